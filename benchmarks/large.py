#!/usr/bin/python3
"""Bodies of 0.2 to 5 million unknowns: tools/benchmark large [--only NAME...] [--sizes SIZE...]

Runs the Hertz scene at each size and the other scenes at --others unknowns, on each number of threads, and prints tables in
Markdown: wall and processor time, peak memory, phases, iterations and contact force of each run; what --check predicts; the
slope of log(time) against log(unknowns); one thread against several; the bandwidth of a STREAM triad before and after. gmsh
makes the meshes first, untimed, and keeps them in --directory. hertz_contact runs where --only names it. Processor time and
ratios within one run are meaningful on a busy machine, wall time is not. Files in --directory: runs.csv, large.md (the tables).
scenes:
"""
import argparse
import csv
import datetime
import math
import os
import re
import subprocess
import sys
import time

sys.dont_write_bytecode = True
import h5py  # noqa: E402
import numpy as np  # noqa: E402

import large_scenes  # noqa: E402
import speed_report  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(HERE)
PHASES = ('read', 'assemble', 'search', 'order', 'factorize', 'iterate', 'recover', 'estimate', 'check', 'write')
SIZES = ('172k', '1030k', '2200k', '5000k')
COLUMNS = ['scene', 'unknowns', 'rows', 'threads', 'wall', 'user', 'system', 'GiB', 'exit', 'CG', 'active sets', 'force',
           'bytes/unknown']


def number(text):
    """Unknowns of a text such as 172k, 2.2M or 5e6."""
    scale = {'k': 1e3, 'M': 1e6}.get(text[-1:], 1)
    return round(float(text[:-1] if scale > 1 else text)*scale)


def stream(folder, threads):
    """Bandwidth of the triad [GB/s]."""
    program = os.path.join(folder, 'stream')
    subprocess.run(['gcc', '-O3', '-march=native', '-fopenmp', os.path.join(HERE, 'stream.c'), '-o', program], check=True)
    ended = subprocess.run([program], env=dict(os.environ, OMP_NUM_THREADS=str(threads)), capture_output=True, text=True,
                           check=True)
    return float(ended.stdout)


def measured(command, threads, log):
    """Run a command: exit code, wall, user and system seconds, peak memory [bytes]; its output goes to a file."""
    environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS=str(threads))
    begun = time.monotonic()
    with open(log, 'w') as file:
        process = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return dict(exit=process.returncode, wall=time.monotonic() - begun, user=usage.ru_utime, system=usage.ru_stime,
                peak=usage.ru_maxrss*1024)


def bytes_of(text):
    """Memory of the log, such as 1518 MiB or 16.3 GiB."""
    value, unit = text.split()
    return float(value)*{'MiB': 2**20, 'GiB': 2**30}[unit]


def predicted(log):
    """What --check predicts."""
    with open(log) as file:
        text = file.read()
    found = {}
    memory = re.search(r'total about ([\d.]+ [MG]iB)', text)
    if memory:
        found['predicted memory'] = bytes_of(memory[1])
    return found


def results(path, log):
    """What the results file and the log say of a run."""
    row = {}
    with h5py.File(path) as file:
        own = file['dotyk']
        summary = own['summary'].attrs
        row.update({phase: float(own['timing'].attrs[phase]) for phase in PHASES if phase in own['timing'].attrs})
        row['unknowns'], row['rows'] = int(summary['unknowns']), int(summary['constraints'])
        row['active sets'] = int(summary['iterations'])
        row['force'] = sum(float(np.linalg.norm(pair.attrs['force'])) for pair in own['contact'].values())
    with open(log) as file:
        found = re.findall(r'(\d+) active sets?, (\d+) iterations? of conjugate gradients', file.read())
    if found:
        row['active sets'], row['CG'] = sum(int(sets) for sets, _ in found), sum(int(steps) for _, steps in found)
    return row


