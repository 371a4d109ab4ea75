#!/usr/bin/env python3
"""Writes a first scene of dotyk from a deck of CalculiX or Abaqus: bodies, rigid ones among them, materials, supports, loads, ties and
contact pairs; several steps become load cases. Parts, instances and assemblies are read as dotyk reads them.

usage: tools/inp2dotyk.py DECK.inp [-o SCENE.nml]

Writes SCENE.nml and SCENE_sets.inp beside it: the latter includes the deck and adds sets of the elements of each body, and surfaces for
supports and loads that the deck has on nodes or elements. What could not be carried over is said in comments of SCENE.nml and on the
standard error; exit code 1 then, 2 where nothing could be written. Needs numpy.
"""
import argparse
import collections
import contextlib
import os
import pathlib
import re
import sys

try:
    import numpy as np
except ImportError:
    if not os.path.samefile(sys.executable, "/usr/bin/python3"):
        os.execv("/usr/bin/python3", ["/usr/bin/python3", "-B", os.path.abspath(__file__)] + sys.argv[1:])
    sys.exit("inp2dotyk: numpy is missing (Debian: apt install python3-numpy)")

# Corners of the faces S1, S2, ... and of the edges with mid-side nodes, by the number of corners and the dimension (CalculiX manual).
FACES = {(3, 4): "123 142 243 341", (3, 8): "1234 5876 1562 2673 3784 4851", (3, 6): "123 465 1452 2563 3641", (3, 5): "1234 152 253 354 451",
         (2, 3): "12 23 31", (2, 4): "12 23 34 41"}
EDGES = {(3, 4): "12 23 31 14 24 34", (3, 8): "12 23 34 41 56 67 78 85 15 26 37 48", (3, 6): "12 23 31 45 56 64 14 25 36",
         (3, 5): "12 23 34 41 15 25 35 45", (2, 3): "12 23 31", (2, 4): "12 23 34 41"}
CORNERS = {3: {4: 4, 10: 4, 8: 8, 20: 8, 6: 6, 15: 6, 5: 5, 13: 5}, 2: {3: 3, 6: 3, 4: 4, 8: 4}}
# Cards that say nothing about the scene, or nothing but how CalculiX solves it and what it prints.
SILENT = set("""heading node element nset elset surface include material elastic expansion density solidsection boundary cload dload dsload
step endstep static contactpair surfaceinteraction surfacebehavior tie temperature initialconditions orientation nodeprint nodefile elprint
elfile contactprint contactfile output nodeoutput elementoutput contactoutput controls sectionprint friction physicalconstants restart part
endpart assembly endassembly instance endinstance preprint fieldoutput historyoutput amplitude output energyoutput rigidbody
pretensionsection""".split())
# Cards of a part that are carried over; others belong into the assembly.
OF_PARTS = set("node element nset elset surface solidsection orientation rigidbody pretensionsection part endpart".split())
# Cards that a load case of dotyk is made of.
PROCEDURES = {"static"}
OTHER_PROCEDURES = set("""dynamic frequency buckle heattransfer modaldynamic steadystatedynamics visco coupledtemperaturedisplacement
uncoupledtemperaturedisplacement green sensitivity complexfrequency electromagnetics cfd geostatic soils substructuregenerate""".split())
# What users may do about cards that are not carried over.
HINTS = {"contact": ": general contact; `&contact auto=.true. /` finds the pairs", "coupling": ": see force and moment of &load, &rigid_body",
         "equation": ": see &tie, &rigid_body", "mpc": ": see &tie, &rigid_body", "clearance": ": see gap of &contact",
         "contactinterference": ": see gap of &contact and &contact_case"}
# Named conditions of Abaqus: first and last displacement.
SYMMETRY = {"ENCASTRE": (1, 3), "PINNED": (1, 3), "XSYMM": (1, 1), "YSYMM": (2, 2), "ZSYMM": (3, 3)}
# A nodal force of a traction may be off by the digits of the deck.
CONSISTENT = 2e-3
# Cosine of the angle between faces that no edge parts: 30 degrees.
SMOOTH = 0.866


def corners(text):
    return [[int(c) - 1 for c in word] for word in text.split()]


def number(text):
    """A number of a deck; 0 for an empty field."""
    return float(re.sub("[dD]", "e", text)) if text.strip() else 0.0


class Card:
    """A keyword card with its parameters and data lines (lists of fields)."""

    def __init__(self, text, place):
        head, *rest = re.split(r",(?=(?:[^\"]*\"[^\"]*\")*[^\"]*$)", text[1:])
        self.keyword, self.place, self.data, self.parameters = re.sub(r"[\s-]", "", head).lower(), place, [], {}
        # Name of the part to which it belongs, in small letters.
        self.part = None
        for field in rest:
            key, _, value = field.partition("=")
            if key.strip():
                self.parameters[re.sub(r"\s", "", key).lower()] = value.strip().strip('"')

    def get(self, key, default=""):
        return self.parameters.get(key, default)


