#!/usr/bin/env python3
"""One case and many load cases of one assembly: time of both, and their ratio.

usage: benchmarks/cases.py [--dotyk PROGRAM] [--folder FOLDER] [-n DIVISIONS] [--cases NUMBER] [--history] [--output 'error_parts='''']
                           [--response full]

Two blocks of n*n*n hexahedra with 20 nodes, meshes that do not match; the upper one floats and is pressed on the lower one by pressures whose
place moves from case to case.
"""
import argparse
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/support"))
from blocks import block_geo  # noqa: E402

SCENE = """&scene /
&material name='steel', young=210e3, poisson=0.3 /
&body name='lower', mesh='lower.msh', volume='block', material='steel' /
&body name='upper', mesh='upper.msh', volume='block', material='steel' /
&support body='lower', surface='bottom', fix='xyz' /
&support body='upper', surface='sides x', fix='x' /
&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /
&solver theta=0, tolerance=1e-6, response='%s' /
&output %s /
"""


def run(options, folder, n):
    """Solve n cases; the log, and the seconds of the run."""
    lines = [SCENE % (options.response, options.output)]
    for k in range(n):
        more = ", history=.true." if options.history and k else ""
        lines.append("&case name='case %d'%s /" % (k + 1, more))
        angle = 2 * math.pi * k / options.cases
        lines.append("&load body='upper', surface='top', pressure_formula='10*exp(-8*((x-%r)^2+(y-%r)^2))', case='case %d' /"
                     % (0.5 + 0.2 * math.cos(angle), 0.5 + 0.2 * math.sin(angle), k + 1))
    path = folder / ("cases_%d.nml" % n)
    path.write_text("\n".join(lines) + "\n")
    log = subprocess.run([options.dotyk, path], check=True, capture_output=True, text=True,
                         env={**os.environ, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}).stdout
    times = re.search(r"^  time .*", log, re.M).group()
    value, unit = re.search(r"total ([0-9.]+) (\S+)", times).groups()
    return log, times, float(value) * {"ms": 1e-3, "s": 1, "min": 60, "h": 3600}[unit]


def main():
    """Run both and print the ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", default=str(ROOT / "build/release/dotyk"))
    parser.add_argument("--folder")
    parser.add_argument("-n", type=int, default=14)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--history", action="store_true")
    parser.add_argument("--output", default="")
    parser.add_argument("--response", default="auto")
    options = parser.parse_args()
    folder = pathlib.Path(options.folder or tempfile.mkdtemp(prefix="dotyk-cases-"))
    folder.mkdir(exist_ok=True)
    for name, z, n in (("lower", 0, options.n), ("upper", 1, options.n - 1)):
        path = folder / (name + ".geo")
        path.write_text(block_geo("hex20", n, (0, 0, z), (1, 1, 1)))
        subprocess.run(["gmsh", "-3", "-format", "msh41", "-bin", "-o", str(folder / (name + ".msh")), str(path)], check=True,
                       stdout=subprocess.DEVNULL)
    found = []
    for n in (1, options.cases):
        log, times, seconds = run(options, folder, n)
        found.append(seconds)
        print("%3d case%s%s" % (n, "s" * (n > 1), times))
    print("unknowns %s" % re.search(r"2 bodies +\d+ +\d+ +(\d+)", log).group(1))
    print("ratio    %.2f" % (found[1] / found[0]))


main()
