#!/usr/bin/python3
"""How far wavy.vtkhdf is from Westergaard's solution: check.py [results file]. Needs h5py and numpy."""
import os
import sys
import h5py
import numpy as np

YOUNG, POISSON, LENGTH, HEIGHT = 1.0, 0.3, 1.0, 0.002  # as in wavy.nml


def errors(path):
    """Half-width a of the contact and peak pressure, and Westergaard's for the same mean pressure."""
    with h5py.File(path) as file:
        contact = file['dotyk/contact/wave']
        x, w, p = contact['position'][:, 0], contact['weight'][:], contact['pressure_projected'][:]
        mean = abs(contact.attrs['force'][1])/(LENGTH/2)
    stiffness = YOUNG/(1 - POISSON**2)/2
    sine2 = mean*LENGTH/(np.pi*stiffness*HEIGHT)
    a_exact = LENGTH/np.pi*np.arcsin(np.sqrt(sine2))
    exact = 2*mean*np.cos(np.pi*x/LENGTH)/sine2*np.sqrt(np.maximum(0, sine2 - np.sin(np.pi*x/LENGTH)**2))
    peak = 2*mean/np.sqrt(sine2)
    # (p/cos)^2 is a straight line in sin^2: fitted inside the contact zone
    s = np.sin(np.pi*x/LENGTH)**2
    inside = s < 0.9*sine2
    slope, square = np.polyfit(s[inside], (p[inside]/np.cos(np.pi*x[inside]/LENGTH))**2, 1, w=np.sqrt(w[inside]))
    a = LENGTH/np.pi*np.arcsin(np.sqrt(-square/slope))
    return {'a': a, 'a_exact': a_exact, 'a_error': a/a_exact - 1, 'p0': np.sqrt(square), 'p0_exact': peak,
            'p0_error': np.sqrt(square)/peak - 1, 'mean': mean,
            'profile_error': np.sqrt(np.sum(w*(p - exact)**2)/np.sum(w*exact**2))}


if __name__ == '__main__':
    default = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'wavy.vtkhdf')
    e = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    print('mean pressure %.6g' % e['mean'])
    print('contact half-width  %.6g, Westergaard %.6g, error %+.2f %%' % (e['a'], e['a_exact'], 100*e['a_error']))
    print('peak pressure       %.6g, Westergaard %.6g, error %+.2f %%' % (e['p0'], e['p0_exact'], 100*e['p0_error']))
    print('pressure in the mean square: error %.2f %%' % (100*e['profile_error']))
