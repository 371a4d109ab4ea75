"""Scenes of studies/theory.py, runs of the program on them, and distances of their results in the energy norm."""
import os
import subprocess
import sys
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, 'tools'))
import energy_norm  # noqa: E402
import dotyk  # noqa: E402

# Two blocks of height 1 between smooth walls, pushed together by 1: one mode, everything is known.
COLUMN_GEO = """
n = 4;
Point(1) = {0, 0, 0};  Point(2) = {0, 1, 0};
side() = Extrude {1, 0, 0} { Point{1}; Layers{n}; };
face() = Extrude {1, 0, 0} { Point{2}; Layers{n}; };
lower() = Extrude {0, 1, 0} { Curve{side(1)}; Layers{n}; Recombine; };
upper() = Extrude {0, 1, 0} { Curve{face(1)}; Layers{n}; Recombine; };
Physical Surface("lower") = {lower(1)};  Physical Surface("upper") = {upper(1)};
Physical Curve("bottom") = {side(1)};    Physical Curve("lower face") = {lower(0)};
Physical Curve("upper face") = {face(1)};  Physical Curve("top") = {upper(0)};
Physical Curve("sides") = {lower(2), lower(3), upper(2), upper(3)};
"""
WAVE_GEO = """
h = 1/DIVISIONS;  H = 0.25;
Mesh.ElementOrder = 2;
Point(1) = {0, 0, 0, h};  Point(2) = {0.5, 0, 0, h};  Point(3) = {0.5, 1.5, 0, H};   Point(4) = {0, 1.5, 0, H};
Point(5) = {0, 0, 0, h};  Point(6) = {0.5, 0, 0, h};  Point(7) = {0.5, -1.5, 0, H};  Point(8) = {0, -1.5, 0, H};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Line(5) = {6, 5};  Line(6) = {5, 8};  Line(7) = {8, 7};  Line(8) = {7, 6};
Curve Loop(1) = {1, 2, 3, 4};  Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, 8};  Plane Surface(2) = {2};
Physical Surface("upper") = {1};     Physical Surface("lower") = {2};
Physical Curve("upper face") = {1};  Physical Curve("lower face") = {5};
Physical Curve("top") = {3};         Physical Curve("bottom") = {7};
Physical Curve("sides") = {2, 4, 6, 8};
"""
COLUMN_NML = """
&scene    mesh='column.msh', analysis='plane_strain' /
&material name='soft',  young=1, poisson=0.2 /
&material name='stiff', young=7, poisson=0.3 /
&body     name='lower', volume='lower', material='soft' /
&body     name='upper', volume='upper', material='stiff' /
&support  body='lower', surface='sides',  fix='x' /
&support  body='upper', surface='sides',  fix='x' /
&support  body='lower', surface='bottom', fix='y' /
&support  body='upper', surface='top',    fix='y', value=0,-1e-3 /
&contact  name='touch', surface_a='upper:upper face', surface_b='lower:lower face' /
&solver /
"""
COLUMN_COMPLIANCE = [(1 + v)*(1 - 2*v)/(e*(1 - v)) for e, v in ((1.0, 0.2), (7.0, 0.3))]

