"""A deck: its mesh with instances, outer faces and bodies."""
import collections
import re

import numpy as np

from .cards import OF_PARTS, located, number, read_cards, refuse_decimal_commas
from .elements import CORNERS, EDGES, FACES, corners, shape_functions
from .mesh import Mesh

# Cosine of the angle between faces that no edge parts: 30 degrees.
SMOOTH = 0.866


class Deck(Mesh):
    """What a deck says of its mesh, and its cards."""

    def __init__(self, path):
        super().__init__()
        self.cards = read_cards(path, path.parent)
        # Parts by their names in small letters; instances by those of their parts: (name, rotation matrix or None).
        self.parts, self.instances = {}, collections.defaultdict(list)
        at, inside = None, None
        for card in self.cards:
            card.part = at
            refuse_decimal_commas(card)
            if card.keyword == "part":
                at = card.get("name").lower()
                card.part, self.parts[at] = at, Mesh()
            elif card.keyword == "endpart":
                at = None
            elif card.keyword == "instance":
                inside = card
                self.add_instance(card)
            elif card.keyword == "endinstance":
                inside = None
            elif inside and card.keyword in OF_PARTS:
                raise ValueError("%s: *%s inside an *INSTANCE; it belongs into its *PART" % (card.place, card.keyword.upper()))
            with located(card):
                getattr(self if at is None else self.parts[at], "read_" + card.keyword, lambda card: None)(card)
        for part in self.parts.values():
            self.unread += part.unread
        dimension = {3 if kind.startswith("C3D") else 2 if re.match("CPS|CPE|CAX", kind) else 0 for kind in self.types.values()}
        if len(dimension) != 1 or 0 in dimension:
            kinds = ["%s (%s)" % (kind, self.place_of_type[kind]) for kind in sorted(set(self.types.values()))]
            raise ValueError("elements %s: solid elements of one dimension are needed" % ", ".join(kinds))
        self.dimension = dimension.pop()
        kinds = {kind[:3] for kind in self.types.values()}
        self.analysis = {"C3D": "3d", "CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}[kinds.pop()]
        if kinds:
            raise ValueError("plane stress, plane strain and axisymmetric elements together")
        self.find_faces()
        self.find_bodies()

    def add_instance(self, card):
        """Nodes, elements, sets and surfaces of an instance, with the names and numbers that dotyk gives them."""
        name, part = card.get("name"), self.parts.get(card.get("part").lower())
        if part is None:
            raise ValueError("%s: there is no part '%s'" % (card.place, card.get("part")))
        given = [number(f) for fields in card.data for f in fields]
        if len(given) > 10 or 3 < len(given) < 10:
            raise ValueError("%s: an instance has a translation of 3 numbers and a rotation of 7" % card.place)
        shift, turn = np.array((given + [0.0]*3)[:3]), None
        if len(given) > 3:
            centre = np.array(given[3:6])
            turn = rotation(np.array(given[6:9]) - centre, given[9])
        step = 10
        while any(step <= max([0, *mesh.nodes, *mesh.elements]) for mesh in self.parts.values()):
            step *= 10
        offset = step*(len(self.offsets) + 1)
        self.offsets[name.upper()] = offset
        self.instances[card.get("part").lower()].append((name, turn))
        for n, x in part.nodes.items():
            x = np.array(x) + shift
            self.nodes[n + offset] = (x if turn is None else centre + turn @ (x - centre)).tolist()
        for e, nodes in part.elements.items():
            self.elements[e + offset] = [n + offset for n in nodes]
            self.types[e + offset] = part.types[e]
        self.place_of_type.update(part.place_of_type)
        self.add(self.element_sets, name, [e + offset for e in part.elements])
        for sets, own in ((self.node_sets, part.node_sets), (self.element_sets, part.element_sets)):
            for key, members in own.items():
                self.add(sets, "%s.%s" % (name, part.spelled.get(key, key)), [m + offset for m in members])
        for key, (spelled, of_nodes, entries) in part.surfaces.items():
            entries = [m + offset if of_nodes else (m[0] + offset, m[1]) for m in entries]
            self.surfaces["%s.%s" % (name.upper(), key)] = ("%s.%s" % (name, spelled), of_nodes, entries)

    def scopes(self, card):
        """Where a card holds: names of instances, empty for the whole deck, with their rotations."""
        return [("", None)] if card.part is None else self.instances[card.part]

    def shape(self, element):
        return self.dimension, CORNERS[self.dimension][len(self.elements[element])]

    def face(self, element, label):
        """Nodes of a face: corners, and mid-side nodes in the order of its edges."""
        shape, nodes = self.shape(element), self.elements[element]
        corner = corners(FACES[shape])[label - 1]
        edges = [frozenset(edge) for edge in corners(EDGES[shape])] if len(nodes) > shape[1] else []
        around = [frozenset((a, b)) for a, b in zip(corner, corner[1:] + corner[:1])][:1 if self.dimension == 2 else None]
        return [nodes[c] for c in corner] + [nodes[shape[1] + edges.index(edge)] for edge in around if edges]

    def find_faces(self):
        """The outer faces: {(element, label): nodes}."""
        seen = {}
        for e in self.elements:
            for label in range(1, len(FACES[self.shape(e)].split()) + 1):
                nodes = self.face(e, label)
                seen.setdefault(frozenset(nodes), []).append((e, label, nodes))
        self.outer = {(e, label): nodes for (e, label, nodes), *others in seen.values() if not others}

    def find_bodies(self):
        """Connected components by common nodes: `body_of` elements and nodes, from 0."""
        root = {}

        def find(n):
            while root.setdefault(n, n) != n:
                root[n] = root[root[n]]
                n = root[n]
            return n

        for nodes in self.elements.values():
            first = find(nodes[0])
            for n in nodes[1:]:
                root[find(n)] = first
        order = {}
        self.body_of = {e: order.setdefault(find(nodes[0]), len(order)) for e, nodes in self.elements.items()}
        self.body_of_node = {n: order[find(n)] for nodes in self.elements.values() for n in nodes}
        self.n_bodies = len(order)

    def faces_of_surface(self, name):
        """Outer faces of a surface of the deck by body: {body: faces}; and its name."""
        if name.replace('"', "").upper() not in self.surfaces:
            raise ValueError("there is no surface '%s'" % name)
        spelled, of_nodes, entries = self.surfaces[name.replace('"', "").upper()]
        if of_nodes:
            inside = set(entries)
            entries = [face for face, nodes in self.outer.items() if inside.issuperset(nodes)]
        else:
            entries = [face for e, label in entries for face in ([(e, label)] if label else [f for f in self.outer if f[0] == e])]
        found = collections.OrderedDict()
        for face in entries:
            found.setdefault(self.body_of[face[0]], []).append(face)
        return spelled, found

    def patches(self, faces):
        """Faces that nodes join, without an edge between them: lists of faces."""
        normal, at_node, root = {}, collections.defaultdict(list), {face: face for face in faces}

        def find(face):
            while root[face] != face:
                face = root[face]
            return face

        for face in faces:
            x = np.array([self.nodes[n] for n in self.outer[face][:4 if self.dimension == 3 else 2]])
            n = np.cross(x[1] - x[0], x[2] - x[0] if self.dimension == 3 else [0, 0, 1])
            normal[face] = n/np.linalg.norm(n)
            for node in self.outer[face]:
                for other in at_node[node]:
                    if abs(normal[face] @ normal[other]) > SMOOTH:
                        root[find(face)] = find(other)
                at_node[node].append(face)
        found = collections.OrderedDict()
        for face in faces:
            found.setdefault(find(face), []).append(face)
        return list(found.values())

    def unit_loads(self, faces):
        """Nodal forces of a unit traction in one direction on faces: {node: force}; per unit thickness in the plane."""
        loads = collections.defaultdict(float)
        for face in faces:
            nodes = self.outer[face]
            x = np.array([self.nodes[n] for n in nodes])
            n = 2 if self.dimension == 2 else len(corners(FACES[self.shape(face[0])])[face[1] - 1])
            if self.dimension == 2:
                weights = {2: [1/2, 1/2], 3: [1/6, 1/6, 2/3]}[len(nodes)]
                for node, w in zip(nodes, weights):
                    loads[node] += w*np.linalg.norm(x[1] - x[0])
                continue
            points = [(1/6, 1/6), (2/3, 1/6), (1/6, 2/3)] if n == 3 else [(a, b) for a in (-.6**.5, 0, .6**.5) for b in (-.6**.5, 0, .6**.5)]
            weights = [1/6]*3 if n == 3 else [a*b for a in (5/9, 8/9, 5/9) for b in (5/9, 8/9, 5/9)]
            for (s, t), w in zip(points, weights):
                value, by_s, by_t = shape_functions(len(nodes), s, t)
                area = w*np.linalg.norm(np.cross(by_s @ x, by_t @ x))
                for node, v in zip(nodes, value):
                    loads[node] += v*area
        return loads


def rotation(axis, degrees):
    """Matrix of a rotation about an axis."""
    a, angle = axis/np.linalg.norm(axis), np.radians(degrees)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle)*cross + (1 - np.cos(angle))*(cross @ cross)
