#!/usr/bin/python3
"""How far groove_row.vtkhdf is from the exact solution for a row of grooves: check.py [results file]. Exit code 1: wrong.

Half-planes with the gap r G(cos(k x))/G(1), G(v) = v sqrt(v^2 - u^2) - u^2 log((v + sqrt(v^2 - u^2))/u), for abs(x) < b, k = pi/l,
u = cos(k b), are pressed together by q in the mean; l is the distance of the grooves. With S = sin(k X), X = abs(x),
s(y) = sin(k y), K = r E* k/G(1) and E* = E/(1 - v^2)/2 they stay open where s(X) < s(c), s(c)^2 = s(b)^2 - 2 q/K, and the
pressure is K S sqrt(S^2 - s(c)^2) up to b and K S (sqrt(S^2 - s(c)^2) - sqrt(S^2 - s(b)^2)) beyond: the parts on y = 0 of a function
of x + i y. For l that is large beside b this is the groove of inputs/groove. Needs h5py and numpy.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

YOUNG, POISSON = 1.0, 0.3                                     # as in groove_row.nml
DEPTH, WIDTH, PERIOD = 1e-3, 1.0, 4.0                         # r in groove_row.nml; b and l = 2 L in groove_row.geo
PRESSURE = 2.02470475e-4                                      # on top
K = np.pi/PERIOD
SINE_B, COSINE_B = np.sin(K*WIDTH), np.cos(K*WIDTH)


def shape(v):
    """G."""
    root = np.sqrt(np.maximum(0, v*v - COSINE_B**2))
    return v*root - COSINE_B**2*np.log((v + root)/COSINE_B)


SLOPE = DEPTH*YOUNG/(1 - POISSON**2)/2*K/shape(1)             # K of the text
SINE_C = np.sqrt(SINE_B**2 - 2*PRESSURE/SLOPE)

# Measured with 50 elements over b: 6e-4 in c, 1e-5 in the peak, 1.1 % in the profile; with 25: 4e-3, 8e-3, 2.1 %; with 100: 4e-5,
# 1e-5, 0.6 %. The pressure begins like the square root of the distance from c and drops like it beyond b.
LIMITS = {'c': 2e-3, 'peak': 1e-3, 'profile': 2e-2, 'force': 1e-9, 'not converged': 0}


def gap(x):
    """The gap between the undeformed faces."""
    return DEPTH*shape(np.maximum(np.cos(K*x), COSINE_B))/shape(1)


def closed_form():
    """Half-width c of what stays open, and the peak pressure, at b."""
    return np.arcsin(SINE_C)/K, SLOPE*SINE_B*np.sqrt(SINE_B**2 - SINE_C**2)


def pressure(x):
    """The pressure between the half-planes."""
    s = np.sin(K*np.abs(x))
    return SLOPE*s*(np.sqrt(np.maximum(0, s*s - SINE_C**2)) - np.sqrt(np.maximum(0, s*s - SINE_B**2)))


def exact_stress(x, y, z=None, body=None):
    """Stresses xx yy zz xy yz xz in both layers, 6 rows.

    With Z = -2 q S/(R_c + R_b), S = sin(k (x + i y)), R_c = sqrt(S^2 - s(c)^2) and R_b likewise: yy = Re Z + y Im Z', xy = -y Re Z',
    xx = Re Z - y Im Z' and a uniform part, as the sides do not move. The depth of the layers, 3 l, changes it by 1e-7 of q.
    """
    height = np.abs(np.asarray(y, float))
    point = K*(np.abs(np.asarray(x, float)) + 1j*height)
    s, c = np.sin(point), np.cos(point)
    s = s.real + 1j*np.maximum(0, s.imag)                     # on the sides of a cell it is zero: the branch above
    roots = [np.sqrt(s - end)*np.sqrt(s + end) for end in (SINE_C, SINE_B)]
    roots = [np.where(root == 0, 1e-300, root) for root in roots]
    total = roots[0] + roots[1]
    value = -2*PRESSURE*s/total
    slope = np.where(height > 0, -2*PRESSURE*K*c*(roots[0]*roots[1] - s*s)/(roots[0]*roots[1]*total), 0)
    xx = value.real - height*slope.imag + PRESSURE*(1 - 2*POISSON)/(1 - POISSON)
    yy = value.real + height*slope.imag
    nothing = np.zeros_like(xx)
    return np.array([xx, yy, POISSON*(xx + yy), -np.sign(y)*height*slope.real, nothing, nothing])


def errors(path):
    """Relative errors, and what was found beside what is exact."""
    results = dotyk.Results(path)
    contact = results.pairs['groove']
    x, w, p, force = contact.position[:, 0], contact.weight, contact.pressure_projected, abs(contact.force[1])
    c, peak = closed_form()
    # (p/S)^2 is a straight line in S^2 between c and b
    inside = (x > c + 0.1*(WIDTH - c)) & (x < WIDTH - 0.1*(WIDTH - c))
    s = np.sin(K*x)
    slope, zero = np.polyfit(s[inside]**2, (p[inside]/s[inside])**2, 1, w=np.sqrt(w[inside]))
    found = {'c': np.arcsin(np.sqrt(-zero/slope))/K, 'peak': SINE_B*np.sqrt(slope*SINE_B**2 + zero)}
    exact = pressure(x)
    e = {'c': abs(found['c']/c - 1), 'peak': abs(found['peak']/peak - 1),
         'profile': np.sqrt(np.sum(w*(p - exact)**2)/np.sum(w*exact**2)),
         'force': abs(force/(PRESSURE*np.sum(w)) - 1), 'not converged': float(not results.converged)}
    return e, {'c': (found['c'], c), 'peak': (found['peak'], peak)}


if __name__ == '__main__':
    default = os.path.join(FOLDER, 'groove_row.vtkhdf')
    e, figures = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    for name, (found, exact) in figures.items():
        print('%-14s found %.6g, exact %.6g' % (name, found, exact))
    for name, error in e.items():
        print('%-14s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