class Benchmark:
    """One call of this script."""

    def __init__(self, options):
        self.options, self.rows, self.bandwidth = options, [], []
        os.makedirs(options.directory, exist_ok=True)

    def triad(self):
        """Measure the bandwidth."""
        self.bandwidth.append({threads: stream(self.options.directory, threads) for threads in self.options.threads})

    def run(self, scene):
        """The scene on each number of threads."""
        say('%s: mesh' % scene.label)
        scene.prepare(self.options.directory)
        case = scene.case(self.options.solver)
        log = os.path.join(scene.folder, 'check.log')
        command = [self.options.dotyk, case]
        check = measured([*command, '--check', '--threads', str(self.options.threads[0])], self.options.threads[0], log)
        if check['exit'] != 0:
            sys.exit('large: %s: --check ended with %d; see %s' % (scene.label, check['exit'], log))
        expected = predicted(log)
        if self.options.check:
            self.rows.append(dict(scene=scene.name, label=scene.label, unknowns=unknowns_of(log),
                                  threads=self.options.threads[0], **check, **expected))
            return
        if expected.get('predicted memory', 0) > self.options.memory*2**30:
            say('%s: skipped: needs about %.1f GiB' % (scene.label, expected['predicted memory']/2**30))
            return
        for threads in self.options.threads:
            output = os.path.join(scene.folder, 'results.vtkhdf')
            log = os.path.join(scene.folder, 'threads_%d.log' % threads)
            best = None
            for _ in range(self.options.repeat):
                row = measured([*command, '--threads', str(threads), '--output', output], threads, log)
                if row['exit'] in (0, 1):
                    row.update(results(output, log))
                if best is None or row['wall'] < best['wall']:
                    best = row
            self.rows.append(dict(scene=scene.name, label=scene.label, threads=threads, **expected, **best))
            say('%s, %d threads: wall %.1f s, user %.1f s, %.2f GiB, exit code %d' % (
                scene.label, threads, best['wall'], best['user'], best['peak']/2**30, best['exit']))

    def write(self):
        """The tables of all runs so far."""
        keys = list(dict.fromkeys(key for row in self.rows for key in row))
        with open(os.path.join(self.options.directory, 'runs.csv'), 'w', newline='') as file:
            writer = csv.DictWriter(file, keys)
            writer.writeheader()
            writer.writerows(self.rows)
        parts = ['%s, %s, %d processors%s' % (datetime.date.today(), speed_report.processor_kind(), os.cpu_count(),
                                              '; &solver ' + self.options.solver if self.options.solver else '')]
        for threads in self.options.threads:
            parts.append('STREAM triad, %d thread%s: %s GB/s' % (
                threads, '' if threads == 1 else 's', ', '.join('%.1f' % one[threads] for one in self.bandwidth)))
        if not self.options.check:
            parts += [table(COLUMNS, [shown(row) for row in self.rows]),
                      'Seconds by phase, and reading, search and writing as a part of the wall time\n\n'
                      + table(['scene', 'threads', *PHASES, 'in and out [%]'], [phases(row) for row in self.rows])]
        known = [row for row in self.rows if 'predicted memory' in row]
        if known:
            parts.append('Predictions of --check\n\n' + table(
                ['scene', 'unknowns', 'threads', 'predicted GiB', 'GiB', 'ratio of memory', 'wall'],
                [prediction(row, self.options.check) for row in known]))
        if not self.options.check:
            parts += slopes(self.rows) + speed_up(self.rows)
        text = '\n\n'.join(parts) + '\n'
        with open(os.path.join(self.options.directory, 'large.md'), 'w') as file:
            file.write(text)
        return text


def say(text):
    """A line with the time of day."""
    print(time.strftime('%H:%M:%S'), text, flush=True)


def unknowns_of(log):
    """Unknowns of all bodies in the table of the log."""
    with open(log) as file:
        found = re.findall(r'(?m)^  (?:\d+ bodies|\S.*?) +\d+ +\d+ +(\d+) +\S+ +\S+$', file.read())
    return int(found[-1]) if found else 0


def shown(row):
    """A row of the table of runs."""
    size = row.get('unknowns')
    return dict(row, GiB=row['peak']/2**30, **({'bytes/unknown': row['peak']/size} if size else {}))


def phases(row):
    """A row of the table of phases."""
    outside = sum(row.get(phase, 0) for phase in ('read', 'search', 'write'))
    return {**row, 'scene': row['label'], 'in and out [%]': 100*outside/row['wall']}


