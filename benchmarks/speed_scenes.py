"""The scenes of benchmarks/speed.py: made from those of inputs/ on finer meshes, and chains of blocks.

Scene.write(folder) writes mesh geometry and namelist; Scene.case(settings) gives the namelist with other settings of &solver and
&output; Scene.fixed(...) says which unknowns of a body the supports take away.
"""
import os
import re
import sys
import numpy as np

sys.dont_write_bytecode = True
ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, 'tools/python'))
import dotyk  # noqa: E402

INPUTS = os.path.join(ROOT, 'inputs')
CHAIN = """
SetFactory("OpenCASCADE");
Mesh.ElementOrder = 2;
{boxes}
MeshSize{{ PointsOf{{ Volume{{:}}; }} }} = {size};
{groups}
"""
# equal to the bit, as all of it is extruded
LADDER = """
Mesh.ElementOrder = 2;
Mesh.SecondOrderIncomplete = 1;
Point(1) = {{0, 0, 0}};
edge() = Extrude {{1, 0, 0}} {{ Point{{1}}; Layers{{{m}}}; }};
face() = Extrude {{0, 1, 0}} {{ Curve{{edge(1)}}; Layers{{{m}}}; Recombine; }};
bottom = face(1);
For k In {{1:{n}}}
  out() = Extrude {{0, 0, 1}} {{ Surface{{bottom}}; Layers{{{m}}}; Recombine; }};
  Physical Volume(Sprintf("body %g", k)) = {{out(1)}};
  Physical Surface(Sprintf("low %g", k)) = {{bottom}};
  Physical Surface(Sprintf("high %g", k)) = {{out(0)}};
  Physical Surface(Sprintf("side %g", k)) = {{out(3), out(5)}};
  bottom = out(0);
EndFor
"""


class Scene:
    """A scene: name, what it is, planes {surface: [(axis, place)]} on which its supports lie, threads ratio that is asked for."""

    def __init__(self, name, about, planes, bound=None, threads=None):
        self.name, self.about, self.planes, self.bound, self.threads = name, about, planes, bound, threads
        self.files, self.text = {}, ''
        self.touching = 0  # unknowns of a body that may touch, where they count

    def write(self, folder):
        """Write what is not there yet; the folder of the scene."""
        self.folder = os.path.join(os.path.abspath(folder), self.name)
        os.makedirs(self.folder, exist_ok=True)
        for name, text in self.files.items():
            put(os.path.join(self.folder, name), text)

    def case(self, name, solver, output):
        """The file of the scene with these keys of &solver and &output."""
        path = os.path.join(self.folder, name + '.nml')
        put(path, self.text + '&solver %s /\n' % solver + ('&output %s /\n' % output if output else ''))
        return path

    def supports(self):
        """For each body in turn: material, [(axes, planes)]."""
        scene = dotyk.Scene.parse(self.text)
        found = {group['name']: (group['material'], []) for group in scene.all('body')}
        for group in scene.all('support'):
            axes = ['xyz'.index(letter) for letter in group['fix']]
            found[group['body']][1].append((axes, self.planes[re.sub(r' \d+$', '', group['surface'])]))
        return list(found.values())

    def materials(self):
        """Young's modulus and Poisson's ratio by name."""
        return {group['name']: (group['young'], group['poisson']) for group in dotyk.Scene.parse(self.text).all('material')}

    @staticmethod
    def fixed(points, dimension, supports):
        """Which unknowns (nodes, dimension) the supports take away."""
        found = np.zeros((len(points), dimension), dtype=bool)
        close = 1e-6*np.ptp(points, axis=0).max()
        for axes, planes in supports:
            on = np.any([abs(points[:, axis] - place) < close for axis, place in planes], axis=0)
            for axis in axes:
                found[:, axis] |= on if axis < dimension else False
        return found


def put(path, text):
    """Write a file unless it says so already, so that a mesh stays."""
    if os.path.exists(path):
        with open(path) as file:
            if file.read() == text:
                return
    with open(path, 'w') as file:
        file.write(text)


def given(*names):
    """A file of inputs/."""
    with open(os.path.join(INPUTS, *names)) as file:
        return file.read()


def without_solver(text, mesh):
    """A scene with another mesh and without &solver."""
    scene = dotyk.Scene.parse(text)
    scene.groups = [group for group in scene.groups if group.name != 'solver']
    scene.scene(mesh=mesh)
    return str(scene)


def replaced(text, changes):
    for old, new in changes:
        if old not in text:
            raise ValueError('no %r in the geometry' % old)
        text = text.replace(old, new)
    return text


