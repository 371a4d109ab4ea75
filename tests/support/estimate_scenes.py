"""Scenes that are hard on estimates of the discretization error, with true errors: corners where stresses are singular, thin
sheets of one layer, moduli that jump.

Loads are constant and supports at rest, so that the squared energy norms of a solution and of its error add up to that of
the exact solution, which a fine mesh of biquadratic squares gives, graded towards the singular points. The scenes in three
dimensions are the plane ones between smooth walls: they have the same exact solution.
"""
import os
import subprocess

import grid
import h5py
import numpy as np

KINDS_2D = ("tri3", "quad4", "tri6", "quad8", "quad9")
KINDS_3D = ("tet4", "hex8", "prism6", "pyramid5", "tet10", "hex20", "prism15", "pyramid13", "pyramid14")


class Cut(grid.Block):
    """A block without some of its cells: keep gives those that stay, from their centres."""

    def __init__(self, name, keep, *lines, **others):
        super().__init__(name, *lines, **others)
        self.keep = keep


def cut(block, kind, whole=grid.cut):
    """Nodes and elements of a block, as in grid."""
    x, groups = whole(block, kind)
    if isinstance(block, Cut):
        groups = [group[block.keep(x[group].mean(axis=1))] for group in groups]
        used = np.unique(np.concatenate([group.ravel() for group in groups]))
        new = np.full(len(x), -1)
        new[used] = np.arange(len(used))
        x, groups = x[used], [new[group] for group in groups]
    return x, [group for group in groups if len(group)]


grid.cut = cut


def line(low, high, n, singular=(), graded=False):
    """n equal divisions; graded: halved 24 times towards the singular points."""
    places = grid.even(low, high, n)
    if graded:
        h = (high - low) / n
        places = np.concatenate([places] + [end + side * h * 0.5**np.arange(1, 24) for end in singular for side in (-1, 1)])
        places = np.unique(np.round(places[(places >= low) & (places <= high)], 14))
    return places


def at(axis, value):
    """Facets on a plane."""
    return lambda p: bool(np.all(np.abs(p[:, axis] - value) < 1e-9))


def square(n, graded, singular):
    """Lines and patches of the unit square."""
    return [line(0, 1, n, singular, graded)] * 2, None, {}


def cornered(n, graded):
    """An L: the square from -1 to 1 without its lower right quarter."""
    both = line(-1, 1, 2 * n, (0,), graded)
    return [both, both], lambda c: ~((c[:, 0] > 0) & (c[:, -1] < 0)), {"right": at(0, 1), "lower": at(-1, -1)}


def cracked(n, graded):
    """The upper half of a square with a crack along x < 0."""
    patches = {"right": at(0, 1), "ligament": lambda p: at(-1, 0)(p) and bool(np.all(p[:, 0] > -1e-9))}
    return [line(-1, 1, 2 * n, (0,), graded), line(0, 1, n, (0,), graded)], None, patches


def sheet(length, n, graded, singular=()):
    """A sheet of thickness 1: one layer."""
    across = grid.even(0, 1, 8 if graded else 1)
    along = line(0, length, 4 * n if graded else n, singular, graded and bool(singular))
    return [along, across], None, {"left": at(0, 0), "right": at(0, length)}


PUSH, SHEAR, LIFT = "top', pressure=1e-3", "top', traction=1e-3,0", "right', traction=0,1e-3"
# name: shape (divisions, graded), supports (surface, directions), load, modulus field, how fine the reference is
SCENES = {
    "smooth": (lambda n, g: square(n, False, ()), (("bottom", "y"), ("sides x", "x")),
               "top', pressure_formula='1e-3*cos(3.14159265358979*x)'", "1", 32),
    "corner": (cornered, (("lower", "xy"),), LIFT, "1", 8),
    "corner on rollers": (cornered, (("lower", "y"), ("right", "x")), PUSH, "1", 8),
    "clamped, pressed": (lambda n, g: square(n, g, (0, 1)), (("bottom", "xy"),), PUSH, "1", 8),
    "clamped, sheared": (lambda n, g: square(n, g, (0, 1)), (("bottom", "xy"),), SHEAR, "1", 8),
    "crack": (cracked, (("ligament", "y"), ("right", "x")), "top', pressure=-1e-3", "1", 8),
    "sheet 1:5": (lambda n, g: sheet(5, n, g), (("left", "x"), ("right", "y")), PUSH, "1", 8),
    "sheet 1:20": (lambda n, g: sheet(20, n, g), (("left", "x"), ("right", "y")), PUSH, "1", 8),
    "sheet 1:100": (lambda n, g: sheet(100, n, g), (("left", "x"), ("right", "y")), PUSH, "1", 8),
    "sheet 1:1000": (lambda n, g: sheet(1000, n, g), (("left", "x"), ("right", "y")), "top', pressure=1e-14", "1", 8),
    "clamped sheet 1:20": (lambda n, g: sheet(20, n, g, (0, 20)), (("left", "xy"),), "top', pressure=1e-6", "1", 8),
    "modulus jumps by 10": (lambda n, g: square(n, False, ()), (("bottom", "y"), ("sides x", "x")),
                            "top', pressure_formula='1e-3*cos(3.14159265358979*x)'", "x < 0.5 ? 1 : 10", 48),
    "modulus jumps by 1000": (lambda n, g: square(n, False, ()), (("bottom", "y"), ("sides x", "x")),
                              "top', pressure_formula='1e-3*cos(3.14159265358979*x)'", "x < 0.5 ? 1 : 1000", 48),
}


