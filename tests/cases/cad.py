#!/usr/bin/python3
"""CAD files: solids become bodies by their numbers, faces surfaces; what `--check` says of them, and what is refused."""
import re
import subprocess

import dotyk_case

# A block on a larger one, and a round pin beside them; made by gmsh, in mm.
PARTS = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 20, 10, 5};  Box(2) = {0, 0, 5, 20, 10, 3};  Cylinder(3) = {40, 0, 0, 0, 0, 8, 2};
Save "parts.%s";
"""
SCENE = """&scene mesh='parts.%s', mesh_size=4%s /
&material name='steel', young=200e3, poisson=0 /
&body name='part *', volume='solid *', material='steel', repeat=2 /
&support body='part 1', surface='face 5', fix='xyz' /
&load body='part 2', surface='face 12', pressure=30 /
&contact auto=.true. /
&solver theta=0, tolerance=1e-9 /
"""


class Cad(dotyk_case.Case):
    def parts(self, ending="step"):
        self.write("make.geo", PARTS % ending)
        subprocess.run(["gmsh", "-0", "make.geo"], cwd=self.folder, check=True, capture_output=True)

    def test_column_of_two_solids(self):
        """Uniform pressure: without lateral strain, the energy is that of a bar."""
        for ending in ("step", "brep"):
            with self.subTest(ending):
                self.parts(ending)
                self.write("case.nml", SCENE % (ending, ""))
                self.dotyk("case.nml")
                energy = 30**2 / (2 * 200e3) * 20 * 10 * 8
                self.assertAlmostEqual(self.results("case.vtkhdf")["dotyk/summary"].attrs["strain_energy"] / energy, 1, delta=1e-9)

    def stl(self, geometry, name="parts.stl"):
        """The triangles of the surfaces of a geometry."""
        self.write("make.geo", 'SetFactory("OpenCASCADE");\n' + geometry)
        subprocess.run(["gmsh", "-2", "make.geo", "-format", "stl", "-o", name], cwd=self.folder, check=True, capture_output=True)

    def test_triangles(self):
        """Closed surfaces of an STL file are solids; their faces are those of the parts, whatever gmsh divides them into."""
        self.stl("Box(1) = {0, 0, 0, 20, 10, 5};  Cylinder(2) = {40, 0, 0, 0, 0, 8, 2};  Mesh.MeshSizeMax = 2;  Mesh.MeshSizeFromCurvature = 24;\n")
        scene = SCENE.replace("&contact auto=.true. /\n", "") % ("stl", "")
        self.write("list.nml", scene[:scene.index("&support")].replace(", mesh_size=4", ""))
        listed = self.dotyk("list.nml", "--check")
        self.assertIn("faces of parts.stl in its own coordinates: about their area, centre, and normal where plane\n", listed)
        box, pin = listed.split("'part 1', solid 1\n")[1].split("    'part 2', solid 2\n")
        faces = dict(re.findall(r"      face (\d+) +\S+ \(.*?\), (\(.*?\))\n", box))
        self.assertEqual(sorted(faces.values()), sorted("(%s)" % n for n in ("-1, 0, 0", "1, 0, 0", "0, -1, 0", "0, 1, 0", "0, 0, -1", "0, 0, 1")))
        for area in (" 50, ", " 100, ", " 200, "):
            self.assertEqual(box.count(area), 2)
        areas = [float(a) for a in re.findall(r"face \d+ +(\S+),", pin.split("\n\n")[0])]
        self.assertEqual(len(areas), 3)
        for area, exact in zip(sorted(areas), (12.566, 12.566, 100.53)):
            self.assertBetween(0.95 * exact, area, exact)
        number = {normal: face for face, normal in faces.items()}
        self.write("case.nml", scene.replace("part *", "part 1").replace("solid *", "solid 1").replace(", repeat=2", "").replace("face 5", "face " + number["(0, 0, -1)"]).replace(
            "'part 2', surface='face 12'", "'part 1', surface='face %s'" % number["(0, 0, 1)"]))
        self.dotyk("case.nml")
        energy = 30**2 / (2 * 200e3) * 20 * 10 * 5
        self.assertAlmostEqual(self.results("case.vtkhdf")["dotyk/summary"].attrs["strain_energy"] / energy, 1, delta=1e-9)

    def test_triangles_that_are_refused(self):
        scene = "&scene mesh='parts.stl' /\n&material name='m', young=1, poisson=0 /\n&body name='a', volume='solid 1', material='m' /\n"
        self.write("case.nml", scene)
        self.stl("Box(1) = {0, 0, 0, 2, 2, 2};\n")
        whole = (self.folder / "parts.stl").read_text().split("endfacet")
        self.write("parts.stl", "endfacet".join(whole[:1] + whole[2:]))
        self.assertIn("parts.stl: gmsh could not mesh it:\n  No elements in volume 1", self.dotyk("case.nml", code=2))
        self.assertIn("the surface must be closed, without holes", self.dotyk("case.nml", code=2))
        self.stl("Box(1) = {0, 0, 0, 2, 2, 2};  Box(2) = {0.5, 0.5, 0.5, 1, 1, 1};\n")
        self.assertIn("closed surface 2 lies in the box of closed surface 1, a part or a cavity", self.dotyk("case.nml", code=2))
        self.write("parts.stl", "hello\n")
        self.assertIn("the file has no triangles", self.dotyk("case.nml", code=2))

    def test_mesh_of_its_own(self):
        """Size and order; one mesh for each of them is kept, and taken again."""
        self.parts()
        numbers = []
        for more in ("", ", mesh_order=1", ""):
            self.write("case.nml", SCENE % ("step", more))
            numbers.append(re.search(r"part 1 +steel +(\d+) +(\d+)", self.dotyk("case.nml", "--check")).groups())
        self.assertEqual(numbers[0], numbers[2])
        self.assertEqual(numbers[0][0], numbers[1][0])
        self.assertLess(int(numbers[1][1]), int(numbers[0][1]))
        self.assertEqual(len(list(self.folder.glob(".dotyk/parts.step-3d-*.msh"))), 2)
        self.assertEqual([path.name for path in self.folder.glob(".dotyk/*.geo")], [])
        text = (self.folder / "case.nml").read_text().replace(", mesh_size=4", "").replace("repeat=2", "repeat=3")
        self.write("default.nml", text)
        printed = self.dotyk("default.nml", "--check")
        elements = [int(n) for n in re.findall(r"\n  part \d +steel +(\d+)", printed)]
        # A twelfth of each solid: the round one has more elements than its size.
        self.assertTrue(all(400 < n < 6000 for n in elements), elements)

    def test_faces_are_listed(self):
        self.parts()
        self.write("case.nml", (SCENE % ("step", "")).replace("repeat=2", "repeat=3"))
        text = self.dotyk("case.nml", "--check")
        self.assertNotIn("looks like Pa", text)
        # A modulus in Pa beside lengths in mm.
        self.write("pascal.nml", (SCENE % ("step", "")).replace("200e3", "200e9"))
        self.assertIn("warning: lengths of 'parts.step' are in mm, and young=2e11 of 'steel' looks like Pa", self.dotyk("pascal.nml", "--check"))
        self.assertIn("faces of parts.step in its own coordinates, in mm: about their area, centre, and normal where plane", text)
        self.assertIn("    'part 2', solid 2\n      face 7      30, (0, 5, 6.5), (-1, 0, 0)\n", text)
        self.assertRegex(text, r"\n      face 13 +100\.\d*, \(40, \S+, 4\), cylinder of radius 2 about \(0, 0, 1\)\n")
        self.assertIn(", (40, ", text)
        self.assertEqual(text.count("      face "), 15)

    def test_shapes_and_picture(self):
        """Cylinders, holes and spheres in any direction; cones are none of them. The faces with their numbers are in a file."""
        self.write("make.geo", 'SetFactory("OpenCASCADE");\nCylinder(1) = {0, 0, 0, 6, 0, 8, 5};  Cylinder(2) = {-3, 0, -4, 12, 0, 16, 2};\n'
                   "BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };  Sphere(4) = {30, 0, 0, 4};\n"
                   'Cone(5) = {50, 0, 0, 0, 0, 8, 4, 2};  Save "parts.step";\n')
        subprocess.run(["gmsh", "-0", "make.geo"], cwd=self.folder, check=True, capture_output=True)
        self.write("case.nml", SCENE[:SCENE.index("&support")].replace("repeat=2", "repeat=3") % ("step", ", mesh_order=1"))
        text = self.dotyk("case.nml", "--check")
        for shape in ("cylinder of radius 5 about (0.6, 0, 0.8)", "hole of radius 2 about (0.6, 0, 0.8)", "sphere of radius 4"):
            self.assertEqual(text.count(", %s\n" % shape), 1, text)
        self.assertEqual(text.count(" of radius "), 3, text)
        self.assertIn("the faces are drawn in case.faces.vtu", text)
        drawing = (self.folder / "case.faces.vtu").read_text()
        array = {name: values.split() for name, values in re.findall(r'Name="(\w+)"[^>]*>([^<]*)<', drawing)}
        self.assertEqual(sorted(set(array["face"]), key=int), re.findall(r"\n      face (\d+) ", text))
        self.assertEqual(set(array["body"]), {"1", "2", "3"})
        self.assertEqual(len(array["Points"]), 3 * int(array["offsets"][-1]))
        self.assertEqual(len(array["types"]), len(array["face"]))

    def test_names_of_solids(self):
        """Names of the file beside numbers; those that several solids have get numbers."""
        self.parts()
        text = (self.folder / "parts.step").read_text()
        names = iter(["all", "Pin", "Block", "Pin"])
        text = re.sub(r"PRODUCT\('[^']*',\s*'[^']*'", lambda _: "PRODUCT('%s',''" % next(names), text)
        self.assertEqual(list(names), [])
        self.write("parts.step", text)
        scene = SCENE % ("step", ", mesh_order=1")
        for old, new in (("name='part *', volume='solid *'", "name='part 1', volume='Pin 1'"), (", repeat=2 /", " /\n&body name='part 2', volume='Block', "
                         "material='steel' /\n&body name='pin', volume='Pin 2', material='steel' /")):
            self.assertIn(old, scene)
            scene = scene.replace(old, new)
        self.write("case.nml", scene)
        listed = self.dotyk("case.nml", "--check")
        self.assertRegex(listed, r"  solids of parts.step by their names\n    Pin 1 +\d+ elements\n    Block +\d+ elements\n    Pin 2 +\d+ elements\n")
        self.assertIn("    'part 2', Block\n      face 7 ", listed)
        self.write("case.nml", scene.replace("'Block'", "'Blok'"))
        self.assertIn("(did you mean 'Block'?)", self.dotyk("case.nml", code=2))

    def test_crash_of_gmsh(self):
        """The solid at which gmsh crashes is named: a gmsh that does so for the second one."""
        self.parts()
        fake = self.write("gmsh.sh", "#!/bin/sh\ncase \"$1\" in --version) exec gmsh --version;; esac\nfor last; do :; done\n"
                          "grep -q 'i != 0' \"$last\" && exec gmsh \"$@\"\nkill -SEGV $$\n")
        fake.chmod(0o755)
        self.write("case.nml", SCENE % ("step", ", mesh_order=1"))
        text = self.dotyk("case.nml", code=2, DOTYK_GMSH=str(fake))
        self.assertRegex(text, r"parts.step: gmsh could not mesh it:\n  exit status 1\d\d\n  gmsh crashed at solid 2, as it does where a curved face "
                               r"ends in a point, such as the apex of a cone")

    def test_what_is_refused(self):
        self.parts()
        text = SCENE % ("step", "")
        self.write("case.nml", text.replace("repeat=2", "repeat=4"))
        self.assertIn("'solid 4'", self.dotyk("case.nml", code=2))
        self.write("case.nml", text.replace("mesh_size=4", "mesh_order=3"))
        self.assertIn("case.nml:1: &scene: mesh_order must be 1 or 2", self.dotyk("case.nml", code=2))
        self.write("case.nml", text.replace("mesh_size=4", "analysis='plane_strain'"))
        self.assertIn("has solids, which need analysis='3d'", self.dotyk("case.nml", code=2))
        self.write("case.nml", text.replace("mesh_size=4", "mesh_size=0.004"))
        self.assertIn("mesh_size is less than 1/1000 of the extent of solid 1, 20 mm: lengths are in mm", self.dotyk("case.nml", code=2))
        self.write("case.nml", text.replace("parts.step", "make.geo"))
        self.assertIn("mesh_size is for CAD files, and no body has one", self.dotyk("case.nml", code=2))
        self.write("make.geo", 'SetFactory("OpenCASCADE");\nRectangle(1) = {0, 0, 0, 1, 1};\nSave "parts.step";\n')
        subprocess.run(["gmsh", "-0", "make.geo"], cwd=self.folder, check=True, capture_output=True)
        self.write("case.nml", text)
        self.assertIn("the file has no solids", self.dotyk("case.nml", code=2))
        self.write("parts.step", "ISO-10303-21;\nno such thing\n")
        self.write("case.nml", text)
        self.assertIn("parts.step: gmsh", self.dotyk("case.nml", code=2))
        self.assertFalse((self.folder / "case.vtkhdf").exists())


if __name__ == "__main__":
    dotyk_case.main()
