#!/usr/bin/python3
"""How far punch.vtkhdf is from the flat punch with rounded edges on a half-plane: check.py [results file]. Exit code 1: wrong.

M. Ciavarella, D. A. Hills, G. Monno, "The influence of rounded edges on indentation by a flat punch", Proc. Instn Mech. Engrs C
212 (1998) 319-328, and `numerical`, which solves the integral equation without it. Needs h5py and numpy.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

YOUNG, POISSON = 1.0, 0.3                # as in punch.nml
STIFFNESS = YOUNG/(1 - POISSON**2)/2     # E*
FLAT, RADIUS = 0.6, 10.0                 # half-width a of the flat part, and the radius beside it
FORCE = 200*6.144165e-5                  # on the whole punch: pressure on top times its width

# Measured with 50 elements over b, 20 of them on the rounding: 3e-4 in b, 4e-4 in the peak, 1e-4 in the middle, 0.6 % in the profile
# (its slope is infinite at x = a, like a logarithm, and at b, like a square root's); with 25: 7e-4, 2e-3, 5e-4, 0.9 %; with 100:
# 9e-5, 1e-4, 4e-5, 0.5 %. The bodies are 100 b deep: with twice that figures change by 2e-5 at most.
LIMITS = {'b': 1e-3, 'peak': 2e-3, 'middle': 1e-3, 'profile': 1.5e-2, 'force': 1e-9, 'not converged': 0}


def force(b):
    """The force that makes the contact as wide as 2 b: P = E* a^2/(2 R) ((pi - 2 f)/(2 sin(f)^2) - cot(f)), sin(f) = a/b."""
    f = np.arcsin(FLAT/b)
    return STIFFNESS*FLAT**2/(2*RADIUS)*((np.pi - 2*f)/(2*np.sin(f)**2) - 1/np.tan(f))


def half_width(load=FORCE):
    """The half-width b of the contact under this force."""
    low, high = FLAT*(1 + 1e-12), FLAT + 2*np.sqrt(4*load*RADIUS/(np.pi*STIFFNESS))
    for _ in range(60):
        b = (low + high)/2
        low, high = (b, high) if force(b) < load else (low, b)
    return low


def pressure(x, b):
    """The pressure at x if the half-width of the contact is b: with x = b sin(t), sin(f) = a/b,

    p = 2 P/(pi b (pi - 2 f - sin(2 f))) {(pi - 2 f) cos(t) + sin(t) log|sin(t + f)/sin(t - f)|
                                          + sin(f) log|tan((t + f)/2) tan((t - f)/2)|}.
    """
    t, f = np.arcsin(np.minimum(np.abs(x)/b, 1)), np.arcsin(FLAT/b)
    # sin(t) log|1/sin(t - f)| + sin(f) log|tan((t - f)/2)| is finite at t = f, where both logarithms are not
    away = np.where(np.abs(t - f) > 1e-14, t - f, 1e-14)
    bracket = ((np.pi - 2*f)*np.cos(t) + np.sin(t)*np.log(np.abs(np.sin(t + f)/np.sin(away)))
               + np.sin(f)*np.log(np.abs(np.tan((t + f)/2)*np.tan(away/2))))
    return np.where(np.abs(x) < b, 2*force(b)/(np.pi*b*(np.pi - 2*f - np.sin(2*f)))*bracket, 0)


def numerical(b, n=400):
    """Force, and x and pressure at points, from 2/(pi E*) int p(s)/(x - s) ds = slope of the gap (Gauss-Chebyshev quadrature)."""
    j = np.arange(1, n + 1)
    s, weight = np.cos(j*np.pi/(n + 1)), np.pi/(n + 1)*np.sin(j*np.pi/(n + 1))**2
    x = np.cos((2*np.arange(1, n + 2) - 1)*np.pi/(2*n + 2))
    slope = np.sign(x)*np.maximum(0, np.abs(x*b) - FLAT)/RADIUS
    # p = g sqrt(1 - s^2); one equation more than unknowns, fulfilled by symmetry
    g = np.linalg.lstsq(weight/(x[:, None] - s), np.pi*STIFFNESS/2*slope, rcond=None)[0]
    return b*np.sum(weight*g), b*s, g*np.sqrt(1 - s*s)


def fitted_half_width(x, p, b):
    """The b of the theoretical pressure, times any number, that is nearest to p inside the contact; b is a first guess."""
    inside = x < 0.97*b

    def misfit(trial):
        shape = pressure(x[inside], trial)
        return np.linalg.norm(p[inside] - shape*np.sum(p[inside]*shape)/np.sum(shape**2))
    low, high, golden = 0.98*b, 1.1*b, (np.sqrt(5) - 1)/2
    for _ in range(60):
        left, right = high - golden*(high - low), low + golden*(high - low)
        low, high = (low, right) if misfit(left) < misfit(right) else (left, high)
    return low


def errors(path):
    """Relative errors, and what was found beside what is exact."""
    results = dotyk.Results(path)
    contact = results.pairs['punch']
    order = np.argsort(contact.position[:, 0])
    x, w, p = contact.position[order, 0], contact.weight[order], contact.pressure_projected[order]
    load = 2*abs(contact.force[1])
    b = half_width()
    dense = pressure(np.linspace(0, b, 20001), b)
    # the highest point of the parabola through the three highest values
    k = np.argmax(p)
    top = np.polynomial.Polynomial.fit(x[k - 1:k + 2], p[k - 1:k + 2], 2)
    flat = x < 0.3*FLAT
    figures = {'b': (fitted_half_width(x, p, b), b), 'peak': (top(top.deriv().roots()[0]), dense.max()),
               'middle': (np.polynomial.Polynomial.fit(x[flat]**2, p[flat], 2)(0), dense[0])}
    exact = pressure(x, b)
    e = {name: abs(found/right - 1) for name, (found, right) in figures.items()}
    e['profile'] = np.sqrt(np.sum(w*(p - exact)**2)/np.sum(w*exact**2))
    e['force'] = abs(load/FORCE - 1)
    e['not converged'] = float(not results.converged)
    return e, figures


if __name__ == '__main__':
    default = os.path.join(FOLDER, 'punch.vtkhdf')
    e, figures = errors(sys.argv[1] if len(sys.argv) > 1 else default)
    for name, (found, exact) in figures.items():
        print('%-14s found %.6g, exact %.6g, %+.3f %%' % (name, found, exact, 100*(found/exact - 1)))
    for name, error in e.items():
        print('%-14s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
    sys.exit(any(error > LIMITS[name] for name, error in e.items()))
