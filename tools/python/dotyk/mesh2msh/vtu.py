"""Unstructured grids of VTK's XML format (.vtu): text, base64 or raw bytes, inline or appended, compressed or not.

Arrays of integers of the cells become volumes and surfaces, one for each of their values: `NAME VALUE`, or `VALUE` where there is one such
array, and for `gmsh:physical`. Arrays of integers of the points become surfaces: the outer faces all of whose points have a value other
than 0. Arrays of reals of the points are fields.
"""
import base64
import binascii
import lzma
import re
import xml.parsers.expat
import zlib

import numpy as np

from .cards import parsed
from .elements import KINDS, TURNED
from .mesh import Fault, Mesh

CELLS = {3: "line", 21: "line3", 5: "triangle", 22: "triangle6", 8: "pixel", 9: "quad", 23: "quad8", 28: "quad9", 10: "tetra", 24: "tetra10",
         11: "voxel", 12: "hexahedron", 25: "hexahedron20", 29: "hexahedron27", 13: "wedge", 26: "wedge15", 32: "wedge18", 14: "pyramid",
         27: "pyramid13"}
# Squares and cubes with their points in the order of coordinates.
BY_COORDINATES = {"pixel": ("quad", [0, 1, 3, 2]), "voxel": ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6])}
# Cells that are no elements: empty ones and points.
NO_ELEMENTS = (0, 1, 2)
TYPES = {"Int8": "i1", "UInt8": "u1", "Int16": "<i2", "UInt16": "<u2", "Int32": "<i4", "UInt32": "<u4", "Int64": "<i8", "UInt64": "<u8",
         "Float32": "<f4", "Float64": "<f8"}
COMPRESSORS = {"": None, "vtkZLibDataCompressor": zlib.decompress, "vtkLZMADataCompressor": lzma.decompress}
# Values of an array beyond which it numbers cells or points; names in a remark.
MOST_VALUES, MOST_LISTED = 1000, 8


class Array:
    """A data array: its attributes, the tag around it, its line, and its text."""

    def __init__(self, attributes, parent, line):
        self.name, self.type, self.format = (attributes.get(key, "") for key in ("Name", "type", "format"))
        self.offset, self.parent, self.line, self.text = attributes.get("offset", ""), parent, line, []
        components = attributes.get("NumberOfComponents", "1")
        self.n_components = int(components) if components.isdigit() else 1