def hertz(name, about, n, growth, **more):
    """Sphere on a block: n elements over the contact radius, how fast they grow."""
    planes = {'cut': [(2, 0.01)], 'bottom': [(2, -0.01)], 'plane x': [(0, 0)], 'plane y': [(1, 0)]}
    scene = Scene(name, about, planes, **more)
    scene.files = {'hertz.geo': given('hertz', 'hertz.geo'),
                   'sphere.geo': 'a = 0.00025;\nn = %g;\ns = %g;\nInclude "hertz.geo";\n' % (n, growth)}
    scene.text = without_solver(given('hertz', 'fine.nml'), 'sphere.geo')
    return scene


def changed_input(name, about, folder, case, changes, planes, **more):
    """A scene of inputs/ with changes of its geometry."""
    scene = Scene(name, about, planes, **more)
    scene.files = {name + '.geo': replaced(given(folder, case + '.geo'), changes)}
    scene.text = without_solver(given(folder, case + '.nml'), name + '.geo')
    return scene


def chain(name, about, n, size, layers=None, placed=False, **more):
    """n cubes in a row, each held at two sides, the last one pressed on: tetrahedra, or equal bricks of layers elements, drawn
    each or drawn once and placed many times."""
    scene = Scene(name, about, {'side': [(0, 0), (0, 1)]}, **more)
    if layers:
        geometry = LADDER.format(n=1 if placed else n, m=layers)
        scene.touching = 2*3*((layers - 1)*(2*layers + 1) + layers*(layers + 1))  # nodes of two faces but for their held edges
    else:
        groups = []
        for k in range(n):
            groups.append('Physical Volume("body %d") = {%d};' % (k + 1, k + 1))
            groups.append('Physical Surface("low %d") = {%d};' % (k + 1, 6*k + 5))
            groups.append('Physical Surface("high %d") = {%d};' % (k + 1, 6*k + 6))
            groups.append('Physical Surface("side %d") = {%d, %d};' % (k + 1, 6*k + 1, 6*k + 2))
        boxes = '\n'.join('Box(%d) = {0, 0, %d, 1, 1, 1};' % (k + 1, k) for k in range(n))
        geometry = CHAIN.format(boxes=boxes, size=size, groups='\n'.join(groups))
    scene.files = {name + '.geo': geometry}
    lines = ["&scene title='%s', mesh='%s.geo' /" % (about, name), "&material name='steel', young=210e9, poisson=0.3 /"]
    drawn = [1 if placed else k + 1 for k in range(n)]
    for k in range(n):
        place = ', at=0,0,%d' % k if placed else ''
        lines.append("&body name='%d', volume='body %d', material='steel'%s /" % (k + 1, drawn[k], place))
        lines.append("&support body='%d', surface='side %d', fix='xyz' /" % (k + 1, drawn[k]))
    lines.append("&load body='%d', surface='high %d', pressure=1e8 /" % (n, drawn[-1]))
    for k in range(n - 1):
        lines.append("&contact name='joint %d', surface_a='%d:high %d', surface_b='%d:low %d' /"
                     % (k + 1, k + 1, drawn[k], k + 2, drawn[k + 1]))
    scene.text = '\n'.join(lines) + '\n'
    return scene


def scenes():
    """All scenes by name."""
    wavy = {'top': [(1, 1.5)], 'bottom': [(1, -1.5)], 'sides': [(0, 0), (0, 0.5)], 'cuts': [(2, 0), (2, 8/72)]}
    composite = {'edge': [(0, 0.5), (1, 0.5)], 'plane x': [(0, 0)], 'plane y': [(1, 0)]}
    found = [
        hertz('hertz', 'sphere on a block, 18 elements over the contact radius', 18, 2.5, bound=1.25, threads=0.9),
        hertz('hertz_fine', 'the same, 24 elements over it', 24, 4, bound=1.25),
        changed_input('wavy', 'wavy surface, plane strain', 'wavy', 'wavy',
                      [('h = l/80;', 'h = l/520;')], wavy, bound=1.25, threads=0.9),
        changed_input('slice', 'wavy surface, a slice of eight layers of tetrahedra', 'wavy', 'slice',
                      [('h = l/40;', 'h = l/72;'), ('t = h;', 't = 8*h;'), ('Layers{1}', 'Layers{8}')], wavy, bound=1.25),
        changed_input('composite', 'eight plates', 'composite', 'composite',
                      [('Layers{3}', 'Layers{10}'), ('Layers{5}', 'Layers{24}')], composite, bound=2, threads=0.9),
        chain('one', 'one large body', 1, 0.046, threads=1.6),
        chain('eight', 'eight equal bodies', 8, 0.1012, threads=0.9),
        chain('chain', 'a chain of 200 equal bodies, all of them drawn', 200, None, layers=8),
        chain('chain_placed', 'the same, one drawn and placed 200 times', 200, None, layers=8, placed=True),
    ]
    return {scene.name: scene for scene in found}
