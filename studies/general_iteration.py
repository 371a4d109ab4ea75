"""The general iteration (32) with several G, measured: part of studies/theory.py.

Three layers with two joints: G = A (scheme='neumann'), and Robin conditions on all points, on those with a small gap, and on
one joint of two (scheme='robin'). The numbers of Theorems 3 and 4 are those of the results files.
"""
import numpy as np
from theory_scenes import Scene, distance, layers

#: gap up to which points have Robin conditions in the third G, over its amplitude: half of the points
ROBIN_GAP = 1.0
STEPS = (1, 2, 3, 4, 7, 8, 15, 16)


def choices(program, folder, name, divisions, amplitude):
    """Name of G -> (scene, keys of &solver); and the scene for other schemes."""
    plain = Scene(program, folder, name, *layers(divisions, amplitude))
    mixed = Scene(program, folder, name + ', mixed', *layers(divisions, amplitude, mixed=True))
    return plain, {'G = A': (plain, {'scheme': 'neumann'}),
                   'Robin, all points': (plain, {'scheme': 'robin'}),
                   'Robin, some points': (plain, {'scheme': 'robin', 'robin_gap': ROBIN_GAP*amplitude}),
                   'Robin, one joint of two': (mixed, {'scheme': 'robin'})}


def measure_gamma(scene, keys, reference, gamma, steps):
    """Factors of steps in the norm of G, and bounds over the true error, with one gamma."""
    def run(most, tolerance):
        return scene.run(gamma=gamma, max_iterations=most, tolerance=tolerance, **keys)
    whole = run(20000, 1e-9)
    n = int(whole.summary['iterations'])
    row = {'gamma': gamma, 'iterations': n, 'q': float(whole.summary['q_predicted']),
           'q_of_paper': float(whole.summary['q_paper']), 'converged': bool(whole.summary['converged']),
           'diverged': whole.code == 1 and 'diverged' in whole.text, 'warned': 'may diverge' in whole.text}
    lengths, row['bounds'], row['bounds_of_paper'] = {}, [], []
    for k in steps:
        one = run(k, 1e-15)
        if one.summary['iterations'] < k:
            break
        norm, error = one.norm(), distance(one, reference)
        # Increments and bounds are relative to the norm of the iterate: 0 where its mean pressures are, bodies being moved only.
        if norm < 1e-6*reference.norm():
            continue
        lengths[k] = one.history['increment'][-1]*norm
        if error < 1e-9*norm:
            break
        row['bounds'].append(one.summary['error_bound']*norm/error)
        row['bounds_of_paper'].append(one.history['error_bound_paper'][-1]*norm/error)
    factors = [lengths[k + 1]/lengths[k] for k in lengths if k + 1 in lengths]
    # Later the norm of the iterate, to which the increments of the history are relative, has settled.
    late = whole.history['increment']
    late = late[(late < 1e-4) & (late > 1e-8)]
    row['late'] = float((late[1:]/late[:-1]).max()) if len(late) > 1 else np.nan
    row['largest'] = float(max(factors, default=np.nan))
    return row


def constants_of(run):
    """What the results file says, and gamma_2 and the best q again from B, D and Lambda, M = B~ = M~ = 1 (Theorems 3 and 4)."""
    found = {name: float(run.summary[name]) for name in ('coercivity', 'penalty_constant', 'smoothness', 'gamma_limit', 'gamma_2',
                                                         'gamma_theory', 'q_theory')}
    m_star = 1 + found['penalty_constant']
    found['gamma_2 again'] = 2*found['coercivity']/m_star**2
    found['q_theory again'] = np.sqrt(1 - found['coercivity']**2/m_star**2)
    found['best'] = 2/(found['coercivity'] + found['smoothness'])
    return found


def measure(program, folder, quick, progress):
    """All measurements: scene -> G -> values."""
    measured = {}
    divisions = 10 if quick else 20
    for name, amplitude in (('open layers', 0.006), ('closed layers', 0.0004)):
        progress('%s: the general iteration' % name)
        plain, forms = choices(program, folder, name, divisions, amplitude)
        reference = plain.run(scheme='dual', theta_relative=1.0, tolerance=1e-12)
        measured[name] = {'closed': float(np.mean(reference.y > 0)), 'forms': {}}
        for form, (scene, keys) in forms.items():
            keys = {**keys, 'theta_relative': 1.0}
            constants = constants_of(scene.run(max_iterations=1, tolerance=1e-15, **keys))
            limit = constants['gamma_limit']
            gammas = {constants['gamma_theory'], constants['best'], 0.99*limit, 1.1*limit}
            if not quick:
                gammas |= {0.1*constants['gamma_2'], 0.97*constants['gamma_2'], 0.25*limit, 0.5*limit, 0.75*limit, 0.9*limit, 1.03*limit, 1.5*limit}
            rows = [measure_gamma(scene, keys, reference, gamma, STEPS[:3] if quick else STEPS) for gamma in sorted(gammas)]
            measured[name]['forms'][form] = {'constants': constants, 'rows': rows}
    return measured


