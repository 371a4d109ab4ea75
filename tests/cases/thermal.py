"""Temperatures: thermal strains of free, held and touching bodies against closed forms, in every kind of elements and
every analysis."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import blocks  # noqa: E402
import cylinder  # noqa: E402
from dotyk_case import Case, main  # noqa: E402

YOUNG, POISSON, EXPANSION, HEAT = 200.0, 0.3, 1.2e-5, 80.0
STRAIN = EXPANSION * HEAT
KINDS_3D = "tet4", "tet10", "prism6", "prism15", "hex8", "hex20", "hex27"
KINDS_2D = "tri3", "tri6", "quad4", "quad8", "quad9"


def material(expansion=EXPANSION, poisson=POISSON, more=""):
    return "&material name='steel', young=%r, poisson=%r, expansion=%r %s /" % (YOUNG, poisson, expansion, more)


class Thermal(Case):
    def solve(self, kind, lines, n=2, size=None, name="block", output=""):
        """A block of elements of one kind. Returns nodes, displacements, stresses and the summary."""
        d = blocks.dimension(kind)
        self.write("block.geo", blocks.block_geo(kind, n, (0,) * d, size or (1,) * d))
        self.write(name + ".nml", "\n".join([*lines, "&output %s /" % output]) + "\n")
        self.log = self.dotyk(name + ".nml")
        with self.results(name + ".vtkhdf") as file:
            return (file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:],
                    file["VTKHDF/CellData/stress"][:], dict(file["dotyk/summary"].attrs))

    def scene(self, analysis, *more, given=None, body=""):
        return ["&scene analysis='%s', mesh='block.geo' /" % analysis, given or material(),
                "&body name='block', volume='block', material='steel' %s /" % body, *more]

    def test_free_block(self):
        """The exact displacement on the bottom leaves the rest free: alpha T everywhere, no stress, no error."""
        for kind in KINDS_3D + KINDS_2D:
            d = blocks.dimension(kind)
            for analysis in ("3d",) if d == 3 else ("plane_stress", "plane_strain"):
                factor = 1 + POISSON if analysis == "plane_strain" else 1
                value = ", ".join("'%r*%s'" % (factor * STRAIN, c) for c in "xyz"[:d])
                x, u, stress, summary = self.solve(kind, self.scene(
                    analysis, "&support body='block', surface='bottom', fix='%s', value_formula=%s /"
                    % ("xyz"[:d], value), "&temperature body='block', value=%r /" % HEAT))
                with self.subTest(kind=kind, analysis=analysis):
                    np.testing.assert_allclose(u[:, :d], factor * STRAIN * x[:, :d], atol=1e-13 * STRAIN * 100)
                    exact = np.zeros(6)
                    if analysis == "plane_strain":
                        exact[2] = -YOUNG * STRAIN
                    np.testing.assert_allclose(stress, exact + 0 * stress, atol=1e-12 * YOUNG * STRAIN)
                    self.assertLess(summary["error_discretization"], 1e-9)

    def test_held_all_over(self):
        """Heat that moves nothing: errors relative to the displacement, which is rounding, are told as energies."""
        lines = self.scene("3d", "&support body='block', surface='*', fix='n' /", "&temperature body='block', value=%r /" % HEAT)
        self.solve("tet10", lines)
        self.assertNotIn("relative error", self.log)
        self.assertRegex(self.log, r"error in energy  iteration <= \S+e-\d\d, discretization ~ \S+e-\d\d \(temperatures or initial")
        self.solve("tet10", self.scene("3d", "&support body='block', surface='bottom', fix='xyz' /",
                                       "&temperature body='block', value=%r /" % HEAT))
        self.assertIn("relative error   iteration", self.log)

    def test_nearly_incompressible(self):
        """The expansion is projected like the dilatation: a free block has no stress, however great the bulk modulus;
        a confined one has the pressure of it."""
        for kind in KINDS_3D + KINDS_2D:
            d = blocks.dimension(kind)
            poisson = 0.4999
            analysis, factor = ("3d", 1) if d == 3 else ("plane_strain", 1 + poisson)
            value = ", ".join("'%r*%s'" % (factor * STRAIN, c) for c in "xyz"[:d])
            heat = "&temperature body='block', value=%r /" % HEAT
            given = material(poisson=poisson)
            x, u, stress, summary = self.solve(kind, self.scene(
                analysis, "&support body='block', surface='bottom', fix='%s', value_formula=%s /" % ("xyz"[:d], value),
                heat, given=given))
            bulk = YOUNG / (3 * (1 - 2 * poisson))
            with self.subTest(kind=kind):
                np.testing.assert_allclose(u[:, :d], factor * STRAIN * x[:, :d], atol=1e-9 * STRAIN)
                exact = np.zeros(6)
                if d == 2:
                    exact[2] = -YOUNG * STRAIN
                np.testing.assert_allclose(stress, exact + 0 * stress, atol=1e-11 * bulk * STRAIN)
            sides = ["&support body='block', surface='sides %s', fix='%s' /" % (c, c) for c in "xy"[:d - 1]]
            ends = ["&support body='block', surface='%s', fix='%s' /" % (s, "xyz"[d - 1]) for s in ("top", "bottom")]
            _, u, stress, _ = self.solve(kind, self.scene(analysis, *sides, *ends, heat, given=given))
            with self.subTest(kind=kind, confined=True):
                np.testing.assert_allclose(u, 0, atol=1e-9 * STRAIN)
                np.testing.assert_allclose(stress[:, :3], -3 * bulk * STRAIN, rtol=1e-9)

    def test_orthotropic(self):
        """A body that is placed and turned, its axes turned in it: the strain is that of its axes, without stress. One
        coefficient expands it alike in all axes."""
        a1, a2 = np.array((2.0, 1.0, 0.5)), np.array((-1.0, 1.0, 1.0))
        axes = np.linalg.qr(np.array((a1, a2)).T, mode="complete")[0]
        angle = np.radians(35)
        turn = np.array(((np.cos(angle), -np.sin(angle), 0), (np.sin(angle), np.cos(angle), 0), (0, 0, 1)))
        turn = turn[np.ix_((1, 2, 0), (1, 2, 0))].T  # about y: cyclic permutation of z
        turn = np.array(((np.cos(angle), 0, np.sin(angle)), (0, 1, 0), (-np.sin(angle), 0, np.cos(angle))))
        for given in (3e-5, 1e-6, -4e-6), (1.2e-5,):
            coefficients = given * 3 if len(given) == 1 else given
            strain = turn @ axes @ np.diag(coefficients) @ axes.T @ turn.T * HEAT
            value = ", ".join("'%s'" % " + ".join("(%r)*%s" % (e, c) for e, c in zip(row.tolist(), "xyz"))
                              for row in strain)
            text = ("&material name='steel', young=11,0.7,0.4, poisson=0.4,0.45,0.5, shear=0.7,0.6,0.04, axis_1=2,1,0.5,"
                    " axis_2=-1,1,1, expansion=%s /" % ",".join(map(repr, given)))
            for kind in "hex8", "tet10":
                x, u, stress, _ = self.solve(kind, self.scene(
                    "3d", "&support body='block', surface='bottom', fix='xyz', value_formula=%s /" % value,
                    "&temperature body='block', value=%r /" % HEAT, given=text,
                    body=", at=0.3,0.2,-0.4, axis=0,1,0, angle=35"))
                np.testing.assert_allclose(u, x @ strain, atol=1e-11 * np.max(np.abs(strain)))
                np.testing.assert_allclose(stress, 0, atol=1e-11 * 11 * np.max(np.abs(strain)))

    def test_clamped_bar(self):
        """Both ends held, the sides free: -E alpha T along the bar, and free expansion across."""
        for kind in "hex20", "tet4", "tri6", "quad4":
            d = blocks.dimension(kind)
            along = "xyz"[d - 1]
            ends = ["&support body='block', surface='%s', fix='%s' /" % (s, along) for s in ("top", "bottom")]
            # One plane across that does not move along x, and one along y.
            lines = self.scene("3d" if d == 3 else "plane_stress", *ends, "&temperature body='*', value=%r /" % HEAT)
            values = ["'%r*%s'" % ((1 + POISSON) * STRAIN, c) for c in "xyz"[:d]]
            values[d - 1] = "'0'"
            lines[-2] = ("&support body='block', surface='bottom', fix='%s', value_formula=%s /"
                         % ("xyz"[:d], ", ".join(values)))
            _, _, stress, summary = self.solve(kind, lines)
            exact = np.zeros(6)
            exact[d - 1] = -YOUNG * STRAIN
            np.testing.assert_allclose(stress, exact + 0 * stress, atol=1e-11 * YOUNG * STRAIN, err_msg=kind)

    def test_modulus_field(self):
        """E = 200/(1 + z) in a clamped bar with Poisson's ratio 0: the stress is that of springs one after the other,
        -alpha T E_0/(1 + 1/2); the strain is linear, and exact in quadratic elements."""
        ends = ["&support body='block', surface='%s', fix='xyz' /" % s for s in ("top", "bottom")]
        given = material(poisson=0, more=", young_formula='1/(1 + z)'")
        sides = ["&support body='block', surface='sides %s', fix='%s' /" % (c, c) for c in "xy"]
        for kind in "hex20", "prism15":
            x, u, stress, _ = self.solve(kind, self.scene(
                "3d", *ends, *sides, "&temperature body='block', value=%r /" % HEAT, given=given))
            np.testing.assert_allclose(stress[:, 2], -YOUNG * STRAIN / 1.5, rtol=1e-3)
            z = x[:, 2]
            np.testing.assert_allclose(u[:, 2], STRAIN * (z - (z + z**2 / 2) / 1.5), atol=1e-3 * STRAIN)

    def test_linear_temperature(self):
        """A temperature linear in space bends a free body without stress."""
        a = STRAIN
        for kind in "tet10", "hex20", "hex27", "prism15", "tri6", "quad8":
            d = blocks.dimension(kind)
            f = 1 if d == 3 else 1 + POISSON
            square = "'%r*(x^2 - y^2%s)/2'" % (a * f, " - z^2" * (d == 3))
            value = ", ".join([square, "'%r*x*y'" % (a * f), "'%r*x*z'" % (a * f)][:d])
            x, u, stress, summary = self.solve(kind, self.scene(
                "3d" if d == 3 else "plane_strain",
                "&support body='block', surface='bottom', fix='%s', value_formula=%s /" % ("xyz"[:d], value),
                "&temperature body='block', formula='%r*x' /" % HEAT))
            np.testing.assert_allclose(u[:, 1], a * f * x[:, 0] * x[:, 1], atol=1e-11 * a)
            stress[:, 2] *= d == 3
            np.testing.assert_allclose(stress, 0, atol=1e-11 * YOUNG * a, err_msg=kind)
            self.assertLess(summary["error_discretization"], 1e-8)

    def tube(self, kind, analysis, n, poisson=POISSON, power=None):
        """The tube under a logarithmic temperature, hot inside, or a power of the radius, held along its axis. Returns
        errors of the radial displacement and of the mean stresses of the elements, relative, and the summary."""
        a, b = cylinder.INNER, cylinder.OUTER
        self.write("tube.geo", cylinder.geometry(kind, n, analysis == "axisymmetric"))
        r = "x" if analysis == "axisymmetric" else "sqrt(x^2 + y^2)"
        formula = ("%r*log(%r/%s)/log(%r)" % (HEAT, b, r, b / a)) if power is None else "%r*(%s)^%d" % (HEAT, r, power)
        lines = ["&scene analysis='%s', mesh='tube.geo' /" % analysis, material(poisson=poisson),
                 "&body name='tube', volume='tube', material='steel' /", *cylinder.held("tube", analysis),
                 "&temperature body='tube', formula='%s' /" % formula]
        self.write("tube.nml", "\n".join(lines) + "\n")
        self.dotyk("tube.nml")
        with self.results("tube.vtkhdf") as file:
            x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
            stress = file["VTKHDF/CellData/stress"][:]
            summary = dict(file["dotyk/summary"].attrs)
            cells = file["VTKHDF/Connectivity"][:].reshape(len(stress), -1)
        radius = x[:, 0] if analysis == "axisymmetric" else np.hypot(x[:, 0], x[:, 1])
        radial = u[:, 0] if analysis == "axisymmetric" else np.sum(u * x, axis=1) / radius

        def moment(r):
            """The integral of t r from a to r, for the temperature t HEAT."""
            if power is not None:
                return (r**(power + 2) - a**(power + 2)) / (power + 2)
            return (r**2 * np.log(b / r) - a**2 * np.log(b / a) + (r**2 - a**2) / 2) / (2 * np.log(b / a))

        # Timoshenko and Goodier, Theory of Elasticity, article 151: u = g m(r)/r + c r + d/r without strain along the
        # axis, no radial stress at a and b.
        g = (1 + poisson) / (1 - poisson) * STRAIN
        c = g * (1 - 2 * poisson) * moment(b) / (b**2 - a**2)
        d = g * a**2 * moment(b) / (b**2 - a**2)
        exact = g * moment(radius) / radius + c * radius + d / radius
        # The sum of the stresses: 3 K (div u - 3 alpha T).
        t = np.log(b / radius) / np.log(b / a) if power is None else radius**power
        trace = YOUNG / (1 - 2 * poisson) * (g * t + 2 * c - 3 * STRAIN * t)
        mean = trace[cells].mean(axis=1)
        return (np.max(np.abs(radial - exact)) / np.max(np.abs(exact)),
                np.max(np.abs(stress[:, :3].sum(axis=1) - mean)) / np.max(np.abs(trace)), summary)

    def test_tube(self):
        """Displacements of order p + 1, stresses of order p."""
        # Measured: 4.0, 3.2, 15.8, 6.8 and 4.0, 1.8, 3.8, 3.7 times.
        for kind, analysis, most in (("quad4", "axisymmetric", (3e-3, 1e-3)), ("tri3", "axisymmetric", (1e-2, 0.06)),
                                     ("quad8", "axisymmetric", (1e-6, 2e-3)), ("tri6", "plane_strain", (5e-5, 1e-3))):
            coarse, fine = (self.tube(kind, analysis, n) for n in (8, 16))
            order = 1 if kind in ("quad4", "tri3") else 2
            with self.subTest(kind=kind):
                self.assertGreater(coarse[0] / fine[0], 0.7 * 2**(order + 1))
                self.assertGreater(coarse[1] / fine[1], 0.8 * 2**order)
                self.assertLess(fine[0], most[0])
                self.assertLess(fine[1], most[1])

    def test_tube_nearly_incompressible(self):
        """The stresses depend on the elastic dilatation, a small difference of the dilatation and the thermal one."""
        for kind in "quad4", "quad9", "tri6":
            ordinary = self.tube(kind, "axisymmetric", 6)
            rubber = self.tube(kind, "axisymmetric", 6, poisson=0.4999)
            with self.subTest(kind=kind):
                self.assertLess(rubber[0], 2e-3 if kind != "quad4" else ordinary[0])
                self.assertLess(rubber[1], 2 * ordinary[1])

    def test_estimate(self):
        """The temperature is one that the elements interpolate exactly: the defect of F is half the squared error."""
        # Measured: 0.95 to 1.38; tri3 0.95, quad8 and quad9 1.3 on the coarse mesh.
        for kind, power in ("quad4", 1), ("tri3", 1), ("quad8", 2), ("tri6", 2), ("quad9", 2):
            coarse, fine = (self.tube(kind, "axisymmetric", n, power=power)[2] for n in (4, 8))
            error = np.sqrt(2 * (coarse["energy"] - fine["energy"]) / (1 - 0.25**power)) / coarse["energy_norm"]
            self.assertBetween(0.85, coarse["error_discretization"] / error, 1.5, kind)
        # The error in energy does not depend on the bulk modulus, whose work on the free expansion is in the norm.
        for kind, power in ("quad4", 1), ("quad9", 2):
            ordinary, rubber = (self.tube(kind, "axisymmetric", 4, power=power, poisson=p)[2] for p in (0.3, 0.4999))
            ratio = np.divide(*(s["error_discretization"] * s["energy_norm"] for s in (rubber, ordinary)))
            self.assertBetween(0.5, ratio, 2, kind)

    def test_heated_between_plates(self):
        """A block that heats up between another one and smooth walls: the pressure that closes what it would expand."""
        lower, upper = blocks.LOWER, blocks.UPPER

        def confined(young, poisson):
            return young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))

        def held(young, poisson):
            return young * STRAIN / (1 - 2 * poisson)

        for kind in "hex8", "tet10", "quad8":
            d = blocks.dimension(kind)
            self.write("lower.geo", blocks.block_geo(kind, 2, (0,) * d, (1,) * d))
            self.write("upper.geo", blocks.block_geo(kind, 3, (0,) * (d - 1) + (1,), (1,) * d))
            text = blocks.column_nml(d, solver="tolerance=1e-10, theta=0").replace("-%r" % blocks.SHORTENING, "0")
            text = text.replace("name='of lower',", "name='of lower', expansion=%r," % EXPANSION)
            self.write("column.nml", text + "&temperature body='lower', value=%r /\n" % HEAT)
            self.dotyk("column.nml")
            pressure = held(*lower) / confined(*lower) / (1 / confined(*lower) + 1 / confined(*upper))
            with self.results("column.vtkhdf") as file:
                np.testing.assert_allclose(file["dotyk/contact/joint/pressure_projected"][:], pressure, rtol=1e-9)
                stress = file["VTKHDF/CellData/stress"][:]
                np.testing.assert_allclose(stress[:, d - 1], -pressure, rtol=1e-8)
                self.assertLess(file["dotyk/summary"].attrs["error_discretization"], 1e-8)

    def test_nothing_moves(self):
        """Two blocks between walls, equally hot: the stress of the expansion, where displacements are rounding."""
        for kind in "hex8", "tet10":
            self.write("lower.geo", blocks.block_geo(kind, 2))
            self.write("upper.geo", blocks.block_geo(kind, 3, (0, 0, 1)))
            text = blocks.column_nml(3, solver="theta=0").replace("-%r" % blocks.SHORTENING, "0")
            for young, poisson in blocks.LOWER, blocks.UPPER:
                text = text.replace("young=%r, poisson=%r" % (young, poisson),
                                    "young=%r, poisson=%r, expansion=%r" % (YOUNG, POISSON, EXPANSION))
            self.write("column.nml", text + "&temperature body='*', value=%r /\n" % HEAT)
            self.dotyk("column.nml")
            with self.results("column.vtkhdf") as file:
                np.testing.assert_allclose(file["dotyk/contact/joint/pressure_projected"][:],
                                           YOUNG * STRAIN / (1 - 2 * POISSON), rtol=1e-9)
                np.testing.assert_allclose(file["VTKHDF/CellData/stress"][:, :3], -YOUNG * STRAIN / (1 - 2 * POISSON),
                                           rtol=1e-9)

    def test_shrink_fit(self):
        """A hot inner tube presses as one that is larger by its free expansion."""
        overlap = 1.5 * STRAIN
        pressures = []
        for gap, heat in ((-overlap, 0.0), (0.0, HEAT)):
            for body, inner, outer in ("inner", 1.0, 1.5), ("outer", 1.5, 2.2):
                self.write(body + ".geo", cylinder.geometry("quad8", 4, inner=inner, outer=outer))
            lines = ["&scene analysis='plane_stress' /", material()]
            for body in "inner", "outer":
                lines += ["&body name='%s', mesh='%s.geo', volume='tube', material='steel' /" % (body, body),
                          *cylinder.held(body, "plane_stress")]
            lines += ["&contact name='fit', surface_a='inner:outside', surface_b='outer:inside', gap=%r /" % gap,
                      "&temperature body='inner', value=%r /" % heat, "&solver theta=0, tolerance=1e-8 /"]
            self.write("fit.nml", "\n".join(lines) + "\n")
            self.dotyk("fit.nml")
            with self.results("fit.vtkhdf") as file:
                pressures.append(file["dotyk/contact/fit/pressure_projected"][:])
        compliance = 2 * 1.5**3 * (2.2**2 - 1) / (YOUNG * (1.5**2 - 1) * (2.2**2 - 1.5**2))
        np.testing.assert_allclose(pressures[1], overlap / compliance, rtol=1e-3)
        np.testing.assert_allclose(pressures[1], pressures[0], rtol=2e-4)

    def congruent(self, bodies):
        """Blocks side by side, each with an axis, an angle and a temperature by formula, clamped. Displacements and errors
        of the elements, one entry a body."""
        lines = ["&scene mesh='block.geo' /", material()]
        for i, (angle, heat) in enumerate(bodies):
            lines += ["&body name='b%d', volume='block', material='steel', at=%d,0,0, axis=1,2,3, angle=%r /"
                      % (i, 10 * i, angle), "&support body='b%d', surface='bottom', fix='xyz' /" % i,
                      "&temperature body='b%d', formula='%s' /" % (i, heat)]
        self.write("many.nml", "\n".join(lines) + "\n")
        self.dotyk("many.nml")
        with self.results("many.vtkhdf") as file:
            u, error = file["VTKHDF/PointData/displacement"][:], file["VTKHDF/CellData/discretization_error"][:]
            error *= file["dotyk/summary"].attrs["energy_norm"]
            classes = file["dotyk/summary/congruence_class"][:]
        return np.split(u, len(bodies)), np.split(error, len(bodies)), classes

    def test_congruent_bodies(self):
        """They share the factor, not the temperature: each has the displacements, and the estimated error, that it has
        alone."""
        self.write("block.geo", blocks.block_geo("hex8", 3))
        bodies = (0.0, "30"), (40.0, "-80"), (100.0, "20*sin(x)")
        u, error, classes = self.congruent(bodies)
        np.testing.assert_array_equal(classes, 1)
        for i, (angle, heat) in enumerate(bodies):
            alone, of_elements, _ = self.congruent([(angle, heat.replace("x", "(x + %d)" % (10 * i)))])
            np.testing.assert_allclose(u[i], alone[0], atol=1e-9 * np.max(np.abs(alone[0])))
            np.testing.assert_allclose(error[i], of_elements[0], rtol=1e-6)

    def test_initial_stress(self):
        """A held body keeps it, a free one gives it up and strains by -S s; constant and by formulas."""
        given = (3.0, -2.0, 1.0, 0.5, 0.25, -0.75)  # xx yy zz xy yz xz
        for kind in "hex8", "tet10", "prism15":
            for poisson in POISSON, 0.4999:
                for key in ("value=%s" % ",".join(map(repr, given)),
                            "formula=%s" % ",".join("'%r + 0*x'" % s for s in given)):
                    initial = "&initial_stress body='b*', %s /" % key
                    sides = ["&support body='block', surface='%s', fix='xyz' /" % s
                             for s in ("bottom", "top", "sides x", "sides y")]
                    _, u, stress, _ = self.solve(kind, self.scene("3d", *sides, initial,
                                                                  given=material(poisson=poisson)), n=1)
                    np.testing.assert_allclose(u, 0, atol=1e-14)
                    np.testing.assert_allclose(stress, np.array([given] * len(stress)), rtol=1e-12)
            s = np.array(((given[0], given[3], given[5]), (given[3], given[1], given[4]), (given[5], given[4], given[2])))
            strain = -((1 + POISSON) * s - POISSON * np.trace(s) * np.eye(3)) / YOUNG
            value = ", ".join("'%s'" % " + ".join("(%r)*%s" % (e, c) for e, c in zip(row.tolist(), "xyz"))
                              for row in strain)
            x, u, stress, summary = self.solve(kind, self.scene(
                "3d", "&support body='block', surface='bottom', fix='xyz', value_formula=%s /" % value, initial))
            np.testing.assert_allclose(u, x @ strain, atol=1e-11 * np.max(np.abs(strain)))
            np.testing.assert_allclose(stress, 0, atol=1e-10)
            self.assertLess(summary["error_discretization"], 1e-9)

    def test_ground(self):
        """Stresses that carry the weight of the ground: nothing moves, whatever the coefficient of pressure at rest."""
        weight, rest = 0.02, 0.7
        for kind, analysis in ("tri6", "plane_strain"), ("quad4", "axisymmetric"), ("hex20", "3d"):
            d = blocks.dimension(kind)
            up = "xyz"[d - 1]
            normal = ["'%r*(%s - 1)'" % (weight * (1 if c == up else rest), up) for c in "xyz"]
            density = ["0"] * (d - 1) + [repr(-weight)]
            _, u, stress, summary = self.solve(kind, self.scene(
                analysis, "&support body='block', surface='bottom', fix='%s' /" % "xyz"[:d],
                *["&support body='block', surface='sides %s', fix='%s' /" % (c, c) for c in "xy"[:d - 1]],
                "&load body='block', force_density=%s /" % ", ".join(density),
                "&initial_stress body='block', formula=%s, '0', '0', '0' /" % ", ".join(normal)))
            np.testing.assert_allclose(u, 0, atol=1e-13 * weight)
            self.assertBetween(-weight, stress[:, d - 1].mean(), -0.45 * weight)
            np.testing.assert_allclose(stress[:, 0] / stress[:, d - 1], rest, rtol=1e-9)
            self.assertLessEqual(summary["error_bound"], 1e-8)

    def refuse(self, message, *lines, given=None, analysis="3d", kind="hex8"):
        """The scene is bad input, with a message in the line of its last group."""
        d = blocks.dimension(kind)
        self.write("block.geo", blocks.block_geo(kind, 1, (0,) * d, (1,) * d))
        lines = [*self.scene(analysis, "&support body='block', surface='bottom', fix='%s' /" % "xyz"[:d], given=given),
                 *lines]
        self.write("block.nml", "\n".join(lines) + "\n")
        self.assertIn("block.nml:%d: %s" % (len(lines), message), self.dotyk("block.nml", code=2))

    def test_messages(self):
        self.refuse("&temperature: the material 'steel' of body 'block' has no expansion",
                    "&temperature body='block', value=20 /", given="&material name='steel', young=1, poisson=0 /")
        self.solve("hex8", self.scene("3d", "&support body='block', surface='bottom', fix='xyz' /",
                                      "&temperature body='block', formula='20 + 60*x' /"))
        self.assertRegex(self.log, "\n  block +20 to 80\n")
        self.refuse("&temperature: 'value' or 'formula' is missing", "&temperature body='block' /")
        self.refuse("&temperature: value and formula are both given", "&temperature body='block', value=1, formula='x' /")
        self.refuse("&temperature: a second &temperature of body 'block' (the first is in line 5)",
                    "&temperature body='block', value=1 /", "&temperature body='b*', value=1 /")
        self.refuse("&temperature: body: unknown body 'blok'", "&temperature body='blok', value=1 /")
        self.refuse("body 'block': the temperature: formula 1, 'log(x - 1)'",
                    "&temperature body='block', formula='log(x - 1)' /")
        self.refuse("&initial_stress: value needs 6 values, got 3", "&initial_stress body='block', value=1,2,3 /")
        self.refuse("&initial_stress: the component yz must be 0 in two dimensions",
                    "&initial_stress body='block', value=1,2,3,4,5,0 /", analysis="plane_strain", kind="quad4")
        self.refuse("&initial_stress: the component zz must be 0 in plane stress",
                    "&initial_stress body='block', formula='1','1','x','0','0','0' /", analysis="plane_stress",
                    kind="quad4")
        orthotropic = ("&material name='steel', young=1,2,3, poisson=0.1,0.1,0.1, shear=1,1,1, axis_1=1,0,0, "
                       "axis_2=0,1,1, expansion=1e-5,2e-5,3e-5 /")
        self.refuse("material 'steel': its thermal expansion makes shear stresses out of the plane", "&temperature body='block', value=1 /",
                    given=orthotropic.replace("young=1,2,3", "young=1,1,1").replace("shear=1,1,1", "shear=0.5,0.5,0.5")
                    .replace("poisson=0.1,0.1,0.1", "poisson=0,0,0"), analysis="plane_strain", kind="quad4")
        for values, message in (("1e-5, 2e-5", "expansion needs 1 or 3 values, got 2"),
                                ("1e-5, 2e-5, 3e-5", "an isotropic material has one value of expansion, got 3")):
            self.write("block.nml", "&scene mesh='block.geo' /\n&material name='steel', young=1, poisson=0,\n"
                       "expansion=%s /\n&body name='block', volume='block', material='steel' /\n" % values)
            self.assertIn("block.nml:3: &material: " + message, self.dotyk("block.nml", code=2))


main()
