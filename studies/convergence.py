#!/usr/bin/python3
"""Errors of examples with known answers on finer and finer meshes of linear and quadratic elements, as tables in Markdown.

usage: studies/convergence.py NAME... [--factors 2,1,0.5] [--orders 1,2] [--scene NAME.nml] [--dotyk FILE] [--more KEY=VALUE ...]
example: studies/convergence.py groove
         studies/convergence.py press_fit --scene overlap.nml --more match=1

The folder inputs/NAME is copied; in the .geo of the copy the element size `h` is multiplied by each factor and `order` set (--more
sets other parameters). Errors are those of check.py's function `errors` and, if it has an `exact_stress`, the relative error in the
energy norm by tools/energy_norm.py. In brackets are the orders: log(error before/error)/log(size before/size).
Seconds are those of the whole run but reading and meshing. Exit code 1: a run failed.
"""
import argparse
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT/'tools'), str(ROOT/'tools/python')]
import dotyk  # noqa: E402

LEFT_OUT = ('not converged', 'force')  # zero but for rounding


def load(path):
    """A script as a module."""
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem + path.parent.name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def set_parameter(text, name, value):
    """Change a parameter of a .geo file; {} in the value stands for what it was."""
    new, n = re.subn(r'^%s\s*=\s*([^;]+);' % name, lambda found: '%s = %s;' % (name, value.replace('{}', found[1])), text,
                     flags=re.M)
    if n != 1:
        sys.exit("study: the .geo file should set '%s' once, not %d times" % (name, n))
    return new


def relative_errors(check, path):
    """The errors of check.py, whatever form they have."""
    result = check.errors(path)
    result = result[0] if isinstance(result, tuple) else result
    endings = [name for name in result if name.endswith('_error')]
    errors = {name[:-6]: abs(result[name]) for name in endings} if endings else result
    return {name: value for name, value in errors.items() if name not in LEFT_OUT}


def run(program, folder, scene, text):
    """One run of a scene whose .geo is this text: the results file."""
    geo = folder/re.search(r"mesh='([^']+)'", (folder/scene).read_text())[1]
    geo.write_text(text)
    for options in (['--check'], []):  # the first one makes the mesh
        done = subprocess.run([program, scene, '--quiet', *options], cwd=folder, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode != 0:
            sys.exit('study: exit code %d\n%s' % (done.returncode, done.stdout))
    return (folder/scene).with_suffix('.vtkhdf')


def rows(options, name, folder):
    """What is told of a run, and its errors: two dictionaries for each run."""
    scene = options.scene or name + '.nml'
    check = load(folder/'check.py')
    norms = load(ROOT/'tools/energy_norm.py') if hasattr(check, 'exact_stress') else None
    original = (folder/re.search(r"mesh='([^']+)'", (folder/scene).read_text())[1]).read_text()
    for key, value in (pair.split('=', 1) for pair in options.more):
        original = set_parameter(original, key, value)
    for order in options.orders:
        for factor in options.factors:
            text = set_parameter(set_parameter(original, 'h', '%g*({})' % factor), 'order', str(order))
            path = run(options.dotyk, folder, scene, text)
            with dotyk.Results(path) as results:
                row = {'order': order, 'factor': factor, 'unknowns': results.summary['unknowns'],
                       'seconds': results.timing['total'] - results.timing['read']}
            errors = relative_errors(check, path)
            if norms:
                errors['energy norm'] = norms.error(str(path), check.exact_stress)/(norms.energy_norm(str(path)) or np.nan)
            yield row, errors


def table(results):
    """The table's lines."""
    names = list(results[0][1])
    yield '| elements | size | unknowns | ' + ' | '.join(names) + ' | seconds |'
    yield '|---' + '|---:'*(len(names) + 3) + '|'
    before = None
    for row, errors in results:
        cells = []
        for name in names:
            cell = '%.1e' % errors[name]
            if before and before[0]['order'] == row['order'] and errors[name] > 0 and before[1][name] > 0:
                cell += ' (%.1f)' % (np.log(before[1][name]/errors[name])/np.log(before[0]['factor']/row['factor']))
            cells.append(cell)
        kind = {1: 'linear', 2: 'quadratic'}[row['order']]
        yield '| %s | %g h | %s | %s | %.2g |' % (kind, row['factor'], format(row['unknowns'], ','), ' | '.join(cells),
                                                  row['seconds'])
        before = row, errors


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('names', nargs='+', metavar='NAME', help='example: a folder in inputs/')
    add('--factors', type=lambda text: [float(part) for part in text.split(',')], default=[2, 1, 0.5], help='on h (2,1,0.5)')
    add('--orders', type=lambda text: [int(part) for part in text.split(',')], default=[1, 2], help='of the elements (1,2)')
    add('--scene', help='namelist file in the folder (NAME.nml)')
    add('--dotyk', default=os.environ.get('DOTYK', str(ROOT/'build/release/dotyk')), help='executable (build/release/dotyk)')
    add('--more', nargs='*', default=[], metavar='KEY=VALUE', help='other parameters of the .geo file')
    options = parser.parse_args()
    options.dotyk = str(pathlib.Path(options.dotyk).resolve())
    for name in options.names:
        with tempfile.TemporaryDirectory(prefix='dotyk-study-') as scratch:
            folder = pathlib.Path(scratch)/name
            shutil.copytree(ROOT/'inputs'/name, folder, ignore=shutil.ignore_patterns('.dotyk', '*.vtkhdf', '__pycache__'))
            results = []
            for result in rows(options, name, folder):
                results.append(result)
                print('%s: %d of %d' % (name, len(results), len(options.factors)*len(options.orders)), file=sys.stderr)
        if len(options.names) > 1:
            print('%s## %s\n' % ('' if name == options.names[0] else '\n', name))
        print('\n'.join(table(results)), flush=True)


if __name__ == '__main__':
    main()
