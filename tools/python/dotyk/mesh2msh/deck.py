"""Meshes of Abaqus and CalculiX decks: nodes, elements, sets, surfaces, parts and instances, temperatures.

Names of the sets and surfaces of a part get the name of the instance and a dot in front, as Abaqus writes them; the instance itself is a
set of its elements. Numbers get an offset: 2000017 is number 17 of the second instance. Keywords about materials, loads and steps are
listed and not read.
"""
import numpy as np

from . import elements
from .cards import Cards, integer
from .elements import KINDS
from .mesh import Fault, Index, Mesh

NOT_GENERATED = "ncopy ngen nfill nmap elgen elcopy system elementcopy".split()
OF_FRAME = "assembly endassembly endinstance heading endstep".split()
# Members of a range beyond which it is a mistake.
MOST_MEMBERS = 10**9
INITIAL, GIVEN = "initial_temperature", "temperature"


def unquoted(text):
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


class Set:
    """Set of nodes or elements: pieces of (numbers, their card or None, the lines there); missing members without a card are no mistake."""

    def __init__(self, name):
        self.name, self.pieces = name, []

    def add(self, numbers, card=None, lines=None):
        self.pieces.append((np.atleast_1d(np.asarray(numbers, dtype=np.int64)), card, lines))

    def numbers(self):
        return np.concatenate([piece[0] for piece in self.pieces]) if self.pieces else np.zeros(0, dtype=np.int64)

    def moved(self, name, offset):
        moved = Set(name)
        moved.pieces = [(numbers + offset, card, lines) for numbers, card, lines in self.pieces]
        return moved


class Surface:
    """Faces of elements, or nodes: entries (set in small letters or None, number, label or 0 for the outer faces, card, line)."""

    def __init__(self, name, of_nodes):
        self.name, self.of_nodes, self.entries = name, of_nodes, []


class Part:
    """A part, or the whole mesh. Sets and surfaces are by their names in small letters."""

    def __init__(self):
        # (numbers, coordinates, card, lines) and (type, kind, numbers, nodes by numbers, card, lines).
        self.nodes, self.elements = [], []
        self.node_sets, self.element_sets, self.surfaces = {}, {}, {}

    def greatest(self):
        return max([0] + [int(chunk[0].max()) for chunk in self.nodes if len(chunk[0])] +
                   [int(chunk[2].max()) for chunk in self.elements if len(chunk[2])])


def rotation(axis, degrees):
    """Matrix of a rotation about an axis."""
    a, angle = axis/np.linalg.norm(axis), np.radians(degrees)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle)*cross + (1 - np.cos(angle))*(cross @ cross)


