"""Unstructured grids of VTK as XML files, in each of its encodings, and the cells of its types."""
import base64
import zlib

import numpy as np

# Type, corners, mid-side nodes by their edges, nodes of faces and of the whole: as the VTK User's Guide draws them. The first triangle of a
# wedge has its normal outward.
CELLS = {
    "tri3": (5, 3, "", "", ""), "tri6": (22, 3, "01 12 20", "", ""), "quad4": (9, 4, "", "", ""), "quad8": (23, 4, "01 12 23 30", "", ""),
    "quad9": (28, 4, "01 12 23 30", "0123", ""), "tet4": (10, 4, "", "", ""), "tet10": (24, 4, "01 12 20 03 13 23", "", ""),
    "hex8": (12, 8, "", "", ""), "hex20": (25, 8, "01 12 23 30 45 56 67 74 04 15 26 37", "", ""),
    "hex27": (29, 8, "01 12 23 30 45 56 67 74 04 15 26 37", "0473 1265 0154 3762 0321 4567", "01234567"),
    "prism6": (13, 6, "", "", ""), "prism15": (26, 6, "01 12 20 34 45 53 03 14 25", "", ""),
    "prism18": (32, 6, "01 12 20 34 45 53 03 14 25", "0143 1254 2035", ""),
    "pyramid5": (14, 5, "", "", ""), "pyramid13": (27, 5, "01 12 23 30 04 14 24 34", "", "")}
TYPES = {"f4": "Float32", "f8": "Float64", "i1": "Int8", "i2": "Int16", "i4": "Int32", "i8": "Int64", "u1": "UInt8", "u2": "UInt16", "u4": "UInt32"}
# Attributes of the file by encoding.
MODES = ("ascii", "base64", "base64 apart", "base64 zlib", "raw", "raw zlib", "appended", "appended zlib")


def grid(kind, elements):
    """Points and cells of a kind on elements, each the places of its corners."""
    points, cells = {}, []
    for element in elements:
        places = [np.array(x, dtype=float) for x in element]
        corners = list(places)
        for group in CELLS[kind][2:]:
            places += [np.mean([corners[int(c)] for c in word], axis=0) for word in group.split()]
        cells.append((CELLS[kind][0], [points.setdefault(tuple(np.round(x, 9)), len(points)) for x in places]))
    return np.array(list(points)), cells


def block(values, mode, size):
    """Header and bytes of an array."""
    header = "<u%d" % size
    if "zlib" not in mode:
        head = np.array([len(values)], dtype=header).tobytes()
        return base64.b64encode(head) + base64.b64encode(values) if "apart" in mode else \
            head + values if "raw" in mode else base64.b64encode(head + values)
    length = 256
    pieces = [values[i:i + length] for i in range(0, len(values), length)]
    packed = [zlib.compress(piece) for piece in pieces]
    head = np.array([len(pieces), length, len(values) % length, *map(len, packed)], dtype=header).tobytes()
    body = b"".join(packed)
    return head + body if "raw" in mode else base64.b64encode(head) + base64.b64encode(body)


def vtu(points, cells, cell_data=None, point_data=None, mode="ascii", size=4, types=None):
    """Bytes of a file."""
    appended, place = [], 0

    def array(name, values, components=1):
        nonlocal place
        values = np.ascontiguousarray(values)
        code = values.dtype.kind + str(values.dtype.itemsize)
        tag = '<DataArray type="%s" Name="%s" NumberOfComponents="%d" ' % ((types or TYPES)[code], name, components)
        if mode == "ascii":
            return tag + 'format="ascii">%s</DataArray>\n' % " ".join(map(repr, values.ravel().tolist()))
        data = block(values.tobytes(), mode, size)
        if mode.startswith("base64"):
            return tag + 'format="binary">\n  %s\n</DataArray>\n' % data.decode()
        place += len(data)
        appended.append(data)
        return tag + 'format="appended" offset="%d"/>\n' % (place - len(data))

    text = "<?xml version=\"1.0\"?>\n<!-- a > b -->\n<VTKFile type='UnstructuredGrid' version='1.0' byte_order='LittleEndian' header_type='UInt%d'%s>\n" \
        % (8 * size, " compressor='vtkZLibDataCompressor'" if "zlib" in mode else "")
    text += '<UnstructuredGrid>\n<Piece NumberOfPoints="%d" NumberOfCells="%d">\n' % (len(points), len(cells))
    text += "<PointData>\n" + "".join(array(name, a) for name, a in (point_data or {}).items()) + "</PointData>\n"
    text += "<CellData>\n" + "".join(array(name, a) for name, a in (cell_data or {}).items()) + "</CellData>\n"
    text += "<Points>\n" + array("Points", points, 3) + "</Points>\n<Cells>\n"
    text += array("connectivity", np.concatenate([np.array(c, dtype=np.int64) for _, c in cells]))
    text += array("offsets", np.cumsum([len(c) for _, c in cells]).astype(np.int32))
    text += array("types", np.array([t for t, _ in cells], dtype=np.uint8))
    text += "</Cells>\n</Piece>\n</UnstructuredGrid>\n"
    result = text.encode()
    if appended:
        result += b'<AppendedData encoding="%s">\n_' % (b"raw" if "raw" in mode else b"base64") + b"".join(appended) + b"\n</AppendedData>\n"
    return result + b"</VTKFile>\n"