def read_cards(path, folder, depth=0):
    """The cards of a deck, those of included files among them; an included file may begin with data lines (keyword '')."""
    cards, card, text = [Card("*", str(path))], None, ""
    for n, line in enumerate(path.read_text(encoding="latin1").splitlines(), 1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") or text:
            text += line
            if text.endswith(","):
                continue
            card, text = Card(text, "%s:%d" % (path.name, n)), ""
            if card.keyword != "include":
                cards.append(card)
            name = card.get("input")
            if name and card.keyword in ("include", "node", "element"):
                if depth > 20:
                    raise ValueError("%s includes itself" % path)
                first, *more = read_cards(folder / name, folder, depth + 1)
                cards[-1].data += first.data
                cards += more
            continue
        cards[-1].data.append([field.strip() for field in line.rstrip(",").split(",")])
    return cards


@contextlib.contextmanager
def located(card):
    """Mistakes are told with the line of a card."""
    try:
        yield
    except (ValueError, KeyError, IndexError) as error:
        said = str(error) if not isinstance(error, KeyError) else "there is no number %s" % error
        raise ValueError(said if said.startswith(card.place) else "%s: *%s: %s" % (card.place, card.keyword.upper(), said)) from None


class Mesh:
    """Nodes, elements, sets and surfaces: of a part, or of the whole deck. Sets are by their names in capital letters."""

    def __init__(self):
        self.nodes, self.elements, self.types, self.place_of_type = {}, {}, {}, {}
        self.node_sets, self.element_sets, self.surfaces, self.offsets = (collections.OrderedDict() for _ in range(4))
        # Names of element sets as they are first written.
        self.spelled, self.unread = {}, []

    def add(self, sets, name, members):
        if sets is self.element_sets:
            self.spelled.setdefault(name.upper(), name)
        sets.setdefault(name.upper(), []).extend(members)

    def read_node(self, card):
        for fields in card.data:
            self.nodes[int(fields[0])] = [number(f) for f in (fields[1:4] + ["", "", ""])[:3]]
        if card.get("nset"):
            self.add(self.node_sets, card.get("nset"), [int(f[0]) for f in card.data])

    def read_element(self, card):
        kind = card.get("type").upper()
        n = int((re.findall(r"\d+", kind[3 if kind.startswith("C3D") else 2:]) or ["0"])[0])
        values = [int(f) for fields in card.data for f in fields if f]
        if not n or len(values) % (n + 1):
            raise ValueError("%s: elements %s are not read" % (card.place, kind))
        self.place_of_type.setdefault(kind, card.place)
        for i in range(0, len(values), n + 1):
            self.elements[values[i]] = values[i + 1:i + n + 1]
            self.types[values[i]] = kind
        if card.get("elset"):
            self.add(self.element_sets, card.get("elset"), values[::n + 1])

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
        raise ValueError("there is no set '%s'" % field)

    def read_set(self, card, sets):
        name, instance = card.get(card.keyword), card.get("instance")
        if card.keyword == "nset" and card.get("elset"):
            found = [n for e in self.members(self.element_sets, card.get("elset"), instance) for n in self.elements[e]]
            self.add(sets, name, list(dict.fromkeys(found)))
        for fields in card.data:
            if "generate" in card.parameters:
                first, last, step = (fields + ["1", "1"])[:3] if len(fields) > 1 else fields*2 + ["1"]
                found = [m + self.offset(instance) for m in range(int(first), int(last) + 1, int(step or 1))]
            else:
                found = [m for f in fields if f for m in list(self.members(sets, f, instance))]
            self.add(sets, name, found)

    def read_nset(self, card):
        self.read_set(card, self.node_sets)

    def read_elset(self, card):
        self.read_set(card, self.element_sets)

    def read_surface(self, card):
        kind = card.get("type", "element").lower()
        if kind not in ("element", "node") or "combine" in card.parameters:
            self.unread.append((card.place, "*SURFACE %s that is neither of faces nor of nodes" % card.get("name")))
            return
        entries = []
        for fields in card.data:
            if kind == "node":
                entries += self.members(self.node_sets, fields[0])
            else:
                label = (fields + ["S0"])[1].upper() or "S0"
                if not re.fullmatch("S[0-6]", label):
                    raise ValueError("%s: face %s of solid elements" % (card.place, label))
                entries += [(e, int(label[1:])) for e in self.members(self.element_sets, fields[0])]
        self.surfaces[card.get("name").upper()] = (card.get("name"), kind == "node", entries)


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


def shape_functions(n, s, t):
    """Values and derivatives on tri3, tri6, quad4 and quad8, derivatives by differences that are exact for these polynomials."""
    def values(s, t):
        if n in (3, 6):
            r = 1 - s - t
            return np.array([r, s, t] if n == 3 else [r*(2*r - 1), s*(2*s - 1), t*(2*t - 1), 4*r*s, 4*s*t, 4*t*r])
        at = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        if n == 4:
            return np.array([(1 + a*s)*(1 + b*t)/4 for a, b in at])
        return np.array([(1 + a*s)*(1 + b*t)*(a*s + b*t - 1)/4 for a, b in at] +
                        [(1 - s*s)*(1 - t)/2, (1 + s)*(1 - t*t)/2, (1 - s*s)*(1 + t)/2, (1 - s)*(1 - t*t)/2])
    return values(s, t), (values(s + 1, t) - values(s - 1, t))/2, (values(s, t + 1) - values(s, t - 1))/2


def rotation(axis, degrees):
    """Matrix of a rotation about an axis."""
    a, angle = axis/np.linalg.norm(axis), np.radians(degrees)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle)*cross + (1 - np.cos(angle))*(cross @ cross)


def quoted(name):
    return "'%s'" % name.replace("'", "''")


def text_of(values):
    return ", ".join("%.12g" % v for v in values)


class Step:
    """What acts in a step: values with the places of their cards. Later steps keep it, or replace it."""

    def __init__(self, number=0, card=None):
        self.number, self.card, self.left_out = number, card, ""
        # {(node, direction): (value, place)}; {(node, direction): [(step, value, place)]}; {key: [(step, card, fields)]}; {node: (value, place)}
        self.displacement, self.force, self.load, self.temperature = {}, {}, collections.OrderedDict(), {}
        # Of nodes of pre-tension sections: ('force', 'shortening' or 'locked', value, place).
        self.tension = {}

    def follow(self, number, card):
        """The next step, which begins with all that acts in this one."""
        step = Step(number, card)
        for name in ("displacement", "force", "load", "temperature", "tension"):
            setattr(step, name, getattr(self, name).copy())
        return step

    def add(self, where, key, entry):
        """A load: it replaces that of a step before, and adds to others of its step."""
        known = where.get(key, [])
        where[key] = ([] if known and known[0][0] != self.number else known) + [(self.number, *entry)]


