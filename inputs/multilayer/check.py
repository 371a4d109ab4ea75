#!/usr/bin/python3
"""Statics, signs and penalty law in multilayer.vtkhdf: check.py [results file]. Exit code 1: wrong.

Needs h5py and numpy."""
import os
import sys
import h5py
import numpy as np

LOAD = 50e6*0.01         # pressure times half the patch, as in multilayer.nml and multilayer.geo

# The displacements of every iterate belong to its pressures: forces balance to round-off, whatever mesh and tolerance.
BALANCE = 1e-9
# Pressure against penetration over theta, mean square: some ten times the tolerance of 1e-6, as 1/theta magnifies errors of
# displacements.
PENALTY = 5e-5


def shear_force(grid, body):
    """Vertical force of a layer on its grip: sigma_xy in the elements next to it, on which no row is closed.

    Exact: the virtual displacement is 1 up to these elements and falls to 0 over them."""
    entries, cells, nodes = (np.concatenate([[0], np.cumsum(grid['NumberOf' + name][:])])
                             for name in ('ConnectivityIds', 'Cells', 'Points'))
    corners = grid['Connectivity'][entries[body]:entries[body + 1]].reshape(cells[body + 1] - cells[body], -1)[:, :4]
    x, y = np.moveaxis(grid['Points'][nodes[body]:nodes[body + 1], :2][corners], -1, 0)
    stress = grid['CellData/stress'][cells[body]:cells[body + 1], 3]
    last = np.max(x, axis=1) > np.max(x)*(1 - 1e-9)
    return np.sum(stress[last]*np.ptp(y[last], axis=1))


def errors(path):
    """What is out of balance relative to the load, what is wrong at single rows, and the figures of each joint."""
    e = {'layers': 0.0, 'tension': 0.0, 'force along the joints': 0.0}
    figures = []
    with h5py.File(path) as file:
        e['not converged'] = 1 - file['dotyk/summary'].attrs['converged']
        grid = file['VTKHDF']
        layers = len(grid['NumberOfPoints'])
        below, misfit, size = 0.0, 0.0, 0.0
        for k in range(layers):
            above = LOAD
            if k + 1 < layers:
                joint = file['dotyk/contact/joint %d' % (k + 1)]
                x = joint['position'][:, 0]
                w, p, gap, theta = (joint[key][:] for key in ('weight', 'pressure', 'gap', 'theta'))
                above = np.sum(w*p)
                e['tension'] = max(e['tension'], -p.min()/p.max())
                e['force along the joints'] = max(e['force along the joints'], abs(joint.attrs['force'][0])/LOAD)
                misfit += np.sum(w*(p - np.maximum(0, -gap)/theta)**2)
                size += np.sum(w*p**2)
                figures.append({'force': above, 'peak': joint['pressure_projected'][:].max(), 'zones': zones(x, gap < 0),
                                'closed': np.sum(w[gap < 0])/np.sum(w)})
            e['layers'] = max(e['layers'], abs(above - below - shear_force(grid, k))/LOAD)
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
    default = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'multilayer.vtkhdf')
    e, figures = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    for k, figure in enumerate(figures):
        print('joint %d: %4.1f %% of the load, peak pressure %.3g Pa, %2.0f %% closed: %s mm' % (
            k + 1, 100*figure['force']/LOAD, figure['peak'], 100*figure['closed'],
            ', '.join('%.1f to %.1f' % (1e3*first, 1e3*last) for first, last in figure['zones'])))
    for name, error in e.items():
        print('%-28s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
