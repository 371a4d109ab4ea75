#!/usr/bin/python3
"""The cost of runs, for docs/speed.md: benchmarks/costs.py [SCENE...]   (all: ten minutes on an idle machine)

Runs scenes of growing size with the default settings on one and two threads and prints a table: size, work of the
factorizations, wall seconds, processor seconds on one thread, peak memory, and the fractions of the time on one thread
that factorizations and error estimates take. The least of --repeat runs counts. On a busy machine only processor
seconds and memory are meaningful.
"""
import argparse
import os
import subprocess
import sys
import time

sys.dont_write_bytecode = True
import h5py  # noqa: E402

import speed_scenes  # noqa: E402

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
WAVY = {'top': [(1, 1.5)], 'bottom': [(1, -1.5)], 'sides': [(0, 0), (0, 0.5)]}
HEAD = ['scene', 'bodies', 'factors', 'unknowns', 'contact points', 'Gflop', 'wall, 1 thread [s]',
        'wall, 2 threads [s]', 'processor [s]', 'memory [MiB]', 'factorize [%]', 'estimate errors [%]']


def scenes():
    """Scenes by name: files that are written into a folder, and the namelist."""
    found = {}
    for name, points, growth in (('hertz 36k', 9, 2.5), ('hertz 200k', 18, 2.5), ('hertz 400k', 24, 2.5)):
        found[name] = speed_scenes.hertz(name.replace(' ', '_'), 'sphere on a block', points, growth)
    for name, n in (('wavy 50k', 260), ('wavy 200k', 520), ('wavy 800k', 1040)):
        found[name] = speed_scenes.changed_input(name.replace(' ', '_'), 'wavy surface, plane strain', 'wavy', 'wavy',
                                                 [('h = l/80;', 'h = l/%d;' % n)], WAVY)
    known = speed_scenes.scenes()
    for name, old in (('block 200k', 'one'), ('composite 300k', 'composite'), ('chain of 200', 'chain_placed')):
        found[name] = known[old]
    for name in ('tunnel', 'free_stack', 'bearing'):
        found[name] = os.path.join(ROOT, 'inputs', name, name + '.nml')
    return found


def run(program, case, threads, folder):
    """One run: wall, processor seconds, peak memory [MiB], what the results file says."""
    output = os.path.join(folder, 'results.vtkhdf')
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS=str(threads))
    begun = time.monotonic()
    process = subprocess.Popen([program, case, '--quiet', '--threads', str(threads), '--output', output],
                               env=environment)
    _, status, usage = os.wait4(process.pid, 0)
    wall, process.returncode = time.monotonic() - begun, os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit('costs: %s: exit code %d' % (case, process.returncode))
    with h5py.File(output) as file:
        own = dict(file['dotyk/summary'].attrs)
        own.update({'time_' + key: float(value) for key, value in file['dotyk/timing'].attrs.items()})
        own['bodies'] = len(file['dotyk/summary/condition_number'])
    os.remove(output)
    return dict(own, wall=wall, processor=usage.ru_utime + usage.ru_stime, memory=usage.ru_maxrss/1024)


def row(name, single, double):
    """A line of the table."""
    def part(phase):
        return '%.0f' % (100*single['time_' + phase]/single['time_total'])
    return [name, '%d' % single['bodies'], '%d' % single['factorizations'], '%d' % single['unknowns'],
            '%d' % single['constraints'], '%.3g' % (single['flops']/1e9), '%.3g' % single['wall'],
            '%.3g' % double['wall'], '%.3g' % single['processor'], '%.0f' % single['memory'], part('factorize'),
            part('estimate')]


def main():
    every = scenes()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scene', nargs='*', default=list(every))
    parser.add_argument('--repeat', type=int, default=2)
    parser.add_argument('--directory', default=os.path.join(ROOT, 'build', 'benchmarks'))
    options = parser.parse_args()
    build = os.path.join(ROOT, 'build', 'release')
    for arguments in (['--preset', 'release'], ['--build', build, '--target', 'dotyk']):
        subprocess.run(['cmake', *arguments], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    program = os.path.join(build, 'dotyk')
    print('| ' + ' | '.join(HEAD) + ' |\n|' + '---|'*len(HEAD), flush=True)
    for name in options.scene:
        scene = every[name]
        case = scene
        if not isinstance(scene, str):
            scene.write(options.directory)
            case = scene.case('default', '', '')
        runs = {threads: [run(program, case, threads, options.directory) for _ in range(options.repeat)]
                for threads in (1, 2)}
        best = {threads: min(found, key=lambda one: one['wall']) for threads, found in runs.items()}
        best[1]['processor'] = min(one['processor'] for one in runs[1])
        print('| ' + ' | '.join(row(name, best[1], best[2])) + ' |', flush=True)


if __name__ == '__main__':
    main()
