#!/usr/bin/python3
"""Meshes of Abaqus and CalculiX decks: the order of nodes and faces of each element type, sets, surfaces, instances,
included files, and what is refused."""
import re
import subprocess

import numpy as np

import dotyk_case
from decks import CUBE, HEXAHEDRON, SHAPES, corners, deck, split

SOLIDS = {"C3D4": "tet", "C3D10": "tet", "C3D10M": "tet", "C3D8": "hex", "C3D8R": "hex", "C3D8I": "hex", "C3D20": "hex", "c3d20rh": "hex",
          "C3D6": "wedge", "C3D15": "wedge", "C3D5": "pyramid"}
PLANE = {"CPS3": "tri", "CPE6": "tri", "CPS4R": "quad", "CPE8": "quad", "CAX3": "tri", "CAX6M": "tri", "CAX4I": "quad", "CAX8R": "quad"}
FIELD = ("0.3*x-0.7*y+0.2*z", "0.5*x+0.9*y-0.4*z", "-0.6*x+0.1*y+0.8*z")
MATERIAL = "&material name='m', young=30, poisson=0.3 /\n"
BLOCK = CUBE + "*ELEMENT, TYPE=C3D8, ELSET=block\n1, 1,2,3,4,5,6,7,8\n"
SCENE = "&scene mesh='part.inp'%s /\n" + MATERIAL + "&body name='part', volume='%s', material='m' /\n"


