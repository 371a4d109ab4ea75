"""Abaqus and CalculiX decks of blocks, one for each element type."""
import itertools
import re

import numpy as np

# Corners in the reference cube, edges with mid-side nodes, corners of S1, S2, ...: as the manual of CalculiX draws them.
HEXAHEDRON = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
SHAPES = {
    "tet": ("12 23 31 14 24 34", "123 142 243 341"),
    "hex": ("12 23 34 41 56 67 78 85 15 26 37 48", "1234 5876 1562 2673 3784 4851"),
    "wedge": ("12 23 31 45 56 64 14 25 36", "123 465 1452 2563 3641"),
    "pyramid": ("", "1234 152 253 354 451"),
    "tri": ("12 23 31", "12 23 31"),
    "quad": ("12 23 34 41", "12 23 34 41")}
CUBE = "*NODE\n" + "".join("%d, %g, %g, %g\n" % (i + 1, *x) for i, x in enumerate(HEXAHEDRON))


def corners(text):
    return [[int(c) - 1 for c in word] for word in text.split()]


def split(shape):
    """Elements of a cube by their corners, numbers of HEXAHEDRON."""
    if shape == "tet":
        whole = []
        for axes in itertools.permutations(range(3)):
            path = [0, 0, 0]
            tet = [0]
            for axis in axes:
                path[axis] = 1
                tet.append(HEXAHEDRON.index(tuple(path)))
            x = np.array([HEXAHEDRON[i] for i in tet])
            whole.append(tet if np.linalg.det(x[1:] - x[0]) > 0 else [tet[1], tet[0], *tet[2:]])
        return whole
    return {"hex": [range(8)], "wedge": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
            "pyramid": [[*face, 8] for face in ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))],
            "tri": [[0, 1, 2], [0, 2, 3]], "quad": [[0, 1, 2, 3]]}[shape]


def deck(name, shape, n=2, origin=(0, 0, 0)):
    """A block of n cubes or squares along each axis, its inside distorted, in elements of one type."""
    dim = 2 if shape in ("tri", "quad") else 3
    quadratic = re.search(r"\d+", name[3:]).group() in ("10", "15", "20") or dim == 2 and re.search(r"\d", name[3:]).group() in "68"
    nodes, elements = {}, []

    def number(x):
        return nodes.setdefault(tuple(np.round(x, 9)), len(nodes) + 1)

    for cell in itertools.product(range(n), repeat=dim):
        x = [np.array((*cell, 0)[:3]) + HEXAHEDRON[i] * np.array([1, 1, dim - 2]) for i in range(8)]
        x.append(np.mean(x, axis=0))
        x = [p + 0.15 * np.prod(np.sin(np.pi * p[:dim] / n)) * np.array([1, -0.8, 0.6 * (dim - 2)]) * (n > 1) for p in x]
        for element in split(shape):
            points = [x[i] for i in element]
            if quadratic:
                points += [(points[a] + points[b]) / 2 for a, b in corners(SHAPES[shape][0])]
            elements.append([number(p) for p in points])
    lines = ["*node, nset = All"] + ["%d, %r, %r, %r" % (i, *(float(c + o) for c, o in zip(x, origin))) for x, i in nodes.items()]
    lines.append("*Element, Type=%s, ELSET=block" % name)
    for i, element in enumerate(elements):
        text = [str(i + 1), *map(str, element)]
        lines += [", ".join(text[:9]) + ("," if len(text) > 9 else "")] + ([", ".join(text[9:])] if len(text) > 9 else [])
    return "\n".join(lines) + "\n"
