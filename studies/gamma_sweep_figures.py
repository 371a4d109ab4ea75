"""Figures of gamma_sweep.py: iterations against gamma, and the contact zones of a package."""
import matplotlib
matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.collections import LineCollection, PolyCollection  # noqa: E402
from PIL import Image  # noqa: E402
from gamma_sweep import LIMIT, THICKNESS, TOLERANCE, most_steps  # noqa: E402
from theory import factor, factor_of_paper  # noqa: E402

# Okabe and Ito: told apart by everyone
BLUE, ORANGE, GREEN, RED = '#0072B2', '#E69F00', '#009E73', '#D55E00'
PURPLE, SKY, BLACK = '#CC79A7', '#56B4E9', '#000000'
SOFT, STIFF = '#e6dccf', '#a9b5c2'
STYLE = {'font.size': 10, 'axes.titlesize': 11, 'legend.fontsize': 9, 'legend.framealpha': 0.95,
         'lines.markersize': 5.5}


def save(figure, path):
    """As a picture of few colours, a third of the size."""
    figure.savefig(path, dpi=100)
    plt.close(figure)
    Image.open(path).convert('RGB').quantize(256, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)


def draw_sweeps(measured, path):
    """Iterations against gamma: left numbers of layers, right penalties."""
    plt.rcParams.update({**STYLE, 'axes.grid': True, 'grid.color': '0.9', 'axes.axisbelow': True})
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 5.4), constrained_layout=True)
    sweeps = [one for one in measured['sweeps'] if one['ratio'] == 3 and one['variant'] != 'quadrature']
    many = [one for one in sweeps if one['theta'] == 1]
    for one, colour, marker in zip(many, (GREEN, SKY, BLUE, PURPLE, RED), 'osD^v'):
        draw_sweep(left, one, RED if one['variant'] else colour, marker,
                   '%d layers%s: L = %.3g' % (one['layers'], ', all rows closed' if one['variant'] else '', one['L']))
    left.set(xscale='linear', xlim=(0, 0.2), ylim=(20, 5000), xlabel=r'$\gamma$',
             ylabel=r'iterations to a relative error bound of $10^{%d}$' % round(np.log10(TOLERANCE)),
             title=r'Number of layers, $\theta_{relative} = 1$')
    mark(left, many[-1], ('best', 'limit'), 23)
    left.legend(loc='upper right')
    one_package = sorted((one for one in sweeps if one['layers'] == 8 and not one['variant']),
                         key=lambda one: -one['theta'])
    for one, colour, marker in zip(one_package, (GREEN, BLUE, ORANGE, PURPLE, BLACK), 'oDs^v'):
        draw_sweep(right, one, colour, marker, r'$\theta_{relative}$ = %g: L = %.3g' % (one['theta'], one['L']))
    right.set(ylim=(10, 5*LIMIT), xlim=(3e-4, 1.5), xlabel=r'$\gamma$', title='Penalty, 8 layers')
    mark(right, one_package[1 if len(one_package) > 1 else 0], ('best_of_paper', 'limit_of_paper', 'best', 'limit'), 12)
    right.plot([], [], '-', color='0.4', lw=1, label='at most, by the sharp q')
    right.plot([], [], '--', color='0.4', lw=1.2, label='at most, by (40)')
    right.legend(loc='upper right')
    save(figure, path)


def draw_sweep(axis, one, colour, marker, label):
    """Measured iterations as points; the most by q as a line, by (40) dashed; crosses: diverged."""
    gamma, steps = (np.array([row[key] for row in one['rows']]) for key in ('gamma', 'iterations'))
    good = np.array([row['converged'] for row in one['rows']])
    axis.loglog(gamma[good], steps[good], marker, color=colour, label=label, zorder=3)
    inside = np.geomspace(gamma[0], 0.9999*one['limit'], 2000)
    axis.loglog(inside, most_steps(factor(inside, one['L']), one['L'], one['start']), '-', color=colour, lw=1)
    inside = np.geomspace(one['best_of_paper']/4, 0.9999*one['limit_of_paper'], 400)
    of_paper = factor_of_paper(inside, one['L'])
    axis.loglog(inside, most_steps(of_paper, one['L'], one['start']), '--', color=colour, lw=1.2)


def mark(axis, one, names, height):
    """The theory's gamma of one package."""
    text = {'best_of_paper': r'$\frac{1}{(1+L)^2}$', 'limit_of_paper': r'$\gamma_2$', 'best': r'$\frac{2}{2+L}$',
            'limit': r'$\frac{2}{1+L}$'}
    for name in names:
        axis.axvline(one[name], color='0.5', lw=0.8, ls=':')
        side = 'right' if name.startswith('best') else 'left'
        axis.text(one[name], height, ' %s ' % text[name], ha=side, va='bottom', fontsize=13)