class Inp(dotyk_case.Case):
    def check(self, text, volume="block", more="", analysis="3d", code=0):
        """What `--check` says of a deck."""
        self.write("part.inp", text)
        self.write("part.nml", SCENE % (", analysis='%s'" % analysis, volume) + more)
        return self.dotyk("--check", "part.nml", code=code)

    def patch(self, name, shape, analysis):
        """A linear displacement given on the boundary, which is a node set: that of all nodes."""
        dim = 3 if analysis == "3d" else 2
        field = FIELD if dim == 3 else ("0.3*x+0*y", "0.9*y+0*x") if analysis == "axisymmetric" else ("0.3*x-0.7*y", "0.5*x+0.9*y")
        self.write("part.inp", deck(name, shape))
        self.write("part.nml", SCENE % (", analysis='%s'" % analysis, "block") +
                   "&support body='part', surface='All', fix='%s', value_formula=%s /\n"
                   % ("xyz"[:dim], ",".join("'%s'" % f for f in field)))
        self.dotyk("part.nml")
        file = self.results("part.vtkhdf")
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        exact = np.stack([eval(f, dict(zip("xyz", x.T))) for f in field], axis=1)
        np.testing.assert_allclose(u[:, :dim], exact, rtol=0, atol=1e-12 * np.abs(exact).max())

    def test_patch_test_of_each_element_type(self):
        for name, shape in {**SOLIDS, **PLANE}.items():
            analysis = {"CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}.get(name[:3], "3d")
            with self.subTest(name):
                self.patch(name, shape, analysis)

    def test_faces_of_each_shape(self):
        """S1, S2, ... of one element: their centres and normals."""
        for name, shape in (("C3D4", "tet"), ("C3D10", "tet"), ("C3D8", "hex"), ("C3D20", "hex"), ("C3D6", "wedge"), ("C3D15", "wedge"),
                            ("C3D5", "pyramid"), ("CPS3", "tri"), ("CPS6", "tri"), ("CPS4", "quad"), ("CPS8", "quad")):
            with self.subTest(name):
                text = deck(name, shape, 1)
                faces = corners(SHAPES[shape][1])
                text += "".join("*SURFACE, NAME=F%d\nBLOCK, S%d\n" % (i + 1, i + 1) for i in range(len(faces)))
                text = re.sub(r"(ELSET=block\n(?:.*\n){%d})(?:\d+,.*\n)*" % (1 + ("C3D20" == name or "C3D10" == name or "C3D15" == name)), r"\1",
                              text)
                listed = self.check(text, analysis="3d" if shape not in ("tri", "quad") else "plane_stress")
                block = HEXAHEDRON + [(0.5, 0.5, 0.5 if len(faces[0]) > 2 else 0)]
                points = np.array([block[i] for i in split(shape)[0]], dtype=float)
                for i, face in enumerate(faces):
                    found = re.search(r"\n      F%d +\S+, \((.*?)\)(?:, \((.*?)\))?" % (i + 1), listed)
                    own = points[face]
                    np.testing.assert_allclose([float(c) for c in found.group(1).split(",")], own.mean(axis=0), atol=2e-4)
                    normal = [float(c) for c in found.group(2).split(",")]
                    np.testing.assert_allclose((own - own.mean(axis=0)) @ normal, 0, atol=1e-3)
                    self.assertLess((points.mean(axis=0) - own.mean(axis=0)) @ normal, 0)

    def test_surfaces_of_sets_and_nodes(self):
        """Numbers, sets, ranges, sets of sets, the outer faces of elements, of node sets and of nodes: on two cubes in a row."""
        text = (CUBE + "9, 2,0,0\n10, 2, 1, 0\n11, 2,0,1\n12, 2,1,1, \n*ELEMENT, TYPE=C3D8, ELSET=left\n1, 1,2,3,4,5,6,7,8\n"
                "*ELEMENT, TYPE=C3D8R, ELSET=right\n2, 2,9,10,3,\n6,11,12,7\n*ELSET, ELSET=both\nLEFT, right\n*elset, elset=range, generate\n"
                "1, 2\n*NSET, NSET=ends\n1, 4, 5, 8, 9, 10, 11, 12,\n*NSET, NSET=more\nends, 2\n*NSET,NSET=of right, ELSET=right\n"
                "*SURFACE, NAME=low, TYPE=ELEMENT\nboth, S1\n*SURFACE, NAME=sides\n1, S3\n2, S3\n 1,S5\n2, S5\n"
                "*SURFACE, NAME=far, TYPE=NODE\n9,\n10,\n11\n12\n*SURFACE, NAME=skin\nright,\n")
        for volume in ("both", "range"):
            listed = self.check(text, volume)
            self.assertIn("    left          1 element\n", listed)
            self.assertIn("    both          2 elements\n", listed)
            for name, area, centre in (("low", "2", "(1, 0.5, 0)"), ("sides", "4", "(1, 0.5, 0.5)"), ("far", "1", "(2, 0.5, 0.5)"),
                                       ("skin", "5", "(1.6, 0.5, 0.5)"), ("ends", "2", "(1, 0.5, 0.5)"), ("more", "2", "(1, 0.5, 0.5)"),
                                       ("of right", "5", "(1.6, 0.5, 0.5)")):
                self.assertRegex(listed, r"\n      %s +%s, %s" % (name, area, re.escape(centre)))
            self.assertIn("than on those: 'more' (1 of 9)\n", listed)
        # The corners of a box lie on a sphere, its sides do not.
        self.assertNotIn('sphere', listed)
        self.assertNotIn('cylinder', listed)
        # an end of the left body only; the interface is no outer face
        self.assertRegex(self.check(text, "left"), r"\n      ends +1, \(0, 0.5, 0.5\), \(-1, 0, 0\)\n")
        self.assertIn("'of right' has no facet on this body", self.check(
            text, "left", "&support body='part', surface='of right', fix='xyz' /\n", code=2))

    def test_elements_without_set(self):
        self.assertIn("    Eall          1 element\n", self.check(BLOCK.replace(", ELSET=block", ""), "Eall"))

    def test_parts_and_instances(self):
        """Two instances of a part, one of them rotated about z and moved: its volume, its sets, those of the assembly."""
        text = ("*Heading\n*Part, name=Cube\n" + BLOCK + "*Nset, nset=foot, generate\n1, 4, 1\n*Surface, type=ELEMENT, name=head\nblock, S2\n"
                "*End Part\n**\n*Assembly, name=Assembly\n*Instance, name=Cube-1, part=Cube\n*End Instance\n*Instance, name=Cube-2, part=Cube\n"
                "5., 0., 0.\n5., 0., 0., 5., 0., 1., 90.\n*End Instance\n*Elset, elset=_S_S1, internal, instance=Cube-2\n1\n"
                "*Elset, elset=all\nCube-1.block, Cube-2.1\n*Surface, type=ELEMENT, name=S\n_S_S1, S4\n"
                "*Surface, type=ELEMENT, name=T\nCube-2.1, S6\n*End Assembly\n*Material, name=m\n*Elastic\n1, 0.3\n*Step\n*Static\n*End Step\n")
        listed = self.check(text, "Cube-2")
        for line in ("Cube-2.head 1, (4.5, 0.5, 1), (0, 0, 1)", "Cube-2.foot 1, (4.5, 0.5, 0), (0, 0, -1)", "S           1, (4.5, 1, 0.5), (0, 1, 0)",
                     "T           1, (4.5, 0, 0.5), (0, -1, 0)"):
            self.assertIn("      %s\n" % line, listed)
        self.assertIn("    all           2 elements\n", listed)
        self.assertIn("part.inp, read as a mesh: not read: *MATERIAL, *ELASTIC, *STEP, *STATIC\n", listed)
        self.assertIn("Cube-1.foot 1, (0.5, 0.5, 0), (0, 0, -1)", self.check(text, "Cube-1.block"))

    def test_included_files(self):
        """Data lines and cards in files of their own; mistakes there are told with their lines."""
        (self.folder / "parts").mkdir()
        self.write("parts/nodes.txt", CUBE.split("\n", 1)[1])
        self.write("elements.inp", "** elements\r\n*ELEMENT, TYPE=C3D8, ELSET=block\r\n1, 1,2,3,4,5,6,7,8\r\n")
        text = "*NODE, NSET=All\n*INCLUDE, INPUT=parts/nodes.txt\n*INCLUDE,\n INPUT=elements.inp\n"
        self.assertRegex(self.check(text), r"\n      All +6, \(0.5, 0.5, 0.5\)")
        self.assertRegex(self.check("*NODE, INPUT=parts/nodes.txt\n*INCLUDE, INPUT=elements.inp\n"), "block         1 element")
        self.write("elements.inp", "*ELEMENT, TYPE=C3D8, ELSET=block\n\n1, 1,2,3,4,5,6,7,99\n")
        self.assertIn("elements.inp:3: element 1 has node 99, which no *NODE has", self.check(text, code=2))
        self.assertIn("part.inp:1: no.inp: ", self.check("*INCLUDE, INPUT=no.inp\n", code=2))
        self.write("elements.inp", "*INCLUDE, INPUT=elements.inp\n")
        self.assertIn("too many nested files: one includes itself", self.check(text, code=2))

    def test_what_is_refused(self):
        for text, message in (
                ("", "the file is empty"),
                ("hello\n", "part.inp:1: this is no Abaqus or CalculiX deck: it does not begin with a keyword, as *NODE"),
                (CUBE, "the file has no elements"),
                ("*HEADING\n", "the file has no nodes outside of parts"),
                (CUBE + "1, 0, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1,2,3,5\n", "part.inp:10: node 1 occurs a second time"),
                (CUBE.replace("0, 1, 1", "0, one, 1"), "part.inp:9: expected a finite number, found 'one'"),
                (CUBE.replace("1, 0, 0, 0", "1.5, 0, 0, 0"), "part.inp:2: expected an integer, found '1.5'"),
                (BLOCK + "1, 1,2,3,4,5,6,7,8\n", "part.inp:12: element 1 occurs a second time"),
                (BLOCK + "2, 1,2,3,4,5,6,7\n", "part.inp:12: element 2 has 7 nodes, 8 are needed"),
                (BLOCK + "2, 1,2,3,4,5,6,7,8,9\n", "part.inp:12: element 2 has more than 8 nodes"),
                (BLOCK + "2, 1,2,3,3,5,6,7,7\n", "part.inp:12: element 2 has node 3 twice: collapsed elements are not read"),
                (BLOCK + "*ELEMENT, TYPE=S4\n2, 1,2,3,4\n", "part.inp:12: *ELEMENT, TYPE='S4' is not read, only solid elements: C3D4"),
                (BLOCK + "*ELEMENT, TYPE=T3D2\n2, 1,2\n", "part.inp:12: *ELEMENT, TYPE='T3D2' is not read"),
                (BLOCK + "*ELEMENT\n2, 1,2\n", "part.inp:12: *ELEMENT needs TYPE="),
                (BLOCK + "*SURFACE, NAME=s\nblock, S7\n", "part.inp:13: expected a face of solid elements, S1 to S6, found 'S7'"),
                (BLOCK + "*SURFACE, NAME=s\nblock, SPOS\n", "part.inp:13: expected a face of solid elements"),
                (BLOCK + "*SURFACE, NAME=s\nother, S1\n", "part.inp:13: surface 's': there is no element set 'other'"),
                (BLOCK + "*SURFACE, NAME=s\n7, S1\n", "part.inp:13: surface 's': there is no element 7"),
                (BLOCK + "*SURFACE, NAME=s\n1, S1\n*SURFACE, NAME=S\n1, S2\n", "part.inp:14: the surface 'S' occurs a second time"),
                (BLOCK + "*NSET, NSET=n\n1, 77\n", "part.inp:13: set 'n': there is no node 77"),
                (BLOCK + "*NSET, NSET=n\nother\n", "part.inp:13: there is no set 'other' above this line"),
                (BLOCK + "*NSET, NSET=n, GENERATE\n5, 1\n", "part.inp:13: GENERATE needs first, last and step of a range"),
                (BLOCK + "*NCOPY, CHANGE NUMBER=8\n", "part.inp:12: *NCOPY: nodes and elements must be in the file"),
                (BLOCK + "*NODE, SYSTEM=C\n9, 1, 0, 0\n", "part.inp:12: *NODE, SYSTEM=C: only Cartesian coordinates are read"),
                ("*PART, NAME=p\n" + BLOCK, "the file ends inside a *PART"),
                (BLOCK + "*INSTANCE, NAME=i, PART=p\n*END INSTANCE\n", "there is no part 'p' above this line")):
            with self.subTest(message):
                self.assertIn(message, self.check(text, code=2))
        self.assertIn("part.inp:11: element 1 is of 3 dimensions, the analysis of 2", self.check(BLOCK, analysis="plane_strain", code=2))
        plane = deck("CPS4", "quad", 1)
        self.assertIn("element 1 is of 2 dimensions, the analysis of 3", self.check(plane, code=2))
        self.assertIn("has no physical volume 'other'", self.check(BLOCK, "other", code=2))

    def test_files_of_gmsh(self):
        """Triangles that gmsh writes beside tetrahedra are surfaces, lines beside triangles curves."""
        geometry = ("SetFactory(\"OpenCASCADE\");\nBox(1) = {0, 0, 0, 1, 1, 1}; Mesh.MeshSizeMin = 0.5; Mesh.ElementOrder = %d;\n"
                    "Mesh.SaveGroupsOfNodes = 1; Physical Volume(\"block\") = {1}; Physical Surface(\"top\") = {6};\n")
        for order in (1, 2):
            self.write("part.geo", geometry % order)
            subprocess.run(["gmsh", "-3", "part.geo", "-format", "inp", "-o", "part.inp"], cwd=self.folder, check=True, capture_output=True)
            listed = self.check((self.folder / "part.inp").read_text(), "Volume1")
            self.assertRegex(listed, r"\n      top +1, \(0.5, 0.5, 1\), \(0, 0, 1\)\n")
            self.assertRegex(listed, r"\n      Surface6 +1, \(0.5, 0.5, 1\), \(0, 0, 1\)\n")


if __name__ == "__main__":
    dotyk_case.main()
