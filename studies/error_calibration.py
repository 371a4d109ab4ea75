#!/usr/bin/python3
"""The errors that dotyk reports over the true ones, on examples with known answers; tables in Markdown.

usage: studies/error_calibration.py [mesh] [penalty] [iteration] [quantities] [--dotyk FILE] [--quick]

mesh       error_discretization over the distance to the exact stresses, in the energy norm, on finer and finer meshes of linear and
           quadratic elements (theta = 0); where only some finer mesh is known, over the distance to that
penalty    error_penalty over the distance of the answer from that with theta = 0 on the same mesh
quantities error of single numbers, by a much finer mesh of quadratic elements, over their error bars; and of numbers that the estimate corrects
iteration  error_bound over the distance of an answer that was stopped early from one that was not
"""
import argparse
import os
import pathlib
import shutil
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT/'tools'))
import convergence  # noqa: E402
import energy_norm  # noqa: E402
import dotyk  # noqa: E402

# examples with exact stresses, and the factors on h of the meshes
EXACT = {'wavy': (4, 2, 1, 0.5), 'groove_row': (4, 2, 1, 0.5), 'press_fit': (4, 2, 1, 0.5)}
# examples compared with a finer mesh of quadratic elements: factors, and that of the finer mesh
FINER = {'cylinder': ((4, 2, 1), 0.5), 'punch': ((4, 2, 1), 0.5), 'groove': ((4, 2, 1), 0.5), 'hertz_axisymmetric': ((4, 2, 1), 0.5),
         'hertz': ((4, 2), 1)}
THETAS = {'wavy': (1, 1e-1, 1e-2, 1e-3, 1e-4), 'column': (1, 1e-1, 1e-2), 'press_fit': (1, 1e-1, 1e-2), 'hertz': (1e-1, 1e-2),
          'receding': (1e-1, 1e-2), 'free_stack': (1e-1, 1e-2)}
# quantities of examples, factors on h of the meshes, and that of the finer mesh
QUANTITIES = {
    'wavy': (('force:wave', 'reaction:lower:bottom y', 'displacement:upper:upper face y'), (4, 2.8, 2, 1.4, 1, 0.7), 0.2),
    'groove_row': (('displacement:upper:* face y',), (4, 2.8, 2, 1.4, 1, 0.7), 0.2),
    'press_fit': (('force:fit', 'reaction:inner:plane x x', 'displacement:outer:outside x', 'displacement:inner:outside y'),
                  (4, 2.8, 2, 1.4, 1, 0.7), 0.2),
    'cylinder': (('displacement:cylinder:cut y', 'displacement:block:up x', 'displacement:cylinder:low x'), (4, 2.8, 2, 1.4, 1), 0.3),
    'punch': (('displacement:upper:top y', 'displacement:lower:lower face y', 'displacement:upper:upper face y'), (4, 2.8, 2, 1.4, 1), 0.3),
    'hertz_axisymmetric': (('displacement:ball:cut y', 'displacement:ball:low x', 'displacement:half-space:up y'), (4, 2.8, 2, 1.4, 1), 0.3),
    'hertz': (('force:touch', 'reaction:block:plane x x', 'displacement:block:up z', 'displacement:ball:low x'), (4, 2.8, 2, 1.4, 1), 0.6)}
STOPS = {'neumann': (10, 100, 1000), 'robin': (10, 100)}


def run(folder, name, output, quantity=(), **solver):
    """Run an example with another &solver group, and with quantities; its results file."""
    scene = dotyk.Scene.read(folder/(name + '.nml'))
    for group in scene.all('solver'):  # not every example has one
        scene.groups.remove(group)
    scene.solver(**solver)
    if quantity:
        scene.output(quantity=list(quantity))
    try:
        return dotyk.run(scene.write(folder/'case.nml'), folder/output, program=OPTIONS.dotyk).path
    except dotyk.Error as error:
        sys.exit('calibration: %s: %s' % (name, error))


def copy(name, scratch):
    """The example in a folder of its own."""
    folder = pathlib.Path(scratch)/name
    if not folder.exists():
        shutil.copytree(ROOT/'inputs'/name, folder, ignore=shutil.ignore_patterns('.dotyk', '*.vtkhdf', '__pycache__'))
    return folder


def summary(path):
    """The attributes of /dotyk/summary."""
    return dotyk.Results(path).summary.attributes


def refined(name, folder, order, factor, quantity=()):
    """An example on another mesh: results file under a name of its own."""
    original = ROOT/'inputs'/name/(name + '.geo')
    text = convergence.set_parameter(convergence.set_parameter(original.read_text(), 'h', '%g*({})' % factor), 'order', str(order))
    (folder/(name + '.geo')).write_text(text)
    return run(folder, name, '%s_%d_%g.vtkhdf' % (name, order, factor), quantity, theta_relative=0, tolerance=1e-8, response='full')


