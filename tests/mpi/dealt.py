"""Scenes of many small bodies, which ranks read each its own: what is wrong with them is told as on one rank, and no more of a volume
is held than on one rank of many.
"""
import re

import numpy as np

import dotyk_case
from mpi_case import RankCase

BOX = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};  Box(2) = {0, 0, 1, 1, 1, 1};  Box(3) = {0, 0, 2, 1, 1, 1};  Box(4) = {0, 0, 3, 1, 1, 1};
Mesh.MeshSizeMax = 0.5;  e = 1e-6;
For k In {1:4}
  Physical Volume(Sprintf("box %g", k)) = {k};
  Physical Surface(Sprintf("low %g", k)) = {Surface In BoundingBox{-e, -e, k - 1 - e, 1 + e, 1 + e, k - 1 + e}};
EndFor
"""
# A tetrahedron, and one that is upside down beside a right one.
INVERTED = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
3 1 "bad"
$EndPhysicalNames
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
$EndNodes
$Elements
2
1 4 2 1 1 1 2 3 4
2 4 2 1 1 2 3 5 4
$EndElements
"""


class Dealt(RankCase):
    def scene_of_boxes(self, *lines, solver="theta_relative=1e-2"):
        self.write("boxes.geo", BOX)
        text = ["&scene mesh='boxes.geo' /", "&material name='m', young=200, poisson=0.3 /"]
        text += ["&body name='box %d', volume='box %d', material='m' /" % (k, k) for k in range(1, 5)]
        text += ["&support body='box 1', surface='low 1', fix='xyz' /", "&solver %s /" % solver, *lines]
        return self.write("case.nml", "\n".join(text) + "\n")

    def messages(self, printed):
        """Lines that name the file of the case."""
        return [line for line in printed.splitlines() if re.match(r"\S*case\.nml[:,]? ?.*: ", line)]

    def assertSame(self, code, *texts):
        """The same messages on any number of ranks; they have the texts, in this order."""
        expected = self.messages(self.run_ranks(1, "case.nml", "--quiet", code=code))
        self.assertEqual(len(expected), len(texts), expected)
        for text, line in zip(texts, expected):
            self.assertIn(text, line)
        for ranks in (2, 3):
            self.assertEqual(self.messages(self.run_ranks(ranks, "case.nml", "--quiet", code=code)), expected)

    def test_faults_of_bodies_of_several_ranks(self):
        self.write("inverted.msh", INVERTED)
        self.scene_of_boxes("&support body='box 3', surface='lov 3', fix='z' /", "&support body='box 4', surface='low 1', fix='z' /",
                            "&body name='bad', volume='bad', mesh='inverted.msh', material='m' /",
                            "&body name='none', volume='box 5', material='m' /")
        self.assertSame(2, "'lov 3'", "'low 1' has no facet on this body", "'box 5'", "inverted")

    def test_loads_on_no_body(self):
        self.scene_of_boxes("&load body='box *', surface='box 1', pressure=1 /")
        self.assertSame(2, "none of the bodies has such a surface")

    def test_bodies_that_float(self):
        self.scene_of_boxes("&contact name='c', surface_a='box 2:low 2', surface_b='box 1:low 1', search_radius=2 /", solver="scheme='neumann', theta_relative=1e-2")
        self.assertSame(3, "'box 2': scheme 'neumann' needs supported bodies", "'box 3'", "'box 4'")

    def test_bodies_that_penetrate(self):
        """Boxes without contact, pushed into each other by more and more: what one rank finds in its couples, all write."""
        supports = ["&support body='box %d', surface='low %d', fix='xyz', value=0,0,%g /" % (k, k, -0.01 * k * k) for k in range(2, 5)]
        self.scene_of_boxes(*supports)
        depths = []
        for ranks in (1, 2, 3):
            printed = self.run_ranks(ranks, "case.nml", "--output", "%d.vtkhdf" % ranks, code=1)
            depths.append((self.results("%d.vtkhdf" % ranks)["VTKHDF/PointData/penetration"][()],
                           [line for line in printed.splitlines() if "penetrat" in line and "time" not in line]))
        self.assertGreater(np.max(depths[0][0]), 0.01)
        for depth, lines in depths[1:]:
            np.testing.assert_array_equal(depth, depths[0][0])
            self.assertEqual(lines, depths[0][1])

    def test_files_that_no_rank_can_read(self):
        self.scene_of_boxes("&body name='bad', volume='bad', mesh='nowhere.msh', material='m' /")
        self.assertOnce("nowhere.msh", self.run_ranks(3, "case.nml", code=2))


if __name__ == "__main__":
    dotyk_case.main()
