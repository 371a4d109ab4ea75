#!/usr/bin/python3
"""Meshes that the program chooses (&accuracy), on known answers: what was asked for, what the error bar says, and the true error.

usage: studies/known_answers.py [NAME...]      scenes, all if none; --list names them

Geometries have no sizes of elements. The table has a row for each quantity: error that was asked for, value, error bar, true error
(all relative), true error over error bar, unknowns of the last mesh, number of meshes, seconds in all. The executable is $DOTYK, or
build/release/dotyk.
"""
import argparse
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
import h5py  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / 'tests/cases'), str(ROOT / 'tests/support')]
import accuracy as case  # noqa: E402
EXE = os.environ.get('DOTYK', str(ROOT / 'build/release/dotyk'))
YOUNG, NU = 200e3, 0.3  # MPa, mm
STAR = YOUNG / (2 * (1 - NU**2))  # of two bodies
A, B, C = 10.0, 20.0, 30.0  # radii of tubes and shells

RING = """Point({0}) = {{0, 0, 0}};  Point({1}) = {{{r}, 0, 0}};  Point({2}) = {{{R}, 0, 0}};  Point({3}) = {{0, {R}, 0}};  Point({4}) = {{0, {r}, 0}};
Line({1}) = {{{1}, {2}}};  Circle({2}) = {{{2}, {0}, {3}}};  Line({3}) = {{{3}, {4}}};  Circle({4}) = {{{4}, {0}, {1}}};
Curve Loop({0}) = {{{1}, {2}, {3}, {4}}};  Plane Surface({0}) = {{{0}}};
Physical Surface("{name}") = {{{0}}};  Physical Curve("y of {name}") = {{{1}}};  Physical Curve("out of {name}") = {{{2}}};
Physical Curve("x of {name}") = {{{3}}};  Physical Curve("in of {name}") = {{{4}}};
Mesh.ElementOrder = 2;
"""
MATERIAL = f"&material name='steel', young={YOUNG}, poisson={NU} /\n"


def ring(name, inside, outside, first=1):
    return RING.format(*range(first, first + 5), r=inside, R=outside, name=name)


def plane(*bodies):
    return MATERIAL + ''.join(f"""&body name='{b}', volume='{b}', material='steel' /
&support body='{b}', surface='x of {b}', fix='x' /
&support body='{b}', surface='y of {b}', fix='y' /
""" for b in bodies)


def mises(*s):
    return math.sqrt(0.5 * ((s[0] - s[1])**2 + (s[1] - s[2])**2 + (s[2] - s[0])**2))


def tube():
    p = 100.0
    hoop = p * (B**2 + A**2) / (B**2 - A**2)
    move = (1 + NU) * p * A**2 / (YOUNG * (B**2 - A**2)) * ((1 - 2 * NU) * A + B**2 / A)
    return ring('tube', A, B), "&scene analysis='plane_strain', mesh='a.geo' /\n" + plane('tube') + \
        f"&load body='tube', surface='in of tube', pressure={p} /\n", \
        {'mises:tube': mises(-p, hoop, NU * (hoop - p)), 'displacement:tube': move}


def fit():
    d = 0.02
    p = YOUNG / (1 - NU**2) * d * (B**2 - A**2) * (C**2 - B**2) / (2 * B**3 * (C**2 - A**2))
    hoop = -2 * p * B**2 / (B**2 - A**2)
    return ring('shaft', A, B) + ring('hub', B, C, 6), "&scene analysis='plane_strain', mesh='a.geo' /\n" + plane('shaft', 'hub') + \
        f"&contact name='fit', surface_a='shaft:out of shaft', surface_b='hub:in of hub', gap={-d} /\n", \
        {'mean_pressure:fit': p, 'peak:fit': p, 'area:fit': B * math.pi / 2, 'mises:shaft': mises(0, hoop, NU * hoop)}


