#!/usr/bin/python3
"""Sizes of elements by hand (&mesh_size)."""
import numpy as np

import dotyk_case

# Two blocks of 4 x 2, one on the other, in one file.
BLOCKS = """SetFactory("OpenCASCADE");
Rectangle(1) = {0, -2, 0, 4, 2};  Rectangle(2) = {0, 0, 0, 4, 2};  e = 1e-6;
Physical Surface("lower") = {1};  Physical Surface("upper") = {2};
Physical Curve("bottom") = {Curve In BoundingBox{-e, -2 - e, -e, 4 + e, -2 + e, e}};
Physical Curve("top") = {Curve In BoundingBox{-e, 2 - e, -e, 4 + e, 2 + e, e}};
Physical Curve("joint") = {Curve In BoundingBox{-e, -e, -e, 4 + e, e, e}};
Mesh.ElementOrder = 2;  Mesh.MeshSizeMax = 1;
"""

SCENE = """&scene mesh='%s', analysis='plane_strain' /
&material name='steel', young=200, poisson=0.3 /
&body name='lower', volume='lower', material='steel' /
&body name='upper', volume='upper', material='steel' /
&support body='lower', surface='bottom', fix='xy' /
&load body='upper', surface='top', pressure=1 /
&contact name='joint', surface_a='upper:joint', surface_b='lower:joint' /
&solver theta=0, tolerance=1e-10 /
"""


class MeshSizes(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.write("blocks.geo", BLOCKS)

    def sizes(self, *groups, mesh="blocks.geo", exit_code=0, edit=lambda text: text):
        """The longest edges of the two bodies at y = -2, 0, 0 and 2; or the message."""
        self.write("case.nml", edit(SCENE % mesh) + "\n".join(groups) + "\n")
        printed = self.dotyk("case.nml", code=exit_code)
        if exit_code:
            return printed
        file = self.results("case.vtkhdf")
        x, n = file["VTKHDF/Points"][:], file["VTKHDF/NumberOfPoints"][:]
        found = []
        for body, y in ((x[:n[0]], -2), (x[:n[0]], 0), (x[n[0]:], 0), (x[n[0]:], 2)):
            # Every second node of a face is a mid node.
            at = np.sort(body[np.abs(body[:, 1] - y) < 1e-9, 0])
            found.append(np.diff(at[::2]).max())
        return found

    def test_without(self):
        self.assertGreater(min(self.sizes()), 0.4)

    def test_face(self):
        """A face of one body gets its size, and elements grow from there; the other body keeps its own."""
        bottom, low, up, top = self.sizes("&mesh_size body='lower', surface='bott*', size=0.1 /")
        self.assertBetween(0.08, bottom, 0.13)
        self.assertGreater(min(low, up, top), 0.4)

    def test_body_and_contact(self):
        """The size of a body, and smaller ones at contact pairs of all bodies."""
        bottom, low, up, top = self.sizes("&mesh_size body='*', contact=0.1 /", "&mesh_size body='upper', size=0.4 /")
        self.assertBetween(0.08, low, 0.13)
        self.assertBetween(0.08, up, 0.13)
        self.assertGreater(bottom, 0.4)
        self.assertBetween(0.3, top, 0.5)

    def test_least_size_holds(self):
        bottom = self.sizes("&mesh_size body='lower', surface='bottom', size=0.1 /",
                            "&mesh_size body='lower', surface='*', size=0.3 /")[0]
        self.assertBetween(0.08, bottom, 0.13)

    def test_coarser(self):
        """Sizes may be greater than those of the geometry."""
        self.assertGreater(min(self.sizes("&mesh_size body='*', size=2 /")), 1.5)

    def test_mesh_is_kept(self):
        group = "&mesh_size body='*', contact=0.2 /"
        found = self.sizes(group)
        meshes = {path.name: path.stat().st_mtime_ns for path in (self.folder / ".dotyk").iterdir()}
        self.assertEqual(self.sizes(group), found)
        self.assertEqual({path.name: path.stat().st_mtime_ns for path in (self.folder / ".dotyk").iterdir()}, meshes)
        self.assertEqual([name for name in meshes if name.endswith(".pos")], [])
        self.assertNotEqual(self.sizes("&mesh_size body='*', contact=0.1 /"), found)

    def test_first_mesh_of_accuracy(self):
        self.write("case.nml", SCENE % "blocks.geo" + "&mesh_size body='*', contact=0.1 /\n&accuracy error=0.9 /\n")
        self.dotyk("case.nml")
        self.assertGreater(self.results("case.vtkhdf")["dotyk/contact/joint/weight"].shape[0], 35)

    def test_mistakes(self):
        """File, line, and what to do."""
        line = SCENE.count("\n") + 1
        for group, message in (
                ("&mesh_size body='lower' /", "one of size (of the body, or of its surface) and contact"),
                ("&mesh_size body='lower', surface='bottom', contact=0.1 /", "surface has no size"),
                ("&mesh_size body='lower', size=-1 /", "size must be above 0"),
                ("&mesh_size body='lower', surface='side', size=0.1 /", "has no physical curve 'side'"),
                ("&mesh_size body='*', surface='side', size=0.1 /", "none of its bodies has a surface 'side'"),
                ("&mesh_size body='lower', size=1e-5 /", "the sizes make about ")):
            self.assertIn("case.nml:%d: &mesh_size: " % line, self.sizes(group, exit_code=2))
            self.assertIn(message, self.sizes(group, exit_code=2))
        self.assertIn("contact: no &contact names a surface of body 'lower'",
                      self.sizes("&mesh_size body='lower', contact=0.1 /", exit_code=2,
                                 edit=lambda text: text.replace("name='joint', surface_a='upper:joint', surface_b='lower:joint'",
                                                                "auto=.true.")))

    def test_fixed_meshes(self):
        """Meshes without a geometry, and geometries that fix theirs."""
        self.sizes()
        (self.folder / "blocks.msh").write_bytes((self.folder / ".dotyk/blocks.geo-2d.msh").read_bytes())
        self.assertIn("is no geometry", self.sizes("&mesh_size body='lower', size=0.1 /", mesh="blocks.msh", exit_code=2))
        for fixed, message in (("Transfinite Curve{:} = 5;  Transfinite Surface{:};", "Transfinite, Layers"),
                               ("Transfinite Curve{:} = 5;  Transfinite Surface{:};  Recombine Surface{:};", "remove Recombine")):
            self.write("fixed.geo", BLOCKS + fixed + "\n")
            self.assertIn(message, self.sizes("&mesh_size body='*', size=0.1 /", mesh="fixed.geo", exit_code=2))


if __name__ == "__main__":
    dotyk_case.main()
