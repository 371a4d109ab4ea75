#!/usr/bin/python3
"""Unstructured grids of VTK (.vtu): the order of nodes of each cell type, encodings, sets, and what is refused."""
import itertools
import re
import subprocess

import numpy as np

import dotyk_case
from decks import HEXAHEDRON, split
from vtu_files import CELLS, MODES, grid, vtu

FIELD = ("0.3*x-0.7*y+0.2*z", "0.5*x+0.9*y-0.4*z", "-0.6*x+0.1*y+0.8*z")
MATERIAL = "&material name='m', young=30, poisson=0.3 /\n"
SCENE = "&scene mesh='part.vtu'%s /\n" + MATERIAL + "&body name='part', volume='%s', material='m' /\n"
SHAPES = {"tri": "tri", "quad": "quad", "tet": "tet", "hex": "hex", "prism": "wedge", "pyramid": "pyramid"}


def elements(kind, n=2):
    """A block of n cubes or squares along each axis, its inside distorted, in elements of one kind: the places of their corners."""
    shape = SHAPES[re.sub(r"\d+", "", kind)]
    dim = 2 if shape in ("tri", "quad") else 3
    result = []
    for cell in itertools.product(range(n), repeat=dim):
        x = [np.array((*cell, 0)[:3]) + HEXAHEDRON[i] * np.array([1, 1, dim - 2]) for i in range(8)]
        x.append(np.mean(x, axis=0))
        x = [p + 0.15 * np.prod(np.sin(np.pi * p[:dim] / n)) * np.array([1, -0.8, 0.6 * (dim - 2)]) for p in x]
        result += [[x[i] for i in corners] for corners in split(shape)]
    return result


def turned(wedge):
    """The same wedge with its triangles turned."""
    return [wedge[i] for i in (0, 2, 1, 3, 5, 4)]


def cube(**arguments):
    """One hexahedron with its end x = 1."""
    points, cells = grid("hex8", [HEXAHEDRON])
    cells.append((9, [1, 2, 6, 5]))
    return vtu(points, cells, **{"cell_data": {"part": np.array([1, 7], dtype=np.int32)}, **arguments})


