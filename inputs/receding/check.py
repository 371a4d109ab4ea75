#!/usr/bin/python3
"""How far receding.vtkhdf is from the layer on a half-plane, and tenfold.vtkhdf from ten times it. Exit code 1: wrong.

usage: check.py [results file [results file with another load]]; needs h5py and numpy. The second is left out if it is not there.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

THICKNESS, STRIP = 10.0, 0.5                       # of the layer; half the width of the load: as in receding.geo
LOAD = {'receding': 1000.0, 'tenfold': 10000.0}    # as in the namelists

# Some 33 elements over the half-width, a foundation 40 layers deep in place of a half-plane.
WIDTH_ERROR, PROFILE_ERROR = 0.005, 0.01
# The scheme stops at a relative error of 1e-8 in the energy norm; forces balance to round-off.
SCALED_ERROR, FORCE_ERROR = 1e-6, 1e-9


def exact(strip, n=41):
    """Half-width b of the contact of a layer of thickness 1 with a half-plane of the same material under a load 1 on
    abs(x) < strip, and the pressure p at x >= 0.

    The formulation of Keer, Dundurs and Tsai (J. Appl. Mech. 39 (1972) 1115-1120) in plain terms: a layer under pressure p
    below and q above has there, in Fourier transforms, the displacement 2/(E' k) (S (p + q)/2 + A (p - q)/2) upwards, the
    half-plane 2/(E' k) p downwards. The slopes of the two cancel where they touch:
        int_0^inf [2 p + N p - D q] sin(k x) dk = 0,   N = (S + A)/2 - 1,   D = (A - S)/2.
    With p = g sqrt(b^2 - x^2) at Gauss-Chebyshev points this is one equation more than unknowns, which determines b.
    A load on a line: b = 1.32417; the digits do not change from n = 21 to 41.
    """
    j = np.arange(1, (n + 1)//2 + 1)
    t = np.cos(j*np.pi/(n + 1))                    # points t > 0, and t = 0 if n is odd; p is even
    weight = 2*np.pi/(n + 1)*np.sin(j*np.pi/(n + 1))**2
    weight[np.abs(t) < 1e-9] /= 2
    x = np.cos((2*np.arange(1, n//2 + 2) - 1)*np.pi/(2*n + 2))
    x = x[x > 1e-9]                                # where the slopes cancel
    s, w = np.polynomial.legendre.leggauss(2000)
    k, w = 30*(s + 1), 30*w
    symmetric = 2*np.sinh(k/2)**2/(np.sinh(k) + k)
    bending = 2*np.cosh(k/2)**2/(np.sinh(k) - k)
    near, through = (symmetric + bending)/2 - 1, (bending - symmetric)/2
    load = np.sinc(k*strip/np.pi)

    def equations(b):
        half_plane = (1/(x[:, None] - t) + 1/(x[:, None] + t))*weight
        sine = np.sin(np.outer(k*b, x))*w[:, None]
        # N p - D q = N (p - 1) + (N - D q): the transforms of both loads are 1 at k = 0, where N and D are infinite
        layer = sine.T @ (near[:, None]*(np.cos(np.outer(k*b, t)) - 1)*weight*b)
        return np.vstack([half_plane + layer, weight*b]), np.append(-(sine.T @ (near - through*load)), 1)

    def pressure(b):
        """The pressure that fulfils all equations but the first one, and what is left of that."""
        a, rhs = equations(b)
        g = np.linalg.solve(a[1:], rhs[1:])
        return g*np.sqrt(1 - t*t), a[0] @ g - rhs[0]

    low, high = 1.0, 2.0                           # for a strip that is not wide
    for _ in range(50):
        middle = (low + high)/2
        same = pressure(middle)[1]*pressure(low)[1] > 0
        low, high = (middle, high) if same else (low, middle)
    return low, low*t, pressure(low)[0]


def measured(path):
    """Contact points x, pressures (projected, and of the scheme), the force, the half-width, whether it converged."""
    results = dotyk.Results(path)
    joint = results.pairs['joint']
    order = np.argsort(joint.position[:, 0])
    x, p = joint.position[order, 0], joint.pressure_projected[order]
    return x, p, joint.pressure[order], joint.force[1], half_width(np.abs(x), p), results.converged


def half_width(x, p):
    """Where p^2, a smooth function of x^2 that falls to zero, does so: x^2 as a cubic in p^2 near the rim. (Right to 0.12 %.)"""
    rim = x[p > 1e-2*p.max()].max()
    near = (x > 0.8*rim) & (x < 0.98*rim)
    return np.sqrt(np.polynomial.Polynomial.fit(p[near]**2, x[near]**2, 3)(0))


def errors(path, load):
    """Errors of the half-width, the pressure in the mean square, and the force."""
    b, x, p = exact(STRIP/THICKNESS)
    x, p = x*THICKNESS, p*load/THICKNESS
    found_x, found, _, force, found_b, converged = measured(path)
    expected = np.interp(np.abs(found_x), x[::-1], p[::-1], right=0)
    return {'b': found_b, 'b_exact': b*THICKNESS, 'b_error': found_b/(b*THICKNESS) - 1, 'force_error': force/load - 1,
            'peak_error': found.max()/p.max() - 1, 'converged': converged,
            'profile_error': np.linalg.norm(found - expected)/np.linalg.norm(expected)}


def scaled_errors(path, load, other, other_load):
    """How far two loads are from the same contact: points, pressures, half-widths."""
    first, second = measured(path), measured(other)
    return {'points': int(np.sum((first[2] > 0) != (second[2] > 0))), 'b_error': abs(second[4]/first[4] - 1),
            'pressure_error': np.abs(second[2]*load/other_load - first[2]).max()/first[2].max()}


if __name__ == '__main__':
    path = sys.argv[1] if len(sys.argv) > 1 else os.path.join(FOLDER, 'receding.vtkhdf')
    other = sys.argv[2] if len(sys.argv) > 2 else os.path.join(FOLDER, 'tenfold.vtkhdf')
    e = errors(path, LOAD['receding'])
    print('half-width %.5f mm, exact %.5f mm, error %+.2f %%' % (e['b'], e['b_exact'], 100*e['b_error']))
    print('pressure: at the middle %+.2f %%, in the mean square %.2f %%' % (100*e['peak_error'], 100*e['profile_error']))
    print('force on the layer against the load: %.1e' % e['force_error'])
    wrong = (not e['converged'] or abs(e['b_error']) > WIDTH_ERROR or e['profile_error'] > PROFILE_ERROR
             or abs(e['force_error']) > FORCE_ERROR)
    if os.path.exists(other):
        e = scaled_errors(path, LOAD['receding'], other, LOAD['tenfold'])
        print('with ten times the load: %d points differ in contact, half-width by %.1e, pressure/load by %.1e'
              % (e['points'], e['b_error'], e['pressure_error']))
        wrong |= e['points'] > 0 or e['b_error'] > SCALED_ERROR or e['pressure_error'] > SCALED_ERROR
    print('WRONG' if wrong else 'as exact as can be expected')
    sys.exit(bool(wrong))
