"""tools/batch.slurm under a Slurm of its own (cluster.py): array jobs, failed, requeued, cancelled and late cases, several tasks.

usage: tools/check.sh slurm, or PYTHONPATH=tests/support tools/python.sh tests/slurm/jobs.py [TEST...]

DOTYK names the program (build/release/dotyk), DOTYK_MPI that with MPI (build/mpi/dotyk); without the latter the tests of
several tasks are skipped.
"""
import csv
import os
import pathlib
import shutil
import signal
import sys
import time
import unittest

import dotyk_case

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cluster  # noqa: E402

DOTYK = os.environ.get("DOTYK", str(dotyk_case.ROOT / "build/release/dotyk"))
DOTYK_MPI = os.environ.get("DOTYK_MPI", str(dotyk_case.ROOT / "build/mpi/dotyk"))
ENDLESS = "scheme='neumann', theta_relative=1e-9, tolerance=1e-12, max_iterations=100000000"
ABSENT = cluster.absent()


def setUpModule():
    if ABSENT:
        raise unittest.SkipTest(ABSENT)
    slurm = cluster.Cluster()
    unittest.addModuleCleanup(slurm.__exit__)
    globals()["SLURM"] = slurm.__enter__()


class Scenes(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        shutil.copy(dotyk_case.INPUTS / "column" / "column.geo", self.folder)

    def scene(self, name, solver="theta_relative=1e-2", extra=""):
        """The column, its upper block bent, so that points open."""
        lines = [line for line in (dotyk_case.INPUTS / "column" / "column.nml").read_text().splitlines()
                 if "'top'" not in line and "&solver" not in line]
        lines += ["&support body='upper', surface='top', fix='z', value_formula='0','0','1e-3*(0.3-x)' /", "&solver %s /" % solver, extra]
        return self.write(name, "\n".join(lines) + "\n")

    def submit(self, *words, program=DOTYK, **environment):
        """Number of a job of batch.slurm, cancelled at the end of the test."""
        script = str(dotyk_case.ROOT / "tools" / "batch.slurm")
        k = next((i for i, word in enumerate(words) if word.endswith(".nml")), len(words))
        job = SLURM.submit(*words[:k], script, *words[k:], cwd=self.folder, DOTYK=program, DOTYK_ROOT=str(dotyk_case.ROOT), **environment)
        self.addCleanup(SLURM.wait_job, job)
        self.addCleanup(SLURM.ask, "scancel", job)
        return job

    def ends(self, job, *states, **options):
        """The parts of a job, which end with these states and exit codes."""
        parts = sorted(SLURM.wait_job(job, **options), key=lambda part: int(part.get("ArrayTaskId", 0)))
        found = tuple((part["JobState"], part["ExitCode"]) for part in parts)
        self.assertEqual(found, states, self.output())
        return parts

    def requeue(self, job, between=lambda: None):
        """Requeue a job and start it again without the two minutes that Slurm waits; `between` is checked while it is pending.

        Not before its last step has left: a node refuses to start a job that it is still ending."""
        SLURM.ask("scontrol", "requeue", job, check=True)
        SLURM.wait_job(job, states=("PENDING",))
        between()
        SLURM.wait_for(lambda: not SLURM.steps(), "steps of job %s gone" % job, 60)

        def starts():
            SLURM.ask("scontrol", "update", "JobId=" + job, "StartTime=now")
            return SLURM.job(job)[0]["JobState"] == "RUNNING"
        SLURM.wait_for(starts, "job %s again" % job, 60)

    def output(self):
        """All that the jobs of this test printed, and the logs of the cases."""
        files = [*self.folder.glob("slurm-*.out"), *self.folder.glob("batch/*.log")]
        return "".join("--- %s\n%s" % (path.name, path.read_text(errors="replace")) for path in files)

    def rows(self):
        """The rows of batch.csv by case."""
        with open(self.folder / "batch" / "batch.csv", newline="") as file:
            return {row["case"]: row for row in csv.DictReader(file)}

    def log(self, name, text, number=1, seconds=60):
        """Wait until the log of a case has a text so many times; the log."""
        path, limit = self.folder / "batch" / (name + ".log"), time.monotonic() + seconds
        while not path.is_file() or path.read_text().count(text) < number:
            if time.monotonic() > limit:
                self.fail("no '%s' in %s after %d s:\n%s" % (text, path, seconds, self.output()))
            time.sleep(0.1)
        return path.read_text()

    def status(self, name, left=0):
        """Status in the results file of a case, which is whole; besides it at most `left` temporary files of killed runs."""
        self.assertLessEqual(len(list(self.folder.glob("batch/*.tmp"))), left)
        results = self.results("batch/%s.vtkhdf" % name)
        return results["dotyk/summary"].attrs["status"].decode()


class Jobs(Scenes):
    """One task a case."""

    def test_array_job_with_a_failed_case(self):
        self.scene("good.nml")
        self.scene("bad.nml", solver="theta_relativ=1e-2")
        self.scene("other.nml", solver="theta_relative=1e-3")
        job = self.submit("--array=1-3", "good.nml", "bad.nml", "other.nml")
        self.ends(job, ("COMPLETED", "0:0"), ("FAILED", "2:0"), ("COMPLETED", "0:0"))
        self.assertEqual({name: row["exit"] for name, row in self.rows().items()}, {"good": "0", "bad": "2", "other": "0"})
        self.assertIn("theta_relativ", (self.folder / "batch" / "bad.log").read_text())
        self.assertFalse((self.folder / "batch" / "bad.vtkhdf").exists())
        self.assertEqual([self.status("good"), self.status("other")], ["converged", "converged"])

    def test_cases_one_after_another(self):
        """Without an array; what is done is not done again."""
        self.scene("one.nml")
        self.scene("two.nml", solver="theta_relative=1e-3")
        self.ends(self.submit("one.nml"), ("COMPLETED", "0:0"))
        job = self.submit("one.nml", "two.nml")
        self.ends(job, ("COMPLETED", "0:0"))
        self.assertIn("one: already done", (self.folder / ("slurm-%s.out" % job)).read_text())
        self.assertEqual([row["exit"] for row in self.rows().values()], ["0", "0"])

    def test_requeue_goes_on_from_the_results(self):
        self.scene("case.nml", ENDLESS)
        job = self.submit("case.nml")
        self.log("case", "relaxation")
        time.sleep(0.5)
        self.requeue(job, lambda: self.assertEqual(self.status("case"), "interrupted"))
        text = self.log("case", "relaxation", number=2)
        self.assertEqual(SLURM.job(job)[0]["Restarts"], "1")
        self.assertIn("interrupted after", text)
        self.assertIn("warm start       from batch/case.vtkhdf", text.split("interrupted after")[1])
        time.sleep(0.5)
        SLURM.ask("scancel", job, check=True)
        SLURM.wait_job(job)
        self.log("case", "interrupted after", number=2)
        self.assertEqual(self.status("case"), "interrupted")

    def test_a_killed_job_leaves_no_half_a_file(self):
        """SIGKILL: the results are those of `interval`, and the requeued job goes on from them."""
        self.scene("case.nml", ENDLESS, "&output interval=0.5 /")
        job = self.submit("case.nml")
        self.log("case", "relaxation")
        limit = time.monotonic() + 30
        while not (self.folder / "batch" / "case.vtkhdf").exists() and time.monotonic() < limit:
            time.sleep(0.1)
        ranks = SLURM.processes(DOTYK)
        self.assertEqual(len(ranks), 1)
        os.kill(ranks[0], signal.SIGKILL)
        self.ends(job, ("FAILED", "137:0"))
        self.assertEqual(self.status("case", left=1), "running")
        self.requeue(job)
        self.assertIn("warm start", self.log("case", "relaxation", number=2).split("relaxation")[1])
        self.assertEqual(self.status("case"), "running")

    def test_cancelled_job_writes_its_results(self):
        self.scene("case.nml", ENDLESS)
        job = self.submit("case.nml")
        self.log("case", "relaxation")
        time.sleep(0.5)
        SLURM.ask("scancel", job, check=True)
        self.ends(job, ("CANCELLED", "1:0"))
        self.log("case", "interrupted after")
        self.assertEqual(self.status("case"), "interrupted")

    def test_before_the_time_limit_the_results_are_written(self):
        self.scene("case.nml", ENDLESS)
        job = self.submit("--time=1", "--signal=TERM@50", "case.nml")
        self.ends(job, ("FAILED", "1:0"))
        self.assertIn("not converged: interrupted after", self.log("case", "interrupted"))
        self.assertEqual(self.status("case"), "interrupted")
        self.assertEqual(self.rows()["case"]["exit"], "1")

    def test_two_tasks_need_mpi(self):
        self.scene("case.nml")
        self.ends(self.submit("-n", "2", "case.nml"), ("FAILED", "2:0"))
        self.assertIn("is built without MPI and takes one task, not 2", self.output())
        self.assertFalse((self.folder / "batch").exists())


@unittest.skipUnless(os.access(DOTYK_MPI, os.X_OK), "no program with MPI: %s" % DOTYK_MPI)
class Ranks(Scenes):
    """Two tasks on one node and on two."""

    def ranks(self, *words, **environment):
        return self.submit("-n", "2", *words, program=DOTYK_MPI, **environment)

    def test_two_tasks(self):
        """By srun and by mpirun, against the program without MPI."""
        import numpy as np
        self.scene("case.nml")
        self.dotyk_results()
        expected = self.results("batch/case.vtkhdf")["dotyk/contact/joint/pressure"][:]
        for nodes in ("1", "2"):
            for launcher in ("", "mpirun --allow-run-as-root -n 2"):
                shutil.rmtree(self.folder / "batch")
                job = self.ranks("-N", nodes, "case.nml", **({"DOTYK_LAUNCHER": launcher} if launcher else {}))
                self.ends(job, ("COMPLETED", "0:0"))
                pressure = self.results("batch/case.vtkhdf")["dotyk/contact/joint/pressure"][:]
                np.testing.assert_allclose(pressure, expected, atol=1e-6 * abs(expected).max(), err_msg="%s %s" % (nodes, launcher))

    def dotyk_results(self):
        self.ends(self.submit("case.nml"), ("COMPLETED", "0:0"))

    def test_bad_input_is_named_once(self):
        self.scene("bad.nml", solver="theta_relativ=1e-2")
        self.ends(self.ranks("-N", "2", "bad.nml"), ("FAILED", "2:0"))
        self.assertEqual((self.folder / "batch" / "bad.log").read_text().count("unknown key"), 1, self.output())
        self.assertFalse((self.folder / "batch" / "bad.vtkhdf").exists())

    def test_cancelled_ranks_write_their_results(self):
        self.scene("case.nml", ENDLESS)
        job = self.ranks("-N", "2", "case.nml")
        self.log("case", "relaxation")
        time.sleep(0.5)
        SLURM.ask("scancel", job, check=True)
        self.ends(job, ("CANCELLED", "1:0"))
        self.log("case", "interrupted after")
        self.assertEqual(self.status("case"), "interrupted")

    def test_a_killed_rank_ends_the_job(self):
        self.scene("case.nml", ENDLESS)
        job = self.ranks("-N", "2", "case.nml")
        self.log("case", "relaxation")
        ranks = SLURM.processes(DOTYK_MPI)
        self.assertEqual(len(ranks), 2)
        os.kill(ranks[-1], signal.SIGKILL)
        part = SLURM.wait_job(job, seconds=30)[0]
        self.assertEqual((part["JobState"], part["ExitCode"]), ("FAILED", "137:0"), self.output())
        self.assertEqual(SLURM.processes(DOTYK_MPI), [])

    def test_a_signal_to_the_job_script_reaches_ranks_of_mpirun(self):
        """As `--signal=B:TERM@120` sends it."""
        self.scene("case.nml", ENDLESS)
        job = self.ranks("-N", "2", "case.nml", DOTYK_LAUNCHER="mpirun --allow-run-as-root -n 2")
        self.log("case", "relaxation")
        time.sleep(0.5)
        SLURM.ask("scancel", "--signal=TERM", "--batch", job, check=True)
        self.ends(job, ("FAILED", "1:0"))
        self.assertIn("interrupted after", self.log("case", "interrupted after"))
        self.assertEqual(self.status("case"), "interrupted")


if __name__ == "__main__":
    if ABSENT:
        print("skipped: %s" % ABSENT)
        sys.exit(0)
    dotyk_case.main()