class Scene:
    """The scene under construction."""

    def __init__(self, deck, path, sets):
        self.deck, self.path, self.sets = deck, path, sets
        self.lines, self.more, self.left = [], [], []
        self.axes = "xyz"[:deck.dimension]
        self.cards = [card for card in deck.cards if card.part is None or card.keyword in OF_PARTS]
        self.names, self.used, self.known = {}, {*deck.surfaces, *deck.node_sets, *deck.element_sets}, {}
        for place, message in deck.unread:
            self.leave(place, message)

    def leave(self, place, message):
        """Something that is not carried over."""
        text = "%s: %s" % (place, message) if place else message
        if text not in self.left:
            self.left.append(text)

    def of(self, *keywords):
        return [card for card in self.cards if card.keyword in keywords]

    def body(self, b):
        return self.names[b]

    def surface(self, name, faces):
        """A surface of the file of sets; its name, another one where that is taken."""
        key = name.split("_")[0], frozenset(faces)
        if key in self.known:
            return self.known[key]
        while name.upper() in self.used:
            name += "_"
        self.used.add(name.upper())
        self.known[key] = name
        self.more.append("*SURFACE, NAME=%s" % name)
        self.more += ["%d, S%d" % face for face in faces]
        return name

    def read_steps(self):
        """Steps of the deck: `base`, what holds before them, and `steps`."""
        self.base, self.steps = Step(), []
        at, first, procedure, before = self.base, set(), None, self.base
        for card in self.cards:
            if card.part is not None:
                continue
            if card.keyword == "step":
                # Steps go on from the last one that is no perturbation.
                before = before if at.left_out.startswith("a perturbation") else at
                at, first, procedure = before.follow(len(self.steps) + 1, card), set(), None
                self.steps.append(at)
                if "perturbation" in card.parameters:
                    at.left_out = "a perturbation"
            elif card.keyword in ("boundary", "cload", "dload", "dsload", "temperature"):
                if card.get("op").lower() == "new" and card.keyword not in first:
                    self.clear(at, card.keyword)
                first.add(card.keyword)
                if card.get("amplitude"):
                    self.leave(card.place, "the amplitude of *%s: its whole value is taken" % card.keyword.upper())
                for name in ("type", "fixed", "loadcase", "file", "submodel", "user", "bstep"):
                    bolts = name == "fixed" in card.parameters and all(n in self.tension for fields in card.data for n in self.nodes_of(fields[0]))
                    if name in card.parameters and card.get(name).lower() != "displacement" and not bolts:
                        self.leave(card.place, "*%s with %s" % (card.keyword.upper(), name.upper()))
                with located(card):
                    getattr(self, "read_" + card.keyword)(at, card)
            elif at is not self.base and procedure is None and card.keyword in PROCEDURES | OTHER_PROCEDURES:
                procedure = card
                if card.keyword not in PROCEDURES:
                    at.left_out = at.left_out or "*%s, not *STATIC," % card.keyword.upper()
        if not self.steps:
            self.steps = [self.base]
        kept = [step for step in self.steps if not step.left_out] or self.steps[:1]
        for step in self.steps:
            if step not in kept:
                self.leave(step.card.place, "step %d: %s is left out" % (step.number, step.left_out))
        held = set(kept[0].displacement)
        for step in kept[1:]:
            if set(step.displacement) != held:
                self.leave(step.card.place, "step %d: it holds other nodes or directions than step %d; supports are those of all load cases, give "
                           "it a scene of its own" % (step.number, kept[0].number))
        self.steps = [step for step in kept if set(step.displacement) == held]
        self.cases = [step.card.get("name") or "step %d" % step.number if step.card else "" for step in self.steps]
        if len(set(self.cases)) < len(self.cases):
            self.cases = ["step %d" % step.number for step in self.steps]

    @staticmethod
    def clear(step, keyword):
        """OP=NEW: nothing of earlier steps remains."""
        if keyword in ("dload", "dsload"):
            for key in [key for key in step.load if key[0] == keyword]:
                del step.load[key]
        else:
            {"boundary": step.displacement, "cload": step.force, "temperature": step.temperature}[keyword].clear()
            gone = {"boundary": ("shortening", "locked"), "cload": ("force",)}.get(keyword, ())
            step.tension = {n: entry for n, entry in step.tension.items() if entry[0] not in gone}

    def nodes_of(self, field):
        return self.deck.members(self.deck.node_sets, field)

    def read_boundary(self, step, card):
        for fields in card.data:
            if len(fields) < 2:
                raise ValueError("a direction is missing")
            first, last = SYMMETRY.get(fields[1].upper(), (0, 0))
            turned = {"ENCASTRE": (4, 5, 6), "XSYMM": (5, 6), "YSYMM": (4, 6), "ZSYMM": (4, 5)}.get(fields[1].upper(), ())
            if not first:
                if not re.fullmatch(r"\d+", fields[1]):
                    self.leave(card.place, "*BOUNDARY %s" % fields[1])
                    continue
                first = int(fields[1])
                last = int(fields[2]) if len(fields) > 2 and fields[2] else first
            value = number(fields[3]) if len(fields) > 3 else 0.0
            for n in self.nodes_of(fields[0]):
                if n in self.tension:
                    if first == 1:
                        step.tension[n] = "locked" if "fixed" in card.parameters else "shortening", value, card.place
                    continue
                rigid = n in self.reference or n in self.turning
                if last > 3 and not rigid and not turned:
                    self.leave(card.place, "degree of freedom %d of nodes (temperature, rotation)" % last)
                for d in [*range(first, last + 1), *(turned if rigid else ())]:
                    if d <= 3 or rigid and d <= 6:
                        step.displacement[n, d] = value, card.place

    def read_cload(self, step, card):
        for fields in card.data:
            d = int(fields[1])
            for n in self.nodes_of(fields[0]):
                if n in self.tension:
                    if d == 1:
                        step.tension[n] = "force", number(fields[2]), card.place
                    continue
                if d > self.deck.dimension and n not in self.reference and n not in self.turning:
                    self.leave(card.place, "moments and other loads of nodes (degree of freedom %s)" % fields[1])
                    continue
                if (n, d) in step.force and step.force[n, d][0][0] == step.number:
                    self.leave(card.place, "several forces on a node in one direction: their sum is taken")
                step.add(step.force, (n, d), (number(fields[2]), card.place))

    def read_dload(self, step, card):
        """Keys are of a face where there is one: the load that it replaces."""
        for fields in card.data:
            label = fields[1].upper()
            if re.fullmatch("P[1-6]", label):
                for e in self.deck.members(self.deck.element_sets, fields[0]):
                    step.add(step.load, ("dload", e, label), (card, fields))
            else:
                step.add(step.load, ("dload", fields[0].upper(), label), (card, fields))

    def read_dsload(self, step, card):
        for fields in card.data:
            step.add(step.load, ("dsload", fields[0].upper(), fields[1].upper()), (card, fields))

    def read_temperature(self, step, card):
        for fields in card.data:
            for n in self.nodes_of(fields[0]):
                step.temperature[n] = number(fields[1]), card.place

    def by_case(self, lines_of):
        """Write the groups that each step needs, with the key case where they are not those of all steps."""
        needed = collections.OrderedDict()
        for step, case in zip(self.steps, self.cases):
            for line, times in collections.Counter(lines_of(step)).items():
                for k in range(times):
                    needed.setdefault((line, k), []).append(case)
        for (line, _), cases in needed.items():
            self.lines.append(line + self.keys_of_cases(cases) + " /")

    def keys_of_cases(self, cases):
        return "" if len(cases) == len(self.cases) else ", case=" + ", ".join(map(quoted, cases))

    def materials(self):
        """&material of each material, and what other parts need of it: {name: density, expansion}."""
        self.density, self.expansion = {}, {}
        orientation = {(card.part, card.get("name").upper()): card for card in self.of("orientation")}
        of_material, current = {}, None
        for card in self.cards:
            if card.keyword == "material":
                current = card.get("name").upper()
                of_material[current] = []
            elif current and card.keyword in ("elastic", "expansion", "density"):
                of_material[current].append(card)
            elif current and card.keyword in ("plastic", "hyperelastic", "hyperfoam", "creep", "usermaterial", "cyclichardening", "depvar"):
                self.leave(card.place, "material %s: *%s; dotyk is linear elastic" % (current, card.keyword.upper()))
        self.section = {}
        used = {}
        for card in self.of("solidsection"):
            name, turned = card.get("material").upper(), card.get("orientation").upper()
            axes = orientation.get((card.part, turned), orientation.get((None, turned)))
            if turned and axes is None:
                self.leave(card.place, "there is no orientation '%s'" % turned)
            for prefix, turn in self.deck.scopes(card):
                own = name
                if axes is not None or turn is not None and self.has_axes(of_material.get(name, [])):
                    own = " ".join(filter(None, (name, turned, prefix if turn is not None or axes and axes.part else "")))
                used[own] = (name, axes, turn if own != name else None, card)
                with located(card):
                    self.section.update(dict.fromkeys(self.deck.members(self.deck.element_sets, card.get("elset"), prefix), own))
            thickness = number((card.data or [["1"]])[0][0])
            if self.deck.dimension == 2 and thickness not in (0.0, 1.0):
                self.leave(card.place, "thickness %g: dotyk's plane analyses have thickness 1; divide forces by it" % thickness)
        for own, (name, axes, turn, section) in used.items():
            keys = []
            for card in of_material.get(name, []):
                values = [number(f) for fields in card.data for f in fields]
                kind = card.get("type", "iso").lower()[:3]
                if card.keyword == "density":
                    self.density[own] = values[0]
                    keys.append("density=%.12g" % values[0])
                elif card.keyword == "expansion":
                    if kind == "ani" or len(card.data) > 1:
                        self.leave(card.place, "material %s: *EXPANSION of type ANISO or that depends on the temperature; %d constants of the "
                                   "first line are taken" % (name, 3 if kind in ("ort", "ani") else 1))
                    values = [number(f) for f in card.data[0]][:3 if kind in ("ort", "ani") else 1]
                    self.expansion[own] = any(values)
                    if any(values):
                        keys.append("expansion=" + text_of(values))
                elif kind == "iso":
                    young, poisson = (values + [0.0])[:2]
                    keys.append("young=%.12g, poisson=%.12g" % (young, poisson))
                    if len(card.data) > 1:
                        self.leave(card.place, "material %s: constants that depend on the temperature; those of the first line are taken" % name)
                elif len(card.data) > {"eng": 2, "ort": 2, "ani": 3}.get(kind, 0):
                    self.leave(card.place, "material %s: *ELASTIC of type %s or of several temperatures; it is left out"
                               % (name, card.get("type").upper()))
                elif kind == "eng":
                    keys.append("young=%s, poisson=%s, shear=%s" % (text_of(values[:3]), text_of(values[3:6]), text_of(values[6:9])))
                elif kind in ("ort", "ani"):
                    keys.append("stiffness=" + text_of(stiffness(values, kind)))
            if not any(key.startswith(("young", "stiffness")) for key in keys):
                self.leave(section.place, "material %s has no *ELASTIC that is read" % own)
                keys.append("young=0, poisson=0")
            if axes is not None:
                if axes.get("system", "rectangular").lower()[:1] != "r":
                    self.leave(axes.place, "cylindrical axes of a material are no part of dotyk: its axes are those of the deck's global system")
                else:
                    if axes.get("definition", "coordinates").lower() != "coordinates" or len(axes.data[0]) not in (6, 9):
                        raise ValueError("%s: orientation %s is not given by two vectors" % (axes.place, axes.get("name")))
                    a = np.array([number(f) for f in axes.data[0]] + [0.0]*3)[:9].reshape(3, 3)
                    a = (a[:2] - a[2]) @ (np.eye(3) if turn is None else turn).T
                    keys.append("axis_1=%s, axis_2=%s" % (text_of(a[0]), text_of(a[1])))
                    if len(axes.data) > 1:
                        self.leave(axes.place, "the further rotation of the orientation")
            elif turn is not None:
                keys.append("axis_1=%s, axis_2=%s" % (text_of(turn[:, 0]), text_of(turn[:, 1])))
                self.leave(section.place, "material %s without *ORIENTATION in a rotated instance: its axes are taken to rotate with it" % name)
            self.lines.append("&material name=%s, %s /" % (quoted(own), ", ".join(keys)))

    @staticmethod
    def has_axes(cards):
        """Whether a material has axes."""
        return any(card.get("type", "iso").lower()[:3] != "iso" for card in cards if card.keyword in ("elastic", "expansion"))

    def bodies(self):
        """&body of each connected component; a set of the deck where it is one, else one of the file of sets."""
        deck, members = self.deck, collections.defaultdict(list)
        for e, b in deck.body_of.items():
            members[b, self.section.get(e, "?")].append(e)
        without = [e for e in deck.elements if e not in self.section]
        if without:
            self.leave("", "%d elements have no *SOLID SECTION with a material (the first is %d)" % (len(without), without[0]))
        of_set = {frozenset(m): name for name, m in deck.element_sets.items()}
        of_set.update({frozenset(deck.element_sets[name]): name for name in deck.offsets})
        spelled = deck.spelled
        for b in range(deck.n_bodies):
            volumes, materials = [], []
            for (c, material), elements in members.items():
                if c != b:
                    continue
                name = of_set.get(frozenset(elements))
                if name is None:
                    name = "body_%d" % (b + 1) + ("_%d" % (len(volumes) + 1) if volumes else "")
                    self.more.append("*ELSET, ELSET=%s" % name)
                    self.more += [", ".join(map(str, elements[i:i + 12])) + "," for i in range(0, len(elements), 12)]
                volumes.append(spelled.get(name, name))
                materials.append(material)
            self.names[b] = volumes[0]
            self.lines.append("&body name=%s, volume=%s, material=%s /" % (quoted(volumes[0]), ", ".join(map(quoted, volumes)),
                                                                         ", ".join(map(quoted, materials))))

    def supports(self):
        """&support on the faces all of whose nodes have the same given displacements; their values by load case."""
        given, place = collections.defaultdict(dict), {}
        for n, d in self.steps[0].displacement:
            if n in self.reference or n in self.turning or d > self.deck.dimension:
                continue
            entries = [step.displacement[n, d] for step in self.steps]
            given[n][d], place[n, d] = tuple(value for value, _ in entries), entries[0][1]
        for card in self.of("transform"):
            self.leave(card.place, "*TRANSFORM: supports and forces are taken in global axes")
        # Directions of a face are those that all its nodes have with one value.
        groups = collections.OrderedDict()
        for face, nodes in self.deck.outer.items():
            common = tuple(d for d in (1, 2, 3) if all(d in given.get(n, {}) for n in nodes) and len({given[n][d] for n in nodes}) == 1)
            if common and self.deck.body_of[face[0]] not in self.rigid:
                groups.setdefault((self.deck.body_of[face[0]], common, tuple(given[nodes[0]][d] for d in common)), []).append(face)
        held = collections.defaultdict(set)
        for i, ((b, directions, values), faces) in enumerate(groups.items(), 1):
            head = "&support body=%s, surface=%s, fix='%s'" % (quoted(self.body(b)), quoted(self.surface("fix_%d" % i, faces)),
                                                               "".join(self.axes[d - 1] for d in directions))
            cases = collections.OrderedDict()
            for k, case in enumerate(self.cases):
                cases.setdefault(tuple(value[k] for value in values), []).append(case)
            moved = [(value, of_value) for value, of_value in cases.items() if any(value)]
            for value, of_value in moved:
                full = [value[directions.index(d)] if d in directions else 0.0 for d in range(1, self.deck.dimension + 1)]
                self.lines.append("%s, value=%s%s /" % (head, text_of(full), self.keys_of_cases(of_value)))
            if not moved:
                self.lines.append(head + " /")
            for face in faces:
                for n in self.deck.outer[face]:
                    held[n].update(directions)
        lost = collections.defaultdict(list)
        for n, values in given.items():
            for d in values:
                if d not in held[n]:
                    lost[place[n, d], d, n in self.deck.body_of_node].append(n)
        for (at, d, solid), nodes in sorted(lost.items()):
            listed = "%s%s" % (", ".join(map(str, sorted(nodes)[:8])), ", ..." if len(nodes) > 8 else "")
            self.leave(at, "*BOUNDARY: direction %s of %d nodes %s (%s)" % (
                "xyz"[d - 1], len(nodes), "on no whole face with it" if solid else "that no solid element has", listed))

    def nodal_forces(self, step):
        """&load of nodal forces: a traction where they are its nodal forces, else a total force and moment."""
        force, places, lines = collections.defaultdict(lambda: np.zeros(3)), collections.defaultdict(dict), []
        for (n, d), entries in step.force.items():
            if n in self.reference or n in self.turning:
                continue
            force[n][d - 1] = sum(value for _, value, _ in entries)
            for _, _, at in entries:
                places[self.deck.body_of_node.get(n), d - 1][at] = True

        def leave(b, d, message):
            self.leave(", ".join(places[b, d]), "*CLOAD: " + message)

        if force and self.deck.analysis == "axisymmetric":
            for b, d in places:
                leave(b, d, "axisymmetric elements: give tractions in their place")
            return lines
        for b in range(self.deck.n_bodies):
            for d in range(self.deck.dimension):
                nodes = {n for n, f in force.items() if self.deck.body_of_node.get(n) == b and f[d] != 0}
                if not nodes:
                    continue
                faces = [face for face, of_face in self.deck.outer.items() if nodes.issuperset(of_face)]
                unit = self.deck.unit_loads(faces)
                if set(unit) != nodes:
                    leave(b, d, "forces in direction %s on %d nodes of body %s that are no whole face (%s%s), in all %.6g"
                          % ("xyz"[d], len(nodes), self.body(b), ", ".join(map(str, sorted(nodes)[:8])), ", ..." if len(nodes) > 8 else "",
                             sum(force[n][d] for n in nodes)))
                    continue
                patches = self.deck.patches(faces)
                units = [self.deck.unit_loads(patch) for patch in patches]
                order = sorted(nodes)
                matrix = np.array([[unit.get(n, 0.0) for unit in units] for n in order])
                right = np.array([force[n][d] for n in order])
                traction = np.linalg.lstsq(matrix, right, rcond=None)[0]
                names = ["force_%d_%s" % (b + 1, "xyz"[d]) + ("_%d" % (k + 1) if len(patches) > 1 else "") for k in range(len(patches))]
                exact = np.abs(matrix @ traction - right).max() <= CONSISTENT*np.abs(right).max()
                if not exact and (len(patches) > 1 or abs(right.sum()) < CONSISTENT*np.abs(right).sum()):
                    leave(b, d, "forces in direction %s on body %s: those of no uniform traction on each of %d faces, in all %.6g"
                          % ("xyz"[d], self.body(b), len(patches), right.sum()))
                    continue
                for name, patch, value in zip(names, patches, traction):
                    vector = np.zeros(self.deck.dimension)
                    vector[d] = value if exact else right.sum()
                    load = "traction=" + text_of(vector)
                    if not exact:
                        point = sum(f*np.array(self.deck.nodes[n]) for n, f in zip(order, right))/right.sum()
                        load = "force=%s, point=%s" % (text_of(vector), text_of(point[:self.deck.dimension]))
                    lines.append("&load body=%s, surface=%s, %s" % (quoted(self.body(b)), quoted(self.surface(name, patch)), load))
                if not exact:
                    leave(b, d, "forces in direction %s on body %s are those of no uniform traction: written as their total force "
                          "at its point, spread over the faces" % ("xyz"[d], self.body(b)))
        for b, d in places:
            if b is None:
                lost = [n for n, f in force.items() if n not in self.deck.body_of_node and f[d] != 0]
                leave(b, d, "forces on %d nodes that no solid element has" % len(lost))
        return lines

    def distributed_loads(self, step):
        """&load of *DLOAD and *DSLOAD."""
        pressures, lines, loaded = collections.OrderedDict(), [], {}

        def press(card, value, b, faces):
            for face in faces:
                if face in loaded:
                    self.leave(card.place, "several pressures on a face, the other one of %s: their sum is taken" % loaded[face])
                loaded[face] = card.place
            pressures.setdefault((b, value), []).extend(faces)

        for (keyword, target, label), entries in step.load.items():
            for _, card, fields in entries:
                if keyword == "dsload" and label == "P":
                    with located(card):
                        found = self.deck.faces_of_surface(fields[0])[1]
                    for b, faces in found.items():
                        press(card, number(fields[2]), b, faces)
                elif keyword == "dload" and re.fullmatch("P[1-6]", label):
                    press(card, number(fields[2]), self.deck.body_of[target], [(target, int(label[1]))])
                elif keyword == "dload" and label in ("GRAV", "CENTRIF"):
                    lines += self.volume_load(card, fields, label)
                else:
                    self.leave(card.place, "load %s" % label)
        for i, ((b, value), faces) in enumerate(pressures.items(), 1):
            if value:
                # A face that has the value twice needs two groups.
                times = collections.Counter(faces)
                while times:
                    name = self.surface("pressure_%d" % i, list(times))
                    lines.append("&load body=%s, surface=%s, pressure=%.12g" % (quoted(self.body(b)), quoted(name), value))
                    times -= collections.Counter(list(times))
        return lines

    def volume_load(self, card, fields, label):
        """Gravity or a centrifugal load on whole bodies."""
        with located(card):
            elements = set(self.deck.members(self.deck.element_sets, fields[0]) if fields[0] else self.deck.elements)
        lines = []
        for b in range(self.deck.n_bodies):
            own = [e for e, c in self.deck.body_of.items() if c == b]
            inside = [e for e in own if e in elements]
            if not inside:
                continue
            materials = {self.section.get(e) for e in own}
            density = {self.density.get(m) for m in materials}
            if len(inside) < len(own) or None in density:
                self.leave(card.place, "%s on body %s: on a part of it, or materials without density" % (label, self.body(b)))
                continue
            values = [number(f) for f in fields[2:]]
            if label == "GRAV":
                direction = np.array(values[1:4])/np.linalg.norm(values[1:4])*values[0]
                lines.append("&load body=%s, acceleration=%s" % (quoted(self.body(b)), text_of(direction[:self.deck.dimension])))
                continue
            axis = np.array(values[4:7])/np.linalg.norm(values[4:7])*values[0]**0.5
            keys = "angular_velocity=%s, centre=%s" % (text_of(axis), text_of(values[1:4]))
            if self.deck.dimension == 2:
                keys = "angular_velocity=%.12g" % np.linalg.norm(axis)
                if self.deck.analysis != "axisymmetric":
                    keys += ", centre=" + text_of(values[1:3])
            lines.append("&load body=%s, %s" % (quoted(self.body(b)), keys))
        return lines

    def initial_temperatures(self):
        self.start = {}
        for card in self.of("initialconditions"):
            if card.get("type").lower() != "temperature":
                self.leave(card.place, "initial conditions of type %s" % card.get("type"))
                continue
            with located(card):
                for fields in card.data:
                    self.start.update(dict.fromkeys(self.nodes_of(fields[0]), number(fields[1])))

    def temperatures(self, step):
        """&temperature of bodies: one change of temperature, or the field of the deck above one initial temperature."""
        lines = []
        for b in range(self.deck.n_bodies):
            if not any(self.expansion.get(self.section.get(e)) for e, c in self.deck.body_of.items() if c == b):
                continue
            own = [n for n, c in self.deck.body_of_node.items() if c == b]
            change = {step.temperature.get(n, (self.start.get(n, 0.0),))[0] - self.start.get(n, 0.0) for n in own}
            start = {self.start.get(n, 0.0) for n in own}
            if len(change) == 1:
                if change != {0.0}:
                    lines.append("&temperature body=%s, value=%.12g" % (quoted(self.body(b)), change.pop()))
            elif len(start) == 1 and all(n in step.temperature or n in self.start for n in own):
                field = "temperature" + (" step %d" % step.number if step.number else "")
                lines.append("&temperature body=%s, field='%s', reference=%.12g" % (quoted(self.body(b)), field, start.pop()))
            else:
                places = dict.fromkeys(step.temperature[n][1] for n in own if n in step.temperature)
                self.leave(", ".join(places), "temperatures of body %s of which some nodes have none, or above initial temperatures that "
                           "differ: give a formula" % self.body(b))
        return lines

    def one_node(self, card, key, prefix):
        """A node that a card names by its number or by a set of one node."""
        field = card.get(key)
        if not field:
            return None
        with located(card):
            found = self.deck.members(self.deck.node_sets, field, prefix)
            if len(found) != 1:
                raise ValueError("%s names %d nodes" % (key.upper(), len(found)))
        return found[0]

    def find_references(self):
        """Nodes that stand for rigid bodies and pre-tensions: `reference` and `turning` (rotations) by node, `rigid` by body."""
        self.reference, self.turning, self.tension, self.rigid = {}, {}, {}, {}
        for card in self.of("rigidbody"):
            for prefix, _ in self.deck.scopes(card):
                if card.get("elset"):
                    with located(card):
                        elements = set(self.deck.members(self.deck.element_sets, card.get("elset"), prefix))
                else:
                    nodes = card.get("nset") or card.get("tienset") or card.get("pinnset")
                    if not nodes:
                        self.leave(card.place, "*RIGID BODY without a set of elements or nodes")
                        continue
                    with located(card):
                        nodes = set(self.deck.members(self.deck.node_sets, nodes, prefix))
                    elements = {e for e, own in self.deck.elements.items() if nodes.issuperset(own)}
                    touched = {self.deck.body_of_node[n] for n in nodes if n in self.deck.body_of_node}
                    if not touched <= {self.deck.body_of[e] for e in elements}:
                        elements = set()
                bodies = {self.deck.body_of[e] for e in elements}
                whole = sum(b in bodies for b in self.deck.body_of.values()) == len(elements)
                at, turn = self.one_node(card, "refnode", prefix), self.one_node(card, "rotnode", prefix)
                if len(bodies) != 1 or not whole or at is None:
                    self.leave(card.place, "*RIGID BODY that is not one whole body with a reference node; give its surface a body of its own "
                               "or supports")
                    continue
                b = bodies.pop()
                self.rigid[b] = at, turn, card
                self.reference[at] = b
                if turn is not None:
                    self.turning[turn] = b
        for card in self.of("pretensionsection"):
            for prefix, _ in self.deck.scopes(card):
                node = self.one_node(card, "node", prefix)
                if node is None or node in self.tension:
                    self.leave(card.place, "*PRE-TENSION SECTION without a node of its own")
                else:
                    self.tension[node] = card

    def tensions(self):
        """&bolt of pre-tension sections: flat surfaces inside a body."""
        for node, card in self.tension.items():
            said = ["%s %.6g (%s)" % step.tension[node] for step in self.steps if node in step.tension]
            said = "*PRE-TENSION SECTION, NODE=%d, with %s" % (node, ", ".join(dict.fromkeys(said)) or "neither force nor shortening")
            bodies = {}
            for prefix, _ in self.deck.scopes(card):
                if card.get("surface"):
                    with located(card):
                        name = "%s.%s" % (prefix, card.get("surface")) if prefix else card.get("surface")
                        spelled, bodies = self.deck.faces_of_surface(name)
            acts = [step.tension.get(node, ("free", 0.0, ""))[:2] for step in self.steps]
            kinds = [kind for kind, _ in acts]
            # Forces come first, and a bolt stays locked.
            forces = kinds.count("force")
            right = len(set(acts)) == 1 if forces == 0 else len(set(acts[:forces])) == 1 and set(kinds[forces:]) <= {"locked"}
            if len(bodies) != 1 or len(self.deck.scopes(card)) != 1:
                self.leave(card.place, said + ": it has no surface inside one body")
            elif not right or acts[0][0] not in ("force", "shortening") or kinds[0] == "force" and not acts[0][1] > 0:
                self.leave(card.place, said + ": &bolt has one positive force, in the first load cases, or one shortening")
            elif not self.is_outward(card, next(iter(bodies.values()))):
                self.leave(card.place, said + ": its normal is not that of the surface, outwards from its elements")
            else:
                b = next(iter(bodies))
                keys = self.keys_of_cases(self.cases[:forces]) if forces else ""
                if len(self.cases) > 1 and forces == len(self.cases):
                    keys = ", case=" + ", ".join(map(quoted, self.cases))
                self.lines.append("&bolt name=%s, body=%s, surface=%s, %s=%.12g%s /" % (
                    quoted(spelled), quoted(self.body(b)), quoted(spelled), *acts[0], keys))

    def is_outward(self, card, faces):
        """Whether the normal of a section, if it is given, is that of its faces."""
        given = np.array([number(f) for f in (card.data or [[]])[0]] + [0.0]*3)[:3]
        if not given.any():
            return True
        for element, label in faces:
            x = np.array([self.deck.nodes[n] for n in self.deck.face(element, label)])
            inside = np.mean([self.deck.nodes[n] for n in self.deck.elements[element]], axis=0)
            n = np.cross(x[1] - x[0], x[2] - x[0] if self.deck.dimension == 3 else [0, 0, 1])
            n *= np.sign(n @ (x[0] - inside))/np.linalg.norm(n)
            if n @ given < 0.99*np.linalg.norm(given):
                return False
        return True

    def motions(self):
        """&rigid_body with the motions of its reference node, and &load with its forces."""
        plane, axial = self.deck.dimension == 2, self.deck.analysis == "axisymmetric"
        names = {1: "x", 2: "y", 3: "z", 4: "rx", 5: "ry", 6: "rz"}
        for d in ([3, 4, 5] if plane else []) + ([1, 6] if axial else []):
            del names[d]
        for b, (at, turn, card) in self.rigid.items():
            point = self.deck.nodes[at][:self.deck.dimension]
            if axial:
                point = [0.0, point[1]]

            def values(where, pick):
                found = {}
                for (n, d), entry in where.items():
                    if n == at or n == turn:
                        found[d + (3 if n == turn and d <= 3 else 0)] = pick(entry)
                return {d: value for d, value in found.items() if d in names}

            held = sorted(values(self.steps[0].displacement, lambda entry: 0))
            cases = collections.OrderedDict()
            for step, case in zip(self.steps, self.cases):
                moved = values(step.displacement, lambda entry: entry[0])
                cases.setdefault(tuple(moved[d] for d in held), []).append(case)
            head = "&rigid_body body=%s, point=%s, fix=%s" % (quoted(self.body(b)), text_of(point), quoted(" ".join(names[d] for d in held)))
            moved = [(value, of_value) for value, of_value in cases.items() if any(value)]
            for value, of_value in moved:
                of = dict(zip(held, value))
                keys = ", value=" + text_of([of.get(d, 0.0) for d in range(1, self.deck.dimension + 1)])
                if any(of.get(d) for d in (4, 5, 6)):
                    keys += ", rotation=" + text_of([of.get(d, 0.0) for d in ([6] if plane else [4, 5, 6])])
                self.lines.append("%s%s%s /" % (head, keys, self.keys_of_cases(of_value)))
            if not moved:
                self.lines.append(head + " /")
            faces = [face for face in self.deck.outer if self.deck.body_of[face[0]] == b]

            def forces(step):
                force = values(step.force, lambda entries: sum(value for _, value, _ in entries))
                if not any(force.values()):
                    return []
                keys = "force=" + text_of([force.get(d, 0.0) for d in range(1, self.deck.dimension + 1)])
                if any(force.get(d) for d in (4, 5, 6)):
                    keys += ", moment=" + text_of([force.get(d, 0.0) for d in ([6] if plane else [4, 5, 6])])
                if not axial:
                    keys += ", point=" + text_of(point)
                return ["&load body=%s, surface=%s, %s" % (quoted(self.body(b)), quoted(self.surface("rigid_%d" % (b + 1), faces)), keys)]

            self.by_case(forces)

    def contacts(self):
        """&contact of contact pairs."""
        behaviour, current = {}, None
        for card in self.cards:
            if card.keyword == "surfaceinteraction":
                current = card.get("name").upper()
                behaviour[current] = ""
            elif current and card.keyword == "surfacebehavior":
                kind = card.get("pressure-overclosure", "hard").lower()
                if kind == "tied":
                    behaviour[current] = None
                elif kind == "linear":
                    behaviour[current] = ", theta=%.12g" % (1/number(card.data[0][0]))
                elif kind != "hard":
                    self.leave(card.place, "pressure-overclosure %s: taken for hard contact" % kind.upper())
            elif current and card.keyword == "friction":
                self.leave(card.place, "friction: contact is frictionless")
        for card in self.of("contactpair"):
            if "adjust" in card.parameters:
                self.leave(card.place, "ADJUST: the gap of the mesh is taken; `gap=0` of &contact closes it")
            keys = behaviour.get(card.get("interaction").upper(), "")
            if card.get("interaction").upper() not in behaviour:
                self.leave(card.place, "there is no surface interaction '%s': hard contact is taken" % card.get("interaction"))
            for slave, master in (fields[:2] for fields in card.data):
                self.pairs(card, "tie" if keys is None else "contact", slave, master, keys or "")
        for card in self.of("tie"):
            if set(card.parameters) & {"cyclicsymmetry", "multistage"}:
                self.leave(card.place, "*TIE with cyclic symmetry: see angle of &tie")
                continue
            radius = card.get("positiontolerance")
            for slave, master in (fields[:2] for fields in card.data):
                self.pairs(card, "tie", slave, master, ", search_radius=%.12g" % number(radius) if radius and number(radius) > 0 else "")

    def pairs(self, card, group, slave, master, keys):
        """&contact or &tie of two surfaces, one for each two bodies that have them."""
        sides = []
        for name in (slave, master):
            with located(card):
                spelled, found = self.deck.faces_of_surface(name)
            if not found:
                self.leave(card.place, "surface %s: its nodes are no whole face" % spelled)
            sides.append([(b, spelled) for b in found])
        for a, one in sides[0]:
            for b, other in sides[1]:
                if a == b:
                    self.leave(card.place, "%s of %s and %s, both of body %s" % (group, one, other, self.body(a)))
                    continue
                name = "%s - %s" % (one, other) + (" %d-%d" % (a + 1, b + 1) if len(sides[0])*len(sides[1]) > 1 else "")
                self.lines.append("&%s name=%s, surface_a=%s, surface_b=%s%s /" % (
                    group, quoted(name), quoted("%s:%s" % (self.body(a), one)), quoted("%s:%s" % (self.body(b), other)), keys))

    def others(self):
        """What nobody reads."""
        for card in self.deck.cards:
            if card.keyword and card.keyword not in SILENT | {"transform", "plastic", "hyperelastic", "hyperfoam", "creep", "usermaterial",
                                                              "cyclichardening", "depvar"}:
                self.leave(card.place, "*" + card.keyword.upper() + HINTS.get(card.keyword, ""))
            elif card.part is not None and card.keyword not in OF_PARTS | {"heading"}:
                self.leave(card.place, "*%s inside a *PART" % card.keyword.upper())
        for card in self.of("step"):
            if "nlgeom" in card.parameters and card.get("nlgeom").lower() != "no":
                self.leave(card.place, "NLGEOM: displacements are small in dotyk")

    def write(self, deck_path):
        self.materials()
        self.bodies()
        self.find_references()
        self.read_steps()
        self.initial_temperatures()
        if len(self.steps) > 1:
            self.lines += ["&case name=%s /" % quoted(name) for name in self.cases]
        self.supports()
        self.motions()
        self.tensions()
        for lines_of in (self.distributed_loads, self.nodal_forces, self.temperatures):
            self.by_case(lines_of)
        self.contacts()
        self.others()
        analysis = "" if self.deck.analysis == "3d" else ", analysis='%s'" % self.deck.analysis
        scene = "&scene title=%s, mesh=%s%s /" % (quoted(deck_path.stem), quoted(self.sets.name), analysis)
        comments = ["! Not carried over: " + text for text in self.left]
        lines = ["! Made from %s by inp2dotyk.py." % deck_path.name, *comments, scene, *self.lines, "&solver theta=0 /"]
        name = os.path.relpath(deck_path, self.sets.parent)
        self.sets.write_text("\n".join(["** Sets and surfaces for %s" % self.path.name, "*INCLUDE, INPUT=" + name, *self.more]) + "\n")
        self.path.write_text("\n".join(lines) + "\n")


