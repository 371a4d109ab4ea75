"""Keyword cards of a deck, with the files that it includes."""
import contextlib
import re

# Cards of a part that are carried over; others belong into the assembly.
OF_PARTS = set("node element nset elset surface solidsection orientation rigidbody pretensionsection part endpart".split())


def number(text):
    """A number of a deck; 0 for an empty field."""
    return float(re.sub("[dD]", "e", text)) if text.strip() else 0.0


# Most fields of a data line that are numbers of these cards; more, of which none has a point, are numbers with decimal commas.
MOST_FIELDS = {"node": 4, "elastic": 3, "density": 2, "cload": 3}


def refuse_decimal_commas(card):
    """200,5 is two fields, 200 and 5."""
    most = MOST_FIELDS.get(card.keyword, 0)
    if not most or card.keyword == "elastic" and card.get("type", "iso").lower()[:3] != "iso" or card.keyword == "node" and card.get("system"):
        return
    for fields in card.data:
        if len(fields) > most and not any(re.search(r"[.eEdD]", field) for field in fields[-most:]):
            raise ValueError("%s: *%s: '%s' has %d numbers, %d at most are read: decimals of a deck have a point, not a comma" % (
                card.place, card.keyword.upper(), ", ".join(fields), len(fields), most))


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
