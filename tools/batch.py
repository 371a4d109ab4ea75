#!/usr/bin/env python3
"""Runs many cases of dotyk; the worker behind batch.sh and batch.slurm."""
import argparse
import concurrent.futures
import csv
import json
import os
import pathlib
import re
import shlex
import signal
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "python"))
import dotyk  # noqa: E402
from dotyk.program import ask_to_end  # noqa: E402

COLUMNS = ("case", "exit", "error_bound", "iterations", "seconds", "memory_mib", "error_penalty", "error_discretization")


def arguments():
    parser = argparse.ArgumentParser(prog="batch.sh", description="Run many cases, each with a log; go on after failures; skip "
                                     "those that converged and whose inputs have not changed since; end with a table.")
    parser.add_argument("cases", nargs="+", metavar="CASE.nml", type=pathlib.Path)
    parser.add_argument("-j", "--jobs", type=int, default=1, metavar="N", help="cases at once; they share the cores (1)")
    parser.add_argument("--threads", type=int, metavar="N", help="threads of each case (cores / jobs)")
    parser.add_argument("--directory", type=pathlib.Path, default=pathlib.Path("batch"), metavar="DIR",
                        help="where results, logs and batch.csv go (./batch)")
    parser.add_argument("--again", action="store_true", help="run what is already done, too")
    parser.add_argument("--launcher", type=shlex.split, default=[], metavar="COMMAND",
                        help="what starts the ranks of a program with MPI, such as 'mpirun -n 4'; a SIGTERM is handed on as it takes it")
    parser.add_argument("--resume", action="store_true",
                        help="start an unfinished case from the results of its last run, and go on in its log (for requeued jobs)")
    parser.add_argument("--only", type=int, metavar="I", help="run the I-th case only (from 1), for array jobs")
    args = parser.parse_args()
    if args.jobs < 1 or (args.threads or 1) < 1:
        parser.error("--jobs and --threads are at least 1")
    if args.only is not None and not 1 <= args.only <= len(args.cases):
        parser.error("--only %d: there are %d cases" % (args.only, len(args.cases)))
    if not os.access(os.environ["DOTYK"], os.X_OK):
        parser.error("no executable %s" % os.environ["DOTYK"])
    return args


def names_of(cases):
    """A name for each case: that of its file, with as many folders in front as tell it from the others."""
    parts = [case.resolve().with_suffix("").parts[1:] for case in cases]
    depth = [1] * len(parts)
    while True:
        names = ["-".join(p[-d:]) for p, d in zip(parts, depth)]
        longer = [i for i, name in enumerate(names) if names.count(name) > 1 and depth[i] < len(parts[i])]
        if not longer:
            return names
        for i in longer:
            depth[i] += 1


def inputs_of(path):
    """The file and those that it names between quotes, such as the mesh, and so on."""
    found, todo = set(), [path.resolve()]
    while todo:
        file = todo.pop()
        if file in found or not file.is_file():
            continue
        found.add(file)
        if file.suffix in (".nml", ".geo"):
            for double, single in re.findall(r'"([^"\n]+)"|\'([^\'\n]+)\'', file.read_text(errors="replace")):
                name = double or single
                if not name.endswith(".vtkhdf"):
                    todo.append((file.parent / name).resolve())
    return found


def summary_of(results):
    """Errors and number of iterations in a results file."""
    try:
        with dotyk.Results(results) as file:
            return {part: file.summary[part] for part in ("error_bound", "iterations", "error_penalty", "error_discretization")
                    if part in file.summary}
    except (OSError, KeyError) as error:
        print("batch: %s: %s" % (results, error), file=sys.stderr)
        return {}


