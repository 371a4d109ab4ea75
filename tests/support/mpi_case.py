"""Tests of the program with MPI: `RankCase`, a dotyk_case.Case that runs it on ranks.

DOTYK names the program; without MPI in it the tests are skipped. DOTYK_MPIRUN: what starts ranks, `mpirun` if absent.
"""
import os
import shlex
import shutil
import signal
import subprocess
import time
import unittest

import dotyk_case

MPIRUN = shlex.split(os.environ.get("DOTYK_MPIRUN", "mpirun"))
ENVIRONMENT = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
               "OMPI_MCA_hwloc_base_binding_policy": "none", "OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"}
ENDLESS = "scheme='neumann', theta_relative=1e-9, tolerance=1e-12, max_iterations=100000000"


def absent():
    """Why these tests cannot run, or an empty text."""
    program = os.environ.get("DOTYK", str(dotyk_case.ROOT / "build/mpi/dotyk"))
    os.environ["DOTYK"] = program
    if not os.access(program, os.X_OK):
        return "no program with MPI: %s" % program
    if "libmpi" not in subprocess.run(["ldd", program], capture_output=True, text=True, check=False).stdout:
        return "built without MPI: %s" % program
    if not shutil.which(MPIRUN[0]):
        return "no %s" % MPIRUN[0]
    return ""


ABSENT = absent()


@unittest.skipIf(ABSENT, ABSENT)
class RankCase(dotyk_case.Case):
    """A test with ranks in a folder of its own."""

    def scene(self, solver="theta_relative=1e-2", name="case.nml", without=(), extra=""):
        """The column, its upper block bent, so that points open; without the lines that have certain texts."""
        shutil.copy(dotyk_case.INPUTS / "column" / "column.geo", self.folder)
        lines = [line for line in (dotyk_case.INPUTS / "column" / "column.nml").read_text().splitlines()
                 if not any(text in line for text in ("'top'", "&solver", *without))]
        lines += ["&support body='upper', surface='top', fix='z', value_formula='0','0','1e-3*(0.3-x)' /", "&solver %s /" % solver, extra]
        return self.write(name, "\n".join(lines) + "\n")

    def command(self, ranks, *arguments, before=""):
        """Words that start ranks; `before` is a line of shell that each runs first."""
        program = [os.environ["DOTYK"], *map(str, arguments), "--verbose"]
        if before:
            program = ["sh", "-c", before + '; exec "$@"', "sh", *program]
        return [*MPIRUN, "-n", str(ranks), *program]

    def start(self, ranks, *arguments, until=None, before=""):
        """Start ranks, and wait for a text in what they print."""
        log = open(self.folder / "printed.txt", "wb")
        self.addCleanup(log.close)
        process = subprocess.Popen(self.command(ranks, *arguments, before=before), cwd=self.folder, env=ENVIRONMENT, stdin=subprocess.DEVNULL,
                                   stdout=log, stderr=subprocess.STDOUT)
        self.addCleanup(self.end_all, process)
        limit = time.monotonic() + 60
        while until and until not in self.printed():
            self.assertTrue(process.poll() is None and time.monotonic() < limit, self.printed())
            time.sleep(0.05)
        return process

    def end_all(self, process):
        """Nothing outlives a test."""
        for pid in self.ranks():
            os.kill(pid, signal.SIGKILL)
        process.kill()
        process.wait()

    def printed(self):
        return (self.folder / "printed.txt").read_text(errors="replace")

    def ranks(self):
        """Processes of the program in the folder of this test."""
        found = []
        for entry in os.listdir("/proc"):
            try:
                if entry.isdigit() and os.path.samefile("/proc/%s/exe" % entry, os.environ["DOTYK"]) and \
                        os.path.samefile("/proc/%s/cwd" % entry, self.folder):
                    found.append(int(entry))
            except OSError:
                pass
        return sorted(found)

    def ends(self, process, *codes, seconds=30):
        """Exit code and what was printed; all ranks have ended."""
        try:
            self.code = code = process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.fail("hangs after %d s:\n%s" % (seconds, self.printed()))
        limit = time.monotonic() + 5
        while self.ranks() and time.monotonic() < limit:
            time.sleep(0.05)
        self.assertEqual(self.ranks(), [], "a rank is left")
        if codes:
            self.assertIn(code, codes, self.printed())
        return self.printed()

    def run_ranks(self, ranks, *arguments, code=0, before="", seconds=120):
        """Run to the end; what was printed, which nothing redraws: mpirun gives the program a terminal that is none."""
        printed = self.ends(self.start(ranks, *arguments, before=before), code, seconds=seconds)
        self.assertNotIn("\x1b", printed)
        return printed

    def assertOnce(self, text, printed):
        self.assertEqual(printed.count(text), 1, printed)
