#!/usr/bin/env python3
"""Search for contact pairs in a box of N^3 balls (`--check` of inputs/balls_in_box), and the share of the check for penetration
in the time of the examples.

usage: benchmarks/search.py [--dotyk PROGRAM] [--sizes 3 10] [--skip-examples]

Prints tables: processor time by pair, against that of the smallest box; and time of the check over time of the run, by the run's own
timing (one thread).
"""
import argparse
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
INPUTS = ROOT / "inputs"


def write_balls(folder, n):
    """inputs/balls_in_box with n balls along each edge."""
    geometry = (INPUTS / "balls_in_box" / "balls_in_box.geo").read_text()
    for old, new in (("3*d", "%d*d" % n), ("2.5*d", "%g*d" % (n - 0.5)), ("4*d", "%d*d" % (n + 1))):
        if old not in geometry:
            sys.exit("search: no %r in the geometry" % old)
        geometry = geometry.replace(old, new)
    case = (INPUTS / "balls_in_box" / "balls_in_box.nml").read_text()
    if "repeat=3,3,3" not in case:
        sys.exit("search: no array of 27 balls")
    (folder / "balls_in_box.geo").write_text(geometry)
    (folder / "balls.nml").write_text(case.replace("repeat=3,3,3", "repeat=%d,%d,%d" % (n, n, n)))


def run(command, folder):
    """Output and processor seconds of a run."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode > 1:
        sys.exit("search: exit code %d\n%s" % (done.returncode, done.stdout))
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def boxes(program, sizes):
    """Times of --check, the mesh read before."""
    print("balls  pairs  processor time [s]  by pair [ms]  by pair, over the smallest")
    first = None
    for n in sizes:
        with tempfile.TemporaryDirectory() as temporary:
            folder = pathlib.Path(temporary)
            write_balls(folder, n)
            command = [program, "balls.nml", "--check", "--threads", "1"]
            run(command, folder)
            text, seconds = run(command, folder)
        pairs = int(re.search(r"found +(\d+) pairs", text).group(1))
        each = 1000*seconds/pairs
        first = first or each
        print("%5d  %5d  %18.1f  %12.1f  %26.2f" % (n**3, pairs, seconds, each, each/first), flush=True)


def examples(program):
    """Share of the check in the time of each example."""
    import h5py
    print("\nexample              total [s]  check [s]  check / total")
    for case in sorted(INPUTS.glob("*/*.nml")):
        if re.search(r"(?i)&grid", case.read_text()):
            continue
        with tempfile.TemporaryDirectory() as temporary:
            output = os.path.join(temporary, "out.vtkhdf")
            run([program, str(case), "--threads", "1", "--output", output], case.parent)
            with h5py.File(output) as file:
                timing = dict(file["dotyk/timing"].attrs)
        print("%-20s  %8.2f  %9.3f  %12.1f%%" % (case.stem, timing["total"], timing["check"],
                                                100*timing["check"]/timing["total"]), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", default=str(ROOT / "build" / "release" / "dotyk"))
    parser.add_argument("--sizes", type=int, nargs="+", default=[3, 10], help="balls along an edge of the box")
    parser.add_argument("--skip-examples", action="store_true")
    wish = parser.parse_args()
    program = os.path.abspath(wish.dotyk)
    boxes(program, wish.sizes)
    if not wish.skip_examples:
        examples(program)


if __name__ == "__main__":
    main()
