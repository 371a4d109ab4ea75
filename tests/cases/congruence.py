#!/usr/bin/python3
"""Congruent bodies share a factorization: the same solution as without sharing, and as with a mesh that holds every
body."""
import numpy as np

import dotyk_case
from blocks import block_geo, dimension, mesh

E, V, PRESSURE = 30.0, 0.2, 0.06  # Young's modulus, Poisson's ratio, pressure on the chain

def repeated(msh, n, shift):
    """The text of a mesh (2.2, ASCII) with n copies, each moved by `shift` from the one before: volumes 'block1',
    'block2', ..."""
    lines = msh.read_text().split("\n")

    def section(name):
        start = lines.index("$" + name)
        return [line.split(None, 2 if name == "PhysicalNames" else -1)
                for line in lines[start + 2:lines.index("$End" + name)]]

    names = {words[2]: words[:2] for words in section("PhysicalNames")}
    volume = names.pop('"block"')
    nodes, elements = section("Nodes"), section("Elements")
    step = max(int(words[0]) for words in nodes)
    groups = [(*words, name) for name, words in names.items()] + [
        (volume[0], 100 + k, '"block%d"' % k) for k in range(1, n + 1)]
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", len(groups)]
    text += ["%s %s %s" % group for group in groups] + ["$EndPhysicalNames", "$Nodes", n * len(nodes)]
    for k in range(n):
        for words in nodes:
            x = np.array(list(map(float, words[1:]))) + k * np.array(shift)
            text.append("%d %r %r %r" % (int(words[0]) + k * step, *map(float, x)))
    text += ["$EndNodes", "$Elements", n * len(elements)]
    for k in range(n):
        for i, words in enumerate(elements):
            tags = int(words[2])
            group = 101 + k if words[3] == volume[1] else int(words[3])
            text.append(" ".join(map(str, [k * len(elements) + i + 1, words[1], 2, group, words[4],
                                           *[int(word) + k * step for word in words[3 + tags:]]])))
    text += ["$EndElements", ""]
    return "\n".join(map(str, text))


