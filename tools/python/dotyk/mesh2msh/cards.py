"""Keyword cards of Abaqus and CalculiX decks, with the files that they include.

Sources: CalculiX CrunchiX USER'S MANUAL, chapter "Input deck format"; Abaqus Keywords Reference Guide.
"""
import bisect
import functools
import os
import re
import warnings

import numpy as np

from .mesh import Fault

# Nested files beyond which one includes itself.
MOST_NESTED = 20
INTEGER = re.compile(r"[+-]?\d{1,18}")
REAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")
# Mark of gmsh in its comments: its truss elements are edges of plane meshes.
OF_GMSH = "E L E M E N T S"


def integer(text):
    """An integer; None for other texts."""
    return int(text) if INTEGER.fullmatch(text) else None


def parsed(text, kind, separator=","):
    """Numbers that commas or blanks separate; None where the text is anything else."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, dtype=kind, sep=separator)
        except (DeprecationWarning, ValueError):
            return None


class Card:
    """A keyword card with its parameters and data lines.

    keyword in small letters without blanks; parameters by names in the same way, values without quotes; lines: data lines without blanks
    around them and commas behind, without comments; part: name of the part to which it belongs, in small letters, None outside.
    """

    def __init__(self, text, path, number):
        head, *rest = re.split(r",(?=(?:[^\"]*\"[^\"]*\")*[^\"]*$)", text[1:])
        self.keyword, self.place, self.part = re.sub(r"[\s-]", "", head).lower(), "%s:%d" % (path, number), None
        self.lines, self.numbers, self.files = [], [], []
        self.parameters = {}
        for field in rest:
            key, _, value = field.partition("=")
            if key.strip():
                self.parameters[re.sub(r"\s", "", key).lower()] = value.strip().strip('"')

    def get(self, key, default=""):
        return self.parameters.get(key, default)

    def add(self, path, lines, numbers):
        """Add data lines with their numbers."""
        self.files.append((len(self.lines), path))
        self.lines += [line.rstrip(", \t") for line in lines]
        self.numbers += numbers

    def at(self, line):
        """file:line of a data line."""
        return "%s:%d" % (self.files[bisect.bisect(self.files, (line, chr(0x10ffff))) - 1][1], self.numbers[line])

    @functools.cached_property
    def data(self):
        """Fields of the data lines."""
        return [[field.strip() for field in line.split(",")] for line in self.lines]

    def fail(self, message, line=None):
        raise Fault("%s: %s" % (self.place if line is None else self.at(line), message))

    def integer(self, text, line):
        value = integer(text)
        if value is None:
            self.fail("expected an integer, found '%s'" % text, line)
        return value

    def real(self, text, line):
        """A number; 0 for an empty field."""
        value = float(re.sub("[dD]", "e", text)) if REAL.fullmatch(text) else np.inf if text else 0.0
        if not np.isfinite(value):
            self.fail("expected a finite number, found '%s'" % text, line)
        return value

    def table(self):
        """Numbers of the data lines (lines, fields); None where lines differ in the number of fields or have other things than numbers."""
        n = self.lines[0].count(",") if self.lines else 0
        if any(line.count(",") != n for line in self.lines):
            return None
        values = parsed(",".join(self.lines), float)
        return values.reshape(-1, n + 1) if values is not None and values.size == (n + 1)*len(self.lines) else None

    def integers(self):
        """Integers of the data lines, one after another, and how many each line has; None where there are other things than integers."""
        values = parsed(",".join(self.lines), np.int64)
        counts = np.array([line.count(",") + 1 for line in self.lines], dtype=np.int64)
        return (values, counts) if values is not None and values.size == counts.sum() else None


class Cards:
    """The cards of a deck, those of included files among them; `files` are all that were read."""

    def __init__(self, path):
        self.folder, self.files, self.list, self.by_gmsh = os.path.dirname(path), [], [], False
        self.read(path, 1)

    def read(self, path, depth):
        """Read a file: what precedes its first card are data of the card before."""
        self.files.append(path)
        with open(path, encoding="utf-8", errors="surrogateescape") as file:
            lines = [line.strip() for line in file.read().split("\n")]
        if depth == 1 and not any(lines):
            raise Fault("%s: the file is empty" % path)
        begin = after = 0
        for i in [i for i, line in enumerate(lines) if not line or line[0] == "*"] + [len(lines)]:
            if i < after:
                continue
            if i > begin:
                if not self.list:
                    raise Fault("%s:%d: this is no Abaqus or CalculiX deck: it does not begin with a keyword, as *NODE" % (path, begin + 1))
                self.list[-1].add(path, lines[begin:i], range(begin + 1, i + 1))
            begin = i + 1
            if i == len(lines) or not lines[i]:
                continue
            if lines[i].startswith("**"):
                self.by_gmsh = self.by_gmsh or OF_GMSH in lines[i]
                continue
            text = lines[i]
            while text.endswith(",") and begin < len(lines):
                text += lines[begin]
                begin += 1
            after = begin
            self.begin(Card(text, path, i + 1), depth)

    def begin(self, card, depth):
        """Begin a card, and read the file that it names."""
        if card.keyword != "include":
            self.list.append(card)
        elif not card.get("input"):
            card.fail("*INCLUDE needs INPUT=")
        if card.keyword not in ("include", "node", "element") or not card.get("input"):
            return
        if depth >= MOST_NESTED:
            card.fail("too many nested files: one includes itself")
        path = os.path.join(self.folder, card.get("input"))
        try:
            self.read(path, depth + 1)
        except OSError as error:
            card.fail("%s: %s" % (path, error.strerror))
