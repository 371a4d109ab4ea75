#!/usr/bin/python3
"""Springs on surfaces, weight and point masses: blocks and beams on Winkler foundations against exact solutions."""
import numpy as np

import dotyk_case
from blocks import block_geo, dimension

SOLVER = "&solver theta=0, tolerance=1e-10 /"
YOUNG = 200.0
SIZE, ORIGIN = (1.0, 1.5, 2.0), (1.0, 2.0, 3.0)


class Springs(dotyk_case.Case):
    def run_scene(self, lines, analysis="3d", poisson=0.0, code=0):
        self.write("case.nml", "\n".join(["&scene analysis='%s' /" % analysis,
                                          "&material name='steel', young=%r, poisson=%r, density=2 /" % (YOUNG, poisson),
                                          *lines]) + "\n")
        return self.dotyk("case.nml", code=code)

    def block(self, kind, n=2, name="block", more="", origin=ORIGIN, size=SIZE):
        d = dimension(kind)
        self.write(name + ".geo", block_geo(kind, n, origin[:d], (*size[:d - 1], size[2])))
        return "&body name='%s', mesh='%s.geo', volume='block', material='steel' %s /" % (name, name, more)

    def fields(self):
        """Results of the program, positions, displacements."""
        file = self.results("case.vtkhdf")
        x = file["VTKHDF/Points"][:]
        return file, x, file["VTKHDF/PointData/displacement"][:]

    def check_block(self, kind, spring, load, sigma, bend, settlement=0.0, modulus=50.0, solver=SOLVER, analysis=None):
        """A column on springs along all axes with the stress sigma + bend*(x - middle) and without Poisson's ratio:
        its bottom stays plane and sinks by stress over modulus."""
        d = dimension(kind)
        analysis = analysis or ("3d" if d == 3 else "plane_strain")
        self.run_scene([self.block(kind), "&spring body='block', surface='bottom', %s /" % spring,
                        "&load body='block', surface='top', %s /" % load, solver], analysis)
        file, x, u = self.fields()
        up, across = d - 1, x[:, 0] - ORIGIN[0] - SIZE[0] / 2
        x[:, up] -= ORIGIN[up]
        exact = np.zeros(u.shape)
        exact[:, up] = (sigma + bend * across) * (x[:, up] / YOUNG + 1 / modulus) + settlement
        exact[:, 0] = -bend * x[:, up] * (x[:, up] / (2 * YOUNG) + 1 / modulus)
        np.testing.assert_allclose(u, exact, atol=1e-9 * np.abs(exact).max())
        return file["dotyk"]

    def test_block(self):
        """Uniform and eccentric loads: exact, by factors and by p-multigrid, per area and in total."""
        area, inertia = 1.5, 1.5 / 12
        total = "fix='xyz', stiffness=%r" % (50 * area)
        for kind, spring, solver in (("hex20", "fix='xyz', modulus=50", SOLVER), ("tet10", total, SOLVER),
                                     ("hex27", "fix='nt', modulus=50", "&solver theta=0, response='multigrid' /")):
            with self.subTest(kind):
                own = self.check_block(kind, spring, "force=0,0,-3, moment=0,0.4,0", -3 / area, -0.4 / inertia,
                                       solver=solver)
                # Springs are tractions for the error estimate.
                self.assertLess(own["summary"].attrs["error_discretization"], 1e-8)
        own = self.check_block("quad8", "fix='xy', modulus=50", "force=0,-3, moment=0.4", -3, 0.4 * 12)
        bodies = own["bodies"]
        self.assertLess(own["bodies"].attrs["force_error"], 1e-12)
        self.assertLess(own["bodies"].attrs["moment_error"], 1e-12)
        np.testing.assert_allclose(own["supports/force"][:], [(0, 3, 0)], atol=1e-11)
        # Of the springs: int sigma^2/(2 k) dA.
        self.assertAlmostEqual(bodies["spring_energy"][0], (9 + 4.8**2 / 12) / 100, delta=1e-11)
        self.assertAlmostEqual(bodies["spring_energy"][0] + bodies["strain_energy"][0],
                               own["summary"].attrs["strain_energy"], delta=1e-10)

    def test_far_ends(self):
        """Far ends that move take the body along without stress, and count as supports, not as loads."""
        own = self.check_block("quad9", "fix='xi n', modulus=50, value=0,0.25", "force=0,-3", -3, 0, settlement=-0.25)
        np.testing.assert_allclose(own["bodies/load_force"][:], [(0, -3, 0)], atol=1e-12)
        np.testing.assert_allclose(own["bodies/reaction_force"][:], [(0, 3, 0)], atol=1e-11)

    def test_axisymmetric(self):
        """The stiffness is that of the full circumference."""
        kind, area = "quad8", np.pi * (2.0**2 - 1)
        self.run_scene([self.block(kind), "&spring body='block', surface='bottom', fix='y', stiffness=%r /" % (50 * area),
                        "&load body='block', surface='top', force=0,%r /" % (-3 * area), SOLVER], "axisymmetric", 0.3)
        file, x, u = self.fields()
        np.testing.assert_allclose(u[:, 1], -3 * ((x[:, 1] - ORIGIN[1]) / YOUNG + 1 / 50), rtol=1e-9)
        np.testing.assert_allclose(u[:, 0], 3 * 0.3 / YOUNG * x[:, 0], rtol=1e-9)
        np.testing.assert_allclose(file["dotyk/supports/force"][:], [(0, 3 * area, 0)], atol=1e-10)

    def test_layer(self):
        """A layer under the pressure cos(k x) on springs along its normal: by Airy's function, with the order of the
        elements; the estimated error converges, too."""
        k, height, modulus, young, nu = np.pi, 0.5, 300.0, YOUNG / (1 - 0.3**2), 0.3 / 0.7
        # f = (a + b y) cosh(k y) + (c + d y) sinh(k y), the derivatives 0 .. 3 of each term.
        def terms(y):
            rows = []
            for function in (np.cosh, np.sinh):
                other = np.sinh if function is np.cosh else np.cosh
                value = [k**i * (function if i % 2 == 0 else other)(k * y) for i in range(4)]
                rows += [value, [y * value[i] + (i * value[i - 1] if i else 0) for i in range(4)]]
            return np.array(rows)
        def deflection(t):
            return (t[:, 3] - (2 + nu) * k**2 * t[:, 1]) / (k**2 * young)
        low, high = terms(0.0), terms(height)
        amplitude = np.linalg.solve([k**2 * high[:, 0], high[:, 1], low[:, 1],
                                     k**2 * low[:, 0] + modulus * deflection(low)], (1, 0, 0, 0))
        errors, estimates = [], []
        for n in (3, 6):
            self.write("block.geo", block_geo("quad8", (2 * n, n), (0.0, 0.0), (1.0, height)))
            self.run_scene(["&body name='block', mesh='block.geo', volume='block', material='steel' /",
                            "&support body='block', surface='sides x', fix='n' /",
                            "&spring body='block', surface='bottom', fix='n', modulus=%r /" % modulus,
                            "&load body='block', surface='top', pressure_formula='cos(%r*x)' /" % k, SOLVER],
                           "plane_strain", 0.3)
            file, x, u = self.fields()
            exact = []
            for point in x:
                t = terms(point[1])
                exact.append((amplitude @ (t[:, 2] + nu * k**2 * t[:, 0]) / (k * young) * np.sin(k * point[0]),
                              amplitude @ deflection(t) * np.cos(k * point[0]), 0))
            errors.append(np.abs(u - exact).max() / np.abs(exact).max())
            estimates.append(file["dotyk/summary"].attrs["error_discretization"])
        self.assertLess(errors[1], 1e-4)
        self.assertGreater(errors[0] / errors[1], 7)
        self.assertBetween(3.2, estimates[0] / estimates[1], 4.8)

    def test_beam(self):
        """Hetenyi's long beam under a force in its middle: deflection and pressure there, and where it lifts off; shear
        adds little."""
        length, height, modulus = 40.0, 1.0, 0.5
        self.write("block.geo", block_geo("quad8", (160, 2), (0.0, 0.0), (length, height)))
        self.run_scene(["&body name='block', mesh='block.geo', volume='block', material='steel' /",
                        "&support body='block', surface='sides x', fix='x' /",
                        "&spring body='block', surface='bottom', fix='y', modulus=%r /" % modulus,
                        # Half of it: x = 0 is the plane of symmetry.
                        "&load body='block', surface='top', pressure_formula='exp(-x*x/0.32)/0.501326' /", SOLVER],
                       "plane_stress")
        _, x, u = self.fields()
        bottom = x[:, 1] < 1e-9
        beta = (modulus / (4 * YOUNG / 12))**0.25
        along, sunk = x[bottom, 0], -u[bottom, 1]
        exact = 2 * beta / (2 * modulus) * np.exp(-beta * along) * (np.cos(beta * along) + np.sin(beta * along))
        np.testing.assert_allclose(sunk, exact, atol=0.03 * exact.max())

    def test_congruent(self):
        """Copies with and without springs, with other springs, and turned ones whose springs turn with them."""
        lines = []
        for i, spring in enumerate(("fix='nt', modulus=50", "fix='nt', modulus=50", "fix='nt', modulus=25", "")):
            lines.append(self.block("hex20", more=", at=%r,0,0, angle=%r" % (10.0 * i, 90.0 * (i % 2))).replace(
                "name='block'", "name='block %d'" % i))
            lines.append("&spring body='block %d', surface='bottom', %s /" % (i, spring) if spring else
                         "&support body='block %d', surface='bottom', fix='xyz' /" % i)
            lines.append("&load body='block %d', surface='top', force=0,0,-3 /" % i)
        self.run_scene([*lines, SOLVER])
        file, x, u = self.fields()
        n, first = file["VTKHDF/NumberOfPoints"][:], 0
        for count, modulus in zip(n if len(n) > 1 else [len(x) // 4] * 4, (50, 50, 25, np.inf)):
            part = slice(first, first + count)
            first += count
            np.testing.assert_allclose(u[part, 2], -2 * ((x[part, 2] - ORIGIN[2]) / YOUNG + 1 / modulus), atol=1e-10)
        self.assertEqual(first, len(x))

    def test_partly_held(self):
        """Springs along the normal of a plane leave three rigid body modes; those along a sphere none but rotations."""
        for fix, modes in (("n", "sliding along (1, 0, 0), sliding along (0, 1, 0) and spin about the axis"),
                           ("z x", "sliding along (0, 1, 0) of 'block'")):
            printed = self.run_scene([self.block("hex8"), "&spring body='block', surface='bottom', fix='%s', modulus=5 /" % fix,
                                      "&load body='block', surface='top', force=0,0,-3 /", SOLVER])
            self.assertIn("not determined by contact: " + modes, printed)

    def test_mistakes(self):
        """Messages name line and remedy."""
        for spring, message in (("surface='bottom', fix='n'", "one of modulus (per area) and stiffness (total) is needed"),
                                ("surface='bottom', fix='n', modulus=1, stiffness=2", "modulus and stiffness are both given"),
                                ("surface='bottom', fix='n', modulus=-1", "modulus must be above 0, got '-1'"),
                                ("surface='bottom', fix='n', modulus=1, value=1,0,0", "fix does not name xi"),
                                ("surface='bottom', modulus=1", "'fix' is missing"),
                                ("surface='floor', fix='n', modulus=1", "'floor'")):
            with self.subTest(spring):
                printed = self.run_scene([self.block("hex8"), "&spring body='block', %s /" % spring], code=2)
                self.assertIn("case.nml:4: ", printed)
                self.assertIn(message, printed)
        printed = self.run_scene([self.block("hex8"), "&spring body='bl*', surface='floor', fix='n', modulus=1 /"], code=2)
        self.assertIn("case.nml:4: &spring: none of the bodies has such a surface", printed)

    def test_table(self):
        """The log shows area, total stiffness and modulus: a stiffness is that of all surfaces of a wildcard together."""
        printed = self.run_scene([self.block("hex8", size=(1, 2, 2)), "&spring body='block', surface='sides *', fix='xz', stiffness=24 /",
                                  "&spring body='block', surface='bottom', fix='n', modulus=5 /", "&load body='block', surface='top', force=0,0,-3 /"])
        self.assertIn("block:sides *        12, 24 in total along each of x, z, 2 per area", printed)
        self.assertIn("block:bottom         2, 10 in total along n, 5 per area", printed)

    def test_surfaces_on_the_axis(self):
        """A body whose surface is on the axis is left out by wildcards, and refused by its name."""
        geo = ("Point(1) = {%d, 0, 0}; l() = Extrude {1, 0, 0} { Point{1}; Layers{2}; };\n"
               "f() = Extrude {0, 1, 0} { Curve{l(1)}; Layers{2}; Recombine; };\n"
               'Physical Surface("block") = {f(1)}; Physical Curve("inside") = {Abs(f(3)), Abs(f(2))};\n'
               'Physical Curve("bottom") = {l(1)};\n')
        self.write("disc.geo", (geo % 0).replace("Abs(f(3)), Abs(f(2))", "Abs(f(3))"))
        self.write("tube.geo", geo % 1)
        disc, tube = ("&body name='%s', mesh='%s.geo', volume='block', material='steel', at=0,%d /" % (b, b, 2 * (b == "tube")) for b in ("disc", "tube"))
        lines = ["&support body='*', surface='bottom', fix='y' /", "&load body='%s', surface='inside', pressure=1 /"]
        spring = "&spring body='%s', surface='inside', fix='x', modulus=1 /"
        for line in lines[1], spring:
            with self.subTest(line=line):
                printed = self.run_scene([disc, tube, lines[0], line % "*"], "axisymmetric")
                self.assertIn("tube:inside", printed)
                self.assertNotIn("disc:inside", printed)
                printed = self.run_scene([disc, tube, lines[0], line % "disc"], "axisymmetric", code=2)
                self.assertIn("'inside' lies on the axis and has no area", printed)
                printed = self.run_scene([disc, lines[0], line % "d*"], "axisymmetric", code=2)
                self.assertIn("case.nml:5: %s: none of the bodies has such a surface off the axis" % line.split()[0], printed)

    def test_weight(self):
        """A column under its own weight and that of a mass beside it: stresses of beam theory; forces of the rotation."""
        gravity, mass, arm = 10.0, 0.3, 0.25
        self.run_scene([self.block("hex20"), "&spring body='block', surface='bottom', fix='xyz', modulus=50 /",
                        "&load body='*', acceleration=0,0,%r /" % -gravity,
                        "&mass body='block', surface='top', mass=%r, point=%r,%r,9 /" % (mass, 1.5 + arm, 2.75), SOLVER])
        file, x, u = self.fields()
        bend, z, across = -mass * gravity * arm / (1.5 / 12), x[:, 2] - ORIGIN[2], x[:, 0] - 1.5
        # The stress is linear along the axis from the weight, and across it from the moment.
        sigma = -2 * gravity * 2.0 - mass * gravity / 1.5
        exact = sigma * (z / YOUNG + 1 / 50) + 2 * gravity * z**2 / (2 * YOUNG) + bend * across * (z / YOUNG + 1 / 50)
        np.testing.assert_allclose(u[:, 2], exact, atol=1e-9 * np.abs(exact).max())
        loads = file["dotyk/loads"]
        np.testing.assert_allclose(loads["force"][:], [(0, 0, -60), (0, 0, -mass * gravity)], atol=1e-12)
        np.testing.assert_allclose(loads["moment"][:][1], np.cross((1.75, 2.75, 9), (0, 0, -3)), atol=1e-11)
        self.assertIn("block:top (mass)", str(loads.attrs["names"]))
        self.run_scene([self.block("hex20"), "&support body='block', surface='bottom', fix='xyz' /",
                        "&load body='block', angular_velocity=0,0,3, centre=1,0,0 /",
                        "&mass body='block', surface='top', mass=2, point=1.5,2.75,6 /", SOLVER])
        loads = self.results("case.vtkhdf")["dotyk/loads"]
        force = 9 * 2 * np.array((0.5, 2.75, 0))
        np.testing.assert_allclose(loads["force"][:][1], force, atol=1e-11)
        np.testing.assert_allclose(loads["moment"][:][1], np.cross((1.5, 2.75, 6), force), atol=1e-10)

    def test_weight_in_two_dimensions(self):
        """The same in the plane and about an axis, where a mass is on the axis."""
        for analysis, kind, area, about in (("plane_stress", "quad8", 1.0, 3.0), ("axisymmetric", "quad8", 3 * np.pi, 0.0)):
            with self.subTest(analysis):
                self.run_scene([self.block(kind), "&spring body='block', surface='bottom', fix='y', modulus=50 /",
                                "&load body='block', acceleration=0,-10 /",
                                "&mass body='block', surface='top', mass=%r, point=%r,9 /" % (0.3 * area, about / 2), SOLVER],
                               analysis)
                file, x, u = self.fields()
                y = x[:, 1] - ORIGIN[1]
                exact = -43 * (y / YOUNG + 1 / 50) + 20 * y**2 / (2 * YOUNG)
                np.testing.assert_allclose(u[:, 1], exact, atol=1e-9 * np.abs(exact).max())
                np.testing.assert_allclose(file["dotyk/supports/force"][:], [(0, 43 * area, 0)], atol=1e-10)

    def test_mistakes_of_masses(self):
        """Messages name line and remedy."""
        weight = "&load body='block', acceleration=0,0,-1 /"
        top = "&mass body='block', surface='top', "
        for lines, message in (((top + "mass=1 /",), "case.nml:4: &mass: no &load acceleration or angular_velocity acts on body"),
                               ((top + "mass=-1 /", weight), "case.nml:4: &mass: mass must be above 0"),
                               ((top + "/", weight), "case.nml:4: &mass: 'mass' is missing"),
                               ((top + "mass=1 /", "&load body='block', angular_velocity=0,0,1 /"), "point is needed"),
                               (("&load body='block', surface='top', acceleration=0,0,-1 /",), "surface does not go together"),
                               (("&load body='block', acceleration=0,0,-1, pressure=1 /",), "exactly one of"),
                               (("&load body='block', acceleration_formula='0','0','z' /",), "acceleration_formula")):
            with self.subTest(message):
                self.assertIn(message, self.run_scene([self.block("hex8"), *lines], code=2))
        self.write("case.nml", "\n".join(["&scene /", "&material name='steel', young=1, poisson=0 /", self.block("hex8"), weight]))
        self.assertIn("case.nml:4: &load: the material 'steel' of body 'block' has no density", self.dotyk("case.nml", code=2))


if __name__ == "__main__":
    dotyk_case.main()
