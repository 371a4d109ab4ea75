#!/usr/bin/python3
"""The theory, measured: studies/theory.py [--quick] [--dotyk FILE] [--figure FILE.png] [--table FILE.md]

Runs the program on small scenes and holds what it does against the theorems: how the penalty error falls with theta (Theorem 1),
by which factor a step of the Neumann scheme shrinks the error at every gamma (Theorems 3 and 4), the same for the general
iteration with other forms G (general_iteration.py), how far the bounds are above the true error, and what of this depends on
the mesh. Prints two tables in Markdown and draws one figure. Exit code 1: something contradicts the theory.
Needs gmsh, numpy, h5py and matplotlib; three to four minutes, with --quick some twenty seconds.
"""
import argparse
import os
import sys
import tempfile
import time
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [os.path.join(ROOT, 'tools'), os.path.join(ROOT, 'studies')]
import energy_norm  # noqa: E402
import general_iteration  # noqa: E402
from theory_scenes import (COLUMN_COMPLIANCE, COLUMN_GEO, COLUMN_NML, Scene, deviation_of, distance, hertz, punch,  # noqa: E402
                           wavy)


def slope(x, y):
    """Of a straight line through logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


# Theorem 1

def measure_penalty(scene, thetas):
    """Distance of u_theta from u_0, relative, for all theta_relative."""
    exact = scene.run(scheme='dual', theta_relative=0.0, tolerance=1e-12)
    norm = exact.norm()
    # (p_0, p_0)^(1/2) on the contact surface: ||u_theta - u_0||_A <= sqrt(theta)/2 of it
    size = np.sqrt(np.sum(exact.weight*exact.pressure**2))
    rows = []
    for theta in thetas:
        run = scene.run(scheme='dual', theta_relative=theta, tolerance=1e-12)
        error = distance(run, exact)
        rows.append({'theta_relative': theta, 'theta': run.theta, 'error': error/norm, 'limit': np.sqrt(run.theta)/2*size/norm,
                     'estimate': run.summary.get('error_penalty', np.nan)*run.norm()/error, 'active': int(np.sum(run.y > 0))})
    return {'norm': norm, 'active': int(np.sum(exact.pressure > 0)), 'rows': rows}


def slopes_of(penalty, low, high):
    """Slope of the error for theta_relative in [low, high]."""
    rows = [row for row in penalty['rows'] if low*(1 - 1e-9) <= row['theta_relative'] <= high*(1 + 1e-9)]
    return slope([row['theta'] for row in rows], [row['error'] for row in rows])


def column_error(theta):
    """||u_theta - u_0||_A/||u_0||_A of the column: p = s/(c + theta), c being the compliance of both blocks."""
    return theta/(sum(COLUMN_COMPLIANCE) + theta)


# Theorems 3 and 4

def factor(gamma, lambda_max):
    """q: the sharp factor."""
    return np.maximum(np.abs(1 - gamma), np.abs(1 - gamma*(1 + lambda_max)))


def factor_of_paper(gamma, lambda_max):
    """q of (40) with the constants of the energy norm; below 1 for gamma < gamma_2."""
    return np.sqrt(1 - gamma*(2 - gamma*(1 + lambda_max)**2))


def measure_iteration(scene, theta, gammas, steps, tolerance=1e-9):
    """True errors and bounds of the iterates at `steps` and later ones, for every gamma of the function gammas(L)."""
    reference = scene.run(scheme='dual', theta_relative=theta, tolerance=1e-12)
    # so small a gamma leaves u^0, the scene without contact, as it is
    start = scene.run(scheme='neumann', theta_relative=theta, gamma_rule='fixed', gamma=1e-300, max_iterations=1, tolerance=1e-15)
    lambda_max = float(start.summary['lambda_max'])
    limit = 2/(1 + lambda_max)
    rows, deviation = [], 0.0
    for gamma in gammas(lambda_max):
        def run(most, tolerance):
            return scene.run(scheme='neumann', theta_relative=theta, gamma_rule='fixed', gamma=gamma, max_iterations=most,
                             tolerance=tolerance)
        whole = run(5000, tolerance)
        n = int(whole.summary['iterations'])
        row = {'gamma': gamma, 'q': float(factor(gamma, lambda_max)), 'iterations': n,
               'q_of_paper': float(factor_of_paper(gamma, lambda_max)) if gamma < limit/(1 + lambda_max) else np.nan,
               'converged': bool(whole.summary['converged']), 'diverged': whole.code == 1 and 'diverged' in whole.text,
               'warned': 'may diverge' in whole.text}
        # The slowest mode shows itself late.
        late = [k + i for k in (n//4, n//2, 3*n//4) for i in (0, 1)] if row['converged'] else []
        values = [(0, distance(start, reference), np.nan, np.nan)]
        for k in sorted(set(steps) | {k for k in late if k > steps[-1]}):
            one = run(k, 1e-15)
            if one.summary['iterations'] < k:
                break
            norm = one.norm()
            if len(values) % 3 == 1:
                deviation = max(deviation, deviation_of(one, reference))
            values.append((k, distance(one, reference), one.summary['error_bound']*norm, one.summary['error_bound_paper']*norm))
        # Beyond this the errors are those of rounding.
        values = np.array([value for value in values if value[1] > 1e-9*reference.norm()])
        k, row['errors'] = values[:, 0].astype(int), values[:, 1]
        row['steps'], row['bounds'], row['bounds_of_paper'] = k, values[:, 2], values[:, 3]
        factors = (row['errors'][1:]/row['errors'][:-1])**(1/np.diff(k))
        row['largest'], row['last'] = float(factors.max()), float(factors[-1])
        # The history has increments relative to the norm of the iterate, which settles; later ones are made of rounding errors.
        steps_of = whole.history['increment']
        steps_of = steps_of[(steps_of < 1e-3) & (steps_of > 1e-8)]
        row['by_increments'] = float((steps_of[1:]/steps_of[:-1]).max()) if row['converged'] and len(steps_of) > 1 else np.nan
        rows.append(row)
    return {'L': lambda_max, 'limit': limit, 'limit_of_paper': limit/(1 + lambda_max), 'best': 2/(2 + lambda_max),
            'active': int(np.sum(reference.pressure > 0)), 'active_start': int(np.sum(start.y > 0)), 'points': len(reference.y),
            'norm': reference.norm(), 'theta': reference.theta, 'deviation': deviation, 'rows': rows}


def gammas_of(inside, across, beyond):
    """Relaxation parameters: fractions of gamma_2 of Theorem 3, of 2/(1+L), and beyond it."""
    def gammas(lambda_max):
        limit = 2/(1 + lambda_max)
        return sorted({x*limit/(1 + lambda_max) for x in inside} | {x*limit for x in (*across, *beyond)} | {2/(2 + lambda_max)})
    return gammas


def ratios(iteration, name):
    """Bound over true error of all iterates, where there is a bound."""
    values = np.concatenate([row[name]/row['errors'] for row in iteration['rows']])
    return values[np.isfinite(values)]


def measure_schemes(scene, thetas, steps):
    """`error_bound` over the true error, of displacements, of every scheme stopped at `steps`: scheme -> ratios."""
    found = {}
    for theta in thetas:
        exact = scene.run(scheme='dual', theta_relative=theta, tolerance=1e-12)
        for scheme in ('neumann', 'robin', 'dual'):
            for k in steps:
                run = scene.run(scheme=scheme, theta_relative=theta, max_iterations=k, tolerance=1e-15)
                error, norm = energy_norm.distance(run.results, exact.results), energy_norm.energy_norm(run.results)
                if run.summary['iterations'] < k or error < 1e-9*norm:
                    break
                found.setdefault(scheme, []).append(float(run.summary['error_bound']*norm/error))
    return found


# Meshes

def measure_meshes(scenes, sizes, thetas):
    """L, the factors and the steps to 1e-6 on meshes of elements `sizes` at theta_relative of `thetas`."""
    rows = []
    for scene, size, theta in zip(scenes, sizes, thetas):
        run = scene.run(scheme='neumann', theta_relative=theta, tolerance=1e-6)
        rows.append({'h': size, 'theta': run.theta, 'points': len(run.y), 'iterations': int(run.summary['iterations']),
                     **{name: float(run.summary[name]) for name in ('lambda_max', 'q_predicted', 'q_measured')}})
    return rows


def measure(program, folder, quick=False, progress=lambda text: None):
    """All measurements."""
    def scene(name, texts):
        progress(name)
        return Scene(program, folder, name, *texts)

    column = scene('column', (COLUMN_GEO, COLUMN_NML))
    open_wave, closed_wave = scene('open wave', wavy(40, 0.006)), scene('closed wave', wavy(40, 0.0005))
    divisions = (10, 20, 40) if quick else (20, 40, 80, 160)
    waves = [scene('wave %d' % n, wavy(n)) for n in divisions]
    balls = [] if quick else [scene('ball %s' % n, hertz(n)) for n in (2, 3, 4.5)]

    thetas = 10.0**-np.arange(0, 6.1, 1.5 if quick else 0.5)
    penalty = {'column': column, 'wave': waves[-1]}
    if not quick:
        penalty.update({'ball': balls[1], 'sharp punch': scene('sharp punch', punch())})
    for name in penalty:
        progress('%s: u_theta at %d theta' % (name, len(thetas)))
        penalty[name] = measure_penalty(penalty[name], thetas)

    if quick:
        gammas, steps = gammas_of((0.5,), (0.9,), (1.1,)), (1, 2, 3, 9, 10)
    else:
        gammas = gammas_of((0.1, 0.25, 0.5, 0.75, 0.97), (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99), (1.03, 1.06, 1.1, 1.2, 1.5))
        steps = (1, 2, 3, 4, 5, 8, 9, 12, 13, 18, 19, 24, 30, 31)
    few = gammas_of((0.25, 0.5, 0.97), (0.7, 0.9), (1.1, 1.6))
    iteration = {}
    plan = [('closed wave', closed_wave, 1.0, gammas, steps), ('open wave', open_wave, 1.0, gammas, steps),
            ('column', column, 0.5, gammas if quick else few, steps[::2])]
    if balls:
        plan.append(('ball', balls[1], 0.1, few, (1, 2, 5, 6, 12, 13, 24, 25)))
    for name, one, theta, gamma, at in plan:
        progress('%s: the iteration at %d gamma' % (name, len(gamma(1.0))))
        iteration[name] = measure_iteration(one, theta, gamma, at)

    progress('the bounds of all schemes')
    thetas, steps = ((1e-2,), (1, 2, 20)) if quick else ((1, 1e-2, 1e-4), (1, 2, 3, 5, 13, 30, 100, 400))
    schemes = measure_schemes(open_wave, thetas, steps)
    progress('meshes')
    meshes = {'wave, fixed theta': measure_meshes(waves, 1/np.array(divisions), [0.1]*len(waves)),
              'wave, theta as h': measure_meshes(waves, 1/np.array(divisions), [0.1*divisions[0]/n for n in divisions])}
    if balls:
        meshes['ball, fixed theta'] = measure_meshes(balls, 1/np.array((2, 3, 4.5)), [0.02]*3)
    return {'penalty': penalty, 'iteration': iteration, 'schemes': schemes, 'meshes': meshes,
            'general': general_iteration.measure(program, folder, quick, progress)}


# What the theory says of it

def singular_exponent():
    """lambda in p ~ r^(lambda - 1) at the edge of the punch: a quarter plane on a half-plane, same material, no friction.

    Dundurs and Lee (J. Elasticity 2 (1972) 109-112): cot(pi l) + sin(pi l)/(2 (sin^2(pi l/2) - l^2)) = 0."""
    def rest(x):
        return np.cos(np.pi*x)/np.sin(np.pi*x) + np.sin(np.pi*x)/(2*(np.sin(np.pi*x/2)**2 - x*x))

    low, high = 0.6, 0.9
    for _ in range(60):
        middle = (low + high)/2
        low, high = (middle, high) if rest(middle)*rest(low) > 0 else (low, middle)
    return low


def column_lambda(theta):
    """L of the column: its only mode is the uniform pressure."""
    return sum(COLUMN_COMPLIANCE)/theta


def per_row(iteration, function):
    """A function of every gamma that is said to converge."""
    return np.array([function(row) for row in iteration['rows'] if row['gamma'] < iteration['limit']])


def figures(measured):
    """Figures by name: least, largest, and what the theory allows, [low, high] (None: no limit)."""
    found = {}
    for name, penalty in measured['penalty'].items():
        rows = penalty['rows']
        errors, limits = (np.array([row[key] for row in rows]) for key in ('error', 'limit'))
        found['penalty limit over error, ' + name] = (limits/errors).min(), (limits/errors).max(), 1 - 1e-9, None
        value = [row['estimate'] for row in rows if np.isfinite(row['estimate'])]
        if value:
            found['error_penalty over error, ' + name] = min(value), max(value), 0.8, 1.3
        if name == 'sharp punch':
            # the regular part of the pressure adds a part that falls like theta
            value = slopes_of(penalty, 1e-5, 1e-4)
            found['slope at small theta, sharp punch'] = value, value, singular_exponent(), singular_exponent() + 0.05
        else:
            value = slopes_of(penalty, 1e-6, 1.1e-3)
            found['slope at small theta, ' + name] = value, value, 0.98, 1.005
        value = slopes_of(penalty, 0.9e-3, 1)
        found['slope at large theta, ' + name] = value, value, 0, 1.005
    rows = measured['penalty']['column']['rows']
    value = max(abs(row['error']/column_error(row['theta']) - 1) for row in rows)
    found['error against theta/(c + theta), column'] = value, value, 0, 1e-6
    for name, iteration in measured['iteration'].items():
        rows = [row for row in iteration['rows'] if row['gamma'] < iteration['limit']]
        value = [row['largest']/row['q'] for row in iteration['rows']]
        found['factor over q, ' + name] = min(value), max(value), 0, 1 + 1e-6
        value = [row['largest']/row['q_of_paper'] for row in rows if np.isfinite(row['q_of_paper'])]
        found['factor over (40), ' + name] = min(value), max(value), 0, 1 + 1e-6
        # the norm of the iterate, to which the increments are relative, has settled to 1e-3
        value = [row['by_increments']/row['q'] for row in rows if np.isfinite(row['by_increments'])]
        found['factor by increments over q, ' + name] = min(value), max(value), 0, 1 + 2e-3
        found['not converged below 2/(1+L), ' + name] = (sum(not row['converged'] for row in rows),)*2 + (0, 0)
        value = ratios(iteration, 'bounds')
        found['bound over error, ' + name] = value.min(), value.max(), 1 - 1e-6, None
        value = ratios(iteration, 'bounds_of_paper')
        found['(41) over error, ' + name] = value.min(), value.max(), 1 - 1e-6, None
        found['deviation of two ways to the error, ' + name] = (iteration['deviation'],)*2 + (0, 1e-6)
    for scheme, values in measured['schemes'].items():
        found['bound over error, scheme ' + scheme] = min(values), max(values), 1 - 1e-6, None
    # all points stay closed: q is sharp, and so is 2/(1+L), but for the margin of L
    for name in ('column', 'closed wave'):
        iteration = measured['iteration'][name]
        beyond = [row for row in iteration['rows'] if row['gamma'] > 1.025*iteration['limit']]
        value = sum(not (row['diverged'] and row['warned']) for row in beyond)
        found['not diverged beyond 2/(1+L), ' + name] = value, value, 0, 0
        # the largest gamma that converges has the factor gamma (1 + L) - 1
        row = [row for row in iteration['rows'] if row['gamma'] < iteration['limit']][-1]
        value = iteration['L']/((1 + row['last'])/row['gamma'] - 1)
        found['L over measured L, ' + name] = value, value, 1, 1.05
    iteration = measured['iteration']['column']
    value = iteration['L']/column_lambda(iteration['theta'])
    found['L over exact L, column'] = value, value, 1, 1.05
    value = max(abs(row['largest'] - abs(1 - row['gamma']*(1 + column_lambda(iteration['theta'])))) for row in iteration['rows']
                if row['gamma'] < iteration['limit'])
    found['factor against abs(1 - gamma (1+L)), column'] = value, value, 0, 1e-6
    for name, rows in measured['meshes'].items():
        sizes = np.array([row['h'] for row in rows])
        for key in ('lambda_max', 'iterations'):
            value = np.array([row[key] for row in rows], float)
            if 'fixed' in name:
                found['%s on meshes, %s' % (key, name)] = value.min()/value.max(), 1, 0.95, 1
            else:
                found['%s on meshes, %s' % (key, name)] = (slope(sizes, value),)*2 + (-1.05, -0.95)
        value = [row['q_measured']/row['q_predicted'] for row in rows]
        found['q on meshes, ' + name] = min(value), max(value), 0, 1 + 1e-6
    found.update(general_iteration.figures(measured['general']))
    return found


def contradictions(found):
    """Lines on what is not as the theory says."""
    return ['%s: %.9g to %.9g, but must be in [%s, %s]' % (name, least, largest, low, high)
            for name, (least, largest, low, high) in found.items()
            if not (least >= low and (high is None or largest <= high))]


# Table and figure

def table(measured):
    """The table in Markdown: a row for each statement, a column for each scene."""
    found, penalty, iteration, meshes = figures(measured), measured['penalty'], measured['iteration'], measured['meshes']
    scenes = ('column', 'closed wave', 'open wave', 'ball', 'sharp punch')
    scenes = [name for name in scenes if name in penalty or name in iteration]
    # the wave of Theorem 1 and of the meshes is partly open too
    twin = {'open wave': 'wave'}
    text = ['| | theory | %s |' % ' | '.join(scenes), '|---|---|%s' % ('---|'*len(scenes))]

    def row(title, theory, cell):
        cells = []
        for name in scenes:
            try:
                cells.append(cell(name))
            except KeyError:
                cells.append('')
        text.append('| %s | %s | %s |' % (title, theory, ' | '.join(cells)))

    def span(digits, title):
        def cell(name):
            key = title + ', ' + name
            least, largest = found[key if key in found else title + ', ' + twin.get(name, name)][:2]
            return ' to '.join(sorted({'%.*g' % (digits, value) for value in (least, largest)}, key=float))
        return cell

    def numbers(format_, values):
        """Numbers, or one where all are the same."""
        values = [format_ % value for value in values]
        return values[0] if len(set(values)) == 1 else ', '.join(values)

    def row_at(name, gamma):
        return min(iteration[name]['rows'], key=lambda row: abs(row['gamma'] - gamma))

    def closed(name):
        one = penalty[twin.get(name, name)]
        return numbers('%d', (one['active'], one['rows'][0]['active']))

    def steps(gamma):
        def cell(name):
            found_at = row_at(name, iteration[name][gamma]*(0.5 if gamma == 'limit_of_paper' else 1))
            return '%d (%.0f)' % (found_at['iterations'], np.log(1e-9)/np.log(found_at['q']))
        return cell

    def ends(name):
        one = iteration[name]
        last = max(row['gamma'] for row in one['rows'] if row['converged'])/one['limit']
        first = min((row['gamma'] for row in one['rows'] if row['diverged']), default=np.inf)/one['limit']
        return '%.3g, %.3g' % (last, first)

    def on_meshes(kind, format_, key):
        return lambda name: numbers(format_, [row[key] for row in meshes['%s, %s' % (twin.get(name, name), kind)]])

    row('closed points at theta = 0, at theta = 1', '', closed)
    row('Theorem 1: slope of the error, theta 1e-6 to 1e-3 (sharp punch: 1e-5 to 1e-4)',
        '1 (sharp punch: %.3f)' % singular_exponent(), span(4, 'slope at small theta'))
    row('the same, theta 1e-3 to 1', 'below 1', span(3, 'slope at large theta'))
    row('sqrt(theta)/2 of the norm of p_0, over the error', '>= 1', span(4, 'penalty limit over error'))
    row('`error_penalty` over true error', '0.8 to 1.3', span(4, 'error_penalty over error'))
    row('L of the iteration', '', lambda name: '%.3g' % iteration[name]['L'])
    row('Theorem 4: factor over q', '<= 1', span(4, 'factor over q'))
    row('the same from increments (history)', '<= 1', span(4, 'factor by increments over q'))
    row('factor over (40)', '<= 1', span(3, 'factor over (40)'))
    row('Theorem 3: converges up to, diverges from gamma (1+L)/2', 'closed: 1', ends)
    row('gamma_2 (1+L)/2', '', lambda name: '%.3g' % (1/(1 + iteration[name]['L'])))
    row('steps to 1e-9 with gamma = 2/(2+L) (by q)', '', steps('best'))
    row('steps to 1e-9 with gamma = 1/(1+L)^2 (by q)', '', steps('limit_of_paper'))
    row('`error_bound` over true error', '>= 1', span(4, 'bound over error'))
    for scheme in measured['schemes']:
        key = 'bound over error, scheme ' + scheme
        row('the same, scheme %s, theta 1e-4 to 1' % scheme, '>= 1',
            lambda name: '%.4g to %.3g' % found[key][:2] if name == 'open wave' else '')
    row('(41) over true error', '>= 1', span(3, '(41) over error'))
    row('L of the program over the exact one', '1 to 1.05', lambda name: '%.3f' % found[
        ('L over exact L, ' if name == 'column' else 'L over measured L, ') + name][0])
    row('mesh sizes', '', on_meshes('fixed theta', '%.3g', 'h'))
    row('L, theta fixed', 'constant', on_meshes('fixed theta', '%.4g', 'lambda_max'))
    row('steps to 1e-6, theta fixed', 'constant', on_meshes('fixed theta', '%d', 'iterations'))
    row('L, theta as h', '1/h', on_meshes('theta as h', '%.4g', 'lambda_max'))
    row('steps to 1e-6, theta as h', '1/h', on_meshes('theta as h', '%d', 'iterations'))
    row('two ways to the true error differ by', '0', span(1, 'deviation of two ways to the error'))
    return '\n'.join(text) + '\n'


# Okabe and Ito: told apart by everyone
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, BLACK = '#0072B2', '#E69F00', '#009E73', '#D55E00', '#CC79A7', '#56B4E9', '#000000'


def draw(measured, path):
    """Four panels."""
    import matplotlib
    matplotlib.use('Agg')
    import matplotlib.pyplot as plt
    import matplotlib.ticker
    from PIL import Image
    plt.rcParams.update({'font.size': 10, 'axes.titlesize': 11, 'legend.fontsize': 8.5, 'legend.framealpha': 0.9,
                         'axes.grid': True, 'grid.color': '0.88', 'axes.axisbelow': True, 'lines.markersize': 5.5})
    figure, ((one, two), (three, four)) = plt.subplots(2, 2, figsize=(11.5, 9), constrained_layout=True)

    labels = {'column': 'column: flat faces, zone stays', 'wave': r'wavy surface: zone grows with $\theta$',
              'ball': 'ball on a block (3d)', 'sharp punch': 'sharp punch: infinite pressure at its edge'}
    for (name, penalty), colour, marker in zip(measured['penalty'].items(), (BLUE, ORANGE, GREEN, RED), 'os^D'):
        theta, error = (np.array([row[key] for row in penalty['rows']]) for key in ('theta_relative', 'error'))
        same = np.array([row['active'] == penalty['active'] for row in penalty['rows']])
        one.loglog(theta, error, '-', color=colour, lw=1)
        one.loglog(theta[same], error[same], marker, color=colour, label=labels[name])
        one.loglog(theta[~same], error[~same], marker, color=colour, mfc='white')
    x = np.array([1e-6, 1e-2])
    one.loglog(x, 0.25*x, '--', color=BLACK, lw=1, label='slope 1')
    if 'sharp punch' in measured['penalty']:
        x = np.array([1e-6, 1e-4])
        row = min(measured['penalty']['sharp punch']['rows'], key=lambda row: abs(row['theta_relative'] - 3e-5))
        one.loglog(x, 14*row['error']*(x/row['theta_relative'])**singular_exponent(), ':', color=BLACK, lw=1.3,
                   label='slope %.3f' % singular_exponent())
    one.set(xlabel=r'$\theta$ / (size/E of the two bodies)', ylim=(1e-7, 3),
            ylabel=r'$\Vert u_\theta - u_0 \Vert_A \,/\, \Vert u_0 \Vert_A$',
            title='Theorem 1: error of the penalty\n(hollow: not the contact zone of $\\theta = 0$)')
    one.legend(loc='lower right')

    closed = measured['iteration']['closed wave']
    lambda_max, limit = closed['L'], closed['limit']
    gamma = np.linspace(0, 1.25*limit, 400)
    two.plot(gamma, factor(gamma, lambda_max), '-', color=BLACK, lw=1.5, label=r'$q = \max(|1-\gamma|, |1-\gamma(1+L)|)$')
    inside = np.linspace(0, closed['limit_of_paper'], 100)
    two.plot(inside, factor_of_paper(inside, lambda_max), '--', color=PURPLE, lw=2, label=r'(40), $\gamma < \gamma_2$')
    for name, colour, marker, label in (('open wave', ORANGE, 's', 'wavy surface, partly open'),
                                        ('closed wave', BLUE, 'o', 'wavy surface, all points closed')):
        rows = [row for row in measured['iteration'][name]['rows'] if row['gamma'] <= gamma[-1]]
        gammas, factors = (np.array([row[key] for row in rows]) for key in ('gamma', 'largest'))
        ends = np.array([row['diverged'] for row in rows])
        two.plot(gammas[~ends], factors[~ends], marker, color=colour, label=label)
        if ends.any():
            two.plot(gammas[ends], factors[ends], 'X', color=RED, ms=8, label='the latter, diverges, as the program says')
    two.axvspan(limit, gamma[-1], color='0.93', zorder=0)
    for x, text in ((closed['limit_of_paper'], r'$\gamma_2$'), (closed['best'], r'$\frac{2}{2+L}$'), (limit, r'$\frac{2}{1+L}$')):
        two.axvline(x, ymax=0.7, color='0.5', lw=0.8, ls=':')
        two.text(x, 0.03, ' ' + text, va='bottom', fontsize=12)
    two.set(xlim=(0, gamma[-1]), ylim=(0, 2.2), xlabel=r'$\gamma$', ylabel='largest factor of a step on the true error',
            title='Theorems 3 and 4: factor of a step, L = %.3g' % lambda_max)
    two.legend(loc='upper left')

    iteration = measured['iteration']['open wave']
    best = min(iteration['rows'], key=lambda row: abs(row['gamma'] - iteration['best']))
    theory = min(iteration['rows'], key=lambda row: abs(row['gamma'] - iteration['limit_of_paper']/2))
    for row, colour, marker, text in ((theory, BLUE, 'o', '1/(1+L)^2'), (best, ORANGE, 's', '2/(2+L)')):
        k = row['steps']
        show = k <= 31
        k, scale = k[show], iteration['norm']
        three.semilogy(k, row['errors'][show]/scale, '-' + marker, color=colour, lw=1, label=r'true error, $\gamma = %s$' % text)
        three.semilogy(k, row['bounds'][show]/scale, '--', color=colour, lw=1.6, label='its error_bound')
        if np.isfinite(row['bounds_of_paper']).any():
            three.semilogy(k, row['bounds_of_paper'][show]/scale, ':', color=PURPLE, lw=2.2, label='its bound (41)')
    three.set(xlabel='step k', ylabel=r'$\Vert u^k - u_\theta \Vert_A \,/\, \Vert u_\theta \Vert_A$',
              title='Bounds and true error, wavy surface, partly open')
    three.legend(loc='lower left')

    styles = {'wave, fixed theta': (BLUE, 'o', r'wavy surface, $\theta$ fixed'),
              'wave, theta as h': (RED, 'D', r'wavy surface, $\theta \sim h$'),
              'ball, fixed theta': (GREEN, '^', r'ball, $\theta$ fixed')}
    for name, rows in measured['meshes'].items():
        colour, marker, text = styles[name]
        # the coarsest mesh of each scene is 1
        size = np.array([rows[0]['h']/row['h'] for row in rows])
        four.loglog(size, [row['iterations'] for row in rows], '-' + marker, color=colour, lw=1.2, label='steps, ' + text)
        four.loglog(size, [row['lambda_max'] for row in rows], '--' + marker, color=colour, mfc='white', lw=1.2,
                    label='L, ' + text)
    last = measured['meshes']['wave, theta as h'][-1]
    x = np.array([1, measured['meshes']['wave, theta as h'][0]['h']/last['h']])
    four.loglog(x, 0.6*last['iterations']*x/x[-1], ':', color=BLACK, lw=1.3, label='slope 1')
    four.set_xticks([1, 2, 4, 8], ['h', 'h/2', 'h/4', 'h/8'])
    four.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    four.set(ylim=(5, 4e4), xlabel='element size', ylabel='steps to 1e-6 (full), and L (hollow)',
             title='What depends on the mesh')
    four.legend(loc='upper left', ncol=2)
    figure.savefig(path, dpi=100)
    plt.close(figure)
    # few colours: a third of the size
    Image.open(path).convert('RGB').quantize(256, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)


def main():
    """Parse, measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--dotyk', default=os.path.join(ROOT, 'build/release/dotyk'), help='the program')
    parser.add_argument('--quick', action='store_true', help='fewer points, and no 3d scene')
    parser.add_argument('--figure', default='theory.png', help='picture to write (theory.png)')
    parser.add_argument('--table', help='file for the table; default: the terminal')
    options = parser.parse_args()
    if not os.access(options.dotyk, os.X_OK):
        sys.exit('theory: %s is not there; build the program, or name it with --dotyk' % options.dotyk)
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        measured = measure(os.path.abspath(options.dotyk), folder, options.quick,
                           lambda text: print('%5.0f s  %s' % (time.monotonic() - start, text), file=sys.stderr, flush=True))
    text = table(measured) + '\n' + general_iteration.table(measured['general'])
    if options.table:
        with open(options.table, 'w') as file:
            file.write(text)
    else:
        print(text)
    draw(measured, options.figure)
    wrong = contradictions(figures(measured))
    if wrong:
        sys.exit('theory: contradictions\n  ' + '\n  '.join(wrong))


if __name__ == '__main__':
    main()
