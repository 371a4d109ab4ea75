"""The live line of a terminal: it shows long stages, and what stays on the screen is the log of a file."""
import os
import pathlib
import pty
import re
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import blocks  # noqa: E402
from dotyk_case import Case, main  # noqa: E402

CLEAR = "\r\x1b[2K"


class Progress(Case):
    def on_terminal(self, *arguments):
        """All that is written to a terminal."""
        master, slave = pty.openpty()
        child = subprocess.Popen([os.environ["DOTYK"], *map(str, arguments)], cwd=self.folder, stdout=slave, stderr=slave)
        os.close(slave)
        found = b""
        while True:
            try:
                piece = os.read(master, 65536)
            except OSError:
                break
            if not piece:
                break
            found += piece
        os.close(master)
        self.assertEqual(child.wait(), 0)
        return found.decode().replace("\r\n", "\n")

    def test_meshing(self):
        """gmsh waits for a second and a half: its stage is shown once it takes half a second."""
        geo = blocks.block_geo("hex8", 1, (0, 0, 0))
        self.write("lower.geo", geo + 'SystemCall "sleep 1.5";\n')
        self.write("upper.geo", blocks.block_geo("hex8", 1, (0, 0, 1)))
        self.write("column.nml", blocks.column_nml(3))
        written = self.on_terminal("column.nml", "--verbose")
        self.assertIn(CLEAR + "  progress         meshing lower.geo with gmsh: 1 s", written)
        screen = [line.split(CLEAR)[-1] for line in written.split("\n")]
        self.assertFalse([line for line in screen if "progress" in line])
        plain = self.dotyk("column.nml")
        self.assertNotIn("progress", plain)

        def without_times(lines):
            """Without steps of the iteration, too, which are live lines on a terminal."""
            return [re.sub(r"\S*\d\S*", "#", line) for line in lines
                    if line and not re.match(r" *(time|processor time|iteration) ", line)]

        self.assertEqual(without_times(screen), without_times(plain.split("\n")))


main()
