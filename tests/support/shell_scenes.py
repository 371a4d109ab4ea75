"""Thin shells of one layer of quadratic elements under internal pressure, with exact stresses: a spherical and a cylindrical
patch between planes through the centre, which Lame's solutions meet at any thickness.

The true error is the norm of the difference to the exact stress, element by element, that of curved facets included.
"""
import os
import subprocess
import sys

import grid
import h5py
import numpy as np
from dotyk_case import ROOT

sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "tools/python")]
import energy_norm  # noqa: E402

ANGLE, PRESSURE, POISSON = np.pi / 4, 1e-6, 0.3
KINDS = ("tet10", "prism15", "prism18", "hex20", "hex27")


def sphere(x, thickness):
    """A patch of a sphere with mean radius 1 from angles to two planes through the centre and the place in the layer."""
    p = np.stack([np.tan(x[:, 0]), np.tan(x[:, 1]), np.ones(len(x))], axis=1)
    return p / np.linalg.norm(p, axis=1)[:, None] * (1 + thickness * (x[:, 2:] - 0.5))


def cylinder(x, thickness):
    """A patch of a cylinder along y with mean radius 1."""
    r = 1 + thickness * (x[:, 2] - 0.5)
    return np.stack([r * np.sin(x[:, 0]), x[:, 1], r * np.cos(x[:, 0])], axis=1)


SHAPES = {"sphere": sphere, "cylinder": cylinder}


def exact_stress(name, thickness):
    """Lame's stress, as energy_norm wants it; the cylinder between smooth walls."""
    inner, outer = 1 - thickness / 2, 1 + thickness / 2
    power = 3 if name == "sphere" else 2

    def stress(x, y, z, _):
        place = np.array([x, y if name == "sphere" else 0 * y, z])
        r = np.linalg.norm(place, axis=0)
        normal = place / r
        base = PRESSURE * inner**power / (outer**power - inner**power)
        radial, hoop = base * (1 - (outer / r)**power), base * (1 + (outer / r)**power / (power - 1))
        tensor = hoop * np.eye(3)[:, :, None] + (radial - hoop) * normal[:, None] * normal
        if name == "cylinder":
            tensor[1, 1] = POISSON * (radial + hoop)
        return np.array([tensor[i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))])
    return stress


def bend(path, shape):
    """Move all nodes of a mesh: those in the middle of edges, too, which gmsh places on straight lines."""
    with open(path, encoding="ascii") as file:
        lines = file.read().split("\n")
    start = lines.index("$Nodes") + 2
    end = lines.index("$EndNodes")
    rows = [line.split() for line in lines[start:end]]
    places = shape(np.array([[float(value) for value in row[1:]] for row in rows]))
    lines[start:end] = ["%s %r %r %r" % (row[0], *map(float, place)) for row, place in zip(rows, places)]
    with open(path, "w", encoding="ascii") as file:
        file.write("\n".join(lines))


def on(axis, value):
    """Facets of the grid at this coordinate."""
    return lambda place: bool(np.all(np.abs(place[:, axis] - value) < 1e-9))


def pressed_roof(folder, dotyk, kind, n, layers=1, near=4):
    """A quarter of a cylindrical roof, R/t = 50, clamped at its edges, under a round punch of near by near cells.

    Results file, energy norm and estimated relative error.
    """
    stem, thickness, width, aside = "roof %s %d %d" % (kind, n, layers), 0.02, 0.2, 10
    path = os.path.join(folder, stem)
    line = ANGLE * grid.even(0, 1, n)**1.5
    square = aside + grid.even(0, width, near)
    roof = grid.Block("roof", line, line, grid.even(0, 1, layers), patches={
        "left": on(0, 0), "right": on(0, ANGLE), "front": on(1, 0), "back": on(1, ANGLE), "outside": on(2, 1)})
    punch = grid.Block("punch", square, square, grid.even(0, 1, 2), patches={
        "punch left": on(0, aside), "punch front": on(1, aside), "round": on(2, 0), "punch top": on(2, 1)})
    grid.write_mesh(path + ".msh", [roof, punch], kind)

    def shape(x):
        y, of_punch = cylinder(x, thickness), x[:, 0] > aside / 2
        a, b, c = (x[of_punch] - [aside, aside, 0]).T
        low = 1 + thickness / 2 + (a**2 + b**2) / 0.6
        y[of_punch] = np.stack([a, b, low + (1.3 - low) * c], axis=1)
        return y
    bend(path + ".msh", shape)
    supports = (("roof", "left", "'x'"), ("roof", "front", "'y'"), ("roof", "right", "'xyz'"), ("roof", "back", "'xyz'"),
                ("punch", "punch left", "'x'"), ("punch", "punch front", "'y'"), ("punch", "punch top", "'z', value=0,0,-2e-3"))
    with open(path + ".nml", "w", encoding="ascii") as file:
        file.write("&scene mesh='%s.msh', output='%s.vtkhdf' /\n&material name='m', young=1, poisson=%g /\n"
                   "&body name='roof', volume='roof', material='m' /\n&body name='punch', volume='punch', material='m' /\n"
                   "&contact name='c', surface_a='roof:outside', surface_b='punch:round' /\n&solver theta=0 /\n"
                   % (stem, stem, POISSON))
        file.writelines("&support body='%s', surface='%s', fix=%s /\n" % support for support in supports)
    subprocess.run([dotyk, stem + ".nml", "--quiet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    with h5py.File(path + ".vtkhdf") as file:
        found = file["dotyk/summary"].attrs
        return path + ".vtkhdf", found["energy_norm"], found["error_discretization"]


def ratio(folder, dotyk, name, kind, n, slenderness):
    """True relative error of a shell of n by n cells, and the estimate over the true error."""
    stem, thickness = "%s %s %d %d" % (name, kind, n, slenderness), 1 / slenderness
    path = os.path.join(folder, stem)
    grid.write_mesh(path + ".msh", [grid.Block("s", grid.even(0, ANGLE, n), grid.even(0, ANGLE, n), grid.even(0, 1, 1))],
                    kind)
    bend(path + ".msh", lambda x: SHAPES[name](x, thickness))
    with open(path + ".nml", "w", encoding="ascii") as file:
        file.write("&scene mesh='%s.msh', output='%s.vtkhdf' /\n&material name='m', young=1, poisson=%g /\n"
                   "&body name='s', volume='s', material='m' /\n&load body='s', surface='bottom', pressure=%g /\n"
                   "&support body='s', surface='sides x', fix='n' /\n&support body='s', surface='sides y', fix='n' /\n"
                   % (stem, stem, POISSON, PRESSURE))
    subprocess.run([dotyk, stem + ".nml", "--quiet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    true = energy_norm.error(path + ".vtkhdf", exact_stress(name, thickness))
    with h5py.File(path + ".vtkhdf") as file:
        found = file["dotyk/summary"].attrs
        return true / found["energy_norm"], found["error_discretization"] * found["energy_norm"] / true
