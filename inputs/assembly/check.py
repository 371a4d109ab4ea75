#!/usr/bin/python3
"""Statics and shortening of tubes and blocks of assembly.vtkhdf: check.py [results file]. Needs h5py and numpy. Exit code 1: wrong.

Tubes and blocks are prisms with free sides that touch frictionless planes at their ends. Whatever the pressures there, the mean
shortening is F L/(E A): Betti's theorem with the uniform state, in which the ends move as rigid planes.
"""
import os
import sys
import numpy as np

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(FOLDER, '../../tools/python'))
import dotyk  # noqa: E402

YOUNG, FORCE, POINT = 210e3, 50e3, (6.0, 3.0)                                    # as in assembly.nml
TUBES, BLOCKS = ['part %d' % i for i in (2, 3, 4, 5)], ['part %d' % i for i in (7, 8, 9, 10)]
SECTION = {**dict.fromkeys(TUBES, np.pi*(9**2 - 5**2)), **dict.fromkeys(BLOCKS, 14.0**2)}   # as in make_step.geo
CENTRE = {**dict(zip(TUBES, ((-45, -27), (45, -27), (45, 27), (-45, 27)))),
          **dict(zip(BLOCKS, ((-25, -15), (25, -15), (25, 15), (-25, 15))))}

LIMITS = {
    'not converged': 0.5,
    # Forces and moments are in equilibrium to the round-off of the solver, whatever the mesh.
    'forces on tubes and blocks': 1e-9,
    'moments on tubes and blocks': 1e-9,
    'ends of tubes and blocks': 1e-9,
    # Betti's theorem holds for finite elements that contain linear displacements, too.
    'shortening of blocks': 1e-9,
    # Quadratic elements, 16 around a circle: their section is 1e-4 off that of the tube.
    'shortening of tubes': 5e-4,
}


def mean_height(body, z, field):
    """Mean of a field over the faces of tet10 in the plane at a height, and their area: tri6, which may have curved edges."""
    nodes, found = body.nodes, []
    cells = body.cells[0].nodes
    for face in ((0, 1, 2, 4, 5, 6), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (0, 2, 3, 6, 9, 7)):
        faces = cells[:, face]
        found.append(faces[(np.abs(nodes[faces, 2] - z) < 1e-9).all(axis=1)])
    faces = np.concatenate(found)
    # Gauss points of degree 5 in barycentric coordinates
    a, b = (6 - np.sqrt(15))/21, (6 + np.sqrt(15))/21
    points = [(1/3, 1/3)] + [p for c in (a, b) for p in ((c, c), (1 - 2*c, c), (c, 1 - 2*c))]
    weights = [9/40] + 3*[(155 - np.sqrt(15))/1200] + 3*[(155 + np.sqrt(15))/1200]
    area = total = 0.0
    for (s, t), weight in zip(points, weights):
        r = 1 - s - t
        shape = np.array([r*(2*r - 1), s*(2*s - 1), t*(2*t - 1), 4*r*s, 4*s*t, 4*t*r])
        by_s = np.array([1 - 4*r, 4*s - 1, 0, 4*(r - s), 4*t, -4*t])
        by_t = np.array([1 - 4*r, 0, 4*t - 1, -4*s, 4*s, 4*(r - t)])
        x_s, x_t = (np.einsum('n,fnd->fd', by, nodes[faces, :2]) for by in (by_s, by_t))
        measure = weight/2*np.abs(x_s[:, 0]*x_t[:, 1] - x_s[:, 1]*x_t[:, 0])
        area += measure.sum()
        total += (measure*(field[faces] @ shape)).sum()
    return total/area


def errors(path):
    """Force and shortening of tubes and blocks, and what is wrong with them."""
    results = dotyk.Results(path)
    below, above = {}, {}
    for name, pair in results.pairs.items():
        first, second = name.split(': ')[-1].split(' - ')
        body = first if first in SECTION else second
        # Force and moment are those on the slave body, the first one.
        sign = 1 if body == first else -1
        (below if sign*pair.force[2] > 0 else above)[body] = abs(pair.force[2]), sign*pair['moment'][:2]
    force = {name: below[name][0] for name in SECTION}
    short = {}
    for name in SECTION:
        body = results.bodies[name]
        z = body.nodes[:, 2]
        short[name] = mean_height(body, z.min(), body.displacement[:, 2]) - mean_height(body, z.max(), body.displacement[:, 2])
    theory = {name: force[name]*(30 if name in TUBES else 20)/(YOUNG*SECTION[name]) for name in SECTION}
    moment = np.array([FORCE*POINT[1], -FORCE*POINT[0]])
    e = {'not converged': float(not results.converged),
         'forces on tubes and blocks': max(abs(sum(force[name] for name in row)/FORCE - 1) for row in (TUBES, BLOCKS)),
         'moments on tubes and blocks': max(np.abs(sum(below[name][1] for name in row) - moment).max()/np.abs(moment).max()
                                            for row in (TUBES, BLOCKS)),
         'ends of tubes and blocks': max(abs(above[name][0]/force[name] - 1) for name in SECTION),
         'shortening of blocks': max(abs(short[name]/theory[name] - 1) for name in BLOCKS),
         'shortening of tubes': max(abs(short[name]/theory[name] - 1) for name in TUBES)}
    return e, force, short, theory


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else os.path.join(FOLDER, 'assembly.vtkhdf')
    e, force, short, theory = errors(path)
    for name in SECTION:
        print('%-8s at (%3d, %3d)  force %6.0f N, shortening %.4f um, F L/(E A) %.4f um'
              % (name, *CENTRE[name], force[name], 1e3*short[name], 1e3*theory[name]))
    for name, value in e.items():
        print('%-30s %.2g (limit %g)' % (name, value, LIMITS[name]))
    return int(any(not value <= LIMITS[name] for name, value in e.items()))


if __name__ == '__main__':
    sys.exit(main())
