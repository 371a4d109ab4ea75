#!/usr/bin/python3
"""The Neumann scheme on plane multilayer composites: iterations against gamma.

    studies/gamma_sweep.py [--quick] [--figure FILE.png] [--zones FILE.png] [--table FILE.md] [--dotyk FILE]
    studies/gamma_sweep.py --scene N > FILE.nml

Runs packages of 2 to 16 layers (inputs/multilayer) at many relaxation parameters gamma, for several penalties theta
and ratios of Young's moduli. Prints a table in Markdown and draws two figures: iterations to the tolerance against
gamma, and the contact zones of the example. Every run is compared with Theorems 3 and 4 and with the dual scheme;
exit code 1: a measurement contradicts the theory. `--scene N` prints the scene of N layers, for `inputs/multilayer`.
Needs gmsh, numpy, h5py and matplotlib; one to two minutes, with --quick ten seconds.
"""
import argparse
import os
import subprocess
import sys
import tempfile
import time
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [os.path.join(ROOT, 'studies'), os.path.join(ROOT, 'tools/python')]
import dotyk  # noqa: E402
from theory import contradictions, factor, factor_of_paper  # noqa: E402

GEO = os.path.join(ROOT, 'inputs/multilayer/multilayer.geo')
# thickness of a layer [m], initial gap of all joints [m]
THICKNESS, GAP = 0.01, "gap_formula='1e-6*(1-cos(250*pi*x))'"
# other &contact keys: layers that overlap, which closes all rows; (18) as it stands
VARIANTS = {'all closed': 'gap=-5e-5', 'quadrature': GAP + ", discretization='quadrature'"}
# tolerance of the sweeps, most iterations that a gamma may take by the theory
TOLERANCE, LIMIT = 1e-6, 40000


def scene(layers, solver="scheme='neumann', theta_relative=0.1", ratio=3, gap=GAP, mesh='multilayer.geo'):
    """Namelists of a package of layers, the odd ones soft; ratio: Young's modulus of the even layers to that of the odd
    ones, with the same sum of 1/E of both."""
    text = ["&scene    title='package of %d layers', mesh='%s', analysis='plane_strain' /" % (layers, mesh),
            "&material name='soft',  young=%ge9, poisson=0.33 /" % (52.5*(1 + 1/ratio)),
            "&material name='stiff', young=%ge9, poisson=0.3 /" % (52.5*(1 + ratio))]
    kinds = ['soft' if k % 2 == 0 else 'stiff' for k in range(layers)]
    for k, kind in enumerate(kinds):
        text.append("&body     name='layer %d', volume='%s layer', material='%s', at=0,%g /"
                    % (k + 1, kind, kind, k*THICKNESS))
    for k, kind in enumerate(kinds):
        text += ["&support  body='layer %d', surface='%s middle', fix='x' /" % (k + 1, kind),
                 "&support  body='layer %d', surface='%s end', fix='xy' /" % (k + 1, kind)]
    text.append("&load     body='layer %d', surface='%s patch', pressure=50e6 /" % (layers, kinds[-1]))
    for k in range(1, layers):
        # the soft layer of each pair has the finer mesh: it is the slave
        sides = ["'layer %d:%s upper face'" % (k, kinds[k - 1]), "'layer %d:%s lower face'" % (k + 1, kinds[k])]
        text += ["&contact  name='joint %d', surface_a=%s, surface_b=%s," % (k, *(sides if k % 2 else sides[::-1])),
                 '          %s /' % gap]
    return '\n'.join(text) + '\n&solver   %s /\n' % solver


