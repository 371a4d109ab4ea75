#!/usr/bin/python3
"""Speed and memory of dotyk as ratios within one run: benchmarks/speed.py [NAME...]      (all of them: half an hour)

NAME is a part (ratios, threads, chains, profile), a scene (see below), or both. Every ratio is one of times of this run, and the
programs take turns:
  ratios    total time over that of ordering and factorization of the same matrices by plain CHOLMOD with METIS (which is
            cholmod_reference.c; stiffness_matrices.py makes the matrices from the mesh of a results file), for some theta, with and
            without the estimated errors; peak memory over CHOLMOD's factors; part of DGEMM's rate
  threads   one thread, two, and two processes of one thread at once
  chains    total time against parts of it for one body
  profile   where the time goes, by perf: phases and functions
Files in --directory: meshes, matrices (kept), and runs.csv (every single run), ratios.csv, benchmark.md (tables; also printed).
The least of --repeat runs counts; 'processor' is that of processor time, which other programs on the machine disturb less.
"""
import argparse
import csv
import os
import resource
import signal
import subprocess
import sys
import time

sys.dont_write_bytecode = True
import h5py  # noqa: E402
import numpy as np  # noqa: E402

import stiffness_matrices  # noqa: E402
import speed_profile  # noqa: E402
import speed_report  # noqa: E402
import speed_scenes  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(HERE)
THETAS = ('1e-2', '1e-4', '1e-8', 'default')


class Finished:
    """What a process was: exit code (None: stopped), wall and processor seconds, peak memory [bytes], output."""

    def __init__(self, code, wall, processor, peak, text):
        self.code, self.wall, self.processor, self.peak, self.text = code, wall, processor, peak, text


def start(command, limit, threads=1):
    """Start a process that may take so many processor seconds; pair with finish."""
    environment = dict(os.environ, OPENBLAS_NUM_THREADS=str(threads), OMP_NUM_THREADS=str(threads))
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)))
    return process, time.monotonic()


def finish(*started):
    """Wait for processes that say little."""
    found, waiting = {}, {process.pid: (process, begun) for process, begun in started}
    while waiting:
        pid, status, usage = os.wait3(0)
        process, begun = waiting.pop(pid)
        wall, process.returncode = time.monotonic() - begun, 0  # waited for
        code = os.waitstatus_to_exitcode(status)
        with process.stdout:
            text = process.stdout.read()
        found[process] = Finished(None if code in (-signal.SIGXCPU, -signal.SIGKILL) else code, wall,
                                  usage.ru_utime + usage.ru_stime, usage.ru_maxrss*1024, text)
    return [found[process] for process, _ in started]


def busy():
    """Processor seconds of all programs on this machine so far."""
    with open('/proc/stat') as file:
        ticks = [int(word) for word in file.readline().split()[1:9]]
    return (sum(ticks) - ticks[3] - ticks[4])/os.sysconf('SC_CLK_TCK')


