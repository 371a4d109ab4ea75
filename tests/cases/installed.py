#!/usr/bin/python3
"""`cmake --install` into a folder: program, Python package and its commands, manual page, completion, examples and
pages; and that they work there, without what the repository has."""
import gzip
import os
import pathlib
import re
import shutil
import subprocess

import dotyk_case
from decks import CUBE

COMMANDS = ["dotyk-convert", "dotyk-render", "dotyk-summary"]
BASH_COMPLETION = pathlib.Path("/usr/share/bash-completion/bash_completion")
DECK = (CUBE + "*ELEMENT, TYPE=C3D8, ELSET=cube\n1, 1,2,3,4,5,6,7,8\n*NSET, NSET=foot\n1, 2, 3, 4\n"
        "*NSET, NSET=head\n5, 6, 7, 8\n*BOUNDARY\nfoot, 1, 3\n*MATERIAL, NAME=M\n*ELASTIC\n200., 0.\n"
        "*SOLID SECTION, ELSET=cube, MATERIAL=M\n"
        "*STEP\n*STATIC\n*CLOAD\nhead, 3, -1.\n*END STEP\n")


class Installed(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        folders = pathlib.Path(os.environ["DOTYK"]).resolve().parents
        build = next((folder for folder in folders if (folder / "CMakeCache.txt").is_file()), None)
        if build is None:
            self.skipTest("the program is in no build folder")
        self.prefix = self.folder / "prefix"
        self.run_program("cmake", "--install", build, "--prefix", self.prefix)
        self.share, self.doc = self.prefix / "share", self.prefix / "share/doc/dotyk"
        self.package = next(self.prefix.glob("lib/**/dotyk"))
        self.python = (self.prefix / "bin/dotyk-convert").read_text().splitlines()[0][2:]
        self.manual = gzip.decompress((self.share / "man/man1/dotyk.1.gz").read_bytes()).decode("ascii")

    def run_program(self, program, *arguments, code=0, **environment):
        """What a program of the install or of the PATH prints; the package of the repository is not found."""
        own = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        program = self.prefix / "bin" / program if program.startswith("dotyk") else shutil.which(program)
        done = subprocess.run([program, *map(str, arguments)], cwd=self.folder, text=True, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              env={**own, "PYTHONDONTWRITEBYTECODE": "1", **environment})
        self.assertEqual(done.returncode, code, done.stdout)
        return done.stdout

    def test_files(self):
        """All scenes, pages and modules of the repository; each command has a manual page and completion."""
        def names(folder, pattern):
            paths = [path.relative_to(folder) for path in pathlib.Path(folder).rglob(pattern)]
            return sorted(str(path) for path in paths if ".dotyk" not in path.parts)

        self.assertEqual(names(self.prefix / "bin", "*"), ["dotyk", *COMMANDS])
        self.assertEqual(names(self.share / "bash-completion/completions", "*"), ["dotyk", *COMMANDS])
        for name in ["dotyk", *COMMANDS]:
            self.assertEqual((self.share / "man/man1" / (name + ".1.gz")).resolve().name, "dotyk.1.gz")
        for pattern in ("*.nml", "*.geo", "*.step", "check.py"):
            self.assertEqual(names(self.doc / "examples", pattern), names(dotyk_case.INPUTS, pattern))
        for path in (self.doc / "examples").rglob("*.*"):
            self.assertEqual(oct(path.stat().st_mode & 0o777), "0o755" if path.suffix == ".py" else "0o644", path)
        self.assertEqual(names(self.doc / "docs", "*.md"), names(dotyk_case.ROOT / "docs", "*.md"))
        self.assertEqual(names(self.package, "*.py"), names(pathlib.Path(dotyk_case.PACKAGE) / "dotyk", "*.py"))
        for page in (self.doc / "README.md", *(self.doc / "docs").glob("*.md"), self.doc / "examples/README.md"):
            for link in re.findall(r"\]\((?:\.\./)?((?:inputs|docs)/[^)#]+)", page.read_text()):
                self.assertTrue((self.doc / link).exists(), (page, link))
        self.assertIn((dotyk_case.ROOT / "LICENSE").read_text(), (self.doc / "copyright").read_text())
        with gzip.open(self.doc / "changelog.gz") as file:
            self.assertEqual(file.read(), (dotyk_case.ROOT / "CHANGELOG.md").read_bytes())

    def test_one_version(self):
        """The number in CMakeLists.txt is that of program, manual page, module and distribution."""
        text = (dotyk_case.ROOT / "CMakeLists.txt").read_text()
        version = re.search(r"project\(dotyk VERSION ([\d.]+)", text)[1]
        self.assertRegex(self.run_program("dotyk", "--version"), r"^dotyk %s \(" % re.escape(version))
        self.assertIn('"dotyk %s"' % version, self.manual.splitlines()[0])
        script = ("import dotyk; from importlib.metadata import version; "
                  "print(dotyk.__version__, version('dotyk'), dotyk.__file__)")
        printed = self.run_program("bash", "-c", self.python + ' -c "$0"', script, PYTHONPATH=str(self.package.parent))
        self.assertEqual(printed.split(), [version, version, str(self.package / "__init__.py")])

    def test_deck_to_summary(self):
        """The program finds its converter, the commands their package in the install: a cube of a deck under a force."""
        self.write("cube.inp", DECK)
        python = self.write("python", '#!/bin/sh\necho "$2" > converter\nexec %s "$@"\n' % self.python)
        python.chmod(0o755)
        self.assertEqual(self.run_program("dotyk-convert", "cube.inp"), "")
        self.run_program("dotyk", "cube.nml", DOTYK_PYTHON=str(python))
        converter = pathlib.Path((self.folder / "converter").read_text().strip())
        self.assertEqual(converter.resolve(), (self.package / "mesh2msh").resolve())
        table = self.run_program("dotyk-summary", "--csv", "bodies", "cube.vtkhdf")
        self.assertEqual(len(table.splitlines()), 2, table)
        file = self.results("cube.vtkhdf")
        head = file["VTKHDF/PointData/node_tag"][:] > 4
        self.assertAlmostEqual(file["VTKHDF/PointData/displacement"][:][head, 2].mean(), -4/200, delta=1e-9)

    def test_help(self):
        """Every group with its keys as in docs/input.md, every option of --help; troff has nothing to complain of."""
        def by_group(text, group, key):
            parts = re.split(group, text)[1:]
            return [(name, re.findall(key, keys)) for name, keys in zip(parts[::2], parts[1::2])]

        page = (dotyk_case.ROOT / "docs/input.md").read_text()
        wanted = by_group(page, r"(?m)^## `&(\w+)`$", r"(?m)^\| `(\w+)` \|")
        self.assertGreater(len(wanted), 10)
        self.assertEqual(by_group(self.manual, r"(?m)^\.SS &(\w+)$", r"(?m)^\.TP\n\\fB(\w+)\\fR"), wanted)
        for option in self.options("dotyk"):
            self.assertIn("\n.TP\n\\fB%s\\fR" % option.replace("-", "\\-"), self.manual)
        if shutil.which("man"):
            path = self.write("dotyk.1", self.manual)
            said = self.run_program("bash", "-c", 'man --warnings -l "$0" 2>&1 > /dev/null', path, MANWIDTH="80")
            self.assertEqual(said, "")

    def options(self, command):
        """The options that --help of a command lists, one a line."""
        found = re.findall(r"(?m)^ +(?:-\w[^,\n]*, )?(--[\w-]+)", self.run_program(command, "--help"))
        self.assertGreaterEqual(len(found), 2)
        return sorted(found)

    def test_completion(self):
        """All options of each command, and the files that it reads."""
        if not BASH_COMPLETION.is_file():
            self.skipTest("bash-completion is not installed")
        for name in ("a.nml", "b.inp", "c.vtkhdf", "d.txt"):
            self.write(name, "")

        def complete(command, *words):
            words = [str(self.prefix / "bin" / command), *words]
            program = ('. "$0"; . "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE=$*\n'
                       'COMP_LINE=${COMP_LINE// = /=}; COMP_POINT=${#COMP_LINE}; _dotyk "$1" "${@: -1}" "${@: -2:1}"\n'
                       'printf "%s\\n" "${COMPREPLY[@]}"')
            own = self.share / "bash-completion/completions" / command
            printed = self.run_program("bash", "-c", program, BASH_COMPLETION, own, *words)
            return sorted(filter(None, (word.rstrip() for word in printed.splitlines())))

        for command in ["dotyk", *COMMANDS]:
            self.assertEqual(complete(command, "--"), self.options(command))
        self.assertEqual(complete("dotyk", "--th"), ["--threads"])
        self.assertEqual(complete("dotyk", "--help", "=", ""), ["man", "markdown"])
        self.assertEqual(complete("dotyk", "--threads", ""), [])
        for command, words, file in (("dotyk", [], "a.nml"), ("dotyk", ["--restart"], "c.vtkhdf"),
                                     ("dotyk-convert", [], "b.inp"), ("dotyk-summary", [], "c.vtkhdf"),
                                     ("dotyk-render", [], "c.vtkhdf")):
            self.assertEqual([word for word in complete(command, *words, "") if "." in word], [file])


if __name__ == "__main__":
    dotyk_case.main()