class Deck:
    """A deck: the model, what is outside of parts with the instances of the parts.

    cards; parts {name in small letters: Part}; offsets {name of an instance in small letters: what is added to its numbers}; instances
    {name of a part: [(name, rotation matrix or None)]}; not_read: keywords.
    """

    def __init__(self, path):
        self.path, self.model, self.parts, self.offsets, self.instances, self.not_read = path, Part(), {}, {}, {}, []
        cards = Cards(path)
        self.cards, self.files, self.by_gmsh = cards.list, cards.files, cards.by_gmsh
        # Temperatures so far: at the beginning, and in the present step; the fields; the steps that have some.
        self.initial, self.given, self.temperatures, self.step, self.perturbs, self.with_some = {}, {}, {}, 0, False, []
        at = None
        for card in self.cards:
            card.part = at
            self.at = self.model if at is None else self.parts[at]
            if card.keyword == "part":
                if at is not None:
                    card.fail("*PART inside a *PART")
                at = card.part = card.get("name").lower()
                self.parts[at] = Part()
            elif card.keyword == "endpart":
                at = None
            elif card.keyword in NOT_GENERATED:
                card.fail("*%s: nodes and elements must be in the file, they are not generated" % card.keyword.upper())
            elif card.keyword not in OF_FRAME:
                getattr(self, "read_" + card.keyword, self.note)(card)
        self.end_step()
        if at is not None:
            raise Fault("%s: the file ends inside a *PART: *END PART is missing" % path)

    def note(self, card, text=""):
        """Note a keyword that is not read."""
        text = "*" + card.keyword.upper() + text
        if text not in self.not_read:
            self.not_read.append(text)

    def open_set(self, card, keyword):
        """The set that a card names, in the present part."""
        sets = self.at.node_sets if keyword == "nset" else self.at.element_sets
        return sets.setdefault(card.get(keyword).lower(), Set(card.get(keyword)))

    # Nodes and elements

    def read_node(self, card):
        if set(card.get("system").lower()) & set("cs"):
            card.fail("*NODE, SYSTEM=%s: only Cartesian coordinates are read" % card.get("system"))
        table = card.table()
        if table is None or not np.isfinite(table).all() or (np.abs(table[:, 0]) > 2.0**53).any() or (table[:, 0] % 1 != 0).any():
            table = np.zeros((len(card.lines), 4))
            for i, fields in enumerate(card.data):
                table[i, 0] = card.integer(fields[0], i)
                table[i, 1:len(fields[:4])] = [card.real(f, i) for f in fields[1:4]]
        tags, x = table[:, 0].astype(np.int64), np.zeros((len(table), 3))
        x[:, :table.shape[1] - 1] = table[:, 1:4]
        if (tags <= 0).any():
            card.fail("the number of a node must be positive", int(np.flatnonzero(tags <= 0)[0]))
        self.at.nodes.append((tags, x, card, np.arange(len(tags))))
        if card.get("nset"):
            self.open_set(card, "nset").add(tags)

    def read_element(self, card):
        name = card.get("type")
        kind = elements.kind_of_type(name)
        if not name:
            card.fail("*ELEMENT needs TYPE=")
        if kind is None or kind.startswith("line") and not self.by_gmsh:
            card.fail("*ELEMENT, TYPE='%s' is not read, only solid elements: C3D4, C3D5, C3D6, C3D8, C3D10, C3D15, C3D20 and their "
                      "variants, in two dimensions CPS, CPE, CAX with 3, 4, 6, 8 nodes; remove these elements from the file, and model "
                      "what they stand for in the namelist" % name)
        values, first = self.connectivity(card, KINDS[kind][2])
        twice = np.sort(values[:, 1:], axis=1)
        twice = np.flatnonzero((twice[:, 1:] == twice[:, :-1]).any(axis=1))
        if len(twice):
            nodes = values[twice[0], 1:].tolist()
            card.fail("element %d has node %d twice: collapsed elements are not read, write it as a C3D6 or C3D15, or a triangle" % (
                values[twice[0], 0], next(n for n in nodes if nodes.count(n) > 1)), int(first[twice[0]]))
        self.at.elements.append((name.upper(), kind, values[:, 0], values[:, 1:], card, first))
        if card.get("elset"):
            self.open_set(card, "elset").add(values[:, 0])

    @staticmethod
    def connectivity(card, n_nodes):
        """Number and nodes of each element (n, n_nodes + 1), on as many lines as are needed; its first line."""
        found = card.integers()
        if found:
            values, counts = found
            last = np.cumsum(counts)
            n = len(values)//(n_nodes + 1)
            # Elements end where lines do.
            ends = np.arange(n + 1)*(n_nodes + 1)
            if len(values) == n*(n_nodes + 1) and np.isin(ends[1:], last, assume_unique=True).all():
                return values.reshape(n, n_nodes + 1), np.searchsorted(last, ends[:-1], side="right")
        rows, first, own = [], [], []
        for i, fields in enumerate(card.data):
            for f in filter(None, fields):
                if len(own) == n_nodes + 1:
                    card.fail("element %d has more than %d nodes" % (own[0], n_nodes), i)
                first += [i] if not own else []
                own.append(card.integer(f, i))
            if len(own) == n_nodes + 1:
                rows.append(own)
                own = []
        if own:
            card.fail("element %d has %d nodes, %d are needed" % (own[0], len(own) - 1, n_nodes), first[-1])
        return np.array(rows, dtype=np.int64).reshape(-1, n_nodes + 1), np.array(first, dtype=np.int64)

    # Sets and surfaces

    def number(self, text, offset=0):
        """The number of a node or element: an integer, or that of an instance, as part-1.17; None for other texts."""
        value = integer(text)
        if value is not None:
            return value + offset
        before, _, after = text.rpartition(".")
        value = integer(after)
        return value + self.offsets[before.lower()] if value is not None and before.lower() in self.offsets else None

    def above(self, card, sets, name, what, line=None):
        """A set that must be defined above: of the part, or of the instance that the card names."""
        for key in (name.lower(), "%s.%s" % (card.get("instance").lower(), name.lower())):
            if key in sets:
                return sets[key]
        return card.fail("there is no %s '%s' above this line" % (what, name.lower()), line)

    def read_set(self, card):
        """Numbers, ranges, and sets that are defined above."""
        keyword = card.keyword
        if not card.get(keyword):
            card.fail("*%s needs a name, %s=" % (keyword.upper(), keyword.upper()))
        instance, offset = card.get("instance"), 0
        if instance:
            offset = self.offsets.get(instance.lower(), 0)
            if not offset:
                card.fail("there is no instance '%s' above this line" % instance)
        new = self.open_set(card, keyword)
        if keyword == "nset" and "elset" in card.parameters:
            new.add(self.nodes_of(self.above(card, self.at.element_sets, card.get("elset"), "element set").numbers()))
        if "generate" in card.parameters:
            for i, fields in enumerate(card.data):
                given = [card.integer(f, i) for f in fields if f][:3]
                first, last, step = given + [given[0], 1][len(given) - 1:] if given else (1, 0, 1)
                if step < 1 or last < first:
                    card.fail("GENERATE needs first, last and step of a range", i)
                if (last - first)//step > MOST_MEMBERS:
                    card.fail("the range has too many members", i)
                new.add(np.arange(first, last + 1, step) + offset)
            return
        found = card.integers()
        if found:
            new.add(found[0] + offset, card, np.repeat(np.arange(len(found[1])), found[1]))
            return
        sets = self.at.node_sets if keyword == "nset" else self.at.element_sets
        for i, fields in enumerate(card.data):
            for text in filter(None, fields):
                value = self.number(text, offset)
                if value is not None:
                    new.add(value, card, [i])
                else:
                    new.add(self.above(card, sets, unquoted(text), "set", i).numbers())

    read_nset = read_elset = read_set

    def nodes_of(self, numbers):
        """Nodes of elements of the present part."""
        found = [nodes[np.isin(tags, numbers)].ravel() for _, _, tags, nodes, _, _ in self.at.elements]
        return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)

    def read_surface(self, card):
        name, kind = card.get("name"), card.get("type", "element").lower()
        if not name:
            card.fail("*SURFACE needs a name, NAME=")
        if "combine" in card.parameters or kind not in ("element", "node"):
            self.note(card, " NAME=" + name)
            return
        if name.lower() in self.at.surfaces:
            card.fail("the surface '%s' occurs a second time" % name)
        surface = self.at.surfaces[name.lower()] = Surface(name, kind == "node")
        for i, fields in enumerate(card.data):
            value, label = self.number(fields[0]), 0
            if not fields[0]:
                card.fail("expected an element, a node or a set", i)
            if len(fields) > 1 and fields[1] and kind != "node":
                label = "S123456".find(fields[1][1:].upper()) if len(fields[1]) == 2 and fields[1][0] in "sS" else 0
                if label < 1:
                    card.fail("expected a face of solid elements, S1 to S6, found '%s'" % fields[1], i)
            surface.entries.append((unquoted(fields[0]).lower() if value is None else None, value, label, card, i))

    # Instances

    def read_instance(self, card):
        """Add an instance of a part to the model: a translation of 3 numbers; two points of an axis and an angle."""
        name, part = card.get("name"), self.parts.get(card.get("part").lower())
        given = [card.real(f, i) for i, fields in enumerate(card.data) for f in fields]
        if not name or not card.get("part"):
            card.fail("*INSTANCE needs NAME= and PART=")
        if len(given) > 10:
            card.fail("an instance has one translation and one rotation: nodes and elements belong into its *PART")
        if 3 < len(given) < 10:
            card.fail("a rotation of an instance has 7 numbers: two points of the axis and the angle")
        if name.lower() in self.offsets:
            card.fail("the instance '%s' occurs a second time" % name)
        if part is None:
            card.fail("there is no part '%s' above this line" % card.get("part"))
        step = 10
        while step <= max(p.greatest() for p in self.parts.values()):
            step *= 10
        offset = self.offsets[name.lower()] = step*(len(self.offsets) + 1)
        shift, turn, centre = np.array((given + [0.0]*3)[:3]), None, np.array(given[3:6])
        if len(given) > 3:
            if np.array_equal(given[3:6], given[6:9]):
                card.fail("the two points of the axis of a rotation are the same")
            turn = rotation(np.array(given[6:9]) - centre, given[9])
        self.instances.setdefault(card.get("part").lower(), []).append((name, turn))
        for tags, x, own, lines in part.nodes:
            x = x + shift
            self.model.nodes.append((tags + offset, x if turn is None else centre + (x - centre) @ turn.T, own, lines))
        whole = self.model.element_sets.setdefault(name.lower(), Set(name))
        for kind, shape, tags, nodes, own, lines in part.elements:
            self.model.elements.append((kind, shape, tags + offset, nodes + offset, own, lines))
            whole.add(tags + offset)
        for sets, others in ((self.model.node_sets, part.node_sets), (self.model.element_sets, part.element_sets)):
            for key, other in others.items():
                sets["%s.%s" % (name.lower(), key)] = other.moved("%s.%s" % (name, other.name), offset)
        for key, other in part.surfaces.items():
            new = self.model.surfaces["%s.%s" % (name.lower(), key)] = Surface("%s.%s" % (name, other.name), other.of_nodes)
            new.entries = [("%s.%s" % (name.lower(), members) if members else None, value + offset if members is None else None, *rest)
                           for members, value, *rest in other.entries]

    # Temperatures: *TEMPERATURE goes on in later steps until OP=NEW; nodes without it have their initial temperature.

    def read_step(self, card):
        self.end_step()
        self.step, self.perturbs = self.step + 1, "perturbation" in card.parameters
        self.note(card)

    def end_step(self):
        """Keep what acts at the end of a step; steps that are a perturbation are passed over."""
        if not self.perturbs:
            self.temperatures[self.step] = dict(self.given)

    def read_temperature(self, card):
        target = self.initial if card.keyword == "initialconditions" else self.given
        if "file" in card.parameters or "user" in card.parameters:
            self.note(card, " with FILE or USER (%s)" % card.place)
            return
        if target is self.given:
            if self.perturbs:
                return
            self.with_some += [self.step] if self.step not in self.with_some else []
            if card.get("op").lower() == "new":
                target.clear()
        table = card.table()
        if table is not None and table.shape[1] > 1 and np.isfinite(table).all() and (table[:, 0] % 1 == 0).all():
            target.update(zip(table[:, 0].astype(np.int64).tolist(), table[:, 1].tolist()))
            return
        for i, fields in enumerate(card.data):
            value, number = card.real((fields + [""])[1], i), self.number(fields[0])
            if number is not None:
                target[number] = value
            else:
                target.update(dict.fromkeys(self.above(card, self.at.node_sets, unquoted(fields[0]), "node set", i).numbers().tolist(), value))

    def read_initialconditions(self, card):
        if card.get("type").lower() == "temperature":
            self.read_temperature(card)
        else:
            self.note(card)

    def fields(self):
        """Temperatures by their names: {name: {node number: value}}."""
        found = {INITIAL: self.initial} if self.initial else {}
        if len(self.with_some) == 1:
            found[GIVEN] = {**self.initial, **self.given}
        for step, given in self.temperatures.items() if self.with_some else ():
            if step > 0:
                found["%s step %d" % (GIVEN, step)] = {**self.initial, **given}
        return found

    # The mesh

    def mesh(self, dimension):
        """The mesh, and a remark."""
        model = self.model
        if not sum(len(chunk[0]) for chunk in model.nodes):
            raise Fault("%s: the file has no nodes outside of parts: *NODE or *INSTANCE is missing" % self.path)
        tags = np.concatenate([chunk[0] for chunk in model.nodes])
        nodes = Index(tags)
        twice = nodes.repeated()
        if twice is not None:
            raise Fault("%snode %d occurs a second time" % (place(model.nodes, twice, 0), tags[twice]))
        chunks = [chunk for chunk in model.elements if len(chunk[2])]
        if not chunks:
            raise Fault("%s: the file has no elements" % self.path)
        parts = [(kind, own, nodes.find(rows)) for _, kind, own, rows, _, _ in chunks]
        mesh = Mesh(tags, np.concatenate([chunk[1] for chunk in model.nodes]), parts, dimension)
        index = Index(mesh.tag)
        twice = index.repeated()
        if twice is not None:
            raise Fault("%selement %d occurs a second time" % (place(chunks, twice, 2), mesh.tag[twice]))
        mesh.check_dimension(lambda e: place(chunks, e, 2))
        for (_, own, rows), chunk in zip(parts, chunks):
            missing = np.argwhere(rows < 0)
            if len(missing):
                e, k = missing[0]
                raise Fault("%s: element %d has node %d, which no *NODE has" % (chunk[4].at(int(chunk[5][e])), own[e], chunk[3][e, k]))
        mesh.add_elements([(s.name, members(s, index, "element")) for s in model.element_sets.values()])
        for surface in model.surfaces.values():
            self.add_surface(mesh, surface, nodes, index)
        remark = mesh.add_node_sets([(s.name, members(s, nodes, "node")) for key, s in model.node_sets.items() if key not in model.surfaces])
        for name, values in self.fields().items():
            mesh.fields.append((name, np.array(list(values), dtype=np.int64), np.array(list(values.values()))[:, None], 0))
        return mesh, "; ".join(filter(None, ["not read: " + ", ".join(self.not_read) if self.not_read else "", remark]))

    def add_surface(self, mesh, surface, nodes, index):
        """Add the faces of a surface."""
        what, sets = ("node", self.model.node_sets) if surface.of_nodes else ("element", self.model.element_sets)
        numbers, faces = [], []
        for name, value, label, card, line in surface.entries:
            if name is None:
                chosen = (nodes if surface.of_nodes else index).find(np.array([value]))
                if chosen[0] < 0:
                    card.fail("surface '%s': there is no %s %d" % (surface.name, what, value), line)
            elif name not in sets:
                card.fail("surface '%s': there is no %s set '%s'" % (surface.name, what, name), line)
            else:
                chosen = members(sets[name], nodes if surface.of_nodes else index, what)
            if surface.of_nodes:
                numbers.append(chosen)
            elif label == 0:
                element, own = mesh.outer()
                inside = np.isin(element, chosen)
                faces.append((element[inside], own[inside]))
            else:
                for kind in np.unique(mesh.kind[chosen]):
                    name = elements.NAMES[kind]
                    if label > len(elements.FACES.get(elements.corner_kind(name), "").split()):
                        card.fail("element %d has no face S%d" % (mesh.tag[chosen[mesh.kind[chosen] == kind][0]], label), line)
                faces.append((chosen, np.full(len(chosen), label - 1)))
        if numbers:
            faces.append(mesh.faces_of_nodes(np.concatenate(numbers))[0])
        if faces:
            mesh.add_faces(surface.name, *(np.concatenate(part) for part in zip(*faces)))


def place(chunks, i, of_tags):
    """'file:line: ' of a node or element."""
    for chunk in chunks:
        if i < len(chunk[of_tags]):
            return chunk[-2].at(int(chunk[-1][i])) + ": "
        i -= len(chunk[of_tags])
    return ""


def members(chosen, index, what):
    """Indices of the members of a set, each once, without those that do not exist."""
    found = []
    for numbers, card, lines in chosen.pieces:
        own = index.find(numbers)
        if card is not None and (own < 0).any():
            i = int(np.flatnonzero(own < 0)[0])
            card.fail("set '%s': there is no %s %d" % (chosen.name, what, numbers[i]), int(lines[i]))
        found.append(own[own >= 0])
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)


def read(path, dimension):
    """The mesh of a deck, its remark, and the files that it is made of."""
    deck = Deck(path)
    mesh, remark = deck.mesh(dimension)
    return mesh, remark, deck.files
