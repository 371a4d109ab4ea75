"""Reads namelist files as dotyk does: groups such as &scene title='a', size=1,2*3 / with comments behind !.

groups(text, file) gives a list of Group: name, line and the keys, each with its line and its values (str, int, float or bool).
Group.get and Group.check are for programs that have groups of their own: unknown keys and values of the wrong kind are refused
with file, line and the nearest known name. changed(text, ...) changes keys and leaves all else as it is.
"""
import difflib
import re

TOKEN = re.compile(r"""(?P<blank>[ \t\r\n,]+)|(?P<comment>![^\n]*)|(?P<text>'(?:[^']|'')*'|"(?:[^"]|"")*")"""
                   r"""|(?P<group>&[A-Za-z_]\w*)|(?P<end>/)|(?P<key>[A-Za-z_]\w*)[ \t]*=|(?P<word>[^\s,/'"!=&]+)""")
LOGICAL = {'.true.': True, '.t.': True, 't': True, 'true': True, '.false.': False, '.f.': False, 'f': False, 'false': False}


class NamelistError(Exception):
    """A mistake in a namelist file; the text begins with file and line."""


class Group:
    """One group: name, line, keys {name: (line, values)}, and where in the text its first key and each key are."""

    def __init__(self, file, name, line, start):
        self.file, self.name, self.line, self.keys = file, name, line, {}
        self.start, self.spans = start, {}

    def fail(self, text, key=None):
        """Refuse this group, or a key of it."""
        line = self.keys[key][0] if key in self.keys else self.line
        raise NamelistError('%s:%d: &%s: %s' % (self.file, line, self.name, text))

    def check(self, known):
        """Refuse keys that are not among the known ones."""
        for key in self.keys:
            if key not in known:
                near = difflib.get_close_matches(key, known, 1)
                self.fail("unknown key '%s'%s" % (key, " (did you mean '%s'?)" % near[0] if near else ''), key)

    def get(self, key, kind, default=None):
        """The values of a key as a list, each of this kind (str, int, float, bool); the default where it is absent."""
        if key not in self.keys:
            return default
        values = []
        for value in self.keys[key][1]:
            if kind is float and isinstance(value, int) and not isinstance(value, bool):
                value = float(value)
            if kind is float and isinstance(value, float) or type(value) is kind:
                values.append(value)
            else:
                self.fail('%s: %r is not %s' % (key, value, {str: 'a text in quotes', int: 'an integer', float: 'a number',
                                                             bool: 'a logical'}[kind]), key)
        if not values:
            self.fail('%s: no value' % key, key)
        return values

    def get_one(self, key, kind, default=None):
        """The only value of a key."""
        values = self.get(key, kind)
        if values is None:
            return default
        if len(values) > 1:
            self.fail('%s: %d values in place of one' % (key, len(values)), key)
        return values[0]


def value_of(word):
    """A word without quotes as a number or a logical; None if it is neither."""
    if word.lower() in LOGICAL:
        return LOGICAL[word.lower()]
    if re.fullmatch(r'[+-]?\d+', word):
        return int(word)
    if re.fullmatch(r'[+-]?(\d+\.?\d*|\.\d+)([edED][+-]?\d+)?', word):
        return float(re.sub('[dD]', 'e', word))
    return None


def groups(text, file='input'):
    """All groups of a namelist text."""
    found, group, key, place = [], None, None, 0
    while place < len(text):
        line = text.count('\n', 0, place) + 1
        match = TOKEN.match(text, place)
        if match is None:
            what = 'a quote without end' if text[place] in '\'"' else 'unexpected %r' % text[place]
            raise NamelistError('%s:%d: %s' % (file, line, what))
        place, kind, token = match.end(), match.lastgroup, match[0]
        if kind in ('blank', 'comment'):
            continue
        if kind == 'group':
            if group is not None:
                group.fail("no / before %s" % token)
            group, key = Group(file, token[1:].lower(), line, place), None
        elif group is None:
            raise NamelistError('%s:%d: %r outside of a group' % (file, line, token))
        elif kind == 'end':
            found.append(group)
            group = None
        elif kind == 'key':
            key = match['key'].lower()
            if key in group.keys:
                group.fail("key '%s' twice" % key, key)
            group.keys[key] = line, []
            group.spans[key] = match.start(), place
        elif key is None:
            group.fail('%r without a key' % token)
        elif kind == 'text':
            group.keys[key][1].append(token[1:-1].replace(2*token[0], token[0]))
            group.spans[key] = group.spans[key][0], place
        else:
            times, star, word = token.rpartition('*')
            value = value_of(word)
            if value is None or star and not times.isdigit():
                raise NamelistError('%s:%d: &%s: %s: %r is neither a number nor a text in quotes'
                                    % (file, line, group.name, key, token))
            group.keys[key][1].extend([value]*(int(times) if star else 1))
            group.spans[key] = group.spans[key][0], place
    if group is not None:
        group.fail('no / at its end')
    return found


def written(value):
    """A value as it stands in a namelist file."""
    if isinstance(value, str):
        return "'%s'" % value.replace("'", "''")
    return ('.true.' if value else '.false.') if isinstance(value, bool) else repr(value)


def changed(text, name, keys, without=()):
    """The text with these keys {name: value} in every group of this name, and without some others; the rest stays as it is."""
    for group in reversed(groups(text)):
        if group.name != name:
            continue
        for key in sorted(group.spans, key=lambda key: -group.spans[key][0]):
            if key in keys or key in without:
                start, end = group.spans[key]
                rest = text[end:]
                comma = re.match(r'[ \t]*,', rest)
                text = text[:start] + (rest[comma.end():] if comma else rest)
        words = ''.join(' %s=%s,' % (key, written(value)) for key, value in keys.items())
        text = text[:group.start] + words + text[group.start:]
    return text
