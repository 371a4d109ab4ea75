"""Where the time of a run goes, by perf: profile(command, folder) counts samples by phase and function, text(...) tabulates them.

A sample belongs to the phase whose procedure of the driver is on its stack. Kernels of the BLAS have no frames that perf could
follow: their samples belong to the phase before them, which with one thread is theirs.
"""
import collections
import os
import re
import subprocess

PHASES = [('estimate', 'estimate_errors'), ('recover', 'recover_bodies|project_pressures'),
          ('iterate', 'solve_scheme|solve_free_scene|prepare_coarse_space|share_solves|problem_prepare'),
          ('factorize', 'factorize_bodies'), ('order', 'analyze_bodies'), ('search', 'find_pairs|build_operator|full_attach'),
          ('assemble', 'assemble_bodies'), ('read', 'build_bodies|read_case'), ('write', 'write_')]
PHASES = [(name, re.compile(r'dotyk_(?:driver|control|model)_\w+_MOD_(?:%s)' % words))
          for name, words in PHASES]


def profile(command, folder):
    """Run a command under perf: {phase: Counter of functions}."""
    data = os.path.join(folder, 'perf.data')
    environment = dict(os.environ, OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')
    subprocess.run(['perf', 'record', '-q', '-F', '99', '--call-graph', 'dwarf,32768', '-o', data, *command], check=True,
                   env=environment)
    listing = subprocess.run(['perf', 'script', '-i', data, '--no-inline', '-F', 'comm,ip,sym,dso'], check=True, text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
    os.remove(data)
    counts, last = collections.defaultdict(collections.Counter), 'read'
    program = os.path.basename(command[0])[:15]
    for sample in listing.split('\n\n'):
        lines = sample.strip('\n').split('\n')
        if len(lines) < 2 or lines[0].strip() != program:
            continue
        functions = [line.split(None, 1)[1].strip() if ' ' in line.strip() else '?' for line in lines[1:]]
        stack = ' '.join(functions)
        last = next((name for name, words in PHASES if words.search(stack)), last)
        counts[last][shown(functions[0])] += 1
    return counts


def shown(function):
    """A function with its library as perf writes it, without what compilers add."""
    function, _, library = function.rpartition(' (')
    if library.startswith('[') or 'kallsyms' in library:
        return 'kernel'
    if function == '[unknown]':
        return 'in ' + os.path.basename(library.rstrip(')')).split('.so')[0]
    found = re.match(r'__dotyk_(\w+?)_MOD_(\w+)', function)
    name = '%s (%s)' % (found[2], found[1]) if found else function
    return re.sub(r'(\._omp_fn|\.constprop|\.isra|\.part|\.cold)(\.\d+)?', '', name)


def text(name, counts, most=4, least=0.01):
    """A table in Markdown: percent of the whole run by phase, and the functions that take most of each phase."""
    total = sum(sum(functions.values()) for functions in counts.values())
    lines = ['| %s: phase | %% of the run | functions (%% of the run) |' % name, '|---|---|---|']
    for phase, functions in sorted(counts.items(), key=lambda item: -sum(item[1].values())):
        top = ['`%s` %.1f' % (function, 100*count/total) for function, count in functions.most_common(most)
               if count >= least*total]
        lines.append('| %s | %.1f | %s |' % (phase, 100*sum(functions.values())/total, ', '.join(top)))
    return '\n'.join(lines) + '\n'
