"""Steps of a deck, which become load cases."""
import collections
import re

from .cards import located, number
from .namelist import Namelist

# Cards that a load case of dotyk is made of.
PROCEDURES = {"static"}
OTHER_PROCEDURES = set("""dynamic frequency buckle heattransfer modaldynamic steadystatedynamics visco coupledtemperaturedisplacement
uncoupledtemperaturedisplacement green sensitivity complexfrequency electromagnetics cfd geostatic soils substructuregenerate""".split())
# Named conditions of Abaqus: first and last displacement.
SYMMETRY = {"ENCASTRE": (1, 3), "PINNED": (1, 3), "XSYMM": (1, 1), "YSYMM": (2, 2), "ZSYMM": (3, 3)}


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


class Steps(Namelist):
    """What acts in each step."""

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
                    other = {"dload": "dsload", "dsload": "dload"}.get(card.keyword)
                    if any(key[0] == other for key in at.load):
                        self.leave(card.place, "*%s, OP=NEW: *%s of earlier steps goes on, as in Abaqus; CalculiX ends it, too: delete its groups from the load cases "
                                   "from here on if that is meant" % (card.keyword.upper(), other.upper()))
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
