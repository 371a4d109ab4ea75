"""Assemblies that touch in one point: narrow edges, tips on facets, edges that cross."""
import numpy as np

import point_contact as pc
from assembly import Mesh, Scene, about, box
from assembly_rows import Row, solved


# 1.3: narrow edges, points on facets, edges on edges

def triangle(n, apex, half_width, height):
    """A knife: a triangle with its apex down, n divisions; patches 'left', 'right', 'top', group 'edge'."""
    x, number = [], {}
    for row in range(n + 1):
        for k in range(row + 1):
            number[row, k] = len(x)
            x.append((apex[0] + half_width * (2 * k - row) / n, apex[1] + height * row / n))
    cells = [(number[r, k], number[r + 1, k + 1], number[r + 1, k]) for r in range(n) for k in range(r + 1)]
    cells += [(number[r, k], number[r, k + 1], number[r + 1, k + 1]) for r in range(1, n) for k in range(r)]
    mesh = Mesh("tri3", np.array(x), np.array(cells))
    mesh.patch("top", lambda c: c[1] > apex[1] + height - 1e-9)
    for name, side in (("left", -1), ("right", 1)):
        mesh.patch(name, lambda c, side=side: (c[0] - apex[0]) * side > 0 and c[1] < apex[1] + height - 1e-9)
    return mesh.group("edge", "left", "right")


def knife(degrees, at=0.13, swap=False):
    """A knife edge of some degrees on a beam, at a place that is no node."""
    def run(seed=0, dotyk=None):
        beam = box("quad4", (16, 3), (-2, -0.4), (2, 0))
        blade = triangle(3, (at, 0), np.tan(np.radians(degrees / 2)), 1.0)
        scene = Scene("plane_strain").body("blade", blade, 10.0).body("beam", beam, 1.0)
        scene.fix("beam", "left", "xy").fix("beam", "right", "xy").fix("blade", "top", "xy", (0, -0.01))
        names = ["blade:edge", "beam:top"][::-1 if swap else 1]
        answer = solved(scene.pair("touch", *names), seed, dotyk)
        bodies = [pc.Body(blade, 10.0, 0.3, [("top", (0, -0.01))]),
                  pc.Body(beam, 1.0, 0.3, [("left", (0, 0)), ("right", (0, 0))])]
        force, u, v = pc.touch(*bodies, 0.0, (0, -1), ([0], [1.0]), pc.surface_point(beam, "top", (at, 0)))
        return point_rows(answer, swap, force, u, v, ("blade", "beam"), 1)
    return run


def point_rows(answer, swap, force, u, v, names, axis):
    """Force and largest displacement of the body that is pressed, over those of a contact in one point."""
    found = np.linalg.norm(answer.force()) / force
    errors = [np.abs(answer.bodies[name][1][:, :axis + 1] - w).max() / np.abs(v).max()
              for name, w in zip(names, (u, v))]
    return [Row("force over that of the point", found, 1.0, 1e-8),
            Row("error of the displacements", max(errors), 0.0, 1e-8)]


def vertex(height, at=(0.13, 0.21), swap=False):
    """The tip of a pyramid of base 1 and some height on a facet."""
    def run(seed=0, dotyk=None):
        block = box("hex8", (5, 5, 3), (-1, -1, -1), (1, 1, 0))
        x, y = at
        nodes = [(x, y, 0), (x, y, height)] + [(x + a, y + b, height) for a, b in ((-.5, -.5), (.5, -.5), (.5, .5),
                                                                                  (-.5, .5))]
        tip = Mesh("tet4", np.array(nodes), np.array([(0, 2 + (k + 1) % 4, 2 + k, 1) for k in range(4)]))
        tip.patch("top", lambda c: c[2] > height - 1e-9)
        for k, (axis, side) in enumerate(((1, -1), (0, 1), (1, 1), (0, -1))):
            tip.patch("flank %d" % k, lambda c, a=axis, s=side: c[2] < height - 1e-9 and (c[a] - at[a]) * s > 0.1)
        tip.group("tip", *["flank %d" % k for k in range(4)])
        move = (0, 0, -0.01)
        scene = Scene("3d").body("tip", tip, 10.0).body("block", block, 1.0)
        scene.fix("block", "bottom", "xyz").fix("tip", "top", "xyz", move)
        answer = solved(scene.pair("touch", *["tip:tip", "block:top"][::-1 if swap else 1]), seed, dotyk)
        bodies = [pc.Body(tip, 10.0, 0.3, [("top", move)]), pc.Body(block, 1.0, 0.3, [("bottom", (0, 0, 0))])]
        # pyramids with one node on top only have no unknowns but the tip
        force, u, v = pc.touch(*bodies, 0.0, (0, 0, -1), ([0], [1.0]), pc.surface_point(block, "top", (x, y, 0)))
        return point_rows(answer, swap, force, u, v, ("tip", "block"), 2)
    return run


def bar(n, angle, up):
    """A bar of length 4 with a square section, standing on its edge: the edge is at z = 0, up or down."""
    side = 0.5
    mesh = box("hex8", (n, 2, 2), (-2, 0, 0), (2, side, side))
    # the edge y = z = 0 is the ridge
    mesh.group("ridge", "front", "bottom")
    turn = about((0, 0, 1), angle) @ about((1, 0, 0), 225 if up else 45)
    return mesh.move(lambda x: x @ turn.T)


def crossed(angle=90, n=(5, 5), swap=False, place=0.0):
    """Two bars that cross with their edges, no node at the crossing; the upper one is moved down at its ends."""
    def run(seed=0, dotyk=None):
        low, high = bar(n[0], 0, True), bar(n[1], angle, False)
        along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0])
        high.move(lambda x: x + place * along)
        move = (0, 0, -0.01)
        scene = Scene("3d").body("upper", high).body("lower", low)
        for name in ("left", "right"):
            scene.fix("lower", name, "xyz").fix("upper", name, "xyz", move)
        answer = solved(scene.pair("touch", *["upper:ridge", "lower:ridge"][::-1 if swap else 1]), seed, dotyk)
        bodies = [pc.Body(mesh, 1.0, 0.3, [("left", value), ("right", value)])
                  for mesh, value in ((high, move), (low, (0, 0, 0)))]
        points = [ridge_point(mesh, direction) for mesh, direction in ((high, along), (low, np.array([1.0, 0, 0])))]
        force, u, v = pc.touch(*bodies, 0.0, (0, 0, -1), *points)
        return point_rows(answer, swap, force, u, v, ("upper", "lower"), 2)
    return run


def ridge_point(mesh, along):
    """Nodes and weights of the origin on the ridge of a bar."""
    ridge = np.where(np.linalg.norm(mesh.x - np.outer(mesh.x @ along, along), axis=1) < 1e-9)[0]
    s = mesh.x[ridge] @ along
    order = np.argsort(s)
    ridge, s = ridge[order], s[order]
    k = np.searchsorted(s, 0.0) - 1
    part = -s[k] / (s[k + 1] - s[k])
    return [ridge[k], ridge[k + 1]], [1 - part, part]
