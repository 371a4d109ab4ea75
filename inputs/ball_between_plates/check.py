#!/usr/bin/python3
"""Both contacts of ball_between_plates.vtkhdf against Hertz: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong.

How contact radius and peak pressure are measured: dotyk.contact_surface, as in inputs/hertz.
"""
import os
import sys

import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402
from dotyk import contact_surface  # noqa: E402

YOUNG, POISSON, RADIUS = 210e9, 0.3, 0.01  # as in ball_between_plates.nml and .geo
SYMMETRY = 4                               # a quarter is computed
LOAD = SYMMETRY*5e6*0.01**2                # on the upper plate

# Forces: equilibrium of the ball and the upper plate holds to the round-off of the solver on any mesh (the loaded face is flat).
FORCE = 1e-10
# Eight elements over the contact radius: a and p0 to -0.07 and -0.07 %; with 10 to -0.05 and -0.07 %, of which the theory's part is
# +0.02 and -0.08 % (a/R = 0.05, inputs/hertz_axisymmetric). The pressure is a broken line on these elements and ends as a square
# root: in the mean square it is wrong by a fraction of element/radius: 6.5, 3.4 and 3.4 % with 5, 8 and 10 elements.
RADIUS_ERROR, PEAK_ERROR, PROFILE_ERROR = 0.003, 0.003, 0.05


def hertz():
    """Contact radius and peak pressure for the load."""
    stiffness = YOUNG/(1 - POISSON**2)/2
    a = (3*LOAD*RADIUS/(4*stiffness))**(1/3)
    return a, 3*LOAD/(2*np.pi*a**2)


def contact_errors(path, name):
    """Contact radius and peak pressure of one contact, and their errors. The ball is the second body."""
    surface = contact_surface.ContactSurface(path, name, 1)
    a, p0 = contact_surface.hertz_radius_and_peak(surface, surface.pressure)
    a_hertz, p_hertz = hertz()
    w, profile = surface.weight, p_hertz*contact_surface.hertz_profile(contact_surface.distance(surface, surface.position)/a_hertz)
    return {'a': a, 'a_error': a/a_hertz - 1, 'p0': p0, 'p0_error': p0/p_hertz - 1,
            'profile_error': np.sqrt(np.sum(w*(surface.projected - profile)**2)/np.sum(w*profile**2))}


def errors(path):
    """Of both contacts, and of their forces relative to the load."""
    contacts = {name: contact_errors(path, name) for name in ('lower contact', 'upper contact')}
    results = dotyk.Results(path)
    force = {name: SYMMETRY*results.pairs[name].force for name in contacts}
    on_ball = {'lower contact': 1, 'upper contact': -1}  # the ball is pushed up from below, and down from above
    balance = max(np.abs(force[name][2] - on_ball[name]*LOAD) for name in contacts)/LOAD
    return {'contacts': contacts, 'force_error': balance, 'converged': results.converged,
            'force_difference': abs(sum(force.values())[2])/LOAD}


if __name__ == '__main__':
    default = os.path.join(FOLDER, 'ball_between_plates.vtkhdf')
    e = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    a, p0 = hertz()
    print('load %.6g N, a/R = %.3f' % (LOAD, a/RADIUS))
    print('forces: each is the load to %.1e, they are equal to %.1e' % (e['force_error'], e['force_difference']))
    wrong = not e['converged'] or e['force_error'] > FORCE or e['force_difference'] > FORCE
    for name, c in e['contacts'].items():
        print('%s: contact radius %.6g m, Hertz %.6g m, error %+.3f %%' % (name, c['a'], a, 100*c['a_error']))
        print('%s: peak pressure %.6g Pa, Hertz %.6g Pa, error %+.3f %%' % (name, c['p0'], p0, 100*c['p0_error']))
        print('%s: pressure in the mean square: error %.2f %%' % (name, 100*c['profile_error']))
        wrong |= abs(c['a_error']) > RADIUS_ERROR or abs(c['p0_error']) > PEAK_ERROR or c['profile_error'] > PROFILE_ERROR
    print('WRONG' if wrong else 'as exact as can be expected')
    sys.exit(bool(wrong))
