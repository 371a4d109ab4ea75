"""Small meshes for tests/fuzz/fuzz.py, made without gmsh: blocks of every element kind, in the formats 2.2 and 4.1, as
text and in binary.

A mesh is a `Mesh` of nodes, physical groups and elements; `write(mesh, version, binary)` gives the bytes of a file.
"""
import itertools
import struct


class Mesh:
    """nodes [[x, y, z]], groups [(dimension, tag, name)], elements [(gmsh type, dimension, group tag, [node numbers
    from 1])]."""

    def __init__(self):
        self.nodes, self.groups, self.elements = [], [], []

    def group(self, dimension, name):
        """Tag of a group, which is made where there is none."""
        for d, tag, other in self.groups:
            if (d, other) == (dimension, name):
                return tag
        self.groups.append((dimension, len(self.groups) + 1, name))
        return len(self.groups)

    def copy(self):
        """Another one with the same in it."""
        new = Mesh()
        new.nodes, new.groups = [list(x) for x in self.nodes], list(self.groups)
        new.elements = [(t, d, g, list(n)) for t, d, g, n in self.elements]
        return new


# Corners of a cell and, in space, its middle; its cuts into elements (numbers of corners), and where the nodes behind the corners are: means of
# corners.
LINE = [(0, 1)]
TRIANGLE = [(0, 1), (1, 2), (2, 0)]
SQUARE = [(0, 1), (1, 2), (2, 3), (3, 0)]
TETRAHEDRON = [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)]
CUBE = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)]
CUBE_FACES = [(0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 7, 3), (1, 2, 6, 5), (2, 3, 7, 6), (4, 5, 6, 7)]
PRISM = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)]
PRISM_FACES = [(0, 1, 4, 3), (0, 3, 5, 2), (1, 2, 5, 4)]
PRISM_ENDS = [(0, 2, 1), (3, 4, 5)]
PYRAMID = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)]
PYRAMID_FACES = [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
CORNERS = {2: [(0, 0), (1, 0), (1, 1), (0, 1)],
           3: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (0.5, 0.5, 0.5)]}
