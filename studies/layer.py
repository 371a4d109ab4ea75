#!/usr/bin/python3
"""A real elastic layer between two blocks: orders of its two discretizations at fixed theta.

usage: studies/layer.py [--quick] [--kinds quad8,tri6,hex20] [--dotyk FILE] [--table FILE.md]

Two blocks between rollers are pressed on each other through a layer of compliance theta, size/E. The gap is a cosine, given
as a formula: the faces are flat, and the exact solution is a cosine series, of one mode where the contact is full, of many where a
part is open. Errors are those of the stresses in the energy norm, relative, on finer and finer meshes: faces that match or not, facets
of one size or 2:1 by turns. Beside them is the distance of the two discrete solutions, the consistency error of the mean.
Exit code 1: an order is below that of docs/theory.md, section 2. Needs gmsh, numpy and h5py; some minutes, with --quick ten seconds.
"""
import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, 'tools'))
import energy_norm  # noqa: E402

POISSON, THETA = 0.3, 1.0            # Young's modulus, the size of the blocks and the amplitude of the gap are 1
PRESS = {'full': 1.5, 'open': 0.1}   # how far the blocks are pushed together
KINDS = ('quad8', 'tri6', 'hex20')
MESHES = ('matching', 'matching 2:1', 'non-matching')
FORMS = ('mortar', 'quadrature')
# orders between the last two meshes: at least that of the theory less 0.2
ORDER = {'mortar': 1.3, 'quadrature': 1.8}

GEO = """
Mesh.ElementOrder = 2;  Mesh.SecondOrderIncomplete = 1;
Point(1) = {0, %(y)d, 0};
line() = Extrude {1, 0, 0} { Point{1}; Layers{ {%(ones)s}, {%(ends)s} }; };
face() = Extrude {0, 1, 0} { Curve{line(1)}; Layers{%(n)d}; %(recombine)s };
"""
PLANE = """
Physical Surface("block") = {face(1)};  Physical Curve("bottom") = {line(1)};  Physical Curve("top") = {face(0)};
Physical Curve("sides") = {face(2), face(3)};
"""
SOLID = """
body() = Extrude {0, 0, 0.25} { Surface{face(1)}; Layers{%(deep)d}; Recombine; };
e = 1e-6;
Physical Volume("block") = {body(1)};
Physical Surface("bottom") = {Surface In BoundingBox {-e, %(y)d - e, -e, 1 + e, %(y)d + e, 1}};
Physical Surface("top") = {Surface In BoundingBox {-e, %(y)d + 1 - e, -e, 1 + e, %(y)d + 1 + e, 1}};
Physical Surface("sides") = {Surface In BoundingBox {-e, -2, -e, e, 2, 1}, Surface In BoundingBox {1 - e, -2, -e, 1 + e, 2, 1}};
Physical Surface("faces") = {face(1), body(0)};
"""
NML = """
&scene    mesh='upper.msh', analysis='%(analysis)s' /
&material name='unit', young=1, poisson=%(poisson)g /
&body     name='upper', volume='block', material='unit' /
&body     name='lower', volume='block', material='unit', mesh='lower.msh' /
&support  body='upper', surface='sides',  fix='x' /
&support  body='lower', surface='sides',  fix='x' /
&support  body='upper', surface='top',    fix='y', value=0,%(down)g%(zero)s /
&support  body='lower', surface='bottom', fix='y' /
%(faces)s
&contact  name='layer', surface_a='upper:bottom', surface_b='lower:top', layer=.true., theta=%(theta)g,
          gap_formula='cos(pi*x)', discretization='%(form)s' /
&solver   tolerance=1e-8 /
&output   fields='displacement', error_parts='' /
"""


