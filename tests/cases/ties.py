"""Ties, bolts and cyclic symmetry: patch tests on meshes that do not fit, one body cut in two, closed forms."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import blocks  # noqa: E402
import cylinder  # noqa: E402
from dotyk_case import Case, main  # noqa: E402

YOUNG, POISSON = 1e5, 0.3
GRADIENT = np.array([[1e-3, 2e-3, 2e-3], [3e-3, -1e-3, 1e-3], [2e-3, -1e-3, 4e-3]])
MULTIGRID = "&solver response='multigrid', tolerance=1e-10 /"
MATERIAL = "&material name='steel', young=%r, poisson=%r /" % (YOUNG, POISSON)


def material(poisson=POISSON):
    return "&material name='steel', young=%r, poisson=%r /" % (YOUNG, poisson)


class Ties(Case):
    def two_blocks(self, kind_low, kind_up, n_low, n_up):
        """A block on another one, with meshes that do not fit."""
        d = blocks.dimension(kind_low)
        self.write("low.geo", blocks.block_geo(kind_low, n_low))
        self.write("up.geo", blocks.block_geo(kind_up, n_up, (0, 0, 1)[3 - d:]))
        return ["&scene mesh='low.geo'%s /" % (", analysis='plane_strain'" if d == 2 else ""),
                "&body name='low', volume='block', material='steel'%s /",
                "&body name='up', volume='block', material='steel', mesh='up.geo'%s /"]

    def solve(self, name, lines, code=0):
        """Log, summary and results of a scene."""
        self.write(name + ".nml", "\n".join(lines) + "\n")
        log = self.dotyk(name + ".nml", code=code)
        if code:
            return log
        file = self.results(name + ".vtkhdf")
        return log, dict(file["dotyk/summary"].attrs), file

    def test_patch(self):
        """Displacements that are linear in the position are exact, whatever meshes meet, and whatever solves the bodies."""
        for low, up, n_low, n_up, solver, tolerance in (
                ("tri3", "quad8", 3, 4, "", 1e-12), ("hex8", "tet4", 2, 3, "", 1e-12), ("tet10", "hex20", 2, 3, "", 1e-12),
                ("quad8", "tri6", 3, 4, MULTIGRID, 1e-9), ("tet10", "hex20", 2, 3, MULTIGRID, 1e-9),
                ("tet4", "hex20", 6, 3, MULTIGRID, 1e-9)):
            with self.subTest(low=low, up=up, solver=solver):
                d = blocks.dimension(low)
                a = GRADIENT[:d, :d]
                lines = self.two_blocks(low, up, n_low, n_up)
                formula = ", ".join("'%s'" % " + ".join("(%r)*%s" % (v, x) for v, x in zip(row.tolist(), "xyz")) for row in a)
                free = "sides x" if d == 2 else "sides *"
                lines = [lines[0], MATERIAL, *(line % "" for line in lines[1:])]
                for body, surface in ("low", "bottom"), ("low", free), ("up", "top"), ("up", free):
                    lines.append("&support body='%s', surface='%s', fix='%s', value_formula=%s /"
                                 % (body, surface, "xyz"[:d], formula))
                lines += ["&tie name='joint', surface_a='up:bottom', surface_b='low:top' /", solver]
                log, _, file = self.solve("patch", lines)
                self.assertEqual("with p-multigrid" in log, bool(solver))
                x, u = file["VTKHDF/Points"][:, :d], file["VTKHDF/PointData/displacement"][:, :d]
                self.assertLess(np.abs(u - x @ a.T).max(), tolerance * np.abs(u).max())

    def test_multigrid(self):
        """p-multigrid closes ties as the factors do, on bodies that are held, and that float together on a third one; its
        bound holds."""
        for name, more in (
                ("held", ["&support body='low', surface='bottom', fix='xyz' /", "&load body='up', surface='top', traction=3,2,-5 /"]),
                ("floating", ["&load body='up', surface='top', pressure=50 /",
                              "&body name='plate', volume='block', material='steel', mesh='plate.geo' /",
                              "&support body='plate', surface='bottom', fix='xyz' /",
                              "&contact name='rest', surface_a='low:bottom', surface_b='plate:top', "
                              "gap_formula='0.002*((x-0.4)^2+(y-0.5)^2)' /"])):
            with self.subTest(scene=name):
                self.write("plate.geo", blocks.block_geo("hex20", 2, (0, 0, -1)))
                lines = self.two_blocks("tet10", "hex20", 3, 4)
                lines = [lines[0], MATERIAL, *(line % "" for line in lines[1:]), *more,
                         "&tie name='joint', surface_a='up:bottom', surface_b='low:top' /"]
                exact = self.solve(name + "_dual", [*lines, "&solver response='full', tolerance=1e-9 /"])[1]
                log, summary, _ = self.solve(name, [*lines, "&solver response='multigrid', tolerance=1e-7 /"])
                self.assertIn("with p-multigrid", log)
                # | |u| - |u*| | <= |u - u*| in the energy norm.
                self.assertLess(abs(summary["strain_energy"] / exact["strain_energy"] - 1), 2 * summary["error_bound"] + 1e-12)
                self.assertLess(summary["error_bound"], 1e-7)

    def test_soft_plates(self):
        """Two plates that are tied face to face are stiffer than each of them: p-multigrid does not ask for forces of the
        tie that are as accurate as the bending of one plate alone would need. Its bound holds for the stresses."""
        self.write("low.geo", blocks.block_geo("hex20", (60, 2, 1), (0, 0, 0), (60, 2, 1)))
        self.write("up.geo", blocks.block_geo("hex20", (60, 2, 1), (0, 0, 1), (60, 2, 1)))
        lines = ["&scene mesh='low.geo' /", MATERIAL, "&body name='low', volume='block', material='steel' /",
                 "&body name='up', volume='block', material='steel', mesh='up.geo' /",
                 "&support body='low', surface='bottom', fix='xyz' /",
                 "&load body='up', surface='top', traction_formula='x/60', '0', '-y*x/60' /",
                 "&tie name='joint', surface_a='up:bottom', surface_b='low:top' /"]
        exact = self.solve("dual", [*lines, "&solver response='full', tolerance=1e-10 /"])[2]
        log, summary, file = self.solve("plates", [*lines, "&solver response='multigrid', tolerance=1e-8 /"])
        self.assertIn("with p-multigrid", log)
        self.assertLess(summary["error_bound"], 1e-8)
        stress = exact["VTKHDF/CellData/stress"][:]
        # Equal elements: squares of stresses are energies times 2 G for shear and 3 K for pressure.
        ratio = np.sqrt((1 + POISSON) / (1 - 2 * POISSON))
        self.assertLess(np.linalg.norm(file["VTKHDF/CellData/stress"][:] - stress) / np.linalg.norm(stress),
                        ratio * summary["error_bound"])

    def test_large_plates(self):
        """Plates so large that p-multigrid is looked at, tied along an edge, get factors, which cost less, and keep their
        tie: its rows were lost, and the loads of the upper plate found no support."""
        n, size = 200, (1, 0.02, 2)
        self.write("low.geo", blocks.block_geo("hex8", (90, 1, n), (0, 0, 0), size))
        self.write("up.geo", blocks.block_geo("hex8", (88, 1, n), (0, 0, 2), size))
        log, summary, _ = self.solve("plates", [
            "&scene mesh='low.geo' /", material(0.0), "&body name='low', volume='block', material='steel' /",
            "&body name='up', volume='block', material='steel', mesh='up.geo' /",
            "&support body='low', surface='bottom', fix='xyz' /", "&load body='up', surface='top', pressure=-100 /",
            "&tie name='joint', surface_a='up:bottom', surface_b='low:top' /", "&output error_parts='' /"])
        self.assertIn("'up': it costs less than p-multigrid", log)
        self.assertAlmostEqual(summary["strain_energy"] / (100**2 / (2 * YOUNG) * 0.08), 1, delta=1e-9)

    def test_area_tied(self):
        """Parts of slave facets beside the master surface are not tied, in the plane, around an axis and in space."""
        for kind, analysis, area in (("quad4", "plane_strain", 1.3 / 2), ("quad8", "axisymmetric", 1.3**2 / 4),
                                     ("hex8", "3d", 1.3 / 2)):
            with self.subTest(analysis=analysis):
                d = blocks.dimension(kind)
                self.write("low.geo", blocks.block_geo(kind, (2, 1, 1)[:d], (0, -1, 0)[:d] if d == 2 else (0, 0, -1), (1.3, 1, 1)[:d]))
                self.write("up.geo", blocks.block_geo(kind, (2, 1, 1)[:d], (0, 0, 0)[:d], (2, 1, 1)[:d]))
                log, _, file = self.solve("part", [
                    "&scene analysis='%s' /" % analysis, MATERIAL,
                    *("&body name='%s', mesh='%s.geo', volume='block', material='steel' /" % (b, b) for b in ("low", "up")),
                    "&support body='low', surface='bottom', fix='%s' /" % ("y" if analysis == "axisymmetric" else "xyz"[:d]),
                    "&load body='up', surface='top', pressure=-1 /",
                    "&tie name='joint', surface_a='up:bottom', surface_b='low:top' /"])
                self.assertAlmostEqual(file["dotyk/ties/area_tied"][0], area, delta=1e-9)
                self.assertIn("the rest of the slave area projects beside the master surface", log)

    def test_tension(self):
        """A bar of two tied blocks, turned, which slides on a plane: stress and energy are exact, and the two bodies float
        together."""
        lines = self.two_blocks("tet10", "hex20", 2, 3)
        placed = ", at=5,1,0, axis=1,2,3, angle=33"
        log, summary, file = self.solve("bar", [
            lines[0], MATERIAL, *(line % placed for line in lines[1:]), "&support body='low', surface='bottom', fix='n' /",
            "&load body='up', surface='top', pressure=-100 /",
            "&tie name='joint', surface_a='up:bottom', surface_b='low:top' /"])
        self.assertAlmostEqual(summary["energy_norm"]**2 / 2 / (100**2 / (2 * YOUNG) * 2), 1, delta=1e-10)
        force = file["dotyk/ties/force"][0]
        self.assertAlmostEqual(np.linalg.norm(force) / 100, 1, delta=1e-10)
        self.assertAlmostEqual(-(force @ file["dotyk/loads/force"][0]) / 100**2, 1, delta=1e-10)
        self.assertRegex(log, "not determined by contact: sliding along .* of 'low', 'up'; least motion taken")
        self.assertNotIn("carry nothing", log)
        self.assertLess(summary["error_discretization"], 1e-9)

    def test_tube(self):
        """Two tubes, one in the other, with meshes that do not fit: Lame's energy, and its order."""
        errors = []
        for n in 1, 2:
            for name, kind, inner, outer, m in ("inner", "quad8", 1.0, 1.5, 2 * n), ("outer", "tri6", 1.5, 2.0, 3 * n):
                self.write(name + ".geo", cylinder.geometry(kind, m, inner=inner, outer=outer))
            lines = ["&scene mesh='inner.geo', analysis='plane_strain' /", MATERIAL]
            for name in "inner", "outer":
                lines.append("&body name='%s', volume='tube', mesh='%s.geo', material='steel' /" % (name, name))
                lines += cylinder.held(name, "plane_strain")
            summary = self.solve("tube", [*lines, "&load body='inner', surface='inside', pressure=100 /",
                                          "&tie name='joint', surface_a='outer:inside', surface_b='inner:outside' /"])[1]
            u = (1 + POISSON) * 100 / (YOUNG * 3) * (1 - 2 * POISSON + 4)
            errors.append(abs(summary["energy_norm"]**2 / (np.pi / 2 * 100 * u) - 1)**0.5)
            self.assertBetween(0.6, summary["error_discretization"] / errors[-1], 2.0)
        self.assertBetween(3.0, errors[0] / errors[1], 5.5)

    def test_contact_beside(self):
        """Two tied blocks lie on a plate, which the joint runs into, under a pressure that tilts them: contact below is
        that of one block of the same mesh, whichever side is the slave; the vertices of the plate are at the joint, or beside it."""
        for slave, n in (("block", 4), ("plate", 4), ("plate", 7)):
            with self.subTest(slave=slave, n=n):
                self.compare_beside(slave, n)

    def test_other_roles(self):
        """A body that is the slave of one of two tied bodies and the master of the other one: the sides of the second pair are
        exchanged, and the pressures are those of the same roles."""
        lines = ["&scene analysis='plane_strain', mesh='plate.geo' /", MATERIAL,
                 "&body name='plate', volume='block', material='steel' /", "&support body='plate', surface='bottom', fix='xy' /"]
        self.write("plate.geo", blocks.block_geo("quad4", (4, 1), (-0.5, -1), (3, 1)))
        for name, x in ("left", 0), ("right", 1):
            self.write(name + ".geo", blocks.block_geo("quad4", 2, (x, 0)) + 'Physical Curve("joint") = {Curve In BoundingBox '
                       "{0.99, -1, -1, 1.01, 2, 1}};\n")
            lines += ["&body name='%s', volume='block', material='steel', mesh='%s.geo' /" % (name, name),
                      "&load body='%s', surface='top', pressure=1 /" % name]
        lines.append("&tie name='joint', surface_a='left:joint', surface_b='right:joint' /")
        contact = "&contact name='%s', surface_a='%s', surface_b='%s' /"
        found = []
        for right, exchanges in (("right:bottom", "plate:top"), False), (("plate:top", "right:bottom"), True):
            log, _, file = self.solve("roles", [*lines, contact % ("one", "left:bottom", "plate:top"), contact % ("two", *right)])
            self.assertEqual(exchanges, "'two': surface_a and surface_b are exchanged, as contact goes on across the tie 'joint'" in log)
            self.assertNotIn("warning", log)
            found.append(np.concatenate([file["dotyk/contact"][name]["pressure"][()] for name in ("one", "two")]))
        np.testing.assert_allclose(found[1], found[0], rtol=1e-9)

    def compare_beside(self, slave, n_plate):
        found, pressure = [], []
        for parts in ("left", "right"), ("both",):
            self.write("plate.geo", blocks.block_geo("hex8", (n_plate, 4, 2), (-0.5, -0.5, -1), (3, 2, 1)))
            lines = ["&scene mesh='plate.geo' /", MATERIAL, "&body name='plate', volume='block', material='steel' /",
                     "&support body='plate', surface='bottom', fix='xyz' /"]
            for name, n, x, width in ("left", 2, 0, 1), ("right", 2, 1, 1), ("both", 4, 0, 2):
                if name not in parts:
                    continue
                text = blocks.block_geo("hex8", (n, 2, 2), (x, 0, 0), (width, 1, 1))
                self.write(name + ".geo", text + 'Physical Surface("joint") = {Surface In BoundingBox '
                           "{0.99, -1, -1, 1.01, 2, 2}};\n")
                lines += ["&body name='%s', volume='block', material='steel', mesh='%s.geo' /" % (name, name),
                          "&load body='%s', surface='top', pressure_formula='100*(1+x)' /" % name,
                          "&contact name='%s', surface_a='%s', surface_b='%s', theta=0 /" % (
                              name, *((name + ":bottom", "plate:top")[::1 if slave == "block" else -1]))]
            if len(parts) == 2:
                lines.append("&tie name='joint', surface_a='left:joint', surface_b='right:joint' /")
            file = self.solve("beside", lines)[2]
            found.append([file["dotyk/summary"].attrs["energy_norm"]**2,
                          sum(file["dotyk/contact"][name].attrs["force"][2] for name in parts)])
            pressure.append({tuple(x[:2]): p for name in parts for x, p in zip(
                file["dotyk/contact"][name]["position"][()], file["dotyk/contact"][name]["pressure"][()])})
        self.assertAlmostEqual(found[0][0] / found[1][0], 1, delta=1e-9)
        np.testing.assert_allclose([abs(force) for _, force in found], 400, rtol=1e-9)
        peak = max(pressure[1].values())
        for place, value in pressure[0].items():
            self.assertAlmostEqual(value / peak, pressure[1][place] / peak, delta=1e-9, msg=place)

    def beside(self, name, cells, kind, n_plate, wide, poisson, load, slave="block", solver=""):
        """Pressures at the slave vertices below blocks side by side, tied to each other, on a plate."""
        lines = ["&scene mesh='plate.geo' /", material(poisson), "&body name='plate', volume='block', material='steel' /",
                 "&support body='plate', surface='bottom', fix='xyz' /", solver]
        self.write("plate.geo", blocks.block_geo(kind, n_plate, (-wide, -wide, -1), (2 + 2 * wide, 1 + 2 * wide, 1)))
        for body, (n, x, width) in cells.items():
            self.write(body + ".geo", blocks.block_geo(kind, n, (x, 0, 0), (width, 1, 1)) +
                       'Physical Surface("joint") = {Surface In BoundingBox {0.99, -1, -1, 1.01, 2, 2}};\n')
            lines += ["&body name='%s', volume='block', material='steel', mesh='%s.geo' /" % (body, body),
                      "&load body='%s', surface='top', %s /" % (body, load),
                      "&contact name='%s', surface_a='%s', surface_b='%s', theta=0 /" % (
                          body, *((body + ":bottom", "plate:top")[::1 if slave == "block" else -1]))]
        if len(cells) == 2:
            lines.append("&tie name='joint', surface_a='left:joint', surface_b='right:joint' /")
        log, _, file = self.solve(name, lines)
        self.assertNotIn("warning", log)
        return {body: [(tuple(x[:2]), p) for x, p in zip(file["dotyk/contact"][body]["position"][()],
                                                         file["dotyk/contact"][body]["pressure"][()])] for body in cells}

    def test_seams_that_do_not_fit(self):
        """The pressure below two tied blocks is one function, whatever meshes meet at the seam: uniform where it is, and
        between those of one block of either mesh where it is not."""
        for kind, solver in ("hex8", ""), ("hex20", ""), ("hex20", MULTIGRID):
            for slave in "block", "plate":
                with self.subTest(kind=kind, solver=solver, slave=slave):
                    of_body = self.beside("even", {"left": ((2, 4, 2), 0, 1), "right": ((2, 5, 2), 1, 1)}, kind, (3, 3, 2), 0, 0,
                                          "pressure=100", slave, solver)
                    for values in of_body.values():
                        np.testing.assert_allclose([p for _, p in values], 100, rtol=1e-6)
        found = self.beside("two", {"left": ((4, 4, 4), 0, 1), "right": ((4, 5, 4), 1, 1)}, "hex8", (7, 6, 3), 0.5, POISSON,
                            "pressure_formula='100*(1+x)'")
        ends = [[], []]
        inside = [[], []]
        for k, n in enumerate((4, 5)):
            for (x, y), p in self.beside("one", {"both": ((8, n, 4), 0, 2)}, "hex8", (7, 6, 3), 0.5, POISSON,
                                         "pressure_formula='100*(1+x)'")["both"]:
                if abs(x - 1) < 1e-9:
                    (ends if min(y, 1 - y) < 1e-9 else inside)[k].append(p)
        for values in found.values():
            for (x, y), p in values:
                if abs(x - 1) > 1e-9:
                    continue
                low, high = (ends[0][0], ends[1][0]) if min(y, 1 - y) < 1e-9 else (min(map(min, inside)), max(map(max, inside)))
                self.assertGreater(p, 0.995 * low)
                self.assertLess(p, 1.005 * high)

    def test_bolt(self):
        """A bar between walls, cut by a bolt: tension and shortening as F L = E A s, given either of them."""
        lines = self.two_blocks("tet10", "hex20", 2, 3)
        placed = ", at=5,1,0, axis=1,2,3, angle=33"
        for key, value in ("force", 50.0), ("shortening", 1e-3):
            summary, file = self.solve("bolt", [
                lines[0], material(0.0), *(line % placed for line in lines[1:]),
                "&support body='low', surface='bottom', fix='nt' /", "&support body='up', surface='top', fix='nt' /",
                "&bolt name='bolt', surface_a='up:bottom', surface_b='low:top', %s=%r /" % (key, value)])[1:]
            self.assertAlmostEqual(file["dotyk/ties/tension"][0], 50, delta=1e-8)
            self.assertAlmostEqual(file["dotyk/ties/shortening"][0], 1e-3, delta=1e-13)
            self.assertAlmostEqual(summary["energy_norm"]**2, 0.05, delta=1e-11)
        self.assertAlmostEqual(summary["energy"], 0.025, delta=1e-11)

    def test_soft_springs(self):
        """Tied blocks on springs far softer than they are: the displacement is F/k, which the bound knows."""
        for stiffness in 1e-3, 1e-6:
            lines = self.two_blocks("hex8", "hex8", 2, 3)
            _, summary, file = self.solve("soft", [
                lines[0], MATERIAL, *(line % "" for line in lines[1:]),
                "&spring body='low', surface='bottom', fix='xyz', stiffness=%r /" % stiffness,
                "&load body='up', surface='top', pressure=1e-6 /",
                "&tie name='joint', surface_a='up:bottom', surface_b='low:top' /"])
            u = file["VTKHDF/PointData/displacement"][:, 2]
            np.testing.assert_allclose(u, -1e-6 / stiffness, rtol=1e-6)
            self.assertLess(summary["error_bound"], 1e-7)

    def test_locked_bolt(self):
        """A bolt between walls is tightened, locked while a wall moves, and tightened again: tensions by E A/L."""
        lines = self.two_blocks("tet10", "hex20", 1, 2)
        self.write("locked.nml", "\n".join([
            lines[0], material(0.0), *(line % "" for line in lines[1:]),
            "&support body='low', surface='bottom', fix='nt' /",
            "&support body='up', surface='top', fix='nt', value=0,0,1e-3, case='pulled', 'again' /",
            "&bolt name='bolt', surface_a='up:bottom', surface_b='low:top', force=50, case='tight', 'again' /",
            *("&case name='%s' /" % name for name in ("slack", "tight", "pulled", "again", "released"))]) + "\n")
        self.dotyk("locked.nml")
        cases = self.results("locked.vtkhdf")["dotyk/cases"]
        for name, tension, shortening in (("slack", 0, 0), ("tight", 50, 1e-3), ("pulled", 100, 1e-3), ("again", 50, 0),
                                          ("released", 0, 0)):
            self.assertAlmostEqual(cases[name]["ties/tension"][0], tension, delta=1e-8, msg=name)
            self.assertAlmostEqual(cases[name]["ties/shortening"][0], shortening, delta=1e-13, msg=name)

    def test_clamp(self):
        """A bolt of two floating halves, of three tied blocks each, clamps a plate by contact: its tension is the contact
        force. The joint stiffness is that of springs in series where nothing bends: all in pure tension or pressure."""
        self.write("plate.geo", blocks.block_geo("hex8", (2, 2, 2), (0, 0, 0), (1, 1, 1)))
        self.write("cap.geo", blocks.block_geo("hex8", (3, 1, 1), (0, 0, 1), (3, 1, 0.5)))
        self.write("base.geo", blocks.block_geo("hex8", (3, 1, 1), (0, 0, -0.5), (3, 1, 0.5)))
        self.write("half.geo", blocks.block_geo("tet4", (2, 2, 1), (2, 0, 0), (1, 1, 0.5)))
        lines = ["&scene mesh='plate.geo' /", material(0.0), "&body name='plate', volume='block', material='steel' /"]
        for name, mesh, place in (("cap", "cap", ""), ("base", "base", ""), ("low", "half", ""),
                                  ("up", "half", ", at=0,0,0.5")):
            lines.append("&body name='%s', volume='block', material='steel', mesh='%s.geo'%s /" % (name, mesh, place))
        lines += ["&tie name='above', surface_a='up:top', surface_b='cap:bottom' /",
                  "&tie name='below', surface_a='low:bottom', surface_b='base:top' /",
                  "&bolt name='bolt', surface_a='low:top', surface_b='up:bottom', force=50 /",
                  "&contact name='top', surface_a='plate:top', surface_b='cap:bottom', theta=0 /",
                  "&contact name='bottom', surface_a='plate:bottom', surface_b='base:top', theta=0 /",
                  # Guides: caps that do not tilt.
                  "&support body='cap', surface='sides *', fix='xy' /", "&support body='base', surface='sides *', fix='xy' /",
                  "&support body='base', surface='bottom', fix='xyz' /", "&support body='cap', surface='top', fix='xy' /"]
        file = self.solve("clamp", lines)[2]
        self.assertEqual(file["dotyk/ties"].attrs["names"], b"above\nbelow\nbolt")
        np.testing.assert_allclose(file["dotyk/ties/tension"][2], 50, rtol=1e-9)
        np.testing.assert_allclose(file["dotyk/ties/force"][:, 2], [50, -50, 50], rtol=1e-9)
        for name, sign in ("top", -1), ("bottom", 1):
            np.testing.assert_allclose(file["dotyk/contact"][name].attrs["force"][2], sign * 50, rtol=1e-9)
        # Plate and bolt, each of length 1 and area 1, and caps that bend.
        self.assertGreater(file["dotyk/ties/shortening"][2], 2 * 50 / YOUNG)

    def test_cyclic(self):
        """A sector of a ring, pressed into an outer ring, stands for all of them: energy and pressures are those of the
        whole ring, on the same mesh of linear elements, where ties hold in each node; the pressure is greatest at the cut,
        which has one row for both sides."""
        def sector(n, whole):
            text = ""
            sectors = 6 if whole else 1
            for i, (name, a, b) in enumerate((("inner", 1, 1.5), ("outer", 1.5, 2))):
                p, faces, ins, outs = 1000 * (i + 1), [], [], []
                text += "Point(%d) = {%r, 0, 0};\nw%d_0() = Extrude {%r, 0, 0} { Point{%d}; Layers{%d}; };\n" % (
                    p, a, i, b - a, p, n)
                for s in range(sectors):
                    text += ("f%d_%d() = Extrude {{0, 0, 1}, {0, 0, 0}, Pi/3} { Curve{w%d_%d(%d)}; Layers{%d}; Recombine; };\n"
                             "w%d_%d() = {f%d_%d(0)};\n" % (i, s, i, s, 1 if s == 0 else 0, 3 * n, i, s + 1, i, s))
                    faces.append("f%d_%d(1)" % (i, s))
                    ins.append("Abs(f%d_%d(3))" % (i, s))
                    outs.append("Abs(f%d_%d(2))" % (i, s))
                for kind, what, entities in (("Surface", name, faces), ("Curve", name + " in", ins),
                                             ("Curve", name + " out", outs)):
                    text += 'Physical %s("%s") = {%s};\n' % (kind, what, ", ".join(entities))
                if not whole:
                    text += ('Physical Curve("%s a") = {w%d_0(1)};\nPhysical Curve("%s b") = {Abs(f%d_0(0))};\n'
                             % (name, i, name, i))
            return text + ("Coherence Mesh;\n" if whole else "")
        energy, pressure = [], []
        for whole in False, True:
            self.write("ring.geo", sector(2, whole))
            lines = ["&scene mesh='ring.geo', analysis='plane_stress' /", MATERIAL,
                     "&contact name='fit', surface_a='inner:inner out', surface_b='outer:outer in', gap=-1e-3, theta=0, geometry='elements' /",
                     "&load body='inner', surface='inner in', pressure_formula='100*(1+0.5*cos(6*atan2(y,x)))' /"]
            for name in "inner", "outer":
                lines.append("&body name='%s', volume='%s', material='steel' /" % (name, name))
                if not whole:
                    lines.append("&tie name='%s', surface_a='%s:%s a', surface_b='%s:%s b', angle=-60 /"
                                 % (name, name, name, name, name))
            _, summary, file = self.solve("ring", [*lines, "&solver tolerance=1e-10 /"])
            energy.append(summary["energy_norm"]**2 * (1 if whole else 6))
            fit = file["dotyk/contact/fit"]
            pressure.append(dict(zip(map(tuple, np.round(fit["position"][()], 9) + 0.0), fit["pressure"][()])))
        self.assertAlmostEqual(energy[0] / energy[1], 1, delta=1e-9)
        peak = max(pressure[1].values())
        for place, value in pressure[0].items():
            self.assertAlmostEqual(value / peak, pressure[1][place] / peak, delta=1e-8, msg=place)

    def test_sector_of_another_angle(self):
        text = "\n".join(["Point(1) = {1, 0, 0};", "w() = Extrude {1, 0, 0} { Point{1}; Layers{4}; };",
                          "f() = Extrude {{0, 0, 1}, {0, 0, 0}, Pi/6} { Curve{w(1)}; Layers{3}; Recombine; };",
                          'Physical Surface("ring") = {f(1)};', 'Physical Curve("a") = {w(1)};',
                          'Physical Curve("b") = {Abs(f(0))};', 'Physical Curve("in") = {Abs(f(3))};', ""])
        self.write("sector.geo", text)
        lines = ["&scene mesh='sector.geo', analysis='plane_stress' /", MATERIAL, "&body name='ring', volume='ring', material='steel' /",
                 "&tie name='sides', surface_a='ring:a', surface_b='ring:b', angle=%s /",
                 "&load body='ring', surface='in', pressure=1 /"]
        for angle, code in (-30, 0), (-31, 2), (-29, 2):
            with self.subTest(angle=angle):
                name = "turned %d" % angle
                log = self.solve(name, ["\n".join(lines) % angle], code=code)
                if code:
                    for words in ":4: ", "'sides'", "angle=%d" % angle, "'b'", "'a'", "360/n":
                        self.assertIn(words, log)
                    self.assertFalse((self.folder / (name + ".vtkhdf")).exists())
        # Tied once more, the sides exchanged.
        lines.append("&tie name='again', surface_a='ring:b*', surface_b='ring:a*', angle=30 /")
        log = self.solve("twice", ["\n".join(lines) % -30], code=2)
        self.assertIn("'again' ties faces that 'sides' (line 4) ties to each other already", log)

    def test_curved_cuts(self):
        """Two rings that touch, cut along one spiral, are sectors that are cut alike; turned against each other they are
        not, which is told."""
        def ring(name, inside, outside, turned):
            text = "Point(99) = {0, 0, 0};\n"
            for side in 0, 1:
                for i in range(4):
                    r = inside + (outside - inside) * i / 3
                    angle = np.radians(40 * (r - 1) + 60 * side + turned)
                    text += "Point(%d) = {%.17g, %.17g, 0};\n" % (10 * side + i + 1, r * np.cos(angle), r * np.sin(angle))
                text += "Spline(%d) = {%s};\n" % (side + 1, ", ".join(str(10 * side + i + 1) for i in range(4)))
            text += ("Circle(3) = {1, 99, 11}; Circle(4) = {4, 99, 14}; Curve Loop(1) = {1, 4, -2, -3}; Plane Surface(1) = {1};\n"
                     "Transfinite Curve{1, 2} = 4; Transfinite Curve{3, 4} = 10;\n"
                     'Physical Surface("ring") = {1}; Physical Curve("a") = {1}; Physical Curve("b") = {2};\n'
                     'Physical Curve("in") = {3}; Physical Curve("out") = {4};\n')
            self.write(name + ".geo", text)
        for turned in 0, 7:
            ring("inner", 1, 1.5, 0)
            ring("outer", 1.5, 2, turned)
            lines = ["&scene analysis='plane_stress' /", MATERIAL]
            for name, sides in ("inner", "surface_a='inner:b', surface_b='inner:a', angle=60"), (
                    "outer", "surface_a='outer:a', surface_b='outer:b', axis=0,0,-1, angle=60"):
                lines += ["&body name='%s', mesh='%s.geo', volume='ring', material='steel' /" % (name, name),
                          "&tie name='%s', %s /" % (name, sides)]
            lines += ["&contact name='fit', surface_a='inner:out', surface_b='outer:in' /"]
            self.write("spiral.nml", "\n".join(lines) + "\n")
            log = self.dotyk("spiral.nml", "--check")
            self.assertEqual("joins sectors that are cut 7 degrees apart" in log, turned == 7)
            self.assertEqual("degrees apart" in log, turned == 7)

    def test_contact_between_tied_edges(self):
        """Contact rows of vertices that ties hold on both sides carry nothing, however the scene is turned."""
        kind = "quad4"
        self.write("c.geo", blocks.block_geo(kind, (4, 2), (0, -1), (2, 1)))
        for name, x in ("a", 0), ("b", 1):
            self.write(name + ".geo", blocks.block_geo(kind, (2, 2), (x, 0), (1, 1)))
        for angle in 0, 20, 33:
            lines = ["&scene analysis='plane_strain' /", MATERIAL]
            lines += ["&body name='%s', mesh='%s.geo', volume='block', material='steel', at=0.3,0.1, axis=0,0,1, angle=%r /"
                      % (b, b, angle) for b in "abc"]
            lines += ["&support body='c', surface='bottom', fix='xy' /", "&load body='a', surface='top', pressure=7 /",
                      "&load body='b', surface='top', pressure=3 /", "&contact name='k', surface_a='a:sides x', surface_b='b:sides x', theta=0 /",
                      *("&tie name='%s', surface_a='%s:bottom', surface_b='c:top' /" % (b, b) for b in "ab")]
            self.write("edge.nml", "\n".join(lines) + "\n")
            self.dotyk("edge.nml")
            summary = self.results("edge.vtkhdf")["dotyk/summary"].attrs
            if angle == 0:
                energy = summary["energy"]
            self.assertAlmostEqual(summary["energy"] / energy, 1, delta=1e-12)
            self.assertEqual(self.results("edge.vtkhdf")["dotyk/contact/k/pressure"][:].max(), 0)

    def test_rigid_coupling(self):
        """A face tied to a rigid surface moves as that does: tension and bending of a bar by force and moment, or by the
        motions that they cause."""
        self.write("bar.geo", blocks.block_geo("hex20", (2, 2, 3), (0, 0, 0), (1, 1, 4)))
        at = ", at=1,2,3, axis=1,2,3, angle=33"
        a, angle = np.array([1, 2, 3]) / np.sqrt(14), np.radians(33)
        cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
        rotate = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        end = rotate @ [0.5, 0.5, 4] + [1, 2, 3]
        lines = ["&scene mesh='bar.geo' /", "&material name='steel', young=1e5, poisson=0 /",
                 "&body name='bar', volume='block', material='steel'%s /" % at,
                 "&body name='cap', surface='top', facing=0.5,0.5,2%s /" % at, "&support body='bar', surface='bottom', fix='xyz' /",
                 "&tie name='coupling', surface_a='bar:top', surface_b='cap:top' /"]
        text = "%.15g,%.15g,%.15g"
        # The linear traction of bending is not in the space of the multipliers on quadratic facets.
        for bending, tolerance in (0, 1e-9), (20, 2e-3):
            force, moment, theta = rotate @ [0, 0, 100], rotate @ [bending, 0, 0], bending / (1e5 / 12) * 4
            shift, turn = rotate @ [0, -theta * 4 / 2, 100 * 4 / 1e5], rotate @ [theta, 0, 0]
            for more in ("&rigid_body body='cap' /\n&load body='cap', surface='top', force=%s, moment=%s, point=%s /"
                         % (text % tuple(force), text % tuple(moment), text % tuple(end)),
                         "&rigid_body body='cap', fix='xyz rx ry rz', point=%s, value=%s, rotation=%s /"
                         % (text % tuple(end), text % tuple(shift), text % tuple(turn))):
                self.write("case.nml", "\n".join([*lines, more]) + "\n")
                self.dotyk("case.nml")
                file = self.results("case.vtkhdf")
                self.assertAlmostEqual(file["dotyk/bodies/strain_energy"][0] / (0.2 + bending * theta / 2), 1, delta=tolerance)
                np.testing.assert_allclose(file["dotyk/ties/force"][0], force, atol=100 * tolerance)
                np.testing.assert_allclose(file["dotyk/ties/moment"][0] - np.cross(end, force), moment, atol=100 * tolerance)
                points, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
                top = np.abs((points - [1, 2, 3]) @ rotate[:, 2] - 4) < 1e-9
                exact = shift + np.cross(turn, points[top] - end)
                np.testing.assert_allclose(u[top], exact, atol=tolerance * np.abs(exact).max())
        self.write("case.nml", "\n".join([*lines[:4], "&rigid_body body='*' /", *lines[5:]]) + "\n")
        self.assertIn("case.nml:6: &tie: both bodies are rigid", self.dotyk("case.nml", code=2))

    def test_faces_that_are_tied(self):
        """Faces are tied once, whatever their surfaces are called."""
        for name, z in ("low", 0), ("up", 1):
            self.write(name + ".geo", blocks.block_geo("hex8", 2, (0, 0, z)))
        lines = ["&scene /", MATERIAL, *("&body name='%s', mesh='%s.geo', volume='block', material='steel' /" % (b, b)
                                         for b in ("low", "up")), "&support body='low', surface='bottom', fix='xyz' /"]
        self.write("case.nml", "\n".join([*lines, "&tie name='one', surface_a='up:bottom', surface_b='low:top' /",
                                          "&tie name='two', surface_a='up:bott*', surface_b='low:top' /"]) + "\n")
        self.assertIn("'two' ties faces that 'one' (line 6) ties to each other already", self.dotyk("case.nml", code=2))

    def test_motion_without_strain(self):
        """A support that moves a tied group leaves no strain, and its rounding is no error."""
        for name, z in ("low", 0), ("up", 1):
            self.write(name + ".geo", blocks.block_geo("hex8", 2 + z, (0, 0, z)))
        for value in "value=1,2,3", "value_formula='1e-3*(y-2*z)', '1e-3*(-x+3*z)', '1e-3*(2*x-3*y)'":
            self.write("case.nml", "\n".join([
                "&scene /", MATERIAL, *("&body name='%s', mesh='%s.geo', volume='block', material='steel' /" % (b, b)
                                        for b in ("low", "up")), "&support body='low', surface='bottom', fix='xyz', %s /" % value,
                "&tie name='one', surface_a='up:bottom', surface_b='low:top' /"]) + "\n")
            self.dotyk("case.nml")

    def test_refused(self):
        lines = self.two_blocks("hex8", "hex8", 1, 2)
        lines = [lines[0], MATERIAL, *(line % "" for line in lines[1:]), "&support body='low', surface='bottom', fix='xyz' /"]
        tie = "&tie name='joint', surface_a='up:bottom', surface_b='low:top'%s /"
        for extra, code, texts in (
                ([tie.replace("low:top", "low:bottom") % ""], 2, ("case.nml:6: &tie 'joint': none of the",)),
                ([tie.replace("up:bottom", "low:bottom") % ""], 2, ("a tie without an angle needs two different bodies, got 'low' twice",)),
                ([tie % ", axis=0,0,1"], 2, ("axis is given without an angle",)),
                ([tie % "", "&solver scheme='neumann', theta_mesh=0.1 /"], 2, ("scheme='neumann' knows no ties",)),
                ([tie % "", "&contact name='k', surface_a='up:bottom', surface_b='low:top' /"], 2,
                 ("case.nml:7: &contact 'k'", "is in part between the faces that 'joint' (line 6) ties",)),
                ([(tie % "").replace("tie", "bolt")], 2, ("'force' or 'shortening' is missing",)),
                ([(tie % ", force=1, shortening=1").replace("tie", "bolt")], 2, ("only one can be meant",)),
                ([(tie % ", force=1").replace("tie", "bolt")], 3, ("no equilibrium", "the tension of &bolt '", "' (line ")),
                ([tie % "", "&support body='low', surface='top', fix='xyz' /",
                  "&support body='up', surface='bottom', fix='xyz', value=1,0,0 /"], 3, ("case.nml: tie 'joint' cannot be closed",))):
            with self.subTest(extra=extra):
                log = self.solve("case", [*lines, *extra], code=code)
                for text in texts:
                    self.assertIn(text, log)
                self.assertFalse((self.folder / "case.vtkhdf").exists())


if __name__ == "__main__":
    main()
