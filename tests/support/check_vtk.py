#!/usr/bin/env python3
"""Opens a results file with VTK's own reader and checks what it sees.

Every array of the file reaches VTK with the same values; the nodes of each cell stand where VTK's cell type expects them
(against the linear cell through its corners; --straight: to round-off, otherwise within a quarter of the cell's size);
Jacobians and sizes of cells are positive; --volumes: the size of each body.
Exit code 0 if all is well, 1 if not, 77 where VTK or h5py is not installed.
"""
import argparse
import sys

try:
    import h5py
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
    from vtkmodules.vtkIOHDF import vtkHDFReader
except ImportError as reason:
    print("check_vtk.py: skipped:", reason)
    sys.exit(77)

LINEAR = {22: 5, 23: 9, 28: 9, 24: 10, 25: 12, 29: 12, 26: 13, 32: 13}  # quadratic cell types -> those of their corners
CORNERS = {5: 3, 9: 4, 10: 4, 12: 8, 13: 6}


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
    return quad if linear == 9 else [a * b for b in (1 - t, t) for a in quad]


def check_cell(cell, tolerance):
    """What is wrong with one cell, or None."""
    n, kind, dimension = cell.GetNumberOfPoints(), cell.GetCellType(), cell.GetCellDimension()
    linear = LINEAR.get(kind, kind)
    if linear not in CORNERS:
        return "has the unexpected type %d" % kind
    x = np.array([cell.GetPoints().GetPoint(i) for i in range(n)])
    p = np.array(cell.GetParametricCoords()).reshape(-1, 3)[:n] if linear != kind else None
    size = np.ptp(x, axis=0).max()
    if p is not None:
        straight = np.array([corner_shapes(linear, q) for q in p]) @ x[:CORNERS[linear]]
        distance = np.abs(straight - x).max(axis=1)
        if distance.max() > tolerance * size:
            return "has node %d at the wrong place" % distance.argmax()
    derivatives = [0.0] * (n * dimension)
    center = [0.0, 0.0, 0.0]
    cell.GetParametricCenter(center)
    cell.InterpolateDerivs(center, derivatives)
    jacobian = np.linalg.det((np.array(derivatives).reshape(dimension, n) @ x)[:, :dimension])
    return None if jacobian > 0 else "has the Jacobian %g" % jacobian


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--straight", action="store_true", help="cells have straight edges and plane faces")
    parser.add_argument("--volumes", nargs="+", type=float, help="volume (area) of each body")
    parser.add_argument("--most", type=int, default=5000, help="look at this many cells one by one, evenly spread (5000)")
    options = parser.parse_args()
    problems = []

    reader = vtkHDFReader()
    if not reader.CanReadFile(options.file):
        sys.exit("%s: VTK's HDF reader refuses it" % options.file)
    reader.SetFileName(options.file)
    reader.Update()
    grid = reader.GetOutput()
    with h5py.File(options.file, "r") as file:
        root = file["VTKHDF"]
        if grid.GetNumberOfPoints() != root["Points"].shape[0] or grid.GetNumberOfCells() != root["Types"].shape[0]:
            problems.append("VTK sees %d points and %d cells" % (grid.GetNumberOfPoints(), grid.GetNumberOfCells()))
        for name, data in (("PointData", grid.GetPointData()), ("CellData", grid.GetCellData())):
            for field, values in root[name].items():
                array = data.GetArray(field)
                if array is None or not np.array_equal(vtk_to_numpy(array), values[:]):
                    problems.append("%s/%s does not reach VTK" % (name, field))
        if not np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), root["Points"][:]):
            problems.append("the points do not reach VTK")
        if not np.array_equal(vtk_to_numpy(grid.GetCellTypesArray()), root["Types"][:]):
            problems.append("the cell types do not reach VTK")
        kinds = sorted(set(root["Types"][:].tolist()))

    n = grid.GetNumberOfCells()
    for i in range(0, n, max(1, n // options.most)):
        problem = check_cell(grid.GetCell(i), 1e-12 if options.straight else 0.25)
        if problem:
            problems.append("cell %d of type %d %s" % (i, grid.GetCellType(i), problem))

    sizes = vtkCellSizeFilter()
    sizes.SetInputData(grid)
    sizes.Update()
    volume = vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray("Volume"))
    area = vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray("Area"))
    size = np.where(volume != 0, volume, area)
    if n and size.min() <= 0:
        problems.append("cell %d has the size %g" % (size.argmin(), size.min()))
    body = vtk_to_numpy(grid.GetCellData().GetArray("body"))
    found = [size[body == b].sum() for b in range(1, body.max() + 1)] if n else []
    if options.volumes and not np.allclose(found, options.volumes, rtol=1e-9, atol=0):
        problems.append("volumes of the bodies: %s, expected %s" % (found, options.volumes))

    if problems:
        sys.exit("\n".join("%s: %s" % (options.file, problem) for problem in problems[:20]))
    print("%s: %d points, %d cells of types %s, %d bodies, size %g" % (
        options.file, grid.GetNumberOfPoints(), n, kinds, len(found), size.sum()))


main()