def wrapped(n, graded, slave):
    """A square block in the notch of a coarser one: one pair of groups that wrap the corner, pressed by unequal pressures."""
    def notch(p):
        return (at(0, 0)(p) or at(1, 0)(p)) and bool(p.min() > -1e-9)

    both, near = line(-1, 1, 2 * n, (-1, 0, 1), graded), line(0, 1, n if graded else 3 * n // 2, (0, 1), graded)
    die = Cut("die", lambda c: (c < 0).any(axis=1), both, both,
              patches={"die left": at(0, -1), "die lower": at(1, -1), "notch": notch})
    part = grid.Block("part", near, near, patches={"wrap": lambda p: at(0, 0)(p) or at(1, 0)(p), "right": at(0, 1)})
    sides = {"die": ("die:notch", "part:wrap"), "part": ("part:wrap", "die:notch")}[slave]
    return [die, part], ("&material name='m', young=1, poisson=0.3 /\n"
                         "&body name='die', volume='die', material='m' /\n"
                         "&body name='part', volume='part', material='m' /\n"
                         "&support body='die', surface='die left', fix='xy' /\n"
                         "&support body='die', surface='die lower', fix='xy' /\n"
                         "&load body='part', surface='top', pressure=1e-3 /\n"
                         "&load body='part', surface='right', pressure=4e-4 /\n"
                         "&contact name='around the corner', surface_a='%s', surface_b='%s' /\n"
                         "&solver theta=0 /\n" % sides)


# name: slave
WRAPPED = {"contact wraps a corner, %s is slave" % name: name for name in ("die", "part")}


def scene(name, kind, n, graded):
    """Blocks and namelist of a scene; the width of the body in three dimensions."""
    if name in WRAPPED:
        return *wrapped(n, graded, WRAPPED[name]), 1.0
    shape, supports, load, modulus, _ = SCENES[name]
    lines, keep, patches = shape(n, graded)
    d = grid.dimension(kind)
    width = 1.0
    if d == 3:
        width = 1 / n
        lines = [lines[0], grid.even(0, width, 1), lines[1]]
        supports = [(surface, fix.replace("y", "z")) for surface, fix in supports] + [("sides y", "y")]
        load = load.replace("traction=1e-3,0", "traction=1e-3,0,0").replace("traction=0,", "traction=0,0,")
    block = Cut("s", keep or (lambda c: np.ones(len(c), bool)), *lines, patches=patches)
    text = "&material name='m', young=1, poisson=0.3, young_formula='%s' /\n&body name='s', volume='s', material='m' /\n" % modulus
    if modulus == "1":
        text = text.replace(", young_formula='1'", "")
    text += "".join("&support body='s', surface='%s', fix='%s' /\n" % support for support in supports)
    return [block], text + "&load body='s', surface='%s /\n" % load, width


def solve(folder, dotyk, name, kind, n, graded=False):
    """Energy norm, estimated error (both per square root of width) of a scene; with that of the mortar rows, if any."""
    stem = "%s %s %d %d" % (name.replace(":", " to "), kind, n, graded)
    blocks, text, width = scene(name, kind, n, graded)
    grid.write_mesh(os.path.join(folder, stem + ".msh"), blocks, kind)
    with open(os.path.join(folder, stem + ".nml"), "w", encoding="ascii") as file:
        file.write("&scene mesh='%s.msh', analysis='%s', output='%s.vtkhdf' /\n%s"
                   % (stem, "plane_strain" if grid.dimension(kind) == 2 else "3d", stem, text))
    subprocess.run([dotyk, stem + ".nml", "--quiet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    with h5py.File(os.path.join(folder, stem + ".vtkhdf")) as file:
        found = file["dotyk/summary"].attrs
        estimate = np.hypot(found["error_discretization"], found["error_contact"] if name in WRAPPED else 0)
        return found["energy_norm"] / np.sqrt(width), estimate * found["energy_norm"] / np.sqrt(width)


def reference(folder, dotyk, name):
    """Energy norm of the exact solution."""
    return solve(folder, dotyk, name, "quad9", 6 if name in WRAPPED else SCENES[name][4], True)[0]


def ratio(folder, dotyk, name, kind, n, exact):
    """True relative error, and the estimate over the true error."""
    norm, estimate = solve(folder, dotyk, name, kind, n)
    true = np.sqrt(max(exact**2 - norm**2, 0))
    return true / exact, estimate / true