HALVES = [(0, 1, 2), (0, 2, 3)]
SIXTHS = [(0, 1, 2, 6), (0, 5, 1, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 4, 5, 6), (0, 7, 4, 6)]
WHOLE = {2: [(0, 1, 2, 3)], 3: [tuple(range(8))]}
SLICES = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]
AROUND = [(*face[::-1], 8) for face in CUBE_FACES]
# kind: gmsh's type, dimension, cuts, nodes behind the corners, faces, {corners of a face: (gmsh's type, nodes behind
# its corners)}
TRI_FACES, TET_FACES = [(0, 1), (1, 2), (2, 0)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
EVERY = [tuple(range(4))]
KINDS = {
    "tri3": (2, 2, HALVES, [], TRI_FACES, {2: (1, [])}),
    "tri6": (9, 2, HALVES, TRIANGLE, TRI_FACES, {2: (8, LINE)}),
    "quad4": (3, 2, WHOLE[2], [], SQUARE, {2: (1, [])}),
    "quad8": (16, 2, WHOLE[2], SQUARE, SQUARE, {2: (8, LINE)}),
    "quad9": (10, 2, WHOLE[2], SQUARE + EVERY, SQUARE, {2: (8, LINE)}),
    "tet4": (4, 3, SIXTHS, [], TET_FACES, {3: (2, [])}),
    "tet10": (11, 3, SIXTHS, TETRAHEDRON, TET_FACES, {3: (9, TRIANGLE)}),
    "hex8": (5, 3, WHOLE[3], [], CUBE_FACES, {4: (3, [])}),
    "hex20": (17, 3, WHOLE[3], CUBE, CUBE_FACES, {4: (16, SQUARE)}),
    "hex27": (12, 3, WHOLE[3], CUBE + CUBE_FACES + [tuple(range(8))], CUBE_FACES, {4: (10, SQUARE + EVERY)}),
    "prism6": (6, 3, SLICES, [], PRISM_FACES + PRISM_ENDS, {3: (2, []), 4: (3, [])}),
    "prism15": (18, 3, SLICES, PRISM, PRISM_FACES + PRISM_ENDS, {3: (9, TRIANGLE), 4: (16, SQUARE)}),
    "prism18": (13, 3, SLICES, PRISM + PRISM_FACES, PRISM_FACES + PRISM_ENDS,
                {3: (9, TRIANGLE), 4: (10, SQUARE + EVERY)}),
    "pyramid5": (7, 3, AROUND, [], PYRAMID_FACES, {3: (2, []), 4: (3, [])}),
    "pyramid13": (19, 3, AROUND, PYRAMID, PYRAMID_FACES, {3: (9, TRIANGLE), 4: (16, SQUARE)}),
    "pyramid14": (14, 3, AROUND, PYRAMID + EVERY, PYRAMID_FACES, {3: (9, TRIANGLE), 4: (10, SQUARE + EVERY)}),
}


def dimension(kind):
    """2 or 3."""
    return KINDS[kind][1]


def add_block(mesh, volume, kind, n, origin, size, shape=lambda x: x):
    """Add a block of n divisions along each edge with the surfaces 'low', 'high' (of its last axis), 'sides x' and
    'sides y'.

    shape maps places in the unit cube to others before they are scaled.
    """
    gmsh_type, d, cuts, behind, faces, face_kinds = KINDS[kind]
    number, count = {}, {}

    def node(place):
        if place not in number:
            unit = list(shape([c / n for c in place])) + [0.0] * (3 - d)
            mesh.nodes.append([origin[i] + size[i] * unit[i] if i < d else 0.0 for i in range(3)])
            number[place] = len(mesh.nodes)
        return number[place]

    def nodes_of(corners, more):
        return [node(c) for c in corners] + [node(mean([corners[i] for i in few])) for few in more]

    for cell in itertools.product(range(n), repeat=d):
        corner = [tuple(c + o for c, o in zip(cell, offset)) for offset in CORNERS[d]]
        for cut in cuts:
            corners = [corner[i] for i in cut]
            mesh.elements.append((gmsh_type, d, mesh.group(d, volume), nodes_of(corners, behind)))
            for face in faces:
                few = [corners[i] for i in face]
                count.setdefault(frozenset(few), []).append(few)
    for same in count.values():
        if len(same) == 1:
            face_type, more = face_kinds[len(same[0])]
            mesh.elements.append((face_type, d - 1, mesh.group(d - 1, side_of(same[0], n, d)), nodes_of(same[0], more)))


def mean(places):
    """The middle of some places."""
    return tuple(sum(c) / len(places) for c in zip(*places))


def side_of(corners, n, d):
    """Name of the side of a block on which a face lies."""
    for axis in range(d):
        at = {c[axis] for c in corners}
        if at == {0} or at == {n}:
            return ("low" if at == {0} else "high") if axis == d - 1 else "sides " + "xy"[axis]
    raise ValueError("a face inside the block")


def write(mesh, version="2.2", binary=False):
    """The bytes of a file."""
    names = "$PhysicalNames\n%d\n%s$EndPhysicalNames\n" % (
        len(mesh.groups), "".join('%d %d "%s"\n' % group for group in mesh.groups))
    head = b"$MeshFormat\n%s %d 8\n" % (version.encode(), binary) + (struct.pack("<i", 1) + b"\n" if binary else b"")
    body = (write_22 if version == "2.2" else write_41)(mesh, binary)
    return head + b"$EndMeshFormat\n" + names.encode() + body


def packed(binary, form, *numbers):
    """Numbers as text or as bytes."""
    if binary:
        return struct.pack("<" + form, *numbers)
    return b" ".join(repr(x).encode() for x in numbers) + b"\n"


def write_22(mesh, binary):
    """$Nodes and $Elements of format 2.2."""
    out = [b"$Nodes\n%d\n" % len(mesh.nodes)]
    out += [packed(binary, "i3d", i, *map(float, x)) for i, x in enumerate(mesh.nodes, 1)]
    out.append(b"$EndNodes\n$Elements\n%d\n" % len(mesh.elements))
    for i, (kind, _, group, nodes) in enumerate(mesh.elements, 1):
        if binary:
            out.append(struct.pack("<3i", kind, 1, 2) + struct.pack("<%di" % (3 + len(nodes)), i, group, group, *nodes))
        else:
            out.append(packed(False, "", i, kind, 2, group, group, *nodes))
    return b"".join(out) + b"$EndElements\n"


def write_41(mesh, binary):
    """$Entities, $Nodes and $Elements of format 4.1: each group is an entity of the same tag."""
    box = [float(f(x[i] for x in mesh.nodes)) for f in (min, max) for i in range(3)]
    end = b"\n" if binary else b""
    by_dimension = [[g for g in mesh.groups if g[0] == d] for d in range(4)]
    out = [b"$Entities\n", packed(binary, "4Q", *map(len, by_dimension))]
    for d, tag, _ in (g for groups in by_dimension for g in groups):
        out.append(packed(binary, "i%ddQi" % (3 if d == 0 else 6) + "Q" * (d > 0), tag, *box[:3 if d == 0 else 6], 1,
                          tag,
                          *([0] if d > 0 else [])))
    out += [end, b"$EndEntities\n$Nodes\n"]
    d, tag, _ = max(mesh.groups)
    n = len(mesh.nodes)
    out += [packed(binary, "4Q", 1, n, 1, n), packed(binary, "3iQ", d, tag, 0, n)]
    out += [packed(binary, "Q", i + 1) for i in range(n)] + [packed(binary, "3d", *map(float, x)) for x in mesh.nodes]
    blocks = {}
    for i, (kind, d, group, nodes) in enumerate(mesh.elements, 1):
        blocks.setdefault((d, group, kind), []).append((i, nodes))
    out += [end, b"$EndNodes\n$Elements\n",
            packed(binary, "4Q", len(blocks), len(mesh.elements), 1, len(mesh.elements))]
    for (d, group, kind), elements in blocks.items():
        out.append(packed(binary, "3iQ", d, group, kind, len(elements)))
        out += [packed(binary, "%dQ" % (1 + len(nodes)), i, *nodes) for i, nodes in elements]
    return b"".join(out) + end + b"$EndElements\n"
