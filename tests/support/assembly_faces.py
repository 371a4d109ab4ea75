"""Assemblies: thin curved bodies, facets that are faces, neutral motions, bodies that carry nothing."""
import numpy as np

from assembly import Scene, box, grid_mesh
from assembly_rows import CLOSE, PRESS, Row, solved


# 1.4: both faces of a thin curved body

def arc(low, high, n, radial=1):
    """A quarter of a ring; patches 'in', 'out', 'plane x', 'plane y', group 'faces'."""
    mesh = grid_mesh("quad4", np.linspace(np.pi / 2, 0, n + 1), np.linspace(low, high, radial + 1))
    polar = mesh.x
    facets = {"in": lambda c: abs(c[1] - low) < 1e-9, "out": lambda c: abs(c[1] - high) < 1e-9,
              "plane x": lambda c: abs(c[0] - np.pi / 2) < 1e-9, "plane y": lambda c: abs(c[0]) < 1e-9}
    for name, holds in facets.items():
        mesh.patch(name, holds)
    mesh.move(lambda x: polar[:, 1:] * np.stack([np.cos(polar[:, 0]), np.sin(polar[:, 0])], axis=1))
    return mesh.group("faces", "in", "out")


def shells(geometry="smooth", n=(16, 16)):
    """Two thin arcs in each other, both faces of each in one group, under outer pressure."""
    def run(seed=0, dotyk=None):
        peaks, forces = [], []
        for names in (("outer:in", "inner:out"), ("outer:faces", "inner:faces")):
            scene = Scene("plane_strain").body("outer", arc(1.0, 1.05, n[0])).body("inner", arc(0.95, 1.0, n[1]))
            for body in ("outer", "inner"):
                scene.fix(body, "plane x", "n").fix(body, "plane y", "n")
            scene.load("outer", "out", pressure=PRESS).pair("touch", *names, "geometry='%s'" % geometry)
            answer = solved(scene, seed if len(peaks) else 0, dotyk)
            peaks.append(answer.peak() / PRESS)
            forces.append(answer.force() / PRESS)
        return [Row("peak pressure over that of the inner faces", peaks[1] / peaks[0], 1.0, 1e-8),
                Row("error of the force", np.abs(forces[1] - forces[0]).max(), 0.0, 1e-8)]
    return run


# 1.5: geometry='smooth'

def wedge(slope, n=1, m=4, swap=False):
    """A wedge with n facets per flank in a groove with m: contraction by prescribed displacements, a homogeneous
    pressure."""
    def run(seed=0, dotyk=None):
        t = np.tan(np.radians(slope))
        bodies = {}
        for name, k, low, high in (("wedge", n, 0.0, 2.0), ("groove", m, -2.0, 0.0)):
            mesh = box("quad4", (2 * k, 2), (-1, low), (1, high))
            centre = mesh.x.copy()
            side = "bottom" if name == "wedge" else "top"
            mesh.patch("flank 1", lambda c, s=low if name == "wedge" else high: c[1] == s and c[0] < 0)
            mesh.patch("flank 2", lambda c, s=low if name == "wedge" else high: c[1] == s and c[0] > 0)
            del mesh.patches[side], mesh.groups[side]
            mesh.group("flanks", "flank 1", "flank 2")
            far = 2.0 if name == "wedge" else -2.0
            mesh.move(lambda x, c=centre, far=far: x + np.outer(t * np.abs(c[:, 0]) * (1 - c[:, 1] / far), [0, 1]))
            bodies[name] = mesh
        e = 1e-3
        scene = Scene("plane_strain")
        for name, mesh in bodies.items():
            scene.body(name, mesh)
            for side in ("left", "right"):
                scene.fix(name, side, "n", (0, -e))
        scene.fix("wedge", "top", "n", (0, -2 * e)).fix("groove", "bottom", "n", (0, -2 * e))
        names = ["wedge:flanks", "groove:flanks"][::-1 if swap else 1]
        answer = solved(scene.pair("touch", *names), seed, dotyk)
        right = e / ((1 + 0.3) * (1 - 2 * 0.3))
        return [Row("force over the exact one", abs(answer.force()[1]) / (2 * right), 1.0, CLOSE),
                Row("peak pressure over the exact one", answer.peak() / right, 1.0, 1e-8)]
    return run


TUBE = """
Mesh.ElementOrder = 2;  Mesh.SecondOrderIncomplete = 1;  Mesh.SecondOrderLinear = %d;
Point(1) = {%r, 0, 0};
line() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };
ring() = Extrude { {0, 0, 1}, {0, 0, 0}, Pi/2 } { Curve{line(1)}; Layers{%d}; Recombine; };
Physical Surface("body") = {ring(1)};
Physical Curve("inside") = {Abs(ring(3))};
Physical Curve("outside") = {Abs(ring(2))};
Physical Curve("plane y") = {line(1)};
Physical Curve("plane x") = {ring(0)};
"""


