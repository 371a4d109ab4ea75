"""Meshes of blocks on grids, written as gmsh 2.2 files without gmsh: sizes, shapes and digits are those that a scene asks for.

The surfaces of a block are 'bottom', 'top', 'sides x' and 'sides y' (two dimensions: 'sides x'), its elements have the name of the
block. It stands along z, in two dimensions along y.
"""
import itertools

import numpy as np

# nodes of a cell in gmsh's order, as offsets along x, y, z
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
CUBE = [(*corner, z) for z in (0, 1) for corner in SQUARE]
# simplices of a cell: both ways of cutting give faces that fit each other (Kuhn's triangulation)
TRIANGLES = [(0, 1, 2), (0, 2, 3)]
TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
# kind: cell, its elements, gmsh's types of element and facet
KINDS = {"quad4": (SQUARE, [(0, 1, 2, 3)], 3, 1), "tri3": (SQUARE, TRIANGLES, 2, 1),
         "hex8": (CUBE, [tuple(range(8))], 5, 3), "tet4": (CUBE, TETRAHEDRA, 4, 2)}


class Block:
    """A block: lines of the grid along each direction, and a map of coordinates (n, d) to new ones."""

    def __init__(self, name, *lines, shape=None):
        self.name, self.lines, self.shape = name, [np.asarray(line, float) for line in lines], shape


def even(low, high, n):
    """A line of n equal divisions."""
    return np.linspace(low, high, n + 1)


def boundary(elements, dimension, cell):
    """Facets that one element alone has, and the element of each."""
    if dimension == 2:
        sides = [(i, (i + 1) % len(elements[0])) for i in range(len(elements[0]))]
    elif len(elements[0]) == 4:
        sides = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    else:
        sides = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    facets = np.concatenate([elements[:, side] for side in sides])
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return facets[first[count == 1]]


def write_mesh(path, blocks, kind):
    """Write blocks as one mesh."""
    cell, pieces, type_of_element, type_of_facet = KINDS[kind]
    d = len(cell[0])
    names, nodes, lines = {}, [], []
    for block in blocks:
        counts = [len(line) for line in block.lines]
        number = np.arange(np.prod(counts)).reshape(counts)
        x = np.stack(np.meshgrid(*block.lines, indexing="ij"), axis=-1).reshape(-1, d)
        cells = np.stack([number[tuple(slice(o, n - 1 + o) for o, n in zip(offset, counts))].ravel() for offset in cell], axis=1)
        elements = np.concatenate([cells[:, piece] for piece in pieces])
        start = sum(map(len, nodes)) + 1
        group = names.setdefault((d, block.name), len(names) + 1)
        lines += [(type_of_element, group, element + start) for element in elements]
        for facet in boundary(elements, d, cell):
            place = x[facet]
            for axis, side in itertools.product(range(d), (0, 1)):
                if np.all(place[:, axis] == block.lines[axis][-side]):
                    name = ("bottom", "top")[side] if axis == d - 1 else "sides " + "xy"[axis]
                    group = names.setdefault((d - 1, name), len(names) + 1)
                    lines.append((type_of_facet, group, facet + start))
        nodes.append(x if block.shape is None else block.shape(x))
    with open(path, "w", encoding="ascii") as file:
        file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n%d\n" % len(names))
        file.writelines('%d %d "%s"\n' % (dimension, number, name) for (dimension, name), number in names.items())
        x = np.concatenate(nodes)
        x = np.hstack([x, np.zeros((len(x), 3 - d))])
        file.write("$EndPhysicalNames\n$Nodes\n%d\n" % len(x))
        file.writelines("%d %r %r %r\n" % (k + 1, *map(float, p)) for k, p in enumerate(x))
        file.write("$EndNodes\n$Elements\n%d\n" % len(lines))
        file.writelines("%d %d 2 %d %d %s\n" % (k + 1, t, g, g, " ".join(map(str, n))) for k, (t, g, n) in enumerate(lines))
        file.write("$EndElements\n")