class Congruence(dotyk_case.Case):
    def run_scene(self, lines, solver, share=True, scene=""):
        """Solve; everything that is to be the same with and without shared factors. Bodies with a modulus field share
        none."""
        text = ["&scene %s /" % scene, "&material name='m', young=%r, poisson=%r /" % (E, V), *lines,
                "&solver %s /" % solver]
        if not share:
            text = [line.replace("&material ", "&material young_formula='1', ") for line in text]
        self.write("case.nml", "\n".join(text) + "\n")
        self.printed = self.dotyk("case.nml", "--output", "shared.vtkhdf" if share else "own.vtkhdf")
        file = self.results("shared.vtkhdf" if share else "own.vtkhdf")
        self.summary = dict(file["dotyk/summary"].attrs)
        self.class_of = file["dotyk/summary/congruence_class"][:].tolist()
        found = {name: pair["pressure"][:] for name, pair in file["dotyk/contact"].items()}
        found["forces"] = np.array([pair.attrs["force"] for pair in file["dotyk/contact"].values()])
        found["displacement"] = file["VTKHDF/PointData/displacement"][:]
        found["stress"] = file["VTKHDF/CellData/stress"][:]
        found["energy"] = np.array([self.summary["energy"], self.summary["energy_norm"]])
        found["errors"] = np.array([1.0, self.summary["error_discretization"]])
        if self.summary["error_discretization"] > 1e-6:
            found["errors of elements"] = file["VTKHDF/CellData/discretization_error"][:]
        file.close()
        return found

    def compare(self, one, other, tolerance=1e-10):
        for name in one:
            np.testing.assert_allclose(one[name], other[name], rtol=0, atol=tolerance * np.abs(one[name]).max(),
                                       err_msg=name)

    def check(self, lines, classes, solver, tolerance=1e-10, **options):
        """The same with and without shared factors; `classes` is the number of factorizations with them."""
        own = self.run_scene(lines, solver, False, **options)
        n = sum(line.startswith("&body") for line in lines)
        self.assertEqual(self.summary["factorizations"], n)
        self.assertEqual(self.class_of, list(range(1, n + 1)))
        self.assertNotIn("congruence class", self.printed)
        entries = self.summary["factor_nonzeros"]
        shared = self.run_scene(lines, solver, True, **options)
        self.assertEqual(self.summary["factorizations"], classes)
        self.assertEqual(len(set(self.class_of)), classes)
        for body, first in enumerate(self.class_of, 1):
            self.assertLessEqual(first, body, self.class_of)
            self.assertEqual(self.class_of[first - 1], first, self.class_of)
        self.assertIn("%d bodies in %d congruence class%s: %d factorization"
                      % (n, classes, "es"[:2*(classes > 1)], classes), self.printed)
        if "linear_solver='direct'" in solver:
            self.assertAlmostEqual(self.summary["factor_nonzeros"] / entries, classes / n, delta=0.5 * classes / n)
        self.compare(own, shared, tolerance)
        return shared

    def chain(self, n, d, where):
        """Blocks on top of each other between smooth walls, pressed at the end; `where` gives the keys that place a
        block."""
        up = "xyz"[d - 1]
        lines = []
        for k in range(1, n + 1):
            name = "b%d" % k
            lines.append("&body name='%s', material='m', %s /" % (name, where(k)))
            lines += ["&support body='%s', surface='sides %s', fix='%s' /" % (name, axis, axis)
                      for axis in "xy"[:d - 1]]
            if k > 1:
                lines.append("&contact name='c%02d', surface_a='b%d:top', surface_b='%s:bottom' /" % (k, k - 1, name))
        lines.append("&support body='b1', surface='bottom', fix='%s' /" % up)
        lines.append("&load body='b%d', surface='top', pressure=%r /" % (n, PRESSURE))
        return lines

    def check_chain(self, kind, solver, theta=0.0):
        """The first block is held from below, the others are alike: a load is no difference."""
        n, d = 5, dimension(kind)
        geo = self.write("block.geo", block_geo(kind, 2, (0,) * d, (1,) * d))
        scene = "analysis='%s'" % ("3d" if d == 3 else "plane_strain")
        at = lambda k: "at=" + ", ".join(["0"] * (d - 1) + [str(k - 1)])
        placed = self.chain(n, d, lambda k: "volume='block', mesh='block.geo', " + at(k))
        found = self.check(placed, 2, "theta=%r, tolerance=1e-12, %s" % (theta, solver), scene=scene)
        for k in range(2, n + 1):
            np.testing.assert_allclose(found["c%02d" % k], PRESSURE, rtol=1e-9)
        # Each layer shortens by s (1+v)(1-2v)/(E(1-v)), plane strain between walls is the same.
        shortening = PRESSURE * (n * (1 + V) * (1 - 2 * V) / (E * (1 - V)) + (n - 1) * theta)
        np.testing.assert_allclose(found["displacement"][:, d - 1].min(), -shortening, rtol=1e-9)
        # Drawn n times in one mesh, there and with shared factors.
        self.write("chain.msh", repeated(mesh(geo, d), n, [0] * (d - 1) + [1] + [0] * (3 - d)))
        drawn = self.run_scene(self.chain(n, d, lambda k: "volume='block%d', mesh='chain.msh'" % k),
                               "theta=%r, tolerance=1e-12, %s" % (theta, solver), scene=scene)
        self.assertEqual(self.summary["factorizations"], 2)
        self.compare(found, drawn)

    def test_chain(self):
        self.check_chain("hex8", "linear_solver='direct'")
        self.check_chain("tet10", "linear_solver='direct'", theta=1e-3)
        self.check_chain("tet4", "linear_solver='iterative'", theta=1e-3)
        self.check_chain("quad8", "linear_solver='direct'")

    def pair(self, d, upper, value):
        """A block on the ground and a block above it, upside down and turned, with its bottom pushed against the
        other."""
        return ["&body name='a', volume='block', mesh='block.geo', material='m' /",
                "&body name='b', volume='block', mesh='block.geo', material='m', %s /" % upper,
                "&support body='a', surface='bottom', fix='n t' /",
                "&support body='b', surface='bottom', fix='n t', value=%s /" % value,
                "&load body='b', surface='sides x', pressure=0.01 /",
                "&contact name='touch', surface_a='a:top', surface_b='b:top' /"]

    def test_turned_pair(self):
        """Turned about a horizontal axis; then about a skew one too, so that the faces do not match."""
        self.write("block.geo", block_geo("tet10", 2, (-0.5, -0.5, 0), (1, 1, 1)))
        for solver in ("linear_solver='direct'", "linear_solver='iterative'", "scheme='neumann', response='full'",
                       "scheme='neumann', response='compliance'", "scheme='robin'"):
            theta = ("theta_relative=1, tolerance=1e-11, " if "scheme" in solver
                     else "theta_relative=1e-3, tolerance=1e-12, ")
            found = self.check(self.pair(3, "at=0, 0, 2, axis=1, 0.3, 0, angle=180", "0, 0, -1e-3"), 1, theta + solver,
                               1e-10 if "scheme" not in solver else 1e-9)
            self.assertGreater(abs(found["forces"][0][2]), 5e-3)

    def test_turned_pair_in_the_plane(self):
        self.write("block.geo", block_geo("quad8", 3, (-0.5, 0), (1, 1)))
        lines = self.pair(2, "at=0.1, 2, angle=180", "1e-4, -1e-3")
        self.check(lines, 1, "theta_relative=1e-3, tolerance=1e-12", scene="analysis='plane_strain'")

    def test_turned_scene(self):
        """The pair as a whole, turned: displacements turn with it."""
        self.write("block.geo", block_geo("tet10", 2, (-0.5, -0.5, 0), (1, 1, 1)))
        solver = "theta_relative=1e-3, tolerance=1e-12"
        straight = self.check(self.pair(3, "at=0, 0, 2, axis=1, 0, 0, angle=180", "0, 0, -1e-3"), 1, solver)
        lines = self.pair(3, "at=2, 0, 0, axis=1, 0, 1, angle=180", "0, 0, -1e-3")
        lines[0] = lines[0].replace(" /", ", axis=0, 1, 0, angle=90 /")
        # z goes to x. The upper block: half a turn about x, then z to x.
        lines[1] = lines[1].replace("axis=1, 0, 1, angle=180", "axis=%r, 0, %r, angle=180" % (0.5 ** 0.5, -0.5 ** 0.5))
        turned = self.check(lines, 1, solver)
        rotation = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        np.testing.assert_allclose(turned["displacement"], straight["displacement"] @ rotation.T, rtol=0, atol=1e-11)
        np.testing.assert_allclose(turned["forces"], straight["forces"] @ rotation.T, rtol=0, atol=1e-10)

    def test_orthotropic_material_turns(self):
        """The scene turned about z by a quarter: the soft axis of the plies goes with the bodies."""
        self.write("block.geo", block_geo("tet10", 2, (-0.5, -0.5, 0), (1, 1, 1)))
        material = ["&material name='ply', young=30, 1, 3, poisson=0.2, 0.2, 0.3, shear=1, 1, 0.7, "
                    "axis_1=1, 0.2, 0.1 /"]
        lines = [line.replace("'m'", "'ply'")
                 for line in self.pair(3, "at=0, 0, 2, axis=1, 0, 0, angle=180", "0, 0, -1e-3")]
        solver = "theta=1e-4, tolerance=1e-12"
        straight = self.check(material + lines, 1, solver)
        lines[0] = lines[0].replace(" /", ", angle=90 /")
        lines[1] = lines[1].replace("axis=1, 0, 0, angle=180", "axis=1, 1, 0, angle=180")
        turned = self.check(material + lines, 1, solver)
        x, y, z = straight["displacement"].T
        np.testing.assert_allclose(turned["displacement"], np.array([-y, x, z]).T, rtol=0, atol=1e-11)

    def test_free_blocks(self):
        """Free blocks between two held ones, each turned otherwise, so that faces do not match: each passes the force
        on."""
        self.write("block.geo", block_geo("tet10", 2, (-0.5, -0.5, 0), (1, 1, 1)))
        lines = ["&body name='b%d', volume='block', mesh='block.geo', material='m', at=0, 0, %d, angle=%d /"
                 % (k, k, 37 * k)
                 for k in range(4)]
        lines += ["&body name='b4', volume='block', mesh='block.geo', material='m', at=0, 0, 4.999, axis=1, 0, 0, "
                  "angle=180 /",
                  "&support body='b0', surface='bottom', fix='xyz' /",
                  "&support body='b4', surface='bottom', fix='xyz' /"]
        lines += ["&contact name='c%d', surface_a='b%d:top', surface_b='b%d:%s' /"
                  % (k, k - 1, k, "top" if k == 4 else "bottom")
                  for k in range(1, 5)]
        for choice in ("direct", "iterative"):
            found = self.check(lines, 2, "theta_relative=1e-3, tolerance=1e-12, linear_solver='%s'" % choice, 1e-9)
            forces = found["forces"]  # on the lower body
            self.assertLess(forces[0][2], -1e-3)
            np.testing.assert_allclose(forces, forces[:1].repeat(4, 0), rtol=0, atol=1e-9 * abs(forces[0][2]))

    def test_refusals_name_every_body(self):
        """The message names every floating body, also those that are congruent to another one."""
        self.write("block.geo", block_geo("tet4", 1))
        lines = self.chain(3, 3, lambda k: "volume='block', mesh='block.geo', at=0, 0, %d" % (k - 1))
        self.write("case.nml", "\n".join(["&scene /", "&material name='m', young=1, poisson=0 /", *lines,
                                          "&solver scheme='neumann' /"]))
        printed = self.dotyk("case.nml", code=3)
        self.assertEqual(printed.count("this body floats"), 2)
        self.assertIn("body 'b2'", printed)
        self.assertIn("body 'b3'", printed)


dotyk_case.main()
