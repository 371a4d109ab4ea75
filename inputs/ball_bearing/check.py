#!/usr/bin/python3
"""Load distribution and pressures of ball_bearing.vtkhdf against theory: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

LOAD = 3000.0                                        # of the half, as in ball_bearing.nml
YOUNG, POISSON = 210e3, 0.3
BALL, INNER_RACE, OUTER_RACE = 5.5, 21.25, 32.25     # radii as in the geometries
GROOVE = 1.04*BALL
ANGLE = np.radians(45*np.arange(8))                  # of the balls 1 to 8, from the lowest one
EXPONENT = 1.5                                       # point contact: load = stiffness*approach^1.5

# The pressure on the bore is integrated with a few points on each of its curved elements; what the balls are out of balance where
# their rolling is held adds less than a thousandth.
LOAD_ERROR = 1e-3
# The meshes of the rings are not symmetric.
SYMMETRY_ERROR = 0.01
# Relative to the largest load. The distribution is that of stiff rings; these yield.
DISTRIBUTION_ERROR = 0.08
# Two elements over the half-width of the most loaded contact, and a theory of flat half-spaces at a/R = 0.4.
PEAK_ERROR = 0.05
# Spinning and rolling are indeterminate: no ball moves by more than the clearance that the rings' yielding gives it, a tenth of a millimetre.
LARGEST_MOTION = 0.1


def elliptic(m):
    """Complete elliptic integrals K(m) and E(m), by the arithmetic-geometric mean."""
    a, b, c, power, total = 1.0, np.sqrt(1 - m), np.sqrt(m), 0.5, m/2
    while abs(c) > 1e-15:
        a, b, c = (a + b)/2, np.sqrt(a*b), (a - b)/2
        power *= 2
        total += power*c*c
    return np.pi/2/a, np.pi/2/a*(1 - total)


def hertz(load, across, along):
    """Peak pressure of a point contact with these relative curvatures, the larger one first (Johnson, Contact Mechanics, section 4.2)."""
    low, high = 1e-6, 1 - 1e-12
    for _ in range(200):                             # ratio of the half-axes, by bisection
        ratio = np.sqrt(low*high)
        k, e = elliptic(1 - ratio**2)
        low, high = (ratio, high) if (e/ratio**2 - k)/(k - e) > across/along else (low, ratio)
    stiffness = YOUNG/(1 - POISSON**2)/2
    a = (3*load*e/(np.pi*ratio**2*(across + along)*stiffness))**(1/3)
    return 3*load/(2*np.pi*a*a*ratio)


def expected_loads():
    """Loads of the halves of the balls without clearance, in balance with the load."""
    cosine = np.maximum(0, np.cos(ANGLE))
    cosine[cosine < 1e-9] = 0
    share = cosine**EXPONENT
    return LOAD*share/np.sum(share*cosine)


def errors(path):
    """What is wrong, loads of the halves of the balls, peak pressures inside and outside and those of Hertz."""
    results = dotyk.Results(path)
    force = np.array([results.pairs['inner %d' % i].force[:2] for i in range(1, 9)])
    peak = {side: np.array([results.pairs['%s %d' % (side, i)].pressure_projected.max() for i in range(1, 9)])
            for side in ('inner', 'outer')}
    motion = np.linalg.norm(results['displacement'], axis=1).max()
    load = np.linalg.norm(force, axis=1)
    largest = load.max()
    mirrored = np.roll(load[::-1], 1)                # balls 1, 8, 7, ...
    loaded = load > 0.1*largest
    conform = 1/BALL - 1/GROOVE
    exact = {'inner': np.array([hertz(2*q, 1/BALL + 1/INNER_RACE, conform) if q > 0 else 0 for q in load]),
             'outer': np.array([hertz(2*q, 1/BALL - 1/OUTER_RACE, conform) if q > 0 else 0 for q in load])}
    e = {'not converged': float(not results.converged),
         'load': np.abs(force.sum(axis=0) - [0, -LOAD]).max()/LOAD,
         'left against right': (np.abs(load - mirrored)/np.maximum(load, 1e-3*largest)).max(),
         'load distribution': np.abs(load - expected_loads()).max()/largest,
         'peak pressures': max(np.abs(peak[side][loaded]/exact[side][loaded] - 1).max() for side in peak),
         'largest motion': motion}
    return e, load, peak, exact


LIMITS = {'not converged': 0, 'load': LOAD_ERROR, 'left against right': SYMMETRY_ERROR, 'load distribution': DISTRIBUTION_ERROR,
          'peak pressures': PEAK_ERROR, 'largest motion': LARGEST_MOTION}

if __name__ == '__main__':
    default = os.path.join(FOLDER, 'ball_bearing.vtkhdf')
    e, load, peak, exact = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('ball      load  stiff rings   peak pressure inside, Hertz   outside, Hertz')
    for i, expected in enumerate(expected_loads()):
        print('%4d %9.1f %12.1f   %20.0f %6.0f %9.0f %6.0f' % (i + 1, load[i], expected, peak['inner'][i], exact['inner'][i],
              peak['outer'][i], exact['outer'][i]))
    for name, error in e.items():
        print('%-28s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
