#!/usr/bin/python3
"""How far column.vtkhdf is from the exact solution of the penalty problem: check.py [results file]. Needs h5py and numpy."""
import os
import sys
import h5py
import numpy as np

SHORTENING = 1e-3                                # as in column.nml; each cube is 1 m high
MATERIALS = [(210e9, 0.3), (30e9, 0.2)]          # (Young's modulus, Poisson's ratio)


def errors(path):
    """Pressure of the joint, and the exact one: uniform."""
    with h5py.File(path) as file:
        contact = file['dotyk/contact/joint']
        w, p = contact['weight'][:], contact['pressure_projected'][:]
        theta = contact.attrs['theta']
    compliance = sum((1 + v)*(1 - 2*v)/(E*(1 - v)) for E, v in MATERIALS)
    exact = SHORTENING/(compliance + theta)
    mean = np.sum(w*p)/np.sum(w)
    return {'mean': mean, 'exact': exact, 'mean_error': mean/exact - 1, 'largest_error': np.max(np.abs(p/exact - 1))}


if __name__ == '__main__':
    default = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'column.vtkhdf')
    e = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('mean pressure of the joint %.8g Pa, exact %.8g Pa, error %+.1e' % (e['mean'], e['exact'], e['mean_error']))
    print('largest error of the pressure at a point %.1e' % e['largest_error'])
