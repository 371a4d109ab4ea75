"""Materials with their axes, and the bodies that have them."""
import collections

import numpy as np

from .cards import located, number
from .namelist import Namelist, quoted, text_of


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


class Materials(Namelist):
    """&material and &body."""

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
                    # 3, 0. turns nothing.
                    if len(axes.data) > 1 and number((axes.data[1] + ["0"])[1]) != 0:
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