def shell():
    p = 100.0
    hoop = p * (B**3 + 2 * A**3) / (2 * (B**3 - A**3))
    move = p * A**3 / (YOUNG * (B**3 - A**3)) * ((1 - 2 * NU) * A + (1 + NU) * B**3 / (2 * A**2))
    return ring('shell', A, B), "&scene analysis='axisymmetric', mesh='a.geo' /\n" + MATERIAL + f"""&body name='shell', volume='shell', material='steel' /
&support body='shell', surface='y of shell', fix='y' /
&load body='shell', surface='in of shell', pressure={p} /
""", {'mises:shell': hoop + p, 'displacement:shell': move}


def hole():
    """Kirsch: tension along x far from a hole of radius 1, tractions of the exact solution on the edges x = 4 and y = 4."""
    geo = """Point(1) = {0, 0, 0};  Point(2) = {1, 0, 0};  Point(3) = {4, 0, 0};  Point(4) = {4, 4, 0};  Point(5) = {0, 4, 0};  Point(6) = {0, 1, 0};
Line(1) = {2, 3};  Line(2) = {3, 4};  Line(3) = {4, 5};  Line(4) = {5, 6};  Circle(5) = {6, 1, 2};
Curve Loop(1) = {1:5};  Plane Surface(1) = {1};
Physical Surface("plate") = {1};  Physical Curve("y of plate") = {1};  Physical Curve("right") = {2};  Physical Curve("up") = {3};
Physical Curve("x of plate") = {4};
Mesh.ElementOrder = 2;
"""
    r2, c, s = '(x^2+y^2)', '((x^2-y^2)/(x^2+y^2))', '(2*x*y/(x^2+y^2))'  # r^2, cos 2t, sin 2t
    cos4, sin4 = f'({c}^2-{s}^2)', f'(2*{s}*{c})'
    xx = f'1-1/{r2}*(1.5*{c}+{cos4})+1.5/{r2}^2*{cos4}'
    yy = f'-1/{r2}*(0.5*{c}-{cos4})-1.5/{r2}^2*{cos4}'
    xy = f'-1/{r2}*(0.5*{s}+{sin4})+1.5/{r2}^2*{sin4}'
    return geo, "&scene analysis='plane_strain', mesh='a.geo' /\n" + plane('plate') + f"""&load body='plate', surface='right', traction_formula='{xx}', '{xy}' /
&load body='plate', surface='up', traction_formula='{xy}', '{yy}' /
""", {'mises:plate': mises(0, 3, 3 * NU)}


def hertz_plane(analysis):
    """A half disc, or half of a ball, pressed on a block by a force."""
    radius = 10.0
    geo = f"""R = {radius};
Point(1) = {{0, 0, 0}};  Point(2) = {{0, R, 0}};  Point(3) = {{R, R, 0}};
Circle(1) = {{1, 2, 3}};  Line(2) = {{3, 2}};  Line(3) = {{2, 1}};
Curve Loop(1) = {{1:3}};  Plane Surface(1) = {{1}};
Point(11) = {{0, -2*R, 0}};  Point(12) = {{2*R, -2*R, 0}};  Point(13) = {{2*R, 0, 0}};  Point(14) = {{0, 0, 0}};
Line(11) = {{11, 12}};  Line(12) = {{12, 13}};  Line(13) = {{13, 14}};  Line(14) = {{14, 11}};
Curve Loop(11) = {{11:14}};  Plane Surface(11) = {{11}};
Physical Surface("ball") = {{1}};  Physical Surface("block") = {{11}};
Physical Curve("skin") = {{1}};  Physical Curve("cut") = {{2}};  Physical Curve("x of ball") = {{3}};
Physical Curve("bottom") = {{11}};  Physical Curve("up") = {{13}};  Physical Curve("x of block") = {{14}};
Mesh.ElementOrder = 2;
"""
    if analysis == 'axisymmetric':
        force, area = 20.0, math.pi * radius**2
        a = (3 * force * radius / (4 * STAR))**(1 / 3)
        peak, zone = 1.5 * force / (math.pi * a**2), math.pi * a**2
        hold = ''
    else:
        force, area = 1000.0, 2 * radius
        a = math.sqrt(4 * force * radius / (math.pi * STAR))
        peak, zone = 2 * force / (math.pi * a), a
        hold = "&support body='*', surface='x of ball', fix='x' /\n&support body='*', surface='x of block', fix='x' /\n"
    return geo, f"""&scene analysis='{analysis}', mesh='a.geo' /
{MATERIAL}&body name='ball', volume='ball', material='steel' /
&body name='block', volume='block', material='steel' /
{hold}&support body='block', surface='bottom', fix='xy' /
&load body='ball', surface='cut', pressure={force / area} /
&contact name='touch', surface_a='ball:skin', surface_b='block:up' /
""", {'peak:touch': peak, 'area:touch': zone, 'mean_pressure:touch': force / zone if hold == '' else force / (2 * zone)}