class Exact:
    """The exact solution: the pressure on the layer as a cosine series, and the stresses of the blocks."""

    def __init__(self, press, points=4096, modes=768):
        x = (np.arange(points) + 0.5)/points
        k = np.pi*np.arange(1, modes)
        cosines = np.cos(np.pi*np.outer(np.arange(modes), x))
        # deflection of a block on rollers under the pressure cos(k x); both blocks
        with np.errstate(over='ignore'):
            compliance = 2*np.concatenate([[(1 + POISSON)*(1 - 2*POISSON)/(1 - POISSON)],
                                           2*(1 - POISSON**2)/k*np.tanh(k)/(1 + 2*k/np.sinh(2*k))])

        def series(p):
            return cosines @ p*np.where(np.arange(modes) > 0, 2, 1)/points

        def penetration(p):
            return press - np.cos(np.pi*x) - (compliance*series(p)) @ cosines

        active = np.ones(points, bool)
        for _ in range(100):
            p = np.zeros(points)
            self.solve(lambda q, active=active: np.where(active, THETA*q + (compliance*series(q)) @ cosines, 0),
                       np.where(active, penetration(p), 0), p)
            new = np.where(active, p > 0, penetration(p) > 0)
            if np.all(new == active):
                break
            active = new
        coefficients = series(p)
        keep = np.abs(coefficients[1:]) > 1e-10*np.abs(coefficients).max()
        self.mean, self.k, self.p = coefficients[0], k[keep], coefficients[1:][keep]
        self.share = active.mean()

    @staticmethod
    def solve(matrix, right, p):
        """Conjugate gradients; p is the start and the solution."""
        r = right - matrix(p)
        d, rr = r.copy(), r @ r
        first = rr
        while rr > 1e-26*first:
            q = matrix(d)
            step = rr/(d @ q)
            p += step*d
            r -= step*q
            rr, before = r @ r, rr
            d = r + rr/before*d

    def __call__(self, x, y, z, body):
        """Stresses xx yy zz xy yz xz. Airy's function of a mode: cos(kx) (a cosh t + b t sinh t), t = k (1 - depth)."""
        depth = np.abs(y)
        side = 1 if body == 1 else -1
        xx, yy, xy = np.full_like(x, -self.mean*POISSON/(1 - POISSON)), np.full_like(x, -self.mean), np.zeros_like(x)
        for k, p in zip(self.k, self.p):
            near = slice(None) if k < 40 else np.flatnonzero(k*depth < 40)
            d, c, s = depth[near], np.cos(k*x[near]), np.sin(k*x[near])
            t = k*(1 - d)
            cosh, sinh = (np.exp(-k*d)*(1 + sign*np.exp(-2*t))/(1 + np.exp(-2*k)) for sign in (1, -1))  # over cosh(k)
            b = -p/(1 + 4*k*np.exp(-2*k)/(1 - np.exp(-4*k)))
            a = -b*(1 + k/np.tanh(k))
            xx[near] += c*(a*cosh + b*(2*cosh + t*sinh))
            yy[near] -= c*(a*cosh + b*t*sinh)
            xy[near] -= side*s*(a*sinh + b*(sinh + t*cosh))
        return np.array([xx, yy, POISSON*(xx + yy), xy, 0*xy, 0*xy])


