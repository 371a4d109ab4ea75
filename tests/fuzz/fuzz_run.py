"""Runs one case of tests/fuzz/fuzz.py and judges what came of it."""
import collections
import math
import os
import pathlib
import re
import resource
import signal
import subprocess
import tempfile
import time

import h5py
import numpy as np

CASE, RESULTS, OLDER = "c.nml", "c.vtkhdf", b"\x89HDF\r\n\x1a\nan older results file"
# What no user should ever see: of the sanitizers, gfortran's run-time library, the C++ and the HDF5 library, LAPACK.
SUPPRESSIONS = pathlib.Path(__file__).resolve().parents[1] / "support" / "lsan.supp"
# Folder of converted meshes.
CACHE = ".dotyk"
REPORTS = re.compile(r"mesh2msh failed at it|AddressSanitizer|LeakSanitizer|ThreadSanitizer|: runtime error:|Fortran runtime error"
                     r"|Error termination|Error allocating|Program received signal|Backtrace for this error"
                     r"|Program aborted|terminate called|HDF5-DIAG|On entry to|CHOLMOD")
WHERE = re.compile(r"(?:mesh2msh failed at it: |SUMMARY: |runtime error: |Fortran runtime error: |received signal |Error allocating )[^\n]*")
SOURCE = re.compile(r"\b(?:in|at) \S*?(\w+) *(?:at )?\S*/(\w+\.(?:f90|c)):(\d+)")

# NaN means unknown there (docs/errors.md), and history counts on it; nowhere may anything be infinite.
MAY_BE_UNKNOWN = re.compile(r"dotyk/summary@(gamma\w*|lambda_max|q_\w+|error_bound_paper"
                            r"|coercivity|penalty_constant|smoothness|error_(penalty|discretization\w*|contact)"
                            r"|penetration_depth)$"
                            r"|dotyk/history/error_(bound_paper|penalty|discretization)$|VTKHDF/CellData/discretization_error$"
                            r"|dotyk/contact/[^@]*@(centre_of_pressure|(force|contact_area|displacement)_uncertainty)$|VTKHDF/PointData/contact_gap$")

# A run that waits for something has no processor time: so many times its limit are its limit of time.
WAITING = 6

# arguments: command line; files {name: bytes}
Case = collections.namedtuple("Case", "number kind scene mutators arguments files")
# fault: empty where all is well; detail: the text behind it
Outcome = collections.namedtuple("Outcome", "code fault detail message seconds megabytes")