class File:
    """The points, cells and arrays of the one piece."""

    def __init__(self, path):
        self.path, self.arrays, self.open, self.line, self.has_piece, self.in_piece = path, [], [], 1, False, False
        with open(path, "rb") as file:
            self.bytes = file.read()
        tag = re.search(rb"<AppendedData[^>]*>\s*", self.bytes)
        self.appended = tag.end() if tag else None
        parser = self.parser = xml.parsers.expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = self.begin, self.end, self.take
        try:
            parser.Parse(self.bytes[:self.appended], tag is None)
        except xml.parsers.expat.ExpatError as error:
            what = ""
            if not self.open and not self.has_piece:
                legacy = self.bytes.startswith(b"# vtk DataFile")
                what = "this is no XML file of VTK: " + "it is a legacy file of VTK: save it as .vtu; "*legacy
            self.fail("%s%s" % (what, xml.parsers.expat.errors.messages[error.code]), error.lineno)
        if self.appended is not None and self.bytes[self.appended:self.appended + 1] != b"_":
            self.fail("the appended data must begin with _", parser.CurrentLineNumber)
        if not self.has_piece:
            self.fail("the file has no cells", 1)

    def fail(self, message, line):
        raise Fault("%s:%d: %s" % (self.path, line, message))

    # Tags

    def begin(self, name, attributes):
        line = self.parser.CurrentLineNumber
        if not self.open:
            if name != "VTKFile":
                self.fail("this is no XML file of VTK: it begins with <%s>" % name, line)
            self.compressor, kind = attributes.get("compressor", ""), attributes.get("type", "")
            self.header = "<u8" if attributes.get("header_type") == "UInt64" else "<u4"
            if kind != "UnstructuredGrid":
                self.fail("the file has type '%s': only UnstructuredGrid is read" % kind, line)
            if attributes.get("byte_order") == "BigEndian":
                self.fail("byte_order BigEndian is not read: save the file with little endian bytes", line)
            if self.compressor not in COMPRESSORS:
                self.fail("the compressor '%s' is not read: save the file with zlib or without" % self.compressor, line)
        elif name == "Piece":
            counts = [self.count(attributes, key, line) for key in ("NumberOfPoints", "NumberOfCells")]
            self.in_piece = counts[1] > 0
            if self.in_piece and self.has_piece:
                self.fail("a second piece: save the mesh as one piece (ParaView: Merge Blocks, Clean to Grid)", line)
            if self.in_piece:
                self.has_piece, (self.n_points, self.n_cells) = True, counts
        elif name == "DataArray" and self.in_piece:
            array = Array(attributes, self.open[-1], line)
            if array.format not in ("ascii", "binary", "appended"):
                self.fail("array '%s': format must be ascii, binary or appended" % array.name, line)
            if array.format == "appended" and not array.offset.isdigit():
                self.fail("array '%s': the offset of its data is missing" % array.name, line)
            self.arrays.append(array)
        elif name == "AppendedData":
            self.encoded = attributes.get("encoding") == "base64"
        self.open.append(name)

    def end(self, name):
        self.open.pop()
        self.in_piece = self.in_piece and name != "Piece"

    def take(self, text):
        if self.in_piece and self.open[-1] == "DataArray":
            self.arrays[-1].text.append(text)

    def count(self, attributes, key, line):
        """A count, for which the file must have room: zlib makes bytes at most 1032 times as many."""
        text = attributes.get(key, "").strip()
        if not text.isdigit() or int(text) > 1032*len(self.bytes):
            self.fail("the piece needs %s, a count that the file has room for" % key, line)
        return int(text)

    # Values

    def find(self, parent, name=None):
        """An array that the file must have."""
        for array in self.arrays:
            if array.parent == parent and name in (None, array.name):
                return array
        return self.fail("<%s> has no DataArray %s: the file is incomplete" % (parent, name or ""), 1)

    def integers(self, array, n):
        if "Int" not in array.type:
            self.fail("array '%s' must be of integers, not %s" % (array.name, array.type), array.line)
        return self.values(array, n).astype(np.int64)

    def reals(self, array, n):
        if "Float" not in array.type:
            self.fail("array '%s' must be Float32 or Float64, not %s" % (array.name, array.type), array.line)
        values = self.values(array, n).astype(float)
        if not np.isfinite(values).all():
            self.fail("array '%s': expected a finite number, found '%s'" % (array.name, values[~np.isfinite(values)][0]), array.line)
        return values

    def values(self, array, n):
        """The n values of an array."""
        if array.type not in TYPES:
            self.fail("array '%s' has the type '%s', which is not known" % (array.name, array.type), array.line)
        kind = np.dtype(TYPES[array.type])
        if array.format == "ascii":
            text = " ".join(" ".join(array.text).split())
            values = parsed(text, float if kind.kind == "f" else np.int64, " ") if text else np.zeros(0)
            if values is None:
                wrong = next((w for w in text.split() if parsed(w, float if kind.kind == "f" else np.int64, " ") is None), "")
                self.fail("array '%s': expected a number, found '%s'" % (array.name, wrong), array.line)
        else:
            try:
                if array.format == "appended":
                    if self.appended is None:
                        raise ValueError("there is no <AppendedData>: the file is truncated")
                    data = self.block(memoryview(self.bytes)[self.appended + 1 + int(array.offset):], self.encoded)
                else:
                    data = self.block("".join("".join(array.text).split()).encode(), True)
                values = np.frombuffer(data, dtype=kind)
            except (ValueError, zlib.error, lzma.LZMAError, binascii.Error) as error:
                self.fail("array '%s': %s" % (array.name, error), array.line)
        if len(values) != n:
            self.fail("array '%s' has %s" % (array.name, "fewer than %d values" % n if len(values) < n else
                                             "more values than its points or cells need"), array.line)
        return values

    def block(self, data, encoded):
        """Bytes of an array behind their header: their number; or of compressed blocks the number, the size of each and of the last one (0:
        as the others), and the compressed sizes."""
        def take(begin, n):
            """Bytes from a place on, and the place behind them."""
            end = begin + (4*((n + 2)//3) if encoded else n)
            if end > len(data):
                raise ValueError("its data end before %d bytes: the file is truncated" % n)
            return (base64.b64decode(bytes(data[begin:end]), validate=True) if encoded else bytes(data[begin:end])), end

        size = np.dtype(self.header).itemsize
        if not self.compressor:
            head, end = take(0, size)
            n = int(np.frombuffer(head[:size], dtype=self.header)[0])
            # The header may be encoded apart from the data.
            if not encoded or len(head) == size and bytes(data[end - 1:end]) == b"=" and n > 0:
                return take(end, n)[0][:n]
            return take(0, size + n)[0][size:size + n]
        n, whole, last = (int(i) for i in np.frombuffer(take(0, 3*size)[0], dtype=self.header))
        head, place = take(0, (3 + n)*size)
        sizes = np.frombuffer(head[:(3 + n)*size], dtype=self.header)[3:].tolist()
        packed, _ = take(place, sum(sizes))
        result, begin = [], 0
        for i, length in enumerate(sizes):
            result.append(COMPRESSORS[self.compressor](packed[begin:begin + length]))
            begin += length
            if len(result[-1]) != (last if i == n - 1 and last else whole):
                raise ValueError("a compressed block has %d bytes, its header says other" % len(result[-1]))
        return b"".join(result)


def read(path, dimension):
    """The mesh of a file, a remark, and the files read."""
    file = File(path)
    points = file.find("Points")
    if points.n_components != 3:
        file.fail("points need NumberOfComponents=\"3\"", points.line)
    x = file.reals(points, 3*file.n_points).reshape(-1, 3)
    parts, element_of, line = cells(file, x)
    mesh = Mesh(np.arange(1, len(x) + 1), x, parts, dimension)
    mesh.check_dimension(lambda e: "%s:%d: " % (path, line))
    add_sets(file, mesh, element_of)
    not_read = []
    for array in file.arrays:
        if array.parent == "PointData" and array.n_components == 1 and "Float" in array.type:
            mesh.fields.append((array.name, mesh.node_tags, file.reals(array, file.n_points)[:, None], 0))
        elif array.parent in ("PointData", "CellData") and not array.is_read:
            not_read.append(array.name)
    remark = ["not read: " + ", ".join(not_read[:MOST_LISTED]) + ", ..."*(len(not_read) > MOST_LISTED)] if not_read else []
    return mesh, "; ".join(remark + [mesh.remark]*bool(mesh.remark)), [path]


def cells(file, x):
    """Elements: (kind, numbers of the cells from 1, nodes); the element of each cell, -1 where it is none; and a line."""
    array = file.find("Cells", "types")
    types = file.integers(array, file.n_cells)
    offsets = file.find("Cells", "offsets")
    ends = file.integers(offsets, file.n_cells)
    starts = np.concatenate([[0], ends[:-1]])
    if (ends < starts).any():
        file.fail("array 'offsets': they must ascend", offsets.line)
    connectivity = file.find("Cells", "connectivity")
    nodes = file.integers(connectivity, int(ends[-1]))
    counts, parts, element_of = ends - starts, [], np.full(len(types), -1)
    for kind in np.unique(types):
        own = np.flatnonzero(types == kind)
        if kind in NO_ELEMENTS:
            continue
        if kind not in CELLS:
            file.fail("cell %d has type %d: only lines, triangles, quadrilaterals, tetrahedra, hexahedra, wedges and pyramids are read, "
                      "linear and quadratic" % (own[0], kind), array.line)
        name, order = BY_COORDINATES.get(CELLS[kind], (CELLS[kind], None))
        n = KINDS[name][2]
        wrong = own[counts[own] != n]
        if len(wrong):
            file.fail("cell %d of type %d (%s) has %d points" % (wrong[0], kind, CELLS[kind], counts[wrong[0]]), offsets.line)
        rows = nodes[starts[own][:, None] + np.arange(n)]
        outside = ((rows < 0) | (rows >= len(x))).any(axis=1)
        if outside.any():
            file.fail("cell %d has a point that is not among 0 to %d" % (own[outside][0], len(x) - 1), connectivity.line)
        if order:
            rows = rows[:, order]
        if name.startswith("wedge"):
            # VTK's own order: the normal of the first triangle points out of the wedge. Many programs write it the other way.
            a, b, c, d = (x[rows[:, i]] for i in range(4))
            ours = ((np.cross(b - a, c - a)*(d - a)).sum(axis=1) > 0)[:, None]
            rows = np.where(ours, rows, rows[:, TURNED[:n]])
        element_of[own] = sum(len(part[1]) for part in parts) + np.arange(len(own))
        parts.append((name, own + 1, rows))
    if not parts:
        file.fail("the file has no elements", array.line)
    return parts, element_of, array.line


def add_sets(file, mesh, element_of):
    """Add the sets of cells and points."""
    of_cells, node_sets = [], []
    for array in file.arrays:
        array.is_read = False
        if array.n_components != 1 or "Int" not in array.type or array.parent not in ("CellData", "PointData"):
            continue
        value = file.integers(array, file.n_cells if array.parent == "CellData" else file.n_points)
        if array.name == "vtkGhostType" and array.parent == "CellData":
            if value.any():
                file.fail("the piece has ghost cells: save the mesh as one piece without them", array.line)
            continue
        levels = np.unique(value)
        array.is_read = len(levels) <= MOST_VALUES
        if array.is_read and array.parent == "CellData":
            of_cells.append((array.name, value, levels))
        elif array.is_read:
            node_sets += [("%s %d" % (array.name, level), np.flatnonzero(value == level)) for level in levels if level != 0]
    sets = []
    for name, value, levels in of_cells:
        if name == "gmsh:geometrical":
            mesh.entity[element_of[element_of >= 0]] = np.clip(value[element_of >= 0], 0, 2**31 - 1)
        prefix = "" if len(of_cells) == 1 or name == "gmsh:physical" else name + " "
        for level in levels:
            chosen = element_of[value == level]
            sets.append(("%s%d" % (prefix, level), chosen[chosen >= 0]))
    mesh.add_elements(sets)
    mesh.remark = mesh.add_node_sets(node_sets)
