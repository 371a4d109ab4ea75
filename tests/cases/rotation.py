"""Centrifugal loads: rotating discs and tubes against closed forms, and any axis against the same force by formulas."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import blocks  # noqa: E402
import cylinder  # noqa: E402
from dotyk_case import Case, main  # noqa: E402

YOUNG, POISSON, DENSITY, VELOCITY = 200.0, 0.3, 7.8, 0.4
MATERIAL = "&material name='steel', young=%r, poisson=%r, density=%r /" % (YOUNG, POISSON, DENSITY)


def rotating(r, plane_stress):
    """Radial and hoop stress, and radial displacement, of a rotating tube (Timoshenko and Goodier, article 32; in plane
    strain with E/(1 - v^2) and v/(1 - v))."""
    a, b = cylinder.INNER, cylinder.OUTER
    young, v = (YOUNG, POISSON) if plane_stress else (YOUNG / (1 - POISSON**2), POISSON / (1 - POISSON))
    c = (3 + v) / 8 * DENSITY * VELOCITY**2
    radial = c * (a**2 + b**2 - (a * b / r)**2 - r**2)
    hoop = c * (a**2 + b**2 + (a * b / r)**2 - (1 + 3 * v) / (3 + v) * r**2)
    return radial, hoop, r * (hoop - v * radial) / young


class Rotation(Case):
    def tube(self, kind, analysis, n, load):
        """Largest error of the radial displacement, relative, and the estimate over the error in energy."""
        self.write("tube.geo", cylinder.geometry(kind, n, analysis == "axisymmetric"))
        self.write("tube.nml", "\n".join(["&scene analysis='%s', mesh='tube.geo' /" % analysis, MATERIAL,
                                          "&body name='tube', volume='tube', material='steel' /",
                                          *cylinder.held("tube", analysis), "&load body='tube', %s /" % load]) + "\n")
        self.dotyk("tube.nml")
        with self.results("tube.vtkhdf") as file:
            x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
            summary = dict(file["dotyk/summary"].attrs)
        r = x[:, 0] if analysis == "axisymmetric" else np.hypot(x[:, 0], x[:, 1])
        radial = u[:, 0] if analysis == "axisymmetric" else np.sum(u * x, axis=1) / r
        exact = rotating(r, analysis == "plane_stress")[2]
        # Twice the energy is the work of the load: the integral of density w^2 r u over the volume.
        points, weights = np.polynomial.legendre.leggauss(30)
        s = (cylinder.INNER + cylinder.OUTER + (cylinder.OUTER - cylinder.INNER) * points) / 2
        volume = {"axisymmetric": 2 * np.pi * cylinder.HEIGHT, "3d": np.pi / 2 * cylinder.HEIGHT}.get(analysis, np.pi / 2)
        work = volume * np.sum(weights / 2 * (cylinder.OUTER - cylinder.INNER) * DENSITY * VELOCITY**2 * s**2 *
                               rotating(s, analysis == "plane_stress")[2])
        error = np.sqrt(max(1 - summary["energy_norm"]**2 / work, 1e-30))
        return np.max(np.abs(radial - exact)) / np.max(exact), summary["error_discretization"] / error

    def test_floating_ring(self):
        """A ring that nothing holds, with small elements on one side: the centroid of its mesh is beside the axis. Its forces are balanced
        with a line that says so, and the stress at the nodes is that of the closed form; an axis that is really beside it is refused."""
        self.write("ring.geo", """SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, %r}; Disk(2) = {0, 0, 0, %r};