class Benchmark:
    """One call of this script."""

    def __init__(self, options):
        self.options, self.rows, self.machine, self.profiles = options, [], {}, []
        self.estimates = [word == 'with' for word in ('with', 'without') if options.errors in (word, 'both')]
        os.makedirs(options.directory, exist_ok=True)
        self.reference = os.path.join(options.directory, 'cholmod_reference')
        source = os.path.join(HERE, 'cholmod_reference.c')
        subprocess.run(['gcc', '-O2', '-fopenmp', '-I/usr/include/suitesparse', source, '-o', self.reference, '-lcholmod',
                        '-lopenblas'], check=True)

    def note(self, scene, program, theta='', errors='', threads=1, **more):
        """Keep a run, and print that something happens."""
        row = dict(scene=scene.name, program=program, theta=theta, errors=errors, threads=threads, **more)
        self.rows.append(row)
        print('%s %-10s %-9s theta %-7s %-9s %d thread%s %8.2f s, processor %.2f s' % (
            time.strftime('%H:%M:%S'), scene.name, program, theta or '-', errors or '-', threads, ' ' if threads == 1 else 's',
            row['wall'], row['processor']), flush=True)
        return row

    def dotyk(self, scene, theta, estimate=True, threads=1, program='dotyk', copies=1):
        """One run of dotyk, or copies of it at once; the rows."""
        solver = 'theta_relative=%s, tolerance=1e-8' % theta if theta != 'default' else ''
        name = 'theta_%s_%s' % (theta, 'estimate' if estimate else 'plain')
        case = scene.case(name, solver, '' if estimate else "fields='displacement stress contact', error_parts=''")
        outputs = [os.path.join(scene.folder, 'run_%d.vtkhdf' % k) for k in range(copies)]
        before = busy()
        command = [self.options.dotyk, case, '--quiet', '--threads', str(threads), '--output']
        started = [start([*command, output], self.options.limit*threads, threads) for output in outputs]
        rows = []
        for ended, output in zip(finish(*started), outputs):
            row = dict(wall=ended.wall, processor=ended.processor, peak=ended.peak, exit=ended.code)
            if ended.code in (0, 1):
                with h5py.File(output) as file:
                    own = file['dotyk']
                    row.update({'phase_' + key: float(value) for key, value in own['timing'].attrs.items()})
                    row.update({key: value for key, value in own['summary'].attrs.items() if np.ndim(value) == 0})
                    self.machine['blas'] = own.attrs['blas'].decode()
            elif ended.code is not None:
                sys.exit('benchmark: %s: exit code %d\n%s' % (case, ended.code, ended.text))
            rows.append(self.note(scene, program, theta, 'with' if estimate else 'without', threads, **row))
        others = busy() - before - sum(row['processor'] for row in rows)
        for row in rows:
            row['others'] = max(0.0, others)/max(row['wall'] for row in rows)
        return rows

    def cholmod(self, scene, threads=1):
        """One run of the reference; its row."""
        before = busy()
        ended, = finish(start([self.reference, str(scene.touching), *scene.matrices], 10*self.options.limit, threads))
        if ended.code != 0:
            sys.exit('benchmark: %s' % ended.text)
        lines = [line.split() for line in ended.text.splitlines()]
        table = np.array([[float(word) for word in line[1:]] for line in lines[1:]])
        if table[:, 9].max() > 1e-6:
            sys.exit('benchmark: the reference does not solve %s' % scene.name)
        unknowns, entries, factor, size, flops, order, factorize, solve, processor = table[:, :9].sum(axis=0)
        return self.note(scene, 'cholmod', threads=threads, wall=order + factorize, processor=processor, peak=ended.peak,
                         unknowns=int(unknowns), stiffness_entries=int(entries), factor_nonzeros=int(factor),
                         factor_bytes=int(size), flops=flops, phase_order=order, phase_factorize=factorize, solve=solve,
                         dgemm=float(lines[0][1]), condensed=float(lines[0][2]), bodies=len(table),
                         others=max(0.0, busy() - before - ended.processor)/ended.wall)

    def prepare(self, scene, bodies=None):
        """Mesh and matrices of a scene, where they are not there yet: of so many bodies, if not of all."""
        scene.write(self.options.directory)
        made = os.path.join(scene.folder, 'matrices.txt')
        text = scene.text + ''.join(scene.files.values())
        names = [os.path.join(scene.folder, 'matrix_%d.bin' % k) for k in range(len(scene.supports()[:bodies]))]
        scene.matrices = names
        if os.path.exists(made) and open(made).read() == text and all(os.path.exists(name) for name in names):
            return
        # a scene without pairs has the same meshes, and is soon solved
        whole, scene.text = scene.text, ''.join(line for line in scene.text.splitlines(True) if not line.startswith('&contact'))
        case = scene.case('mesh', '', "fields='displacement', error_parts=''")
        scene.text = whole
        output = os.path.join(scene.folder, 'mesh.vtkhdf')
        # without pairs bodies may penetrate each other: exit code 1
        ended = subprocess.run([self.options.dotyk, case, '--quiet', '--output', output], capture_output=True, text=True)
        if ended.returncode > 1:
            sys.exit('benchmark: %s' % ended.stderr)
        materials = scene.materials()
        for name, (material, supports), body in zip(names, scene.supports(), stiffness_matrices.bodies(output)):
            points, kind, element = body
            fixed = scene.fixed(points, stiffness_matrices.KINDS[kind][1], supports)
            stiffness_matrices.write(name, stiffness_matrices.stiffness(points, kind, element, *materials[material], fixed))
        os.remove(output)
        with open(made, 'w') as file:
            file.write(text)

    def ratios(self, scene):
        """Times of the scene for every theta beside those of CHOLMOD alone."""
        self.prepare(scene)
        late = set()
        for _ in range(self.options.repeat):
            plain = self.cholmod(scene)
            for theta in self.options.theta:
                for estimate in self.estimates:
                    if (theta, estimate) in late:
                        continue
                    row = self.dotyk(scene, theta, estimate)[0]
                    if row['exit'] is None:
                        late.add((theta, estimate))
                    elif row['unknowns'] != plain['unknowns']:
                        sys.exit('benchmark: %s: %d unknowns, the reference has %d' % (
                            scene.name, row['unknowns'], plain['unknowns']))

    def threads(self, scene):
        """One thread, two, and two processes at once."""
        scene.write(self.options.directory)
        for k in range(self.options.repeat):
            single = self.dotyk(scene, '1e-4', program='single')[0]
            if single['exit'] is None:
                return
            self.dotyk(scene, '1e-4', threads=2, program='double')
            self.dotyk(scene, '1e-4', program='pair', copies=2)

    def chains(self, scene):
        """A chain of equal bodies beside the parts of one."""
        self.prepare(scene, bodies=1)
        for _ in range(self.options.repeat):
            self.cholmod(scene)
            for estimate in self.estimates:
                if self.dotyk(scene, '1e-4', estimate)[0]['exit'] is None:
                    return

    def profile(self, scene):
        """Where the time of a scene goes."""
        scene.write(self.options.directory)
        case = scene.case('profile', 'theta_relative=1e-4, tolerance=1e-8', '')
        output = os.path.join(scene.folder, 'run_0.vtkhdf')
        command = [self.options.dotyk, case, '--quiet', '--threads', '1', '--output', output]
        self.profiles.append(speed_profile.text(scene.name, speed_profile.profile(command, scene.folder)))

    def write(self):
        """Tables of what has been run so far."""
        keys = list(dict.fromkeys(key for row in self.rows for key in row))
        with open(os.path.join(self.options.directory, 'runs.csv'), 'w', newline='') as file:
            writer = csv.DictWriter(file, keys)
            writer.writeheader()
            writer.writerows([{key: value.decode() if isinstance(value, bytes) else value for key, value in row.items()}
                              for row in self.rows])
        return speed_report.write(self.options.directory, self.rows, self.known, self.machine, self.profiles)


