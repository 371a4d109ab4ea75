"""Meshes of blocks on grids, written as gmsh 2.2 files: sizes, shapes and digits are those that a scene asks for.

The surfaces of a block are 'bottom', 'top', 'sides x' and 'sides y' (two dimensions: 'sides x'), its elements have the
name of the block. It stands along z, in two dimensions along y. gmsh makes quadratic elements from linear ones.
"""
import itertools
import shutil
import subprocess

import numpy as np

# nodes of a cell in gmsh's order, as offsets along x, y, z
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
CUBE = [(*corner, z) for z in (0, 1) for corner in SQUARE]
# faces of an element, outward, by its dimension and number of nodes; gmsh's types of elements and of facets
FACES = {(2, 3): [(0, 1), (1, 2), (2, 0)], (2, 4): [(0, 1), (1, 2), (2, 3), (3, 0)],
         (3, 4): [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)],
         (3, 5): [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
         (3, 6): [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
         (3, 8): [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]}
TYPES = {(1, 2): 1, (2, 3): 2, (2, 4): 3, (3, 4): 4, (3, 8): 5, (3, 6): 6, (3, 5): 7}

# how a cell is cut; simplices and prisms of neighbours fit each other (Kuhn's triangulation), squares and cubes as far
# as is said below
WHOLE_SQUARE, WHOLE_CUBE = [(0, 1, 2, 3)], [tuple(range(8))]
TRIANGLES = [(0, 1, 2), (0, 2, 3)]
TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
PRISMS = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]


def pyramids(apex):
    """Three pyramids whose apex is a corner of the cube, that on the horizontal face first."""
    return [(*face[::-1], apex) for face in FACES[3, 8] if apex not in face]


def halves(pyramid):
    """The two tetrahedra of a pyramid whose base is cut from the corner opposite to the apex in the cube."""
    *base, apex = pyramid
    first = base.index(CUBE.index(tuple(1 - c for c in CUBE[apex])))
    base = base[first:] + base[:first]
    return [(*base[:3], apex), (base[0], *base[2:], apex)]


def each(cell):
    """All cells."""
    return np.ones(len(cell), bool)


def alternate(cell):
    """Every other column of cells."""
    return (cell[:, 0] + (cell[:, 1] if cell.shape[1] == 3 else 0)) % 2 == 0


def layers(cell):
    """Every other layer of cells."""
    return cell[:, -1] % 2 == 0


def mirrored(corner, period=2, layer=0):
    """The cells where a corner of the cube is the apex of pyramids, in layers of a period: mirror images side by side."""
    def rule(cell):
        own = np.array(CUBE[corner])
        return np.all(cell[:, :2] % 2 == own[:2], axis=1) & (cell[:, 2] % period == layer + own[2])
    return rule


def others(rule):
    """The cells that a rule leaves."""
    return lambda cell: ~rule(cell)


# name: cell, how which cells are cut, order, whether nodes within faces and elements are left out
KINDS = {"quad4": (SQUARE, [(WHOLE_SQUARE, each)], 1, 0), "tri3": (SQUARE, [(TRIANGLES, each)], 1, 0),
         "hex8": (CUBE, [(WHOLE_CUBE, each)], 1, 0), "tet4": (CUBE, [(TETRAHEDRA, each)], 1, 0),
         "prism6": (CUBE, [(PRISMS, each)], 1, 0),
         "pyramid5": (CUBE, [(pyramids(apex), mirrored(apex)) for apex in range(8)], 1, 0),
         "quad4 and tri3": (SQUARE, [(WHOLE_SQUARE, alternate), (TRIANGLES, others(alternate))], 1, 0),
         "hex8 and prism6": (CUBE, [(WHOLE_CUBE, alternate), (PRISMS, others(alternate))], 1, 0),
         "prism6 and tet4": (CUBE, [(PRISMS, layers), (TETRAHEDRA, others(layers))], 1, 0)}
# layers: hexahedra, pyramids on their upper faces with tetrahedra, the same upside down, hexahedra
KINDS["hex8, pyramid5 and tet4"] = (
    CUBE, [(WHOLE_CUBE, lambda cell: (cell[:, 2] + 1) % 4 < 2)]
    + [(pyramids(apex)[:1], mirrored(apex, 4, 2 - 2 * CUBE[apex][2])) for apex in range(8)]
    + [(halves(pyramids(apex)[1]) + halves(pyramids(apex)[2]), mirrored(apex, 4, 2 - 2 * CUBE[apex][2]))
       for apex in range(8)], 1, 0)
