#!/usr/bin/python3
"""Bolt loads and equilibrium of flange.vtkhdf: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

PRESSURE, RADIUS, TENSION = 5.0, 30.0, 12e3     # as in flange.nml, flange.geo
CASES = 'tightened', 'pressure', 'heat'

LIMITS = {
    'not converged': 0.5,
    # Forces are in equilibrium to the round-off of the solver, whatever the mesh; the pressed disk is a polygon of curved edges.
    'equilibrium of bolts, washers, nuts': 1e-8,
    'equilibrium of the gasket': 1e-8,
    'equilibrium of the cover': 1e-3,
    'tension of the tightened bolts': 1e-8,
    # Locked bolts keep the shortening that they have when tightened.
    'shortening of the locked bolts': 1e-8,
    # The meshes of ring and cover have no symmetry; their elements are as large as the bolts.
    'shortenings unlike': 5e-3,
}


def errors(path):
    """The tension of each bolt and the force on the gasket in each case, and what is wrong with them, relative to the load of a bolt or the
    pressure."""
    results = dotyk.Results(path)
    e = dict.fromkeys(LIMITS, 0.0)
    tension, gasket, shortening = {}, {}, {}
    for case in CASES:
        now = results.case(case)
        force = {name: pair.force for name, pair in now.pairs.items()}
        chain = np.array([[np.abs(force[pair % ((i,)*pair.count('%'))]) for i in range(1, 9)]
                          for pair in ('bolt %d (1) - ring', 'bolt %d (2) - nut %d', 'nut %d - washer %d', 'washer %d - cover')])
        tension[case], shortening[case] = (now.record('ties')[name] for name in ('tension', 'shortening'))
        gasket[case] = abs(force['cover - gasket'][2])
        pressed = PRESSURE*np.pi*RADIUS**2 * (case != 'tightened')
        for name, error in (
                ('not converged', float(not now.converged)),
                # Bolts that bend in the heat touch the flanks of their holes: their axial forces are along z all the same.
                ('equilibrium of bolts, washers, nuts', np.abs(chain[:, :, 2] - tension[case]).max()/TENSION),
                ('equilibrium of the gasket', abs(gasket[case] - abs(force['ring - gasket'][2]))/TENSION),
                ('equilibrium of the cover', abs(tension[case].sum() - gasket[case] - pressed)/(PRESSURE*np.pi*RADIUS**2)),
                ('shortening of the locked bolts', np.abs(shortening[case]/shortening['tightened'] - 1).max()),
                ('shortenings unlike', np.abs(shortening[case]/shortening[case].mean() - 1).max())):
            e[name] = max(e[name], error)
    e['tension of the tightened bolts'] = np.abs(tension['tightened']/TENSION - 1).max()
    return e, tension, gasket


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else os.path.join(FOLDER, 'flange.vtkhdf')
    e, tension, gasket = errors(path)
    for case in CASES:
        print('%-10s bolts %.0f N to %.0f N, gasket %.0f N' % (case, tension[case].min(), tension[case].max(), gasket[case]))
    for name, value in e.items():
        print('%-40s %.2g (limit %g)' % (name, value, LIMITS[name]))
    return int(any(not value <= LIMITS[name] for name, value in e.items()))


if __name__ == '__main__':
    sys.exit(main())