def figures(measured):
    """Figures by name: least, largest, and what the theory allows, [low, high] (None: no limit)."""
    found = {}

    def add(name, values, low, high):
        values = [value for value in values if not np.isnan(value)]
        found[name] = min(values), max(values), low, high
    for scene, values in measured.items():
        for form, one in values['forms'].items():
            name, constants, rows = '%s, %s' % (scene, form), one['constants'], one['rows']
            add('gamma_2 of the file, ' + name, [constants['gamma_2']/constants['gamma_2 again']], 1 - 1e-12, 1 + 1e-12)
            add('q of the file, ' + name, [constants['q_theory']/constants['q_theory again']], 1 - 1e-12, 1 + 1e-12)
            inside = [row for row in rows if row['gamma'] < constants['gamma_2']]
            below = [row for row in rows if row['gamma'] < constants['gamma_limit']]
            add('step over (40), ' + name, [row['largest']/row['q_of_paper'] for row in inside], 0, 1 + 1e-6)
            add('step over q, ' + name, [row['largest']/row['q'] for row in rows], 0, 1 + 1e-6)
            add('late step over q, ' + name, [row['late']/row['q'] for row in below], 0, 1 + 1e-3)
            add('not converged, ' + name, [sum(not row['converged'] for row in below)], 0, 0)
            add('not warned, ' + name, [sum(not row['warned'] for row in rows if row not in below)], 0, 0)
            add('bound over error, ' + name, np.concatenate([row['bounds'] for row in rows]), 1 - 1e-6, None)
            add('(41) over error, ' + name, np.concatenate([row['bounds_of_paper'] for row in inside]), 1 - 1e-6, None)
            if values['closed'] == 1:
                # All points stay closed: the limit is sharp, but for the margin of Lambda.
                beyond = [row for row in rows if row['gamma'] > 1.025*constants['gamma_limit']]
                add('not diverged, ' + name, [sum(not row['diverged'] for row in beyond)], 0, 0)
                last = below[-1]
                add('Lambda over measured, ' + name, [constants['smoothness']/((1 + last['late'])/last['gamma'])], 1, 1.05)
    return found


def table(measured):
    """The table in Markdown: a column for each G."""
    forms = list(next(iter(measured.values()))['forms'])
    found = figures(measured)
    text = ['| | theory | %s |' % ' | '.join(forms), '|---|---|%s' % ('---:|'*len(forms))]
    first = next(iter(measured))

    def row(title, theory, cell):
        text.append('| %s | %s | %s |' % (title, theory, ' | '.join(cell(form) for form in forms)))

    def constant(key, digits=3):
        return lambda form: '%.*g' % (digits, measured[first]['forms'][form]['constants'][key])

    def at(key, value, format_):
        def cell(form):
            one = measured[first]['forms'][form]
            nearest = min(one['rows'], key=lambda row: abs(row['gamma'] - one['constants'][key]))
            return format_ % value(nearest)
        return cell

    def span(title):
        def cell(form):
            values = [found['%s, %s, %s' % (title, scene, form)] for scene in measured]
            return '%.3g to %.3g' % (min(value[0] for value in values), max(value[1] for value in values))
        return cell

    row('$B$, coercivity of $A$', '', constant('coercivity'))
    row('$D$, bound of the penalty', '', constant('penalty_constant'))
    row('$\\Lambda$, sharp bound of both', '', constant('smoothness'))
    row('$\\gamma_2 = 2B/(1+D)^2$', '', constant('gamma_2'))
    row('$2/\\Lambda$', '', constant('gamma_limit'))
    row('iterations to 1e-9, $\\gamma = \\gamma_2/2$', '', at('gamma_theory', lambda row: row['iterations'], '%d'))
    row('q of (40) there', '', constant('q_theory', 5))
    row('factor measured there', 'at most that q', at('gamma_theory', lambda row: np.nanmax([row['largest'], row['late']]), '%.5g'))
    row('iterations to 1e-9, best gamma by $\\Lambda$', '', at('best', lambda row: row['iterations'], '%d'))
    row('step over (40), all $\\gamma < \\gamma_2$', 'at most 1', span('step over (40)'))
    row('step over the sharp q, all gamma', 'at most 1', span('step over q'))
    row('(41) over the true error', 'at least 1', span('(41) over error'))
    row('`error_bound` over the true error', 'at least 1', span('bound over error'))
    closed = [name for name in measured if measured[name]['closed'] == 1]
    for scene in closed:
        row('$\\Lambda$ over the measured one, all points closed', '1 to 1.05',
            lambda form: '%.3f' % found['Lambda over measured, %s, %s' % (scene, form)][0])
    return '\n'.join(text) + '\n'
