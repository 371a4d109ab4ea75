#!/usr/bin/python3
"""What the contact geometry (&contact geometry) does to gap and pressure, as tables in Markdown.

usage: studies/contact_geometry.py [tubes] [spheres] [hertz] [--dotyk FILE]

tubes: press fit of two tubes in plane strain (Lame), whose interference is meshed: the surfaces are arcs with 13 and 10, then 26
and 20 facets on a quarter. spheres: the same for an eighth of two hollow spheres, irregular meshes. hertz: inputs/hertz with 4 and
8 elements over the contact radius. Errors in percent. Exit code 1: a run failed.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT/'tools/python'))
from dotyk import Results  # noqa: E402

YOUNG, POISSON, THETA = 200.0, 0.3, 1e-5
GEOMETRIES = ('elements', 'smooth')
TUBE = """
Mesh.ElementOrder = %d;  Mesh.SecondOrderIncomplete = 1;
Point(1) = {%r, 0, 0};
line() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };
ring() = Extrude { {0, 0, 1}, {0, 0, 0}, Pi/2 } { Curve{line(1)}; Layers{%d}; %s };
Physical Surface("body") = {ring(1)};
Physical Curve("inside") = {Abs(ring(3))};
Physical Curve("outside") = {Abs(ring(2))};
Physical Curve("y") = {line(1)};
Physical Curve("x") = {ring(0)};
"""
SPHERE = """
Mesh.ElementOrder = %d;  Mesh.MeshSizeMin = %r;  Mesh.MeshSizeMax = %r;
Mesh.MeshSizeExtendFromBoundary = 0;  Mesh.MeshSizeFromPoints = 0;  Mesh.Algorithm = %d;
Point(1) = {0, 0, 0};
Point(2) = {%r, 0, 0};  Point(3) = {0, %r, 0};  Point(4) = {0, 0, %r};
Point(5) = {%r, 0, 0};  Point(6) = {0, %r, 0};  Point(7) = {0, 0, %r};
Circle(1) = {2, 1, 3};  Circle(2) = {3, 1, 4};  Circle(3) = {4, 1, 2};
Circle(4) = {5, 1, 6};  Circle(5) = {6, 1, 7};  Circle(6) = {7, 1, 5};
Line(7) = {2, 5};  Line(8) = {3, 6};  Line(9) = {4, 7};
Curve Loop(1) = {1, 2, 3};  Surface(1) = {1};
Curve Loop(2) = {4, 5, 6};  Surface(2) = {2};
Curve Loop(3) = {1, 8, -4, -7};  Plane Surface(3) = {3};
Curve Loop(4) = {2, 9, -5, -8};  Plane Surface(4) = {4};
Curve Loop(5) = {3, 7, -6, -9};  Plane Surface(5) = {5};
Surface Loop(1) = {1, 2, 3, 4, 5};  Volume(1) = {1};
Physical Volume("body") = {1};
Physical Surface("inside") = {1};  Physical Surface("outside") = {2};
Physical Surface("z") = {3};  Physical Surface("x") = {4};  Physical Surface("y") = {5};
"""


def lame(n, radii, interference):
    """Pressure between two hollow cylinders (n = 1, plane strain) or spheres (n = 2): u = A r + B/r^n in each."""
    a, b, c = radii
    if n == 1:
        mean, shear = YOUNG/((1 + POISSON)*(1 - 2*POISSON)), YOUNG/(1 + POISSON)
    else:
        mean, shear = YOUNG/(1 - 2*POISSON), 2*YOUNG/(1 + POISSON)

    def stress(r):
        return [mean, -shear/r**(n + 1)]
    # A and B inside, A and B outside, p
    equations = [stress(a) + [0, 0, 0], stress(b) + [0, 0, 1], [0, 0] + stress(b) + [1], [0, 0] + stress(c) + [0],
                 [-b, -b**-n, b, b**-n, THETA]]
    return np.linalg.solve(np.array(equations), [0, 0, 0, 0, interference])[4]


def run(dotyk, folder, scene):
    """Solve; the results file."""
    done = subprocess.run([dotyk, scene], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True)
    if done.returncode != 0:
        sys.exit(done.stdout)
    return folder/scene.replace('.nml', '.vtkhdf')


def fit(dotyk, folder, analysis, geometry, pressure, interference):
    """Solve a press fit of inner.geo and outer.geo: unknowns of the pressure, errors of it in the mean, in the mean square and at
    most, and of the gap at most."""
    axes = 'xyz' if analysis == '3d' else 'xy'
    lines = ["&scene analysis='%s' /" % analysis, "&material name='m', young=%r, poisson=%r /" % (YOUNG, POISSON)]
    for body in ('inner', 'outer'):
        lines += ["&body name='%s', mesh='%s.geo', volume='body', material='m' /" % (body, body)]
        lines += ["&support body='%s', surface='%s', fix='%s' /" % (body, axis, axis) for axis in axes]
    lines += ["&contact name='fit', surface_a='inner:outside', surface_b='outer:inside', geometry='%s' /" % geometry,
              "&solver theta=%r, tolerance=1e-8 /" % THETA]
    (folder/'fit.nml').write_text('\n'.join(lines) + '\n')
    fit = Results(run(dotyk, folder, 'fit.nml')).pairs['fit']
    w, p, gap = fit.weight, fit.pressure_projected, fit.gap_initial
    error = p/pressure - 1
    return [len(p)] + [100*e for e in (np.sum(w*error)/np.sum(w), np.sqrt(np.sum(w*error**2)/np.sum(w)), np.abs(error).max(),
                                       np.abs(gap/interference + 1).max())]


def show(row, values):
    """A row of a table."""
    print('| ' + ' | '.join(row + ['%d' % v if isinstance(v, int) else '%.2g' % v if abs(v) < 100 else '%.0f' % v
                                   for v in values]) + ' |', flush=True)


def tubes(dotyk, folder):
    """Two tubes."""
    radii, overlap = (1.0, 1.5, 2.2), 1e-3
    pressure = lame(1, radii, overlap)
    for kind in ('tri3', 'quad4', 'tri6', 'quad8'):
        order, recombine = int(kind in ('tri6', 'quad8')) + 1, 'Recombine;' if kind.startswith('quad') else ''
        for fine in (1, 2):
            for name, inner, outer, radial, around in (('inner', radii[0], radii[1] + overlap, 3, 13),
                                                       ('outer', *radii[1:], 4, 10)):
                (folder/(name + '.geo')).write_text(TUBE % (order, inner, outer - inner, fine*radial, fine*around, recombine))
            for geometry in GEOMETRIES:
                show([kind, geometry], fit(dotyk, folder, 'plane_strain', geometry, pressure, overlap))


def spheres(dotyk, folder):
    """Two hollow spheres."""
    radii, overlap = (0.5, 1.0, 1.6), 2e-3
    pressure = lame(2, radii, overlap)
    for order, sizes in ((1, (0.25, 0.125)), (2, (0.25, 0.16))):
        for h in sizes:
            for name, inner, outer, size, algorithm in (('inner', radii[0], radii[1] + overlap/2, h, 6),
                                                        ('outer', radii[1] - overlap/2, radii[2], 0.83*h, 5)):
                (folder/(name + '.geo')).write_text(SPHERE % (order, size, size, algorithm, *3*(inner,), *3*(outer,)))
            for geometry in GEOMETRIES:
                show(['tet4' if order == 1 else 'tet10', geometry], fit(dotyk, folder, '3d', geometry, pressure, overlap))


def hertz(dotyk, folder):
    """inputs/hertz."""
    sys.path.insert(0, str(ROOT/'inputs/hertz'))
    import check
    geo, scene = ((ROOT/'inputs/hertz'/name).read_text() for name in ('hertz.geo', 'hertz.nml'))
    for order in (1, 2):
        for n in (4, 8):
            text = re.sub(r'DefineConstant\[n = \d+\];', 'n = %d;' % n, geo)
            text = re.sub(r'^order = \d;', 'order = %d;' % order, text, flags=re.M)
            (folder/'hertz.geo').write_text(text)
            for geometry in GEOMETRIES:
                (folder/'hertz.nml').write_text(scene.replace("'block:up'", "'block:up', geometry='%s'" % geometry))
                e = check.errors(run(dotyk, folder, 'hertz.nml'))
                show(['tet4' if order == 1 else 'tet10', geometry],
                     [n] + [100*e[name] for name in ('a_error', 'p0_error', 'profile_error')])


def main():
    """Command line."""
    arguments = sys.argv[1:]
    if '-h' in arguments or '--help' in arguments:
        sys.exit(print(__doc__))
    dotyk = os.environ.get('DOTYK', str(ROOT/'build/release/dotyk'))
    if '--dotyk' in arguments:
        at = arguments.index('--dotyk')
        dotyk = os.path.abspath(arguments[at + 1])
        del arguments[at:at + 2]
    heads = {'tubes': 'vertices | mean pressure | mean square | largest | gap',
             'hertz': 'elements over a | radius | peak | mean square'}
    studies = {'tubes': tubes, 'spheres': spheres, 'hertz': hertz}
    for name in arguments or studies:
        if name not in studies:
            sys.exit('unknown study %r; there are: %s' % (name, ', '.join(studies)))
        head = '| elements | geometry | %s |' % heads.get(name, heads['tubes'])
        print('\n%s\n\n%s\n%s' % (name, head, '|---'*(head.count('|') - 1) + '|'))
        with tempfile.TemporaryDirectory(prefix='dotyk-') as folder:
            studies[name](dotyk, pathlib.Path(folder))


if __name__ == '__main__':
    main()
