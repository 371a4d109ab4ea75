#!/usr/bin/python3
"""The numeric factorization of linalg against cholmod_factorize, from the same symbolic analysis:
benchmarks/factorization.py [CASE...]

CASE is a scene of inputs/, or a cube of tet10 with 40, 100 or 200 thousand unknowns; 100x4 is four of them side by
side. Without CASE: the cases of docs/speed.md, half an hour on an idle machine. The numeric phases take turns; medians
count. For each case and number of threads:
  wall, cpu   seconds of the multifrontal code of linalg, wall and processor time
  cholmod     ratio to cholmod_factorize, bodies side by side, one thread each: median of the ratios of paired runs
  blas        ratio to cholmod_factorize, bodies one after the other, BLAS on all threads
  memory      peak memory beside the stiffness matrices, relative to the factors
On a busy machine only processor times on one thread are meaningful (--threads 1).
"""
import argparse
import os
import re
import statistics
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SIZES = {40: 0.0788, 100: 0.0602, 200: 0.0462}
CASES = ['hertz', 'wavy', 'composite', 'press_fit', 'tunnel', 'free_stack', 'bearing', 'punch', 'bricks',
         '40', '40x2', '40x4', '40x8', '100', '100x2', '100x4', '200', '200x2']
HEAD = ['case', 'bodies', 'unknowns', 'largest', 'Gflop', 'threads', 'wall', 'cpu', 'cholmod: wall', 'cpu',
        'blas: wall', 'cpu', 'memory', 'cholmod: memory']
GEOMETRY = """SetFactory("OpenCASCADE");
Mesh.ElementOrder = 2;
Box(1) = {{0, 0, 0, 1, 1, 1}};
MeshSize{{ PointsOf{{ Volume{{:}}; }} }} = {size};
Physical Volume("body") = {{1}};
Physical Surface("side") = {{1, 2}};
"""
SCENE = """&scene mesh='cube_{name}.geo' /
&material name='steel', young=210e9, poisson=0.3 /
&body name='cube', volume='body', material='steel' /
&support body='cube', surface='side', fix='xyz' /
"""


class Run:
    """One line of benchmark_factorization."""

    def __init__(self, line):
        word = line.split()
        self.bodies, self.unknowns, self.largest = int(word[2]), int(word[3]), int(word[4])
        self.gflop, self.factor_bytes = float(word[5])/1e9, int(word[7])
        self.phase, self.wall, self.cpu, self.memory = word[10], float(word[11]), float(word[12]), int(word[13])
        if not float(word[14]) < 1e-8:
            raise ValueError('a solution is wrong: ' + line)


def write_case(name, folder):
    """Input file of a case, and how many copies of it."""
    cube = re.fullmatch(r'(\d+)(?:x(\d+))?', name)
    if not cube:
        return os.path.join(ROOT, 'inputs', name, name + '.nml'), 1
    size, copies = int(cube[1]), int(cube[2] or 1)
    path = os.path.join(folder, 'cube_%d.nml' % size)
    with open(path, 'w') as file:
        file.write(SCENE.format(name=size))
    with open(os.path.join(folder, 'cube_%d.geo' % size), 'w') as file:
        file.write(GEOMETRY.format(size=SIZES[size]))
    return path, copies


def measure(program, path, copies, threads, rounds, phases):
    """Runs by numeric phase."""
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS=str(threads))
    text = subprocess.run([program, str(threads), str(rounds), str(copies), path, *phases], env=environment, check=True,
                          stdout=subprocess.PIPE, text=True).stdout
    runs = [Run(line) for line in text.splitlines()]
    return {phase: [run for run in runs if run.phase == phase] for phase in phases}


def median(values):
    return statistics.median(list(values))


def ratio(runs, others, figure):
    """Median of the ratios of neighbouring runs, both figures of which are not rounded away."""
    found = [getattr(a, figure)/getattr(b, figure) for a, b in zip(runs, others) if getattr(b, figure) > 0]
    return '%.2f' % median(found) if found else '-'


def row(name, threads, found):
    """A line of the table."""
    own = found['multifrontal']
    some = own[0]
    cells = [name, '%d' % some.bodies, '%d' % some.unknowns, '%d' % some.largest, '%.3g' % some.gflop, '%d' % threads,
             '%.3g' % median(run.wall for run in own), '%.3g' % median(run.cpu for run in own)]
    for phase in ('cholmod', 'cholmod_blas'):
        other = found.get(phase)
        cells += [ratio(own, other, 'wall') if other else '', ratio(own, other, 'cpu') if other else '']
    cells += ['%.2f' % (median(run.memory for run in found[phase])/some.factor_bytes)
              for phase in ('multifrontal', 'cholmod')]
    return '| ' + ' | '.join(cells) + ' |'


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('case', nargs='*', default=CASES)
    parser.add_argument('--threads', type=int, nargs='+', default=[1, 2])
    parser.add_argument('--rounds', type=int, default=5, help='three times as many where a round takes less than 1 s')
    parser.add_argument('--directory', default=os.path.join(ROOT, 'build', 'benchmarks'))
    options = parser.parse_args()
    os.makedirs(options.directory, exist_ok=True)
    build = os.path.join(ROOT, 'build', 'release')
    for arguments in (['--preset', 'release'], ['--build', build, '--target', 'benchmark_factorization']):
        subprocess.run(['cmake', *arguments], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    program = os.path.join(build, 'benchmarks', 'benchmark_factorization')
    print('| ' + ' | '.join(HEAD) + ' |\n|' + '---|'*len(HEAD), flush=True)
    for name in options.case:
        path, copies = write_case(name, options.directory)
        for threads in options.threads:
            phases = ['multifrontal', 'cholmod'] + (['cholmod_blas'] if threads > 1 else [])
            rounds = options.rounds
            first = measure(program, path, copies, threads, 1, phases)
            if first['multifrontal'][0].wall < 1:
                rounds *= 3
            print(row(name, threads, measure(program, path, copies, threads, rounds, phases)), flush=True)


if __name__ == '__main__':
    sys.exit(main())
