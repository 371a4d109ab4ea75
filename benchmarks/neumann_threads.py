#!/usr/bin/python3
"""Two threads against one in the iteration of scheme 'neumann': benchmarks/neumann_threads.py [--bodies 2 8 64] [--sizes 2 4 ...]

A row of equal cubes of n x n x n elements (hex8), each held at its sides and pressed against its neighbours by an overlap. Every run makes
--iterations steps. Runs on one thread and on two alternate; each pair gives a ratio of the times per step, and the median of --repeat pairs is
printed, with the least and the largest. The time of a step is the median of the differences of history/seconds in the results file, which other
programs on the machine disturb little; forming compliances, the eigenvalue L and error estimates are not in it. 'iterate' is the ratio of
/dotyk/timing iterate, which has all that the scheme needs. A dash: not run, because one run takes more than --limit seconds. On a machine
that others use, `chrt -f 5` before the command keeps the other programs out of the way; root may.

  --response full auto    compliances by solves, and the choice of the program
  --own                   bodies with different materials: each has a factor of its own, which the caches do not share
"""
import argparse
import os
import statistics
import subprocess
import sys
import tempfile

import h5py
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
GEO = """
n = %d;
Point(1) = {0, 0, 0};
line() = Extrude {1, 0, 0} { Point{1}; Layers{n}; };
face() = Extrude {0, 1, 0} { Curve{line(1)}; Layers{n}; Recombine; };
body() = Extrude {0, 0, 1} { Surface{face(1)}; Layers{n}; Recombine; };
Physical Volume("cube") = {body(1)};
Physical Surface("bottom") = {face(1)};
Physical Surface("top") = {body(0)};
Physical Surface("sides") = {body(2), body(3), body(4), body(5)};
"""


def scene(bodies, response, iterations, own):
    """The namelist of a row of cubes."""
    lines = ["&scene mesh='cube.geo' /"]
    for k in range(bodies if own else 1):
        lines.append("&material name='m%d', young=%r, poisson=0.3 /" % (k, 1 + 0.01*k))
    for k in range(bodies):
        lines.append("&body name='b%d', volume='cube', material='m%d', at=0,0,%d /" % (k, k if own else 0, k))
        lines.append("&support body='b%d', surface='sides', fix='xyz' /" % k)
        if k > 0:
            lines.append("&contact name='c%d', surface_a='b%d:top', surface_b='b%d:bottom', gap=-1e-3 /" % (k, k - 1, k))
    lines.append("&solver scheme='neumann', response='%s', theta_relative=1e-3, gamma=1e-4, max_iterations=%d /"
                 % (response, iterations))
    lines.append("&output fields='contact', error_parts='' /")
    return "\n".join(lines) + "\n"


def run(program, case, threads, limit):
    """One run: seconds per step, seconds of /dotyk/timing iterate, and the summary; none beyond the limit."""
    output = os.path.join(os.path.dirname(case), 'results.vtkhdf')
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS=str(threads))
    try:
        done = subprocess.run([program, case, '--quiet', '--threads', str(threads), '--output', output], env=environment, timeout=limit,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    except subprocess.TimeoutExpired:
        return None
    if done.returncode not in (0, 1):
        sys.exit('neumann_threads: exit code %d\n%s' % (done.returncode, done.stdout))
    with h5py.File(output) as file:
        own, seconds = file['dotyk'], file['dotyk/history/seconds'][:]
        return (float(np.median(np.diff(seconds))), float(own['timing'].attrs['iterate']), dict(own['summary'].attrs),
                own['history/energy'][-1])


def compare(options, folder, bodies, size, response):
    """The row of a scene: medians over pairs of runs."""
    with open(os.path.join(folder, 'cube.geo'), 'w') as file:
        file.write(GEO % size)
    case = os.path.join(folder, 'case.nml')
    with open(case, 'w') as file:
        file.write(scene(bodies, response, options.iterations, options.own))
    pairs = []
    for k in range(options.repeat):
        # the first of a pair alternates, so that a change of the load of the machine favours neither
        found = {}
        for threads in (1, 2) if k % 2 == 0 else (2, 1):
            found[threads] = run(options.dotyk, case, threads, options.limit)
            if found[threads] is None:
                return None
        if found[1][3] != found[2][3]:
            sys.exit('neumann_threads: the energies on one and two threads differ')
        pairs.append(found)
    steps = [pair[1][0]/pair[2][0] for pair in pairs]
    summary = pairs[0][1][2]
    return dict(unknowns=int(summary['unknowns'])//bodies, rows=int(summary['constraints'])//max(1, bodies - 1),
                entries=int(summary['factor_nonzeros']), micro=1e6*statistics.median(pair[1][0] for pair in pairs),
                step=statistics.median(steps), least=min(steps), most=max(steps),
                iterate=statistics.median(pair[1][1]/pair[2][1] for pair in pairs))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build/release/dotyk'))
    parser.add_argument('--bodies', type=int, nargs='+', default=[2, 8, 64])
    parser.add_argument('--sizes', type=int, nargs='+', default=[2, 4, 6, 8, 12, 16])
    parser.add_argument('--response', nargs='+', default=['full', 'auto'])
    parser.add_argument('--iterations', type=int, default=200)
    parser.add_argument('--repeat', type=int, default=7)
    parser.add_argument('--limit', type=float, default=60, help='seconds of a run')
    parser.add_argument('--own', action='store_true')
    options = parser.parse_args()
    print('| response | bodies | elements | unknowns of a body | rows of a joint | step on one thread [us] | gain of the step | least to '
          'largest | gain of iterate |')
    print('|---|---:|---:|---:|---:|---:|---:|---|---:|')
    for response in options.response:
        for bodies in options.bodies:
            for size in options.sizes:
                with tempfile.TemporaryDirectory() as folder:
                    row = compare(options, folder, bodies, size, response)
                if row is None:
                    print('| %s | %d | %d^3 | - | | | | | |' % (response, bodies, size), flush=True)
                    break
                print('| %s | %d | %d^3 | %d | %d | %.0f | %.2f | %.2f to %.2f | %.2f |' % (
                    response, bodies, size, row['unknowns'], row['rows'], row['micro'], row['step'], row['least'], row['most'],
                    row['iterate']), flush=True)


main()
