"""The syntax of namelist files, as dotyk reads them: groups such as &scene title='a', size=1,2*3 / with comments behind !.

parse(text) gives a list of Group, which are mappings of keys to values and can be changed: what is not changed, comments and layout
too, stays as it is. No group and no key is known here.
"""
import collections.abc
import math
import numbers
import os
import re

BLANK = r'(?:[ \t\r\n\ufeff]|![^\n]*(?![^\n]))'  # a comment ends with its line, also where a pattern would like less of it
QUOTED = r"""'(?:[^'\n]|'')*'|"(?:[^"\n]|"")*\""""
TOKEN = re.compile(r"""(?P<blank>%s+)|(?P<group>&\w*)|(?P<end>/)|(?P<comma>,)|(?P<key>[A-Za-z_]\w*)%s*="""
                   r"""|(?:(?P<times>\d+)\*)?(?:(?P<text>%s)|(?P<word>[^\s,/'"!=&*]+))(?=[\s,/!=&]|$)""" % (BLANK, BLANK, QUOTED))
LOGICAL = {'.true.': True, '.t.': True, 't': True, 'true': True, '.false.': False, '.f.': False, 'f': False, 'false': False}
COLUMNS = 100


class NamelistError(ValueError):
    """A mistake in a namelist; the text begins with file and line."""


class Group(collections.abc.MutableMapping):
    """One group: a mapping of keys, in lower case, to values.

    A value is a text, an integer, a number or a logical, or a list of these; numpy arrays are written row by row. A path of pathlib
    is relative to the current directory, as elsewhere in Python, and is written as an absolute one; a text is written as it is.
    group['young'] = 2e11 changes or adds a key, del group['young'] and group['young'] = None remove it.

    name: name of the group in lower case. text: the group as it stands in the file, from & to /. before: the text before it, such as
    comments. file, line: where it was read.
    """

    def __init__(self, name, keys=None, file='namelist', line=1):
        if not re.fullmatch(r'[A-Za-z_]\w*', name):
            raise ValueError('%r is no name of a group' % name)
        self.file, self.line, self.before = file, line, ''
        self._read('&%s /' % name, 0)
        self.update(keys or {})

    __eq__, __hash__ = object.__eq__, object.__hash__

    def _read(self, text, start):
        """Set name, text and entries {key: (first, last, values)} from the group that begins at this place; its end."""
        self.text, self._entries, key, after_comma, place = text[start:], {}, None, True, start
        self.name = ''
        while place < len(text):
            match = TOKEN.match(text, place)
            if match is None:
                self._refuse('a quote without end' if text[place] in '\'"' else 'unexpected %r' % text[place:place + 20].split('\n')[0],
                             place - start)
            first, place, kind = place, match.end(), match.lastgroup
            if kind == 'group':
                if first > start:
                    self._refuse('no / before %s' % match[0], 0)
                self.name = match[0][1:].lower()
                if not self.name:
                    self._refuse('a name is missing after &', 0)
            elif kind == 'end':
                self.text = text[start:place]
                return place
            elif kind == 'key':
                key, after_comma = match['key'].lower(), True
                if key in self._entries:
                    self._refuse("key '%s' twice" % key, first - start)
                self._entries[key] = [first - start, place - start, []]
            elif kind != 'blank' and key is None:
                self._refuse('%r without a key' % match[0], first - start)
            elif kind == 'comma':
                if after_comma:
                    self._refuse('%s: a value is missing' % key, first - start)
                after_comma = True
            elif kind != 'blank':
                if match['text']:
                    value = match['text'][1:-1].replace(2*match['text'][0], match['text'][0])
                else:
                    value = value_of(match['word'])
                if value is None:
                    self._refuse('%s: %r is neither a number nor a text in quotes' % (key, match[0]), first - start)
                entry, after_comma = self._entries[key], False
                entry[1] = place - start
                entry[2].extend([value]*int(match['times'] or 1))
        self._refuse('no / at its end', 0)

    def _refuse(self, text, place):
        raise NamelistError('%s:%d: &%s: %s' % (self.file, self.line + self.text.count('\n', 0, place), self.name, text))

    def fail(self, text, key=None):
        """Raise a NamelistError with file and line of this group, or of one of its keys."""
        self._refuse(text, self._entries[key.lower()][0] if key and key in self else 0)

    def list(self, key):
        """The values of a key as a list, also where there is only one; empty where the key is absent."""
        return list(self._entries[key.lower()][2]) if key in self else []

    def __contains__(self, key):
        return key.lower() in self._entries

    def __getitem__(self, key):
        if key not in self:
            raise KeyError("&%s has no key '%s'" % (self.name, key))
        values = self.list(key)
        return values[0] if len(values) == 1 else values

    def __setitem__(self, key, value):
        if not re.fullmatch(r'[A-Za-z_]\w*', key):
            raise ValueError('%r is no key' % key)
        if value is None:
            self.pop(key, None)
            return
        words = [key.lower() + '=' + written(value)[0]] + written(value)[1:]
        if key in self:
            start, end, _ = self._entries[key.lower()]
            before = self.text[:start]
        else:
            end = max([1 + len(self.name)] + [last for _, last, _ in self._entries.values()])
            before = self.text[:end] + (',' if self._entries else '')
            words[0] = ' ' + words[0]
        for number, word in enumerate(words):
            word += ',' if number + 1 < len(words) else ''
            if len(before) - before.rfind('\n') + len(word) > COLUMNS and before.endswith(','):
                before += '\n' + ' '*(1 + len(self.name)) + (word if word.startswith(' ') else ' ' + word)
            else:
                before += word
        self._read(before + self.text[end:], 0)

    def __delitem__(self, key):
        if key not in self:
            raise KeyError("&%s has no key '%s'" % (self.name, key))
        start, end, _ = self._entries[key.lower()]
        comma = re.match(r'%s*,[ \t]*' % BLANK, self.text[end:])
        before, after = self.text[:start], self.text[end + (comma.end() if comma else 0):]
        if not comma:  # the last one
            before = re.sub(r',\s*$', '', before)
        self._read(before + after, 0)

    def __iter__(self):
        return iter(self._entries)

    def __len__(self):
        return len(self._entries)

    def __repr__(self):
        return self.text