class Runner:
    """Runs an executable under limits."""

    def __init__(self, executable, seconds=20.0, megabytes=1500):
        self.executable, self.seconds, self.megabytes = os.path.abspath(executable), seconds, megabytes
        self.version = subprocess.run([self.executable, "--version"], stdout=subprocess.PIPE, text=True,
                                      check=True).stdout.strip()
        self.sanitized = "Asan" in self.version
        self.environment = {
            **os.environ, "OMP_NUM_THREADS": "2", "LC_ALL": "C",
            "LSAN_OPTIONS": "print_suppressions=0:suppressions=%s" % SUPPRESSIONS,
            "ASAN_OPTIONS": "exitcode=99:allocator_may_return_null=1:max_allocation_size_mb=%d" % megabytes,
            "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1:exitcode=99"}

    def limit(self):
        """Limits of the process; address space is no measure where a sanitizer reserves terabytes of it."""
        resource.setrlimit(resource.RLIMIT_FSIZE, (2**29, 2**29))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(self.seconds), math.ceil(self.seconds) + 5))
        if not self.sanitized:
            resource.setrlimit(resource.RLIMIT_AS, ((self.megabytes + 2000) * 2**20,) * 2)

    def run(self, case):
        """Run a case in a folder of its own; the Outcome."""
        with tempfile.TemporaryDirectory(prefix="dotyk-fuzz-") as name:
            folder = pathlib.Path(name)
            for file, data in case.files.items():
                (folder / file).write_bytes(data)
            older = case.number % 4 == 0
            if older:
                (folder / RESULTS).write_bytes(OLDER)
            with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
                start = time.monotonic()
                process = subprocess.Popen([self.executable, *case.arguments], cwd=folder, env=self.environment,
                                           stdin=subprocess.DEVNULL, stdout=out, stderr=err, preexec_fn=self.limit)
                status, usage = self.wait(process, start)
                seconds = time.monotonic() - start
                err.seek(0)
                message = err.read(200000).decode("utf-8", "replace")
            megabytes = usage.ru_maxrss / 1024
            code = os.waitstatus_to_exitcode(status) if status is not None else None
            fault, detail = self.judge(case, folder, code, message, megabytes, older)
            return Outcome(code, fault, detail, message, seconds, megabytes)

    def wait(self, process, start):
        """Exit status, None where it took too long, and the resources that it used."""
        pause = 0.002
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                process.returncode = status
                return status, usage
            if time.monotonic() - start > WAITING * self.seconds:
                process.send_signal(signal.SIGKILL)
                _, status, usage = os.wait4(process.pid, 0)
                process.returncode = status
                return None, usage
            time.sleep(pause)
            pause = min(2 * pause, 0.02)

    def judge(self, case, folder, code, message, megabytes, older):
        """What is wrong, in a few words that are the same for the same fault, and the text behind it; empty where
        nothing is."""
        if code is None:
            return "hangs", ""
        if code == -signal.SIGXCPU:
            return "takes longer than %g s" % self.seconds, ""
        report = REPORTS.search(message)
        if report:
            where = WHERE.search(message)
            source = SOURCE.search(message)
            place = " %s:%s" % (source[2], source[3]) if source else ""
            return re.sub(r"0x\w+|==\d+==|\d{5,}", "N", (where or report)[0])[:120] + place, message
        if code not in (0, 1, 2, 3, 4, 5):
            return "exit code %s" % code, message
        if megabytes > self.megabytes:
            return "takes more than %d MB" % self.megabytes, message
        if code >= 2:
            return self.judge_refusal(case, folder, message, older, code)
        if message:
            return "text on the standard error with exit code %d" % code, message
        if "--check" in case.arguments:
            return self.judge_files(case, folder, older, code)
        found = [path for path in folder.rglob("*") if path.is_file()
                 and str(path.relative_to(folder)) not in case.files and CACHE not in path.parts]
        if older and len(found) == 2:
            found = [path for path in found if path.name != RESULTS]
        if len(found) != 1:
            return "files left", " ".join(map(str, found))
        return judge_results(found[0], code)

    def judge_refusal(self, case, folder, message, older, code):
        """Messages are there, short and printable; files are as they were."""
        if not message.strip():
            return "no message", ""
        if re.search(r"[\x00-\x09\x0b-\x1f\x7f]", message):
            return "control characters in the message", message
        if len(message) > 60000:
            return "a message of more than 60000 characters", message[:3000]
        return self.judge_files(case, folder, older, code)

    def judge_files(self, case, folder, older, code):
        """Nothing was written."""
        names = {str(path.relative_to(folder)) for path in folder.rglob("*") if CACHE not in path.parts}
        if names != set(case.files) | ({RESULTS} if older else set()):
            return "files left", " ".join(sorted(names))
        if older and (folder / RESULTS).read_bytes() != OLDER:
            return "the older results file was touched", ""
        return "", ""


def judge_results(path, code):
    """A results file is whole, has finite numbers, and says whether the run converged."""
    bad = []

    def check(name, value):
        value = np.asarray(value)
        if value.dtype.kind == "f" and np.any(np.isinf(value) if MAY_BE_UNKNOWN.match(name) else ~np.isfinite(value)):
            bad.append(name)

    def look(name, thing):
        if isinstance(thing, h5py.Dataset):
            check(name, thing[()])
        for key, value in thing.attrs.items():
            check("%s@%s" % (name, key), value)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(look)
            converged = file["dotyk/summary"].attrs["converged"]
    except (OSError, KeyError) as error:
        return "results cannot be read", str(error)
    if bad:
        return "exit code %d, not finite in the results: %s" % (code, " ".join(
            re.sub(r"dotyk/contact/[^/]*", "dotyk/contact", name) for name in bad[:2])), " ".join(bad)
    if bool(converged) != (code == 0):
        return "exit code %d, but converged=%d in the results" % (code, converged), ""
    return "", ""
