#!/usr/bin/python3
"""Lame's pressure of the fit, and the equilibrium of conrod.vtkhdf: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

# As in conrod.nml, conrod.geo.
OVERLAP, INNER, JOINT, EYE, THICK = 0.01, 10.0, 12.0, 18.0, 9.0
STEEL, BRONZE = (210e3, 0.3), (110e3, 0.34)
PIN = {'fitted': 0.0, 'pulled': -120.0, 'pushed': 200.0}

LIMITS = {
    'not converged': 0.5,
    # The small end is a ring but for the shank, which stiffens it.
    'mean pressure of the fit': 0.01,
    # Facets of the bore are parabolas.
    'force of the pin': 1e-4,
    # Forces are in equilibrium to the round-off of the solver, whatever the mesh.
    'equilibrium of the bush': 1e-8,
    'equilibrium of the rod': 1e-8,
}


def lame():
    """Pressure of a press fit of two rings in plane stress."""
    bush = (JOINT**2 + INNER**2)/(JOINT**2 - INNER**2) - BRONZE[1]
    rod = (EYE**2 + JOINT**2)/(EYE**2 - JOINT**2) + STEEL[1]
    return OVERLAP/JOINT/(bush/BRONZE[0] + rod/STEEL[0])


def errors(path):
    """What is wrong, relative to the pressure or the force of the pin, and for each case the fraction of the joint that is closed and its
    greatest pressure."""
    results = dotyk.Results(path)
    e = dict.fromkeys(LIMITS, 0.0)
    state = {}
    for case, pressure in PIN.items():
        now = results.case(case)
        fit = now.pairs['fit']
        pin = pressure*INNER*THICK*np.pi/4
        reaction = now.supports['force']
        at_rod = np.array([name.startswith('rod:') for name in now.supports['names'].splitlines()])
        load = now.loads['force'].sum(0)
        size = max(abs(pin), np.abs(fit.force).max())
        e['not converged'] = max(e['not converged'], float(not now.converged))
        if case == 'fitted':
            mean = -fit.force[1]/(2*JOINT*THICK)
            e['mean pressure of the fit'] = abs(mean/lame() - 1)
        else:
            e['force of the pin'] = max(e['force of the pin'], abs(load[0]/pin - 1))
        bush = load + fit.force + reaction[~at_rod].sum(0)
        rod = reaction[at_rod].sum(0) - fit.force
        e['equilibrium of the bush'] = max(e['equilibrium of the bush'], np.abs(bush).max()/size)
        e['equilibrium of the rod'] = max(e['equilibrium of the rod'], np.abs(rod).max()/size)
        weight = fit.weight
        state[case] = (weight[fit.pressure > 0].sum()/weight.sum(), fit.pressure.max())
    return e, state


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else os.path.join(FOLDER, 'conrod.vtkhdf')
    e, state = errors(path)
    print('pressure of rings %.2f MPa' % lame())
    for case, (closed, peak) in state.items():
        print('%-10s %3.0f %% of the joint is closed, peak pressure %.1f MPa' % (case, 100*closed, peak))
    for name, value in e.items():
        print('%-40s %.2g (limit %g)' % (name, value, LIMITS[name]))
    return int(any(not value <= LIMITS[name] for name, value in e.items()))


if __name__ == '__main__':
    sys.exit(main())
