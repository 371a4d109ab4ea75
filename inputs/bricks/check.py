#!/usr/bin/python3
"""Forces and moments of bricks.vtkhdf against statics: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

WEIGHT = 1.7658e-5*240*120*60                             # of a brick, as in bricks.nml and bricks.geo
CENTRE = {'left brick': (170, 60), 'right brick': (500, 75), 'bridging brick': (350, 90)}
# pairs and the sign of the force on surface_a for each brick
PAIRS = {'left brick': {'left bed': 1, 'left bearing': 1}, 'right brick': {'right bed': 1, 'right bearing': 1},
         'bridging brick': {'left bearing': -1, 'right bearing': -1}}
LENGTH = 240


def errors(path):
    """What is out of balance, relative to a brick's weight (and length), and the reactions of the bridging brick."""
    e, force, place, pressure, normal, results = {}, {}, {}, [], [], dotyk.Results(path)
    for name, contact in results.pairs.items():
        p, each = contact.pressure, contact.forces[:, 2]       # upward on body a
        force[name] = contact.force
        place[name] = each @ contact.position[:, :2]/np.sum(each)  # centre of pressure
        pressure.append(p.min()/p.max())
        normal.append(np.abs(force[name][:2]).max()/WEIGHT)
        e['sum of ' + name] = abs(np.sum(each)/force[name][2] - 1)
    e['converged'] = 1 - results.summary['converged']
    for brick, pairs in PAIRS.items():
        e['force on ' + brick] = abs(sum(sign*force[name][2] for name, sign in pairs.items()) - WEIGHT)/WEIGHT
        moment = sum(sign*force[name][2]*(place[name] - CENTRE[brick]) for name, sign in pairs.items())
        e['moment on ' + brick] = np.abs(moment).max()/(WEIGHT*LENGTH)
    e['horizontal force'] = max(normal)
    e['tension'] = max(0, -min(pressure))
    # a beam on two bearings: the lever rule at the centres of pressure
    left, right = -force['left bearing'][2], -force['right bearing'][2]
    x1, x2 = place['left bearing'][0], place['right bearing'][0]
    e['lever rule'] = abs(right/WEIGHT - (CENTRE['bridging brick'][0] - x1)/(x2 - x1))
    return e, {'left': left, 'right': right, 'x1': x1, 'x2': x2}


# Flat surfaces, so that forces and moments of the pressures are exact on any mesh: what is left is the round-off of the solver
# (1e-10 of the largest force) and the tolerance of the scheme.
TOLERANCE = 1e-8

if __name__ == '__main__':
    default = os.path.join(FOLDER, 'bricks.vtkhdf')
    e, reaction = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('weight of a brick %.6f N' % WEIGHT)
    print('bridging brick: %.6f N at x = %.2f mm, %.6f N at x = %.2f mm'
          % (reaction['left'], reaction['x1'], reaction['right'], reaction['x2']))
    for name, error in e.items():
        print('%-28s %.1e%s' % (name, error, '' if error <= TOLERANCE else '   WRONG'))
    sys.exit(any(error > TOLERANCE for error in e.values()))
