#!/usr/bin/python3
"""How far hertz.vtkhdf is from Hertz's theory: check.py [results file]. Needs h5py and numpy."""
import os
import sys
import h5py
import numpy as np

YOUNG, POISSON, RADIUS = 210e9, 0.3, 0.01  # as in hertz.nml and hertz.geo
SYMMETRY = 4  # a quarter is computed


def errors(path):
    """Contact radius a and peak pressure p0 of the results, and Hertz's for the same force."""
    with h5py.File(path) as file:
        contact = file['dotyk/contact/touch']
        x, w, p = contact['position'][:], contact['weight'][:], contact['pressure_projected'][:]
        force = SYMMETRY*abs(contact.attrs['force'][2])
    stiffness = YOUNG/(1 - POISSON**2)/2
    a_hertz = (3*force*RADIUS/(4*stiffness))**(1/3)
    p_hertz = 3*force/(2*np.pi*a_hertz**2)
    # p^2 = p0^2 (1 - r^2/a^2) is a straight line in r^2: fitted inside the contact zone, weighted by area
    r2 = x[:, 0]**2 + x[:, 1]**2
    inside = r2 < (0.9*a_hertz)**2
    slope, square = np.polyfit(r2[inside], p[inside]**2, 1, w=np.sqrt(w[inside]))
    p0, a = np.sqrt(square), np.sqrt(-square/slope)
    profile = p_hertz*np.sqrt(np.maximum(0, 1 - r2/a_hertz**2))
    return {'a': a, 'a_hertz': a_hertz, 'a_error': a/a_hertz - 1, 'p0': p0, 'p0_hertz': p_hertz, 'p0_error': p0/p_hertz - 1,
            'a/R': a_hertz/RADIUS, 'force': force,
            'profile_error': np.sqrt(np.sum(w*(p - profile)**2)/np.sum(w*profile**2))}


if __name__ == '__main__':
    default = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'hertz.vtkhdf')
    e = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('force %.6g N, a/R = %.3f' % (e['force'], e['a/R']))
    print('contact radius  %.6g m, Hertz %.6g m, error %+.2f %%' % (e['a'], e['a_hertz'], 100*e['a_error']))
    print('peak pressure   %.6g Pa, Hertz %.6g Pa, error %+.2f %%' % (e['p0'], e['p0_hertz'], 100*e['p0_error']))
    print('pressure in the mean square: error %.2f %%' % (100*e['profile_error']))
