"""Contact pairs and ties."""
from .cards import located, number
from .namelist import Namelist, quoted


class Contacts(Namelist):
    """&contact and &tie."""

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
