"""What the tests through the executable share: `Case`, a unittest.TestCase with a folder of its own, and `main`.

ctest names the executable in the environment variable DOTYK.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
INPUTS = ROOT / "inputs"
sys.path.insert(0, str(ROOT / "tools" / "python"))


class Case(unittest.TestCase):
    """A test with a temporary folder `self.folder`, which is removed at the end."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="dotyk-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, name, text):
        """Write a file into the folder."""
        path = self.folder / name
        path.write_text(text)
        return path

    def copy(self, path):
        """Copy an example, such as 'hertz', or a file into the folder."""
        source = INPUTS / path
        target = self.folder / source.name
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy(source, target)
        return target

    def dotyk(self, *arguments, code=0, timeout=600, **environment):
        """Run the executable in the folder; its exit code must be `code` (None: any). Returns what it printed, as one
        text."""
        done = subprocess.run([os.environ["DOTYK"], *map(str, arguments)], cwd=self.folder, timeout=timeout, text=True,
                              env={**os.environ, **environment}, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if code is not None:
            self.assertEqual(done.returncode, code, "dotyk %s:\n%s" % (" ".join(map(str, arguments)), done.stdout))
        return done.stdout

    def assertBetween(self, low, value, high, message=None):
        """low < value < high."""
        self.assertLess(low, value, message)
        self.assertLess(value, high, message)

    def assertUnknown(self, values, message=None):
        """A value that is not known, or all values of an array: NaN."""
        import numpy as np
        np.testing.assert_array_equal(values, np.full(np.shape(values), np.nan), err_msg=str(message or ""))

    def assertIncreasing(self, values, least=0.0, message=None):
        """Each value is above the one before it, or above it by more than `least`, which may be negative."""
        steps = [float(after - before) for before, after in zip(values, values[1:])]
        self.assertGreater(min(steps), least, "%s: %s" % (message or "not increasing", list(values)))

    def results(self, name):
        """A results file of the folder, opened with h5py."""
        import h5py
        file = h5py.File(self.folder / name, "r")
        self.addCleanup(file.close)
        return file


def main():
    """Run the tests of the calling script; that there is none is a failure."""
    result = unittest.main(exit=False).result
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
