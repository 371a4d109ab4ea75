#!/usr/bin/python3
"""Speed and memory of dotyk as ratios within one run: tools/benchmark.py [--dotyk FILE] [--directory DIR] [NAME...]

one      one body of about 200,000 unknowns (tet10), one thread: what is neither ordering, factorization nor iteration, as a part of
         ordering and factorization; peak memory against factor and one copy of K
eight    eight equal bodies: two threads against one, and against two one-thread processes at once

Absolute times depend on the machine; the ratios are what counts.
"""
import argparse
import os
import subprocess
import sys
import time
import h5py

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

BLOCK = """
SetFactory("OpenCASCADE");
Mesh.ElementOrder = 2;
{boxes}
MeshSize{{ PointsOf{{ Volume{{:}}; }} }} = {size};
e = 1e-6;
{groups}
"""


def chain(folder, n, size, steps):
    """n cubes in a row, every one held at two sides, the first one pressed on; the scene's namelist."""
    boxes = '\n'.join('Box(%d) = {0, 0, %d, 1, 1, 1};' % (k + 1, k) for k in range(n))
    groups = []
    for k in range(n):
        groups.append('Physical Volume("body %d") = {%d};' % (k + 1, k + 1))
        groups.append('Physical Surface("low %d") = {%d};' % (k + 1, 6*k + 5))
        groups.append('Physical Surface("high %d") = {%d};' % (k + 1, 6*k + 6))
        groups.append('Physical Surface("side %d") = {%d, %d};' % (k + 1, 6*k + 1, 6*k + 2))
    name = os.path.join(folder, 'chain_%d_%g' % (n, size))
    with open(name + '.geo', 'w') as file:
        file.write(BLOCK.format(boxes=boxes, size=size, groups='\n'.join(groups)))
    lines = ["&scene title='benchmark', mesh='%s.geo' /" % os.path.basename(name),
             "&material name='steel', young=210e9, poisson=0.3 /"]
    for k in range(n):
        lines.append("&body name='%d', volume='body %d', material='steel' /" % (k + 1, k + 1))
        lines.append("&support body='%d', surface='side %d', fix='xyz' /" % (k + 1, k + 1))
    lines.append("&load body='%d', surface='high %d', pressure=1e8 /" % (n, n))
    for k in range(n - 1):
        lines.append("&contact name='joint %d', surface_a='%d:high %d', surface_b='%d:low %d' /"
                     % (k + 1, k + 1, k + 1, k + 2, k + 2))
    lines.append("&solver scheme='neumann', theta_relative=1e-1, tolerance=1e-12, max_iterations=%d /" % steps)
    with open(name + '.nml', 'w') as file:
        file.write('\n'.join(lines) + '\n')
    return name + '.nml'


def start(dotyk, case, threads, tag):
    """Start a run; its results file gets a name of its own."""
    output = case[:-4] + '_' + tag + '.vtkhdf'
    process = subprocess.Popen([dotyk, case, '--quiet', '--threads', str(threads), '--output', output])
    return process, output


def finish(process, output):
    """Wait for a run: timing and summary of its results, wall time not included, peak memory [bytes]."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        sys.exit('dotyk failed with exit code %d' % process.returncode)
    with h5py.File(output) as file:
        timing = dict(file['dotyk/timing'].attrs)
        summary = dict(file['dotyk/summary'].attrs)
    os.remove(output)
    return timing, summary, usage.ru_maxrss*1024


def run(dotyk, case, threads, tag='run'):
    return finish(*start(dotyk, case, threads, tag))


def one(dotyk, folder, args):
    case = chain(folder, 1, args.size, 1)
    run(dotyk, case, 1)  # meshed and cached
    for _ in range(args.repeat):
        timing, summary, peak = run(dotyk, case, 1)
        solver = timing['order'] + timing['factorize']
        rest = sum(timing[k] for k in ('read', 'assemble', 'search', 'recover', 'write'))
        bound = summary['factor_bytes'] + summary['stiffness_bytes']
        print('one: %d unknowns, order %.2f s, factorize %.2f s (%.1f Gflop/s), rest %.2f s = %.1f %% of both; '
              'peak memory %.0f MiB = %.2f x (factor + K)'
              % (summary['unknowns'], timing['order'], timing['factorize'], summary['flops']/timing['factorize']/1e9, rest,
                 100*rest/solver, peak/2**20, peak/bound))
        print('     ' + ', '.join('%s %.3f' % (k, timing[k]) for k in sorted(timing, key=timing.get, reverse=True)))


def eight(dotyk, folder, args):
    case = chain(folder, 8, 2.2*args.size, args.steps)
    run(dotyk, case, 2)
    for _ in range(args.repeat):
        single = run(dotyk, case, 1)[0]
        double = run(dotyk, case, 2)[0]
        pair = [start(dotyk, case, 1, 'a'), start(dotyk, case, 1, 'b')]
        pair = [finish(*p)[0] for p in pair]
        together = {k: sum(p[k] for p in pair)/2/2 for k in single}  # two scenes in the time of one: per scene half of it
        for stage in ('assemble', 'order', 'factorize', 'iterate', 'total'):
            print('eight: %-9s 1 thread %6.2f s, 2 threads %6.2f s, ratio %.2f; two processes at once %6.2f s a scene, '
                  '2 threads reach %.2f of them' % (stage, single[stage], double[stage], single[stage]/double[stage],
                                                    together[stage], together[stage]/double[stage]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', default=['one', 'eight'], help='which benchmarks')
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build', 'release', 'dotyk'))
    parser.add_argument('--directory', default='benchmark', help='where scenes and meshes are kept')
    parser.add_argument('--size', type=float, default=0.046, help='element size of the large body (edge 1)')
    parser.add_argument('--steps', type=int, default=200, help='iterations of the eight bodies')
    parser.add_argument('--repeat', type=int, default=3)
    args = parser.parse_args()
    os.makedirs(args.directory, exist_ok=True)
    print(time.strftime('%Y-%m-%d %H:%M'), os.cpu_count(), 'processors')
    for name in args.names or ['one', 'eight']:
        {'one': one, 'eight': eight}[name](args.dotyk, args.directory, args)


if __name__ == '__main__':
    main()
