#!/usr/bin/python3
"""Statics, signs and penalty law in multilayer.vtkhdf: check.py [results file]. Exit code 1: wrong.

Needs h5py and numpy."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

LOAD = 50e6*0.01         # pressure times half the patch, as in multilayer.nml and multilayer.geo

# The displacements of every iterate belong to its pressures: forces balance to round-off, whatever mesh and tolerance.
BALANCE = 1e-9
# Pressure against penetration over theta, mean square: some ten times the tolerance of 1e-6, as 1/theta magnifies errors of
# displacements.
PENALTY = 5e-5


def shear_force(layer):
    """Vertical force of a layer on its grip: sigma_xy in the elements next to it, on which no row is closed.

    Exact: the virtual displacement is 1 up to these elements and falls to 0 over them."""
    x, y = np.moveaxis(layer.nodes[layer.cells[0].nodes[:, :4], :2], -1, 0)
    last = np.max(x, axis=1) > np.max(x)*(1 - 1e-9)
    return np.sum(layer.stress[last, 3]*np.ptp(y[last], axis=1))


def errors(path):
    """What is out of balance relative to the load, what is wrong at single rows, and the figures of each joint."""
    e = {'layers': 0.0, 'tension': 0.0, 'force along the joints': 0.0}
    figures, results = [], dotyk.Results(path)
    e['not converged'] = 1 - results.summary['converged']
    below, misfit, size = 0.0, 0.0, 0.0
    for k, layer in enumerate(results.bodies.values(), 1):
        above = LOAD
        if k < len(results.bodies):
            joint = results.pairs['joint %d' % k]
            w, p, gap = joint.weight, joint.pressure, joint.gap
            above = np.sum(w*p)
            e['tension'] = max(e['tension'], -p.min()/p.max())
            e['force along the joints'] = max(e['force along the joints'], abs(joint.force[0])/LOAD)
            misfit += np.sum(w*(p - np.maximum(0, -gap)/joint.theta)**2)
            size += np.sum(w*p**2)
            figures.append({'force': above, 'peak': joint.pressure_projected.max(), 'zones': zones(joint.position[:, 0], gap < 0),
                            'closed': np.sum(w[gap < 0])/np.sum(w)})
        e['layers'] = max(e['layers'], abs(above - below - shear_force(layer))/LOAD)
        below = above
    e['pressure against penetration'] = np.sqrt(misfit/size)
    return e, figures


def zones(x, closed):
    """First and last closed row of each contact zone, from the middle on."""
    order = np.argsort(x)
    x, closed = x[order], np.concatenate([[False], closed[order], [False]])
    return list(zip(x[closed[1:-1] & ~closed[:-2]], x[closed[1:-1] & ~closed[2:]]))


LIMITS = {'layers': BALANCE, 'tension': 0, 'force along the joints': BALANCE, 'not converged': 0,
          'pressure against penetration': PENALTY}

if __name__ == '__main__':
    default = os.path.join(FOLDER, 'multilayer.vtkhdf')
    e, figures = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    for k, figure in enumerate(figures):
        print('joint %d: %4.1f %% of the load, peak pressure %.3g Pa, %2.0f %% closed: %s mm' % (
            k + 1, 100*figure['force']/LOAD, figure['peak'], 100*figure['closed'],
            ', '.join('%.1f to %.1f' % (1e3*first, 1e3*last) for first, last in figure['zones'])))
    for name, error in e.items():
        print('%-28s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