class Batch:
    def __init__(self, args):
        self.args = args
        self.names = names_of(args.cases)
        self.threads = args.threads or max(1, (os.cpu_count() or 1) // args.jobs)
        self.running, self.lock, self.stopped = set(), threading.Lock(), False
        self.launcher = pathlib.Path(self.args.launcher[0]).name if self.args.launcher else ""

    def file(self, i, suffix):
        return self.args.directory / (self.names[i] + suffix)

    def status(self, i):
        try:
            return json.loads(self.file(i, ".status").read_text())
        except (OSError, ValueError):
            return {}

    def is_current(self, i):
        """Whether case i has results that are newer than its inputs."""
        results = self.file(i, ".vtkhdf")
        return results.is_file() and all(path.stat().st_mtime < results.stat().st_mtime for path in inputs_of(self.args.cases[i]))

    def is_done(self, i):
        status = self.status(i)
        return status.get("exit") == 0 and status.get("path") == str(self.args.cases[i].resolve()) and self.is_current(i)

    def run(self, i):
        """Run case i and note how it ended."""
        results, status = self.file(i, ".vtkhdf"), {"path": str(self.args.cases[i].resolve())}
        self.file(i, ".status").unlink(missing_ok=True)
        command = [*self.args.launcher, os.environ["DOTYK"], str(self.args.cases[i]), "--output", str(results),
                   "--threads", str(self.threads)]
        if self.args.resume and self.is_current(i):
            command += ["--restart", str(results)]
        else:
            results.unlink(missing_ok=True)
        start = time.monotonic()
        with open(self.file(i, ".log"), "a" if self.args.resume else "w") as log:
            with self.lock:
                if self.stopped:
                    return
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
                self.running.add(process)
            # wait4 tells the peak memory of this very process.
            _, code, usage = os.wait4(process.pid, 0)
            with self.lock:
                process.returncode = os.waitstatus_to_exitcode(code)
                self.running.discard(process)
        status["exit"] = process.returncode if process.returncode >= 0 else 128 - process.returncode
        status["seconds"] = round(time.monotonic() - start, 3)
        # srun starts its ranks elsewhere.
        if self.launcher != "srun":
            status["memory_mib"] = round(usage.ru_maxrss / 1024, 1)
        if results.is_file():
            status.update(summary_of(results))
        write(self.file(i, ".status"), json.dumps(status) + "\n")

    def run_all(self):
        chosen = range(len(self.names)) if self.args.only is None else [self.args.only - 1]
        todo = [i for i in chosen if self.args.again or not self.is_done(i)]
        for i in sorted(set(chosen) - set(todo)):
            print("%s: already done" % self.names[i], flush=True)
        pool = concurrent.futures.ThreadPoolExecutor(self.args.jobs)
        futures = {pool.submit(self.run, i): i for i in todo}
        try:
            for n, future in enumerate(concurrent.futures.as_completed(futures), 1):
                future.result()
                i, status = futures[future], self.status(futures[future])
                print("[%d/%d] %s: exit %d, %.1f s, log in %s" % (n, len(todo), self.names[i], status["exit"], status["seconds"],
                                                                  self.file(i, ".log")), flush=True)
        except KeyboardInterrupt:
            print("batch: stopped", file=sys.stderr)
            with self.lock:
                self.stopped = True
                for process in self.running:
                    ask_to_end(process, self.launcher)
        pool.shutdown()

    def report(self):
        """The table, on the screen and in batch.csv. The exit code: that of a single case, or 1 where one of many has not converged."""
        rows = []
        for i, name in enumerate(self.names):
            status = self.status(i)
            rows.append([name] + [status.get(column) for column in COLUMNS[1:]])
        target = self.args.directory / "batch.csv"
        temporary = target.with_name("batch.csv.%d" % os.getpid())
        with open(temporary, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(rows)
        os.replace(temporary, target)
        forms = ("%s", "%d", "%.2e", "%d", "%.1f", "%.0f", "%.1e", "%.1e")
        texts = [list(COLUMNS)] + [["-" if x is None else form % x for form, x in zip(forms, row)] for row in rows]
        widths = [max(len(row[k]) for row in texts) for k in range(len(COLUMNS))]
        print()
        for row in texts:
            print("  ".join([row[0].ljust(widths[0])] + [text.rjust(width) for text, width in zip(row[1:], widths[1:])]))
        chosen = rows if self.args.only is None else [rows[self.args.only - 1]]
        print("\n%d of %d converged; as CSV in %s" % (sum(row[1] == 0 for row in chosen), len(chosen), target))
        if len(chosen) == 1:
            return 1 if chosen[0][1] is None else chosen[0][1]
        return 0 if all(row[1] == 0 for row in chosen) else 1


def write(path, text):
    """Write a file whole or not at all."""
    temporary = path.with_name(path.name + ".new")
    temporary.write_text(text)
    os.replace(temporary, path)


def interrupt(*_):
    """Once; what follows waits for the runs."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def main():
    args = arguments()
    signal.signal(signal.SIGTERM, interrupt)
    args.directory.mkdir(parents=True, exist_ok=True)
    batch = Batch(args)
    batch.run_all()
    return batch.report()


sys.exit(main())
