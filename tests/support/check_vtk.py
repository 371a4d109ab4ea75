#!/usr/bin/env python3
"""Opens a results file with VTK's own reader and checks what it sees.

Every array of the file reaches VTK with the same values. The nodes of each cell stand where VTK's cell type expects
them: against the linear cell through the corners, to round-off (--straight) or within a quarter of the cell's size.
With VTK's own shape functions Jacobians are positive everywhere, and bodies have the volumes given (--volumes).
Exit code 0 if all is well, 1 if not, 77 where VTK or h5py is not installed.
"""
import argparse
import sys
import warnings

try:
    import h5py
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import reference, vtkLogger
    from vtkmodules.vtkCommonDataModel import vtkWedge
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
    from vtkmodules.vtkIOHDF import vtkHDFReader
except ImportError as reason:
    print("check_vtk.py: skipped:", reason)
    sys.exit(77)

LINEAR = {22: 5, 23: 9, 28: 9, 24: 10, 25: 12, 29: 12, 26: 13, 32: 13, 27: 14}  # quadratic cell types -> those of their corners
CORNERS = {5: 3, 9: 4, 10: 4, 12: 8, 13: 6, 14: 5}
POINT, WEIGHT = (t.tolist() for t in np.polynomial.legendre.leggauss(4))


