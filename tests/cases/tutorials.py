#!/usr/bin/python3
"""The tutorials of docs, and errors.md: their commands run as printed, and the log has the lines of the page."""
import re

import dotyk_case
from page import DOCS, PageCase, blocks

#: Lines with times, and those that the page cuts.
NOT_COMPARED = re.compile(r"\.\.\.|^\s*(time|factorization|hertz\.nml|dotyk \d|converged after)")


def printed(page):
    """Lines of the log on a page: blocks without a language. A line that the page breaks is two parts of one."""
    lines = [line for language, block in blocks(page) if language == "" for line in block.splitlines()]
    return [line for line in lines if line.strip() and not NOT_COMPARED.search(line)]


class Tutorials(PageCase):
    def compare(self, name, log, skip=""):
        """All printed lines of a page but those with the pattern `skip`."""
        lines = [line for line in printed((DOCS / name).read_text()) if not (skip and re.search(skip, line))]
        self.assertGreater(len(lines), 4)
        for line in lines:
            self.assertHasLine(line, log)

    def test_five_minutes(self):
        page = (DOCS / "five_minutes.md").read_text()
        self.copy("hertz/hertz.geo")
        scene = self.copy("hertz/hertz.nml").read_text()
        # The scene of the page is the example.
        self.assertIn(next(block for language, block in blocks(page) if language == "fortran"), scene)
        log = self.dotyk("hertz.nml", "--threads", "1")
        # Rounding, and moments about the origin, which are differences.
        self.compare("five_minutes.md", log, skip="bound|relative error|moment|smallest|touch   ")

    def test_errors(self):
        """Error bars of the example, and meshes that the program chooses for the roller of the recipes."""
        page = (DOCS / "errors.md").read_text()
        recipes = (DOCS / "how_do_i.md").read_text()
        for language, block in blocks(recipes):
            if language == "geo" and "roller.geo" in block:
                self.write("roller.geo", block)
        scene = next(block for _, block in blocks(recipes) if block.startswith("! accuracy.nml"))
        self.copy("hertz/hertz.geo")
        self.write("bars.nml", self.copy("hertz/hertz.nml").read_text() + re.search(r"(?m)^&output quantity=.*$", page)[0] + "\n")
        log = self.dotyk("bars.nml", "--threads", "1")
        for number, group in enumerate(re.findall(r"&accuracy [^`/]*/", page)):
            self.write("roller.nml", re.sub(r"(?m)^&accuracy.*$", group, scene))
            log += self.dotyk("roller.nml", "--threads", "1")
        self.assertEqual(number, 2)
        lines = [re.sub(r", after [\d.]+ s", "", line) for line in printed(page) + ["  accuracy mesh 3: 4663 unknowns"]]
        for line in lines:
            if not line.startswith("&"):
                self.assertHasLine(line, re.sub(r", after [\d.]+ s", "", log))
        self.assertHasLine(re.search(r"`(peak:touch [^`]*)`", page)[1], log)

    def test_from_calculix(self):
        self.write_files((DOCS / "from_calculix.md").read_text(), ["inp"])
        said = self.shell("dotyk-convert cubes.inp", code=1)
        scene = (self.folder / "cubes.nml").read_text()
        page = (DOCS / "from_calculix.md").read_text()
        self.assertIn("```fortran\n%s```" % scene, page)
        log = self.shell("dotyk cubes.nml --check; dotyk cubes.nml")
        self.compare("from_calculix.md", said + log)

    def test_step_to_report(self):
        page = (DOCS / "step_to_report.md").read_text()
        self.write_files(page)
        log = self.shell("gmsh make_step.geo -parse_and_exit > gmsh.log; dotyk look.nml --check; dotyk bracket.nml")
        # Greatest stresses at sharp edges are those of the mesh.
        self.compare("step_to_report.md", log, skip="mises:bracket  |iteration|not determined|the axis|constraints active")
        forces = re.findall(r"base - bracket: .*contact force \(0, 0, (-[\d.]+)\)", log)
        self.assertEqual(re.findall(r"base - bracket: .*contact force \(0, 0, (-[\d.]+)\)", page), forces)
        for command in ("contacts", "ties", "supports"):
            table = self.shell("dotyk-summary --csv %s bracket.vtkhdf" % command)
            self.assertIn("\nbracket.vtkhdf,down,", table)


if __name__ == "__main__":
    dotyk_case.main()
