#!/usr/bin/env python3
"""Balls in a box under gravity, none of which is held: writes the scene, solves it, checks statics, prints a line of a table.

usage: benchmarks/balls.py [--dotyk PROGRAM] [--folder FOLDER] [--options 'theta=0'] NX NY NZ

One coarse mesh of a ball is placed NX*NY*NZ times on a lattice with gaps without order; the box is a floor and four walls. Every ball is
in equilibrium if the forces of its contacts add up to its weight, and the floor carries all of them.
"""
import argparse
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile

PROGRAM = pathlib.Path(__file__).resolve().parents[1] / "build/release/dotyk"
RADIUS, GAP, WALL, MESH, SEARCH = 1.0, 0.02, 1.0, 0.45, 0.12
SCENE = """&scene title='balls in a box', mesh='box.geo' /
&material name='m', young=1e4, poisson=0.3 /
"""


def write_ball(folder):
    """One ball about the origin."""
    (folder / "ball.geo").write_text("""SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, %g};
Mesh.MeshSizeMax = %g;  Mesh.MeshSizeMin = %g;
Physical Volume("ball") = {1};
Physical Surface("skin") = {1};
""" % (RADIUS, MESH, MESH))


def write_box(folder, size):
    """Floor and walls, held on their outer faces. Returns their lines of the namelist."""
    x, y, z = size
    parts = {"floor": ((0, 0, -WALL), (x, y, 0), 2, 0), "left": ((-WALL, 0, 0), (0, y, z), 0, 0),
             "right": ((x, 0, 0), (x + WALL, y, z), 0, x), "front": ((0, -WALL, 0), (x, 0, z), 1, 0),
             "back": ((0, y, 0), (x, y + WALL, z), 1, y)}
    text = 'SetFactory("OpenCASCADE");\nMesh.MeshSizeMax = %g;  Mesh.MeshSizeMin = %g;\n' % (RADIUS, RADIUS)
    lines = ""
    for number, (name, (low, high, axis, inner)) in enumerate(parts.items(), 1):
        edges = [b - a for a, b in zip(low, high)]
        text += "Box(%d) = {%s};\n" % (number, ", ".join("%.15g" % v for v in (*low, *edges)))
        text += 'Physical Volume("%s") = {%d};\n' % (name, number)
        outer = low[axis] if inner == high[axis] else high[axis]
        for side, place in (("inner", inner), ("outer", outer)):
            a, b = list(low), list(high)
            a[axis] = b[axis] = place
            box = ", ".join("%.15g" % v for v in [v - 1e-6 for v in a] + [v + 1e-6 for v in b])
            text += 's() = Surface In BoundingBox {%s};\nPhysical Surface("%s %s") = {s()};\n' % (box, name, side)
        lines += "&body name='%s', volume='%s', material='m' /\n" % (name, name)
        lines += "&support body='%s', surface='%s outer', fix='xyz' /\n" % (name, name)
    (folder / "box.geo").write_text(text)
    return lines


def write_scene(folder, n, options, seed=1):
    """Meshes and input. Returns the numbers of balls and pairs."""
    rng = random.Random(seed)
    pitch = 2 * RADIUS + GAP
    size = [pitch * k for k in n]
    cells = [(i, j, k) for i in range(n[0]) for j in range(n[1]) for k in range(n[2])]
    place = {cell: [pitch * (c + 0.5) + rng.uniform(-GAP / 4, GAP / 4) for c in cell] for cell in cells}
    name = {cell: "ball %d" % (i + 1) for i, cell in enumerate(cells)}
    write_ball(folder)
    text = SCENE + write_box(folder, size)
    pairs = []
    for cell in cells:
        text += "&body name='%s', volume='ball', mesh='ball.geo', material='m', at=%.15g,%.15g,%.15g /\n" % (name[cell], *place[cell])
        text += "&load body='%s', force_density=0,0,-1 /\n" % name[cell]
        for axis in range(3):
            other = tuple(c + (a == axis) for a, c in enumerate(cell))
            if other in name:
                pairs.append((name[cell], name[other], name[other] + ":skin"))
        walls = (("left", cell[0] == 0), ("right", cell[0] == n[0] - 1), ("front", cell[1] == 0), ("back", cell[1] == n[1] - 1),
                 ("floor", cell[2] == 0))
        pairs += [(name[cell], wall, "%s:%s inner" % (wall, wall)) for wall, touches in walls if touches]
    for a, b, surface in pairs:
        text += "&contact name='%s, %s', surface_a='%s:skin', surface_b='%s', search_radius=%g /\n" % (a, b, a, surface, SEARCH)
    text += "&solver %s /\n&output fields='displacement contact', error_parts='' /\n" % options
    (folder / "balls.nml").write_text(text)
    return len(cells), len(pairs)


def check_statics(path):
    """Weight of a ball; how far forces on any ball are from the mean, and the floor's from all weights, relative to a weight."""
    import h5py
    import numpy as np
    total, floor = {}, np.zeros(3)
    with h5py.File(path) as file:
        for pair, data in file["dotyk/contact"].items():
            force = data.attrs["force"]
            a, b = pair.split(", ")
            total[a] = total.get(a, np.zeros(3)) + force
            if b.startswith("ball"):
                total[b] = total.get(b, np.zeros(3)) - force
            if b == "floor":
                floor += force
        summary = dict(file["dotyk/summary"].attrs)
    forces = np.array(list(total.values()))
    weight = forces[:, 2].mean()
    spread = np.abs(forces - [0, 0, weight]).max() / weight
    # The walls are smooth and upright.
    return weight, spread, abs(floor[2] / weight - len(forces)), summary


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", default=os.environ.get("DOTYK", str(PROGRAM)))
    parser.add_argument("--folder", help="where to leave scene and results; if absent, nowhere")
    parser.add_argument("--options", default="theta_mesh=1e-2, tolerance=1e-6", help="keys of &solver")
    parser.add_argument("n", type=int, nargs=3)
    wish = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(wish.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        balls, pairs = write_scene(folder, wish.n, wish.options)
        done = subprocess.run([wish.dotyk, "balls.nml", "--threads", "1"], cwd=folder, stdout=subprocess.PIPE, text=True)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode > 1:
            sys.exit("balls: exit code %d" % done.returncode)
        weight, spread, floor, summary = check_statics(folder / "balls.vtkhdf")
    print("balls    modes  pairs  constraints  iterations  processor time [s]  memory [GiB]  bound    forces - weight  floor - weights")
    print("%5d  %7d  %5d  %11d  %10d  %18.1f  %12.2f  %7.1e  %15.1e  %15.1e" % (
        balls, summary["rigid_body_modes"], pairs, summary["constraints"], summary["iterations"], used.ru_utime + used.ru_stime,
        used.ru_maxrss / 2**20, summary["error_bound"], spread, floor))
    return 0 if done.returncode == 0 and spread < 1e-9 and floor < 1e-9 * balls else 1


if __name__ == "__main__":
    sys.exit(main())
