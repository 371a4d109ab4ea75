"""Faults while running: interrupts, too little memory, full disks."""
import os
import re
import resource
import select
import signal
import subprocess
import time

import dotyk_case

ENDLESS = "scheme='neumann', theta_relative=1e-9, tolerance=1e-12, max_iterations=100000000"


class Faults(dotyk_case.Case):
    """The column example with few elements on faces that do not match, its upper block bent by a load, so that points
    open."""

    def setUp(self):
        super().setUp()
        geo = (dotyk_case.INPUTS/"column"/"column.geo").read_text()
        self.write("column.geo", geo)

    def scene(self, solver, name="case.nml"):
        """A scene whose upper block is pushed down on one side, so that it lifts off on the other."""
        text = (dotyk_case.INPUTS/"column"/"column.nml").read_text()
        lines = [line for line in text.splitlines() if "'top'" not in line and "&solver" not in line]
        lines += ["&support body='upper', surface='top', fix='z', value_formula='0','0','1e-3*(0.3-x)' /",
                  "&solver %s /" % solver]
        return self.write(name, "\n".join(lines) + "\n")

    def start(self, *arguments, until=None):
        """Start the program, and wait for a text in what it prints."""
        process = subprocess.Popen([os.environ["DOTYK"], *map(str, arguments), "--verbose"], cwd=self.folder,
                                   stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        process.text = ""
        limit = time.monotonic() + 60
        while until and until not in process.text:
            self.assertTrue(select.select([process.stdout], [], [], max(0, limit - time.monotonic()))[0], process.text)
            more = os.read(process.stdout.fileno(), 65536).decode()
            self.assertTrue(more, "ended early:\n" + process.text)
            process.text += more
        return process

    def end(self, process):
        """Exit code and all that was printed."""
        rest, _ = process.communicate(timeout=60)
        return process.returncode, process.text + rest.decode()

    def answer(self, name="case.vtkhdf"):
        """Pressures, summary and number of entries of the history."""
        results = self.results(name)
        return (results["dotyk/contact/joint/pressure"][:], dict(results["dotyk/summary"].attrs),
                len(results["dotyk/history/iteration"]))

    # Interrupts

    def test_an_interrupt_ends_the_iteration_and_marks_the_results(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1):
            self.scene(ENDLESS)
            process = self.start("case.nml", until="relaxation")
            time.sleep(0.05)
            process.send_signal(number)
            code, text = self.end(process)
            self.assertEqual(code, 1, text)
            self.assertIn("not converged: interrupted after", text)
            _, summary, steps = self.answer()
            self.assertEqual(summary["converged"], 0)
            self.assertEqual(summary["status"], b"interrupted")
            self.assertEqual(summary["iterations"], steps)
            self.assertGreater(summary["error_bound"], 1e-12)

    def test_signals_at_the_same_time_are_one(self):
        """timeout(1) sends its signal to the process and to its group."""
        self.scene(ENDLESS)
        process = self.start("case.nml", until="relaxation")
        process.send_signal(signal.SIGTERM)
        process.send_signal(signal.SIGHUP)
        self.assertEqual(self.end(process)[0], 1)
        self.assertEqual(self.answer()[1]["status"], b"interrupted")

    def test_an_interrupt_of_a_load_case_keeps_those_before(self):
        """The first one is solved for itself, the second one in a block with that which has no end."""
        text = self.scene(ENDLESS).read_text()
        held = "value_formula='0','0','1e-3*(0.3-x)'"
        self.assertIn(held, text)
        names = "first", "second", "endless", "last"
        self.write("case.nml", text.replace(held, held + ", case='endless', 'last'") +
                   "".join("&case name='%s' /\n" % name for name in names))
        process = self.start("case.nml", until="max penetration")
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        code, text = self.end(process)
        self.assertEqual(code, 1, text)
        self.assertNotIn("case 'last'", text)
        cases = self.results("case.vtkhdf")["dotyk/cases"]
        self.assertEqual(cases.attrs["names"].decode().split("\n"), list(names[:3]))
        self.assertEqual([cases[name]["summary"].attrs["status"] for name in names[:3]],
                         [b"converged", b"converged", b"interrupted"])

    def test_an_interrupt_of_gmsh_leaves_nothing(self):
        self.write("slow", "#!/bin/sh\n"
                           "while [ $# -gt 1 ]; do [ $1 = -o ] && touch $2; shift; done\ntouch started\n"
                           "exec sleep 60\n").chmod(0o755)
        self.scene("")
        process = subprocess.Popen([os.environ["DOTYK"], "case.nml"], cwd=self.folder, stdout=subprocess.PIPE,
                                   text=True,
                                   stderr=subprocess.STDOUT, env={**os.environ, "DOTYK_GMSH": str(self.folder/"slow")})
        limit = time.monotonic() + 60
        while not (self.folder/"started").exists() and time.monotonic() < limit:
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        text, _ = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 1, text)
        self.assertIn("interrupted while meshing column.geo with gmsh: no results were written", text)
        self.assertEqual(sorted(path.name for path in (self.folder/".dotyk").iterdir()), [".gitignore"])
        self.assertFalse((self.folder/"case.vtkhdf").exists())

    # Too little memory, full disks

    def limited(self, kind, value, *arguments):
        """Run with a limit: exit code and output."""
        done = subprocess.run([os.environ["DOTYK"], "case.nml", "--threads", "1", *arguments], cwd=self.folder,
                              timeout=120, text=True, errors="replace",
                              preexec_fn=lambda: resource.setrlimit(kind, (value, value)), stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
        return done.returncode, done.stdout

    def test_too_little_memory_is_said(self):
        self.scene("theta_relative=1e-2")
        self.dotyk("case.nml")
        before = (self.folder/"case.vtkhdf").read_bytes()
        codes = set()
        for mebibytes in (100, 150, 200, 225, 230, 240, 260, 2000):
            code, text = self.limited(resource.RLIMIT_AS, mebibytes << 20)
            codes.add(code)
            if code == 0:
                continue
            self.assertEqual(code, 5, text)
            self.assertRegex(text, r"out of memory while [\w ]+.* are left of the process \(ulimit -v\)")
            self.assertEqual((self.folder/"case.vtkhdf").read_bytes(), before)
        self.assertEqual(codes, {0, 5})

    def test_small_stacks_are_said(self):
        """Of threads and of the program: it would end with a signal, or with an error of the library of OpenMP."""
        for size, kibibytes in (("64k", "64"), ("100000B", "97.66"), ("  0.25M", "256")):
            text = self.dotyk("--version", code=5, OMP_STACKSIZE=size)
            self.assertEqual(text, "OMP_STACKSIZE=%s makes stacks of %s kiB; dotyk needs 512 kiB at least: unset it, or "
                             "make it 8M\n" % (size, kibibytes))
        self.dotyk("--version", OMP_STACKSIZE="512k")
        code, text = self.limited(resource.RLIMIT_STACK, 64 << 10)
        self.assertEqual((code, text), (5, "ulimit -s makes stacks of 64 kiB; dotyk needs 512 kiB at least: "
                                           "ulimit -s 8192\n"))

    def test_files_that_cannot_grow(self):
        """As on a full disk: the old results stay, and nothing is left beside them."""
        self.scene("theta_relative=1e-2")
        self.dotyk("case.nml")
        before = (self.folder/"case.vtkhdf").read_bytes()
        for part in (0.01, 0.2, 0.6, 0.95):
            code, text = self.limited(resource.RLIMIT_FSIZE, int(part*len(before)), "--quiet")
            self.assertEqual(code, 4, text)
            self.assertIn("'case.vtkhdf' cannot be written: File too large", text)
            self.assertEqual((self.folder/"case.vtkhdf").read_bytes(), before)
            self.assertEqual(list(self.folder.glob("*.tmp")), [])

    def test_a_log_that_cannot_be_written_is_no_reason_to_stop(self):
        self.scene("theta_relative=1e-2")
        with open("/dev/full", "w") as full:
            done = subprocess.run([os.environ["DOTYK"], "case.nml"], cwd=self.folder, stdout=full,
                                  stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "warning: the log cannot be written; the run continues without it\n")
        self.assertEqual(self.answer()[1]["converged"], 1)
        for command in ("%s case.nml >&-", "%s case.nml <&- >&- 2>&-", "%s case.nml | true"):
            (self.folder/"case.vtkhdf").unlink()
            subprocess.run(["bash", "-c", command % os.environ["DOTYK"]], cwd=self.folder, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL)
            self.assertEqual(self.answer()[1]["converged"], 1, command)

    def test_what_a_killed_run_left_is_deleted_by_the_next(self):
        self.scene(ENDLESS)
        process = self.start("case.nml", until="relaxation")
        mark = "%s-%d" % (re.sub("[^A-Za-z0-9]", "_", os.uname().nodename), process.pid)
        left = self.write("case.vtkhdf.%s.tmp" % mark, "half a file")
        other = self.write("case.vtkhdf.elsewhere-%d.tmp" % process.pid, "of another machine")
        self.scene("theta_relative=1e-2", name="next.nml")
        self.dotyk("next.nml", "--output", "case.vtkhdf")
        self.assertTrue(left.exists(), "it belongs to a run that is alive")
        process.kill()
        process.wait()
        self.dotyk("next.nml", "--output", "case.vtkhdf")
        self.assertFalse(left.exists())
        self.assertTrue(other.exists())


if __name__ == "__main__":
    dotyk_case.main()
