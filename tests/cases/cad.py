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
        self.assertEqual(len(list(self.folder.glob(".dotyk/parts-*.msh"))), 2)
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
        self.assertIn("faces of parts.step in its own coordinates, in mm: about their area, centre, and normal where plane", text)
        self.assertIn("    'part 2', solid 2\n      face 7      30, (0, 5, 6.5), (-1, 0, 0)\n", text)
        self.assertRegex(text, r"\n      face 13 +100\.\d*, \(40, \S+, 4\)\n")
        self.assertIn(", (40, ", text)
        self.assertEqual(text.count("      face "), 15)

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