def main():
    scenes = speed_scenes.scenes()
    about = ''.join('  %-11s %s\n' % (name, scene.about) for name, scene in scenes.items())
    parser = argparse.ArgumentParser(description=__doc__ + '\nscenes:\n' + about,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', metavar='NAME')
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build', 'release', 'dotyk'))
    parser.add_argument('--directory', default='benchmark', help='where scenes, meshes and results are kept')
    parser.add_argument('--repeat', type=int, default=3)
    parser.add_argument('--limit', type=int, default=120, help='processor seconds of each thread after which a run is stopped')
    parser.add_argument('--theta', nargs='+', default=THETAS, help='theta_relative, or default')
    parser.add_argument('--errors', choices=['with', 'without', 'both'], default='both', help='with estimated errors or not')
    options = parser.parse_args()
    options.dotyk = os.path.abspath(options.dotyk)
    options.directory = os.path.abspath(options.directory)
    parts = {'ratios': [n for n, s in scenes.items() if s.bound], 'threads': [n for n, s in scenes.items() if s.threads],
             'chains': [n for n in ('chain', 'chain_placed') if n in scenes],
             'profile': [n for n in ('hertz', 'wavy', 'composite') if n in scenes]}
    for name in options.names:
        if name not in parts and name not in scenes:
            sys.exit('benchmark: %s: one of %s' % (name, ', '.join([*parts, *scenes])))
    if not os.access(options.dotyk, os.X_OK):
        sys.exit('benchmark: no executable %s; tools/build.sh makes it, or --dotyk names another' % options.dotyk)
    benchmark = Benchmark(options)
    benchmark.known = scenes
    for part in [name for name in options.names if name in parts] or parts:
        for name in parts[part]:
            if name in options.names or not any(name in scenes for name in options.names):
                getattr(benchmark, part)(scenes[name])
                text = benchmark.write()
    print(text)


if __name__ == '__main__':
    main()