def mesh(scratch):
    """Rows of the table of the mesh's part."""
    yield '| example | elements | size | unknowns | true error | estimate | estimate/true |\n|---|---|---:|---:|---:|---:|---:|'
    for name in list(EXACT) + list(FINER):
        if OPTIONS.only and name not in OPTIONS.only:
            continue
        folder = copy(name, scratch)
        finest = None
        if name in FINER:
            finest = refined(name, folder, 2, FINER[name][1])
        for order in (1, 2):
            for factor in (EXACT.get(name) or FINER[name][0]):
                path = refined(name, folder, order, factor)
                if finest:
                    true = energy_norm.distance_meshes(path, finest)
                else:
                    true = energy_norm.error(path, convergence.load(folder/'check.py').exact_stress)
                true /= energy_norm.energy_norm(path)
                found = summary(path)
                yield '| %s | %s | %g h | %s | %.2e | %.2e | %.2f |' % (
                    name, ('linear', 'quadratic')[order - 1], factor, format(int(found['unknowns']), ','), true,
                    found['error_discretization'], found['error_discretization']/true)


def penalty(scratch):
    """Rows of the table of the penalty's part."""
    yield '| example | theta E/h | true error | estimate | estimate/true |\n|---|---:|---:|---:|---:|'
    for name, thetas in THETAS.items():
        folder = copy(name, scratch)
        exact = run(folder, name, 'exact.vtkhdf', theta_relative=0, tolerance=1e-10)
        for theta in thetas:
            path = run(folder, name, 'penalty.vtkhdf', theta_mesh=theta, tolerance=1e-10)
            true = energy_norm.distance(path, exact)/energy_norm.energy_norm(path)
            estimate = summary(path)['error_penalty']
            yield '| %s | %g | %.3e | %.3e | %.4f |' % (name, theta, true, estimate, estimate/true)


def iteration(scratch):
    """Rows of the table of the iteration's part."""
    yield '| example | scheme | steps | true error | bound | bound/true |\n|---|---|---:|---:|---:|---:|'
    for name in ('wavy', 'column'):
        folder = copy(name, scratch)
        exact = run(folder, name, 'exact.vtkhdf', scheme='dual', theta_mesh=0.3, tolerance=1e-12)
        for scheme, steps in STOPS.items():
            for step in steps:
                path = run(folder, name, 'a.vtkhdf', scheme=scheme, theta_mesh=0.3, tolerance=1e-9, max_iterations=step)
                true = energy_norm.distance(path, exact)/energy_norm.energy_norm(path)
                bound = summary(path)['error_bound']
                yield '| %s | %s | %d | %.2e | %.2e | %.2f |' % (name, scheme, summary(path)['iterations'], true, bound, bound/true)


def quantities(scratch):
    """Rows of the table of error bars of quantities, and how many of them hold."""
    yield '| example | quantity | elements | size | value | true error | error bar | true/bar | corrected: true/bar |\n' + '|---|---|---|---:' + 5*'|---:' + '|'
    ratios = []
    for name, (quantity, factors, finest) in QUANTITIES.items():
        if OPTIONS.only and name not in OPTIONS.only:
            continue
        folder = copy(name, scratch)
        best = dotyk.Results(refined(name, folder, 2, finest, quantity)).quantities
        truth = dict(zip(best['names'].splitlines(), best['value'] + best['estimate']))
        for order in (1, 2):
            for factor in factors:
                found = dotyk.Results(refined(name, folder, order, factor, quantity)).quantities
                for which, value, error, estimate in zip(found['names'].splitlines(), found['value'], found['error'], found['estimate']):
                    true = truth[which] - value
                    # Forces that balance loads are exact, but for rounding.
                    if not error > 1e-8*abs(value):
                        continue
                    ratios.append(abs(true)/error)
                    yield '| %s | %s | %s | %g h | %.6g | %.2e | %.2e | %.2f | %.2f |' % (
                        name, which, ('linear', 'quadratic')[order - 1], factor, value, true, error, ratios[-1], abs(true - estimate)/error)
    yield '\n%d bars: true/bar in [0.3, 1.2] in %.0f %%, below 1.2 in %.0f %%' % (
        len(ratios), 100*sum(0.3 <= x <= 1.2 for x in ratios)/len(ratios), 100*sum(x < 1.2 for x in ratios)/len(ratios))


PARTS = {'mesh': mesh, 'quantities': quantities, 'penalty': penalty, 'iteration': iteration}


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('parts', nargs='*', choices=[[], *PARTS], metavar='PART')
    parser.add_argument('--dotyk', default=os.environ.get('DOTYK', str(ROOT/'build/release/dotyk')), help='executable')
    parser.add_argument('--only', nargs='*', help='examples of the tables of the mesh and of quantities')
    global OPTIONS
    OPTIONS = parser.parse_args()
    OPTIONS.dotyk = str(pathlib.Path(OPTIONS.dotyk).resolve())
    for part in OPTIONS.parts or PARTS:
        with tempfile.TemporaryDirectory(prefix='dotyk-calibration-') as scratch:
            print('\n## %s\n' % part)
            for row in PARTS[part](scratch):
                print(row, flush=True)


if __name__ == '__main__':
    main()
