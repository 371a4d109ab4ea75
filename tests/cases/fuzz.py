#!/usr/bin/python3
"""tests/fuzz/fuzz.py: a short run without a fault, and that it sees faults."""
import os
import subprocess
import sys

import dotyk_case

FUZZ = dotyk_case.ROOT / "tests" / "fuzz" / "fuzz.py"
# An executable that does all that it must not.
WRONG = """#!/bin/sh
case "$*" in *--version*) echo wrong; exit 0;; esac
n=$(wc -c < c.nml)
case $((n % 6)) in
0) exit 2;;
1) echo 'At line 1: Fortran runtime error: bad' >&2; exit 2;;
2) kill -11 $$;;
3) echo no >&2; echo x > rest.tmp; exit 3;;
4) printf 'a\\033b' >&2; exit 2;;
5) echo fine; exit 0;;
esac
"""


class Fuzz(dotyk_case.Case):
    def fuzz(self, executable, *arguments):
        """Exit code and output of a run."""
        done = subprocess.run([sys.executable, "-B", FUZZ, "--dotyk", executable, "--keep", self.folder / "kept",
                               *arguments], text=True, timeout=300,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        return done.returncode, done.stdout

    def test_no_faults(self):
        code, text = self.fuzz(os.environ["DOTYK"], "--seed", "6", "--cases", "200")
        self.assertEqual(code, 0, text)
        self.assertRegex(text, r"\| all \| 200 \|")

    def test_a_case_is_made_from_its_number(self):
        code, text = self.fuzz(os.environ["DOTYK"], "--seed", "6", "--case", "7")
        first = {path.name: path.read_bytes() for path in (self.folder / "kept").iterdir()}
        self.assertEqual(code, 0, text)
        self.assertEqual(set(first), {"a.msh", "c.nml"})
        self.assertEqual(self.fuzz(os.environ["DOTYK"], "--seed", "6", "--case", "7")[0], 0)
        self.assertEqual({path.name: path.read_bytes() for path in (self.folder / "kept").iterdir()}, first)

    def test_faults_are_seen(self):
        wrong = self.write("wrong", WRONG)
        wrong.chmod(0o755)
        code, text = self.fuzz(wrong, "--cases", "60", "--reduce", "--kinds", "namelist")
        self.assertEqual(code, 1)
        for fault in ("no message", "Fortran runtime error: bad", "exit code -11", "files left",
                      "control characters in the message"):
            self.assertIn("  " + fault, text)
        self.assertRegex(text, r"\| all \| 60 \| \d \| 0 \| 0 \| 0 \| 0 \| 0 \| [45]\d \|")
        self.assertTrue(list((self.folder / "kept").glob("*/case-*/fault.txt")))


if __name__ == "__main__":
    dotyk_case.main()