def value_of(word):
    """A word without quotes as a number or a logical; None if it is neither."""
    if word.lower() in LOGICAL:
        return LOGICAL[word.lower()]
    if re.fullmatch(r'[+-]?\d+', word):
        return int(word)
    if re.fullmatch(r'[+-]?(\d+\.?\d*|\.\d+)([edED][+-]?\d+)?', word):
        return float(re.sub('[dD]', 'e', word))
    return None


def written(value):
    """A value as it stands in a namelist: a list of words, one for each number, text or logical."""
    if isinstance(value, os.PathLike):
        value = os.path.abspath(value)
    if isinstance(value, str):
        if '\n' in value:
            raise ValueError('a text of a namelist has one line: %r' % value)
        return ["'%s'" % value.replace("'", "''")]
    if hasattr(value, 'tolist'):  # of numpy
        value = value.tolist()
    if isinstance(value, bool):
        return ['.true.' if value else '.false.']
    if isinstance(value, numbers.Integral):
        return [str(int(value))]
    if isinstance(value, numbers.Real):
        if not math.isfinite(value):
            raise ValueError('%r has no place in a namelist' % value)
        return [repr(float(value))]
    if isinstance(value, collections.abc.Sequence) and not isinstance(value, (bytes, bytearray)) and len(value):
        return [word for part in value for word in written(part)]
    raise TypeError('%r is no value of a namelist' % (value,))


def parse(text, file='namelist'):
    """The groups of a namelist text, and what follows behind the last one."""
    groups, place = [], 0
    while True:
        blank = re.compile(BLANK + '*').match(text, place)
        line = 1 + text.count('\n', 0, blank.end())
        if blank.end() == len(text):
            return groups, blank[0]
        if text[blank.end()] != '&':
            raise NamelistError('%s:%d: %r outside of a group' % (file, line, text[blank.end():].split('\n')[0][:20]))
        group = Group.__new__(Group)
        group.file, group.line, group.before = str(file), line, blank[0]
        place = group._read(text, blank.end())
        groups.append(group)
