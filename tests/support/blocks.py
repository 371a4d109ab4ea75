"""Meshes of a block for the cases, and the column of two blocks with its exact solution.

The surfaces of a block are 'bottom', 'top', 'sides x' and 'sides y' (two dimensions: 'sides x'), its elements 'block'.
It stands along z, in two dimensions along y.
"""
import shutil
import subprocess

import numpy as np

# kind: dimension, order, incomplete, Recombine on the faces, Recombine in the volume
KINDS = {
    "tet4": (3, 1, 0, False, False), "tet10": (3, 2, 0, False, False),
    "prism6": (3, 1, 0, False, True), "prism15": (3, 2, 1, False, True), "prism18": (3, 2, 0, False, True),
    "hex8": (3, 1, 0, True, True), "hex20": (3, 2, 1, True, True), "hex27": (3, 2, 0, True, True),
    "tri3": (2, 1, 0, False, False), "tri6": (2, 2, 0, False, False),
    "quad4": (2, 1, 0, True, False), "quad8": (2, 2, 1, True, False), "quad9": (2, 2, 0, True, False)}


def dimension(kind):
    """2 or 3."""
    return KINDS[kind][0]


def block_geo(kind, n, origin=(0, 0, 0), size=(1, 1, 1)):
    """Geometry for gmsh of a block with n divisions along each edge, or one number for each; in two dimensions origin
    and size have two numbers."""
    d, order, incomplete, faces, volume = KINDS[kind]
    x, y, z = (*origin, 0)[:3]
    a, b, c = (*size, 0)[:3]
    n_x, n_y, n_z = (*n, 1)[:3] if isinstance(n, tuple) else (n, n, n)
    e = 1e-6 * max(size)
    text = """
Mesh.ElementOrder = %d;  Mesh.SecondOrderIncomplete = %d;
Point(1) = {%r, %r, %r};
line() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };
face() = Extrude {0, %r, 0} { Curve{line(1)}; Layers{%d}; %s };
""" % (order, incomplete, x, y, z, a, n_x, b, n_y, "Recombine;" * faces)
    if d == 2:
        text += 'Physical Surface("block") = {face(1)};\n'
    else:
        text += "body() = Extrude {0, 0, %r} { Surface{face(1)}; Layers{%d}; %s };\n" % (c, n_z, "Recombine;" * volume)
        text += 'Physical Volume("block") = {body(1)};\n'
    entity = "Curve" if d == 2 else "Surface"
    low, high = np.array((x, y, z), float), np.array((x + a, y + b, z + (c if d == 3 else 0)), float)
    for name, axis, sides in (("bottom", d - 1, "l"), ("top", d - 1, "h"), ("sides x", 0, "lh"),
                              ("sides y", 1, "lh"))[:d + 1]:
        boxes = []
        for side in sides:
            corners = [low.copy(), high.copy()]
            corners[0][axis] = corners[1][axis] = (low if side == "l" else high)[axis]
            box = [*(corners[0] - e).tolist(), *(corners[1] + e).tolist()]
            boxes.append("%s In BoundingBox {%s}" % (entity, ", ".join(map(repr, box))))
        text += 'Physical %s("%s") = {%s};\n' % (entity, name, ", ".join(boxes))
    return text


def mesh(geo, d, transform=None):
    """Mesh a .geo file with gmsh to a .msh file beside it (2.2, ASCII); transform maps coordinates (n, 3) to new
    ones."""
    msh = geo.with_suffix(".msh")
    subprocess.run([shutil.which("gmsh"), "-%d" % d, "-format", "msh22", "-o", str(msh), str(geo)],
                   check=True, stdout=subprocess.DEVNULL)
    if transform:
        lines = msh.read_text().split("\n")
        start = lines.index("$Nodes") + 2
        stop = lines.index("$EndNodes")
        nodes = [line.split() for line in lines[start:stop]]
        x = transform(np.array([[float(word) for word in node[1:]] for node in nodes]))
        lines[start:stop] = ["%s %r %r %r" % (node[0], *map(float, point)) for node, point in zip(nodes, x)]
        msh.write_text("\n".join(lines))
    return msh


# The column: two blocks of height 1 between smooth walls, pushed together.
LOWER, UPPER = (30.0, 0.2), (210.0, 0.3)  # Young's modulus, Poisson's ratio
SHORTENING = 1e-3


def column_nml(d, analysis=None, contact="", solver="theta_relative=1, tolerance=1e-12", output=""):
    """The scene of the column, with meshes lower.geo and upper.geo."""
    up = "xyz"[d - 1]
    value = ", ".join(["0"] * (d - 1) + ["-%r" % SHORTENING])
    lines = ["&scene analysis='%s' /" % (analysis or ("3d" if d == 3 else "plane_strain"))]
    for name, (young, poisson) in (("lower", LOWER), ("upper", UPPER)):
        lines += ["&material name='of %s', young=%r, poisson=%r /" % (name, young, poisson),
                  "&body name='%s', mesh='%s.geo', volume='block', material='of %s' /" % (name, name, name)]
        lines += ["&support body='%s', surface='sides %s', fix='%s' /" % (name, axis, axis) for axis in "xy"[:d - 1]]
    lines += ["&support body='lower', surface='bottom', fix='%s' /" % up,
              "&support body='upper', surface='top', fix='%s', value=%s /" % (up, value),
              "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' %s /" % contact,
              "&solver %s /" % solver, "&output %s /" % output]
    return "\n".join(lines) + "\n"


def column_exact(theta, analysis="3d", gap=0.0):
    """Pressure of the column's joint, shortening per height of the lower and the upper block, and stress along x over
    pressure."""
    def compliance(young, poisson):
        if analysis == "plane_stress":
            return (1 - poisson**2) / young
        return (1 + poisson) * (1 - 2 * poisson) / (young * (1 - poisson))

    lower, upper = compliance(*LOWER), compliance(*UPPER)
    pressure = (SHORTENING - gap) / (lower + upper + theta)
    return pressure, pressure * lower, pressure * upper