# Three layers, the middle one clamped at its left side and pressed from below and above.
LAYERS_GEO = """
h = 1/DIVISIONS;  H = 0.25;
Mesh.ElementOrder = 2;
Macro Layer
  p = newp;
  Point(p) = {0, y0, 0, h0};  Point(p+1) = {0.5, y0, 0, h0};  Point(p+2) = {0.5, y1, 0, h1};  Point(p+3) = {0, y1, 0, h1};
  l = newl;
  Line(l) = {p, p+1};  Line(l+1) = {p+1, p+2};  Line(l+2) = {p+2, p+3};  Line(l+3) = {p+3, p};
  Curve Loop(newll) = {l, l+1, l+2, l+3};  s = news;  Plane Surface(s) = {newll-1};
Return
y0 = -1.5;  y1 = 0;  h0 = H;  h1 = h;
Call Layer;
Physical Surface("lower") = {s};   Physical Curve("bottom") = {l};         Physical Curve("lower face") = {l+2};
Physical Curve("lower sides") = {l+1, l+3};
y0 = 0;  y1 = 0.5;  h0 = h/1.5;  h1 = h/1.5;
Call Layer;
Physical Surface("middle") = {s};  Physical Curve("middle bottom") = {l};  Physical Curve("middle top") = {l+2};
Physical Curve("left") = {l+3};    Physical Curve("right") = {l+1};
y0 = 0.5;  y1 = 2;  h0 = h;  h1 = H;
Call Layer;
Physical Surface("upper") = {s};   Physical Curve("upper face") = {l};     Physical Curve("top") = {l+2};
Physical Curve("upper sides") = {l+1, l+3};
"""
LAYERS_NML = """
&scene    mesh='layers.msh', analysis='plane_strain' /
&material name='soft',  young=1, poisson=0.3 /
&material name='stiff', young=3, poisson=0.2 /
&body     name='lower',  volume='lower',  material='soft' /
&body     name='middle', volume='middle', material='stiff' /
&body     name='upper',  volume='upper',  material='soft' /
&support  body='lower',  surface='lower sides', fix='x' /
&support  body='upper',  surface='upper sides', fix='x' /
&support  body='middle', surface='left',   fix='xy' /
&support  body='middle', surface='right',  fix='x' /
&support  body='lower',  surface='bottom', fix='y', value=0,6.2e-3 /
&support  body='upper',  surface='top',    fix='y', value=0,-5e-3 /
&contact  name='first',  surface_a='middle:middle bottom', surface_b='lower:lower face', gap_formula='AMPLITUDE*(1-cos(2*pi*x))' /
&contact  name='second', surface_a='middle:middle top', surface_b='upper:upper face', gap_formula='AMPLITUDE*(1-cos(2*pi*x))' /
&solver /
"""

# A block with sharp edges on a wider one: the pressure is infinite at the edge, like the distance to it to the power of -0.226.
PUNCH_GEO = """
h = 2e-6;  H = 0.15;
Mesh.ElementOrder = 2;
Point(1) = {0, 0, 0, 0.03};    Point(2) = {0.5, 0, 0, h};   Point(3) = {0.5, 1, 0, H};  Point(4) = {0, 1, 0, H};
Point(5) = {0, 0, 0, 0.03};    Point(6) = {0.5, 0, 0, h};   Point(7) = {1.5, 0, 0, H};  Point(8) = {1.5, -1, 0, H};
Point(9) = {0, -1, 0, H};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Line(5) = {5, 9};  Line(6) = {9, 8};  Line(7) = {8, 7};  Line(8) = {7, 6};  Line(9) = {6, 5};
Curve Loop(1) = {1, 2, 3, 4};     Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, 8, 9};  Plane Surface(2) = {2};
Physical Surface("upper") = {1};   Physical Surface("lower") = {2};
Physical Curve("upper face") = {1};  Physical Curve("lower face") = {8, 9};
Physical Curve("top") = {3};         Physical Curve("bottom") = {6};
Physical Curve("sides") = {4, 5};
"""


class Run:
    """What one run left: the state of its contact points, summary, history and exit code."""

    def __init__(self, results):
        self.text, self.code = results.log, 0 if results.converged else 1
        self.summary, self.history = results.summary.attributes, dict(results.history)
        pairs = [pair for _, pair in sorted(results.pairs.items())]
        self.weight, self.pressure, gap, theta = (np.concatenate([pair[name] for pair in pairs])
                                                  for name in ('weight', 'pressure', 'gap', 'theta'))
        self.y, self.row_theta, self.theta = -gap, theta, pairs[0].attributes['theta']
        self.results = energy_norm.Results(results.path)

    def norm(self):
        """||u||_A: nothing but given displacements loads the scenes, so that F_theta is half its square and the penalty term."""
        soft = self.row_theta > 0
        penalty = np.sum((self.weight*np.maximum(self.y, 0)**2)[soft]/(2*self.row_theta[soft]))
        return np.sqrt(max(0.0, 2*(self.summary['energy'] - penalty)))


