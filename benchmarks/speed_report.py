"""Tables of benchmarks/speed.py: write(folder, rows, ...) makes ratios.csv and benchmark.md, and gives this one as text."""
import csv
import datetime
import os
import re

PHASES = ['read', 'assemble', 'order', 'factorize', 'search', 'iterate', 'recover', 'estimate', 'write']
RATIOS = ['scene', 'theta', 'errors', 'total', 'ratio', 'processor', 'bound', *PHASES, 'rest', 'solves', 'memory', 'own memory']
REFERENCE = ['scene', 'unknowns', 'order', 'factorize', 'Gflop', 'entries', 'own order', 'own factorize', 'own Gflop',
             'own entries', 'DGEMM', 'part of DGEMM', 'own part']
THREADS = ['scene', 'phase', 'one', 'two', 'ratio', 'pair', 'reach', 'bound']
CHAIN = ['scene', 'errors', 'bodies', 'total', 'once', 'solve', 'output', 'sweeps', 'condensed', 'no sweeps', 'ratio', 'bound']


def number(value):
    """A number as it stands in a table."""
    if value is None or value == '':
        return ''
    if isinstance(value, str):
        return value
    if isinstance(value, int) or float(value).is_integer() and abs(value) >= 100:
        return '%d' % value
    return '%.3g' % value if abs(value) < 100 else '%.0f' % value


def table(keys, rows):
    """Markdown."""
    lines = ['| ' + ' | '.join(keys) + ' |', '|' + '---|'*len(keys)]
    return '\n'.join(lines + ['| ' + ' | '.join(number(row.get(key)) for key in keys) + ' |' for row in rows]) + '\n'


def least(rows, key='wall'):
    """The row with the least of a key; None where there is none."""
    return min((row for row in rows if row.get('exit', 0) is not None), key=lambda row: row[key], default=None)


def chosen(rows, **keys):
    """Rows with these values."""
    return [row for row in rows if all(row[key] == value for key, value in keys.items())]


def phases(row):
    """Seconds by phase, those that nobody here knows among them."""
    return {key[6:]: value for key, value in row.items() if key.startswith('phase_') and key != 'phase_total'}


def ratios(rows, scenes):
    """Total times over those of the reference."""
    made = []
    for name in dict.fromkeys(row['scene'] for row in rows if row['program'] == 'dotyk'):
        plain = chosen(rows, scene=name, program='cholmod')
        if not scenes[name].bound or not plain:
            continue
        base, processor = least(plain), least(plain, 'processor')['processor']
        own = chosen(rows, scene=name, program='dotyk')
        for theta, errors in dict.fromkeys((row['theta'], row['errors']) for row in own):
            runs = chosen(own, theta=theta, errors=errors)
            best = least(runs)
            row = {'scene': name, 'theta': theta, 'errors': errors, 'bound': scenes[name].bound}
            if best is None:
                made.append({**row, 'total': '> %.0f' % runs[0]['processor'],
                             'processor': '> %.1f' % (runs[0]['processor']/processor)})
                continue
            seconds = phases(best)
            row.update(seconds, total=best['wall'], ratio=best['wall']/base['wall'],
                       processor=least(runs, 'processor')['processor']/processor, rest=best['wall'] - sum(seconds.values()),
                       solves=int(best['body_solves']), memory=max(run['peak'] for run in runs)/base['factor_bytes'])
            row['own memory'] = row['memory']*base['factor_bytes']/best['factor_bytes']
            made.append(row)
    return made


def reference(rows):
    """The reference beside dotyk's own ordering and factorization."""
    made = []
    for name in dict.fromkeys(row['scene'] for row in rows if row['program'] == 'cholmod'):
        plain = least(chosen(rows, scene=name, program='cholmod'))
        own = least(chosen(rows, scene=name, program='dotyk'), 'phase_factorize')
        rate = max(row['dgemm'] for row in chosen(rows, scene=name, program='cholmod'))
        row = {'scene': name, 'unknowns': int(plain['unknowns']), 'order': plain['phase_order'],
               'factorize': plain['phase_factorize'], 'Gflop': plain['flops']/1e9, 'DGEMM': rate/1e9,
               'entries': '%.3gM' % (plain['factor_nonzeros']/1e6),
               'part of DGEMM': plain['flops']/plain['phase_factorize']/rate}
        if own:
            row.update({'own order': own['phase_order'], 'own factorize': own['phase_factorize'], 'own Gflop': own['flops']/1e9,
                        'own entries': '%.3gM' % (own['factor_nonzeros']/1e6),
                        'own part': own['flops']/own['phase_factorize']/rate})
        made.append(row)
    return made


