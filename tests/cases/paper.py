#!/usr/bin/python3
"""The table of docs/theory.md, section 8: every numbered equation and theorem of the paper, where it is in the source
code, and which test holds it."""
import re

import dotyk_case

#: Numbers in a comment: after the word that says what they number.
MENTION = re.compile(r"\b(?:equations?|iteration|problem|bound|of) (\(\d+\)(?:(?:, | and )\(\d+\))*)")
THEOREM = re.compile(r"\b(Theorem \d+)")


def rows_of(page):
    """Cells of the rows of the table."""
    section = page.split("\n## 8. The paper, equation by equation\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in section.splitlines() if line.startswith("|")]
    return rows[2:]


def entries(cell):
    """`file`: `name`, `name`; `file`: `name` -> [(file, [names])]."""
    found = []
    for part in cell.split("; "):
        file, names = part.split(": ")
        found.append((file.strip("`"), [name.strip("`") for name in names.split(", ")]))
    return found


def statements(text):
    """Equations and theorems that a cell names, in its order."""
    return re.findall(r"\(\d+\)|Theorem \d+", text)


def mentions(source):
    """Equations and theorems that the comments of a source file name."""
    comments = re.sub(r"\s+", " ", " ".join(re.findall(r"!(?:>|<)? ?(.*)", source)))
    found = set(THEOREM.findall(comments))
    for group in MENTION.findall(comments):
        found |= set(statements(group))
    return found


class Paper(dotyk_case.Case):
    @classmethod
    def setUpClass(cls):
        cls.rows = rows_of((dotyk_case.ROOT / "docs/theory.md").read_text())

    def test_every_equation_and_theorem_is_there_once(self):
        expected = ["(%d)" % n for n in range(1, 47)] + ["Theorem %d" % n for n in range(1, 5)]
        found = [name for row in self.rows for name in statements(row[0])]
        self.assertEqual(sorted(found), sorted(expected))
        for row in self.rows:
            self.assertEqual(len(row), 4, row)
            self.assertGreater(len(row[1]), 3, row)

    def test_code_is_where_the_table_says(self):
        """The files have the procedures or types, and one of them names the number in a comment."""
        for row in self.rows:
            named = set()
            for file, names in entries(row[2]):
                source = (dotyk_case.ROOT / "src" / (file + ".f90")).read_text()
                named |= mentions(source)
                for name in names:
                    self.assertRegex(source, r"(?m)^ *[^!\n]*\b(?:subroutine|function|type\b.*::) %s\b" % name, file)
            for name in statements(row[0]):
                self.assertIn(name, named, row[2])

    def test_tests_are_where_the_table_says(self):
        for row in self.rows:
            for file, names in entries(row[3]):
                for suffix, kind in ((".pf", "subroutine"), (".py", "def")):
                    path = dotyk_case.ROOT / "tests" / (file + suffix)
                    if path.exists():
                        break
                source = path.read_text()
                for name in names:
                    self.assertRegex(source, r"(?m)^ *%s %s\(" % (kind, name), file)

    def test_a_missing_mention_is_found(self):
        """The test itself: numbers count in comments only, and shapes of arrays do not."""
        self.assertEqual(mentions("x = f(3) !> of equations (3), (4) and (5), Theorem 2\n"),
                         {"(3)", "(4)", "(5)", "Theorem 2"})
        self.assertEqual(mentions("call of (3)\n !> Stresses (6) [pressure]\n"), set())
        self.assertEqual(mentions("!> the equations\n  !> (13), (14)\n"), {"(13)", "(14)"})


dotyk_case.main()
