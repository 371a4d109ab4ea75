#!/usr/bin/env python3
"""Writes a first scene of dotyk from a deck of CalculiX or Abaqus: bodies, materials, supports, loads, ties and contact pairs of its first
step.

usage: tools/inp2dotyk.py DECK.inp [-o SCENE.nml]

Writes SCENE.nml and SCENE_sets.inp beside it: the latter includes the deck and adds sets of the elements of each body, and surfaces for
supports and loads that the deck has on nodes or elements. What could not be carried over is said in comments of SCENE.nml and on the
standard error; exit code 1 then, 2 where nothing could be written. Needs numpy.
"""
import argparse
import collections
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
endpart assembly endassembly instance endinstance preprint fieldoutput historyoutput amplitude""".split())
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
        self.keyword, self.place, self.data, self.parameters = re.sub(r"\s", "", head).lower(), place, [], {}
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


class Deck:
    """What a deck says of its mesh, and its cards."""

    def __init__(self, path):
        self.cards = read_cards(path, path.parent)
        if any(card.keyword in ("part", "instance") for card in self.cards):
            raise ValueError("parts and instances: flatten the deck first; dotyk reads them as a mesh, see docs/limits.md")
        self.nodes, self.elements, self.types = {}, {}, {}
        self.node_sets, self.element_sets, self.surfaces = (collections.OrderedDict() for _ in range(3))
        for card in self.cards:
            getattr(self, "read_" + card.keyword, lambda card: None)(card)
        dimension = {3 if kind.startswith("C3D") else 2 if re.match("CPS|CPE|CAX", kind) else 0 for kind in self.types.values()}
        if len(dimension) != 1 or 0 in dimension:
            raise ValueError("elements %s: solid elements of one dimension are needed" % ", ".join(sorted(set(self.types.values()))))
        self.dimension = dimension.pop()
        kinds = {kind[:3] for kind in self.types.values()}
        self.analysis = {"C3D": "3d", "CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}[kinds.pop()]
        if kinds:
            raise ValueError("plane stress, plane strain and axisymmetric elements together")
        self.find_faces()
        self.find_bodies()

    def add(self, sets, name, members):
        known = sets.setdefault(name.upper(), [])
        known += members

    def read_node(self, card):
        for fields in card.data:
            self.nodes[int(fields[0])] = [number(f) for f in (fields[1:4] + ["", "", ""])[:3]]
        if card.get("nset"):
            self.add(self.node_sets, card.get("nset"), [int(f[0]) for f in card.data])

    def read_element(self, card):
        kind = card.get("type").upper()
        n = int((re.findall(r"\d+", kind[2 if kind.startswith("C3D") is False else 3:]) or ["0"])[0])
        values = [int(f) for fields in card.data for f in fields if f]
        if not n or len(values) % (n + 1):
            raise ValueError("%s: elements %s are not read" % (card.place, kind))
        for i in range(0, len(values), n + 1):
            self.elements[values[i]] = values[i + 1:i + n + 1]
            self.types[values[i]] = kind
        if card.get("elset"):
            self.add(self.element_sets, card.get("elset"), values[::n + 1])

    def members(self, sets, field):
        """Members that a field names: a number or a set."""
        if re.fullmatch(r"\d+", field):
            return [int(field)]
        if field.upper() not in sets:
            raise ValueError("there is no set '%s'" % field)
        return sets[field.upper()]

    def read_set(self, card, sets):
        name = card.get(card.keyword)
        for fields in card.data:
            if "generate" in card.parameters:
                first, last, step = (fields + ["1"])[:3] if len(fields) < 3 else fields[:3]
                self.add(sets, name, list(range(int(first), int(last) + 1, int(step or 1))))
            else:
                self.add(sets, name, [m for f in fields if f for m in list(self.members(sets, f))])

    def read_nset(self, card):
        self.read_set(card, self.node_sets)

    def read_elset(self, card):
        self.read_set(card, self.element_sets)

    def read_surface(self, card):
        of_nodes = card.get("type").lower() == "node"
        entries = []
        for fields in card.data:
            if of_nodes:
                entries += self.members(self.node_sets, fields[0])
            else:
                label = (fields + ["S0"])[1].upper()
                entries += [(e, int(label[1:])) for e in self.members(self.element_sets, fields[0])]
        self.surfaces[card.get("name").upper()] = (card.get("name"), of_nodes, entries)

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
        spelled, of_nodes, entries = self.surfaces[name.upper()]
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


def quoted(name):
    return "'%s'" % name.replace("'", "''")


def text_of(values):
    return ", ".join("%.12g" % v for v in values)


class Scene:
    """The scene under construction."""

    def __init__(self, deck, path, sets):
        self.deck, self.path, self.sets = deck, path, sets
        self.lines, self.more, self.left = [], [], []
        self.axes = "xyz"[:deck.dimension]
        self.step = [i for i, card in enumerate(deck.cards) if card.keyword == "endstep"][:1] or [len(deck.cards)]
        self.cards = deck.cards[:self.step[0]]
        self.names = {}

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
        """A surface of the file of sets."""
        self.more.append("*SURFACE, NAME=%s" % name)
        self.more += ["%d, S%d" % face for face in faces]
        return name

    def materials(self):
        """&material of each material, and what other parts need of it: {name: density, expansion}."""
        self.density, self.expansion = {}, {}
        orientation = {card.get("name").upper(): card for card in self.of("orientation")}
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
            name = card.get("material").upper()
            axes = orientation.get(card.get("orientation").upper())
            own = name if axes is None else name + " " + card.get("orientation").upper()
            used[own] = (name, axes)
            for e in self.deck.members(self.deck.element_sets, card.get("elset")):
                self.section[e] = own
            thickness = number((card.data or [["1"]])[0][0])
            if self.deck.dimension == 2 and thickness not in (0.0, 1.0):
                self.leave(card.place, "thickness %g: dotyk's plane analyses have thickness 1; divide forces by it" % thickness)
        for own, (name, axes) in used.items():
            keys = []
            for card in of_material.get(name, []):
                values = [number(f) for fields in card.data for f in fields]
                kind = card.get("type", "iso").lower()[:3]
                if card.keyword == "density":
                    self.density[own] = values[0]
                    keys.append("density=%.12g" % values[0])
                elif card.keyword == "expansion":
                    values = [number(f) for f in card.data[0]][:3 if kind == "ort" else 1]
                    self.expansion[own] = any(values)
                    if any(values):
                        keys.append("expansion=" + text_of(values))
                elif kind == "iso":
                    young, poisson = (values + [0.0])[:2]
                    keys.append("young=%.12g, poisson=%.12g" % (young, poisson))
                    if len(card.data) > 1:
                        self.leave(card.place, "material %s: constants that depend on the temperature; those of the first line are taken" % name)
                elif kind == "eng":
                    keys.append("young=%s, poisson=%s, shear=%s" % (text_of(values[:3]), text_of(values[3:6]), text_of(values[6:9])))
                elif kind in ("ort", "ani"):
                    keys.append("stiffness=" + text_of(stiffness(values, kind)))
            if not any(key.startswith(("young", "stiffness")) for key in keys):
                self.leave("", "material %s has no *ELASTIC" % own)
                keys.append("young=0, poisson=0")
            if axes is not None:
                if axes.get("system", "rectangular").lower()[:1] != "r":
                    self.leave(axes.place, "cylindrical axes of a material are no part of dotyk: its axes are those of the deck's global system")
                else:
                    a = [number(f) for f in axes.data[0]]
                    keys.append("axis_1=%s, axis_2=%s" % (text_of(a[:3]), text_of(a[3:6])))
                    if len(axes.data) > 1:
                        self.leave(axes.place, "the further rotation of the orientation")
            self.lines.append("&material name=%s, %s /" % (quoted(own), ", ".join(keys)))

    def bodies(self):
        """&body of each connected component; a set of the deck where it is one, else one of the file of sets."""
        deck, members = self.deck, collections.defaultdict(list)
        for e, b in deck.body_of.items():
            members[b, self.section.get(e, "?")].append(e)
        without = [e for e in deck.elements if e not in self.section]
        if without:
            self.leave("", "%d elements have no *SOLID SECTION with a material (the first is %d)" % (len(without), without[0]))
        of_set = {frozenset(m): name for name, m in deck.element_sets.items()}
        spelled = {card.get("elset").upper(): card.get("elset") for card in reversed(self.deck.cards)}
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
        """&support on the faces all of whose nodes have the same given displacements."""
        given = collections.defaultdict(dict)
        for card in self.of("boundary"):
            for fields in card.data:
                first, last = SYMMETRY.get(fields[1].upper(), (0, 0))
                if not first:
                    first = int(fields[1])
                    last = int(fields[2]) if len(fields) > 2 and fields[2] else first
                value = number(fields[3]) if len(fields) > 3 else 0.0
                if first > 3:
                    self.leave(card.place, "degree of freedom %d of nodes (temperature, rotation)" % first)
                    continue
                for n in self.deck.members(self.deck.node_sets, fields[0]):
                    for d in range(first, min(last, self.deck.dimension) + 1):
                        given[n][d] = value
        if self.of("transform"):
            self.leave(self.of("transform")[0].place, "*TRANSFORM: supports and forces are taken in global axes")
        # Directions of a face are those that all its nodes have with one value.
        groups = collections.OrderedDict()
        for face, nodes in self.deck.outer.items():
            common = tuple(d for d in (1, 2, 3) if all(d in given.get(n, {}) for n in nodes) and len({given[n][d] for n in nodes}) == 1)
            if common:
                groups.setdefault((self.deck.body_of[face[0]], common, tuple(given[nodes[0]][d] for d in common)), []).append(face)
        held = collections.defaultdict(set)
        for i, ((b, directions, values), faces) in enumerate(groups.items(), 1):
            name = self.surface("fix_%d" % i, faces)
            key = "fix='%s'" % "".join(self.axes[d - 1] for d in directions)
            if any(values):
                full = [values[directions.index(d)] if d in directions else 0.0 for d in range(1, self.deck.dimension + 1)]
                key += ", value=" + text_of(full)
            self.lines.append("&support body=%s, surface=%s, %s /" % (quoted(self.body(b)), quoted(name), key))
            for face in faces:
                for n in self.deck.outer[face]:
                    held[n].update(directions)
        lost = collections.defaultdict(list)
        for n, values in given.items():
            for d in values:
                if d not in held[n] and n in self.deck.body_of_node:
                    lost[d].append(n)
        for d, nodes in sorted(lost.items()):
            self.leave("*BOUNDARY", "direction %s of %d nodes on no whole face with it (%s%s)"
                       % ("xyz"[d - 1], len(nodes), ", ".join(map(str, sorted(nodes)[:8])), ", ..." if len(nodes) > 8 else ""))
        if any(n not in self.deck.body_of_node for n in given):
            self.leave("*BOUNDARY", "nodes that no solid element has, as those of rigid bodies")

    def nodal_forces(self):
        """&load of nodal forces: a traction where they are its nodal forces, else a total force and moment."""
        force = collections.defaultdict(lambda: np.zeros(3))
        for card in self.of("cload"):
            for fields in card.data:
                for n in self.deck.members(self.deck.node_sets, fields[0]):
                    if int(fields[1]) > self.deck.dimension:
                        self.leave(card.place, "moments and other loads of nodes (degree of freedom %s)" % fields[1])
                        continue
                    if force[n][int(fields[1]) - 1] != 0:
                        self.leave(card.place, "several forces on a node in one direction: their sum is taken")
                    force[n][int(fields[1]) - 1] += number(fields[2])
        if force and self.deck.analysis == "axisymmetric":
            self.leave(self.of("cload")[0].place, "*CLOAD of axisymmetric elements: give tractions in their place")
            return
        for b in range(self.deck.n_bodies):
            for d in range(self.deck.dimension):
                nodes = {n for n, f in force.items() if self.deck.body_of_node.get(n) == b and f[d] != 0}
                if not nodes:
                    continue
                faces = [face for face, of_face in self.deck.outer.items() if nodes.issuperset(of_face)]
                unit = self.deck.unit_loads(faces)
                if set(unit) != nodes:
                    self.leave("*CLOAD", "forces in direction %s on %d nodes of body %s that are no whole face (%s%s), in all %.6g"
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
                    self.leave("*CLOAD", "forces in direction %s on body %s: those of no uniform traction on each of %d faces, in all %.6g"
                               % ("xyz"[d], self.body(b), len(patches), right.sum()))
                    continue
                for name, patch, value in zip(names, patches, traction):
                    vector = np.zeros(self.deck.dimension)
                    vector[d] = value if exact else right.sum()
                    load = "traction=" + text_of(vector)
                    if not exact:
                        point = sum(f*np.array(self.deck.nodes[n]) for n, f in zip(order, right))/right.sum()
                        load = "force=%s, point=%s" % (text_of(vector), text_of(point[:self.deck.dimension]))
                    self.lines.append("&load body=%s, surface=%s, %s /" % (quoted(self.body(b)), quoted(self.surface(name, patch)), load))
                if not exact:
                    self.leave("*CLOAD", "forces in direction %s on body %s are those of no uniform traction: written as their total force "
                               "at its point, spread over the faces" % ("xyz"[d], self.body(b)))
        lost = [n for n in force if n not in self.deck.body_of_node]
        if lost:
            self.leave("*CLOAD", "forces on %d nodes that no solid element has" % len(lost))

    def distributed_loads(self):
        """&load of *DLOAD and *DSLOAD."""
        pressures = collections.OrderedDict()
        for card in self.of("dload", "dsload"):
            if card.get("amplitude"):
                self.leave(card.place, "the amplitude of a load: its whole value is taken")
            for fields in card.data:
                label = fields[1].upper()
                if card.keyword == "dsload" and label == "P":
                    found = self.deck.faces_of_surface(fields[0])[1]
                    for b, faces in found.items():
                        pressures.setdefault((b, number(fields[2])), []).extend(faces)
                elif re.fullmatch(r"P[1-6]", label):
                    for e in self.deck.members(self.deck.element_sets, fields[0]):
                        pressures.setdefault((self.deck.body_of[e], number(fields[2])), []).append((e, int(label[1])))
                elif label in ("GRAV", "CENTRIF"):
                    self.volume_load(card, fields, label)
                else:
                    self.leave(card.place, "load %s" % label)
        loaded = [face for faces in pressures.values() for face in faces]
        if len(loaded) > len(set(loaded)):
            self.leave("", "several pressures on a face: their sum is taken")
        for i, ((b, value), faces) in enumerate(pressures.items(), 1):
            name = self.surface("pressure_%d" % i, faces)
            self.lines.append("&load body=%s, surface=%s, pressure=%.12g /" % (quoted(self.body(b)), quoted(name), value))

    def volume_load(self, card, fields, label):
        """Gravity or a centrifugal load on whole bodies."""
        elements = set(self.deck.members(self.deck.element_sets, fields[0]))
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
                self.lines.append("&load body=%s, acceleration=%s /" % (quoted(self.body(b)), text_of(direction[:self.deck.dimension])))
                continue
            axis = np.array(values[4:7])/np.linalg.norm(values[4:7])*values[0]**0.5
            keys = "angular_velocity=%s, centre=%s" % (text_of(axis), text_of(values[1:4]))
            if self.deck.dimension == 2:
                keys = "angular_velocity=%.12g" % np.linalg.norm(axis)
                if self.deck.analysis != "axisymmetric":
                    keys += ", centre=" + text_of(values[1:3])
            self.lines.append("&load body=%s, %s /" % (quoted(self.body(b)), keys))

    def temperatures(self):
        """&temperature of bodies with one change of temperature."""
        start, end = {}, {}
        for card in self.of("initialconditions", "temperature"):
            if card.keyword == "initialconditions" and card.get("type").lower() != "temperature":
                self.leave(card.place, "initial conditions of type %s" % card.get("type"))
                continue
            for fields in card.data:
                for n in self.deck.members(self.deck.node_sets, fields[0]):
                    (end if card.keyword == "temperature" else start)[n] = number(fields[1])
        for b in range(self.deck.n_bodies):
            if not any(self.expansion.get(self.section.get(e)) for e, c in self.deck.body_of.items() if c == b) or not end:
                continue
            change = {end.get(n, start.get(n, 0.0)) - start.get(n, 0.0) for n, c in self.deck.body_of_node.items() if c == b}
            if len(change) > 1:
                self.leave("*TEMPERATURE", "temperatures of body %s that differ from node to node: give a formula" % self.body(b))
            elif change != {0.0}:
                self.lines.append("&temperature body=%s, value=%.12g /" % (quoted(self.body(b)), change.pop()))

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
            spelled, found = self.deck.faces_of_surface(name)
            if not found:
                self.leave(card.place, "surface %s: its nodes are no whole face" % spelled)
            sides.append([(b, spelled) for b in found])
        for a, one in sides[0]:
            for b, other in sides[1]:
                if a == b:
                    self.leave(card.place, "%s of body %s with itself" % (group, self.body(a)))
                    continue
                name = "%s - %s" % (one, other) + (" %d-%d" % (a + 1, b + 1) if len(sides[0])*len(sides[1]) > 1 else "")
                self.lines.append("&%s name=%s, surface_a=%s, surface_b=%s%s /" % (
                    group, quoted(name), quoted("%s:%s" % (self.body(a), one)), quoted("%s:%s" % (self.body(b), other)), keys))

    def others(self):
        """What nobody reads."""
        for card in self.cards:
            if card.keyword and card.keyword not in SILENT | {"transform", "plastic", "hyperelastic", "hyperfoam", "creep", "usermaterial",
                                                              "cyclichardening", "depvar"}:
                self.leave(card.place, "*" + card.keyword.upper())
        for card in self.of("step"):
            if "nlgeom" in card.parameters:
                self.leave(card.place, "NLGEOM: displacements are small in dotyk")
        rest = sum(card.keyword == "step" for card in self.deck.cards[self.step[0]:])
        if rest:
            self.leave("", "%d further steps: the scene is that of the first one" % rest)

    def write(self, deck_path):
        self.materials()
        self.bodies()
        self.supports()
        self.distributed_loads()
        self.nodal_forces()
        self.temperatures()
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
