"""Nodes, elements, sets and surfaces by their cards."""
import collections
import re

from .cards import number


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
        kind, other, others = (("nodes", "elements", self.element_sets) if sets is self.node_sets else ("elements", "nodes", self.node_sets))
        if name.upper() in others:
            raise ValueError("'%s' is a set of %s; one of %s is needed here: *%s" % (
                field, other, kind, "NSET, NSET=..., ELSET=%s makes it" % field if kind == "nodes" else "ELSET"))
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
