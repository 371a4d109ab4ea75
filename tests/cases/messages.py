#!/usr/bin/python3
"""Exit codes and messages of the program: bad input, scenes that cannot be solved, files that cannot be written,
options."""
import os
import re
import subprocess
import time

import numpy as np

import dotyk_case
from blocks import block_geo, column_nml


class Messages(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        for name, z in (("lower", 0.0), ("upper", 1.0)):
            self.write(name + ".geo", block_geo("hex8", 1, (0.0, 0.0, z)))
        self.text = column_nml(3, solver="theta_relative=1, tolerance=1e-8")

    def scene(self, *changes):
        """Write the column with some patterns replaced."""
        text = self.text
        for old, new in changes:
            self.assertIn(old, text)
            text = text.replace(old, new)
        self.write("case.nml", text)

    def line_of(self, part):
        """Number of the line of the input file that has this part."""
        lines = (self.folder / "case.nml").read_text().split("\n")
        return 1 + next(i for i, line in enumerate(lines) if part in line)

    def refuse(self, code, *expected, options=()):
        """The case is refused with this exit code; the messages are on the standard error, and no results are
        written."""
        done = subprocess.run([os.environ["DOTYK"], "case.nml", "--verbose", *options], cwd=self.folder, text=True, timeout=60,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        for part in expected:
            self.assertIn(part, done.stderr)
        self.assertEqual([path for path in self.folder.iterdir() if "vtkhdf" in path.name], [])
        return done.stderr

    # Bad input: 2

    def test_input_mistakes_in_one_go(self):
        self.scene(("young=30.0", "yuong=30.0"), ("poisson=0.3", "poisson=0.7"),
                   ("&body name='upper'", "&boddy name='upper'"),
                   ("theta_relative=1", "theta_relative=-1"), ("fix='x'", "fix='q'"))
        at = self.line_of
        self.refuse(2, "case.nml:%d: &material: unknown key 'yuong' (did you mean 'young'?)" % at("yuong"),
                    "case.nml:%d: &material: poisson must be above -1 and below 0.5" % at("poisson=0.7"),
                    "case.nml:%d: unknown group '&boddy' (did you mean '&body'?)" % at("&boddy"),
                    "case.nml:%d: &solver: theta_relative must not be below 0" % at("theta_relative"),
                    "case.nml:%d: &support: " % at("fix='q'"))

    def test_unresolved_names_of_the_input(self):
        self.scene(("material='of lower'", "material='of loser'"), ("surface_b='lower:top'", "surface_b='lover:top'"))
        self.refuse(2, "case.nml:%d: " % self.line_of("of loser"), "of loser",
                    "case.nml:%d: " % self.line_of("lover:top"), "lover")

    def test_physical_names_in_one_go(self):
        """Those of all meshes together, with the names that each mesh has."""
        self.scene(("lower.geo', volume='block'", "lower.geo', volume='blok'"), ("upper:bottom", "upper:botom"),
                   ("surface='top'", "surface='tip'"))
        message = self.refuse(2, "case.nml:%d: " % self.line_of("blok"), "'blok'", "(did you mean 'block'?)",
                              "case.nml:%d: " % self.line_of("botom"), "'botom'",
                              "case.nml:%d: " % self.line_of("'tip'"), "'tip'")
        for line in message.splitlines():
            if "botom" in line or "'tip'" in line:
                for name in ("'bottom'", "'top'", "'sides x'", "'sides y'"):
                    self.assertIn(name, line)
        self.assertIn("lower.geo", message)

    def test_files_that_are_something_else(self):
        """None is waited for, and each is called by its name."""
        self.scene()
        os.mkfifo(self.folder / "pipe.msh")
        (self.folder / "zero.msh").symlink_to("/dev/zero")
        (self.folder / "folder.msh").mkdir()
        self.write("empty.msh", "")
        (self.folder / "wide.msh").write_text("$MeshFormat\n2.2 0 8\n", encoding="utf-16")
        (self.folder / "results.msh").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
        self.write("mesh.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
        (self.folder / "zeros.msh").write_bytes(bytes(2000))
        odd = [("pipe", "is a pipe, not a file", "is a pipe, not a file"),
               ("zero", "is a device, not a file", "is a device, not a file"),
               ("folder", "is a directory", "is a directory"), ("empty", "the file is empty", "the file has no groups"),
               ("wide", "it is UTF-16 text", "is UTF-16 text, no namelist file: save it as UTF-8"),
               ("results", "it is an HDF5 file", "is an HDF5 file, no namelist file"),
               ("zeros", "it is a binary file", "is a binary file, no namelist file")]
        for name, of_mesh, of_input in odd:
            self.write("case.nml", self.text.replace("lower.geo", name + ".msh"))
            self.assertEqual(self.refuse(2, of_mesh).count("\n"), 1)
            self.assertIn(of_input, self.dotyk(name + ".msh", code=2))
        self.assertIn("is a mesh of gmsh, no namelist file: a scene names it by mesh=",
                      self.dotyk("mesh.msh", code=2))
        self.assertIn("is a geometry of gmsh", self.dotyk("lower.geo", code=2))
        for name, text, words in (("deck.inp", "**\n*NODE\n1, 0, 0\n", "dotyk-convert makes a first scene from it"),
                                  ("deck", "*Heading\na\n", "dotyk-convert makes a first scene from it"),
                                  ("part.step", "ISO-10303-21;\nHEADER;\n", "is a CAD file, no namelist file"),
                                  ("part.STL", "solid a\n facet normal 0 0 1\n", "is a CAD file, no namelist file"),
                                  ("part.vtu", "<VTKFile>\n", "is a mesh, no namelist file: a scene names it by mesh=")):
            self.write(name, text)
            message = self.dotyk(name, code=2)
            self.assertIn(words, message)
            self.assertEqual(message.count("\n"), 1)

    def test_keys_of_friction(self):
        for key in "friction", "mu", "friction_coefficient":
            self.scene(("&contact name='joint'", "&contact %s=0.2, name='joint'" % key))
            self.refuse(2, "case.nml:%d: &contact: unknown key '%s' (contact is without friction" % (
                self.line_of("&contact"), key))

    def test_decimal_commas(self):
        """Decimals that a comma splits off are told where they cannot be values of their own."""
        for values, text in (("0,0,01", "value: '0,01' are two values: decimals have a point, write 0.01"),
                             ("-2,05,0", "value: '-2,05' are two values: decimals have a point, write -2.05")):
            self.scene(("surface='bottom', fix='z'", "surface='bottom', fix='xyz', value=" + values))
            self.assertEqual(self.refuse(2, "case.nml:%d: &support: %s" % (self.line_of(values), text)).count("\n"), 1)
        self.scene(("tolerance=1e-8", "tolerance=1,5e-8"))
        self.refuse(2, "tolerance needs 1 value, got 2 (decimals have a point: 1.5e-8)")
        self.scene(("surface='bottom', fix='z'", "surface='bottom', fix='xyz', value=0,0,-0.01"))
        self.dotyk("case.nml", "--check")

    def test_results_take_the_place_of_results_only(self):
        self.scene()
        (self.folder / "notes.txt").write_text("mine\n")
        (self.folder / "far").mkdir()
        (self.folder / "link.vtkhdf").symlink_to("far/real.vtkhdf")
        os.mkfifo(self.folder / "pipe.vtkhdf")
        for name in ("case.nml", "./case.nml", "lower.geo", "notes.txt"):
            before = (self.folder / name).read_bytes()
            self.assertIn("'%s' exists and is not a results file" % name,
                          self.dotyk("case.nml", "--output", name, code=4))
            self.assertEqual((self.folder / name).read_bytes(), before)
        for name, reason in (("pipe.vtkhdf", "is a pipe"), ("/dev/null", "is a device"), ("far", "is a folder")):
            self.assertIn(reason, self.dotyk("case.nml", "--output", name, code=4))
        self.dotyk("case.nml", "--output", "link.vtkhdf")
        self.assertTrue((self.folder / "link.vtkhdf").is_symlink())
        self.assertTrue((self.folder / "far" / "real.vtkhdf").is_file())
        if os.geteuid() == 0:
            return  # to whom nothing is protected
        (self.folder / "far" / "real.vtkhdf").chmod(0o444)
        self.assertIn("is protected", self.dotyk("case.nml", "--output", "far/real.vtkhdf", code=4))

    def test_very_many_groups(self):
        """They are read in seconds."""
        for text, message in (("&x\n", "&x: the group is not ended with '/' before '&x' in line 2"),
                              ("&body /\n", "&body: 'name' is missing"),
                              ("x\n", "text outside the groups: 'x'")):
            self.write("many.nml", text*300000)
            done = subprocess.run([os.environ["DOTYK"], "many.nml", "--check"], cwd=self.folder, text=True, timeout=60,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            self.assertEqual(done.returncode, 2)
            self.assertIn("many.nml:1: " + message, done.stderr)
            self.assertLess(len(done.stderr), 10000)

    def test_very_long_texts(self):
        """Lines of messages are cut, and texts of doubled quotes are read in linear time: a second, not a minute."""
        self.scene(("surface_b='lower:top'", "surface_b='lower:top%s'" % ("1" * 200000)))
        message = self.refuse(2, "case.nml:%d: " % self.line_of("lower:top"), " [...] ")
        self.assertLess(len(message), 1100)
        self.scene(("name='upper'", "name='%s'" % ("''" * 200000)))
        start = time.monotonic()
        self.refuse(2)
        self.assertLess(time.monotonic() - start, 5)

    def test_no_control_characters(self):
        """Names may hold what a terminal would take for commands."""
        self.scene(("name='lower'", "name='low\x1b[31mer'"))
        message = self.refuse(2, "low?[31mer")
        self.assertNotIn("\x1b", message)
        self.write("lower.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"bl\x1b[2Jock\"\n"
                   "$EndPhysicalNames\n"
                   "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n1 4 2 1 1 1 2 3 4\n"
                   "$EndElements\n")
        self.scene(("mesh='lower.geo'", "mesh='lower.msh'"))
        self.assertNotIn("\x1b", self.refuse(2, "bl?[2Jock"))

    def test_numbers_that_do_not_fit(self):
        self.scene(("-0.001", "-1e300"))
        self.refuse(2, "case.nml:%d: &support: value: '-1e300' is too large or too small" % self.line_of("-1e300"),
                    "other units")

    def test_formula(self):
        self.scene(("lower:top'", "lower:top', gap_formula='1e-3*(x'"))
        self.refuse(2, "case.nml:%d: &contact: " % self.line_of("&contact"), "gap_formula")

    def test_missing_mesh(self):
        self.scene(("mesh='lower.geo'", "mesh='lover.geo'"))
        self.refuse(2, "lover.geo")

    def test_broken_geometry(self):
        self.write("lower.geo", "Point(1) = {0, 0};\nthis is no geometry\n")
        self.scene()
        self.refuse(2, "lower.geo")

    def test_truncated_mesh(self):
        self.write("lower.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n")
        self.scene(("mesh='lower.geo'", "mesh='lower.msh'"))
        self.refuse(2, "lower.msh:")

    def test_no_partner(self):
        self.scene(("lower:top'", "lower:bottom'"))
        self.refuse(2, "case.nml", "joint")

    def test_stop_rule_of_the_paper(self):
        """(41) needs gamma below gamma_2: the rule 'theory' is the default with it, the spectral rule does not heed it."""
        self.scene(("tolerance=1e-8", "stop_rule='paper', gamma_rule='spectral'"))
        self.refuse(2, "case.nml:%d: &solver: " % self.line_of("&solver"), "stop_rule='paper'", "gamma_2",
                    "gamma_rule='theory'")
        self.scene(("tolerance=1e-8", "stop_rule='paper'"))
        self.dotyk("case.nml")
        summary = self.results("case.vtkhdf")["dotyk/summary"].attrs
        self.assertLessEqual(summary["error_bound_paper"], 1e-6)
        # (41) overestimates what the other bound guarantees.
        self.assertLess(summary["error_bound"], summary["error_bound_paper"])

    def test_missing_case(self):
        self.refuse(2, "case.nml", "does not exist")

    # Not solvable as posed: 3

    def test_not_held(self):
        self.scene(("surface='bottom', fix='z'", "surface='bottom', fix='x'"), ("tolerance=1e-8", "scheme='neumann'"))
        self.refuse(3, "case.nml:%d: body 'lower': scheme 'neumann' needs supported bodies, and this body floats: "
                    "translation along (0, 0, 1); add a &support against this motion, or use scheme='dual', which "
                    "allows floating bodies"
                    % self.line_of("&body name='lower'"))

    def test_nothing_is_held(self):
        """Where no body has a support the end says so; a body that is held elsewhere takes the words away."""
        lines = [line for line in self.text.split("\n") if "&support" not in line]
        self.text = "\n".join([*lines, "&load body='upper', surface='top', pressure=1 /", ""])
        self.scene()
        message = self.refuse(3, "(no body of the scene has a &support)")
        self.assertIn("no equilibrium", message)
        self.text += "&support body='upper', surface='sides x', fix='x' /\n"
        self.scene()
        self.assertNotIn("has a &support)", self.refuse(3, "no equilibrium"))

    def test_bodies_given_twice(self):
        """The same volume in the same place is refused, with both lines; moved or turned it is another body."""
        again = "&body name='again', mesh='lower.geo', volume='block', material='of lower' %s/"
        self.text += again % "" + "\n"
        self.scene()
        self.refuse(2, "case.nml:%d: &body: 'again' is the same volume in the same place as 'lower' of line %d: a volume is one body" % (
            self.line_of("'again'"), self.line_of("&body name='lower'")))
        for place in ", at=0,0,-1 ", ", axis=1,0,0, angle=180 ":
            self.scene((again % "", again % place))
            self.assertNotIn("in the same place", self.dotyk("case.nml", "--check", code=None))

    def test_not_held_either(self):
        """All bodies that are not held, each with its motions."""
        self.scene(("surface='bottom', fix='z'", "surface='bottom', fix='x'"), ("tolerance=1e-8", "scheme='neumann'"),
                   ("&support body='upper', surface='sides x', fix='x' /\n", ""),
                   ("&support body='upper', surface='sides y', fix='y' /\n", ""))
        self.refuse(3, "body 'lower'", "translation along (0, 0, 1)", "body 'upper'", "translation along (1, 0, 0)",
                    "translation along (0, 1, 0)", "rotation")

    # Stopped before the tolerance: 1, with results

    def test_max_iterations(self):
        self.scene(("tolerance=1e-8", "scheme='neumann', tolerance=1e-8, max_iterations=3"))
        text = self.dotyk("case.nml", code=1)
        self.assertIn("not converged", text)
        self.assertIn("max_iterations", text)
        file = self.results("case.vtkhdf")
        summary = file["dotyk/summary"].attrs
        self.assertEqual(summary["converged"], 0)
        self.assertEqual(summary["iterations"], 3)
        self.assertGreater(summary["error_bound"], 1e-8)
        self.assertLessEqual(summary["q_measured"], summary["q_predicted"])
        self.assertEqual(len(file["dotyk/history/energy"]), 3)

    def test_max_iterations_of_active_sets(self):
        """The dual scheme stops where it is told to, and at no other number."""
        self.copy("wavy")
        scene = (self.folder / "wavy/wavy.nml").read_text()
        counts = []
        for most in (1, 2, 100000):
            self.write("wavy/case.nml", re.sub("tolerance=1e-8.*/", "tolerance=1e-8, max_iterations=%d /" % most, scene))
            text = self.dotyk("wavy/case.nml", code=int(most < 10))
            summary = self.results("wavy/case.vtkhdf")["dotyk/summary"].attrs
            counts.append(summary["iterations"])
            self.assertEqual(summary["status"], b"max_iterations" if most < 10 else b"converged")
            self.assertEqual("max_iterations" in text, most < 10)
        self.assertEqual(counts[:2], [1, 2])
        self.assertGreater(counts[2], 2)

    def test_gamma_too_large(self):
        self.scene(("tolerance=1e-8", "gamma_rule='fixed', gamma=1.9"))
        text = self.dotyk("case.nml", code=1)
        summary = self.results("case.vtkhdf")["dotyk/summary"].attrs
        self.assertEqual((summary["converged"], summary["gamma"]), (0, 1.9))
        found = re.search(r"\n  diverged +gamma = 1.9 exceeds the stability limit ([^\s;]+);", text)
        self.assertTrue(found, text)
        limit = float(found[1])
        self.assertAlmostEqual(limit * (1 + summary["lambda_max"]) / 2, 1, delta=1e-5)
        # Inside the range that it named, it converges.
        self.scene(("tolerance=1e-8", "gamma_rule='fixed', gamma=%r" % (0.95 * limit)))
        self.dotyk("case.nml")

    def test_increment_is_no_error(self):
        """A small gamma makes a small increment at any distance from the solution."""
        self.scene(("theta_relative=1, tolerance=1e-8",
                    "scheme='neumann', theta_relative=1e-3, stop_rule='increment', gamma_rule='fixed', gamma=1e-6, "
                    "tolerance=1e-2"))
        text = self.dotyk("case.nml", code=1)
        self.assertIn("not converged: stop_rule met by an iterate without a useful error bound", text)
        self.assertRegex(text, r"\n  stop_rule +'increment' is met: the last increment, [^ ]+, does not exceed the tolerance")
        self.assertNotIn("rounding", text)
        summary = self.results("case.vtkhdf")["dotyk/summary"].attrs
        self.assertEqual((summary["converged"], summary["status"]), (0, b"unverified"))
        self.assertGreater(summary["error_bound"], 0.5)
        # The same rule near the solution is a convergence criterion, and the bound is said without blaming rounding.
        self.scene(("theta_relative=1, tolerance=1e-8",
                    "scheme='neumann', theta_relative=1e-1, stop_rule='increment', tolerance=1e-4"))
        text = self.dotyk("case.nml")
        self.assertRegex(text, r"\n  stop_rule +'increment' is met")
        self.assertNotIn("rounding", text)

    # Not written: 4

    def test_no_output_folder(self):
        self.scene()
        self.refuse(4, "'none/results.vtkhdf' cannot be written", options=("--output", "none/results.vtkhdf"))
        self.scene(("&scene ", "&scene output='none/results.vtkhdf', "))
        self.refuse(4, "none/results.vtkhdf' cannot be written")

    def test_output_is_a_folder(self):
        self.scene()
        (self.folder / "there").mkdir()
        self.refuse(4, "'there'", options=("--output", "there"))

    # Options

    def test_check(self):
        self.scene()
        text = self.dotyk("case.nml", "--check")
        for part in ("lower", "upper", "joint", "unknowns", "estimated memory", "nothing was solved"):
            self.assertIn(part, text)
        self.assertEqual([path for path in self.folder.iterdir() if "vtkhdf" in path.name], [])

    def test_check_finds_what_a_run_would(self):
        self.scene(("lower:top'", "lower:tip'"))
        self.refuse(2, "'tip'", options=("--check",))
        self.scene(("surface='bottom', fix='z'", "surface='bottom', fix='x'"), ("tolerance=1e-8", "scheme='neumann'"))
        self.refuse(3, "translation along (0, 0, 1)", options=("--check",))

    def test_help(self):
        text = self.dotyk("--help")
        for group in ("scene", "material", "body", "support", "load", "contact", "solver", "output"):
            self.assertRegex(text, r"(?m)^&%s\b" % group)
        for word in ("theta_relative", "gap_formula", "max_iterations", "1e-6", "100000", "exit codes", "--threads N"):
            self.assertIn(word, text)
        self.assertLessEqual(max(map(len, text.splitlines())), 120)

    def test_version(self):
        self.assertRegex(self.dotyk("--version"), r"^dotyk \d+\.\d+\.\d+")

    def test_wrong_options(self):
        self.assertIn("(did you mean --check?)", self.dotyk("case.nml", "--chek", code=2))
        self.assertIn("--threads", self.dotyk("case.nml", "--threads", "many", code=2))
        self.assertIn("--threads", self.dotyk("case.nml", "--threads", code=2))
        self.assertIn("one case", self.dotyk("a.nml", "b.nml", code=2))
        self.assertIn("no case", self.dotyk(code=2))

    def test_quiet(self):
        self.scene()
        self.assertEqual(self.dotyk("case.nml", "--quiet"), "")
        self.assertEqual(self.results("case.vtkhdf")["dotyk/summary"].attrs["converged"], 1)

    # Scenes with little in them

    def test_no_contact_pairs(self):
        self.scene(("&contact name='joint', surface_a='upper:bottom', surface_b='lower:top'", "! no contact"))
        self.text = re.sub(r"(?m)^! no contact.*\n", "", (self.folder / "case.nml").read_text())
        self.scene(("&output", "&load body='lower', surface='top', pressure=0.3 /\n&output"))
        self.assertIn("no contact pairs", self.dotyk("case.nml"))
        file = self.results("case.vtkhdf")
        summary = file["dotyk/summary"].attrs
        self.assertEqual((summary["converged"], summary["iterations"]), (1, 0))
        # Rounding is all the error there is.
        self.assertLess(summary["error_bound"], 1e-13)
        self.assertEqual(len(file["dotyk/contact"]), 0)
        self.assertEqual(file["dotyk/history/energy"].shape, (0,))
        # The lower block bears the pressure, the upper one follows its top.
        zz = file["VTKHDF/CellData/stress"][:, 2]
        np.testing.assert_allclose(zz, [-0.3, 0], rtol=0, atol=1e-12)

    def test_contact_that_never_closes(self):
        self.scene(("value=0, 0, -0.001", "value=0, 0, 0.001"))
        self.check_open(0.001)

    def test_nothing_moves(self):
        self.scene(("value=0, 0, -0.001", "value=0, 0, 0"))
        self.check_open(0.0)

    def check_open(self, gap):
        """Converged at once: no pressure, and the upper block moves as a whole."""
        self.dotyk("case.nml")
        file = self.results("case.vtkhdf")
        summary = file["dotyk/summary"].attrs
        self.assertEqual((summary["converged"], summary["error_bound"], summary["max_penetration"]), (1, 0, 0))
        joint = file["dotyk/contact/joint"]
        np.testing.assert_array_equal(joint["pressure"][:], 0)
        np.testing.assert_array_equal(joint.attrs["force"], 0)
        np.testing.assert_allclose(joint["gap"][:], gap, rtol=0, atol=1e-15)


dotyk_case.main()