for linear, quadratic, incomplete in (("quad4", "quad8", 1), ("quad4", "quad9", 0), ("tri3", "tri6", 0),
                                      ("hex8", "hex20", 1), ("hex8", "hex27", 0), ("tet4", "tet10", 0),
                                      ("prism6", "prism15", 1), ("prism6", "prism18", 0),
                                      ("pyramid5", "pyramid13", 1), ("pyramid5", "pyramid14", 0),
                                      ("hex8, pyramid5 and tet4", "hex20, pyramid13 and tet10", 1),
                                      ("hex8, pyramid5 and tet4", "hex27, pyramid14 and tet10", 0),
                                      ("quad4 and tri3", "quad9 and tri6", 0),
                                      ("hex8 and prism6", "hex20 and prism15", 1),
                                      ("prism6 and tet4", "prism18 and tet10", 0)):
    KINDS[quadratic] = (*KINDS[linear][:2], 2, incomplete)

class Block:
    """A block: lines of the grid along each direction, and a map of coordinates (n, d) to new ones.

    patches: names of surfaces, and which facets of the grid, places (nodes, d), are on them and on no other.
    volume: the name of the volume of an element by its centre in the grid; the name of the block where it is not given.
    """

    def __init__(self, name, *lines, shape=None, patches=None, volume=None):
        self.name, self.lines, self.shape, self.patches = name, [np.asarray(line, float)
                                                                 for line in lines], shape, patches or {}
        self.volume = volume or (lambda centre: name)

    def surfaces(self, place):
        """Names of the surfaces that a facet is on."""
        for name, holds in self.patches.items():
            if holds(place):
                return [name]
        d = len(self.lines)
        return [("bottom", "top")[side] if axis == d - 1 else "sides " + "xy"[axis]
                for axis, side in itertools.product(range(d), (0, 1))
                if np.all(place[:, axis] == self.lines[axis][-side])]


def even(low, high, n):
    """A line of n equal divisions."""
    return np.linspace(low, high, n + 1)


def dimension(kind):
    """2 or 3."""
    return len(KINDS[kind][0][0])


def boundary(groups, d):
    """Facets that one element alone has: lists of nodes."""
    facets = []
    for elements in groups:
        for face in FACES[d, elements.shape[1]]:
            facet = np.full((len(elements), 4), -1)
            facet[:, :len(face)] = elements[:, face]
            facets.append(facet)
    facets = np.concatenate(facets)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return [facet[facet >= 0] for facet in facets[first[count == 1]]]


def cut(block, kind):
    """Nodes and elements of a block, these in groups of one kind."""
    cell, parts = KINDS[kind][:2]
    counts = [len(line) for line in block.lines]
    number = np.arange(np.prod(counts)).reshape(counts)
    x = np.stack(np.meshgrid(*block.lines, indexing="ij"), axis=-1).reshape(-1, len(counts))
    corners = np.stack([number[tuple(slice(o, n - 1 + o) for o, n in zip(offset, counts))].ravel() for offset in cell],
                       axis=1)
    index = np.stack(np.unravel_index(np.arange(len(corners)), [n - 1 for n in counts]), axis=1)
    groups = [np.concatenate([corners[rule(index)][:, piece] for piece in pieces]) for pieces, rule in parts]
    return x, [group for group in groups if len(group)]


def write_mesh(path, blocks, kind):
    """Write blocks as one mesh."""
    d, order, incomplete = dimension(kind), *KINDS[kind][2:]
    names, nodes, lines = {}, [], []
    for block in blocks:
        x, groups = cut(block, kind)
        start = sum(map(len, nodes)) + 1
        for elements in groups:
            for element in elements:
                group = names.setdefault((d, block.volume(x[element].mean(axis=0))), len(names) + 1)
                lines.append((TYPES[d, len(element)], group, element + start))
        for facet in boundary(groups, d):
            for name in block.surfaces(x[facet]):
                group = names.setdefault((d - 1, name), len(names) + 1)
                lines.append((TYPES[d - 1, len(facet)], group, facet + start))
        nodes.append(x if block.shape is None else block.shape(x))
    with open(path, "w", encoding="ascii") as file:
        file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n%d\n" % len(names))
        file.writelines('%d %d "%s"\n' % (dim, number, name) for (dim, name), number in names.items())
        x = np.concatenate(nodes)
        x = np.hstack([x, np.zeros((len(x), 3 - d))])
        file.write("$EndPhysicalNames\n$Nodes\n%d\n" % len(x))
        file.writelines("%d %r %r %r\n" % (k + 1, *map(float, p)) for k, p in enumerate(x))
        file.write("$EndNodes\n$Elements\n%d\n" % len(lines))
        file.writelines("%d %d 2 %d %d %s\n" % (k + 1, t, g, g, " ".join(map(str, n)))
                        for k, (t, g, n) in enumerate(lines))
        file.write("$EndElements\n")
    if order == 2:
        subprocess.run([shutil.which("gmsh"), "-%d" % d, str(path), "-order", "2", "-setnumber",
                        "Mesh.SecondOrderIncomplete", str(incomplete), "-format", "msh22", "-o",
                        str(path)], check=True, stdout=subprocess.DEVNULL)
