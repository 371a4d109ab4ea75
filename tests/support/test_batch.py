"""Tests of tools/batch.sh with a stand-in for the executable."""
import csv
import os
import signal
import stat
import subprocess
import sys
import time
import unittest

import dotyk_case

# Ends as the case says, and writes a summary unless it fails.
STAND_IN = """#!%s
import os, sys
import h5py
words = sys.argv
text = open(words[1]).read()
print(*words[2:])
if "crash" in text:
    os.abort()
if "bad" in text:
    sys.exit(2)
memory = bytearray(100 * 2**20) if "large" in text else b""
with h5py.File(words[words.index("--output") + 1], "w") as file:
    summary = file.create_group("dotyk/summary")
    summary.attrs["error_bound"] = 2.5e-7
    summary.attrs["iterations"] = 42
sys.exit(1 if "slow" in text else 0)
""" % sys.executable


class Batch(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.write("dotyk", STAND_IN).chmod(stat.S_IRWXU)

    def batch(self, *words, code):
        """What batch.sh prints, and the rows of batch.csv by case."""
        environment = {**os.environ, "DOTYK": str(self.folder / "dotyk")}
        done = subprocess.run([dotyk_case.ROOT / "tools" / "batch.sh", *words], cwd=self.folder, env=environment,
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        with open(self.folder / "batch" / "batch.csv", newline="") as file:
            return done.stdout, {row["case"]: row for row in csv.DictReader(file)}

    def test_goes_on_after_failures(self):
        for name in ("crash", "bad", "slow", "large"):
            self.write(name + ".nml", name)
        text, rows = self.batch("-j", "2", "crash.nml", "bad.nml", "slow.nml", "large.nml", code=1)
        self.assertEqual({name: int(row["exit"]) for name, row in rows.items()},
                         {"crash": 134, "bad": 2, "slow": 1, "large": 0})
        self.assertEqual([rows["large"]["iterations"], rows["slow"]["iterations"], rows["bad"]["iterations"]],
                         ["42", "42", ""])
        self.assertEqual(float(rows["large"]["error_bound"]), 2.5e-7)
        self.assertGreater(float(rows["large"]["memory_mib"]), float(rows["slow"]["memory_mib"]) + 90)
        self.assertIn("1 of 4 converged", text)
        self.assertIn("--threads %d" % max(1, os.cpu_count() // 2), (self.folder / "batch" / "bad.log").read_text())

    def test_skips_what_is_done(self):
        self.write("a.nml", "&scene mesh='a.geo' /")
        self.write("a.geo", 'Include "part.geo";')
        part = self.write("part.geo", "")
        self.write("b.nml", "slow")
        self.batch("a.nml", "b.nml", code=1)
        text, _ = self.batch("a.nml", "b.nml", code=1)
        self.assertIn("a: already done", text)
        self.assertIn("[1/1] b: exit 1", text)
        os.utime(part, (2**31, 2**31))
        self.assertIn("[1/1] a: exit 0", self.batch("a.nml", code=0)[0])
        os.utime(part, (0, 0))
        self.assertIn("a: already done", self.batch("a.nml", code=0)[0])
        self.assertIn("[1/1] a: exit 0", self.batch("--again", "a.nml", code=0)[0])

    def test_cases_of_one_name(self):
        for folder in ("one", "two"):
            (self.folder / folder).mkdir()
            self.write(folder + "/case.nml", "")
        _, rows = self.batch("one/case.nml", "two/case.nml", code=0)
        self.assertEqual(sorted(rows), ["one-case", "two-case"])
        self.batch("one/case.nml", code=0)
        self.assertIn("[1/1] case", self.batch("two/case.nml", code=0)[0])

    def test_a_single_case_gives_its_exit_code(self):
        self.write("bad.nml", "bad")
        self.write("good.nml", "")
        self.batch("bad.nml", code=2)
        self.batch("--only", "1", "bad.nml", "good.nml", code=2)
        self.batch("bad.nml", "good.nml", code=1)

    def test_launcher(self):
        self.write("a.nml", "")
        self.write("start", '#!/bin/sh\necho "ranks $1"\nshift\nexec "$@"\n').chmod(stat.S_IRWXU)
        self.batch("--launcher", "%s/start 4" % self.folder, "a.nml", code=0)
        self.assertIn("ranks 4", (self.folder / "batch" / "a.log").read_text())

    def test_resumes_from_the_results_of_the_last_run(self):
        self.write("a.nml", "slow")
        self.batch("--resume", "a.nml", code=1)
        self.batch("--resume", "a.nml", code=1)
        first, second = (self.folder / "batch" / "a.log").read_text().splitlines()
        self.assertNotIn("--restart", first)
        self.assertIn("--restart batch/a.vtkhdf", second)
        os.utime(self.write("a.nml", "slow"), (2**31, 2**31))
        self.batch("--resume", "a.nml", code=1)
        self.assertEqual((self.folder / "batch" / "a.log").read_text().count("--restart"), 1)

    def test_a_signal_ends_runs_with_their_results(self):
        """SIGTERM to the program itself, SIGUSR1 to mpirun, nothing to srun, whose ranks Slurm signals."""
        for launcher, expected in ((None, "TERM"), ("mpirun", "USR1"), ("srun", "none")):
            script = ('#!/bin/bash\ntrap "echo got TERM; exit 1" TERM\ntrap "echo got USR1; exit 1" USR1\necho started\n'
                      'for i in {1..%d}; do sleep 0.1; done\necho got none; exit 1\n' % (10 if launcher == "srun" else 300))
            self.write(launcher or "dotyk", script).chmod(stat.S_IRWXU)
            self.write("a.nml", "")
            words = ["--launcher", str(self.folder / launcher)] if launcher else []
            process = subprocess.Popen([dotyk_case.ROOT / "tools" / "batch.sh", *words, "a.nml"], cwd=self.folder, text=True,
                                       env={**os.environ, "DOTYK": str(self.folder / "dotyk")}, stdout=subprocess.PIPE,
                                       stderr=subprocess.STDOUT)
            log = self.folder / "batch" / "a.log"
            limit = time.monotonic() + 30
            while not (log.is_file() and "started" in log.read_text()) and time.monotonic() < limit:
                time.sleep(0.02)
            process.send_signal(signal.SIGTERM)
            text, _ = process.communicate(timeout=60)
            self.assertEqual(process.returncode, 1, text)
            self.assertIn("got " + expected, log.read_text())
            self.assertIn("0 of 1 converged", text)
            log.unlink()

    def test_array_job(self):
        for name in ("a", "b"):
            self.write(name + ".nml", "")
        _, rows = self.batch("--only", "2", "--threads", "3", "a.nml", "b.nml", code=0)
        self.assertEqual((rows["a"]["exit"], rows["b"]["exit"]), ("", "0"))
        self.assertIn("--threads 3", (self.folder / "batch" / "b.log").read_text())


if __name__ == "__main__":
    dotyk_case.main()