def prediction(row, only):
    """A row of the table of predictions."""
    made = {'scene': row['label'], 'unknowns': row.get('unknowns', ''), 'threads': row['threads'],
            'predicted GiB': row['predicted memory']/2**30}
    if only:
        return made
    made.update({'GiB': row['peak']/2**30, 'ratio of memory': row['predicted memory']/row['peak'], 'wall': row['wall']})
    return made


def slopes(rows):
    """Lines with the slope of log(time) against log(unknowns), by least squares."""
    lines = []
    for name, threads in dict.fromkeys((row['scene'], row['threads']) for row in rows):
        runs = [row for row in rows if (row['scene'], row['threads']) == (name, threads) and row.get('unknowns')]
        if len(runs) < 2:
            continue
        size = np.log([row['unknowns'] for row in runs])
        found = ['%s %.2f' % (what, np.polyfit(size, np.log([row[key] for row in runs]), 1)[0])
                 for what, key in (('wall', 'wall'), ('user', 'user'), ('memory', 'peak'))]
        lines.append('Slope of log(time) against log(unknowns), %s, %d threads: %s' % (name, threads, ', '.join(found)))
    return lines


def speed_up(rows):
    """Table of one thread against several."""
    made = []
    for row in rows:
        single = [one for one in rows if one['label'] == row['label'] and one['threads'] == 1]
        if row['threads'] == 1 or not single or 'unknowns' not in row:
            continue
        made.append({'scene': row['label'], 'threads': row['threads'], 'ratio': single[0]['wall']/row['wall'],
                     **{phase: single[0][phase]/row[phase] for phase in PHASES
                        if row.get(phase, 0) > 0.05 and phase in single[0]}})
    return ['One thread over several, by phases of more than 0.05 s\n\n' + table(['scene', 'threads', 'ratio', *PHASES], made)] \
        if made else []


def table(head, rows):
    """A table in Markdown."""
    def cell(value):
        if isinstance(value, float):
            return '%.3g' % value if not math.isnan(value) and abs(value) < 1e4 else '%.4g' % value
        return str(value)
    lines = ['| ' + ' | '.join(head) + ' |', '|' + '---|'*len(head)]
    return '\n'.join(lines + ['| ' + ' | '.join(cell(row.get(key, '')) for key in head) + ' |' for row in rows])


def main():
    makers = large_scenes.scenes()
    about = ''.join('  %-14s %s\n' % (name, make.__doc__) for name, make in makers.items())
    parser = argparse.ArgumentParser(description=__doc__ + about, prog='tools/benchmark large',
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--only', nargs='+', choices=list(makers), default=[name for name in makers if name != 'hertz_contact'])
    parser.add_argument('--sizes', nargs='+', type=number, default=[number(size) for size in SIZES],
                        help='unknowns of the Hertz scene, such as 172k or 2.2M (%s)' % ' '.join(SIZES))
    parser.add_argument('--others', nargs='+', type=number, default=[1030000], help='unknowns of the other scenes (1.03M)')
    parser.add_argument('--threads', nargs='+', type=int, default=[2, 1])
    parser.add_argument('--repeat', type=int, default=1, help='the fastest of so many runs counts')
    parser.add_argument('--solver', default='', help="keys of &solver, such as \"response='multigrid', tolerance=1e-6\"")
    parser.add_argument('--memory', type=float, default=math.inf,
                        help='GiB; scenes for which --check predicts more are skipped')
    parser.add_argument('--check', action='store_true', help='--check only: nothing is solved')
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build', 'release', 'dotyk'))
    parser.add_argument('--directory', default=os.path.join(ROOT, 'build', 'benchmarks', 'large'))
    options = parser.parse_args()
    options.dotyk = os.path.abspath(options.dotyk)
    if not os.access(options.dotyk, os.X_OK):
        sys.exit('large: no executable %s; tools/build.sh makes it, or --dotyk names another' % options.dotyk)
    benchmark = Benchmark(options)
    benchmark.triad()
    for name in options.only:
        for size in sorted(options.sizes if name.startswith('hertz') else options.others):
            benchmark.run(makers[name](size))
            benchmark.write()
    benchmark.triad()
    print(benchmark.write())


if __name__ == '__main__':
    main()
