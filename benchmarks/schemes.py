#!/usr/bin/python3
"""Every scheme on every scene at every theta: benchmarks/schemes.py [--dotyk FILE] [--threads N] [--limit STEPS] [SCENE...]

Prints a table in Markdown: iterations, solves per body, seconds of the iteration, and the error bound reached (tolerance 1e-6). Scenes with
floating bodies are for the dual scheme only; so is theta = 0. The last two scenes, refined, show what size costs. Seconds depend on the
machine; iterations and bounds do not.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import h5py

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCHEMES = ['dual', 'neumann', 'robin']
THETAS = ['1e-1', '1e-2', '1e-3', '1e-4', '1e-6', '1e-8', '0']
# example, changes of its geometry, schemes, thetas
HELD = SCHEMES, THETAS
FREE = ['dual'], THETAS
SCENES = {'hertz': ('hertz', (), *HELD), 'wavy': ('wavy', (), *HELD), 'composite': ('composite', (), *HELD),
          'multilayer': ('multilayer', (), *HELD), 'column': ('column', (), *HELD),
          'ball_between_plates': ('ball_between_plates', (), *FREE), 'free_stack': ('free_stack', (), *FREE),
          'bricks': ('bricks', (), *FREE), 'bearing': ('bearing', (), *FREE), 'receding': ('receding', (), *FREE),
          'free_stack fine': ('free_stack', (('m = 8;', 'm = 14;'),), ['dual'], ['1e-2', '0']),
          'hertz fine': ('hertz', (('[n = 10]', '[n = 20]'), ('[s = 2.5]', '[s = 3]')), ['dual'], ['1e-2', '0'])}


def run(dotyk, folder, example, scheme, theta, threads, limit):
    """One run; a row of the table."""
    case = os.path.join(folder, example, example + '.nml')
    with open(case) as file:
        text = file.read()
    steps = 100 if scheme == 'dual' else limit
    solver = "&solver scheme='%s', theta_relative=%s, tolerance=1e-6, max_iterations=%d /" % (scheme, theta, steps)
    changed = os.path.join(folder, example, 'run.nml')
    with open(changed, 'w') as file:
        file.write(re.sub(r'(?m)^&solver .*$', '', text) + '\n' + solver + '\n')
    output = os.path.join(folder, 'run.vtkhdf')
    done = subprocess.run([dotyk, changed, '--quiet', '--output', output, '--threads', str(threads)], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode not in (0, 1):
        return '%s |' % done.stdout.strip()
    with h5py.File(output) as file:
        summary, timing = file['dotyk/summary'].attrs, file['dotyk/timing'].attrs
        return '%d | %d | %d | %.3g | %.3g | %.1e | %s |' % (
            summary['unknowns'], summary['iterations'], summary['body_solves'], timing['iterate'], timing['total'],
            summary['error_bound'], 'yes' if summary['converged'] else 'no')


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build/release/dotyk'))
    parser.add_argument('--threads', type=int, default=1)
    parser.add_argument('--limit', type=int, default=20000, help='steps at most, but for dual')
    parser.add_argument('--schemes', default=' '.join(SCHEMES), help='in one pair of quotes')
    parser.add_argument('scenes', nargs='*', metavar='SCENE', help=', '.join(SCENES))
    options = parser.parse_args()
    for name in options.scenes:
        if name not in SCENES:
            sys.exit('%s: the scenes are %s' % (name, ', '.join(SCENES)))
    print('| scene | theta_relative | scheme | unknowns | iterations | solves | iterate [s] | total [s] | bound | converged |')
    print('|---|---|---|---|---|---|---|---|---|---|')
    with tempfile.TemporaryDirectory() as folder:
        for name in options.scenes or SCENES:
            example, changes, schemes, thetas = SCENES[name]
            shutil.rmtree(os.path.join(folder, example), ignore_errors=True)
            shutil.copytree(os.path.join(ROOT, 'inputs', example), os.path.join(folder, example))
            geometry = os.path.join(folder, example, example + '.geo')
            with open(geometry) as file:
                text = file.read()
            for old, new in changes:
                if old not in text:
                    sys.exit('%s has no %r' % (geometry, old))
                text = text.replace(old, new)
            with open(geometry, 'w') as file:
                file.write(text)
            for theta in thetas:
                for scheme in schemes:
                    # The others need some 1/theta steps.
                    if scheme not in options.schemes.split() or scheme != 'dual' and float(theta) < 1e-4:
                        continue
                    print('| %s | %s | %s | %s' % (name, theta, scheme, run(options.dotyk, folder, example, scheme, theta,
                                                                           options.threads, options.limit)), flush=True)


if __name__ == '__main__':
    main()