def distance(one, other):
    """||u_1 - u_2||_A of two runs on the same mesh, whatever their theta and scheme.

    With u = u0 - K^-1 B^T W m and y = B u - d the square is (m_1 - m_2)^T W (y_2 - y_1): nothing cancels, its own quadrature.
    """
    square = np.sum(one.weight*(one.pressure - other.pressure)*(other.y - one.y))
    return np.sqrt(max(0.0, square))


def deviation_of(one, other):
    """How far the distance is from the one of the displacements, relative; 0 where rounding has a say in the latter."""
    near = distance(one, other)
    return 0.0 if near < 1e-5*one.norm() else abs(energy_norm.distance(one.results, other.results)/near - 1)


class Scene:
    """A folder with a mesh and a namelist file, whose solver is chosen run by run."""

    def __init__(self, program, folder, name, geo, nml):
        self.program, self.name, self.nml = program, name, nml
        self.folder = os.path.join(folder, name)
        os.makedirs(self.folder)
        path = os.path.join(self.folder, name)
        with open(path + '.geo', 'w') as file:
            file.write(geo)
        dimension = '-2' if 'plane_strain' in nml else '-3'
        subprocess.run(['gmsh', dimension, '-format', 'msh41', '-o', path + '.msh', path + '.geo'], check=True,
                       stdout=subprocess.DEVNULL)
        self.runs = 0

    def run(self, **solver):
        """One run; keywords are those of &solver."""
        scene = dotyk.Scene.parse(self.nml)
        for group in scene.all('solver'):  # not every example has one
            scene.groups.remove(group)
        scene.scene(mesh=self.name + '.msh')
        scene.solver(**solver)
        scene.output(fields='displacement contact')
        scene.write(os.path.join(self.folder, 'run.nml'))
        try:
            results = dotyk.run(scene, threads=1, program=self.program)
        except dotyk.Error as error:
            sys.exit('%s: %s' % (self.name, error))
        self.runs += 1
        return Run(results)


def wavy(divisions, amplitude=0.002):
    """Geometry and scene of half a wave of two deep layers, elements of 1/divisions of the wave; the wave is in the gap."""
    nml = COLUMN_NML.replace('poisson=0.2', 'poisson=0.3').replace('young=7', 'young=1')
    nml = nml.replace('value=0,-1e-3', 'value=0,-6.2e-3')
    return (WAVE_GEO.replace('DIVISIONS', str(divisions)),
            nml.replace("lower face' /", "lower face', gap_formula='%r*(1-cos(2*pi*x))' /" % amplitude))


def layers(divisions, amplitude, mixed=False):
    """Geometry and scene of the layers; `mixed`: Robin conditions between the first two only."""
    nml = LAYERS_NML.replace('AMPLITUDE', repr(amplitude))
    if mixed:
        nml = nml.replace("name='second',", "name='second', condition='neumann',")
    return LAYERS_GEO.replace('DIVISIONS', str(divisions)), nml


def hertz(divisions):
    """The quarter of a ball on a block of inputs/hertz, with elements of 1/divisions of the contact radius."""
    texts = []
    for suffix in ('.geo', '.nml'):
        with open(os.path.join(ROOT, 'inputs/hertz/hertz' + suffix)) as file:
            texts.append(file.read())
    return ('n = %r;  m = 2;  g = 0.4;\n' % divisions + texts[0], texts[1])


def punch():
    """Geometry and scene of the punch."""
    nml = COLUMN_NML.replace('young=7, poisson=0.3', 'young=1, poisson=0.3').replace('poisson=0.2', 'poisson=0.3')
    return PUNCH_GEO, nml.replace("surface='bottom', fix='y'", "surface='bottom', fix='xy'")