def threads(rows, scenes):
    """One thread, two, and two processes at once; the pair is the time for one scene of two."""
    made = []
    for name in dict.fromkeys(row['scene'] for row in rows if row['program'] == 'double'):
        runs = {program: [row for row in chosen(rows, scene=name, program=program) if row['exit'] is not None]
                for program in ('single', 'double', 'pair')}
        if not all(runs.values()):
            continue
        bound = scenes[name].threads
        for phase in ('total', 'assemble', 'order', 'factorize', 'iterate', 'estimate'):
            key = 'wall' if phase == 'total' else 'phase_' + phase
            if not all(key in row for program in runs.values() for row in program):
                continue
            one, two = (min(row[key] for row in runs[program]) for program in ('single', 'double'))
            couples = zip(runs['pair'][0::2], runs['pair'][1::2])
            pair = min(max(a[key], b[key]) for a, b in couples)/2
            row = {'scene': name, 'phase': phase, 'one': one, 'two': two, 'ratio': one/max(two, 1e-9), 'pair': pair,
                   'reach': pair/max(two, 1e-9)}
            if phase == 'total':
                row['bound'] = 'ratio %g' % bound if bound > 1 else 'reach %g' % bound
            made.append(row)
    return made


def chain(rows):
    """Many equal bodies over twice one factorization and, for each body, a solve, its part of the output, and sweeps with the
    condensed factor, where a sweep is a right-hand side (no sweeps: without them)."""
    made = []
    for name, errors in [(name, errors) for name in ('chain', 'chain_placed') for errors in ('with', 'without')]:
        plain = least(chosen(rows, scene=name, program='cholmod'))
        best = least(chosen(rows, scene=name, program='dotyk', errors=errors))
        if plain is None or best is None:
            continue
        bodies = round(best['unknowns']/plain['unknowns'])
        row = {'scene': name, 'errors': errors, 'bodies': bodies, 'total': best['wall'], 'once': plain['wall'],
               'solve': plain['solve'], 'output': best.get('phase_write', 0)/bodies, 'sweeps': int(best['body_solves']),
               'condensed': plain['condensed']}
        each = row['solve'] + row['output'] + row['sweeps']*row['condensed']
        row['ratio'] = row['total']/(2*row['once'] + bodies*each)
        row['no sweeps'] = row['total']/(2*row['once'] + bodies*(row['solve'] + row['output']))
        made.append({**row, **phases(best), 'bound': 1})
    return made


def processor_kind():
    with open('/proc/cpuinfo') as file:
        found = re.search(r'(?m)^model name\s*:\s*(.*)$', file.read())
    return found[1] if found else 'unknown'


def write(folder, rows, scenes, machine, profiles):
    """ratios.csv and benchmark.md."""
    found = ratios(rows, scenes)
    others = [row['others'] for row in rows if 'others' in row]
    parts = ['%s, %s, %d processors, %s; other programs took %.2f processors in the mean\n' % (
        datetime.date.today(), processor_kind(), os.cpu_count(), machine.get('blas', ''), sum(others)/max(1, len(others)))]
    if found:
        with open(os.path.join(folder, 'ratios.csv'), 'w', newline='') as file:
            writer = csv.DictWriter(file, RATIOS, extrasaction='ignore')
            writer.writeheader()
            writer.writerows(found)
        parts += ['Total time over ordering and factorization by plain CHOLMOD with METIS; one thread [s]\n',
                  table(RATIOS, found)]
    if any(row['program'] == 'cholmod' for row in rows):
        parts += ['CHOLMOD, and what dotyk says of its own factorization [s, Gflop/s]\n', table(REFERENCE, reference(rows))]
    made = threads(rows, scenes)
    if made:
        parts += ['Two threads; pair: a scene of two that run at once; reach: what two threads reach of that [s]\n',
                  table(THREADS, made)]
    made = chain(rows)
    if made:
        keys = CHAIN[:-3] + [key for key in made[0] if key not in CHAIN] + CHAIN[-3:]
        parts += ['Chain of equal bodies; once: factorization of one\n', table(keys, made)]
    text = '\n'.join(parts + profiles)
    with open(os.path.join(folder, 'benchmark.md'), 'w') as file:
        file.write(text)
    return text
