#!/usr/bin/python3
"""Meshes that mesh2msh converts: what meshio reads (MED and others), format 2.2 of gmsh, and programs that are missing. Decks and .vtu files
are in inp.py and vtu.py."""
import numpy as np

import dotyk_case
from decks import deck
from dotyk.mesh2msh.other import MIRRORED
from vtu import FIELD, elements, turned
from vtu_files import grid

MATERIAL = "&material name='m', young=30, poisson=0.3 /\n"
BODY = "&body name='part', volume='%s', material='m' /\n"
KINDS = {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8", "hexahedron20": "hex20", "wedge": "prism6", "wedge15": "prism15",
         "pyramid": "pyramid5", "pyramid13": "pyramid13"}


class Converted(dotyk_case.Case):
    def patch(self, mesh, volume, surface):
        """A linear displacement given on the boundary."""
        self.write("case.nml", "&scene mesh='%s' /\n" % mesh + MATERIAL + BODY % volume + "&support body='part', surface='%s', fix='xyz', "
                   "value_formula=%s /\n" % (surface, ",".join("'%s'" % f for f in FIELD)))
        self.dotyk("case.nml")
        file = self.results("case.vtkhdf")
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        exact = np.stack([eval(f, dict(zip("xyz", x.T))) for f in FIELD], axis=1)
        np.testing.assert_allclose(u, exact, rtol=0, atol=1e-12*np.abs(exact).max())
        file.close()

    def mesh(self, kind, mirrored):
        """Points and elements of a block, in the order of VTK or with turned faces, as MED has them."""
        of = elements(KINDS[kind])
        # Corners of decks' wedges are those of gmsh, turned against VTK.
        points, cells = grid(KINDS[kind], [turned(e) for e in of] if kind.startswith("wedge") == mirrored and "wedge" in kind else of)
        rows = np.array([nodes for _, nodes in cells])
        if mirrored and not kind.startswith("wedge"):
            rows = rows[:, MIRRORED[kind.rstrip("0123456789")][:rows.shape[1]]]
        return points, rows

    def test_patch_of_med(self):
        """Groups of elements are volumes, groups of points surfaces: by their names, in both orders of nodes."""
        import meshio
        getattr(meshio._mesh, "topological_dimension", {}).update(wedge15=3, pyramid13=3)
        for kind in KINDS:
            for mirrored in (True, False):
                with self.subTest(kind, mirrored=mirrored):
                    points, rows = self.mesh(kind, mirrored)
                    mesh = meshio.Mesh(points, [(kind, rows)], {"point_tags": np.full(len(points), 2)}, {"cell_tags": [np.full(len(rows), -6)]})
                    mesh.cell_tags, mesh.point_tags = {-6: ["block", "whole"]}, {2: ["all"]}
                    meshio.write(str(self.folder / "part.med"), mesh)
                    self.patch("part.med", "whole", "all")
        listed = self.dotyk("--check", "case.nml")
        self.assertIn("    block         48 elements\n", listed)

    def test_no_shell(self):
        """Decks start no programs; Python may be a script that does."""
        self.write("part.inp", deck("C3D8", "hex"))
        self.write("case.nml", "&scene mesh='part.inp' /\n" + MATERIAL + BODY % "block")
        python = self.write("python", "#!/bin/sh\ntrue | cat\npython3 \"$@\"\n")
        python.chmod(0o755)
        self.assertIn("    block         8 elements\n", self.dotyk("--check", "--no-shell", "case.nml", DOTYK_PYTHON=str(python)))

    def test_other_formats(self):
        """Their integers of the cells are volumes."""
        import meshio
        points, rows = self.mesh("hexahedron20", False)
        for ending, data in ((".vtk", {"part": [np.full(len(rows), 7)]}), (".mesh", {"medit:ref": [np.full(8, 7)]})):
            with self.subTest(ending):
                kind, own = ("hexahedron20", rows) if ending == ".vtk" else ("hexahedron", rows[:, :8])
                meshio.write(str(self.folder / ("part" + ending)), meshio.Mesh(points, [(kind, own)], cell_data=data))
                self.write("case.nml", "&scene mesh='part%s' /\n" % ending + MATERIAL + BODY % "7")
                self.assertIn("    7             8 elements\n", self.dotyk("--check", "case.nml"))

    def test_what_cannot_be_read(self):
        self.write("case.nml", "&scene mesh='part.med' /\n" + MATERIAL + BODY % "block")
        self.write("part.med", "no file of HDF5\n")
        self.assertIn("part.med: meshio cannot read it: ", self.dotyk("--check", "case.nml", code=2))
        self.write("meshio.py", "raise ImportError\n")
        python = self.write("python", "#!/bin/sh\nPYTHONPATH=%s exec python3 \"$@\"\n" % self.folder)
        python.chmod(0o755)
        self.assertIn("part.med: meshio, which reads this format, is missing: install it (Debian: apt install python3-meshio)",
                      self.dotyk("--check", "case.nml", code=2, DOTYK_PYTHON=str(python)))
        self.assertIn("no-python, which converts meshes, was not found: install it (Debian: apt install python3 python3-numpy python3-meshio)",
                      self.dotyk("--check", "case.nml", code=2, DOTYK_PYTHON="no-python"))

    def test_groups_of_format_22_belong_to_elements(self):
        """Two elements of one entity in different groups, one of them in both: gmsh would give all of them to both."""
        x = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1), (3, 0), (3, 1)]
        self.write("part.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 1 \"left\"\n2 2 \"right\"\n$EndPhysicalNames\n"
                   "$Nodes\n8\n%s\n$EndNodes\n$Elements\n4\n7 3 2 1 1 1 2 3 4\n8 3 2 2 1 2 5 6 3\n8 3 2 1 1 2 5 6 3\n9 3 2 2 1 5 7 8 6\n$EndElements\n"
                   % "\n".join("%d %g %g 0" % (i + 1, *p) for i, p in enumerate(x)))
        for name, n, nodes in (("left", 2, 6), ("right", 2, 6)):
            self.write("case.nml", "&scene mesh='part.msh', analysis='plane_strain' /\n" + MATERIAL + BODY % name)
            self.assertRegex(self.dotyk("--check", "case.nml"), r"\n  part +m +%d +%d " % (n, nodes))

    def test_format_22_is_format_41(self):
        """Every element kind, text and binary: the resultant and the moment of a weight, and the faces of surfaces, to all digits printed."""
        for name in ("kinds_1", "kinds_2", "kinds_2i"):
            said = {}
            for ending in ("41.bin", "22", "22.bin"):
                self.copy(dotyk_case.ROOT / "tests/unit/mesh/data" / ("%s.%s.msh" % (name, ending))).replace(self.folder / "part.msh")
                self.write("case.nml", "&scene mesh='part.msh' /\n" + MATERIAL + "".join(
                    "&body name='%s', volume='%s', material='m' /\n&load body='%s', force_density=1,2,3 /\n" % (n, n, n)
                    for n in ("tetrahedra", "hexahedra", "prisms")) + "&support body='tetrahedra', surface='bottom', fix='xyz' /\n"
                    "&load body='tetrahedra', surface='top and more', pressure=1 /\n")
                said[ending] = self.dotyk("--check", "case.nml").split("estimated memory")[0]
            self.assertIn("tetrahedra:top and more", said["22"])
            self.assertEqual(said["41.bin"], said["22"])
            self.assertEqual(said["22"], said["22.bin"])

    def test_mistakes_of_format_22(self):
        good = ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n$Elements\n1\n7 3 2 1 1 1 2 3 4\n"
                "$EndElements\n")
        self.write("case.nml", "&scene mesh='part.msh', analysis='plane_strain' /\n" + MATERIAL + BODY % "1")
        for old, new, message in (
                ("", "", None), ("3 1 1 0", "3 1 one 0", "part.msh:8: expected finite numbers, found '3 1 one 0'"),
                ("3 1 1 0", "2 1 1 0", "node tag 2 occurs a second time"), ("3 1 1 0", "-3 1 1 0", "node tag -3 is not positive"),
                ("1 2 3 4\n", "1 2 3 5\n", "element 7 refers to node 5, which $Nodes does not have"),
                ("1 2 3 4\n", "1 2 3\n", "element 7 of type 3 with 2 tags has 8 numbers, 9 are needed"),
                ("7 3 2", "7 99 2", "element 7 has type 99, which is not known"), ("7 3 2 1", "7 3 2 0", "no element belongs to a physical group"),
                ("$Nodes\n4", "$Nodes\n5", "part.msh:6: 5 nodes are announced, the file has 4"),
                ("$Nodes\n4", "$Nodes\n3", "part.msh:9: expected $EndNodes, found other text"),
                ("$EndElements", "", "the file ends without $EndElements: it is truncated"),
                ("$Elements", "$Other", "part.msh:")):
            with self.subTest(message):
                self.write("part.msh", good.replace(old, new, 1) if old else good)
                text = self.dotyk("--check", "case.nml", code=2 if message else 0)
                self.assertIn(message or "", text)


if __name__ == "__main__":
    dotyk_case.main()
