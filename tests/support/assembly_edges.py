"""Assemblies: groups that wrap edges, and sheets that move farther than they are thick."""
import numpy as np

from assembly import Scene, about, box, grid_mesh, rotation
from assembly_rows import CLOSE, PRESS, Row, solved


# 1.1: groups that wrap edges

def corner_scene(kind, n, wrapped, pressed=("down",), swap=False, m=3):
    """A block in a corner: see corner."""
    block, room = corner_meshes(kind, n, m)
    d = block.d
    scene = Scene("3d" if d == 3 else "plane_strain")
    scene.body("block", block, 1.0, 0.3).body("room", room, 2.0, 0.0)
    for axis in range(d):
        scene.fix("room", "low %d" % axis, "n")
        if axis == d - 1 or "across" in pressed:
            pressure = PRESS if axis == d - 1 else 0.5 * PRESS
            scene.load("block", "high %d" % axis, pressure=pressure)
            scene.load("room", "high %d" % axis, pressure=pressure)
        else:
            scene.fix("block", "high %d" % axis, "n", [0] * (d - 1) + [PRESS])
    sides = ("block", "room")[::-1 if swap else 1]
    if wrapped:
        scene.pair("corner", "%s:corner" % sides[0], "%s:corner" % sides[1])
    else:
        for axis in range(d):
            scene.pair("wall %d" % axis, "%s:wall %d" % (sides[0], axis), "%s:wall %d" % (sides[1], axis))
    return scene


def corner_meshes(kind, n, m):
    """A cube with n divisions, and what is around it in a corner, m divisions."""
    d = 2 if kind in ("quad4", "tri3") else 3
    block = grid_mesh(kind, *[np.linspace(0, 1, n + 1)] * d)
    room = grid_mesh(kind, *[np.linspace(-1, 1, 2 * m + 1)] * d, keep=lambda c: c.min() < 0)
    for axis in range(d):
        block.patch("wall %d" % axis, lambda c, axis=axis: c[axis] < 1e-9)
        block.patch("high %d" % axis, lambda c, axis=axis: c[axis] > 1 - 1e-9)
        room.patch("wall %d" % axis, lambda c, axis=axis: abs(c[axis]) < 1e-9)
        room.patch("high %d" % axis, lambda c, axis=axis: c[axis] > 1 - 1e-9)
        room.patch("low %d" % axis, lambda c, axis=axis: c[axis] < -1 + 1e-9)
    for mesh in (block, room):
        mesh.group("corner", *["wall %d" % axis for axis in range(d)])
    return block, room


def corner(kind="quad4", n=4, wrapped=True, pressed=("down",), swap=False):
    """A block in a corner pressed down, moved away from the walls or pressed on them: uniaxial or biaxial stress."""
    def run(seed=0, dotyk=None):
        answer = solved(corner_scene(kind, n, wrapped, pressed, swap), seed, dotyk)
        d = 2 if kind in ("quad4", "tri3") else 3
        force = answer.force() * (-1 if swap else 1) / PRESS
        sides = [0.5 if "across" in pressed else 0.0] * (d - 1)
        rows = [Row("peak pressure", answer.peak() / PRESS, 1.0, CLOSE),
                Row("force on the floor", force[d - 1], 1.0, CLOSE)]
        rows += [Row("force on wall %d" % (k + 1), force[k], sides[k], CLOSE) for k in range(d - 1)]
        if not sides[0]:
            away = 1 - (0.39 if d == 2 else 0.3)
            rows.append(Row("corner away from the wall", answer.at("block", *[0] * d)[0] / PRESS, away, CLOSE))
        return rows
    return run


def hexagon_point(s):
    """Points of a hexagon of apothem 1, s in 0...6."""
    k = np.floor(s).astype(int) % 6
    corner = np.array([[np.cos(a), np.sin(a)] for a in np.radians(60 * np.arange(7))]) / np.cos(np.pi / 6)
    part = (s - np.floor(s))[:, None]
    return (1 - part) * corner[k] + part * corner[k + 1]


