"""What tests of pages of docs share: blocks of a page, commands as at a prompt, lines of the log beside those of the page."""
import os
import re
import shutil
import subprocess
import sys

import dotyk_case

DOCS = dotyk_case.ROOT / "docs"
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.I)
#: Numbers of a page may differ from those of the log by what another version of gmsh makes of a mesh.
MESH = 2e-3


def blocks(text):
    """[(language, text)] of the blocks between fences; the language may be empty."""
    return re.findall(r"(?ms)^```(\w*)\n(.*?)^```$", text)


def file_name(block):
    """The name in the comment of the first line, such as `// rings.geo: ...`."""
    return re.match(r"(?://|!|#|\*\*) (\w+\.\w+)", block)[1]


def pattern_of(line):
    """A line of the log as a pattern: blanks and numbers are free."""
    parts = NUMBER.split(re.sub(r"\s+", " ", line.strip()))
    number = r"(%s|NaN)" % NUMBER.pattern
    return number.join(re.escape(part).replace(r"\ ", r"\s*") for part in parts)


def numbers_of(line):
    """All numbers of a line."""
    return [float(text) for text in NUMBER.findall(line)]


def matches(line, log, tolerance=MESH):
    """Whether the log has the line, its numbers within the tolerance; beside the greatest one, zeros are rounding."""
    wanted = numbers_of(line)
    scale = max(map(abs, wanted), default=0)
    for found in re.finditer(pattern_of(line), re.sub(r"\s+", " ", log), re.I):
        values = [float(text) for text in found.groups()]
        if all(abs(a - b) <= tolerance * max(abs(a), abs(b)) or abs(a - b) < 1e-6 * scale for a, b in zip(values, wanted)):
            return True
    return False


class PageCase(dotyk_case.Case):
    """A test whose folder gets what a page prints."""

    def write_files(self, page, languages=("geo", "fortran", "python", "inp")):
        """The blocks of these languages, as files with the names in their first lines; returns the names."""
        found = [(file_name(block), block) for language, block in blocks(page) if language in languages]
        for name, block in found:
            self.write(name, block)
        return [name for name, _ in found]

    def shell(self, commands, code=0):
        """Commands as at a prompt, with dotyk and the commands of its package; all that they print."""
        folder = self.folder / "bin"
        if not folder.exists():
            folder.mkdir()
            (folder / "dotyk").symlink_to(shutil.which(os.environ["DOTYK"]))
            (folder / "python3").symlink_to(sys.executable)
            for name in ("render", "summary", "convert"):
                path = folder / ("dotyk-" + name)
                path.write_text("#!/bin/sh\nexec '%s' -B -m dotyk.%s \"$@\"\n" % (sys.executable, name))
                path.chmod(0o755)
        environment = {**os.environ, "PATH": "%s:%s" % (folder, os.environ["PATH"]), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", commands], cwd=self.folder, env=environment, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=1800)
        self.assertEqual(done.returncode, code, "%s\n%s" % (commands, done.stdout))
        return done.stdout

    def assertHasLine(self, line, log, tolerance=MESH):
        """The log has a line of the page."""
        self.assertTrue(matches(line, log, tolerance), "the log has no line '%s':\n%s" % (line, log))
