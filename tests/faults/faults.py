#!/usr/bin/python3
"""What becomes of a run when the machine fails it: kills, interrupts, too little memory, files that do not grow, full
disks.

usage: tests/faults/faults.py [--dotyk build/release/dotyk] [--scene inputs/hertz/hertz.nml]
                              [--solver "scheme='neumann', theta_relative=1e-3"]
                    [--runs 40] [--seed 1] [--only kill,interrupt,memory,disk,tmpfs] [--verbose]

Each campaign makes so many runs of the scene, in a folder of its own, and counts how they end. A run is right where it
has converged, or said why not in words with one of the exit codes of --help, and where the results file beside it is
the whole one of before or a whole new one. Prints a table in Markdown; exit code 1: something was wrong. Needs Debian's
python3-h5py and python3-numpy.
"""
import argparse
import collections
import hashlib
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
LIMIT = 120  # [s]; more is a hang
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Exit codes that every run may end with, and what must stand in the output.
SAID = {0: "", 1: "interrupted|not converged", 2: "is the disk full", 4: "cannot be written",
        5: "out of memory|not enough memory",
        127: "while loading shared libraries"}


class Scene:
    """A scene in a folder of its own, and what an undisturbed run of it gives."""

    def __init__(self, dotyk, path, solver, folder):
        self.dotyk, self.folder = str(dotyk), folder
        for file in path.parent.iterdir():
            if file.suffix in (".geo", ".msh"):
                shutil.copy(file, folder)
        text = re.sub(r"(?m)^&(solver|output).*\n", "", path.read_text())
        (folder/"case.nml").write_text(text + "&solver %s /\n" % solver)
        start = time.monotonic()
        done = subprocess.run([self.dotyk, "case.nml", "--output", "first.vtkhdf"], cwd=folder, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            sys.exit("faults: the scene does not run: exit code %d\n%s" % (done.returncode, done.stdout))
        self.seconds = time.monotonic() - start
        start = time.monotonic()
        subprocess.run([self.dotyk, "case.nml", "--output", "first.vtkhdf", "--quiet"], cwd=folder, check=True)
        self.seconds = time.monotonic() - start  # without meshing
        self.pressure = self.pressures("first.vtkhdf")
        self.size = (folder/"first.vtkhdf").stat().st_size
        self.reset()

    def reset(self):
        """An old results file."""
        shutil.copy(self.folder/"first.vtkhdf", self.folder/"case.vtkhdf")
        with h5py.File(self.folder/"case.vtkhdf", "a") as file:
            file["dotyk"].attrs["old"] = 1
        self.old = self.hash()

    def hash(self):
        return hashlib.sha256((self.folder/"case.vtkhdf").read_bytes()).hexdigest()

    def pressures(self, name):
        """Of all pairs, behind each other."""
        with h5py.File(self.folder/name, "r") as file:
            contact = file["dotyk/contact"]
            return np.concatenate([contact[pair]["pressure"][:] for pair in contact])

    def results(self):
        """'old', 'new', 'marked' (whole, of a run that was interrupted) or what is wrong with the results file."""
        if self.hash() == self.old:
            return "old"
        try:
            with h5py.File(self.folder/"case.vtkhdf", "r") as file:
                file["dotyk/timing"].attrs["total"]  # what is written last
                if file["dotyk/summary"].attrs["converged"] == 0:
                    return "marked"
            worst = abs(self.pressures("case.vtkhdf") - self.pressure).max()
            return "new" if worst <= 1e-3*self.pressure.max() else "WRONG PRESSURES"
        except (OSError, KeyError) as error:
            return "DAMAGED: %s" % error

    def start(self, *arguments, limits=()):
        def limit():
            for kind, value in limits:
                resource.setrlimit(kind, (value, value))
        return subprocess.Popen([self.dotyk, "case.nml", *arguments], cwd=self.folder, stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True, errors="replace", preexec_fn=limit)

    def leftovers(self):
        return [path.name for path in self.folder.iterdir() if path.suffix == ".tmp"]


class Campaign:
    """Runs of one kind: how they ended."""

    def __init__(self, title, verbose):
        self.title, self.verbose = title, verbose
        self.ends = collections.Counter()
        self.longest = 0  # from a signal to the end [s]
        self.wrong = []

    def note(self, end, wrong=False, text=""):
        self.ends[end] += 1
        if wrong:
            self.wrong.append("%s: %s\n%s" % (self.title, end, text.strip()))
        if self.verbose:
            print("  %-10s %s   %s" % (self.title, end, " / ".join(text.strip().splitlines()[-2:])[:200]), flush=True)

    def finish(self, scene, process, killed=()):
        """Wait for the end of a run and judge it."""
        try:
            text, _ = process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            return self.note("HANGS", True, process.communicate()[0])
        code, results = process.returncode, scene.results()
        if code < 0 and -code in killed:
            end, wrong = "killed", results not in ("old", "new", "marked")
        elif code in SAID:
            # What is marked in the results needs no words: the runs are quiet.
            end, wrong = "exit %d" % code, not (re.search(SAID[code], text) or code == 1 and results == "marked")
            wrong = wrong or (code == 0) != (results == "new") or results not in ("old", "new", "marked")
        else:
            end, wrong = "exit %d" % code, True
        self.note("%s, results %s" % (end, results), wrong, text)


def kill(scene, runs, campaign):
    """Killed at any moment."""
    for k in range(runs):
        process = scene.start("--quiet")
        time.sleep(random.uniform(0, 1.1*scene.seconds))
        process.kill()
        campaign.finish(scene, process, killed=(signal.SIGKILL,))
        if k % 5 == 4:
            before = len(scene.leftovers())
            campaign.finish(scene, scene.start("--quiet"))
            campaign.note("leftovers deleted by the next run", bool(scene.leftovers()), " ".join(scene.leftovers()))
            campaign.ends["leftovers deleted by the next run"] += before - 1
            scene.reset()


def interrupt(scene, runs, campaign):
    """Asked to stop at any moment."""
    for k in range(runs):
        scene.reset()
        process = scene.start("--quiet")
        # Before main there is nobody to listen.
        time.sleep(random.uniform(0.05, 1.1*scene.seconds))
        process.send_signal(SIGNALS[k % len(SIGNALS)])
        start = time.monotonic()
        campaign.finish(scene, process, killed=[int(number) for number in SIGNALS])
        campaign.longest = max(campaign.longest, time.monotonic() - start)


def memory(scene, runs, campaign):
    """Too little address space, from none to enough."""
    most = 4 << 30
    least = 16 << 20
    for k in range(runs):
        scene.reset()
        value = int(least*(most/least)**(k/max(1, runs - 1)))
        campaign.finish(scene, scene.start("--quiet", limits=[(resource.RLIMIT_AS, value)]))


def disk(scene, runs, campaign):
    """No file may grow beyond a size, from 0 to enough for all."""
    for k in range(runs):
        scene.reset()
        value = int(1.2*scene.size*(k/max(1, runs - 1))**2)
        campaign.finish(scene, scene.start("--quiet", limits=[(resource.RLIMIT_FSIZE, value)]))
        campaign.note("leftovers", True, " ".join(scene.leftovers())) if scene.leftovers() else None


def tmpfs(scene, runs, campaign):
    """A real disk without enough room, from none to enough for old and new results, where this user may mount one."""
    place = scene.folder/"small"
    place.mkdir()
    for k in range(runs):
        scene.reset()
        size = max(4096, int(2.5*scene.size*k/max(1, runs - 1)))
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=%d" % size, "tmpfs", place],
                          stderr=subprocess.DEVNULL).returncode != 0:
            return campaign.note("not run: this user may not mount")
        try:
            there = size > 1.2*scene.size
            if there:
                shutil.copy(scene.folder/"case.vtkhdf", place)
            process = scene.start("--quiet", "--output", "small/case.vtkhdf")
            text, _ = process.communicate(timeout=LIMIT)
            left = sorted(path.name for path in place.iterdir())
            old = there and hashlib.sha256((place/"case.vtkhdf").read_bytes()).hexdigest() == scene.old
            if process.returncode == 0:
                shutil.copy(place/"case.vtkhdf", scene.folder)
                campaign.note("exit 0, results " + scene.results(), scene.results() != "new" or left != ["case.vtkhdf"],
                              text)
            else:
                wrong = (process.returncode != 4 or not re.search("No space left on device", text)
                         or left != ["case.vtkhdf"]*there or old != there)
                campaign.note("exit %d, %s" % (process.returncode, "results old" if there else "no results"), wrong,
                              text)
        finally:
            subprocess.run(["umount", place], check=True)