def hexagon_mesh(n, low, high, radial):
    """A ring between two hexagons; patches 'in k' and 'out k'."""
    mesh = grid_mesh("quad4", np.arange(6 * n) / n, np.linspace(low, high, radial + 1), ring=True)
    mesh.move(lambda x: x[:, 1:] * hexagon_point(x[:, 0]))
    across = [np.array([np.cos(a), np.sin(a)]) for a in np.radians(30 + 60 * np.arange(6))]
    for k, normal in enumerate(across):
        mesh.patch("in %d" % k, lambda c, normal=normal: abs(c @ normal - low) < 1e-9)
        mesh.patch("out %d" % k, lambda c, normal=normal: abs(c @ normal - high) < 1e-9)
    mesh.group("in", *["in %d" % k for k in range(6)]).group("out", *["out %d" % k for k in range(6)])
    return mesh


def hexagon_rotation(n, wrapped, swap, seed, dotyk, m=None):
    """Rotation of a hexagonal shaft under a torque in a hexagonal hole."""
    scene = Scene("plane_strain")
    scene.body("shaft", hexagon_mesh(n, 0.4, 1.0, 2)).body("hub", hexagon_mesh(m or n, 1.0, 1.6, 2))
    scene.fix("hub", "out", "xy")
    for k in range(6):
        angle = np.radians(120 + 60 * k)
        scene.load("shaft", "in %d" % k, traction=PRESS * np.array([np.cos(angle), np.sin(angle)]))
    names = ["shaft:out", "hub:in"][::-1 if swap else 1]
    if wrapped:
        scene.pair("all", *names)
    else:
        for k in range(6):
            scene.pair("flat %d" % k, *[name + " %d" % k for name in names])
    x, u = solved(scene, seed, dotyk).bodies["shaft"]
    return np.sum(x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0]) / np.sum(x * x) / PRESS


def hexagon(n, swap=False, m=None):
    """One group for each body against one pair for each flat."""
    def run(seed=0, dotyk=None):
        right = hexagon_rotation(n, False, swap, 0, dotyk, m)
        return [Row("rotation over that of six pairs", hexagon_rotation(n, True, swap, seed, dotyk, m) / right, 1.0,
                    1e-6)]
    return run


# 1.2: search radius

def sheet_scene(radius, thin):
    """A sheet over a crowned die, pressed down."""
    thick = 0.02 if thin else 0.1
    sheet = box("quad4", (40, 1), (-2, 0), (2, thick))
    die = box("quad4", (24, 4), (-1.5, -1.2), (1.5, -0.2))
    top, crown = SHEET[thin]
    die.move(lambda x: x + np.outer((x[:, 1] + 1.2) * (0.2 - top - crown * x[:, 0]**2), [0, 1]))
    scene = Scene("plane_strain").body("sheet", sheet).body("die", die, 1e4)
    scene.fix("sheet", "left", "xy").fix("sheet", "right", "xy").fix("die", "bottom", "xy")
    scene.load("sheet", "top", pressure=4e-5 if thin else 2e-3)
    return scene.pair("touch", "sheet:bottom", "die:top", "search_radius=%r" % radius if radius else "")


# thin: distance of the die's top from the sheet, its crown
SHEET = {False: (0.08, 0.1), True: (0.005, 0.125)}


def sheet(turns=(0, 1, 5), thin=False):
    """Deflection of a sheet whose way is longer than its thickness, turned by some degrees."""
    def run(seed=0, dotyk=None):
        rows = []
        right = solved(sheet_scene(10.0, thin), 0, dotyk)
        for degrees in turns:
            turn = about((0, 0, 1), degrees) @ rotation(seed, 2)
            answer = solved(sheet_scene(None, thin), 0, dotyk, turn=turn)
            rows.append(Row("deflection turned by %g degrees" % degrees, -answer.at("sheet", 1, 0)[1],
                            -right.at("sheet", 1, 0)[1], 1e-8))
            x, u = answer.bodies["sheet"]
            low = (x[:, 1] < 1e-9) & (np.abs(x[:, 0]) < 1.5)
            top, crown = SHEET[thin]
            depth = (-top - crown * x[low, 0]**2 - x[low, 1] - u[low, 1]).max()
            rows.append(Row("depth in the die turned by %g degrees" % degrees, max(0.0, depth), 0.0, 3e-3))
        return rows
    return run
