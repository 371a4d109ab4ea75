#!/usr/bin/python3
"""Forces on the balls of balls_in_box.vtkhdf against statics: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong.

Pairs are called 'slave - master'. Contact forces alone act on the balls, and each of the 27 balls is in equilibrium on any mesh.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

# 54 pairs of balls, 25 balls at walls and bottom, 9 under the lid.
PAIRS = 88
# The round-off and the tolerance of the scheme, relative to the force on the lid.
BALANCE = 1e-7
LIMITS = {'not converged': 0, 'number of pairs': 0, 'equilibrium of each ball': BALANCE, 'tension': 0}


def errors(path):
    """What is out of balance, relative to the force on the lid, and that force."""
    results, force, tension = dotyk.Results(path), {}, 0.0
    for name, pair in results.pairs.items():
        for body, sign in zip(name.split(' - '), (1, -1)):
            force[body] = force.get(body, 0) + sign*pair.force
        tension = max(tension, -pair.pressure.min())
    lid = np.linalg.norm(force['lid'])
    return {'not converged': float(not results.converged), 'number of pairs': abs(len(results.pairs) - PAIRS),
            'equilibrium of each ball': max(np.abs(force[body]).max() for body in force if body.startswith('ball'))/lid,
            'tension': tension}, lid


if __name__ == '__main__':
    default = os.path.join(FOLDER, 'balls_in_box.vtkhdf')
    e, lid = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('force on the lid %.2f N' % lid)
    for name, error in e.items():
        print('%-28s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