def hertz():
    """A quarter of a ball on a quarter of a block, moved towards it; the force is that of a mesh of 147,000 unknowns."""
    force = 4 * 655.72
    a = (3 * force * 0.01 / (4 * 210e9 / (2 * 0.91)))**(1 / 3)
    return case.HERTZ, case.SPHERE.replace('s.geo', 'a.geo'), \
        {'force:touch': force / 4, 'peak:touch': 1.5 * force / (math.pi * a**2), 'area:touch': math.pi * a**2 / 4,
         'mean_pressure:touch': force / (math.pi * a**2)}


SCENES = {'tube': (tube, (0.02, 0.002)), 'shell': (shell, (0.02, 0.002)), 'hole': (hole, (0.02, 0.002)), 'fit': (fit, (0.02, 0.002)),
          'disc': (lambda: hertz_plane('plane_strain'), (0.02, 0.005)), 'ball': (lambda: hertz_plane('axisymmetric'), (0.02, 0.005)),
          'hertz': (hertz, (0.03, 0.01))}


def run(scene, asked):
    """Rows of a scene."""
    geo, nml, exact = scene()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / 'a.geo').write_text(geo)
        quantities = ', '.join(f"'{q}'" for q in exact)
        (folder / 'a.nml').write_text(nml + f"&accuracy error={asked}, quantity={quantities} /\n")
        done = subprocess.run([EXE, 'a.nml', '--threads', '1'], cwd=folder, capture_output=True, text=True, timeout=1200)
        lines = re.findall(r'accuracy +mesh (\d+): (\d+) unknowns.*after ([\d.e+]+) s(.*)', done.stdout)
        if not lines:
            sys.exit(done.stdout + done.stderr)
        meshes, unknowns, seconds, verdict = lines[-1]
        with h5py.File(folder / 'a.vtkhdf') as file:
            group = file['dotyk/quantities']
            names = group.attrs['names']
            names = (names.decode() if isinstance(names, bytes) else names).split('\n')
            for q, value, bar in zip(names, group['value'], group['error']):
                yield q, value, bar / abs(value), abs(value / exact[q] - 1), int(unknowns), int(meshes), float(seconds), 'reached:' in verdict


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', metavar='NAME')
    parser.add_argument('--list', action='store_true')
    options = parser.parse_args()
    if options.list:
        print('\n'.join(SCENES))
        return
    ratios = []
    n_held = 0
    print('| scene | asked | quantity | value | bar | true error | true/bar | unknowns | meshes | s |\n|---|---:|---|---:|---:|---:|---:|---:|---:|---:|')
    for name in options.names or SCENES:
        scene, errors = SCENES[name]
        for asked in errors:
            for q, value, bar, true, unknowns, meshes, seconds, reached in run(scene, asked):
                print(f"| {name} | {100 * asked:.2g} % | `{q}` | {value:.5g} | {100 * bar:.2g} % | {100 * true:.2g} % | {true / bar:.2f} | "
                      f"{unknowns} | {meshes}{'' if reached else ', not reached'} | {seconds:.2g} |", flush=True)
                ratios.append(true / bar)
                n_held += true <= asked
    n = len(ratios)
    print(f'\n{n_held} of {n} true errors are within what was asked for; true/bar is below 1.2 in '
          f'{100 * sum(r <= 1.2 for r in ratios) / n:.0f} %, and at least 0.3 too in {100 * sum(0.3 <= r <= 1.2 for r in ratios) / n:.0f} %.')


if __name__ == '__main__':
    main()
