#!/usr/bin/python3
"""Contact by displacements with p-multigrid, which response='multigrid' forces on small bodies: exact stresses, the same
answers as with factors, bodies that have no p-multigrid, scenes without equilibrium, and contradictory input."""
import re

import numpy as np

import dotyk_case
from blocks import LOWER, UPPER, block_geo, column_nml, mesh

# What the log says where the contact was found by displacements, and where it was not.
MARK = "iterations of conjugate gradients with p-multigrid"
FALLBACK = "the dual scheme takes over"
TOLERANCE = 1e-9
AGREEMENT = 1e-6  # of the greatest value


class Multigrid(dotyk_case.Case):
    def solve(self, case, code=0):
        """Run; returns what was printed, and the results with their bound checked."""
        printed = self.dotyk(case + ".nml", code=code)
        file = self.results(case + ".vtkhdf")
        summary = file["dotyk/summary"].attrs
        self.assertEqual(summary["converged"], 1, printed)
        self.assertLessEqual(summary["error_bound"], TOLERANCE)
        return printed, file

    def both(self, text, case):
        """Solve a scene by p-multigrid and with factors: logs and results."""
        answers = []
        for response in ("multigrid", "full"):
            name = "%s_%s" % (case, response)
            changed, n = re.subn(r"(?m)^&solver .*$", "&solver theta=0, tolerance=%r, response='%s' /"
                                 % (TOLERANCE, response), text)
            self.assertEqual(n, 1)
            self.write(name + ".nml", changed)
            answers.append(self.solve(name))
        return answers

    def assertSame(self, one, two, what):
        np.testing.assert_allclose(one, two, rtol=0, atol=AGREEMENT * np.abs(two).max(), err_msg=what)

    def compare(self, text, case, displacements=True):
        """Pressures, forces and displacements are those with factors. Returns the log of p-multigrid."""
        (printed, found), (direct, expected) = self.both(text, case)
        self.assertIn(MARK, printed)
        self.assertNotIn(FALLBACK, printed)
        self.assertNotIn(MARK, direct)
        names = list(expected["dotyk/contact"])
        for what in ("pressure", "pressure_projected"):
            self.assertSame(*(np.concatenate([file["dotyk/contact"][name][what][:] for name in names])
                              for file in (found, expected)), what)
        self.assertSame(*(np.array([file["dotyk/contact"][name].attrs["force"] for name in names])
                          for file in (found, expected)), "force")
        if displacements:
            self.assertSame(found["VTKHDF/PointData/displacement"][:], expected["VTKHDF/PointData/displacement"][:],
                            "displacement")
        return printed

    def stacked(self, kinds, n=(2, 2), solver="theta=0, tolerance=%r, response='multigrid'" % TOLERANCE, poisson=None):
        """Two blocks without walls, the upper one floating under a pressure of 1: uniaxial stress."""
        lines = ["&scene /"]
        for name, kind, k, (young, ratio) in (("lower", kinds[0], n[0], LOWER), ("upper", kinds[1], n[1], UPPER)):
            self.write(name + ".geo", block_geo(kind, k, (0, 0, 0 if name == "lower" else 1)))
            if name == "upper" and poisson:
                ratio = poisson
            lines += ["&material name='of %s', young=%r, poisson=%r /" % (name, young, ratio),
                      "&body name='%s', mesh='%s.geo', volume='block', material='of %s' /" % (name, name, name)]
        lines += ["&support body='lower', surface='bottom', fix='z' /",
                  "&load body='upper', surface='top', pressure=1 /",
                  "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", "&solver %s /" % solver]
        return "\n".join(lines) + "\n"

    def test_uniaxial_stress(self):
        """Exact on meshes that do not match; sliding and turning are of least motion."""
        self.write("case.nml", self.stacked(("hex20", "tet10"), (2, 3)))
        printed, file = self.solve("case")
        self.assertIn(MARK, printed)
        self.assertNotIn(FALLBACK, printed)
        joint = file["dotyk/contact/joint"]
        np.testing.assert_allclose(joint["pressure"][:], 1, atol=1e-6)
        np.testing.assert_allclose(joint.attrs["force"], [0, 0, 1], atol=1e-8)
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        z = x[:, 2]
        strain = np.where(z < 1, 1 / LOWER[0], 1 / UPPER[0])
        down = np.where(z <= 1, z / LOWER[0], 1 / LOWER[0] + (z - 1) / UPPER[0])
        np.testing.assert_allclose(u[:, 2], -down, atol=1e-7 * down.max())
        for (young, ratio), inside in ((LOWER, z < 0.99), (UPPER, z > 1.01)):
            for axis in (0, 1):
                wide = ratio / young * (x[inside, axis] - 0.5)
                np.testing.assert_allclose(u[inside, axis], wide, atol=1e-6 * strain.max())

    def test_examples(self):
        """Axisymmetric, plane, and floating bodies in three dimensions, whose places are not determined."""
        for name, determined in (("hertz_axisymmetric", True), ("punch", True), ("bricks", False)):
            with self.subTest(name):
                self.copy(name)
                for file in (self.folder / name).glob("*.geo"):
                    file.rename(self.folder / file.name)
                self.compare((self.folder / name / (name + ".nml")).read_text(), name, determined)

    def test_beside_other_bodies(self):
        """Few linear elements and nearly incompressible bodies keep their factors beside p-multigrid."""
        text = column_nml(3)
        for case, kinds, ratio in (("linear", ("hex8", "tet10"), None), ("rubber", ("hex20", "tet10"), 0.4999)):
            with self.subTest(case):
                for name, kind, at in (("lower", kinds[0], 0), ("upper", kinds[1], 1)):
                    self.write(name + ".geo", block_geo(kind, 3, (0, 0, at)))
                scene = text
                if ratio:
                    scene = text.replace("poisson=%r" % LOWER[1], "poisson=%r" % ratio)
                    self.assertNotEqual(scene, text)
                # Pushed down at an edge, so that the pressure is not uniform.
                scene = re.sub("&support body='lower', surface='sides .*\n", "", scene)
                scene = scene.replace("surface='bottom', fix='z'", "surface='bottom', fix='xyz'")
                scene = scene.replace("value=0, 0, -0.001", "value_formula='0', '0', '-0.001*x^2'")
                self.assertIn("x^2", scene)
                self.compare(scene, case)

    def test_pushed_without_force(self):
        """A wall pushes a floating block that slides: no force, but the block moves with the wall."""
        text = self.stacked(("hex20", "tet10")).replace("&solver", """&body name='wall', mesh='wall.geo', volume='block', material='of lower' /
&support body='wall', surface='bottom', fix='xyz', value=-0.01, 0, 0 /
&contact name='side', surface_a='wall:sides x', surface_b='upper:sides x' /
&solver""")
        self.write("wall.geo", block_geo("hex20", 2, (1, 0, 1.2), (0.5, 1, 0.5)))
        (printed, found), (_, expected) = self.both(text, "wall")
        self.assertIn(MARK, printed)
        moved = [file["VTKHDF/PointData/displacement"][:, 0] for file in (found, expected)]
        self.assertSame(*moved, "displacement")
        upper = found["VTKHDF/Points"][:, 2] > 1.9
        np.testing.assert_allclose(moved[0][upper], -0.01, atol=0.004)
        self.assertLess(found["dotyk/contact/side"].attrs["force"][0], 1e-6)

    def test_way_back_to_factors(self):
        """A large thin plate is slow by p-multigrid: 'auto' gives factors to all bodies."""
        self.write("plate.geo", block_geo("hex20", (70, 70, 1), size=(1, 1, 0.002)))
        self.write("block.geo", block_geo("tet10", (2, 4, 1), (1, 0.4, 0), (0.1, 0.2, 0.002)))
        text = """&scene /
&material name='steel', young=210, poisson=0.3 /
&body name='plate', mesh='plate.geo', volume='block', material='steel' /
&body name='block', mesh='block.geo', volume='block', material='steel' /
&support body='plate', surface='sides y', fix='xyz' /
&support body='block', surface='sides y', fix='xyz', value=-1e-5, 0, 0 /
&contact name='joint', surface_a='block:sides x', surface_b='plate:sides x' /
&output fields='displacement contact', error_parts='' /
&solver theta=0, tolerance=1e-9 /
"""
        self.write("case.nml", text)
        printed, file = self.solve("case")
        self.assertIn("'plate': it costs less than p-multigrid with", printed)
        self.assertNotIn(MARK, printed)
        summary = file["dotyk/summary"].attrs
        self.assertEqual(summary["error_bound_guaranteed"], 1)
        self.assertEqual(summary["bodies_by_multigrid"], 0)
        # The block is held at its sides: what pushes the plate is what it resists.
        force = file["dotyk/contact/joint"].attrs["force"]
        self.assertGreater(force[0], 0)
        np.testing.assert_allclose(force[1:], 0, atol=1e-6 * force[0])

    def test_linear_elements(self):
        """Aggregates of nodes are the coarse level of linear elements."""
        text = column_nml(3)
        for name, kind, n, at in (("lower", "tet4", 6, 0), ("upper", "hex8", 7, 1)):
            self.write(name + ".geo", block_geo(kind, n, (0, 0, at)))
        text = re.sub("&support body='lower', surface='sides .*\n", "", text)
        text = text.replace("surface='bottom', fix='z'", "surface='bottom', fix='xyz'")
        text = text.replace("value=0, 0, -0.001", "value_formula='0', '0', '-0.001*x^2'")
        self.assertIn("x^2", text)
        self.assertIn("p-multigrid      2 bodies", self.compare(text, "case"))

    def test_soft_layer(self):
        """A floating block between a soft layer, which has most of the energy, and a stiff contact: a sharp bound."""
        self.write("low.geo", block_geo("hex20", (3, 3, 1)))
        self.write("middle.geo", block_geo("tet10", 3, (0.1, 0.15, 1)))
        self.write("top.geo", block_geo("hex20", (2, 2, 1), (0, 0, 2)))
        bodies = "".join("&body name='%s', mesh='%s.geo', volume='block', material='steel' /\n" % (name, name)
                         for name in ("low", "middle", "top"))
        printed = self.compare("""&scene /
&material name='steel', young=30, poisson=0.3 /
%s&support body='low', surface='bottom', fix='xyz' /
&support body='top', surface='top', fix='xyz', value=0,0,-0.01 /
&contact name='soft', surface_a='middle:bottom', surface_b='low:top', layer=.true., theta=1 /
&contact name='stiff', surface_a='middle:top', surface_b='top:bottom' /
&solver theta=0 /
""" % bodies, "layer", displacements=False)
        self.assertIn("least Ritz value", printed)

    def test_no_equilibrium(self):
        """The lower block lies on nothing."""
        text = self.stacked(("hex20", "tet10")).replace("&support body='lower', surface='bottom', fix='z' /\n", "")
        self.write("case.nml", text)
        printed = self.dotyk("case.nml", code=3)
        self.assertIn("no equilibrium: the loads do work on a rigid body mode that neither supports nor contact resist",
                      printed)
        # Pulled off.
        self.write("case.nml", self.stacked(("hex20", "tet10")).replace("pressure=1", "pressure=-1"))
        printed = self.dotyk("case.nml", code=3)
        self.assertIn("body 'upper': no equilibrium", printed)
        self.assertEqual(list(self.folder.glob("*.vtkhdf*")), [])

    def test_contradictory_input(self):
        for other in ("scheme='neumann'", "linear_solver='direct'"):
            theta = 1 if "neumann" in other else 0
            text = self.stacked(("hex20", "tet10"), solver="theta=%d, response='multigrid', %s" % (theta, other))
            self.write("case.nml", text)
            printed = self.dotyk("case.nml", code=2)
            line = 1 + text.splitlines().index(next(row for row in text.splitlines() if row.startswith("&solver")))
            self.assertIn("case.nml:%d: " % line, printed)
            self.assertIn("response='multigrid'", printed)
        self.assertEqual(list(self.folder.glob("*.vtkhdf*")), [])


dotyk_case.main()
