"""The scene as a namelist: groups, remarks, and surfaces of the file of sets."""
import collections

from .cards import OF_PARTS, located


def quoted(name):
    return "'%s'" % name.replace("'", "''")


def text_of(values):
    return ", ".join("%.12g" % v for v in values)


class Namelist:
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

    def node_set(self, name, nodes):
        """A set of nodes of the file of sets; its name."""
        key = name.split("_")[0], tuple(sorted(nodes))
        if key not in self.known:
            while name.upper() in self.used:
                name += "_"
            self.used.add(name.upper())
            self.known[key] = name
            self.more += ["*NSET, NSET=%s" % name] + [", ".join(map(str, key[1][i:i + 10])) for i in range(0, len(nodes), 10)]
        return self.known[key]

    def nodes_of(self, field):
        return self.deck.members(self.deck.node_sets, field)

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
