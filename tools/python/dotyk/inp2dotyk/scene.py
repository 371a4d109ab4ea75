"""The scene of a deck, with all that was carried over and what was not."""
import os

from .cards import OF_PARTS
from .contacts import Contacts
from .loads import Loads
from .materials import Materials
from .namelist import quoted
from .rigid import Rigid
from .steps import Steps

# Cards that say nothing about the scene, or nothing but how CalculiX solves it and what it prints.
SILENT = set("""heading node element nset elset surface include material elastic expansion density solidsection boundary cload dload dsload
step endstep static contactpair surfaceinteraction surfacebehavior tie temperature initialconditions orientation nodeprint nodefile elprint
elfile contactprint contactfile output nodeoutput elementoutput contactoutput controls sectionprint friction physicalconstants restart part
endpart assembly endassembly instance endinstance preprint fieldoutput historyoutput amplitude output energyoutput rigidbody
pretensionsection""".split())
# What users may do about cards that are not carried over.
HINTS = {"contact": ": general contact; `&contact auto=.true. /` finds the pairs", "coupling": ": see force and moment of &load, &rigid_body",
         "equation": ": see &tie, &rigid_body", "mpc": ": see &tie, &rigid_body", "clearance": ": see gap of &contact",
         "contactinterference": ": see gap of &contact and &contact_case"}


class Scene(Steps, Materials, Loads, Rigid, Contacts):
    """A scene, written with its file of sets."""

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
        lines = ["! Made from %s by dotyk-convert." % deck_path.name, *comments, scene, *self.lines, "&solver theta=0 /"]
        name = os.path.relpath(deck_path, self.sets.parent)
        self.sets.write_text("\n".join(["** Sets and surfaces for %s" % self.path.name, "*INCLUDE, INPUT=" + name, *self.more]) + "\n")
        self.path.write_text("\n".join(lines) + "\n")
