"""Meshes of gmsh's format 2.2, text and binary (gmsh reference manual, "MSH file format version 2").

Physical groups belong to elements there, whatever their entities are: gmsh's own conversion gives all elements of an entity the groups of
each of them.
"""
import re

import numpy as np

from .cards import parsed
from .elements import KINDS
from .mesh import Block, Fault, Index

KIND_OF = {KINDS[name][0]: name for name in KINDS}
# Numbers of nodes of other types, which are skipped where they are in no physical group.
OTHERS = {20: 9, 21: 10, 22: 12, 23: 15, 26: 4, 27: 5, 29: 20, 30: 35, 36: 16, 37: 25, 90: 40, 92: 64, 93: 125, 118: 30}


class File:
    """A file: its sections, nodes, elements (type, numbers, tags, nodes by numbers) and fields."""

    def __init__(self, path):
        self.path, self.names, self.fields, self.elements, self.node_tags = path, {}, [], [], None
        with open(path, "rb") as file:
            self.bytes = file.read()
        self.place, self.binary = 0, False
        while True:
            section = re.compile(rb"\s*(\S+)[^\S\n]*\n?").match(self.bytes, self.place)
            if not section:
                break
            name = section[1].decode("latin1")
            if not name.startswith("$"):
                self.fail("expected a section, as $Nodes, found other text")
            self.begin, self.place = section.start(1), section.end()
            if name == "$ParametricNodes":
                self.fail("parametric nodes of format 2.2 are not read: save without Mesh.SaveParametric")
            getattr(self, "read_" + name[1:], lambda: None)()
            end = self.bytes.find(b"$End" + name[1:].encode(), self.place)
            if end < 0:
                self.fail("the file ends without $End%s: it is truncated" % name[1:])
            if name[1:] in ("Nodes", "Elements", "NodeData") and self.bytes[self.place:end].strip():
                self.place += len(self.bytes[self.place:end]) - len(self.bytes[self.place:end].lstrip())
                self.fail("expected $End%s, found other text: a count is wrong or the file is corrupt" % name[1:])
            self.place = end + len(name) + 3
        for what, found in (("$Nodes", self.node_tags is not None), ("$Elements", hasattr(self, "n_elements"))):
            if not found:
                self.fail("the file ends without %s: it has no mesh or is truncated" % what)

    def fail(self, message, place=None):
        place = self.place if place is None else place
        raise Fault("%s:%d: %s" % (self.path, self.bytes.count(b"\n", 0, place) + 1, message))

    def line(self):
        """The next line that is not empty."""
        found = re.compile(rb"\s*([^\n]*)\n?").match(self.bytes, self.place)
        self.place = found.end()
        return found[1].decode("utf-8", "surrogateescape").strip()

    def count(self, what="items"):
        place, text = self.place, self.line()
        if not text.isdigit() or int(text) > len(self.bytes):
            self.fail("expected a count of %s, found '%s'" % (what, text), place)
        return int(text)

    def lines(self, n, what):
        """The next n lines, and their numbers in one row."""
        end = self.bytes.find(b"$", self.place)
        rows = self.bytes[self.place:end if end >= 0 else len(self.bytes)].decode("latin1").split("\n")
        rows = [row for row in map(str.strip, rows) if row]
        if len(rows) < n:
            self.fail("%d %s are announced, the file has %d: it is truncated or the count is wrong" % (n, what, len(rows)))
        # What is left is found as other text.
        self.place = end if len(rows) == n else self.bytes.find(rows[n].encode("latin1"), self.place)
        return rows[:n]

    def numbers(self, rows, kind):
        """Numbers of rows, one after another; a row with other things is a mistake."""
        values = parsed(" ".join(rows), kind, " ") if rows else np.zeros(0, dtype=kind)
        if values is not None and np.isfinite(values).all():
            return values
        for row in rows:
            own = parsed(row, kind, " ")
            if own is None or not np.isfinite(own).all():
                self.fail("expected %s, found '%s'" % ("finite numbers" if kind is float else "integers", row),
                          self.bytes.find(row.encode("latin1"), self.begin))
        return self.fail("expected numbers")

    def table(self, n, kind, what):
        """n rows of a number and values: text, or bytes of the structured kind."""
        if not self.binary:
            rows = self.lines(n, what)
            values = self.numbers(rows, float)
            width = len(values)//max(n, 1)
            if values.size != n*width or any(len(row.split()) != width for row in rows):
                self.fail("rows of %s differ in their lengths" % what, self.begin)
            return values.reshape(n, -1)[:, 0].astype(np.int64), values.reshape(n, -1)[:, 1:]
        own = np.dtype(kind)
        if self.place + n*own.itemsize > len(self.bytes):
            self.fail("%d %s are announced, the file has no room for them: it is truncated or the count is wrong" % (n, what))
        rows = np.frombuffer(self.bytes, dtype=own, count=n, offset=self.place)
        self.place += n*own.itemsize
        if not np.isfinite(rows["value"]).all():
            self.fail("expected finite numbers", self.begin)
        return rows["tag"].astype(np.int64), rows["value"].reshape(n, -1)

    def read_MeshFormat(self):
        words = self.line().split()
        if len(words) != 3 or words[1] not in "01" or words[2] != "8":
            self.fail("only files with numbers of 8 bytes are read: convert it with: gmsh -save -format msh41 -o new.msh old.msh", self.begin)
        self.binary = words[1] == "1"
        if self.binary and self.bytes[self.place:self.place + 4] != np.int32(1).tobytes():
            self.fail("the file has the byte order of another kind of machine, or is corrupt: save it as text (gmsh without -bin)")

    def read_PhysicalNames(self):
        for _ in range(self.count("physical names")):
            row = self.line()
            found = re.match(r'(\d+)\s+(\d+)\s+"(.*)"', row)
            if not found:
                self.fail("expected dimension, tag and \"name\" of a physical group", self.begin)
            self.names[int(found[1]), int(found[2])] = found[3]

    def read_Nodes(self):
        n = self.count("nodes")
        self.node_tags, self.x = self.table(n, [("tag", "<i4"), ("value", "<f8", (3,))], "nodes")
        if not n or self.x.shape[1] != 3:
            self.fail("the mesh has no nodes" if not n else "nodes need three coordinates", self.begin)
        if (self.node_tags <= 0).any():
            self.fail("node tag %d is not positive" % self.node_tags[self.node_tags <= 0][0], self.begin)

    def read_NodeData(self):
        """String, real and integer tags, which are text in binary files too; then a node and its values each."""
        texts = [self.line() for _ in range(self.count("string tags"))]
        for _ in range(self.count("real tags")):
            self.line()
        own = [int(text) if text.lstrip("-").isdigit() else -1 for text in (self.line() for _ in range(self.count("integer tags")))]
        if len(own) < 3 or own[1] < 1 or own[2] < 0:
            self.fail("the integers time step, components and number of values are missing", self.begin)
        tags, values = self.table(own[2], [("tag", "<i4"), ("value", "<f8", (own[1],))], "values")
        self.fields.append((texts[0].strip('"') if texts else "", tags, values, own[0]))

    def read_Elements(self):
        """Number, type, tags (the first is the physical group, the second the entity) and nodes of each element; in binary files under headers
        of type, number of elements and number of tags."""
        self.n_elements = n = self.count("elements")
        if not n:
            self.fail("the mesh has no elements", self.begin)
        if not self.binary:
            rows = self.lines(n, "elements")
            counts = np.array([len(row.split()) for row in rows])
            values = self.numbers(rows, np.int64)
            first = np.concatenate([[0], np.cumsum(counts)])
            if (counts < 3).any():
                self.fail("an element needs number, type and tags", self.begin)
            head = values[first[:-1, None] + np.arange(3)]
            for kind, n_tags in np.unique(head[:, 1:], axis=0):
                own = np.flatnonzero((head[:, 1] == kind) & (head[:, 2] == n_tags))
                n_nodes = self.n_nodes(kind, head[own[0], 0], n_tags)
                wrong = own[counts[own] != 3 + n_tags + n_nodes]
                if len(wrong):
                    self.fail("element %d of type %d with %d tags has %d numbers, %d are needed" % (
                        head[wrong[0], 0], kind, n_tags, counts[wrong[0]], 3 + n_tags + n_nodes), self.begin)
                table = values[first[own, None] + np.arange(3 + n_tags + n_nodes)]
                self.elements.append((int(kind), own, table[:, 0], table[:, 3:3 + n_tags], table[:, 3 + n_tags:]))
            return
        done = 0
        while done < n:
            if self.place + 12 > len(self.bytes):
                self.fail("the file ends inside $Elements: it is truncated")
            kind, own, n_tags = np.frombuffer(self.bytes, dtype="<i4", count=3, offset=self.place).tolist()
            if own < 1 or own > n - done:
                self.fail("a header announces %d elements, where %d of %d are left" % (own, n - done, n))
            width = 1 + n_tags + self.n_nodes(kind, done + 1, n_tags)
            if self.place + 12 + 4*own*width > len(self.bytes):
                self.fail("the file ends inside $Elements: it is truncated")
            if own == 1:
                # gmsh writes a header for each element.
                table = self.equal_heads([kind, own, n_tags], n - done, 3 + width)[:, 3:]
                own = len(table)
                self.place += 4*own*(3 + width)
            else:
                table = np.frombuffer(self.bytes, dtype="<i4", count=own*width, offset=self.place + 12).reshape(own, width)
                self.place += 12 + 4*own*width
            table = table.astype(np.int64)
            self.elements.append((kind, done + np.arange(own), table[:, 0], table[:, 1:1 + n_tags], table[:, 1 + n_tags:]))
            done += own

    def equal_heads(self, head, most, width):
        """The rows from here on that begin as the first one: at most so many, each of `width` integers."""
        most = min(most, (len(self.bytes) - self.place)//(4*width))
        n = 1
        while n < most:
            n = min(2*n, most)
            rows = np.frombuffer(self.bytes, dtype="<i4", count=n*width, offset=self.place).reshape(n, width)
            other = np.flatnonzero((rows[n//2:, :3] != head).any(axis=1))
            if len(other):
                return rows[:n//2 + other[0]]
        return np.frombuffer(self.bytes, dtype="<i4", count=n*width, offset=self.place).reshape(n, width)

    def n_nodes(self, kind, element, n_tags):
        if int(kind) not in KIND_OF and int(kind) not in OTHERS:
            self.fail("element %d has type %d, which is not known" % (element, kind), self.begin)
        if n_tags < 0 or n_tags > 1000:
            self.fail("element %d has %d tags, which cannot be right" % (element, n_tags), self.begin)
        return KINDS[KIND_OF[int(kind)]][2] if int(kind) in KIND_OF else OTHERS[int(kind)]


def read(path, dimension):
    """The mesh of a file, a remark, and the files read."""
    file = File(path)
    index = Index(file.node_tags)
    twice = index.repeated()
    if twice is not None:
        file.fail("node tag %d occurs a second time" % file.node_tags[twice])
    blocks = {}
    for kind, order, tags, groups, nodes in file.elements:
        physical, entity = (np.abs(groups[:, k]) if groups.shape[1] > k else np.zeros(len(tags), dtype=np.int64) for k in (0, 1))
        if not physical.any():
            continue
        if kind not in KIND_OF:
            file.fail("element %d is of type %d, which is not supported: only elements of order 1 and 2 are" % (tags[physical > 0][0], kind))
        name = KIND_OF[kind]
        rows = index.find(nodes)
        missing = np.argwhere((rows < 0) & (physical > 0)[:, None])
        if len(missing):
            e, k = missing[0]
            file.fail("element %d refers to node %d, which $Nodes does not have" % (tags[e], nodes[e, k]))
        rows = rows[:, KINDS[name][3]] if KINDS[name][3] else rows
        by_group = np.lexsort((entity, physical))
        by_group = by_group[physical[by_group] > 0]
        ends = np.flatnonzero((np.diff(physical[by_group]) != 0) | (np.diff(entity[by_group]) != 0)) + 1
        for chosen in np.split(by_group, ends):
            blocks.setdefault((name, int(physical[chosen[0]]), int(entity[chosen[0]])), []).append((order[chosen], tags[chosen], rows[chosen]))
    if not blocks:
        raise Fault("%s: no element belongs to a physical group: add Physical Volume(\"name\") and Physical Surface(\"name\") (in two dimensions "
                    "Physical Surface and Physical Curve) to the geometry and mesh it again" % path)
    file.dimension, file.blocks = dimension, []
    for (name, group, entity), pieces in sorted(blocks.items(), key=lambda item: item[1][0][0][0]):
        _, tags, rows = (np.concatenate(part) for part in zip(*pieces))
        file.blocks.append(Block(name, tags, rows, [file.names.get((KINDS[name][1], group), str(group))], entity))
    return file, "", [path]
