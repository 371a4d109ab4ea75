#!/usr/bin/python3
"""tools/energy_norm.py: linear and quadratic fields on every element kind, the energy of runs, differences of runs and
meshes."""
import subprocess
import sys

import numpy as np

import dotyk_case
import dotyk
from blocks import KINDS, LOWER, UPPER, block_geo, column_exact, column_nml, dimension

sys.path.insert(0, str(dotyk_case.ROOT / "tools"))
import energy_norm  # noqa: E402


def gauss(d, n=4):
    """Points and weights on [0, 1]^d."""
    x, w = np.polynomial.legendre.leggauss(n)
    grid = np.stack(np.meshgrid(*[(x + 1) / 2] * d, indexing="ij"), axis=-1).reshape(-1, d)
    weights = np.stack(np.meshgrid(*[w / 2] * d, indexing="ij"), axis=-1).reshape(-1, d).prod(axis=1)
    return grid, weights


def linear(x):
    """A linear displacement and its gradient, for points (n, 3)."""
    h = np.array([[0.3, -0.7, 0.2], [0.5, 0.9, -0.4], [-0.6, 0.1, 0.8]])
    return x @ h.T, np.broadcast_to(h, (len(x), 3, 3))


def quadratic(x):
    """A quadratic one."""
    a, b, c = x.T
    u = np.stack([a**2 - b * c, a * b + 0.5 * c**2, b**2 + 2 * a * c - 0.3 * c**2], axis=1)
    zero = 0 * a
    h = np.stack([np.stack([2 * a, -c, -b], axis=1), np.stack([b, a, c], axis=1),
                  np.stack([2 * c, 2 * b, 2 * a - 0.6 * c], axis=1)], axis=1)
    return u, h + zero[:, None, None]


def stress_of(gradient, young, poisson, analysis):
    """Stress (6, n) as in the results file, from gradients (n, 3, 3) of three-dimensional or plane fields."""
    strain = (gradient + gradient.transpose(0, 2, 1)) / 2
    if analysis != "3d":
        strain = strain.copy()
        strain[:, 2, :] = strain[:, :, 2] = 0
        if analysis == "plane_stress":
            strain[:, 2, 2] = -poisson / (1 - poisson) * (strain[:, 0, 0] + strain[:, 1, 1])
    lame, shear = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    s = 2 * shear * strain + lame * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.stack([s[:, 0, 0], s[:, 1, 1], s[:, 2, 2], s[:, 0, 1], s[:, 1, 2], s[:, 0, 2]]), strain


