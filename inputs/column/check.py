#!/usr/bin/python3
"""How far column.vtkhdf is from the exact solution of the penalty problem: check.py [results file]. Exit code 1: wrong.

Needs h5py and numpy.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

SHORTENING = 1e-3                                # as in column.nml; each cube is 1 m high
MATERIALS = [(30e9, 0.2), (210e9, 0.3)]          # lower, upper: Young's modulus, Poisson's ratio
THETA_RELATIVE = 1e-2

# The faces of the two meshes cut each other; the points lie on the pieces, and only round-off remains.
LIMITS = {'mean_error': 1e-11, 'largest_error': 1e-11}


def pressure(theta=None):
    """The uniform pressure of the joint."""
    theta = THETA_RELATIVE*sum(1/young for young, _ in MATERIALS) if theta is None else theta
    return SHORTENING/(sum((1 + v)*(1 - 2*v)/(E*(1 - v)) for E, v in MATERIALS) + theta)


def exact_stress(x, y, z=None, body=None, theta=None):
    """Stresses xx yy zz xy yz xz, 6 rows; body 1 is the lower one."""
    poisson = MATERIALS[body - 1][1]
    aside = -poisson/(1 - poisson)*pressure(theta)
    return np.array([aside, aside, -pressure(theta), 0, 0, 0])[:, None]*np.ones(np.shape(x))


def errors(path):
    """Pressure of the joint, and the exact one: uniform."""
    joint = dotyk.Results(path).pairs['joint']
    w, p = joint.weight, joint.pressure_projected
    exact = pressure(joint.attributes['theta'])
    mean = np.sum(w*p)/np.sum(w)
    return {'mean': mean, 'exact': exact, 'mean_error': mean/exact - 1, 'largest_error': np.max(np.abs(p/exact - 1))}


if __name__ == '__main__':
    default = os.path.join(FOLDER, 'column.vtkhdf')
    e = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('mean pressure of the joint %.8g Pa, exact %.8g Pa, error %+.1e' % (e['mean'], e['exact'], e['mean_error']))
    print('largest error of the pressure at a point %.1e' % e['largest_error'])
    sys.exit(any(abs(e[name]) > limit for name, limit in LIMITS.items()))