def corner_shapes(linear, p):
    """Values at p of the shape functions of VTK's linear cells, in VTK's parametric coordinates (all in [0, 1])."""
    r, s, t = p
    if linear == 5:
        return [1 - r - s, r, s]
    if linear == 10:
        return [1 - r - s - t, r, s, t]
    if linear == 13:
        return [a * b for b in (1 - t, t) for a in (1 - r - s, r, s)]
    quad = [(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s]
    if linear == 14:
        return [a * (1 - t) for a in quad] + [t]
    return quad if linear == 9 else [a * b for b in (1 - t, t) for a in quad]


def quadrature(linear):
    """Points and weights on VTK's parametric domain, a cube also for pyramids: Gauss, folded onto simplices."""
    gauss = [((1 + x) / 2, w / 2) for x, w in zip(POINT, WEIGHT)]
    for r, u in gauss:
        for s, v in gauss:
            for t, w in (gauss if linear in (10, 12, 13, 14) else [(0.0, 1.0)]):
                if linear in (5, 13):
                    yield (r, s * (1 - r), t), u * v * w * (1 - r)
                elif linear == 10:
                    yield (r, s * (1 - r), t * (1 - r) * (1 - s)), u * v * w * (1 - r) ** 2 * (1 - s)
                else:
                    yield (r, s, t), u * v * w


def check_cells(cell, x, tolerance):
    """Problems (index, text) and sizes of cells of one type with the nodes x (n_cells, n_nodes, 3)."""
    n, dimension = cell.GetNumberOfPoints(), cell.GetCellDimension()
    linear = LINEAR.get(cell.GetCellType(), cell.GetCellType())

    def shapes(p):
        values = np.zeros(27)
        cell.EvaluateLocation(reference(0), p, [0.0] * 3, values)
        return values[:n]

    problems = []
    corners = [cell.GetParametricCoords()[3 * i:3 * i + 3] for i in range(n)]
    straight = np.array([corner_shapes(linear, p) for p in corners]) @ x[:, :CORNERS[linear]]
    distance = np.abs(straight - x).max(axis=2) / np.ptp(x, axis=1).max(axis=1)[:, None]
    problems += [(i, "has node %d at the wrong place" % distance[i].argmax())
                 for i in np.flatnonzero(distance.max(axis=1) > tolerance)[:3]]
    size = np.zeros(len(x))
    least = np.full(len(x), np.inf)
    step = np.eye(3) / 1024  # differences are exact up to quadratics, but for round-off
    # The base of VTK's wedge points out of it (vtkWedge's page before VTK 9.7), whatever its parametric coordinates
    # say.
    sign = -1 if linear == 13 else 1
    for p, weight in quadrature(linear):
        gradients = np.array([(shapes(p + h) - shapes(p - h)) * 512 for h in step[:dimension]])
        jacobian = sign * np.linalg.det((gradients @ x)[:, :, :dimension])
        least = np.minimum(least, jacobian)
        size += weight * jacobian
    return problems + [(i, "has the Jacobian %g" % least[i]) for i in np.flatnonzero(least <= 0)[:3]], size


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--straight", action="store_true", help="cells have straight edges and plane faces")
    parser.add_argument("--volumes", nargs="+", type=float, help="volume (area) of each body")
    options = parser.parse_args()
    problems = []

    warnings.simplefilter("ignore", DeprecationWarning)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # VTK 9.1 warns of version 2.0 and reads it
    reader = vtkHDFReader()
    if not reader.CanReadFile(options.file):
        sys.exit("%s: VTK's HDF reader refuses it" % options.file)
    reader.SetFileName(options.file)
    reader.Update()
    grid = reader.GetOutputDataObject(0)
    if grid.IsA("vtkPartitionedDataSet"):  # VTK 9.1 joins the parts by itself
        join = vtkAppendFilter()
        for i in range(grid.GetNumberOfPartitions()):
            join.AddInputData(grid.GetPartition(i))
        join.Update()
        grid = join.GetOutput()
    with h5py.File(options.file, "r") as file:
        root = file["VTKHDF"]
        if grid.GetNumberOfPoints() != root["Points"].shape[0] or grid.GetNumberOfCells() != root["Types"].shape[0]:
            problems.append("VTK sees %d points and %d cells" % (grid.GetNumberOfPoints(), grid.GetNumberOfCells()))
        for name, data in (("PointData", grid.GetPointData()), ("CellData", grid.GetCellData())):
            for field, values in root[name].items():
                array = data.GetArray(field)
                if array is None or not np.array_equal(vtk_to_numpy(array), values[:], equal_nan=values.dtype.kind == "f"):
                    problems.append("%s/%s does not reach VTK" % (name, field))
        if not np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), root["Points"][:]):
            problems.append("the points do not reach VTK")
        if not np.array_equal(vtk_to_numpy(grid.GetCellTypesArray()), root["Types"][:]):
            problems.append("the cell types do not reach VTK")
        kinds = sorted(set(root["Types"][:].tolist()))

    n = grid.GetNumberOfCells()
    types, size = vtk_to_numpy(grid.GetCellTypesArray()), np.zeros(n)
    points = vtk_to_numpy(grid.GetPoints().GetData())
    nodes = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    offsets = vtk_to_numpy(grid.GetCells().GetOffsetsArray())
    for kind in kinds:
        if LINEAR.get(kind, kind) not in CORNERS:
            problems.append("unexpected cell type %d" % kind)
            continue
        which = np.flatnonzero(types == kind)
        for some in np.array_split(which, len(which) // 20000 + 1):
            cell = grid.GetCell(some[0])
            x = points[nodes[offsets[some][:, None] + np.arange(cell.GetNumberOfPoints())]]
            found, size[some] = check_cells(cell, x, 1e-12 if options.straight else 0.25)
            problems += ["cell %d of type %d %s" % (some[i], kind, text) for i, text in found]

    # VTK's own sizes. Those of types 29 and 32 are wrong in VTK 9.1; VTK 9.7 turned its wedges over.
    wedge = vtkWedge()
    for i in range(6):
        wedge.GetPointIds().SetId(i, i)
    unsure = [29, 32] + [13, 26] * (wedge.GetFace(0).GetPointId(1) == 2)
    sizes = vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    own = sum(vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray(name)) for name in ("Volume", "Area"))
    wrong = np.flatnonzero((own <= 0) & ~np.isin(types, unsure))
    problems += ["cell %d of type %d has the size %g for VTK" % (i, types[i], own[i]) for i in wrong[:3]]
    body = vtk_to_numpy(grid.GetCellData().GetArray("body"))
    found = [size[body == b].sum() for b in range(1, body.max() + 1)] if n else []
    if options.volumes and not np.allclose(found, options.volumes, rtol=1e-9, atol=0):
        problems.append("volumes of the bodies: %s, expected %s" % (found, options.volumes))

    if problems:
        sys.exit("\n".join("%s: %s" % (options.file, problem) for problem in problems[:20]))
    print("%s: %d points, %d cells of types %s, %d bodies, size %g" % (
        options.file, grid.GetNumberOfPoints(), n, kinds, len(found), size.sum()))


main()
