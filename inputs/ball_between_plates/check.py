#!/usr/bin/python3
"""Both contacts of ball_between_plates.vtkhdf against Hertz: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong."""
import os
import sys
import h5py
import numpy as np

YOUNG, POISSON, RADIUS = 210e9, 0.3, 0.01  # as in ball_between_plates.nml and .geo
SYMMETRY = 4                               # a quarter is computed
LOAD = SYMMETRY*5e6*0.01**2                # on the upper plate

# Forces: equilibrium of the ball and the upper plate holds to the round-off of the solver on any mesh (the loaded face is flat).
FORCE = 1e-10
# Five elements over the contact radius, and a theory that is off by (a/R)^2 = 0.3 %. The pressure is a broken line on these
# elements and ends as a square root: where it ends it is wrong by a fraction of sqrt(element/radius), in the mean square by a
# fraction of element/radius: 5.9, 6.5, 4.5 and 3.6 % with 4, 5, 6 and 8 elements (and a by 2.5, 1.8, 0.9 and 0.6 %).
RADIUS_ERROR, PEAK_ERROR, PROFILE_ERROR = 0.03, 0.02, 0.08


def hertz():
    """Contact radius and peak pressure for the load."""
    stiffness = YOUNG/(1 - POISSON**2)/2
    a = (3*LOAD*RADIUS/(4*stiffness))**(1/3)
    return a, 3*LOAD/(2*np.pi*a**2)


def contact_errors(contact):
    """Contact radius and peak pressure of one contact, and their errors."""
    x, w, p = contact['position'][:], contact['weight'][:], contact['pressure_projected'][:]
    a_hertz, p_hertz = hertz()
    # p^2 = p0^2 (1 - r^2/a^2) is a straight line in r^2: fitted inside the contact zone, weighted by area
    r2 = x[:, 0]**2 + x[:, 1]**2
    inside = r2 < (0.9*a_hertz)**2
    slope, square = np.polyfit(r2[inside], p[inside]**2, 1, w=np.sqrt(w[inside]))
    p0, a = np.sqrt(square), np.sqrt(-square/slope)
    profile = p_hertz*np.sqrt(np.maximum(0, 1 - r2/a_hertz**2))
    return {'a': a, 'a_error': a/a_hertz - 1, 'p0': p0, 'p0_error': p0/p_hertz - 1,
            'profile_error': np.sqrt(np.sum(w*(p - profile)**2)/np.sum(w*profile**2))}


def errors(path):
    """Of both contacts, and of their forces relative to the load."""
    with h5py.File(path) as file:
        contacts = {name: contact_errors(file['dotyk/contact/' + name]) for name in ('lower contact', 'upper contact')}
        force = {name: SYMMETRY*file['dotyk/contact/' + name].attrs['force'] for name in contacts}
        converged = bool(file['dotyk/summary'].attrs['converged'])
    on_ball = {'lower contact': 1, 'upper contact': -1}  # the ball is pushed up from below, and down from above
    balance = max(np.abs(force[name][2] - on_ball[name]*LOAD) for name in contacts)/LOAD
    return {'contacts': contacts, 'force_error': balance, 'converged': converged,
            'force_difference': abs(sum(force.values())[2])/LOAD}


if __name__ == '__main__':
    default = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'ball_between_plates.vtkhdf')
    e = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    a, p0 = hertz()
    print('load %.6g N, a/R = %.3f' % (LOAD, a/RADIUS))
    print('forces: each is the load to %.1e, they are equal to %.1e' % (e['force_error'], e['force_difference']))
    wrong = not e['converged'] or e['force_error'] > FORCE or e['force_difference'] > FORCE
    for name, c in e['contacts'].items():
        print('%s: contact radius %.6g m, Hertz %.6g m, error %+.2f %%' % (name, c['a'], a, 100*c['a_error']))
        print('%s: peak pressure %.6g Pa, Hertz %.6g Pa, error %+.2f %%' % (name, c['p0'], p0, 100*c['p0_error']))
        print('%s: pressure in the mean square: error %.2f %%' % (name, 100*c['profile_error']))
        wrong |= abs(c['a_error']) > RADIUS_ERROR or abs(c['p0_error']) > PEAK_ERROR or c['profile_error'] > PROFILE_ERROR
    print('WRONG' if wrong else 'as exact as can be expected')
    sys.exit(bool(wrong))