def draw_zones(measured, path):
    """Left the deformed package with its gaps, right the contact pressures of the joints."""
    plt.rcParams.update({**STYLE, 'axes.grid': False})
    run, exact = measured['example'], measured['exact']
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 7), constrained_layout=True, width_ratios=(1, 1.2))
    draw_package(figure, left, run)
    draw_pressures(right, run, exact)
    save(figure, path)


def draw_package(figure, axis, run, scale=600):
    """Deformed layers; the gap is part of the lower face of each layer. Active rows show their pressure."""
    segments, values = [], []
    for k, (points, displacement, cells) in enumerate(run.bodies):
        x, y = 1e3*(points + scale*displacement).T
        if k > 0:
            # the waves of the lower face, fading towards the upper one
            share = 1 - (points[:, 1]/THICKNESS - k)
            y = y + 1e3*scale*share*1e-6*(1 - np.cos(250*np.pi*points[:, 0]))
        for sign in (-1, 1):
            axis.add_collection(PolyCollection(np.stack([sign*x, y], -1)[cells], lw=0.3,
                                               facecolor=SOFT if k % 2 == 0 else STIFF, edgecolor='face'))
        if k == len(run.bodies) - 1:
            continue
        # the upper face of this layer at the rows of its joint
        face = np.abs(points[:, 1]/THICKNESS - (k + 1)) < 1e-6
        order = np.argsort(points[face, 0])
        joint = run.joints[k]
        rows = np.argsort(joint['x'])
        at = joint['x'][rows]
        px, py = (np.interp(at, points[face, 0][order], value[face][order]) for value in (x, y))
        active, p = joint['gap'][rows] < 0, joint['pressure_projected'][rows]/1e6
        for i in range(len(at) - 1):
            if active[i] and active[i + 1]:
                for sign in (-1, 1):
                    segments.append(((sign*px[i], py[i]), (sign*px[i + 1], py[i + 1])))
                    values.append((p[i] + p[i + 1])/2)
    lines = LineCollection(segments, array=np.array(values), cmap='inferno_r', lw=4, capstyle='butt')
    lines.set_clim(0, max(values))
    axis.add_collection(lines)
    figure.colorbar(lines, ax=axis, label='contact pressure, MPa', shrink=0.6, pad=0.02)
    for k, text in ((0, 'soft'), (1, 'stiff')):
        axis.text(0, 1e3*THICKNESS*(k + 0.42), text, ha='center', va='center', fontsize=9)
    top = 1e3*THICKNESS*len(run.bodies)
    for x in (-9, -4.5, 0, 4.5, 9):
        axis.annotate('', (x, top), (x, top + 6), arrowprops={'arrowstyle': '-|>', 'shrinkA': 0, 'shrinkB': 0})
    axis.plot((-10, 10), (top + 6,)*2, color=BLACK, lw=1)
    axis.text(0, top + 7, '50 MPa', ha='center')
    axis.set_aspect('equal')
    axis.set(xlabel='x, mm', ylabel='y, mm', xlim=(-22, 22), ylim=(-3, top + 12),
             title='Contact zones\n(displacements and gaps times %d)' % scale)


def draw_pressures(axis, run, exact):
    """A profile for every joint, the topmost above."""
    peak = max(joint['pressure_projected'].max() for joint in exact.joints)*1e-6
    distance = 0.6*peak
    styles = ({'color': BLUE, 'lw': 1.5, 'label': r'Neumann scheme, $\theta_{relative} = 0.1$'},
              {'color': RED, 'lw': 1.1, 'ls': '--', 'label': r'dual scheme, $\theta = 0$: no penetration'})
    for k, pair in enumerate(zip(run.joints, exact.joints)):
        axis.axhline(k*distance, color='0.7', lw=0.6)
        axis.text(20.4, k*distance, 'joint %d' % (k + 1), va='center', ha='left', fontsize=9)
        for one, style in zip(pair, styles):
            rows = np.argsort(one['x'])
            x, p = 1e3*one['x'][rows], k*distance + np.maximum(0, one['pressure_projected'][rows])*1e-6
            axis.plot(np.concatenate([-x[::-1], x]), np.concatenate([p[::-1], p]), **(style if k == 0 else {
                name: value for name, value in style.items() if name != 'label'}))
    top = (len(run.joints) - 1)*distance
    bar = top + 0.45*peak
    axis.annotate('', (-18.5, bar), (-18.5, bar + 20), arrowprops={'arrowstyle': '|-|', 'mutation_scale': 4})
    axis.text(-18, bar + 10, '20 MPa', va='center', fontsize=9)
    axis.set(xlabel='x, mm', title='Contact pressures', xlim=(-20, 20), ylim=(-0.1*peak, top + 1.6*peak), yticks=[])
    axis.legend(loc='upper right')
