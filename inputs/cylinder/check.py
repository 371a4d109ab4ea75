#!/usr/bin/python3
"""How far cylinder.vtkhdf is from Hertz's theory: check.py [results file]. Exit code 1: wrong. Needs h5py and numpy."""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

RADIUS, FORCE = 50.0, 920.0                                              # as in cylinder.geo; twice that of cylinder.nml
STIFFNESS = 1/((1 - 0.3**2)/210e3 + (1 - 0.33**2)/70e3)                  # E*

# Measured with 20 elements over b: 5e-4 in b, 6e-5 in p0, 0.6 % in the profile; with 10: 1.3e-3, 6e-4, 1.5 %; with 40: 6e-5, 3e-5,
# 0.3 %. The theory is off by a part of (b/R)^2 = 4e-4 (a parabola for the circle), and by less through the depth of the block.
LIMITS = {'b': 1e-3, 'p0': 3e-3, 'profile': 2e-2, 'force': 1e-9, 'not converged': 0}


def closed_form():
    """Half-width b of the contact and peak pressure."""
    b = np.sqrt(4*FORCE*RADIUS/(np.pi*STIFFNESS))
    return b, 2*FORCE/(np.pi*b)


def errors(path):
    """Relative errors, and what was found beside what is exact."""
    results = dotyk.Results(path)
    contact = results.pairs['touch']
    x, w, p, force = contact.position[:, 0], contact.weight, contact.pressure_projected, 2*abs(contact.force[1])
    b, p0 = closed_form()
    # p^2 = p0^2 (1 - x^2/b^2) is a straight line in x^2
    inside = x < 0.9*b
    slope, square = np.polyfit(x[inside]**2, p[inside]**2, 1, w=np.sqrt(w[inside]))
    found = {'b': np.sqrt(-square/slope), 'p0': np.sqrt(square)}
    exact = p0*np.sqrt(np.maximum(0, 1 - x*x/b**2))
    e = {'b': abs(found['b']/b - 1), 'p0': abs(found['p0']/p0 - 1),
         'profile': np.sqrt(np.sum(w*(p - exact)**2)/np.sum(w*exact**2)),
         'force': abs(force/FORCE - 1), 'not converged': float(not results.converged)}
    return e, {'b': (found['b'], b), 'p0': (found['p0'], p0)}


if __name__ == '__main__':
    default = os.path.join(FOLDER, 'cylinder.vtkhdf')
    e, figures = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    for name, (found, exact) in figures.items():
        print('%-14s found %.6g, exact %.6g, %+.3f %%' % (name, found, exact, 100*(found/exact - 1)))
    print('b/R = %.3f' % (figures['b'][1]/RADIUS))
    for name, error in e.items():
        print('%-14s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
