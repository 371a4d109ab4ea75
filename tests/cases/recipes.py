#!/usr/bin/python3
"""docs/how_do_i.md: every recipe runs as it is printed there, its log has the lines of the page, and the number that
the page finds by hand is one of them.

A recipe is a section of the third level. Its blocks are files (geo, fortran: the namelist, python), commands (sh) and
lines of the log (text); geometries of the section "Geometries" are there for all. Its last sentence is
`By hand: ... **NUMBER** ... (within P %)`.
"""
import re

import dotyk_case
from page import DOCS, PageCase, blocks, file_name, matches, numbers_of

HAND = re.compile(r"By hand\b[^:]*: .*?\*\*([-+.\de]+)\*\*.*?\(within ([\d.]+) %\)", re.S)
MOST_LINES = 15  # of a namelist file
FEWEST = 30  # recipes with a number by hand


def sections(page):
    """The shared geometries, and {title: text} of the recipes."""
    shared, recipes = page.split("\n## Geometries\n")[1].split("\n## ", 1)
    found = re.split(r"(?m)^### ", "\n## " + recipes)[1:]
    return shared, {text.split("\n", 1)[0]: re.split(r"(?m)^## ", text)[0] for text in found}


class Recipes(PageCase):
    """A test for each recipe, added below."""

    def run_recipe(self, text):
        """The files of the recipe are written, its commands run; without commands the scene runs by itself."""
        self.write_files(SHARED + text)
        scenes = [block for language, block in blocks(text) if language == "fortran"]
        for block in scenes:
            self.assertLessEqual(block.count("\n"), MOST_LINES)
        commands = "".join(block for language, block in blocks(text) if language == "sh")
        return self.shell(commands) if commands else self.dotyk(file_name(scenes[0]), "--threads", "1")

    def check(self, text):
        """Run a recipe; the log has its lines, and one of their numbers is that by hand."""
        log = self.run_recipe(text)
        lines = [line for language, block in blocks(text) if language == "text" for line in block.splitlines()]
        for line in lines:
            self.assertHasLine(line, log)
        by_hand = HAND.search(text)
        value, part = float(by_hand[1]), float(by_hand[2]) / 100
        numbers = [abs(number) for line in lines for number in numbers_of(line)]
        self.assertTrue(any(abs(number - abs(value)) <= part * abs(value) for number in numbers),
                        "none of %s is %g" % (numbers, value))


class ThePage(dotyk_case.Case):
    def test_enough_recipes_have_a_number_by_hand(self):
        self.assertGreaterEqual(len([name for name in vars(Recipes) if name.startswith("test_")]), FEWEST)

    def test_every_recipe_is_in_the_list_above(self):
        """The links at the top of the page name the recipes, in their order."""
        named = re.findall(r"\[([^]]+)\]\(#", (DOCS / "how_do_i.md").read_text().split("\n## Geometries\n")[0])
        self.assertEqual(named, list(RECIPES))

    def test_the_comparison_fails(self):
        """The test itself: other numbers and other words are no line of the log."""
        line = "touch: 4 of 9 constraints active, contact force (0, 0, 500)"
        self.assertTrue(matches(line, "x\n  touch: 4 of 9 constraints active, contact force (1e-9, 0, 500.1) on"))
        for other in (line.replace("500", "503"), line.replace("touch", "fit"), line.replace("(0,", "(1,")):
            self.assertFalse(matches(line, other))


SHARED, RECIPES = sections((DOCS / "how_do_i.md").read_text())
for title, recipe in RECIPES.items():
    if HAND.search(recipe):
        name = "test_" + re.sub(r"\W+", "_", title.lower()).strip("_")
        setattr(Recipes, name, lambda self, recipe=recipe: self.check(recipe))


if __name__ == "__main__":
    dotyk_case.main()