def mesh(folder, name, kind, n, unequal):
    """A block with n facets on its face."""
    sizes = np.where(np.arange(n) % 2 == 0, 4/3, 2/3) if unequal else np.ones(n)
    text = GEO + (SOLID if kind == 'hex20' else PLANE)
    path = os.path.join(folder, name)
    with open(path + '.geo', 'w') as file:
        file.write(text % {'y': 0 if name == 'upper' else -1, 'n': n, 'deep': max(1, n//4), 'ones': ', '.join(['1']*n),
                           'ends': ', '.join('%.15g' % end for end in np.cumsum(sizes)/sizes.sum()),
                           'recombine': '' if kind == 'tri6' else 'Recombine;'})
    subprocess.run(['gmsh', '-3' if kind == 'hex20' else '-2', '-format', 'msh41', '-o', path + '.msh', path + '.geo'],
                   check=True, stdout=subprocess.DEVNULL)


def run(program, folder, kind, form, press):
    """One run: the results file."""
    solid = kind == 'hex20'
    path = os.path.join(folder, form)
    with open(path + '.nml', 'w') as file:
        file.write(NML % {'analysis': '3d' if solid else 'plane_strain', 'poisson': POISSON, 'theta': THETA, 'down': -press,
                          'zero': ',0' if solid else '', 'form': form,
                          'faces': "&support body='upper', surface='faces', fix='z' /\n"
                                   "&support body='lower', surface='faces', fix='z' /" if solid else ''})
    done = subprocess.run([program, path + '.nml', '--quiet'], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode:
        sys.exit('layer: exit code %d\n%s' % (done.returncode, done.stdout))
    return path + '.vtkhdf'


def measure(program, kinds, quick, say):
    """Errors: {(kind, contact, mesh): {n: (error of the mortar form, of the literal form, distance)}}."""
    found = {}
    for contact in ('full',) if quick else PRESS:
        press = PRESS[contact]
        exact = Exact(press)
        for kind in kinds:
            numbers = (6, 12) if quick else (6, 12, 24) if kind == 'hex20' else (6, 12, 24, 48)
            for name in MESHES:
                found[kind, contact, name] = errors = {}
                for n in numbers:
                    with tempfile.TemporaryDirectory() as folder:
                        mesh(folder, 'upper', kind, n, '2:1' in name)
                        mesh(folder, 'lower', kind, n if name != 'non-matching' else 2*n//3, '2:1' in name)
                        paths = [run(program, folder, kind, form, press) for form in FORMS]
                        results = [energy_norm.Results(path) for path in paths]
                        norm = energy_norm.energy_norm(results[1])
                        errors[n] = [energy_norm.error(one, exact)/norm for one in results] + [
                            energy_norm.distance(*results)/norm]
                    say('%s, %s, %s, %d: %.2e %.2e %.2e' % (kind, contact, name, n, *errors[n]))
    return found


def orders(errors, column):
    """Orders of convergence between neighbouring meshes."""
    numbers = sorted(errors)
    return [np.log(errors[a][column]/errors[b][column])/np.log(b/a) for a, b in zip(numbers, numbers[1:])]


def table(found):
    """Lines of the table: errors on the finest mesh, and the orders."""
    yield '| elements | contact | faces | mortar | literal | distance |'
    yield '|---|---|---|---:|---:|---:|'
    for (kind, contact, name), errors in found.items():
        cells = ['%.1e (%s)' % (errors[max(errors)][column], ', '.join('%.1f' % order for order in orders(errors, column)))
                 for column in range(3)]
        yield '| %s | %s | %s | %s |' % (kind, contact, name, ' | '.join(cells))


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('--dotyk', default=os.path.join(ROOT, 'build/release/dotyk'), help='the program')
    add('--quick', action='store_true', help='two coarse meshes, full contact')
    add('--kinds', default=','.join(KINDS), help='element kinds')
    add('--table', help='file for the table; default: the terminal')
    options = parser.parse_args()
    found = measure(os.path.abspath(options.dotyk), options.kinds.split(','), options.quick,
                    lambda text: print(text, file=sys.stderr, flush=True))
    text = '\n'.join(table(found)) + '\n'
    if options.table:
        with open(options.table, 'w') as file:
            file.write(text)
    else:
        print(text, end='')
    wrong = ['%s, %s, %s, %s: order %.2f' % (*key, form, orders(errors, column)[-1])
             for key, errors in found.items() for column, form in enumerate(FORMS)
             if not orders(errors, column)[-1] > ORDER[form]]
    if wrong:
        sys.exit('layer: orders below the theory\n  ' + '\n  '.join(wrong))


if __name__ == '__main__':
    main()
