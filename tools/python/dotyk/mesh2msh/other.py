"""Meshes that meshio reads: .med and others. Groups of cells, by their names, and integers of the cells become volumes and surfaces, groups
of points surfaces, reals of the points fields."""
import contextlib
import io

import numpy as np

from .elements import KINDS, TURNED, corner_kind
from .mesh import Fault, Mesh

# Nodes of elements whose first face is turned, as MED has them: the order is that of VTK with corners the other way round.
MIRRORED = {
    "tetra": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8], "pyramid": [0, 3, 2, 1, 4, 8, 7, 6, 5, 9, 12, 11, 10], "wedge": TURNED,
    "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17, 22, 23, 20, 21, 24, 25, 26]}
# The corner that tells the orientation: over the first three.
TOP = {"tetra": 3, "pyramid": 4, "wedge": 3, "hexahedron": 4}


def read(path, dimension):
    """The mesh of a file, a remark, and the files read."""
    try:
        import meshio
    except ImportError:
        raise Fault("%s: meshio, which reads this format, is missing: install it (Debian: apt install python3-meshio), or convert the file to "
                    ".msh, .vtu or .inp" % path) from None
    # Elements that meshio 5.0, that of Debian 12, has in its readers and not here.
    getattr(meshio._mesh, "topological_dimension", {}).update(wedge15=3, pyramid13=3)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            given = meshio.read(path)
    except BaseException as error:  # meshio ends the program where it knows no reader, and raises whatever its readers meet
        if isinstance(error, (KeyboardInterrupt, MemoryError)):
            raise
        raise Fault("%s: meshio cannot read it: %s" % (path, " ".join((said.getvalue() + " " + (str(error) or type(error).__name__)).split()))) \
            from None
    if "Warn" in said.getvalue():
        raise Fault("%s: meshio cannot read all of it: %s" % (path, " ".join(said.getvalue().split())))
    x = np.zeros((len(given.points), 3))
    x[:, :given.points.shape[1]] = given.points
    if not np.isfinite(x).all():
        raise Fault("%s: point %d has coordinates that are not finite" % (path, np.flatnonzero(~np.isfinite(x).all(axis=1))[0] + 1))
    parts, offsets, n = [], [], 0
    for block in given.cells:
        offsets.append(n if block.type != "vertex" else -1)
        if block.type == "vertex":
            continue
        if block.type not in KINDS:
            raise Fault("%s: elements of the type %s are not read: only lines, triangles, quadrilaterals, tetrahedra, hexahedra, wedges and "
                        "pyramids, linear and quadratic" % (path, block.type))
        rows = np.asarray(block.data, dtype=np.int64)
        if len(rows) and (rows.min() < 0 or rows.max() >= len(x)):
            raise Fault("%s: an element of the type %s has a point that is not there" % (path, block.type))
        parts.append((block.type, np.arange(n + 1, n + len(rows) + 1), oriented(block.type, rows, x)))
        n += len(rows)
    if not n:
        raise Fault("%s: the file has no elements" % path)
    mesh = Mesh(np.arange(1, len(x) + 1), x, parts, dimension)
    mesh.check_dimension(lambda e: path + ": ")
    mesh.add_elements(cell_sets(given, offsets))
    remark = mesh.add_node_sets(point_sets(given))
    for name, values in given.point_data.items():
        values = np.asarray(values)
        if values.ndim == 1 and values.dtype.kind == "f" and np.isfinite(values).all():
            mesh.fields.append((name, mesh.node_tags, values.astype(float)[:, None], 0))
    return mesh, remark, [path]


def oriented(kind, rows, x):
    """Rows of elements whose first face has its normal into the element."""
    corners = corner_kind(kind)
    if KINDS[kind][1] < 3:
        return rows
    a, b, c, d = (x[rows[:, i]] for i in (0, 1, 2, TOP[corners]))
    ours = ((np.cross(b - a, c - a)*(d - a)).sum(axis=1) > 0)[:, None]
    return np.where(ours, rows, rows[:, MIRRORED[corners][:rows.shape[1]]])


def cell_sets(given, offsets):
    """Sets of elements: (name, indices), groups of MED and others; else the values of integers of the cells."""
    sets = {}

    def add(name, block, chosen):
        if offsets[block] >= 0:
            sets.setdefault(name, []).append(offsets[block] + np.asarray(chosen, dtype=np.int64))

    for name, chosen in getattr(given, "cell_sets", {}).items():
        for block, own in enumerate(chosen):
            add(name, block, own)
    families = getattr(given, "cell_tags", {})
    arrays = {name: data for name, data in given.cell_data.items() if all(np.asarray(d).dtype.kind in "iu" for d in data)}
    for block, tags in enumerate(arrays.get("cell_tags", [])) if families else ():
        for tag, names in families.items():
            for name in names:
                add(name, block, np.flatnonzero(np.asarray(tags) == tag))
    if not sets:
        for name, data in arrays.items():
            for block, values in enumerate(data):
                for value in np.unique(values):
                    add("%s%d" % (name + " " if len(arrays) > 1 else "", value), block, np.flatnonzero(values == value))
    return [(name.strip(), np.concatenate(chosen)) for name, chosen in sets.items()]


def point_sets(given):
    """Sets of nodes: (name, indices)."""
    sets = [(name, np.asarray(chosen, dtype=np.int64)) for name, chosen in getattr(given, "point_sets", {}).items()]
    tags, found = np.asarray(given.point_data.get("point_tags", [])), {}
    for tag, names in getattr(given, "point_tags", {}).items():
        for name in names:
            found.setdefault(name.strip(), []).append(np.flatnonzero(tags == tag))
    return sets + [(name, np.concatenate(chosen)) for name, chosen in found.items()]