class Run:
    """What one run left: contact rows of all joints, displacements, summary, history, log."""

    def __init__(self, path, text):
        self.text = text
        with dotyk.Results(path) as results:
            self.summary, self.history = results.summary.attributes, dict(results.history)
            joints = [results.pairs['joint %d' % (k + 1)] for k in range(len(results.pairs))]
            names = ('weight', 'pressure', 'pressure_projected', 'gap')
            self.joints = [{'x': joint.position[:, 0], **{name: joint[name] for name in names}} for joint in joints]
            self.forces = np.array([joint.force for joint in joints])
            if 'displacement' in results:  # and of the cells the corners of quadrilaterals
                self.bodies = [(body.nodes[:, :2], body.displacement[:, :2], body.cells[0].nodes[:, :4])
                               for body in results.bodies.values()]
        self.weight, self.pressure, self.gap = (np.concatenate([joint[name] for joint in self.joints])
                                                for name in ('weight', 'pressure', 'gap'))
        self.iterations = int(self.summary['iterations'])
        self.converged = bool(self.summary['converged'])

    def active(self):
        """Rows with penetration. On open rows the pressures of the Neumann scheme decay, but are not 0."""
        return self.gap < 0


def distance(one, other):
    """||u_1 - u_2||_A of two runs of one scene: (m_1 - m_2)^T W (y_2 - y_1) with y = -gap."""
    return np.sqrt(max(0.0, np.sum(one.weight*(one.pressure - other.pressure)*(one.gap - other.gap))))


