#!/usr/bin/python3
"""How far hertz.vtkhdf and fine.vtkhdf are from Hertz's theory: check.py [results file ...]. Needs h5py and numpy. Exit code 1: wrong.

The contact radius is 2.5 times the mean square of the distance from the axis, weighted by the pressure; the peak pressure is the force
within half of it, over what it is for a peak of 1 (dotyk.contact_surface: all rows count, and the force on each is compared with
that of the exact pressure, as vertices at the rim carry a mean). `estimator_error` is what this makes of the exact pressure.
(A fit of p^2 over r^2 at the vertices within 0.9 a, where p is the nearest broken line to the exact pressure, gives an a that is
2.8 % too large with 5 elements over a: that is an error of the fit, not of the pressure.)
"""
import os
import sys

import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
from dotyk import contact_surface  # noqa: E402

YOUNG, POISSON, RADIUS = 210e9, 0.3, 0.01  # as in hertz.nml and hertz.geo
SYMMETRY = 4  # a quarter is computed

# The theory: with an axisymmetric mesh of 160 elements over a, a and p0 differ from Hertz's by +0.02 and -0.09 % at a/R = 0.055, by
# +0.02 and -0.05 % at a/R = 0.0275 (inputs/hertz_axisymmetric). The mesh: on seven meshes with 8 to 11 elements over a, errors of a
# between -0.13 and +0.01 % and of p0 between -0.01 and -0.08 %; `fine` and four like it with 12 to 20: -0.02 to +0.01 %, -0.01 to
# -0.04 %. The pressure is a broken line that ends as a square root: 3.4 % in the mean square with 8 elements, 1.5 % with 20.
LIMITS = {'hertz': {'a_error': 3e-3, 'p0_error': 2e-3, 'profile_error': 0.04, 'estimator_error': 5e-4},
          'fine': {'a_error': 1e-3, 'p0_error': 1e-3, 'profile_error': 0.025, 'estimator_error': 2e-4}}


def errors(path):
    """Contact radius a and peak pressure p0 of the results, and Hertz's for the same force."""
    surface = contact_surface.ContactSurface(path, 'touch')
    force = SYMMETRY*abs(surface.force[2])
    stiffness = YOUNG/(1 - POISSON**2)/2
    a_hertz = (3*force*RADIUS/(4*stiffness))**(1/3)
    p_hertz = 3*force/(2*np.pi*a_hertz**2)

    def exact(x):
        return p_hertz*contact_surface.hertz_profile(contact_surface.distance(surface, x)/a_hertz)

    a, p0 = contact_surface.hertz_radius_and_peak(surface, surface.pressure)
    found = contact_surface.hertz_radius_and_peak(surface, surface.means(exact))
    profile = exact(surface.position)
    return {'a': a, 'a_hertz': a_hertz, 'a_error': a/a_hertz - 1, 'p0': p0, 'p0_hertz': p_hertz, 'p0_error': p0/p_hertz - 1,
            'a/R': a_hertz/RADIUS, 'force': force, 'converged': surface.converged,
            'estimator_error': max(abs(found[0]/a_hertz - 1), abs(found[1]/p_hertz - 1)),
            'profile_error': np.sqrt(np.sum(surface.weight*(surface.projected - profile)**2)/np.sum(surface.weight*profile**2))}


def report(path, limits):
    """Print the errors; whether they are beyond the limits."""
    e = errors(path)
    print('%s: force %.6g N, a/R = %.4f' % (os.path.basename(path), e['force'], e['a/R']))
    print('contact radius  %.6g m, Hertz %.6g m, error %+.3f %%' % (e['a'], e['a_hertz'], 100*e['a_error']))
    print('peak pressure   %.6g Pa, Hertz %.6g Pa, error %+.3f %%' % (e['p0'], e['p0_hertz'], 100*e['p0_error']))
    print('pressure in the mean square: error %.2f %%' % (100*e['profile_error']))
    print('of the exact pressure on this mesh both are right to %.3f %%' % (100*e['estimator_error']))
    wrong = not e['converged'] or any(abs(e[name]) > limit for name, limit in limits.items())
    print('WRONG' if wrong else 'as exact as can be expected')
    return wrong


if __name__ == '__main__':
    paths = sys.argv[1:] or [path for path in (os.path.join(FOLDER, name + '.vtkhdf') for name in LIMITS) if os.path.exists(path)]
    if not paths:
        sys.exit('no results: tools/run.sh inputs/hertz/hertz.nml makes them')
    sys.exit(any([report(path, LIMITS['fine' if 'fine' in os.path.basename(path) else 'hertz']) for path in paths]))
