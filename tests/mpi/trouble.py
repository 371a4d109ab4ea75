"""One rank's trouble is everybody's: errors, signals, killed ranks, lack of memory and of disk end all ranks, with one message and one
exit code."""
import os
import re
import signal
import subprocess
import time

import dotyk_case
from mpi_case import ENDLESS, RankCase

ONLY_RANK = 'if [ "$OMPI_COMM_WORLD_RANK" = %d ]; then %s; fi'


class Trouble(RankCase):
    def status(self):
        return self.results("case.vtkhdf")["dotyk/summary"].attrs["status"].decode()

    def assertNothingLeft(self):
        """No results, and no temporary file."""
        self.assertEqual([path.name for path in self.folder.glob("*.vtkhdf*")], [])

    # Errors of the input, which all ranks find

    def test_bad_input_is_named_once(self):
        self.scene("theta_relativ=1e-2")
        for ranks in (2, 3):
            printed = self.run_ranks(ranks, "case.nml", code=2)
            self.assertOnce("unknown key", printed)
            self.assertNothingLeft()

    def test_command_line(self):
        self.assertOnce("--foo", self.run_ranks(2, "case.nml", "--foo", code=2))
        self.assertOnce("missing.nml", self.run_ranks(2, "missing.nml", code=2))
        text = self.run_ranks(2, "--version")
        self.assertOnce("dotyk 0", text)
        self.assertIn("MPI and PETSc", text)

    def test_full_disk(self):
        self.scene()
        disk = self.folder / "disk"
        disk.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(disk)], capture_output=True, check=False).returncode:
            self.skipTest("needs the right to mount a small disk")
        try:
            for ranks in (1, 2):
                printed = self.run_ranks(ranks, "case.nml", "--output", disk / "case.vtkhdf", code=4)
                self.assertOnce("cannot be written: No space left on device", printed)
                self.assertNotIn("SIGSEGV", printed)
                self.assertEqual(list(disk.iterdir()), [])
        finally:
            subprocess.run(["umount", str(disk)], check=True)

    def test_mesh_that_is_not_there(self):
        self.scene()
        (self.folder / "column.geo").unlink()
        self.assertOnce("column.geo", self.run_ranks(2, "case.nml", code=2))
        self.assertNothingLeft()

    def test_the_message_of_a_slow_rank(self):
        """The first rank, which speaks for all, is the last to get to its end: mpirun kills it as soon as another has gone with a code."""
        self.scene().write_text("&scene mesh='nowhere.msh' /\n")
        for _ in range(3):
            self.assertIn("nowhere.msh", self.run_ranks(6, "case.nml", "--quiet", code=2, before=ONLY_RANK % (0, "renice -n 19 $$ > /dev/null")))

    def test_mesh_that_gmsh_refuses(self):
        self.scene()
        self.write("column.geo", "Nonsense(1) = {;\n")
        self.assertOnce("gmsh could not mesh it", self.run_ranks(2, "case.nml", code=2))
        self.assertNothingLeft()

    def test_no_equilibrium(self):
        self.scene(without=("'bottom'",), extra="&load body='lower', surface='bottom', traction=0,0,-1e6 /")
        printed = self.run_ranks(2, "case.nml", code=3)
        self.assertOnce("body 'lower': no equilibrium", printed)
        self.assertNothingLeft()

    def test_results_that_cannot_be_written(self):
        self.scene()
        printed = self.run_ranks(2, "case.nml", "--output", "nowhere/case.vtkhdf", code=4)
        self.assertOnce("nowhere", printed)

    # Signals

    def test_a_signal_to_one_rank_ends_all_with_results(self):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1):
            for which in (0, -1):
                self.scene(ENDLESS)
                process = self.start(3, "case.nml", until="relaxation")
                time.sleep(0.5)
                os.kill(self.ranks()[which], number)
                printed = self.ends(process, 1)
                self.assertOnce("not converged: interrupted after", printed)
                self.assertEqual(self.status(), "interrupted")
                (self.folder / "case.vtkhdf").unlink()

    def test_sigusr1_to_mpirun_ends_all_with_results(self):
        self.scene(ENDLESS)
        process = self.start(2, "case.nml", until="relaxation")
        time.sleep(0.5)
        process.send_signal(signal.SIGUSR1)
        self.assertOnce("not converged: interrupted after", self.ends(process, 1))
        self.assertEqual(self.status(), "interrupted")

    def test_an_interrupt_of_mpirun_leaves_no_half_a_file(self):
        """mpirun kills the ranks a second after its signal: results if they are written by then."""
        for number in (signal.SIGTERM, signal.SIGINT):
            self.scene(ENDLESS)
            process = self.start(2, "case.nml", until="relaxation")
            time.sleep(0.5)
            process.send_signal(number)
            self.ends(process, seconds=20)
            self.assertNotEqual(process.returncode, 0)
            if (self.folder / "case.vtkhdf").exists():
                self.assertEqual(self.status(), "interrupted")

    def test_a_killed_rank_ends_all(self):
        """At the start, and while it iterates."""
        for until in (None, "relaxation"):
            for which in (0, 1, 2):
                self.scene(ENDLESS)
                process = self.start(3, "case.nml", until=until)
                limit = time.monotonic() + 20
                while len(self.ranks()) < 3 and time.monotonic() < limit:
                    time.sleep(0.01)
                time.sleep(0.3)
                os.kill(self.ranks()[which], signal.SIGKILL)
                self.ends(process, seconds=15)
                self.assertNotEqual(process.returncode, 0)
                self.assertFalse((self.folder / "case.vtkhdf").exists())

    # Lack of memory

    def test_a_rank_without_memory_ends_all(self):
        """Limits from what the libraries take to what the run takes: one of them ends it within our own code."""
        self.copy("hertz")
        self.run_ranks(1, "hertz/hertz.nml", "--quiet")
        (self.folder / "hertz" / "hertz.vtkhdf").unlink()
        for which in (0, 1):
            codes = []
            for kilobytes in (400000, 450000, 500000):
                printed = self.ends(self.start(2, "hertz/hertz.nml", "--quiet", before=ONLY_RANK % (which, "ulimit -v %d" % kilobytes)))
                codes.append(self.code)
                if self.code == 5:
                    self.assertEqual(len(re.findall("^(out of|not enough) memory", printed, re.M)), 1, printed)
                if self.code == 0:
                    (self.folder / "hertz" / "hertz.vtkhdf").unlink()
                self.assertFalse((self.folder / "hertz" / "hertz.vtkhdf").exists())
            self.assertIn(5, codes, printed)

    # Warnings and reports are no rank's own

    def test_the_log_is_printed_once(self):
        self.scene()
        printed = self.run_ranks(3, "case.nml")
        for text in ("dotyk 0.2", "factorization  ", "error bound", "results  "):
            self.assertOnce("  " + text if text != "dotyk 0.2" else text, printed)
        self.assertEqual(self.run_ranks(3, "case.nml", "--quiet"), "")


if __name__ == "__main__":
    dotyk_case.main()