BooleanDifference(3) = {Surface{1}; Delete;}{Surface{2}; Delete;};
Field[1] = MathEval; Field[1].F = "%r*(1 + 0.3*x)"; Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0; Mesh.MeshSizeFromPoints = 0; Mesh.ElementOrder = 2;
Physical Surface("ring") = {3};
""" % (cylinder.OUTER, cylinder.INNER, 0.15 * cylinder.INNER))
        text = "&scene analysis='plane_stress', mesh='ring.geo' /\n%s\n&body name='ring', volume='ring', material='steel' /\n" % MATERIAL
        self.write("ring.nml", text + "&load body='ring', angular_velocity=%r /\n" % VELOCITY)
        self.assertRegex(self.dotyk("ring.nml"), r"warning: 'ring' floats, and its centrifugal forces have a resultant of \S+e-\d+ of")
        with self.results("ring.vtkhdf") as file:
            x, stress = file["VTKHDF/Points"][:], file["VTKHDF/PointData/nodal_stress"][:]
            self.assertLess(file["dotyk/bodies"].attrs["force_error"], 1e-12)
        r = np.hypot(x[:, 0], x[:, 1])
        exact = sum(rotating(r, True)[:2])
        np.testing.assert_allclose(stress[:, 0] + stress[:, 1], exact, atol=0.02 * exact.max())
        self.write("ring.nml", text + "&load body='ring', angular_velocity=%r, centre=%r,0 /\n" % (VELOCITY, 0.01 * cylinder.OUTER))
        self.assertIn("no equilibrium", self.dotyk("ring.nml", code=3))

    def test_tube(self):
        about_z = "angular_velocity=0,0,%r" % VELOCITY
        for kind, analysis, n, load, error in (
                ("quad8", "plane_stress", 6, about_z, 1e-4),
                ("tri6", "plane_strain", 6, "angular_velocity=%r" % -VELOCITY, 4e-4),
                ("quad4", "axisymmetric", 8, "angular_velocity=%r" % VELOCITY, 3e-3),
                ("quad8", "axisymmetric", 4, "angular_velocity=0,%r,0" % VELOCITY, 1e-4),
                ("hex20", "3d", 2, about_z + ", centre=0,0,7", 4e-3)):
            with self.subTest(kind=kind, analysis=analysis):
                found = self.tube(kind, analysis, n, load)
                self.assertLess(found[0], error)
                if analysis == "axisymmetric":  # The mesh is exact.
                    self.assertBetween(0.75, found[1], 1.35)

    def test_any_axis(self):
        """An oblique axis beside a body that is placed and turned: the same as the force by formulas, to rounding."""
        w, c = np.array((0.3, -0.2, 0.5)), np.array((1.0, 2.0, -0.5))
        slope = DENSITY * (w @ w * np.eye(3) - np.outer(w, w))
        formula = ", ".join("'%s'" % " + ".join("(%r)*(%s - (%r))" % (s, axis, at) for s, axis, at in
                                                zip(row.tolist(), "xyz", c.tolist())) for row in slope)
        for kind in "tet4", "tet10", "hex8", "prism15":
            self.write("block.geo", blocks.block_geo(kind, 2))
            found = []
            for load in ("angular_velocity=%s, centre=%s" % tuple(",".join(map(repr, v.tolist())) for v in (w, c)),
                         "force_density_formula=" + formula):
                self.write("block.nml", "&scene mesh='block.geo' /\n%s\n&body name='block', volume='block', "
                           "material='steel', at=3,1,2, axis=1,1,0, angle=25 /\n"
                           "&support body='block', surface='bottom', fix='xyz' /\n&load body='b*', %s /\n"
                           % (MATERIAL, load))
                self.log = self.dotyk("block.nml")
                with self.results("block.vtkhdf") as file:
                    found.append((file["VTKHDF/PointData/displacement"][:],
                                  file["dotyk/summary"].attrs["error_discretization"]))
            np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-12 * np.max(np.abs(found[1][0])))
            self.assertAlmostEqual(found[0][1] / found[1][1], 1, delta=1e-9)

    def test_fit_that_opens(self):
        """A fit loses pressure with speed, as the outer ring widens more than the inner one."""
        overlap = 1e-3
        pressures = []
        for velocity in 0.0, 0.05:
            for body, inner, outer in ("inner", 1.0, 1.5), ("outer", 1.5, 2.2):
                self.write(body + ".geo", cylinder.geometry("quad8", 4, inner=inner, outer=outer))
            lines = ["&scene analysis='plane_stress' /", MATERIAL]
            for body in "inner", "outer":
                lines += ["&body name='%s', mesh='%s.geo', volume='tube', material='steel' /" % (body, body),
                          *cylinder.held(body, "plane_stress")]
            lines += ["&contact name='fit', surface_a='inner:outside', surface_b='outer:inside', gap=%r /" % -overlap,
                      "&load body='*', angular_velocity=%r /" % velocity, "&solver theta=0, tolerance=1e-8 /"]
            self.write("fit.nml", "\n".join(lines) + "\n")
            self.dotyk("fit.nml")
            with self.results("fit.vtkhdf") as file:
                p, w = file["dotyk/contact/fit/pressure_projected"][:], file["dotyk/contact/fit/weight"][:]
                pressures.append(np.sum(w * p) / np.sum(w))

        def widening(a, b, r):
            """Of a rotating ring of the same material, free of pressure."""
            v, c = POISSON, (3 + POISSON) / 8 * DENSITY * 0.05**2
            hoop = c * (a**2 + b**2 + (a * b / r)**2 - (1 + 3 * v) / (3 + v) * r**2)
            radial = c * (a**2 + b**2 - (a * b / r)**2 - r**2)
            return r * (hoop - v * radial) / YOUNG

        compliance = 2 * 1.5**3 * (2.2**2 - 1) / (YOUNG * (1.5**2 - 1) * (2.2**2 - 1.5**2))
        left = overlap + widening(1.0, 1.5, 1.5) - widening(1.5, 2.2, 1.5)
        self.assertBetween(0, left, 0.9 * overlap)
        np.testing.assert_allclose(pressures, [overlap / compliance, left / compliance], rtol=1e-3)

    def refuse(self, message, load, analysis="3d", given=MATERIAL):
        kind = "hex8" if analysis == "3d" else "quad4"
        d = blocks.dimension(kind)
        self.write("block.geo", blocks.block_geo(kind, 1, (0,) * d, (1,) * d))
        self.write("block.nml", "&scene mesh='block.geo', analysis='%s' /\n%s\n&body name='block', volume='block', "
                   "material='steel' /\n&load body='block', %s /\n" % (analysis, given, load))
        self.assertIn("block.nml:4: &load: " + message, self.dotyk("block.nml", code=2))

    def test_messages(self):
        self.refuse("the material 'steel' of body 'block' has no density", "angular_velocity=0,0,1",
                    given="&material name='steel', young=1, poisson=0 /")
        self.refuse("angular_velocity needs 3 values in three dimensions, got 1", "angular_velocity=1")
        self.refuse("angular_velocity needs 1 or 3 values, got 2", "angular_velocity=1,2", "plane_strain")
        self.refuse("angular_velocity must be about z in this analysis", "angular_velocity=0,1,0", "plane_stress")
        self.refuse("angular_velocity must be about y in this analysis", "angular_velocity=0,0,1", "axisymmetric")
        self.refuse("axisymmetric bodies rotate about their axis: remove centre", "angular_velocity=1, centre=0,1",
                    "axisymmetric")
        self.refuse("surface does not go together with angular_velocity", "angular_velocity=0,0,1, surface='top'")
        self.refuse("centre means nothing without angular_velocity", "force_density=0,0,1, centre=0,0,1")
        self.refuse("exactly one of traction, pressure, local_traction, force_density, angular_velocity",
                    "angular_velocity=0,0,1, force_density=0,0,1")


main()
