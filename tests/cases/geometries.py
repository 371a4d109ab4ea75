"""Geometries (.geo) that gmsh meshes: when a mesh may be used again, programs that a geometry starts, and the folder in
which meshes are kept."""
import os
import re
import subprocess

import dotyk_case

BLOCK = """
Mesh.MeshSizeMin = h; Mesh.MeshSizeMax = h;
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
Physical Surface("block") = {1}; Physical Curve("low") = {1}; Physical Curve("high") = {3};
"""
CASE = """
&scene mesh='block.geo', analysis='plane_strain' /
&material name='steel', young=1e5, poisson=0.3 /
&body name='block', volume='block', material='steel' /
&support body='block', surface='low', fix='xy' /
&load body='block', surface='high', pressure=1 /
"""

class Geometries(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.write("case.nml", CASE)

    def elements(self, *arguments, **environment):
        """Number of elements of the block, and the log."""
        text = self.dotyk("case.nml", "--check", *arguments, **environment)
        return int(re.search(r"^  block +steel +(\d+)", text, re.M)[1]), text

    def meshes(self, folder=".dotyk"):
        """Meshes that are kept."""
        return list((self.folder/folder).rglob("*.msh"))

    # What a mesh depends on

    def test_included_files_count(self):
        """Whatever the quotes, and whatever quotes stand in comments before."""
        self.write("block.geo", "// the block's size\n/* \" */ Include 'size.geo'; // \"\n" + BLOCK)
        self.write("size.geo", "h = 0.5;")
        coarse, _ = self.elements()
        kept = self.meshes()[0]
        before = kept.stat().st_ino
        self.assertEqual(self.elements()[0], coarse)
        self.assertEqual(kept.stat().st_ino, before)
        self.write("size.geo", "h = 0.1;")
        self.assertGreater(self.elements()[0], 4*coarse)
        self.assertEqual(self.meshes(), [kept])

    def test_files_of_any_way_in_count(self):
        """A name that is computed, a file that a function reads, and one that takes the place of another with an older time."""
        self.write("block.geo", "Include StrCat('si', 'ze.geo');\nlist() = ListFromFile('list.txt'); h = h/list(0);" + BLOCK)
        self.write("size.geo", "h = 0.5;")
        self.write("list.txt", "1")
        coarse, _ = self.elements()
        self.write("size.geo", "h = 0.25;")
        middle, _ = self.elements()
        self.assertGreater(middle, 2*coarse)
        self.write("list.txt", "2")
        self.assertGreater(self.elements()[0], 2*middle)
        old = self.write("other.geo", "h = 1;")
        os.utime(old, (1e9, 1e9))
        old.rename(self.folder/"size.geo")
        self.write("list.txt", "1")
        self.assertLess(self.elements()[0], coarse)
        # The same mesh from another folder, where the paths are others.
        before = self.meshes()[0].stat().st_ino
        (self.folder/"below").mkdir()
        subprocess.run([os.environ["DOTYK"], "../case.nml", "--check"], cwd=self.folder/"below", check=True, stdout=subprocess.DEVNULL)
        self.assertEqual(self.meshes()[0].stat().st_ino, before)
        (self.folder/"list.txt").unlink()
        (self.folder/"size.geo").unlink()
        self.assertIn("block.geo: gmsh could not mesh it", self.dotyk("case.nml", "--check", code=2))
        self.assertEqual(self.meshes(), [])

    def test_remesh(self):
        """What no file says."""
        self.write("block.geo", "h = 0.5; If(StrCmp(GetEnv('FINE'), 'yes') == 0) h = 0.1; EndIf" + BLOCK)
        coarse, _ = self.elements()
        self.assertEqual(self.elements(FINE="yes")[0], coarse)
        self.assertGreater(self.elements("--remesh", FINE="yes")[0], 4*coarse)

    def test_programs_that_are_newer_count(self):
        """gmsh, and options of the user, which it reads."""
        self.write("block.geo", "h = 0.5;" + BLOCK)
        coarse, _ = self.elements(HOME=str(self.folder))
        self.write(".gmshrc", "Mesh.MeshSizeFactor = 0.2;\n")
        fine, _ = self.elements(HOME=str(self.folder))
        self.assertGreater(fine, 4*coarse)
        before = self.meshes()[0].stat().st_ino
        gmsh = self.write("newer gmsh", "#!/bin/sh\nexec gmsh \"$@\"\n")
        gmsh.chmod(0o755)
        self.assertEqual(self.elements(HOME=str(self.folder), DOTYK_GMSH=str(gmsh))[0], fine)
        self.assertNotEqual(self.meshes()[0].stat().st_ino, before)

    # Programs

    def test_programs_are_named_and_forbidden(self):
        self.write("block.geo", "h = 0.5;\nSystemCall 'touch trace';" + BLOCK)
        _, text = self.elements()
        self.assertIn("warning: block.geo starts a program: 'touch trace'; its mesh is made again where a file is newer, or by --remesh. "
                      "--no-shell forbids programs to geometries", text)
        self.assertTrue((self.folder/"trace").exists())
        (self.folder/"trace").unlink()
        # The mesh that a program had a part in is not taken.
        self.assertIn("block.geo: gmsh could not mesh it under --no-shell:",
                      self.dotyk("case.nml", "--check", "--no-shell", code=2))
        self.assertFalse((self.folder/"trace").exists())

    def test_hidden_programs_are_not_started(self):
        """Statements in a file whose name is computed."""
        self.write("block.geo", "h = 0.5; Include StrCat('hidden', '.bin');" + BLOCK)
        for statement in ("SystemCall 'touch trace';", "Printf('x') > 'trace';", "CreateDir 'trace';"):
            self.write("hidden.bin", statement)
            self.dotyk("case.nml", "--check", "--no-shell", code=None)
            self.assertFalse((self.folder/"trace").exists(), statement)
        self.assertIn("block.geo: gmsh could not mesh it under --no-shell:", self.write_and_run("SystemCall 'touch trace';"))
        self.dotyk("case.nml", "--check")
        self.assertTrue((self.folder/"trace").exists())

    def write_and_run(self, statement):
        """What is printed where a hidden statement is forbidden."""
        self.write("hidden.bin", statement)
        return self.dotyk("case.nml", "--check", "--no-shell", code=2)

    def test_without_programs_all_is_the_same(self):
        self.write("block.geo", "h = 0.5;" + BLOCK)
        n, _ = self.elements("--no-shell")
        mesh = self.meshes()[0].read_bytes()
        self.meshes()[0].unlink()
        self.assertEqual(self.elements()[0], n)
        self.assertEqual(self.meshes()[0].read_bytes(), mesh)

    # Where meshes are kept

    def test_folders_of_others_are_not_used(self):
        """A folder that everybody can write may have meshes of others."""
        self.write("block.geo", "h = 0.5;" + BLOCK)
        (self.folder/".dotyk").mkdir()
        (self.folder/".dotyk").chmod(0o777)
        self.elements(XDG_CACHE_HOME=str(self.folder/"cache"))
        self.assertEqual(self.meshes(), [])
        self.assertEqual(len(self.meshes("cache/dotyk")), 1)
        (self.folder/"cache"/"dotyk").chmod(0o777)
        text = self.dotyk("case.nml", "--check", code=4, XDG_CACHE_HOME=str(self.folder/"cache"))
        self.assertIn("no directory for its mesh", text)
        # Without a home: a folder of this user alone among the temporary files.
        (self.folder/"tmp").mkdir()
        self.elements(XDG_CACHE_HOME="", HOME="", TMPDIR=str(self.folder/"tmp"))
        kept = self.folder/"tmp"/("dotyk-%d" % os.geteuid())
        self.assertEqual(kept.stat().st_mode & 0o777, 0o700)
        self.assertEqual(len(self.meshes(kept)), 1)

    def test_links_to_nothing_stay(self):
        self.write("block.geo", "h = 0.5;" + BLOCK)
        (self.folder/".dotyk").mkdir(mode=0o755)
        (self.folder/".dotyk"/".gitignore").symlink_to(self.folder/"target")
        self.elements()
        self.assertEqual(len(self.meshes()), 1)
        self.assertFalse((self.folder/"target").exists())


if __name__ == "__main__":
    dotyk_case.main()