def stiffness(values, kind):
    """Upper triangle by rows in the order 11 22 33 23 13 12, from the constants of *ELASTIC, TYPE=ORTHO or ANISO."""
    order = ["11", "22", "33", "12", "13", "23"]
    if kind == "ort":
        names = ["1111", "1122", "2222", "1133", "2233", "3333", "1212", "1313", "2323"]
    else:
        names = [order[j] + order[i] for i in range(6) for j in range(i + 1)]
    table = collections.defaultdict(float)
    for name, value in zip(names, values):
        table[name[:2], name[2:]] = table[name[2:], name[:2]] = value
    rows = ["11", "22", "33", "23", "13", "12"]
    return [table[rows[i], rows[j]] for i in range(6) for j in range(i, 6)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("deck", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, help="namelist; default: the deck with the ending .nml")
    arguments = parser.parse_args()
    path = arguments.output or arguments.deck.with_suffix(".nml")
    try:
        scene = Scene(Deck(arguments.deck), path, path.with_name(path.stem + "_sets.inp"))
        scene.write(arguments.deck)
    except (OSError, ValueError, KeyError, IndexError, ZeroDivisionError) as error:
        print("inp2dotyk: %s: %s" % (arguments.deck, error if not isinstance(error, KeyError) else "unknown name %s" % error), file=sys.stderr)
        return 2
    for text in scene.left:
        print("not carried over: " + text, file=sys.stderr)
    return int(bool(scene.left))


if __name__ == "__main__":
    sys.exit(main())