class Package:
    """A scene in a folder, whose solver is chosen run by run."""

    def __init__(self, program, folder, mesh, layers, **keys):
        self.program, self.folder, self.layers, self.keys = program, folder, layers, {'mesh': mesh, **keys}

    def run(self, fields='contact', **solver):
        """One run; keywords are those of &solver."""
        keys = ', '.join('%s=%s' % (key, repr(value) if isinstance(value, str) else '%.17g' % value)
                         for key, value in solver.items())
        case, output = (os.path.join(self.folder, name) for name in ('run.nml', 'run.vtkhdf'))
        with open(case, 'w') as file:
            file.write(scene(self.layers, keys, **self.keys) + "&output fields='%s', error_parts='' /\n" % fields)
        done = subprocess.run([self.program, case, '--output', output, '--threads', '1'], text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode not in (0, 1):
            sys.exit('gamma_sweep: %s' % done.stdout)
        return Run(output, done.stdout)


# Measurements

def most_steps(q, lambda_max, start):
    """The program stops after so many iterations at the latest, if each shrinks the error by q < 1; start is
    ||u^0 - u||/||u||: its bound is at most q (1+L) times the error of the last iterate, as F' is (1+L)-Lipschitz."""
    return 2 + np.log((1 + lambda_max)*start/TOLERANCE)/-np.log(q)


def gammas_of(lambda_max, start, quick):
    """Relaxation parameters: from half the best one of Theorem 4, as far as LIMIT admits, to 2 or 3 times 2/(1+L)."""
    limit, theorem = 2/(1 + lambda_max), 1/(1 + lambda_max)**2
    near = (0.99, 1.1, 3) if quick else (0.95, 0.98, 0.99, 1.03, 1.06, 1.1, 1.2, 1.5, 2)
    gammas = np.concatenate([np.geomspace(theorem/2, 0.9*limit, 5 if quick else 16), (theorem, 2/(2 + lambda_max)),
                             limit*np.array(near)])
    return sorted(gamma for gamma in gammas
                  if gamma >= limit or most_steps(factor(gamma, lambda_max), lambda_max, start) < LIMIT)


def reference(package, theta):
    """The solution by the dual scheme, L, and ||u^0 - u||/||u||, u^0 being the solution without contact."""
    dual = package.run(scheme='dual', theta_relative=theta, tolerance=1e-12)
    # so small a gamma leaves u^0 as it is
    begin = package.run(scheme='neumann', theta_relative=theta, gamma_rule='fixed', gamma=1e-300, max_iterations=1,
                        tolerance=1e-15)
    return dual, float(begin.summary['lambda_max']), distance(begin, dual)/float(dual.summary['energy_norm'])


def sweep(package, theta, quick):
    """Iterations to the tolerance at many gamma, the most by the theory, and the distance to the dual scheme."""
    dual, lambda_max, start = reference(package, theta)
    norm = float(dual.summary['energy_norm'])
    limit, rows = 2/(1 + lambda_max), []
    for gamma in gammas_of(lambda_max, start, quick):
        run = package.run(scheme='neumann', theta_relative=theta, gamma_rule='fixed', gamma=gamma,
                          max_iterations=LIMIT, tolerance=TOLERANCE)
        row = {'gamma': gamma, 'iterations': run.iterations, 'converged': run.converged,
               'diverged': 'diverged' in run.text, 'error': distance(run, dual)/norm,
               'bound': float(run.summary['error_bound']), 'other_rows': int(np.sum(run.active() != dual.active())),
               'most': np.nan, 'most_of_paper': np.nan}
        if gamma < limit:
            row['most'] = float(most_steps(factor(gamma, lambda_max), lambda_max, start))
        if gamma < limit/(1 + lambda_max):
            row['most_of_paper'] = float(most_steps(factor_of_paper(gamma, lambda_max), lambda_max, start))
        rows.append(row)
    return {'layers': package.layers, 'L': lambda_max, 'start': start, 'limit': limit, 'best': 2/(2 + lambda_max),
            'limit_of_paper': limit/(1 + lambda_max), 'best_of_paper': limit/(1 + lambda_max)/2, 'rows': rows,
            'systems': dual.iterations, 'active': int(dual.active().sum()), 'points': len(dual.gap)}


def measure(program, folder, quick=False, progress=lambda text: None):
    """All sweeps; the example by the Neumann scheme, and without penalty."""
    mesh = os.path.join(folder, 'multilayer.msh')
    subprocess.run(['gmsh', '-2', '-format', 'msh41', '-setnumber', 'm', '16' if quick else '32', '-o', mesh, GEO],
                   check=True, stdout=subprocess.DEVNULL)
    # layers, theta_relative, ratio of moduli, variant
    plan = [(2, 1, 3, ''), (8, 3, 3, ''), (8, 1, 3, 'all closed')]
    if not quick:
        plan = ([(layers, 1, 3, '') for layers in (2, 4, 8, 16)]
                + [(8, theta, 3, '') for theta in (3, 0.3, 0.1, 0.03)]
                + [(8, 1, ratio, '') for ratio in (0.1, 1, 10)] + [(8, 1, 3, variant) for variant in VARIANTS])
    sweeps = []
    for layers, theta, ratio, variant in plan:
        package = Package(program, folder, mesh, layers, ratio=ratio, gap=VARIANTS.get(variant, GAP))
        sweeps.append({'theta': theta, 'ratio': ratio, 'variant': variant, **sweep(package, theta, quick)})
        progress(title_of(sweeps[-1]))
    package = Package(program, folder, mesh, 8)
    return {'sweeps': sweeps, 'example': package.run('displacement contact', scheme='neumann', theta_relative=0.1),
            'exact': package.run(scheme='dual', theta_relative=0.0)}


# Comparison with the theory

def title_of(one):
    """Name of a sweep in messages."""
    return '%d layers%s, theta_relative %g, ratio %g' % (one['layers'], variant_of(one), one['theta'], one['ratio'])


def variant_of(one):
    """Variant after a comma, if there is one."""
    return ', ' + one['variant'] if one['variant'] else ''


def figures(measured):
    """Figures by name: least, largest, and what the theory allows, [low, high]."""
    found = {}
    for one in measured['sweeps']:
        def put(name, values, low, high):
            values = [value for value in values if np.isfinite(value)]
            if values:
                found['%s, %s' % (name, title_of(one))] = min(values), max(values), low, high

        rows = [row for row in one['rows'] if row['gamma'] < one['limit']]
        put('not converged below 2/(1+L)', [sum(not row['converged'] for row in rows)], 0, 0)
        # The contact is solved again, from where it is, with the facets bent that it turns out to span.
        put('iterations over the most by q', [row['iterations']/row['most'] for row in rows], 0, 1)
        put('iterations over the most by (40)', [row['iterations']/row['most_of_paper'] for row in rows], 0, 1)
        put('error over error_bound', [row['error']/row['bound'] for row in one['rows'] if row['converged']],
            0, 1 + 1e-6)
        if one['variant'] == 'all closed':
            put('open rows', [one['points'] - one['active']], 0, 0)
            put('not diverged beyond 2/(1+L)', [sum(not row['diverged'] for row in one['rows']
                                                    if row['gamma'] > 1.05*one['limit'])], 0, 0)
    # a layer has two joints at most, and (a + b)^2 <= 2 (a^2 + b^2)
    alike = [one for one in measured['sweeps'] if one['ratio'] == 3]
    pair = [one['L']*one['theta'] for one in alike if one['layers'] == 2]
    value = [one['L']*one['theta']/pair[0] for one in alike]
    # L is an upper estimate, up to 5 % too large
    found['L over that of two layers'] = min(value), max(value), 1/1.05, 2*1.05
    return found


def row_at(one, gamma):
    """The run at a gamma; nothing if there is none."""
    return next((row for row in one['rows'] if abs(row['gamma']/gamma - 1) < 1e-9), None)


def table(measured):
    """The table in Markdown: a row for each package."""
    text = ['| layers | ratio of moduli | theta_relative | active rows | L | best gamma over 2/(2+L) '
            '| iterations there | at 2/(2+L) | most by q | at 1/(1+L)^2 | most by (40) | converges up to '
            '| distance from `dual` |',
            '|---:'*13 + '|']
    for one in measured['sweeps']:
        good = [row for row in one['rows'] if row['converged']]
        best = min(good, key=lambda row: row['iterations'])
        at_best, theorem = row_at(one, one['best']), row_at(one, one['best_of_paper'])
        of_theorem = most_steps(factor_of_paper(one['best_of_paper'], one['L']), one['L'], one['start'])
        text.append('| %s |' % ' | '.join((
            '%d%s' % (one['layers'], variant_of(one)), '%g' % one['ratio'], '%g' % one['theta'],
            '%d of %d' % (one['active'], one['points']), '%.3g' % one['L'], '%.2f' % (best['gamma']/one['best']),
            '{:,d}'.format(best['iterations']), '{:,d}'.format(at_best['iterations']),
            '{:,.0f}'.format(at_best['most']), '{:,d}'.format(theorem['iterations']) if theorem else '',
            '{:,.0f}'.format(of_theorem), '%.2f' % (max(row['gamma'] for row in good)/one['limit']),
            '%.1e' % max(row['error'] for row in good))))
    return '\n'.join(text) + '\n'


def main():
    """Parse, measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build/release/dotyk'), help='the program')
    parser.add_argument('--quick', action='store_true', help='fewer packages and gamma, coarser meshes')
    parser.add_argument('--scene', type=int, metavar='N', help='print the scene of N layers, and end')
    parser.add_argument('--figure', default='gamma_sweep.png', help='picture of the iterations (gamma_sweep.png)')
    parser.add_argument('--zones', default='multilayer.png', help='picture of the contact zones (multilayer.png)')
    parser.add_argument('--table', help='file for the table; default: the terminal')
    options = parser.parse_args()
    if options.scene:
        print(scene(options.scene), end='')
        return
    if not os.access(options.dotyk, os.X_OK):
        sys.exit('gamma_sweep: %s is not there; build the program, or name it with --dotyk' % options.dotyk)
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        measured = measure(os.path.abspath(options.dotyk), folder, options.quick,
                           lambda text: print('%5.0f s  %s' % (time.monotonic() - start, text), file=sys.stderr,
                                              flush=True))
    if options.table:
        with open(options.table, 'w') as file:
            file.write(table(measured))
    else:
        print(table(measured))
    import gamma_sweep_figures
    gamma_sweep_figures.draw_sweeps(measured, options.figure)
    gamma_sweep_figures.draw_zones(measured, options.zones)
    wrong = contradictions(figures(measured))
    if wrong:
        sys.exit('gamma_sweep: contradictions\n  ' + '\n  '.join(wrong))


if __name__ == '__main__':
    main()
