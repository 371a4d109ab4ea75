#!/usr/bin/python3
"""Bodies that only contact holds, and theta = 0: exact answers by statics, every refusal, and points that say too
much."""
import os
import subprocess

import numpy as np

import dotyk_case
from blocks import KINDS, block_geo, dimension, mesh

YOUNG, POISSON = 200.0, 0.3
ONE_D = (1 + POISSON) * (1 - 2 * POISSON) / (YOUNG * (1 - POISSON))  # uniaxial strain per stress
ROLLERS = {3: "x y".split(), 2: ["x"]}


class Free(dotyk_case.Case):
    """Scenes of blocks, each with a mesh of its own."""

    def block(self, name, kind, n, origin, size, transform=None):
        """Mesh a block; returns its lines of the namelist."""
        geo = self.write(name + ".geo", block_geo(kind, n, origin, size))
        file = mesh(geo, dimension(kind), transform).name if transform else geo.name
        return "&body name='%s', mesh='%s', volume='block', material='m' /\n" % (name, file)

    def scene(self, lines, solver="theta_relative=0, tolerance=1e-8", analysis="3d", young=YOUNG):
        self.write("case.nml", "&scene analysis='%s' /\n&material name='m', young=%r, poisson=%r /\n%s&solver %s /\n"
                   % (analysis, young, POISSON, lines, solver))

    def solve(self, code=0):
        """Run; returns log and results."""
        text = self.dotyk("case.nml", code=code)
        return text, self.results("case.vtkhdf")

    def refuse(self, *parts, code=3):
        done = subprocess.run([os.environ["DOTYK"], "case.nml", "--verbose"], cwd=self.folder, text=True, timeout=60,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        for part in parts:
            self.assertIn(part, done.stderr)
        self.assertEqual([path for path in self.folder.iterdir() if "vtkhdf" in path.name], [])
        if "no equilibrium" in done.stderr:
            # --check tells it before
            self.assertIn("warning: the run will end with exit code 3: " + done.stderr.strip(), self.dotyk("case.nml", "--check"))

    def check_good(self, file, steps=8, bound=1e-8, converged=1):
        """What holds for every solution without penalty."""
        summary = file["dotyk/summary"].attrs
        self.assertEqual(summary["converged"], converged)
        self.assertLessEqual(summary["iterations"], steps)
        self.assertLessEqual(summary["error_bound"], bound)
        for pair in file["dotyk/contact"].values():
            p, gap = pair["pressure"][:], pair["gap"][:]
            self.assertGreaterEqual(p.min(), 0)
            self.assertGreater(gap.min(), -1e-10)
            self.assertLess(np.max(np.minimum(p / max(p.max(), 1e-300), gap)), 1e-10)

    def column(self, kinds, divisions, rollers=True, load="pressure=1", solver="theta_relative=0, tolerance=1e-8",
               transform=None,
               analysis=None):
        """Blocks on top of each other, the lowest on the ground, pressed on top."""
        d = dimension(kinds[0])
        lines = ""
        for k, (kind, n) in enumerate(zip(kinds, divisions)):
            lines += self.block("b%d" % k, kind, n, (0.0,) * (d - 1) + (1.0 * k,), (1.0,) * d, transform)
            if rollers or k == 0:
                lines += "".join("&support body='b%d', surface='sides %s', fix='n' /\n" % (k, axis)
                                 for axis in ROLLERS[d])
            if k > 0:
                lines += "&contact name='joint %d', surface_a='b%d:bottom', surface_b='b%d:top' /\n" % (k, k, k - 1)
        lines += ("&support body='b0', surface='bottom', fix='n' /\n&load body='b%d', surface='top', %s /\n"
                  % (len(kinds) - 1, load))
        self.scene(lines, solver, analysis or ("3d" if d == 3 else "plane_strain"))

    def test_column_of_every_kind(self):
        """Four blocks, three of them free to move along the column: uniform pressure, to rounding."""
        for kind in KINDS:
            with self.subTest(kind):
                self.column([kind] * 4, [2] * 4)
                file = self.solve()[1]
                self.check_good(file)
                d = dimension(kind)
                for pair in file["dotyk/contact"].values():
                    np.testing.assert_allclose(pair["pressure"][:], 1, rtol=1e-9)
                    np.testing.assert_allclose(pair["gap"][:], 0, atol=1e-12)
                    self.assertAlmostEqual(pair.attrs["force"][d - 1], 1, delta=1e-10)
                np.testing.assert_allclose(file["VTKHDF/CellData/stress"][:, d - 1], -1, rtol=1e-9)
                z = file["VTKHDF/Points"][:, d - 1]
                np.testing.assert_allclose(file["VTKHDF/PointData/displacement"][:, d - 1], -ONE_D * z,
                                           atol=1e-9 * 4 * ONE_D)

    def test_every_theta(self):
        """The joint shortens by theta s besides; the same few steps at every theta."""
        for power in (1, 2, 4, 6, 8, 10, None):
            theta = 0 if power is None else 10.0**-power / YOUNG
            self.column(["hex8"] * 3, [2] * 3, solver="theta=%r, tolerance=1e-8" % theta)
            file = self.solve()[1]
            summary = file["dotyk/summary"].attrs
            self.assertLessEqual(summary["iterations"], 8)
            self.assertLessEqual(summary["error_bound"], 1e-8)
            for pair in file["dotyk/contact"].values():
                np.testing.assert_allclose(pair["pressure"][:], 1, rtol=1e-8)
                np.testing.assert_allclose(pair["gap"][:], -theta, atol=1e-11)

    def test_faces_that_do_not_match(self):
        """Pressures of cut facets are good to the quadrature of the means; forces are exact."""
        self.column(["tet10", "hex8", "tet4", "hex20"], [2, 3, 4, 3])
        file = self.solve()[1]
        self.check_good(file)
        for pair in file["dotyk/contact"].values():
            self.assertAlmostEqual(pair.attrs["force"][2], 1, delta=1e-10)
            # The rule of degree 8 does not see where facets are cut: 2 % on meshes of 2 to 4 divisions.
            np.testing.assert_allclose(pair["pressure_projected"][:], 1, atol=0.03)

    def test_sliding_is_not_determined(self):
        """Without walls nothing stops or excites sliding and spinning: least motions, and the log says which."""
        self.column(["hex8"] * 3, [2] * 3, rollers=False)
        text, file = self.solve()
        self.check_good(file)
        # Two bodies that move alike share a part of the line.
        self.assertIn("  not determined by contact: sliding along (1, 0, 0), sliding along (0, 1, 0) and spin about the axis "
                      "(0, 0, 1) of 'b1', 'b2'; least motion taken\n", text)
        # Symmetric about the axis of the column, as the load is: no drift.
        u, x = file["VTKHDF/PointData/displacement"][:], file["VTKHDF/Points"][:]
        for body in (1, 2):
            inside = (x[:, 2] > body + 0.25) & (x[:, 2] < body + 0.75)
            np.testing.assert_allclose(u[inside, :2].mean(axis=0), 0, atol=1e-10)

    def test_tilted_and_shifted(self):
        """The whole scene turned by an odd angle, and far from the origin."""
        axis = np.array([0.36, 0.48, 0.8])
        cross = np.array([[0, -0.8, 0.48], [0.8, 0, -0.36], [-0.48, 0.36, 0]])
        turn = np.eye(3) + np.sin(0.7) * cross + (1 - np.cos(0.7)) * cross @ cross
        np.testing.assert_allclose(turn @ axis, axis, atol=1e-14)
        for shift, tolerance in ((0.0, 1e-9), (1e3, 1e-8)):
            self.column(["tet10", "tet4", "hex8"], [2, 2, 2], transform=lambda x: x @ turn.T + shift)
            file = self.solve()[1]
            self.check_good(file)
            for pair in file["dotyk/contact"].values():
                # From b (above) into a: the force on the upper body points up the column.
                np.testing.assert_allclose(pair.attrs["force"], turn[:, 2], atol=tolerance)

    def test_units_and_order(self):
        """Pascals and metres in other units, bodies and pairs in another order: the same steps and numbers."""
        self.column(["hex8", "tet4", "hex8"], [2, 3, 2])
        one = self.solve()[1]
        text = (self.folder / "case.nml").read_text().splitlines()
        body = [line for line in text if line.startswith("&body")]
        contact = [line for line in text if line.startswith("&contact")]
        rest = [line for line in text if not line.startswith(("&body", "&contact"))]
        self.write("case.nml", "\n".join(rest + body[::-1] + contact[::-1]) + "\n")
        other = self.solve()[1]
        text = "\n".join(text).replace("young=200.0", "young=200.0e9").replace("pressure=1 ", "pressure=1e9 ")
        self.write("case.nml", text + "\n")
        scaled = self.solve()[1]
        for name in ("joint 1", "joint 2"):
            p = one["dotyk/contact"][name]["pressure"][:]
            np.testing.assert_allclose(other["dotyk/contact"][name]["pressure"][:], p, atol=1e-9)
            np.testing.assert_allclose(scaled["dotyk/contact"][name]["pressure"][:] / 1e9, p, atol=1e-9)
        self.assertEqual(one["dotyk/summary"].attrs["iterations"], other["dotyk/summary"].attrs["iterations"])
        self.assertEqual(one["dotyk/summary"].attrs["iterations"], scaled["dotyk/summary"].attrs["iterations"])

    def test_axisymmetric_disc(self):
        """A disc on a disc, free along the axis; force over the full turn."""
        lines = (self.block("low", "quad4", 3, (0.0, 0.0), (1.0, 1.0)) +
                 self.block("high", "quad4", 4, (0.0, 1.0), (1.0, 1.0)))
        lines += ("&support body='low', surface='bottom', fix='y' /\n&load body='high', surface='top', pressure=2 /\n"
                  "&contact name='joint', surface_a='high:bottom', surface_b='low:top' /\n")
        self.scene(lines, analysis="axisymmetric")
        file = self.solve()[1]
        self.check_good(file)
        self.assertAlmostEqual(file["dotyk/contact/joint"].attrs["force"][1] / (2 * np.pi), 1, delta=1e-10)

    def beam(self, n=6, load="traction_formula='0','-1/4'", more=""):
        """A beam of length 4 on two blocks at its ends, in the plane; nothing else holds it."""
        lines = (self.block("left", "quad8", 2, (0.0, 0.0), (1.0, 1.0)) +
                 self.block("right", "quad8", 2, (3.0, 0.0), (1.0, 1.0)))
        lines += self.block("beam", "quad8", n, (0.0, 1.0), (4.0, 1.0))
        lines += "".join("&support body='%s', surface='bottom', fix='xy' /\n" % name for name in ("left", "right"))
        lines += "&load body='beam', surface='top', %s /\n" % load
        lines += "".join("&contact name='%s', surface_a='%s:top', surface_b='beam:bottom' /\n" % (name, name)
                         for name in ("left", "right"))
        self.scene(lines + more, analysis="plane_strain")

    def test_beam_by_statics(self):
        """Forces and moments of a free body balance: load over x^k with a resultant of 1 off the middle."""
        for load, force, moment in (("traction_formula='0','-1/4'", 1.0, 2.0),
                                    ("traction_formula='0','-x/8'", 1.0, 8 / 3)):
            self.beam(load=load)
            file = self.solve()[1]
            self.check_good(file)
            left, right = file["dotyk/contact/left"], file["dotyk/contact/right"]
            # On the blocks, downwards; flat and straight: the moment of a vertex is that of its force.
            self.assertAlmostEqual(-(left.attrs["force"] + right.attrs["force"])[1], force, delta=1e-10)
            self.assertAlmostEqual(sum(np.sum(pair["weight"][:] * pair["pressure"][:] * pair["position"][:, 0])
                                       for pair in (left, right)), moment, delta=1e-9)

    def test_tipping(self):
        """A load between its supports is carried, one beyond them tips the beam: refused, with the rotation."""
        self.beam(load="traction_formula='0','-max(0,x-3)'")
        self.check_good(self.solve()[1])
        self.beam(load="traction_formula='0','-max(0,x-3)'",
                  more="&load body='beam', surface='sides x', traction_formula='0','-2*(x-2)' /\n")
        (self.folder / "case.vtkhdf").unlink()
        self.refuse("body 'beam'", "rotation about", "a rigid body mode that neither supports nor contact resist")

    def test_refusals(self):
        """Up, and along the joint: no contact can stop it."""
        for load, motion in (("pressure=-1", "translation along (0, 0, 1)"),
                             ("traction=0.1,0,-1", "translation along (1, 0, 0)")):
            self.column(["hex8"] * 2, [2] * 2, rollers=False, load=load)
            self.refuse("body 'b1'", motion, "resultant", "case.nml:")
        # A free body that touches nothing, loaded.
        self.column(["hex8"] * 2, [2] * 2)
        loose = self.block("loose", "hex8", 1, (5.0, 0.0, 0.0), (1.0, 1.0, 1.0))
        text = (self.folder / "case.nml").read_text()
        self.write("case.nml", text + loose + "&load body='loose', force_density=0,0,-1 /\n")
        self.refuse("body 'loose'", "translation along (0, 0, 1)")
        # Unloaded it stays where it is, and the log says so.
        self.write("case.nml", text + loose)
        self.assertIn("any motion of 'loose'; least motion taken", self.solve()[0])

    def test_press_fit_carries_no_torque(self):
        """However small the torque is beside the forces of the fit: they are none that resist it."""
        self.write("fit.geo", """SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, -8, 0, 0, 16, 5};
Cylinder(2) = {0, 0, -4, 0, 0, 8, 9}; Cylinder(3) = {0, 0, -9, 0, 0, 18, 5};
BooleanDifference(4) = { Volume{2}; Delete; }{ Volume{3}; Delete; };
Physical Volume("shaft") = {1}; Physical Volume("hub") = {4};
Physical Surface("end") = Surface In BoundingBox {-6, -6, -8.01, 6, 6, -7.99};
Physical Surface("top") = Surface In BoundingBox {-10, -10, 3.99, 10, 10, 4.01};
Physical Surface("side") = Surface In BoundingBox {-5.1, -5.1, -8.1, 5.1, 5.1, 8.1};
s() = Boundary{ Volume{4}; }; Physical Surface("skin") = {s()};
Mesh.MeshSizeMax = 3;
""")
        for torque, code in (0, 0), (2000, 1):
            self.write("case.nml", """&scene mesh='fit.geo' /
&material name='m', young=210e3, poisson=0.3 /
&body name='shaft', volume='shaft', material='m' /
&body name='hub', volume='hub', material='m' /
&support body='shaft', surface='end', fix='xyz' /
&contact name='fit', surface_a='shaft:side', surface_b='hub:skin', gap=-0.01 /
&load body='hub', surface='top', force=0,0,0, moment=0,0,%d /
""" % torque)
            self.dotyk("case.nml", code=code)

    def test_loose_key(self):
        """A key that nothing loads, flush with the bottom of its keyway, gets no force; the hub gives its load on."""
        self.write("key.geo", """SetFactory("OpenCASCADE");
Cylinder(1) = {0,0,-10,0,0,60,20}; Box(10) = {-4,15.5,5,8,10,30};
s() = BooleanDifference{ Volume{1}; Delete; }{ Volume{10}; Delete; };
Cylinder(2) = {0,0,5,0,0,30,38}; Cylinder(11) = {0,0,0,0,0,40,20.05}; Box(12) = {-4.03,0,0,8.06,23.8,40};
h() = BooleanDifference{ Volume{2}; Delete; }{ Volume{11,12}; Delete; };
Box(3) = {-3.98,15.5,5.1,7.96,8,29.8};
Physical Volume("shaft") = {s(0)}; Physical Volume("hub") = {h(0)}; Physical Volume("key") = {3};
Physical Surface("end") = Surface In BoundingBox {-21,-21,-10.1,21,21,-9.9};
Physical Surface("side") = Surface In BoundingBox {-39,-39,4.9,39,39,35.1};
Mesh.MeshSizeMax = 7; Mesh.ElementOrder = 2;
""")
        self.write("case.nml", """&scene mesh='key.geo' /
&material name='m', young=210e3, poisson=0.3 /
&body name='shaft', volume='shaft', material='m' /
&body name='hub', volume='hub', material='m' /
&body name='key', volume='key', material='m' /
&support body='shaft', surface='end', fix='xyz' /
&support body='hub', surface='side', fix='z' /
&load body='hub', surface='side', force=0,500,0, point=0,0,20 /
&contact auto=.true. /
""")
        self.dotyk("case.nml")
        contact = self.results("case.vtkhdf")["dotyk/contact"]
        force = {name: contact[name].attrs["force"] for name in contact}
        self.assertAlmostEqual(abs(force["shaft - hub"][1]), 500, delta=1e-4)
        self.assertLess(max(abs(force[name]).max() for name in force if "key" in name), 1e-4)

    def test_balanced_loads(self):
        """A column that leans, its upper block free across: rounding errors of the pressure's direction push it
        nowhere."""
        self.column(["quad8"] * 2, [3] * 2)
        text = (self.folder / "case.nml").read_text()
        text = text.replace("material='m' /", "material='m', angle=33 /")
        text = text.replace("&support body='b1', surface='sides x', fix='n'",
                            "&support body='b1', surface='sides x', fix='t'")
        self.write("case.nml", text)
        printed, file = self.solve()
        self.check_good(file)
        self.assertRegex(printed, "not determined by contact: sliding along .* of 'b1'; least motion taken")

    def test_a_scheme_that_needs_more(self):
        self.column(["hex8"] * 2, [2] * 2, solver="scheme='neumann'")
        self.refuse("scheme 'neumann' needs supported bodies", "body 'b1'", "translation along (0, 0, 1)",
                    "scheme='dual'")
        self.column(["hex8"] * 2, [2] * 2, solver="scheme='robin', theta=0")
        self.refuse("case.nml:", "theta = 0 of &solver needs scheme='dual', got 'robin'", code=2)

    def test_pushed_away(self):
        """A support pushes a block that nothing else holds: it moves along without any force."""
        self.column(["hex8"] * 2, [2] * 2)
        text = (self.folder / "case.nml").read_text()
        text = text.replace("&load body='b1', surface='top', pressure=1 /",
                            "&support body='b1', surface='top', fix='z', value=0,0,-0.1 /")
        self.write("case.nml", text.replace("&support body='b0', surface='bottom', fix='n' /", ""))
        file = self.solve()[1]
        self.check_good(file)
        np.testing.assert_allclose(file["dotyk/contact/joint 1/pressure"][:], 0, atol=1e-9 * YOUNG)
        np.testing.assert_allclose(file["VTKHDF/PointData/displacement"][:, 2].max(), -0.1, atol=1e-9)

    def test_pulled_away(self):
        """Held and pressed into each other to begin with, then pulled apart: open everywhere."""
        self.column(["hex8"] * 2, [2] * 2)
        text = (self.folder / "case.nml").read_text().replace("surface_b='b0:top'", "surface_b='b0:top', gap=-0.01")
        self.write("case.nml", text.replace("&load body='b1', surface='top', pressure=1 /",
                                            "&support body='b1', surface='top', fix='z', value=0,0,0.1 /"))
        file = self.solve()[1]
        self.check_good(file)
        np.testing.assert_array_equal(file["dotyk/contact/joint 1/pressure"][:], 0)
        np.testing.assert_allclose(file["dotyk/contact/joint 1/gap"][:], 0.09, atol=1e-12)

    def test_falls_until_it_touches(self):
        """Free blocks with wide gaps between them: they fall, by the gaps, and then bear the load."""
        self.column(["hex8"] * 3, [2] * 3)
        text = (self.folder / "case.nml").read_text().replace(":top' /", ":top', gap=0.25 /")
        self.write("case.nml", text)
        file = self.solve()[1]
        self.check_good(file)
        u, x = file["VTKHDF/PointData/displacement"][:, 2], file["VTKHDF/Points"][:, 2]
        self.assertAlmostEqual(u[x > 2.999].mean(), -0.5 - 3 * ONE_D, delta=1e-9)

    def test_chain(self):
        """Ten blocks that only hold each other."""
        self.column(["hex8"] * 10, [1] * 10)
        file = self.solve()[1]
        self.check_good(file)
        for pair in file["dotyk/contact"].values():
            np.testing.assert_allclose(pair["pressure"][:], 1, rtol=1e-9)

    def test_on_two_blocks(self):
        """One face on two blocks, side by side: vertices of the seam are in both pairs. The sides of the two are in no
        pair, and press into each other."""
        lines = self.block("left", "hex8", 2, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
        lines += self.block("right", "hex8", 2, (1.0, 0.0, 0.0), (1.0, 1.0, 1.0))
        lines += self.block("high", "hex8", 4, (0.0, 0.0, 1.0), (2.0, 1.0, 1.0))
        lines += "".join("&support body='%s', surface='bottom', fix='xyz' /\n" % name for name in ("left", "right"))
        for side in ("left", "right"):
            lines += "&contact name='%s', surface_a='high:bottom', surface_b='%s:top' /\n" % (side, side)
        # Points of the seam say the same thing twice: the bound is the root of what rounding leaves, 1.5e-8.
        self.scene(lines + "&load body='high', surface='top', pressure=1 /\n",
                   solver="theta_relative=0, tolerance=1e-7")
        text, file = self.solve(code=1)
        self.assertRegex(text, r"penetration +'(left|right)' is inside '(left|right)' by 0\.0015")
        self.check_good(file, bound=1e-7, converged=0)
        for side in ("left", "right"):
            self.assertAlmostEqual(file["dotyk/contact"][side].attrs["force"][2], 1, delta=1e-9)

    def test_pair_given_twice(self):
        """The same contact named twice counts once."""
        self.column(["hex8"] * 2, [3] * 2)
        text = (self.folder / "case.nml").read_text()
        self.write("case.nml", text + "&contact name='twin', surface_a='b1:bottom', surface_b='b0:top' /\n")
        text, file = self.solve()
        self.assertIn("same contact     'twin'", text)
        self.check_good(file)
        self.assertEqual(list(file["dotyk/contact"]), ["joint 1"])
        np.testing.assert_allclose(file["dotyk/contact/joint 1/pressure"][:], 1, rtol=1e-9)

    def test_supports_on_the_contact_surface(self):
        """Held on both sides points cannot give way: harmless where they just touch, refused where they are pressed."""
        self.column(["hex8"] * 2, [2] * 2)
        held = "".join("&support body='b%d', surface='%s', fix='xyz' /\n" % (k, s)
                       for k, s in ((0, "top"), (1, "bottom")))
        text = (self.folder / "case.nml").read_text() + held
        self.write("case.nml", text)
        self.check_good(self.solve()[1])
        (self.folder / "case.vtkhdf").unlink()
        self.write("case.nml", text.replace("surface_b='b0:top'", "surface_b='b0:top', gap=-0.01"))
        self.refuse("joint 1", "theta = 0", "prescribed displacements of both bodies make the surfaces overlap")
        # Without matrices, too.
        pressed = text.replace("surface_b='b0:top'", "surface_b='b0:top', gap=-0.01")
        self.write("case.nml", pressed.replace("tolerance=", "linear_solver='iterative', tolerance="))
        self.refuse("joint 1", "theta = 0", "prescribed displacements of both bodies make the surfaces overlap")
        # With a layer the same scene has a solution: p = 0.01/theta.
        self.write("case.nml", text.replace("surface_b='b0:top'", "surface_b='b0:top', gap=-0.01, theta=0.1"))
        np.testing.assert_allclose(self.solve()[1]["dotyk/contact/joint 1/pressure"][:], 0.1, rtol=1e-9)

    def test_quadrature_points_without_a_layer(self):
        """More points than unknowns: forces and means are right, and the log says that single pressures are not
        determined."""
        # The bound of redundant rows is that of rounding errors to the power 1/2: 1e-8.
        self.column(["hex8"] * 2, [3] * 2, solver="theta_relative=0, tolerance=1e-6")
        text = (self.folder / "case.nml").read_text()
        self.write("case.nml", text.replace("surface_b='b0:top'", "surface_b='b0:top', discretization='quadrature'"))
        log, file = self.solve()
        self.assertIn("the pressures at single quadrature points oscillate", log)
        self.assertAlmostEqual(file["dotyk/contact/joint 1"].attrs["force"][2], 1, delta=1e-9)
        self.write("case.nml", text)
        self.assertNotIn("oscillate", self.solve()[0])

    def test_linear_solvers_agree(self):
        """Conjugate gradients and the factorization, free bodies and theta = 0."""
        energies = []
        for solver in ("direct", "iterative"):
            self.column(["tet10", "hex8", "tet4"], [2, 3, 3],
                        solver="theta_relative=0, tolerance=1e-8, linear_solver='%s'" % solver)
            file = self.solve()[1]
            self.check_good(file)
            energies.append(file["dotyk/summary"].attrs["energy"])
        self.assertAlmostEqual(energies[0] / energies[1], 1, delta=1e-10)

    def test_schemes_agree(self):
        """All schemes on held bodies: energies as near as both bounds say."""
        found = {}
        for scheme in ("dual", "neumann", "robin"):
            self.column(["hex8", "tet4"], [2, 3], solver="scheme='%s', theta_relative=1e-1, tolerance=1e-6" % scheme)
            text = (self.folder / "case.nml").read_text()
            self.write("case.nml", text.replace("&load body='b1', surface='top', pressure=1 /",
                                                "&support body='b1', surface='top', fix='z', value=0,0,-0.01 /"))
            summary = self.solve()[1]["dotyk/summary"].attrs
            self.assertEqual(summary["converged"], 1)
            found[scheme] = summary["energy"], summary["error_bound"]
        energy, bound = found["dual"]
        for scheme, (other, other_bound) in found.items():
            # F is quadratic about its minimum: 1/2 (1 + L) ||u - u*||^2 with ||u||_A^2 about 2 F, and L below 1e3 here.
            self.assertLess(abs(other / energy - 1), 1e3 * (bound + other_bound)**2 + 1e-12, scheme)


if __name__ == "__main__":
    dotyk_case.main()