class Vtu(dotyk_case.Case):
    def check(self, content, volume="1", more="", analysis="3d", code=0):
        """What `--check` says of a file."""
        (self.folder / "part.vtu").write_bytes(content)
        self.write("part.nml", SCENE % (", analysis='%s'" % analysis, volume) + more)
        return self.dotyk("--check", "part.nml", code=code)

    def patch(self, kind, of, **arguments):
        """A linear displacement given on the boundary, which is a set of points."""
        dim = 2 if of[0][0][2] == 0 and np.ptp([x[2] for e in of for x in e]) == 0 else 3
        field = FIELD if dim == 3 else ("0.3*x-0.7*y", "0.5*x+0.9*y")
        points, cells = grid(kind, of)
        (self.folder / "part.vtu").write_bytes(vtu(points, cells, {"part": np.full(len(cells), 3, dtype=np.int32)},
                                                   {"all": np.full(len(points), 5, dtype=np.int8)}, **arguments))
        self.write("part.nml", SCENE % (", analysis='%s'" % ("3d" if dim == 3 else "plane_stress"), "3") +
                   "&support body='part', surface='all 5', fix='%s', value_formula=%s /\n" % ("xyz"[:dim], ",".join("'%s'" % f for f in field)))
        self.dotyk("part.nml")
        file = self.results("part.vtkhdf")
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        exact = np.stack([eval(f, dict(zip("xyz", x.T))) for f in field], axis=1)
        np.testing.assert_allclose(u[:, :dim], exact, rtol=0, atol=1e-12 * np.abs(exact).max())
        file.close()
        return x, u

    def test_patch_test_of_each_cell_type(self):
        for kind in CELLS:
            of = elements(kind)
            with self.subTest(kind):
                # The decks have wedges as gmsh has them: turned against VTK, as many programs write them.
                self.patch(kind, [turned(e) for e in of] if kind.startswith("prism") else of)
                if kind.startswith("prism"):
                    self.patch(kind, of)

    def test_encodings(self):
        """All give the same bits."""
        of = elements("prism15")
        first = self.patch("prism15", of)
        for mode in MODES:
            for size in (4, 8) if "zlib" in mode else (4,):
                with self.subTest(mode, size=size):
                    for one, other in zip(first, self.patch("prism15", of, mode=mode, size=size)):
                        np.testing.assert_array_equal(one, other)

    def test_the_mesh_of_gmsh(self):
        """Hexahedra and wedges of 27 and 18 nodes with their surfaces: the same answer as from the .msh file, to the bit."""
        self.write("part.geo", """SetFactory("OpenCASCADE");
Rectangle(1) = {0,0,0,1,1}; Rectangle(2) = {1,0,0,1,1}; Coherence; Transfinite Line{:} = 3; Transfinite Surface{:}; Recombine Surface{1};
e() = Extrude {0,0,1} { Surface{1,2}; Layers{2}; Recombine; }; Mesh.ElementOrder = 2; Physical Volume("1") = {1,2};
s() = Surface In BoundingBox{-0.1,-0.1,-0.1,0.1,1.1,1.1}; Physical Surface("2") = {s()};
t() = Surface In BoundingBox{1.9,-0.1,-0.1,2.1,1.1,1.1}; Physical Surface("3") = {t()};
""")
        subprocess.run(["gmsh", "-3", "part.geo", "-format", "msh2", "-o", "part.msh"], cwd=self.folder, check=True, capture_output=True)
        lines = (self.folder / "part.msh").read_text().split("\n")
        start = lines.index("$Nodes") + 2
        nodes = {int(line.split()[0]): [float(c) for c in line.split()[1:]] for line in lines[start:lines.index("$EndNodes")]}
        number = {tag: i for i, tag in enumerate(nodes)}
        # Orders of gmsh's reference manual to those of VTK, whose wedges are turned here: corners are the same.
        order = {12: [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26],
                 13: [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16], 10: range(9)}
        types = {12: 29, 13: 32, 10: 28, 9: 22}
        cells, group, entity = [], [], []
        for line in lines[lines.index("$Elements") + 2:lines.index("$EndElements")]:
            words = [int(word) for word in line.split()]
            own = [number[tag] for tag in words[3 + words[2]:]]
            cells.append((types[words[1]], [own[i] for i in order.get(words[1], range(len(own)))]))
            group.append(words[3])
            entity.append(words[4])
        self.assertEqual({kind for kind, _ in cells}, {29, 32, 28})
        data = {"gmsh:physical": np.array(group), "gmsh:geometrical": np.array(entity)}
        (self.folder / "part.vtu").write_bytes(vtu(np.array(list(nodes.values())), cells, data, mode="appended zlib"))
        u = []
        for mesh in ("part.msh", "part.vtu"):
            self.write("case.nml", SCENE.replace("part.vtu", mesh) % ("", "1") + "&support body='part', surface='2', fix='xyz' /\n"
                       "&load body='part', surface='3', force=1,2,3 /\n")
            self.dotyk("case.nml")
            file = self.results("case.vtkhdf")
            u.append(file["VTKHDF/PointData/displacement"][:])
            file.close()
        np.testing.assert_array_equal(*u)

    def test_temperatures_of_points(self):
        """Temperatures that the file has for its points are those of the same formula; of linear elements, too, which
        have nodes that the file does not have. One for each load case."""
        scene = (SCENE % ("%s", "3")).replace("poisson=0.3", "poisson=0.3, expansion=1e-3").replace(
            "material='m' /", "material='m', at=1,2,0 /") % ", analysis='%s'"
        for kind, analysis, mode in (("tet4", "3d", "raw zlib"), ("hex20", "3d", "base64"), ("tri6", "plane_stress", "ascii")):
            with self.subTest(kind):
                points, cells = grid(kind, elements(kind))
                heat = 20 + 3 * points[:, 0] - 2 * points[:, 1] + points[:, 2]
                (self.folder / "part.vtu").write_bytes(vtu(
                    points, cells, {"part": np.full(len(cells), 3, dtype=np.int32)},
                    {"all": np.full(len(points), 5, dtype=np.int8), "T": heat, "T 2": 2 * heat}, mode=mode))
                found = []
                hold = "&support body='part', surface='all 5', fix='x' /\n&case name='a' /\n&case name='b' /\n"
                for temperature in ("field='T', reference=20, case='a'", "field='T 2', case='b'"), \
                                   ("formula='3*(x-1)-2*(y-2)+z', case='a'", "formula='40+2*(3*(x-1)-2*(y-2)+z)', case='b'"):
                    self.write("part.nml", scene % analysis + hold + "".join(
                        "&temperature body='part', %s /\n" % given for given in temperature))
                    self.dotyk("part.nml")
                    file = self.results("part.vtkhdf")
                    found.append((file["VTKHDF/PointData/displacement"][:],
                                  [file["dotyk/cases"][case + "/summary"].attrs["energy_norm"] for case in "ab"]))
                    file.close()
                np.testing.assert_allclose(found[0][0], found[1][0], rtol=0, atol=1e-12 * np.abs(found[1][0]).max())
                np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-11)
        for given, message in (("field='heat'", "part.vtu: the nodes have no field 'heat'; they have 'T', 'T 2'"),
                               ("field='all'", "part.vtu: the nodes have no field 'all'; they have 'T', 'T 2'"),
                               ("field='T', value=3", "value does not go together with field"),
                               ("value=3, reference=2", "reference is for a field")):
            with self.subTest(given):
                self.write("part.nml", scene % "plane_stress" + "&temperature body='part', %s /\n" % given)
                self.assertIn(message, self.dotyk("part.nml", code=2))

    def test_sets(self):
        listed = self.check(cube())
        for line in ("    1             1 element\n", "      7           1, (1, 0.5, 0.5), (1, 0, 0)\n"):
            self.assertIn(line, listed)
        # Several arrays: by name; numbers of points and cells, and reals, are none.
        data = {"part": np.array([1, 7], dtype=np.int32), "zone": np.array([-2, 3], dtype=np.int16), "u": np.zeros(2)}
        listed = self.check(cube(cell_data=data, point_data={"low": np.array([1, 1, 1, 1, 0, 0, 0, 0], dtype=np.uint8)}), "zone -2")
        for line in ("    part 1        1 element\n", "    zone -2       1 element\n", "      zone 3      1, (1, 0.5, 0.5), (1, 0, 0)\n",
                     "      low 1       1, (0.5, 0.5, 0), (0, 0, -1)\n", "part.vtu, read as a mesh: not read: u\n"):
            self.assertIn(line, listed)
        self.assertIn("    Eall          1 element\n", self.check(cube(cell_data={}), "Eall"))

    def test_voxels(self):
        points = np.array(list(itertools.product((0, 1), repeat=3)), dtype=float)[:, ::-1]
        self.assertIn("(0.5, 0.5, 0), (0, 0, -1)", self.check(vtu(points, [(11, range(8)), (8, range(4)), (1, [0])], {"part": np.array([1, 2, 3])})))

    def test_what_is_refused(self):
        good = cube().decode()
        for old, new, message in (
                ("UnstructuredGrid", "PolyData", "part.vtu:3: the file has type 'PolyData': only UnstructuredGrid is read"),
                ("LittleEndian", "BigEndian", "part.vtu:3: byte_order BigEndian is not read"),
                ("header_type='UInt32'", "compressor='vtkLZ4DataCompressor'", "part.vtu:3: the compressor 'vtkLZ4DataCompressor' is not read"),
                ('NumberOfPoints="8"', 'NumberOfPoints="9"', "part.vtu:12: array 'Points' has fewer than 27 values"),
                ('NumberOfPoints="8"', 'NumberOfPoints="7"', "part.vtu:12: array 'Points' has more values than its points or cells need"),
                ('NumberOfPoints="8"', "", "part.vtu:5: the piece needs NumberOfPoints, a count that the file has room for"),
                ('NumberOfPoints="8"', 'NumberOfPoints="800000000"', "the piece needs NumberOfPoints, a count that the file has room for"),
                ('NumberOfCells="2"', 'NumberOfCells="0"', "part.vtu:1: the file has no cells"),
                ("0.0, 1.0".replace(",", ""), "0.0 nan", "expected a finite number, found 'nan'"),
                ("1 2 6 5", "1 2 6 8", "part.vtu:15: cell 1 has a point that is not among 0 to 7"),
                ("8 12", "7 12", "part.vtu:16: cell 1 of type 9 (quad) has 5 points"),
                ("8 12", "13 12", "array 'offsets': they must ascend"),
                (">12 9<", ">42 9<", "cell 0 has type 42: only lines, triangles"),
                ('"ascii">12', '"hex">12', "part.vtu:17: array 'types': format must be ascii, binary or appended"),
                ("types", "kinds", "<Cells> has no DataArray types: the file is incomplete"),
                ('Name="part"', 'Name="vtkGhostType"', "the piece has ghost cells"),
                ("</Points>", "</Point>", "part.vtu:13: mismatched tag"),
                ("<VTKFile", "# vtk DataFile Version 2.0\n<VTKFile", "this is no XML file of VTK"),
                ('type="Int64"', 'type="Float64"', "array 'connectivity' must be of integers, not Float64")):
            with self.subTest(message):
                self.assertIn(old, good)
                self.assertIn(message, self.check(good.replace(old, new).encode(), code=2))
        self.assertIn("part.vtu:1: this is no XML file of VTK: it is a legacy file of VTK: save it as .vtu",
                      self.check(b"# vtk DataFile Version 2.0\n", code=2))
        self.assertIn("part.vtu:1: ", self.check(b"", code=2))
        text = self.check(good.replace("</UnstructuredGrid>", good[good.index("<Piece"):good.index("</UnstructuredGrid>")]).encode(), code=2)
        self.assertIn("a second piece: save the mesh as one piece", text)
        self.assertIn("has no physical volume '2'", self.check(cube(), "2", code=2))
        self.assertIn("is of 3 dimensions, the analysis of 2", self.check(cube(), analysis="plane_strain", code=2))

    def test_truncated_and_corrupt_files(self):
        """Nowhere does it end in another way than with a message that names the file."""
        for mode in MODES:
            whole = cube(mode=mode)
            with self.subTest(mode):
                for i in range(7):
                    text = self.check(whole[:len(whole) * (i + 1) // 9], code=2)
                    self.assertRegex(text, r"part\.vtu:\d+: ")
        whole = bytearray(cube(mode="raw zlib"))
        listed = re.compile(r"\n      7  .*\n")
        right = listed.findall(self.check(bytes(whole)))
        self.assertEqual(len(right), 1)
        for i in range(len(whole) - 150, len(whole) - 60, 7):
            broken = bytearray(whole)
            broken[i] ^= 255
            with self.subTest(i):
                text = self.check(bytes(broken), code=None)
                # A greater size of blocks is no matter where there is one.
                self.assertTrue("part.vtu:" in text or listed.findall(text) == right, text)


if __name__ == "__main__":
    dotyk_case.main()
