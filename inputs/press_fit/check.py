#!/usr/bin/python3
"""How far press_fit.vtkhdf and overlap.vtkhdf are from Lame's solution: check.py [results file]. Exit code 1: wrong.

Without a file both are checked, the second one if it is there. Needs h5py and numpy.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

YOUNG, POISSON = 210e3, 0.3              # as in press_fit.nml and overlap.nml
A, B, C = 10.0, 20.0, 30.0               # radii: bore, joint, outside; as in press_fit.geo
INTERFERENCE = 0.02

# Measured with 4 elements through the inner tube: 1e-5 in the pressure, 1e-4 in the displacements, 1e-3 in single stresses; with twice
# as many: 1e-6, 1e-5, 3e-4. Where the tubes overlap as they are drawn: 4e-5 in the mean pressure, 3e-4 in the mean square (1e-3 in the
# two last points), 2e-4 in the displacements.
LIMITS = {'pressure': 1e-4, 'profile': 1e-3, 'displacement': 1e-3, 'stress': 3e-3, 'hoop': 3e-3, 'force': 3e-4,
          'not converged': 0}


def lame(inside, outside, pressure_inside, pressure_outside):
    """A and B in the stresses A - B/r^2 (radial) and A + B/r^2 (hoop) of a tube under pressure."""
    difference = outside**2 - inside**2
    return ((pressure_inside*inside**2 - pressure_outside*outside**2)/difference,
            (pressure_inside - pressure_outside)*inside**2*outside**2/difference)


def widening(inside, outside, pressure_inside, pressure_outside, r):
    """Radial displacement in plane strain."""
    a, b = lame(inside, outside, pressure_inside, pressure_outside)
    return (1 + POISSON)/YOUNG*((1 - 2*POISSON)*a*r + b/r)


def joint(overlap=0.0):
    """Pressure on the inner tube, whose outer radius is B + overlap, and on the outer one.

    The forces are equal, so the pressures are as the radii. Without overlap
    p = E/(1-v^2) s/b (b^2-a^2)(c^2-b^2)/(2 b^2 (c^2-a^2)).
    """
    ratio = (B + overlap)/B
    return np.array([1, ratio])*INTERFERENCE/(widening(B, C, ratio, 0, B) - widening(A, B + overlap, 0, 1, B + overlap))


def exact_stress(x, y, z=None, body=None, overlap=0.0):
    """Stresses xx yy zz xy yz xz, 6 rows. body: 1 inner tube, 2 outer tube; if absent, what lies at this radius."""
    r2 = x*x + y*y
    pressure = joint(overlap)
    inner, outer = lame(A, B + overlap, 0, pressure[0]), lame(B, C, pressure[1], 0)
    within = r2 < B*B if body is None else np.full(np.shape(r2), body == 1)
    a, b = np.where(within, inner[0], outer[0]), np.where(within, inner[1], outer[1])
    cosine, sine = (x*x - y*y)/r2, 2*x*y/r2
    nothing = np.zeros(np.shape(r2))
    return np.array([a - b*cosine/r2, a + b*cosine/r2, 2*POISSON*a, -b*sine/r2, nothing, nothing])


def radius_displacement(r, body, overlap=0.0):
    """Exact radial displacement of one of the tubes."""
    pressure = joint(overlap)
    return widening(A, B + overlap, 0, pressure[0], r) if body == 1 else widening(B, C, pressure[1], 0, r)


def tubes(results):
    """For each body its nodes, their radial displacements, the centres of its elements and their stresses xx yy zz xy."""
    for body in results.bodies.values():
        x, elements = body.nodes, body.cells[0].nodes
        # the middle of a quadrilateral: of 4 nodes their mean, of 8 half of those on the edges less a quarter of the corners
        weights = np.full(4, 0.25) if elements.shape[1] == 4 else np.repeat([-0.25, 0.5], 4)
        r = np.hypot(x[:, 0], x[:, 1])
        yield r, np.sum(x*body.displacement, axis=1)/r, np.einsum('k,cki->ci', weights, x[elements]), body.stress[:, :4]


def errors(path):
    """Relative errors, and what was found beside what is exact."""
    results = dotyk.Results(path)
    fit = results.pairs['fit']
    w, p, force = fit.weight, fit.pressure_projected, np.abs(fit.force[:2])
    overlap = max(0, np.max(np.hypot(*fit.position[:, :2].T)) - B)
    overlap = INTERFERENCE if overlap > INTERFERENCE/2 else 0.0
    exact = joint(overlap)[0]
    displacement, stress, hoop = [], [], []
    for body, (r, u, x, found) in enumerate(tubes(results), 1):
        right = radius_displacement(r, body, overlap)
        displacement.append(np.abs(u - right).max()/np.abs(right).max())
        right = exact_stress(x[:, 0], x[:, 1], None, body, overlap)[:4].T
        stress.append(np.abs(found - right).max()/np.abs(right).max())
        c, s = (x[:, :2]/np.hypot(x[:, 0], x[:, 1])[:, None]).T
        hoops = [t[:, 0]*s*s + t[:, 1]*c*c - 2*t[:, 3]*s*c for t in (found, right)]
        hoop.append(np.abs(hoops[0]/hoops[1] - 1).max())
    mean = np.sum(w*p)/np.sum(w)
    e = {'pressure': abs(mean/exact - 1), 'profile': np.sqrt(np.sum(w*(p - exact)**2)/np.sum(w))/exact,
         'displacement': max(displacement), 'stress': max(stress), 'hoop': max(hoop),
         'force': np.abs(force/(exact*(B + overlap)) - 1).max(), 'not converged': float(not results.converged)}
    return e, {'pressure': (mean, exact)}


if __name__ == '__main__':
    paths = sys.argv[1:2] or [os.path.join(FOLDER, name) for name in ('press_fit.vtkhdf', 'overlap.vtkhdf')]
    wrong = False
    for path in paths[:1] + [path for path in paths[1:] if os.path.exists(path)]:
        e, figures = errors(path)
        print(os.path.basename(path))
        for name, (found, exact) in figures.items():
            print('%-14s found %.6g, exact %.6g' % (name, found, exact))
        for name, error in e.items():
            print('%-14s %.1e%s' % (name, error, '' if error <= LIMITS[name] else '   WRONG'))
        wrong |= any(error > LIMITS[name] for name, error in e.items())
    sys.exit(wrong)