CAMPAIGNS = {"kill": kill, "interrupt": interrupt, "memory": memory, "disk": disk, "tmpfs": tmpfs}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", type=pathlib.Path, default=ROOT/"build"/"release"/"dotyk")
    parser.add_argument("--scene", type=pathlib.Path, default=ROOT/"inputs"/"hertz"/"hertz.nml")
    parser.add_argument("--solver", default="scheme='neumann', theta_relative=1e-3, tolerance=1e-10")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=",".join(CAMPAIGNS))
    parser.add_argument("--verbose", action="store_true")
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    wrong = []
    rows = []
    with tempfile.TemporaryDirectory(prefix="dotyk-") as folder:
        scene = Scene(arguments.dotyk.resolve(), arguments.scene, arguments.solver, pathlib.Path(folder))
        for name in arguments.only.split(","):
            campaign = Campaign(name, arguments.verbose)
            scene.reset()
            CAMPAIGNS[name](scene, arguments.runs, campaign)
            if campaign.longest > 0:
                rows.append((name, "longest time from the signal to the end", "%.2f s" % campaign.longest))
            rows += [(name, end, str(number)) for end, number in sorted(campaign.ends.items())]
            wrong += campaign.wrong
    print("\n%s, %d runs of each campaign, seed %d, %.1f s a run\n"
          % (arguments.scene.name, arguments.runs, arguments.seed, scene.seconds))
    print("| campaign | how runs ended | how many |\n|---|---|---|")
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print("\nwrong: %d" % len(wrong))
    for text in wrong[:10]:
        print("\n" + text)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
