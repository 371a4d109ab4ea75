"""Numbers and mistakes of keyword cards."""
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


@contextlib.contextmanager
def located(card):
    """Mistakes are told with the line of a card."""
    try:
        yield
    except (ValueError, KeyError, IndexError) as error:
        said = str(error) if not isinstance(error, KeyError) else "there is no number %s" % error
        raise ValueError(said if said.startswith(card.place) else "%s: *%s: %s" % (card.place, card.keyword.upper(), said)) from None