class EnergyNorm(dotyk_case.Case):
    def column(self, kinds, analysis=None, name="column", left=0.0, divisions=(2, 1), contact=""):
        """Run the column with these kinds of elements; the path of its results."""
        d = dimension(kinds[0])
        for body, kind, n, z in zip(("lower", "upper"), kinds, divisions, (0.0, 1.0)):
            origin = [left] + [0.0] * (d - 1)
            origin[-1] = z
            self.write(body + ".geo", block_geo(kind, n, origin, (1.0,) * d))
        self.write(name + ".nml", column_nml(d, analysis, contact, "theta_relative=1, tolerance=1e-12"))
        self.dotyk(name + ".nml", "--threads", 1)
        return self.folder / (name + ".vtkhdf")

    def check_field(self, results, field, close=1e-11):
        """The norm of this field on the column against the same integral without a mesh; no error against its own
        stress.

        gmsh's nodes are as good as 1e-12 of the size, so are the strains.
        """
        d, analysis = results.dimension, results.analysis
        results.displacement = field(results.points)[0] * ([1, 1, 1] if d == 3 else [1, 1, 0])
        x, w = gauss(d)
        x = np.hstack([x, np.zeros((len(x), 3 - d))])
        square = 0
        for body, (young, poisson) in enumerate((LOWER, UPPER)):
            stress, strain = stress_of(field(x + np.eye(3)[d - 1] * body)[1], young, poisson, analysis)
            square += w @ np.einsum("cn,nc->n", stress[:3], strain[:, [0, 1, 2], [0, 1, 2]])
            square += 2 * w @ np.einsum("cn,nc->n", stress[3:], strain[:, [0, 1, 0], [1, 2, 2]])
        norm, cells = energy_norm.energy_norm(results, cells=True)
        self.assertAlmostEqual(norm / np.sqrt(square), 1, delta=close)
        self.assertAlmostEqual(np.sqrt(np.sum(cells**2)) / norm, 1, delta=1e-14)

        def exact(x, y, z, body):
            return stress_of(field(np.stack([x, y, z], axis=1))[1], *(LOWER, UPPER)[body - 1], analysis)[0]

        def twice(*arguments):
            return 2 * exact(*arguments)

        self.assertLess(energy_norm.error(results, exact), close * norm)
        self.assertAlmostEqual(energy_norm.error(results, twice) / norm, 1, delta=close)
        if d == 2:
            self.assertLess(energy_norm.error(results, lambda *a: exact(*a)[[0, 1, 3]]), close * norm)
            self.assertLess(energy_norm.error(results, exact_strain=lambda x, y, z, body: stress_of(
                field(np.stack([x, y, z], axis=1))[1], 1, 0, "plane_strain")[0]), close * norm)

    def test_fields(self):
        """Every kind holds linear fields, the quadratic kinds quadratic ones, to round-off."""
        for d in (2, 3):
            kinds = [kind for kind in KINDS if dimension(kind) == d]
            for order in (1, 2):
                these = [kind for kind in kinds if KINDS[kind][1] == order]
                for pair in zip(these[::2], these[1::2] + these[:1] * (len(these) % 2)):
                    with self.subTest(pair):
                        results = energy_norm.Results(self.column(pair))
                        self.assertEqual({block.kind.name for block in results.blocks}, set(pair))
                        self.check_field(results, linear)
                        if order == 2:
                            self.check_field(results, quadratic)

    def test_plane_stress(self):
        self.check_field(energy_norm.Results(self.column(("tri6", "quad8"), "plane_stress")), quadratic)

    def test_energy_of_runs(self):
        """Strain energy and contact energy are the F of the run; and the column's exact norm and stress."""
        for kinds, analysis, left in ((("hex20", "hex20"), "3d", 0), (("quad4", "quad4"), "plane_stress", 0),
                                      (("quad8", "quad8"), "axisymmetric", 0.5), (("tri3", "tri3"), "axisymmetric", 0)):
            with self.subTest(kinds=kinds, analysis=analysis):
                path = self.column(kinds, analysis, left=left, divisions=(2, 2))
                file = self.results("column.vtkhdf")
                joint = file["dotyk/contact/joint"]
                theta, area = joint.attrs["theta"], joint["weight"][:].sum()
                contact = theta * np.sum(joint["weight"][:] * joint["pressure"][:]**2)
                norm = energy_norm.energy_norm(path)
                self.assertAlmostEqual(norm**2 / (2 * file["dotyk/summary"].attrs["energy"] - contact), 1, delta=1e-9)
                self.assertAlmostEqual(norm / file["dotyk/summary"].attrs["energy_norm"], 1, delta=1e-9)
                pressure, lower, upper = column_exact(theta, analysis)
                self.assertAlmostEqual(norm**2 / (pressure * (lower + upper) * area), 1, delta=1e-9)
                d = dimension(kinds[0])

                def exact(x, y, z, body):
                    poisson = (LOWER, UPPER)[body - 1][1]
                    side = 0 if analysis == "plane_stress" else -pressure * poisson / (1 - poisson)
                    stress = np.zeros((6, len(x)))
                    stress[:3] = side
                    stress[d - 1] = -pressure
                    if analysis == "plane_stress":
                        stress[0] = -pressure * poisson
                    return stress

                self.assertLess(energy_norm.error(path, exact), 1e-8 * norm)
                given = energy_norm.Results(path, young=[LOWER[0], UPPER[0]], poisson=[LOWER[1], UPPER[1]])
                self.assertEqual(energy_norm.energy_norm(given), norm)

    def test_curved(self):
        """The wavy surface without penalty: F is half of the square of the norm."""
        self.copy("wavy")
        self.dotyk("wavy/wavy.nml", "--threads", 1)
        energy = self.results("wavy/wavy.vtkhdf")["dotyk/summary"].attrs["energy"]
        self.assertAlmostEqual(energy_norm.energy_norm(self.folder / "wavy/wavy.vtkhdf")**2 / (2 * energy), 1,
                               delta=1e-9)

    def test_distance(self):
        """Two runs that differ in theta: their linear fields differ as their pressures do."""
        one = self.column(("tet10", "tet10"), name="one", divisions=(1, 1))
        two = self.column(("tet10", "tet10"), name="two", divisions=(1, 1), contact=", gap=1e-4")
        theta = self.results("one.vtkhdf")["dotyk/contact/joint"].attrs["theta"]
        (p, lower, upper), (q, _, _) = column_exact(theta), column_exact(theta, gap=1e-4)
        expected = (p - q) * np.sqrt((lower + upper) / p)
        self.assertAlmostEqual(energy_norm.distance(one, two) / expected, 1, delta=1e-8)
        self.assertAlmostEqual(energy_norm.distance_meshes(one, two) / expected, 1, delta=1e-8)
        other = self.column(("tet4", "tet4"), name="other", divisions=(1, 1))
        with self.assertRaises(ValueError):
            energy_norm.distance(one, other)
        script = dotyk_case.ROOT / "tools/energy_norm.py"
        done = subprocess.run([sys.executable, "-B", script, one, other], text=True, stdout=subprocess.PIPE, check=True)
        self.assertIn("distance", done.stdout)

    def test_distance_of_meshes(self):
        """A field that both meshes hold: no distance; one that the coarse one does not hold: its interpolation
        error."""
        for coarse_kinds, fine_kinds in ((("tri6", "quad9"), ("quad8", "tri6")),
                                         (("hex27", "tet10"), ("tet10", "prism15"))):
            with self.subTest(coarse_kinds):
                coarse = energy_norm.Results(self.column(coarse_kinds, name="coarse"))
                fine = energy_norm.Results(self.column(fine_kinds, name="fine", divisions=(3, 2)))
                for results in (coarse, fine):
                    results.displacement = quadratic(results.points)[0] * ([1, 1, 1] if results.dimension == 3
                                                                           else [1, 1, 0])
                distance, cells = energy_norm.distance_meshes(coarse, fine, cells=True)
                self.assertEqual(len(cells), fine.n_cells)
                self.assertLess(distance, 1e-11 * energy_norm.energy_norm(fine))
        # u_x = x^3, interpolated on one quadratic element along x and on 16.
        coarse = energy_norm.Results(self.column(("quad9", "quad9"), name="coarse", divisions=(1, 1)))
        fine = energy_norm.Results(self.column(("quad9", "quad9"), name="fine", divisions=(16, 16)))
        for results in (coarse, fine):
            results.displacement = results.points[:, [0, 1, 2]]**3 * [1, 0, 0]
        x, w = gauss(1)
        # On one element: the quadratic through 0, 1/8, 1 at 0, 1/2, 1 is 3/2 x^2 - x/2.
        square = w @ (3 * x[:, 0]**2 - 3 * x[:, 0] + 0.5)**2
        stiffness = sum(young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))
                        for young, poisson in (LOWER, UPPER))
        # 16 elements leave 16^-4 of the square.
        self.assertAlmostEqual(energy_norm.distance_meshes(coarse, fine) / np.sqrt(stiffness * square), 1,
                               delta=16.0**-4)

    def test_materials(self):
        """An orthotropic material that is isotropic, along oblique axes; the stiffness as 21 numbers."""
        shear = 210 / 2.6
        text = ("&material name='a', young=3*210, poisson=3*0.3, shear=3*%r, axis_1=1,2,3, axis_2=0,1,-1 /\n"
                "&material name='b', stiffness=1,2,3,4,5,6, 7,8,9,10,11, 12,13,14,15, 16,17,18, 19,20, 21 /" % shear)
        one, two = (energy_norm.stiffness_of(group) for group in dotyk.Scene.parse(text).groups)
        np.testing.assert_allclose(one, energy_norm.isotropic(210, 0.3), rtol=0, atol=1e-11)
        np.testing.assert_array_equal(two, two.T)
        self.assertEqual((two[0, 1], two[1, 1], two[2, 3], two[5, 5]), (2, 7, 13, 21))


dotyk_case.main()
