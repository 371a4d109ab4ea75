"""Pages: links and anchors exist; pages of docs that sources name exist; docs/README.md has every page; the messages of
docs/messages.md are those of the program."""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
#: Folders that are no part of the sources.
OTHER = {"build", ".git", ".dotyk", "venv"}


def pages():
    """All pages in Markdown."""
    return [path for path in sorted(ROOT.rglob("*.md")) if not OTHER & set(path.relative_to(ROOT).parts) and path.name != "ford.md"]


def without_code(text):
    """The text without blocks and spans of code."""
    text = re.sub(r"(?ms)^( *)```.*?^\1```$", "", text)
    return re.sub(r"`[^`\n]*`", lambda span: "x" if "](" in span[0] else span[0], text)


def anchors(text):
    """Anchors of the headings, as GitHub makes them."""
    found = {}
    for heading in re.findall(r"(?m)^#+ (.*)$", re.sub(r"(?ms)^```.*?^```$", "", text)):
        heading = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        name = re.sub(r"[^\w\- ]", "", heading).replace(" ", "-")
        found[name] = found.get(name, -1) + 1
    return {name if i == 0 else "%s-%d" % (name, i) for name, n in found.items() for i in range(n + 1)}


def broken(path, text):
    """Links of a page that lead nowhere."""
    wrong = []
    for link in re.findall(r"\]\(([^)\s]+)\)", without_code(text)):
        if re.match(r"[a-z]+:", link):
            continue
        file, _, anchor = link.partition("#")
        target = (path.parent / file).resolve() if file else path
        if not target.exists():
            wrong.append("%s: %s does not exist" % (path.relative_to(ROOT), link))
        elif anchor and target.suffix == ".md" and anchor not in anchors(text if target == path else target.read_text()):
            wrong.append("%s: %s has no such heading" % (path.relative_to(ROOT), link))
    return wrong


class Links(unittest.TestCase):
    def test_links(self):
        found = pages()
        self.assertGreater(len(found), 20)
        self.assertEqual([line for path in found for line in broken(path, path.read_text())], [])

    def test_pages_that_sources_name(self):
        wrong = []
        for folder in ("src", "tools", "tests", "benchmarks", "studies", "inputs"):
            for path in (ROOT / folder).rglob("*"):
                if path.suffix in (".f90", ".pf", ".py", ".c", ".sh", ".slurm", ".txt", ".json", ".nml", ".geo") and not OTHER & set(path.parts):
                    wrong += ["%s: docs/%s" % (path.relative_to(ROOT), name) for name in re.findall(r"\bdocs/(\w+\.\w+)", path.read_text())
                              if not (ROOT / "docs" / name).exists()]
        self.assertEqual(wrong, [])

    def test_the_index_has_every_page(self):
        index = (ROOT / "docs" / "README.md").read_text()
        missing = [path.name for path in (ROOT / "docs").glob("*.md") if path.name != "README.md" and "](%s" % path.name not in index]
        self.assertEqual(missing, [])

    def test_tables_have_equal_columns(self):
        wrong = []
        for path in pages():
            wanted = None
            for number, line in enumerate(without_code(path.read_text()).splitlines()):
                if not line.lstrip().startswith("|"):
                    wanted = None
                    continue
                columns = len(re.split(r"(?<!\\)\|", re.sub(r"\$[^$]*\$|`[^`]*`", "x", line.strip())))
                wanted = wanted or columns
                if columns != wanted:
                    wrong.append("%s: %s" % (path.relative_to(ROOT), line[:80]))
        self.assertEqual(wrong, [])

    def test_prose_has_lines_of_100(self):
        """But for tables, code, pictures, and what programs make: input.md, and what stands between marks."""
        wrong = []
        for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
            text = re.sub(r"(?ms)^<!-- (.*?) -->$.*?^<!-- \1 -->$", "", without_code(path.read_text()))
            for line in text.splitlines() if path.name != "input.md" else []:
                if len(line) > 100 and not re.match(r" *\||    | *!\[", line):
                    wrong.append("%s: %s" % (path.name, line))
        self.assertEqual(wrong, [])

    def test_broken_links_are_found(self):
        """The test itself."""
        path = ROOT / "docs" / "README.md"
        text = "# A b\n[a](no.md) [b](#a-b) [c](#c) [d](../README.md#no) [e](https://x.y/z) `[f](no.md)`\n"
        self.assertEqual(len(broken(path, text)), 3)


def literals():
    """The texts of the sources, parts of one text joined, with single blanks."""
    texts = []
    for path in (ROOT / "src").rglob("*.f90"):
        joined = re.sub(r"'\s*//\s*&?\s*(?:\n\s*&?\s*)?'", "", path.read_text())
        texts.append(joined.replace("''", "'"))
    return re.sub(r"\s+", " ", "\n".join(texts))


class Messages(unittest.TestCase):
    """docs/messages.md explains messages that the program has."""

    def test_messages_are_in_the_sources(self):
        sources = literals()
        missing, found = [], 0
        for line in (ROOT / "docs" / "messages.md").read_text().splitlines():
            for message in re.findall(r"`([^`]+)`", line.split(" | ")[0]) if line.startswith("| `") else []:
                # Names and numbers are those of an example.
                for part in re.split(r"\.\.\.|'[^']*'|\b\d+ ?%?|\b[ndij]\b", message):
                    part = re.sub(r"\s+", " ", part).strip(" ,;:()")
                    if len(part) >= 6:
                        found += 1
                        missing += [message] if part not in sources else []
        self.assertEqual(missing, [])
        self.assertGreater(found, 50)


if __name__ == "__main__":
    unittest.main()
