#!/usr/bin/python3
"""Bolt loads and equilibrium of flange.vtkhdf: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

PRESSURE, RADIUS, TENSION = 5.0, 30.0, 12e3     # as in flange.nml, flange.geo

LIMITS = {
    'not converged': 0.5,
    # Forces are in equilibrium to the round-off of the solver, whatever the mesh; the pressed disk is a polygon of curved edges.
    'equilibrium of bolts, washers, nuts': 1e-8,
    'equilibrium of the gasket': 1e-8,
    'equilibrium of the cover': 1e-3,
    'tension of the bolts': 1e-8,
    # The meshes of ring and cover have no symmetry; their elements are as large as the bolts.
    'shortenings unlike': 5e-3,
}


def errors(path):
    """How far the bolts are shortened, the load of the gasket, and what is wrong with them, relative to the load of a bolt or the pressure."""
    results = dotyk.Results(path)
    force = {name: pair.force for name, pair in results.pairs.items()}
    chain = np.array([[np.abs(force[pair % ((i,)*pair.count('%'))]) for i in range(1, 9)]
                      for pair in ('head %d - ring', 'nut %d - shank %d', 'nut %d - washer %d', 'washer %d - cover')])
    bolt = chain[0, :, 2]
    shortening = results.record('ties')['shortening']
    gasket = abs(force['cover - gasket'][2])
    pressed = PRESSURE*np.pi*RADIUS**2
    e = {'not converged': float(not results.converged),
         'equilibrium of bolts, washers, nuts': np.abs(chain - chain[0]).max()/bolt.mean(),
         'equilibrium of the gasket': abs(gasket - abs(force['ring - gasket'][2]))/bolt.mean(),
         'equilibrium of the cover': abs(bolt.sum() - gasket - pressed)/pressed,
         'tension of the bolts': np.abs(bolt/TENSION - 1).max(),
         'shortenings unlike': np.abs(shortening/shortening.mean() - 1).max()}
    return e, shortening, gasket


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else os.path.join(FOLDER, 'flange.vtkhdf')
    e, shortening, gasket = errors(path)
    print('bolts shortened by %.4f mm to %.4f mm, gasket %.0f N' % (shortening.min(), shortening.max(), gasket))
    for name, value in e.items():
        print('%-40s %.2g (limit %g)' % (name, value, LIMITS[name]))
    return int(any(not value <= LIMITS[name] for name, value in e.items()))


if __name__ == '__main__':
    sys.exit(main())
