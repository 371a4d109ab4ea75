#!/usr/bin/python3
"""docs/how_do_i.md: every recipe runs as it is printed there, its log has the lines of the page, and the number that
the page finds by hand is one of them.

A recipe is a section of the third level. Its blocks are files (geo, fortran: the namelist, python), commands (sh) and
lines of the log (text); geometries of the section "Geometries" are there for all. Its last sentence is
`By hand: ... **NUMBER** ... (within P %)`.
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys

import dotyk_case

PAGE = dotyk_case.ROOT / "docs" / "how_do_i.md"
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
HAND = re.compile(r"By hand: .*?\*\*([-+.\de]+)\*\*.*?\(within ([\d.]+) %\)", re.S)
MOST_LINES = 15  # of a namelist file
FEWEST = 30  # recipes with a number by hand
# Numbers of the log may differ by what another version of gmsh does to a mesh.
MESH = 2e-3


def blocks(text):
    """[(language, text)] of the blocks between fences."""
    return re.findall(r"(?ms)^```(\w+)\n(.*?)^```$", text)


def file_name(block):
    """The name in the comment of the first line, such as `// rings.geo: ...`."""
    return re.match(r"(?://|!|#) (\w+\.\w+)", block)[1]


def sections(page):
    """The shared geometries, and {title: text} of the recipes."""
    shared, recipes = page.split("\n## Geometries\n")[1].split("\n## ", 1)
    found = re.split(r"(?m)^### ", "\n## " + recipes)[1:]
    return shared, {text.split("\n", 1)[0]: re.split(r"(?m)^## ", text)[0] for text in found}


def pattern_of(line):
    """A line of the log as a pattern: blanks and numbers are free."""
    parts = NUMBER.split(re.sub(r"\s+", " ", line.strip()))
    number = r"(%s|NaN)" % NUMBER.pattern
    return number.join(re.escape(part).replace(r"\ ", r"\s*") for part in parts)


def numbers_of(line):
    """All numbers of a line."""
    return [float(text) for text in NUMBER.findall(line)]


def matches(line, log):
    """Whether the log has the line, its numbers within MESH of the greatest number of their line."""
    wanted = numbers_of(line)
    for found in re.finditer(pattern_of(line), re.sub(r"\s+", " ", log)):
        values = [float(text) for text in found.groups()]
        scale = max(map(abs, wanted), default=0)
        # A number of a triple may be rounding beside the others.
        if all(abs(a - b) <= MESH * max(abs(a), abs(b)) or abs(a - b) < 1e-6 * scale for a, b in zip(values, wanted)):
            return True
    return False


class Recipes(dotyk_case.Case):
    """A test for each recipe, added below."""

    def run_recipe(self, text):
        """The files of the recipe are written, its commands run; without commands the scene runs by itself."""
        for language, block in blocks(SHARED) + blocks(text):
            if language in ("geo", "python"):
                self.write(file_name(block), block)
        scenes = [block for language, block in blocks(text) if language == "fortran"]
        for block in scenes:
            self.assertLessEqual(block.count("\n"), MOST_LINES)
            self.write(file_name(block), block)
        commands = "".join(block for language, block in blocks(text) if language == "sh")
        return self.shell(commands) if commands else self.dotyk(file_name(scenes[0]), "--threads", "1")

    def shell(self, commands):
        """Commands as at a prompt, with dotyk and the commands of its package; all that they print."""
        folder = self.folder / "bin"
        folder.mkdir()
        (folder / "dotyk").symlink_to(shutil.which(os.environ["DOTYK"]))
        for name in ("render", "summary", "convert"):
            path = folder / ("dotyk-" + name)
            path.write_text("#!/bin/sh\nexec '%s' -B -m dotyk.%s \"$@\"\n" % (sys.executable, name))
            path.chmod(0o755)
        (folder / "python3").symlink_to(sys.executable)
        environment = {**os.environ, "PATH": "%s:%s" % (folder, os.environ["PATH"]), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", commands], cwd=self.folder, env=environment, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
        self.assertEqual(done.returncode, 0, "%s\n%s" % (commands, done.stdout))
        return done.stdout

    def check(self, text):
        """Run a recipe; the log has its lines, and one of their numbers is that by hand."""
        log = self.run_recipe(text)
        lines = [line for language, block in blocks(text) if language == "text" for line in block.splitlines()]
        for line in lines:
            self.assertTrue(matches(line, log), "the log has no line '%s':\n%s" % (line, log))
        by_hand = HAND.search(text)
        self.assertTrue(by_hand, "no number by hand")
        value, part = float(by_hand[1]), float(by_hand[2]) / 100
        numbers = [abs(number) for line in lines for number in numbers_of(line)]
        self.assertTrue(any(abs(number - abs(value)) <= part * abs(value) for number in numbers),
                        "none of %s is %g" % (numbers, value))


class ThePage(dotyk_case.Case):
    def test_enough_recipes_have_a_number_by_hand(self):
        self.assertGreaterEqual(len([name for name in vars(Recipes) if name.startswith("test_")]), FEWEST)

    def test_every_recipe_is_in_the_list_above(self):
        """The links at the top of the page name the recipes, in their order."""
        named = re.findall(r"\[([^]]+)\]\(#", PAGE.read_text().split("\n## Geometries\n")[0])
        self.assertEqual([name.lower() for name in named if name != "Geometries"],
                         [title.lower() for title in RECIPES])

    def test_the_comparison_fails(self):
        """The test itself: other numbers and other words are no line of the log."""
        line = "touch: 4 of 9 constraints active, contact force (0, 0, 500)"
        self.assertTrue(matches(line, "x\n  touch: 4 of 9 constraints active, contact force (1e-9, 0, 500.1) on"))
        for other in (line.replace("500", "503"), line.replace("touch", "fit"), line.replace("(0,", "(1,")):
            self.assertFalse(matches(line, other))


SHARED, RECIPES = sections(PAGE.read_text())
for title, recipe in RECIPES.items():
    if HAND.search(recipe):
        name = "test_" + re.sub(r"\W+", "_", title.lower()).strip("_")
        setattr(Recipes, name, lambda self, recipe=recipe: self.check(recipe))


if __name__ == "__main__":
    dotyk_case.main()
