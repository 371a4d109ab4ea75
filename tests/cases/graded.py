"""Constants of materials as formulas, each by its own: closed forms, an independent solution of a tube, and twin scenes."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import grid  # noqa: E402
from dotyk_case import Case, main  # noqa: E402

ORTHO = ([10.0, 2.0, 3.0], [0.3, 0.25, 0.2], [1.0, 1.5, 0.8])
AXES = "axis_1=1,1,0, axis_2=0,0,1"
GAP = "acceleration=0,0,-0.02"


def numbers(values):
    return ", ".join("%.17g" % v for v in np.ravel(values))


def formulas(values):
    return ", ".join(v if isinstance(v, str) else "'%.17g'" % v for v in values)


def upper(matrix):
    return [matrix[i, j] for i in range(6) for j in range(i, 6)]


def full():
    """A stiffness without any symmetry."""
    root = np.random.default_rng(1).normal(size=(6, 6))
    return 0.2 * root @ root.T + np.diag([4.0, 5, 6, 2, 2, 3])


class Graded(Case):
    def solve(self, block, kind, material, *lines, analysis="", body="", name="bar", code=0):
        """Returns nodes, displacements, stresses of nodes, those of elements with their centres, and the summary."""
        d = grid.dimension(kind)
        grid.write_mesh(self.folder / (name + ".msh"), [block], kind)
        self.write(name + ".nml", "\n".join([
            "&scene analysis='%s', mesh='%s.msh' /" % (analysis or ("3d" if d == 3 else "plane_strain"), name),
            "&material name='graded', %s /" % material,
            "&body name='bar', volume='bar', material='graded' %s /" % body, *lines]) + "\n")
        self.log = self.dotyk(name + ".nml", code=code)
        if code:
            return None
        with self.results(name + ".vtkhdf") as file:
            data = file["VTKHDF"]
            x, offsets, nodes = data["Points"][:], data["Offsets"][:], data["Connectivity"][:]
            centre = np.array([x[nodes[a:b]].mean(axis=0) for a, b in zip(offsets[:-1], offsets[1:])])
            self.energy = float(np.sum(file["dotyk/bodies/strain_energy"][()]))
            return (x, data["PointData/displacement"][:], data["PointData/nodal_stress"][:], data["CellData/stress"][:], centre,
                    dict(file["dotyk/summary"].attrs))

    @staticmethod
    def block(kind, n=2):
        return grid.Block("bar", *[grid.even(0, 1, n)] * grid.dimension(kind))

    def test_constant_formulas(self):
        """Formulas that are constant give what the numbers give: displacements, stresses, energies and estimates, in all analyses,
        for a turned body with weight and heat."""
        tensor = upper(full())
        outside = np.isin(range(6), (3, 4)).astype(int)
        flat = upper(np.where(np.add.outer(outside, outside) == 1, 0, full()))
        isotropic = "young=2, poisson=%s, expansion=3e-4, density=2"
        as_formulas = "young_formula='2', poisson_formula='%s', expansion_formula='3e-4', density_formula='2'"
        axes = {"axes": AXES}
        ortho = ("young=%s, poisson=%s, shear=%s, " % tuple(numbers(v) for v in ORTHO) + "expansion=1e-4,2e-4,3e-4, density=2, %(axes)s")
        of_ortho = ("young_formula=%s, poisson_formula=%s, shear_formula=%s, " % tuple(formulas(v) for v in ORTHO) +
                    "expansion_formula='1e-4','2e-4','3e-4', density_formula='2', %(axes)s")
        mixed = ("young=%s, poisson=%s, shear_formula=%s, " % (numbers(ORTHO[0]), numbers(ORTHO[1]), formulas(ORTHO[2])) +
                 "expansion=1e-4,2e-4,3e-4, density=2, %(axes)s")
        tri = "stiffness=%s, young_formula='1', expansion=2e-4, density=2, %s"
        of_tri = "stiffness_formula=%s, young_formula='1', expansion_formula='2e-4', density_formula='2', %s"
        cases = [(kind, "", isotropic % poisson, as_formulas % poisson) for kind, poisson in (
            ("hex8", 0.25), ("tet10", 0.3), ("hex8", 0.4999), ("hex20", 0.4999), ("hex27", 0.4999), ("tet10", 0.4999), ("quad4", 0.4999),
            ("quad9", 0.4999), ("tri6", 0.4999), ("prism15", 0.2), ("pyramid14", 0.2), ("tet4", 0.3), ("quad8", 0.3))]
        cases += [("quad4", "plane_stress", isotropic % 0.4, as_formulas % 0.4), ("tri6", "plane_stress", isotropic % 0.3, as_formulas % 0.3),
                  ("quad8", "axisymmetric", isotropic % 0.3, as_formulas % 0.3),
                  ("quad4", "axisymmetric", isotropic % 0.4999, as_formulas % 0.4999)]
        cases += [(kind, "", ortho % axes, of % axes) for kind, of in (("hex8", of_ortho), ("tet10", of_ortho), ("hex8", mixed))]
        cases += [("quad8", "", ortho % {"axes": ""}, of_ortho % {"axes": ""}),
                  ("quad4", "plane_stress", ortho % {"axes": ""}, of_ortho % {"axes": ""}),
                  ("quad8", "axisymmetric", ortho % {"axes": ""}, of_ortho % {"axes": ""})]
        cases += [("hex8", "", tri % (numbers(tensor), AXES), of_tri % (formulas(tensor), AXES)),
                  ("tet10", "", tri % (numbers(tensor), ""), of_tri % (formulas(tensor), "")),
                  ("quad8", "", tri % (numbers(flat), ""), of_tri % (formulas(flat), ""))]
        for kind, analysis, given, by_formulas in cases:
            d = grid.dimension(kind)
            weight = "0,0,-0.02" if d == 3 else "0,-0.02"
            body = ", axis=1,2,0.5, angle=25, at=0.3,0.2,0.1" if d == 3 else ", at=0,0.1" if analysis else ", angle=25"
            lines = ["&support body='bar', surface='bottom', fix='%s' /" % "xyz"[:d], "&load body='bar', acceleration=%s /" % weight,
                     "&load body='bar', angular_velocity=%s /" % ("0.1" if d == 2 else "0.1,0,0.2"),
                     "&temperature body='bar', formula='50+20*x' /"]
            first = self.solve(self.block(kind), kind, given, *lines, analysis=analysis, body=body)
            energy = self.energy
            second = self.solve(self.block(kind), kind, by_formulas, *lines, analysis=analysis, body=body)
            # a radius in the denominator: the rules differ, that of formulas is of a higher degree
            tolerance = 1e-2 if analysis == "axisymmetric" else 1e-8
            with self.subTest(kind=kind, analysis=analysis, material=by_formulas[:40]):
                for a, b in zip(second[1:4], first[1:4]):
                    np.testing.assert_allclose(a, b, atol=tolerance * np.abs(b).max(), rtol=0)
                self.assertLess(abs(self.energy / energy - 1), tolerance)
                self.assertLess(abs(second[5]["error_discretization"] / first[5]["error_discretization"] - 1), 1e3 * tolerance)

    def test_column(self):
        """A column between walls under its own weight and a pressure: modulus, Poisson's ratio and density vary so that the strain
        is linear."""
        for kind in ("quad8", "quad9", "hex20", "hex27"):
            d = grid.dimension(kind)
            z = "xyz"[d - 1]
            stress = "(0.1+0.3*(2*(1-%s)+0.5*(1-%s^2)))" % (z, z)
            poisson = "(0.1+0.3*%s)" % z
            young = "%s/(0.01*(2+%s))*(1+%s)*(1-2*%s)/(1-%s)" % (stress, z, poisson, poisson, poisson)
            x, u, nodal, mean, centre, summary = self.solve(
                self.block(kind), kind,
                "young_formula='%s', poisson_formula='%s', density_formula='2+%s'" % (young, poisson, z),
                *("&support body='bar', surface='%s', fix='%s' /" % pair
                  for pair in [("bottom", z)] + [("sides " + c, c) for c in "xy"[:d - 1]]),
                "&load body='bar', surface='top', pressure=0.1 /",
                "&load body='bar', acceleration=%s /" % ",".join(["0"] * (d - 1) + ["-0.3"]))
            h, at = x[:, d - 1], centre[:, d - 1]
            with self.subTest(kind=kind):
                np.testing.assert_allclose(u[:, d - 1], -0.01 * (2 * h + h**2 / 2), atol=1e-12)
                exact = -(0.1 + 0.3 * (2 * (1 - h) + 0.5 * (1 - h**2)))
                np.testing.assert_allclose(nodal[:, d - 1], exact, rtol=1e-9)
                ratio = (0.1 + 0.3 * h) / (0.9 - 0.3 * h)
                np.testing.assert_allclose(nodal[:, 0], ratio * exact, rtol=1e-9)
                # means over elements of half a unit
                exact = -(0.1 + 0.3 * (2 * (1 - at) + 0.5 * (1 - at**2 - 0.25 / 12)))
                np.testing.assert_allclose(mean[:, d - 1], exact, rtol=1e-9)
                self.assertLess(summary["error_discretization"], 1e-6)

    def patch(self, kind, material, displacement, stress, **more):
        """Displacements that are given at the boundary."""
        d = grid.dimension(kind)
        sides = ["bottom", "top"] + ["sides " + c for c in "xy"[:d - 1]]
        x, u, nodal, mean, _, summary = self.solve(
            self.block(kind), kind, material, *("&support body='bar', surface='%s', fix='%s', value_formula=%s /" % (
                side, "xyz"[:d], ", ".join("'%s'" % f for f in displacement)) for side in sides), **more)
        self.assertTrue(np.all([np.max(np.abs(u[:, i])) > 1e-3 for i in range(d)]))
        for i in range(d):
            exact = eval(displacement[i].replace("^", "**"), {"x": x[:, 0], "y": x[:, 1], "z": x[:, 2]})
            np.testing.assert_allclose(u[:, i], exact, atol=1e-12)
        for found in (nodal, mean):
            np.testing.assert_allclose(found, np.tile(stress, (len(found), 1)), atol=1e-9)
        self.assertLess(summary["error_discretization"], 1e-6)

    def test_patch_orthotropic(self):
        """Nine constants by formulas under a uniform stress: their compliances are linear in space, and so are the strains."""
        stress = np.array([0.02, -0.01, 0.03, 0.004, 0.006, 0.002])  # xx yy zz yz xz xy
        base, slopes = np.array([1.0, 0.8, 1.2, 3, 2, 4]), np.array([[.3, .1, -.2], [.2, -.3, .1], [-.1, .2, .4], [.5, 0, 0], [0, .4, 0],
                                                                    [0, 0, .6]])
        cross, tilts = np.array([-0.2, -0.25, -0.15]), np.array([[.05, 0, .1], [0, .1, 0], [.05, .05, 0]])

        def linear(first, slope):
            return "(%.17g%s)" % (first, "".join("%+.17g*%s" % pair for pair in zip(slope, "xyz")))

        own = [linear(*pair) for pair in zip(base, slopes)]
        pairs = [linear(*pair) for pair in zip(cross, tilts)]
        material = "young_formula=%s, poisson_formula=%s, shear_formula=%s" % (
            formulas("'1/%s'" % s for s in own[:3]),
            formulas("'-%s/%s'" % pair for pair in zip(pairs, (own[0], own[0], own[1]))),
            formulas("'1/%s'" % s for s in (own[5], own[4], own[3])))

        def strain(diagonal, off):
            """The strain tensor under the stress."""
            compliance = np.diag(diagonal)
            for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), off):
                compliance[i, j] = compliance[j, i] = value
            e = compliance @ stress
            return np.array([[e[0], e[5] / 2, e[4] / 2], [e[5] / 2, e[1], e[3] / 2], [e[4] / 2, e[3] / 2, e[2]]])

        constant, tensors = strain(base, cross), [strain(slopes[:, k], tilts[:, k]) for k in range(3)]
        displacement = []
        for i in range(3):
            terms = ["%+.17g*%s" % (constant[i, j], "xyz"[j]) for j in range(3)]
            terms += ["%+.17g*%s*%s" % (tensors[k][i, j] - tensors[i][j, k] / 2, "xyz"[j], "xyz"[k])
                      for j in range(3) for k in range(3)]
            displacement.append("".join(terms))
        for kind in ("hex20", "hex27", "tet10", "prism15"):
            with self.subTest(kind=kind):
                self.patch(kind, material, displacement, stress[[0, 1, 2, 5, 3, 4]])

    def test_patch_anisotropic(self):
        """All 21 constants by formulas, without any symmetry, in turned axes, times a factor: a uniform stress and linear strains."""
        stress = np.array([0.02, -0.01, 0.03, 0.004, 0.006, 0.002])
        stiffness = full()
        e = np.linalg.solve(stiffness, stress)
        tensor = np.array([[e[0], e[5] / 2, e[4] / 2], [e[5] / 2, e[1], e[3] / 2], [e[4] / 2, e[3] / 2, e[2]]])
        slope = "(1+0.3*x+0.2*y-0.4*z)"
        a = [0.3, 0.2, -0.4]
        row = ["(%s)" % "".join("%+.17g*%s" % pair for pair in zip(tensor[i], "xyz")) for i in range(3)]
        form = "(%s)" % "+".join("%s*%s" % pair for pair in zip("xyz", row))
        displacement = ["%s*%s-0.5*%.17g*%s" % (slope, row[i], a[i], form) for i in range(3)]
        for kind, factor in (("hex20", 1), ("tet10", 1), ("hex27", 2)):
            given = "stiffness_formula=%s" % formulas("'%.17g/%s'" % (c / factor, slope) for c in upper(stiffness))
            with self.subTest(kind=kind):
                self.patch(kind, given + (", young_formula='2'" if factor == 2 else ""), displacement, stress[[0, 1, 2, 5, 3, 4]])
                if factor == 1:
                    self.patch(kind, given, displacement, stress[[0, 1, 2, 5, 3, 4]])

    @staticmethod
    def radial(young, poisson, expansion, density, heat, spin, pressure, n=48):
        """Radial displacement of a tube from 1 to 2 between smooth walls, by Chebyshev collocation; a function of the radius."""
        t = np.cos(np.pi * np.arange(n) / (n - 1))
        c = np.where((np.arange(n) == 0) | (np.arange(n) == n - 1), 2.0, 1.0) * (-1.0)**np.arange(n)
        d = np.outer(c, 1 / c) / (t[:, None] - t[None, :] + np.eye(n))
        d = 2 * (d - np.diag(d.sum(axis=1)))
        r = 1.5 + t / 2
        nu, e = poisson(r), young(r)
        first, second = e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
        held = (3 * first + 2 * second) * expansion(r) * heat(r)
        sigma_r = (first + 2 * second)[:, None] * d + np.diag(first / r)
        sigma_t = first[:, None] * d + np.diag((first + 2 * second) / r)
        system = d @ sigma_r + (sigma_r - sigma_t) / r[:, None]
        right = d @ held - density(r) * spin**2 * r
        system[[0, -1]] = sigma_r[[0, -1]]
        right[[0, -1]] = held[[0, -1]] - np.array([0, pressure])
        coefficients = np.polynomial.chebyshev.chebfit(t, np.linalg.solve(system, right), n - 1)
        return lambda radius: np.polynomial.chebyshev.chebval(2 * radius - 3, coefficients)

    def test_tube(self):
        """Young's modulus, Poisson's ratio, expansion and density of a thick tube vary with the radius, under pressure, heat and
        rotation: the displacement converges to that of the equation for the radius, also where the ratio comes near 0.5."""
        block = {}
        for n in (3, 6, 12):
            block[n] = grid.Block("bar", grid.even(1, 2, n), grid.even(0, 0.5, max(1, n // 3)))
            block[n].patches = {"inside": lambda p: bool(np.all(p[:, 0] < 1 + 1e-9))}
        # with projected dilatations, quadratic elements of constant pressures are of order 2
        for text, poisson, orders in (("0.1+0.15*x", lambda r: 0.1 + 0.15 * r, (2, 4, 4, 3)),
                                      ("0.3+0.19*(x-1)", lambda r: 0.3 + 0.19 * (r - 1), (2, 0, 3, 1.5)),
                                      ("0.4999-0.0002*(x-1)", lambda r: 0.4999 - 0.0002 * (r - 1), (2, 2, 4, 2))):
            exact = self.radial(lambda r: 10 * r**2, poisson, lambda r: 1e-3 / r, lambda r: 2 + r, lambda r: 10 * r, 0.5, 1.0)
            material = "young_formula='10*x^2', poisson_formula='%s', expansion_formula='1e-3/x', density_formula='2+x'" % text
            for kind, order in zip(("quad4", "quad8", "quad9", "tri6"), orders):
                errors, stresses, sizes = [], [], (3, 6) if kind[-1] != "4" else (6, 12)
                for n in sizes:
                    x, u, nodal, _, _, summary = self.solve(
                        block[n], kind, material, *("&support body='bar', surface='%s', fix='y' /" % side for side in ("bottom", "top")),
                        "&load body='bar', surface='inside', pressure=1 /", "&load body='bar', angular_velocity=0.5 /",
                        "&temperature body='bar', formula='10*x' /", analysis="axisymmetric")
                    errors.append(np.max(np.abs(u[:, 0] - exact(x[:, 0]))) / np.max(np.abs(exact(x[:, 0]))))
                    stresses.append(np.max(np.abs(nodal[x[:, 0] < 1 + 1e-9, 0] + 1)))
                with self.subTest(kind=kind, poisson=text):
                    self.assertEqual("K/G" in self.log, not text.startswith("0.1"))
                    self.assertLess(errors[1], 0.005 if kind == "quad4" else 8e-4)
                    if order:
                        self.assertGreater(np.log2(errors[0] / errors[1]), order - 0.6)

    def test_refusals(self):
        """Constants that are not those of a stable material name themselves, the point, the body and the line; so do keys that
        exclude each other."""
        upright = ["'%s'" % c for c in "3 1 1 0 0 0 3 1 0 0 0 3 0 0 0 1 0 0 1 0 1-2*x".split()]
        pressure = "&load body='bar', surface='top', pressure=0.1 /"
        weight, heat = "&load body='bar', acceleration=0,0,-1 /", "&temperature body='bar', value=1 /"
        for kind, material, load, message in (
                ("hex8", "young=1, poisson_formula='0.3+0.25*z'", pressure, "bar.nml:2: body 'bar': material 'graded': poisson_formula is "
                 "0.535912, but must lie between -1 and 0.5 at (0.0563508, 0.0563508, 0.943649) (element 2)"),
                ("hex8", "young=1, poisson_formula='log(z-0.5)'", pressure, "'log(z-0.5)', is NaN at"),
                ("hex8", "young_formula='1-2*z', poisson_formula='0.1'", pressure, "young_formula: the modulus factor must be positive"),
                ("hex8", "young_formula='1','2','3', poisson=3*0.1, shear_formula='1','z-0.5','1'", pressure,
                 "material 'graded': shear_formula(2) is -0.443649, but must be positive at ("),
                ("hex8", "young_formula='1','2','3', poisson_formula='0.1','0.1+z','0.1', shear=3*1", pressure,
                 "poisson_formula(2) is 0.656351, but must be smaller than the root of the ratio of the two Young's moduli at ("),
                ("hex8", "young_formula=3*'1', poisson_formula='0.9','0.1','-0.9*z', shear=3*1", pressure,
                 "the three poisson ratios, 0.9, 0.1 and -0.675, do not go together with young 1, 1, 1"),
                ("hex8", "stiffness_formula=%s" % ", ".join(upright), pressure,
                 "the elasticity matrix is not positive definite, its least eigenvalue is -0.225403"),
                ("tet4", "young=1, poisson_formula='0.3+0.19*z'", pressure, "linear triangles, tetrahedra, prisms and pyramids lock"),
                ("hex8", "young=1, poisson=0.3, density_formula='z-0.5'", weight, "bar.nml:4: force density: density_formula is -0.443649"),
                ("hex8", "young=1, poisson=0.3", weight, "the material 'graded' of body 'bar' has no density"),
                ("hex8", "young=1, poisson=0.3, expansion_formula='1','2','3'", heat, "an isotropic material has one value of expansion"),
                *(("hex8", material, pressure, "&material: %s and %s_formula are both given: only one can be meant" % (key, key))
                  for key, material in (("poisson", "young=1, poisson=0.3, poisson_formula='0.1'"),
                                        ("density", "young=1, poisson=0.3, density=1, density_formula='1'"),
                                        ("expansion", "young=1, poisson=0.3, expansion=1, expansion_formula='1'"),
                                        ("young", "young=3*1, poisson=3*0.1, shear=3*1, young_formula=3*'1'"))),
                ("hex8", "poisson_formula='0.1'", pressure, "'young' or 'stiffness' is missing"),
                ("hex8", "young_formula='1', poisson=3*0.1, shear=3*1", pressure, "an orthotropic material needs 3 values each"),
                ("hex8", "stiffness_formula='1','2'", pressure, "stiffness_formula needs 21 values, got 2")):
            self.solve(self.block(kind, 2), kind, material, load, "&support body='bar', surface='bottom', fix='xyz' /", code=2)
            with self.subTest(material=material):
                self.assertIn(message, self.log)
        wall = "&support body='bar', surface='bottom', fix='xy' /"
        for lines in ((pressure, wall), (heat, wall)):
            # the second axis of the material is in the plane alone where x is 0
            self.solve(self.block("quad4"), "quad4", "stiffness_formula=%s, expansion=1" % ", ".join(
                "'%s'" % c for c in "3 1 1 0.1*x 0 0 3 1 0 0 0 3 0 0 0 1 0 0 1 0 1".split()), *lines, code=2)
            self.assertIn("strains in the plane make shear stresses out of it", self.log)

    def test_several(self):
        """Two copies of a graded body are not congruent, for the formulas are in global axes; factors, p-multigrid and contact give
        one solution."""
        block = self.block("hex20", 2)
        grid.write_mesh(self.folder / "bar.msh", [block], "hex20")
        found = {}
        for response in ("factors", "multigrid"):
            lines = ["&scene mesh='bar.msh' /", "&material name='m', young_formula='1+z', poisson_formula='0.1+0.15*z', density_formula='2-z' /",
                     "&body name='low', volume='bar', material='m' /", "&body name='high', volume='bar', material='m', at=0,0,1 /",
                     "&support body='low', surface='bottom', fix='z' /", "&load body='high', surface='top', pressure=0.1 /",
                     *("&support body='%s', surface='sides %s', fix='%s' /" % (b, c, c) for b in ("low", "high") for c in "xy"),
                     "&load body='*', acceleration=0,0,-0.01 /",
                     "&contact name='joint', surface_a='high:bottom', surface_b='low:top', theta=0 /",
                     "&solver %s tolerance=1e-8 /" % ("response='multigrid'," if response == "multigrid" else "")]
            self.write("bars.nml", "\n".join(lines) + "\n")
            log = self.dotyk("bars.nml")
            self.assertNotIn("congruence class", log)
            with self.results("bars.vtkhdf") as file:
                x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
                found[response] = x, u
        x, u = found["factors"]
        np.testing.assert_allclose(found["multigrid"][1], u, atol=1e-6 * np.abs(u).max())
        # the column in one piece, by integration over its height
        t = np.linspace(0, 2, 20001)
        nu, e = 0.1 + 0.15 * t, 1 + t
        strain = -(0.1 + 0.01 * (2 * (2 - t) - (4 - t**2) / 2)) * (1 + nu) * (1 - 2 * nu) / ((1 - nu) * e)
        exact = np.concatenate([[0], np.cumsum((strain[1:] + strain[:-1]) / 2 * 1e-4)])
        np.testing.assert_allclose(u[:, 2], np.interp(x[:, 2], t, exact), atol=5e-4 * np.abs(exact).max())


if __name__ == "__main__":
    main()