def press_fit(straight=1, around=(13, 10)):
    """Press fit of quadratic elements; straight: mid nodes on the chords. Interference 1e-3, as meshed."""
    def run(seed=0, dotyk=None):
        inner, joint, outer, overlap, young, poisson = 1.0, 1.5, 2.2, 1e-3, 200.0, 0.3
        scene = Scene("plane_strain", solver="theta=0, tolerance=1e-9")
        scene.body("inner", TUBE % (straight, inner, joint + overlap - inner, 3, around[0]), young, poisson)
        scene.body("outer", TUBE % (straight, joint, outer - joint, 4, around[1]), young, poisson)
        for body in ("inner", "outer"):
            scene.fix(body, "plane x", "n").fix(body, "plane y", "n")
        answer = solved(scene.pair("fit", "inner:outside", "outer:inside"), seed, dotyk)
        stiffness = young / (1 - poisson**2)
        right = overlap * stiffness * (joint**2 - inner**2) * (outer**2 - joint**2) / (
            2 * joint**3 * (outer**2 - inner**2))
        fit = answer.pairs["fit"]
        mean = np.sum(fit["weight"] * fit["pressure"]) / np.sum(fit["weight"])
        return [Row("mean pressure over Lame's", mean / right, 1.0, 1e-2),
                Row("peak pressure over Lame's", fit["pressure_projected"].max() / right, 1.0, 4e-2)]
    return run


# 1.13: motions that nothing but the facets resists

GROOVE = """SetFactory("OpenCASCADE");
Box(1) = {-1.2, -0.6, %r, 2.4, 1.2, 1.0};
Cylinder(2) = {0, -2, %r, 0, 4, 0, 1.04};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Mesh.ElementOrder = 2;  Mesh.MeshSizeMax = 0.4;  Mesh.MeshSizeMin = 0.4;
Physical Volume("body") = {3};
Physical Surface("groove") = {Surface In BoundingBox {-1.1, -0.7, -1.1, 1.1, 0.7, 1.1}};
Physical Surface("back") = {Surface In BoundingBox {-1.3, -0.7, %r, 1.3, 0.7, %r}};
Physical Surface("end 1") = {Surface In BoundingBox {-1.3, -0.7, -1.6, 1.3, -0.5, 1.6}};
Physical Surface("end 2") = {Surface In BoundingBox {-1.3, 0.5, -1.6, 1.3, 0.7, 1.6}};
Physical Surface("side 1") = {Surface In BoundingBox {-1.3, -0.7, -1.6, -1.1, 0.7, 1.6}};
Physical Surface("side 2") = {Surface In BoundingBox {1.1, -0.7, -1.6, 1.3, 0.7, 1.6}};
"""
BALL = """SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 1};
Mesh.ElementOrder = 2;  Mesh.MeshSizeMax = %r;  Mesh.MeshSizeMin = %r;
Physical Volume("body") = {1};
Physical Surface("skin") = {1};
"""


def ball_in_grooves(size=0.4):
    """A ball between two grooves along y: spin and rolling along y are neutral."""
    def run(seed=0, dotyk=None):
        scene = Scene("3d", solver="theta=0, tolerance=1e-8")
        scene.body("ball", BALL % (size, size))
        for name, low in (("low", -1.5), ("high", 0.5)):
            back = -1.5 if name == "low" else 1.5
            scene.body(name, GROOVE % (low, 0.04 if name == "low" else -0.04, back - 0.1, back + 0.1))
            for side in ("end 1", "end 2", "side 1", "side 2"):
                scene.fix(name, side, "n")
            scene.pair("in " + name, "ball:skin", name + ":groove")
        scene.fix("low", "back", "n").load("high", "back", pressure=PRESS)
        answer = solved(scene, seed, dotyk)
        u = answer.bodies["ball"][1]
        drift = np.abs(u - [0, 0, u[:, 2].mean()]).max()
        right = PRESS * 2.4 * 1.2
        return [Row("force in the low groove", answer.pairs["in low"]["force"][2] / right, 1.0, 1e-2),
                Row("drift of the ball over the size of its facets", drift / size, 0.0, 0.2)]
    return run


# 1.14: what is left out

def named(what, log, *words):
    """Whether a line of a log has all words."""
    return Row(what, float(any(all(word in line for word in words) for line in log.splitlines())), 1.0, 0.0)


def left_out(seed=0, dotyk=None):
    """Two blocks and a nut that touches nothing; a second bolt whose face touches the lower block is in no pair."""
    scene = Scene("3d")
    scene.body("lower", box("hex8", 2, (0, 0, 0), (1, 1, 1))).body("upper", box("hex8", 2, (0, 0, 1), (1, 1, 2)))
    scene.body("nut", box("hex8", 1, (3, 0, 0), (4, 1, 1))).body("bolt", box("hex8", 1, (0.2, 0.2, -1), (0.8, 0.8, 0)))
    scene.fix("lower", "left", "xyz").fix("nut", "bottom", "xyz").fix("bolt", "bottom", "xyz").fix("upper", "left", "n")
    scene.fix("upper", "right", "n").fix("upper", "front", "n").fix("upper", "back", "n")
    scene.load("upper", "top", pressure=PRESS).pair("touch", "upper:bottom", "lower:top")
    answer = scene.solve(seed, dotyk)
    log = answer.log.split("factorization")[0] + "\n" + answer.log.split("factorization")[-1]
    return [named("the body that carries nothing is named", log.split("contact pair ")[-1], "nut"),
            named("the faces that touch and are in no pair are named", log, "bolt", "lower")]
