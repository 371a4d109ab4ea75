"""A deck as mesh2msh reads it, by numbers: its mesh with instances, outer faces and bodies."""
import collections
import re

import numpy as np

from ..mesh2msh import deck
from .cards import OF_PARTS, refuse_decimal_commas
from .elements import CORNERS, EDGES, FACES, corners, shape_functions

# Cosine of the angle between faces that no edge parts: 30 degrees.
SMOOTH = 0.866


class Deck(deck.Deck):
    """What a deck says of its mesh, and its cards. Sets and surfaces are by their names in capital letters."""

    def __init__(self, path):
        super().__init__(str(path))
        inside = False
        for card in self.cards:
            refuse_decimal_commas(card)
            inside = card.keyword == "instance" or inside and card.keyword != "endinstance"
            if inside and card.keyword in OF_PARTS:
                raise ValueError("%s: *%s inside an *INSTANCE; it belongs into its *PART" % (card.place, card.keyword.upper()))
        self.unread = [(card.place, "*SURFACE %s that is neither of faces nor of nodes" % card.get("name")) for card in self.cards
                       if card.keyword == "surface" and ("combine" in card.parameters or card.get("type", "element").lower() not in
                                                         ("element", "node"))]
        model, self.nodes, self.elements, self.types, place_of_type = self.model, {}, {}, {}, {}
        for tags, x, *_ in model.nodes:
            self.nodes.update(zip(tags.tolist(), x.tolist()))
        for kind, _, tags, nodes, card, _ in model.elements:
            self.elements.update(zip(tags.tolist(), nodes.tolist()))
            self.types.update(dict.fromkeys(tags.tolist(), kind))
            place_of_type.setdefault(kind, card.place)
        # Names of element sets as they are first written.
        self.spelled = {key.upper(): own.name for key, own in model.element_sets.items()}
        self.node_sets, self.element_sets = ({key.upper(): own.numbers().tolist() for key, own in sets.items()}
                                             for sets in (model.node_sets, model.element_sets))
        self.offsets = {name.upper(): offset for name, offset in self.offsets.items()}
        self.surfaces = {key.upper(): (own.name, own.of_nodes, self.entries(own)) for key, own in model.surfaces.items()}
        dimension = {3 if kind.startswith("C3D") else 2 if re.match("CPS|CPE|CAX", kind) else 0 for kind in place_of_type}
        if len(dimension) != 1 or 0 in dimension:
            raise ValueError("elements %s: solid elements of one dimension are needed" % ", ".join(
                "%s (%s)" % (kind, place_of_type[kind]) for kind in sorted(place_of_type)))
        self.dimension = dimension.pop()
        kinds = {kind[:3] for kind in place_of_type}
        self.analysis = {"C3D": "3d", "CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}[kinds.pop()]
        if kinds:
            raise ValueError("plane stress, plane strain and axisymmetric elements together")
        self.find_faces()
        self.find_bodies()

    def entries(self, surface):
        """Nodes of a surface, or its elements with the labels of their faces, 0 for outer ones."""
        found = []
        for name, value, label, card, line in surface.entries:
            sets = self.node_sets if surface.of_nodes else self.element_sets
            if name is not None and name.upper() not in sets:
                card.fail("there is no set '%s'" % name, line)
            own = [value] if name is None else sets[name.upper()]
            found += own if surface.of_nodes else [(e, label) for e in own]
        return found

    def offset(self, instance):
        """What is added to the numbers of an instance."""
        if instance and instance.upper() not in self.offsets:
            raise ValueError("there is no instance '%s'" % instance)
        return self.offsets.get(instance.upper(), 0)

    def members(self, sets, field, instance=""):
        """Members that a field names: a number, that of an instance, as Bolt-1.17, or a set."""
        name, (before, _, after) = field.replace('"', ""), field.replace('"', "").rpartition(".")
        if re.fullmatch(r"\d+", name):
            return [int(name) + self.offset(instance)]
        for key in (name.upper(), "%s.%s" % (instance.upper(), name.upper())):
            if key in sets:
                return sets[key]
        if before.upper() in self.offsets and re.fullmatch(r"\d+", after):
            return [int(after) + self.offset(before)]
        kind, other, others = (("nodes", "elements", self.element_sets) if sets is self.node_sets else ("elements", "nodes", self.node_sets))
        if name.upper() in others:
            raise ValueError("'%s' is a set of %s; one of %s is needed here: *%s" % (
                field, other, kind, "NSET, NSET=..., ELSET=%s makes it" % field if kind == "nodes" else "ELSET"))
        raise ValueError("there is no set '%s'" % field)

    def scopes(self, card):
        """Where a card holds: names of instances, empty for the whole deck, with their rotations."""
        return [("", None)] if card.part is None else self.instances.get(card.part, [])

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
