"""Element kinds: their numbers of nodes, their types of gmsh, meshio, Abaqus and CalculiX, and their orders of nodes.

Elements of all readers have their nodes in the order of VTK, corners of wedges turned as gmsh, Abaqus and CalculiX have them.
"""
import re

import numpy as np

# Kind: type of gmsh, dimension, number of nodes; node of gmsh of each node, where their orders differ (gmsh reference manual).
KINDS = {
    "vertex": (15, 0, 1, None), "line": (1, 1, 2, None), "line3": (8, 1, 3, None), "triangle": (2, 2, 3, None),
    "triangle6": (9, 2, 6, None), "quad": (3, 2, 4, None), "quad8": (16, 2, 8, None), "quad9": (10, 2, 9, None),
    "tetra": (4, 3, 4, None), "tetra10": (11, 3, 10, [*range(8), 9, 8]), "hexahedron": (5, 3, 8, None),
    "hexahedron20": (17, 3, 20, [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]),
    "hexahedron27": (12, 3, 27, [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26]),
    "wedge": (6, 3, 6, None), "wedge15": (18, 3, 15, [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11]),
    "wedge18": (13, 3, 18, [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16]),
    "pyramid": (7, 3, 5, None), "pyramid13": (19, 3, 13, [*range(5), 5, 8, 10, 6, 7, 9, 11, 12]),
    "pyramid14": (14, 3, 14, [*range(5), 5, 8, 10, 6, 7, 9, 11, 12, 13])}
NAMES = list(KINDS)
DIMENSION = np.array([KINDS[name][1] for name in NAMES])

# Nodes of a wedge whose triangles are turned.
TURNED = [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13, 17, 16, 15]

# By kind of corners: corners of the edges in the order of their mid-side nodes, and of the faces S1, S2, ... (CalculiX manual, chapter
# "Element types"; the same in the Abaqus Analysis User's Guide, "Three-dimensional solid element library").
EDGES = {"tetra": "12 23 31 14 24 34", "hexahedron": "12 23 34 41 56 67 78 85 15 26 37 48", "wedge": "12 23 31 45 56 64 14 25 36",
         "pyramid": "12 23 34 41 15 25 35 45", "triangle": "12 23 31", "quad": "12 23 34 41"}
FACES = {"tetra": "123 142 243 341", "hexahedron": "1234 5876 1562 2673 3784 4851", "wedge": "123 465 1452 2563 3641",
         "pyramid": "1234 152 253 354 451", "triangle": "12 23 31", "quad": "12 23 34 41"}
FACE_KINDS = {(2, 2): "line", (2, 3): "line3", (3, 3): "triangle", (3, 6): "triangle6", (4, 4): "quad", (4, 8): "quad8", (4, 9): "quad9"}
# Nodes in the middle of quadrilateral faces, by kind and label.
CENTRES = {"quad9": [None]*4, "wedge18": [None, None, 15, 16, 17], "hexahedron27": [24, 25, 22, 21, 23, 20]}

# Types of Abaqus and CalculiX; variants of the same shape follow: reduced integration R, incompatible modes I, hybrid H, ...
SOLIDS = {"C3D4": "tetra", "C3D10": "tetra10", "C3D8": "hexahedron", "C3D20": "hexahedron20", "C3D6": "wedge", "C3D15": "wedge15",
          "C3D5": "pyramid", "3": "triangle", "6": "triangle6", "4": "quad", "8": "quad8", "T3D2": "line", "T3D3": "line3"}


def corner_kind(kind):
    """The kind of the corners."""
    return re.sub(r"\d+", "", kind)


def words(text):
    """Indices from 0."""
    return [[int(c) - 1 for c in word] for word in text.split()]


def faces(kind):
    """Kind and nodes of each face of a kind, in the order of the labels S1, S2, ...."""
    n, corners = KINDS[kind][2], corner_kind(kind)
    first = KINDS[corners][2]
    edges = [frozenset(edge) for edge in words(EDGES[corners])]
    result = []
    for label, face in enumerate(words(FACES[corners])):
        nodes = list(face)
        if n > first:
            around = list(zip(face, face[1:] + face[:1]))[:1 if len(face) == 2 else None]
            nodes += [first + edges.index(frozenset(edge)) for edge in around]
        middle = CENTRES.get(kind, [None]*6)[label]
        nodes += [middle] if middle is not None else []
        result.append((FACE_KINDS[len(face), len(nodes)], nodes))
    return result


def kind_of_type(name):
    """Kind of a type of Abaqus or CalculiX; None for types that are no solids."""
    found = re.fullmatch(r"(C3D\d+|(?:CPS|CPE|CAX)(\d+)|T3D[23])[RIHMSTPE]*", name.upper())
    return found and SOLIDS.get(found[2] or found[1])
