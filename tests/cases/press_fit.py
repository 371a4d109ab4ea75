#!/usr/bin/python3
"""Press fit of two tubes, plane strain, quadratic and linear elements, against Lame's pressure (a quarter of them is
computed)."""
import numpy as np

import dotyk_case

A, B, C = 1.0, 1.5, 2.2  # radii: bore, joint, outside
YOUNG, POISSON = 200.0, 0.3
INTERFERENCE = 1e-3
THETA = 1e-5


def tube_geo(inner, outer, radial, around, order=2, incomplete=1):
    """A quarter of a tube, quadrilaterals."""
    return """
Mesh.ElementOrder = %d;  Mesh.SecondOrderIncomplete = %d;
Point(1) = {%r, 0, 0};
line() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };
ring() = Extrude { {0, 0, 1}, {0, 0, 0}, Pi/2 } { Curve{line(1)}; Layers{%d}; Recombine; };
Physical Surface("tube") = {ring(1)};
Physical Curve("inside") = {Abs(ring(3))};
Physical Curve("outside") = {Abs(ring(2))};
Physical Curve("plane y") = {line(1)};
Physical Curve("plane x") = {ring(0)};
""" % (order, incomplete, inner, outer - inner, radial, around)


class PressFit(dotyk_case.Case):
    SHRINK = 5e-3  # of a pin in a lever

    def fit(self, overlap, contact, around=(12, 12), analysis="plane_strain", order=2):
        """Solve; the inner tube is larger by `overlap`. Returns results, and Lame's pressure with the compliance of the
        layer."""
        self.write("inner.geo", tube_geo(A, B + overlap, 3, around[0], order))
        self.write("outer.geo", tube_geo(B, C, 4, around[1], order))
        lines = ["&scene analysis='%s' /" % analysis,
                 "&material name='steel', young=%r, poisson=%r /" % (YOUNG, POISSON)]
        for body in ("inner", "outer"):
            lines += ["&body name='%s', mesh='%s.geo', volume='tube', material='steel' /" % (body, body),
                      "&support body='%s', surface='plane x', fix='x' /" % body,
                      "&support body='%s', surface='plane y', fix='y' /" % body]
        lines += ["&contact name='fit', surface_a='inner:outside', surface_b='outer:inside' %s /" % contact,
                  "&solver theta=%r, tolerance=1e-6 /" % THETA]
        self.write("fit.nml", "\n".join(lines) + "\n")
        self.dotyk("fit.nml")
        stiffness = YOUNG / (1 - POISSON**2) if analysis == "plane_strain" else YOUNG
        # s = p (compliance of both tubes + theta)
        compliance = 2 * B**3 * (C**2 - A**2) / (stiffness * (B**2 - A**2) * (C**2 - B**2))
        return self.results("fit.vtkhdf"), INTERFERENCE / (compliance + THETA)

    def check(self, file, pressure, tolerance, local):
        """The pressure in the mean, and at single points."""
        fit = file["dotyk/contact/fit"]
        w, p = fit["weight"][:], fit["pressure_projected"][:]
        self.assertAlmostEqual(np.sum(w * p) / np.sum(w) / pressure, 1, delta=tolerance)
        np.testing.assert_allclose(p, pressure, rtol=local)
        # The quarter is pushed along the diagonal by p times the projected length, the radius of surface_a.
        radius = np.sum(w) / (np.pi / 2)
        np.testing.assert_allclose(np.abs(fit.attrs["force"]), [pressure * radius, pressure * radius, 0],
                                   rtol=2 * tolerance, atol=1e-12)

    def test_given_interference(self):
        """Matching meshes: the error is that of arcs of 7.5 degrees by parabolas."""
        file, pressure = self.fit(0.0, ", gap=-%r" % INTERFERENCE)
        self.check(file, pressure, 1e-4, 1e-4)
        # Radial displacement on the bore, from Lame: u = -2 p a b^2/((b^2-a^2) E')
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        r = np.hypot(x[:, 0], x[:, 1])
        bore = np.abs(r - A) < 1e-9
        radial = np.sum(x * u, axis=1)[bore] / r[bore]
        exact = -2 * pressure * A * B**2 / ((B**2 - A**2) * YOUNG / (1 - POISSON**2))
        np.testing.assert_allclose(radial, exact, rtol=2e-3)

    def test_plane_stress(self):
        file, pressure = self.fit(0.0, ", gap=-%r" % INTERFERENCE, analysis="plane_stress")
        self.check(file, pressure, 1e-4, 1e-4)

    def test_overlapping_geometry(self):
        """The overlap is meshed: the geometry is linear theory's but for s/b = 7e-4."""
        file, pressure = self.fit(INTERFERENCE, "")
        gap = file["dotyk/contact/fit/gap_initial"][:]
        np.testing.assert_allclose(gap, -INTERFERENCE, rtol=1e-2)
        self.check(file, pressure, 3e-4, 1e-3)

    def test_ends_of_overlapping_arcs(self):
        """Along the mean normal of the last facet of surface_a, surface_b ends s h/(2R) too early: the last row would
        weigh less by s/R and have so much more pressure."""
        overlap = 10 * INTERFERENCE
        for around in ((12, 12), (17, 20)):
            file, _ = self.fit(overlap, "", around=around)
            fit = file["dotyk/contact/fit"]
            self.assertAlmostEqual(np.sum(fit["weight"][:]) / (np.pi / 2 * (B + overlap)), 1, delta=2e-5)
            p = fit["pressure"][:]
            np.testing.assert_allclose(p, np.median(p), rtol=0.2 * overlap / B)

    def test_not_matching(self):
        """Chords of other lengths: 2e-2 at single points."""
        file, pressure = self.fit(0.0, ", gap=-%r" % INTERFERENCE, around=(13, 10))
        self.check(file, pressure, 1e-4, 2e-2)

    def test_linear_elements(self):
        """Chords of 13 and 10 elements are up to 2.7e-3 and 4.6e-3 from the arc, more than the overlap of 1e-3: by
        themselves they give three times the pressure; with patches over them its error is that of linear elements."""
        file, pressure = self.fit(INTERFERENCE, "", around=(13, 10), order=1)
        self.check(file, pressure, 8e-3, 2e-2)
        np.testing.assert_allclose(file["dotyk/contact/fit/gap_initial"][:], -INTERFERENCE, rtol=2e-3)
        file, pressure = self.fit(INTERFERENCE, ", geometry='elements'", around=(13, 10), order=1)
        fit = file["dotyk/contact/fit"]
        self.assertGreater(np.average(fit["pressure_projected"][:], weights=fit["weight"][:]), 2 * pressure)

    def test_linear_elements_given_interference(self):
        file, pressure = self.fit(0.0, ", gap=-%r" % INTERFERENCE, around=(13, 10), order=1)
        self.check(file, pressure, 8e-3, 2e-2)

    def test_one_layer_along_the_axis(self):
        """Bricks, one of them along the axis: two layers of vertices tell no curvature from a slope."""
        for name, inner, outer, around in (("inner", A, B + INTERFERENCE, 13), ("outer", B, C, 16)):
            self.write(name + ".geo", tube_geo(inner, outer, 4, around, 1) + """
solid[] = Extrude {0, 0, 1.2} { Surface{ring(1)}; Layers{1}; Recombine; };
Physical Volume("tube 3d") = {solid(1)};
Physical Surface("ends") = {ring(1), solid(0)};
Physical Surface("x 3d") = Surface In BoundingBox{-1e-3, -1e-3, -1e-3, 1e-3, 9, 9};
Physical Surface("y 3d") = Surface In BoundingBox{-1e-3, -1e-3, -1e-3, 9, 1e-3, 9};
Physical Surface("in 3d") = Surface In BoundingBox{-1e-3, -1e-3, -1e-3, %r, %r, 9};
""" % (inner + 1e-3, inner + 1e-3))
        lines = ["&scene /", "&material name='steel', young=%r, poisson=%r /" % (YOUNG, POISSON)]
        for body in ("inner", "outer"):
            lines += ["&body name='%s', mesh='%s.geo', volume='tube 3d', material='steel' /" % (body, body)]
            lines += ["&support body='%s', surface='%s', fix='n' /" % (body, plane) for plane in ("ends", "x 3d", "y 3d")]
        lines += ["&contact auto=.true. /", "&solver theta=0, tolerance=1e-6 /"]
        self.write("fit.nml", "\n".join(lines) + "\n")
        self.dotyk("fit.nml")
        stiffness = YOUNG / (1 - POISSON**2)
        pressure = INTERFERENCE * stiffness * (B**2 - A**2) * (C**2 - B**2) / (2 * B**3 * (C**2 - A**2))
        (fit,) = self.results("fit.vtkhdf")["dotyk/contact"].values()
        np.testing.assert_allclose(np.abs(fit.attrs["force"]), [pressure * B * 1.2, pressure * B * 1.2, 0],
                                   atol=0.02 * pressure * B)

    def rings(self, support, more):
        """A whole ring shrunk on a hollow shaft: mean pressure by Lame's, and the pressures. The meshes are unstructured,
        so that the axis of the contact is beside the centres of the bodies."""
        lines = ['SetFactory("OpenCASCADE");', "Mesh.MeshSizeMax = 10; Mesh.MeshSizeFromCurvature = 24; Mesh.ElementOrder = 2; Mesh.HighOrderOptimize = 2;"]
        for number, name, inner, outer in (1, "shaft", 10, 20), (2, "ring", 20, 40):
            lines += ["Cylinder(%d) = {0, 0, 0, 0, 0, 20, %d}; Cylinder(%d) = {0, 0, 0, 0, 0, 20, %d};"
                      % (number, outer, number + 10, inner),
                      "BooleanDifference(%d) = { Volume{%d}; Delete; }{ Volume{%d}; Delete; };"
                      % (number + 20, number, number + 10),
                      'Physical Volume("%s") = {%d};' % (name, number + 20)]
        lines += ['Physical Surface("low") = Surface In BoundingBox {-50, -50, -0.1, 50, 50, 0.1};',
                  'Physical Surface("joint") = Surface In BoundingBox {-20.1, -20.1, -0.1, 20.1, 20.1, 20.1};', ""]
        self.write("rings.geo", "\n".join(lines))
        self.write("rings.nml", """&scene mesh='rings.geo' /
&material name='steel', young=210e3, poisson=0.3 /
&body name='shaft', volume='shaft', material='steel' /
&body name='ring', volume='ring', material='steel' /
&contact name='fit', surface_a='shaft:joint', surface_b='ring:joint', gap=-0.024 /
%s
%s
""" % ("&support body='ring', surface='low', fix='z' /\n&support body='shaft', surface='low', fix='%s' /" % support if support else "", more))
        log = self.dotyk("rings.nml")
        self.assertRegex(log, r"not determined by contact: (.*spin about the axis \(0, 0, 1\)|any motion of 'shaft', 'ring')")
        pairs = list(self.results("rings.vtkhdf")["dotyk/contact"].values())
        x, w, p = (np.concatenate([pair[name][:] for pair in pairs]) for name in ("position", "weight", "pressure"))
        lame = 0.024 / (2 * 20.0**3 * (40**2 - 10**2) / (210e3 * (20**2 - 10**2) * (40**2 - 20**2)))
        return np.sum(w * p) / np.sum(w) / lame, {tuple(np.round(x, 6) + 0.0): p for x, p in zip(x, p)}

    def test_rings_that_float_together(self):
        """Held along the axis alone, they may move together across it, and spin."""
        mean, _ = self.rings("z", "")
        self.assertAlmostEqual(mean, 1, delta=0.01)

    def test_rings_that_nothing_holds(self):
        """Without any support both bodies keep their common motions, and nothing is out of balance but by the mesh."""
        mean, _ = self.rings("", "")
        self.assertAlmostEqual(mean, 1, delta=0.01)
        self.assertLess(self.results("rings.vtkhdf")["dotyk/summary"].attrs["error_bound"], 1e-8)

    def test_ring_on_a_cut_shaft(self):
        """The ring may spin on the shaft, which is held. A cut by a bolt that is not tightened changes nothing."""
        _, whole = self.rings("xyz", "")
        _, cut = self.rings("xyz", "&bolt name='cut', body='shaft', point=0,0,11, normal=0,0,1, shortening=0 /")
        self.assertEqual(cut.keys(), whole.keys())
        for place, pressure in whole.items():
            # Rows of both halves at the cut know the axis that is held to that.
            self.assertAlmostEqual(cut[place] / pressure, 1, delta=1e-5, msg=place)

    def lever(self, arm, lines, dimension=3, code=0):
        """A lever with an eye of radius 1, or a ring where it has no arm, on a pin larger by `SHRINK`; the nodes of pin and
        eye do not meet. Returns the largest displacement, and the pressures by nodes."""
        geo = """SetFactory("OpenCASCADE");
Mesh.MeshSizeMax = 0.5; Mesh.ElementOrder = 2; Mesh.HighOrderOptimize = 2;
Disk(1) = {0, 0, 0, 1.5}; Rectangle(2) = {0, -0.5, 0, %r, 1};
BooleanUnion(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Disk(4) = {0, 0, 0, 1};
BooleanDifference(5) = { Surface{3}; Delete; }{ Surface{4}; Delete; };
eye[] = Curve In BoundingBox {-1.01, -1.01, -0.1, 1.01, 1.01, 0.1};
Transfinite Curve{eye[]} = 18;
Disk(6) = {0, 0, 0, %r}; Disk(7) = {0, 0, 0, 0.4};
BooleanDifference(8) = { Surface{6}; Delete; }{ Surface{7}; Delete; };
pin[] = Boundary{ Surface{8}; };
Transfinite Curve{Abs(pin[0])} = 21;
""" % (arm, 1 + self.SHRINK)
        if dimension == 3:
            geo += """Extrude {0, 0, 1} { Surface{5}; Layers{2}; }
Extrude {0, 0, 1} { Surface{8}; Layers{2}; }
pin[] = Volume In BoundingBox {-1.02, -1.02, -1, 1.02, 1.02, 2};
lever[] = Volume{:}; lever[] -= pin[];
Physical Volume("lever") = {lever[]}; Physical Volume("pin") = {pin[]};
bore[] = Surface In BoundingBox {-0.41, -0.41, -0.1, 0.41, 0.41, 1.1};
low[] = Surface In BoundingBox {-10, -10, -0.1, 10, 10, 0.1};
joint[] = Surface In BoundingBox {-1.02, -1.02, -0.1, 1.02, 1.02, 1.1};
joint[] -= bore[]; joint[] -= low[]; joint[] -= Surface In BoundingBox {-10, -10, 0.9, 10, 10, 1.1};
Physical Surface("joint") = {joint[]}; Physical Surface("bore") = {bore[]}; Physical Surface("low") = {low[]};
Physical Surface("tip") = Surface In BoundingBox {7.9, -1.01, -0.1, 8.1, 1.01, 1.1};
"""
        else:
            geo += """Physical Surface("lever") = {5}; Physical Surface("pin") = {8};
joint[] = Curve In BoundingBox {-1.02, -1.02, -0.1, 1.02, 1.02, 0.1};
joint[] -= Curve In BoundingBox {-0.41, -0.41, -0.1, 0.41, 0.41, 0.1};
Physical Curve("joint") = {joint[]};
"""
        self.write("lever.geo", geo)
        self.write("lever.nml", """&scene mesh='lever.geo' %s /
&material name='steel', young=210e3, poisson=0.3 /
&body name='pin', volume='pin', material='steel' /
&body name='lever', volume='lever', material='steel' /
&contact name='fit', surface_a='pin:joint', surface_b='lever:joint' /
%s
""" % ("" if dimension == 3 else ", analysis='plane_strain'", "\n".join(lines)))
        log = self.dotyk("lever.nml", code=code)
        file = self.results("lever.vtkhdf")
        u = file["VTKHDF/PointData/displacement"][:]
        return np.max(np.linalg.norm(u, axis=1)), file["dotyk/contact/fit/pressure"][:], log

    def test_swing_of_a_lever(self):
        """A lever whose centroid is far from the axis may swing on its pin. The mesh alone drives it, by 0.7 where the
        swing is not held; a support against the swing carries nothing."""
        held = ["&support body='pin', surface='bore', fix='xyz' /", "&support body='lever', surface='low', fix='z' /"]
        largest, pressure, log = self.lever(8.0, held)
        self.assertRegex(log, r"not determined by contact: (rocking|spin) about the axis \(0, 0, 1\) .* of 'lever'; least motion taken")
        of_twin, pressure_of_twin, _ = self.lever(8.0, held + ["&support body='lever', surface='tip', fix='y' /"])
        self.assertLess(of_twin, self.SHRINK)
        # What the mesh excites is 1e-6 of the contact forces, wherever it is held.
        self.assertAlmostEqual(largest / of_twin, 1, delta=1e-3)
        np.testing.assert_allclose(pressure, pressure_of_twin, rtol=1e-5)

    def test_lever_and_pin_without_supports(self):
        """The two have all motions but the swing in common: pressures are those of a pin on weak springs, but for the swing
        that the mesh excites."""
        held = ["&support body='pin', surface='bore', fix='xyz' /", "&support body='lever', surface='low', fix='z' /"]
        bore = ["&spring body='pin', surface='bore', fix='xyz', modulus=1e-3 /"]
        _, pressure, _ = self.lever(8.0, [])
        np.testing.assert_allclose(pressure, self.lever(8.0, bore)[1], rtol=2e-3)
        self.assertGreater(np.max(np.abs(pressure / self.lever(8.0, held)[1] - 1)), 1e-3)

    def test_load_that_nothing_resists(self):
        """A moment about the pin on a lever that may swing, however small it is beside the contact forces, swings it far
        beyond small rotations: no solution."""
        held = ["&support body='pin', surface='bore', fix='xyz' /", "&support body='lever', surface='low', fix='z' /"]
        force = 2 * np.pi * np.mean(self.lever(8.0, held)[1])
        for part in 0.05, 0.005, 0.0005:
            with self.subTest(part=part):
                load = "&load body='lever', surface='tip', force=0,%r,0 /" % (part * force)
                self.assertIn("'lever' rotates by", self.lever(8.0, held + [load], code=1)[2])

    def test_rigid_ring_held_beside_its_axis(self):
        """A pin in a rigid ring that may rotate about a point beside the pin: the ring has no spin of its own, and the two
        keep the rotation that they have in common. Pressures know what the mesh excites, 1e-6 of the contact forces."""
        held = "&rigid_body body='lever', fix='%s', point=0,%r /"
        of_twin, pressure_of_twin, _ = self.lever(1.2, [held % ("x y rz", 0.0)], dimension=2)
        for distance in (8.0, 2.0):
            largest, pressure, _ = self.lever(1.2, [held % ("x", distance)], dimension=2)
            self.assertLess(largest, 1.1 * self.SHRINK)
            np.testing.assert_allclose(pressure, pressure_of_twin, rtol=1e-5)


dotyk_case.main()
