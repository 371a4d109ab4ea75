"""Renders a results file to a picture, without a screen: the deformed shape, coloured by a field. Also the faces of CAD files that
`dotyk --check` writes (CASE.faces.vtu), with their numbers.

examples: dotyk-render hertz.vtkhdf
          dotyk-render hertz.vtkhdf -o hertz.png --field contact_pressure --scale 20 --view 1,-2,0.7 --edges
          dotyk-render assembly.faces.vtu --view 1,2,-1
          dotyk-render hertz.vtkhdf --clip 0,1,0 --range 0,4e8 --unit MPa --factor 1e-6
Needs VTK for Python (Debian: python3-vtk9) and, where there is no display, xvfb-run (Debian: xvfb, xauth).
"""
import argparse
import os
import pathlib
import shutil
import subprocess
import sys
import warnings

warnings.simplefilter("ignore", DeprecationWarning)


def vector(text):
    """Three numbers with commas between them."""
    parts = [float(part) for part in text.split(",")]
    if len(parts) != 3:
        raise argparse.ArgumentTypeError("three numbers with commas are needed, as in 1,-2,0.5")
    return parts


def pair(text):
    """Two numbers with a comma between them."""
    parts = [float(part) for part in text.split(",")]
    if len(parts) != 2:
        raise argparse.ArgumentTypeError("two numbers with a comma are needed, as in 0,4e8")
    return parts


def arguments():
    """The command line."""
    parser = argparse.ArgumentParser("dotyk-render", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("file", help="results file (.vtkhdf), or faces with their numbers (.faces.vtu)")
    add("-o", "--output", help="picture (.png); default: the results file's name with .png")
    add("--case", help="load case by name; default: the first one")
    add("--field", default="von_mises", help="von_mises (default), contact_pressure, displacement (its magnitude), or "
        "any number or vector of the file; 'none': one colour a body")
    add("--scale", default="auto", help="factor on the displacements; 'auto' (default): the largest one is seen as 5 "
        "%% of the scene's size, rounded; 0: undeformed")
    add("--view", type=vector, help="direction from the scene to the camera; default 1,-2,0.8, and 0,0,1 in the plane")
    add("--up", type=vector, help="direction that is up in the picture; default 0,0,1, and 0,1,0 in the plane")
    add("--zoom", type=float, default=1.0, help="larger is nearer (1)")
    add("--focus", type=vector, help="point in the middle of the picture; default: the scene's middle")
    add("--clip", type=vector, help="normal of a plane that cuts the scene open; what it points to is cut away")
    add("--clip-at", type=vector, help="a point of that plane; default: the scene's middle")
    add("--bodies", help="numbers of the bodies to show, with commas; default: all")
    add("--edges", action="store_true", help="draw the edges of the elements")
    add("--range", type=pair, dest="limits", help="least and largest value of the colours; default: those of the field")
    add("--factor", type=float, default=1.0, help="factor on the field's values, as 1e-6 from Pa to MPa (1)")
    add("--unit", help="unit in the title of the colour bar")
    add("--title", help="title of the colour bar; default: the field's name and unit")
    add("--caption", help="text at the bottom; default: the load case and the factor on the displacements; '' for none")
    add("--smooth", action="store_true", help="means at the nodes, body by body, of values that belong to elements")
    add("--map", choices=("turbo", "viridis", "coolwarm"), default="turbo", help="colours (turbo)")
    add("--size", type=pair, default=[1600, 1000], help="width and height in pixels (1600,1000)")
    add("--subdivision", type=int, default=2, help="levels of subdivision of curved faces (2)")
    return parser.parse_args()


def read_grid(path):
    """All bodies as one grid."""
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOHDF import vtkHDFReader

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # VTK 9.1 warns of version 2.0 and reads it
    reader = vtkHDFReader()
    if not pathlib.Path(path).is_file() or not reader.CanReadFile(path):
        sys.exit("dotyk-render: '%s' is not a results file" % path)
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutputDataObject(0)
    if grid.IsA("vtkPartitionedDataSet"):  # VTK 9.1 joins the parts by itself
        join = vtkAppendFilter()
        for i in range(grid.GetNumberOfPartitions()):
            join.AddInputData(grid.GetPartition(i))
        join.Update()
        grid = join.GetOutput()
    if grid.GetNumberOfCells() == 0:
        sys.exit("dotyk-render: '%s' has no elements" % path)
    return grid


def read_faces(path):
    """The facets of CAD files, which have points of their own, as one grid."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    reader = vtkXMLUnstructuredGridReader()
    if not pathlib.Path(path).is_file() or not reader.CanReadFile(path):
        sys.exit("dotyk-render: '%s' is no file of faces" % path)
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    if grid.GetCellData().GetArray("face") is None:
        sys.exit("dotyk-render: '%s' has no faces: dotyk --check CASE.nml writes them as CASE.faces.vtu" % path)
    # Facets of a body that meet get the same points.
    body = np.repeat(vtk_to_numpy(grid.GetCellData().GetArray("body")), np.diff(vtk_to_numpy(grid.GetCells().GetOffsetsArray())))
    _, first, which = np.unique(np.column_stack((vtk_to_numpy(grid.GetPoints().GetData()), body)), axis=0, return_index=True, return_inverse=True)
    points, cells = vtkPoints(), vtkCellArray()
    points.SetData(numpy_to_vtk(vtk_to_numpy(grid.GetPoints().GetData())[first], deep=True))
    cells.SetData(numpy_to_vtkIdTypeArray(vtk_to_numpy(grid.GetCells().GetOffsetsArray()).astype(np.int64), deep=True),
                  numpy_to_vtkIdTypeArray(which.ravel().astype(np.int64), deep=True))
    types = numpy_to_vtk(vtk_to_numpy(grid.GetCellTypesArray()), deep=True)
    grid.SetPoints(points)
    grid.SetCells(types, cells)
    return grid


def add_numbers(renderer, grid, size):
    """The number of each face at one of its facets that are seen; the camera is set and the faces are drawn."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkCellCenters
    from vtkmodules.vtkRenderingCore import vtkActor2D, vtkSelectVisiblePoints
    from vtkmodules.vtkRenderingLabel import vtkLabeledDataMapper

    centres, seen = vtkCellCenters(), vtkSelectVisiblePoints()
    corners = vtk_to_numpy(grid.GetPoints().GetData())
    nodes, offsets = (vtk_to_numpy(a) for a in (grid.GetCells().GetConnectivityArray(), grid.GetCells().GetOffsetsArray()))
    a, b, c = (corners[nodes[offsets[:-1] + i]] for i in range(3))
    front = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.array(renderer.GetActiveCamera().GetPosition()) - a) > 0
    array = numpy_to_vtk(np.where(front, vtk_to_numpy(grid.GetCellData().GetArray("face")), 0).astype(np.int32), deep=True)
    array.SetName("front")
    grid.GetCellData().AddArray(array)
    centres.SetInputData(grid)
    seen.SetInputConnection(centres.GetOutputPort())
    seen.SetRenderer(renderer)
    seen.SetToleranceWorld(0.003 * grid.GetLength())
    seen.Update()
    found = seen.GetOutput()
    places, numbers = [], []
    if found.GetNumberOfPoints():
        x, face = vtk_to_numpy(found.GetPoints().GetData()), vtk_to_numpy(found.GetPointData().GetArray("front"))
        for number in np.unique(face[face > 0]):
            own = x[face == number]
            places.append(own[np.linalg.norm(own - own.mean(axis=0), axis=1).argmin()])
            numbers.append(number)
    points, labels, mapper, actor = vtkPoints(), vtkPolyData(), vtkLabeledDataMapper(), vtkActor2D()
    for place in places:
        points.InsertNextPoint(place)
    labels.SetPoints(points)
    array = numpy_to_vtk(np.array(numbers, dtype=np.int32), deep=True)
    array.SetName("face")
    labels.GetPointData().AddArray(array)
    mapper.SetInputData(labels)
    mapper.SetLabelModeToLabelFieldData()
    mapper.SetFieldDataName("face")
    text = mapper.GetLabelTextProperty()
    text.SetColor(0.05, 0.05, 0.05)
    text.SetFontSize(size)
    text.SetJustificationToCentered()
    text.SetVerticalJustificationToCentered()
    text.ItalicOff()
    text.ShadowOff()
    actor.SetMapper(mapper)
    renderer.AddActor2D(actor)
    return numbers


def cases_of(path):
    """Names of the load cases of a results file; none where it has no cases."""
    import h5py

    with h5py.File(path) as file:
        if "dotyk/cases" not in file:
            return []
        names = file["dotyk/cases"].attrs["names"]
        return (names.decode() if isinstance(names, bytes) else str(names)).split("\n")


def take_case(grid, path, name):
    """The fields of a load case in place of those of the first one: VTK before 9.3 reads no steps of time."""
    import h5py
    from vtkmodules.util.numpy_support import numpy_to_vtk

    names = cases_of(path)
    if not names:
        sys.exit("dotyk-render: '%s' has no load cases" % path)
    if name not in names:
        sys.exit("dotyk-render: no load case '%s'; there are %s" % (name, ", ".join(names)))
    with h5py.File(path) as file:
        steps = file["VTKHDF/Steps"]
        for place, data, n in (("PointData", grid.GetPointData(), grid.GetNumberOfPoints()),
                               ("CellData", grid.GetCellData(), grid.GetNumberOfCells())):
            for field, values in file["VTKHDF"][place].items():
                first = steps["%sOffsets/%s" % (place, field)][names.index(name)]
                array = numpy_to_vtk(values[first:first + n], deep=True)
                array.SetName(field)
                data.AddArray(array)


def round_factor(factor):
    """The nearest of 1, 2, 5 times a power of ten."""
    import math

    decade = 10.0 ** math.floor(math.log10(factor))
    return decade * min((1, 2, 5, 10), key=lambda m: abs(math.log(m * decade / factor)))


def only_bodies(grid, numbers):
    """The part of the grid that belongs to some bodies."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkSelection, vtkSelectionNode
    from vtkmodules.vtkFiltersExtraction import vtkExtractSelection

    cells = np.flatnonzero(np.isin(vtk_to_numpy(grid.GetCellData().GetArray("body")), numbers)).astype(np.int64)
    if len(cells) == 0:
        sys.exit("dotyk-render: no such body")
    node, selection, extract = vtkSelectionNode(), vtkSelection(), vtkExtractSelection()
    node.SetFieldType(vtkSelectionNode.CELL)
    node.SetContentType(vtkSelectionNode.INDICES)
    node.SetSelectionList(numpy_to_vtkIdTypeArray(cells, deep=True))
    selection.AddNode(node)
    extract.SetInputData(0, grid)
    extract.SetInputData(1, selection)
    extract.Update()
    return extract.GetOutput()


def deform(grid, scale):
    """Move the nodes; the factor that was used. ('auto' becomes a number.)"""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints

    array = grid.GetPointData().GetArray("displacement")
    if array is None:
        return 0.0
    displacement = vtk_to_numpy(array)
    if scale == "auto":
        largest = np.linalg.norm(displacement, axis=1).max()
        factor = round_factor(0.05 * grid.GetLength() / largest) if largest > 0 else 0.0
    else:
        factor = float(scale)
    points = vtkPoints()
    points.SetData(numpy_to_vtk(vtk_to_numpy(grid.GetPoints().GetData()) + factor * displacement, deep=True))
    grid.SetPoints(points)
    return factor


def colour_array(grid, options):
    """Add the array 'colour' to points or cells; where it is ('point', 'cell') or None."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    for place, data in (("point", grid.GetPointData()), ("cell", grid.GetCellData())):
        array = data.GetArray("body" if options.field == "none" else options.field)
        if array is None:
            continue
        values = vtk_to_numpy(array).astype(float)
        values = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        if place == "cell" and options.smooth and options.field not in ("none", "body"):
            values, place, data = nodal_means(grid, values), "point", grid.GetPointData()
        colour = numpy_to_vtk(values * options.factor, deep=True)
        colour.SetName("colour")
        data.AddArray(colour)
        return place
    names = [d.GetArrayName(i) for d in (grid.GetPointData(), grid.GetCellData()) for i in range(d.GetNumberOfArrays())]
    sys.exit("dotyk-render: no field '%s'; the file has %s" % (options.field, ", ".join(names)))


def nodal_means(grid, values):
    """Means over the elements at each node. (Bodies share no nodes.)"""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    nodes = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    lengths = np.diff(vtk_to_numpy(grid.GetCells().GetOffsetsArray()))
    total = np.bincount(nodes, np.repeat(values, lengths), grid.GetNumberOfPoints())
    return total / np.maximum(1, np.bincount(nodes, minlength=grid.GetNumberOfPoints()))


def surface_of(grid, options):
    """Faces to draw, curved ones subdivided, and the edges of the elements."""
    from vtkmodules.vtkFiltersCore import vtkFeatureEdges, vtkPolyDataNormals
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(options.subdivision)
    surface.PassThroughCellIdsOn()
    normals = vtkPolyDataNormals()
    normals.SetInputConnection(surface.GetOutputPort())
    normals.SetFeatureAngle(35)
    normals.Update()
    outline = vtkFeatureEdges()
    outline.SetInputConnection(surface.GetOutputPort())
    outline.BoundaryEdgesOn()
    outline.FeatureEdgesOn()
    outline.SetFeatureAngle(35)
    outline.ManifoldEdgesOff()
    outline.NonManifoldEdgesOff()
    outline.ColoringOff()
    outline.Update()
    return normals.GetOutput(), outline.GetOutput()


def element_edges(surface):
    """Lines where faces of different elements meet, following the curved faces."""
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    nodes = vtk_to_numpy(surface.GetPolys().GetConnectivityArray())
    offsets = vtk_to_numpy(surface.GetPolys().GetOffsetsArray())
    element = vtk_to_numpy(surface.GetCellData().GetArray("element"))[-len(offsets) + 1:]
    following = np.arange(len(nodes)) + 1
    following[offsets[1:] - 1] = offsets[:-1]
    points = vtk_to_numpy(surface.GetPoints().GetData())
    # Points are doubled where normals jump: compare places, not numbers.
    _, place = np.unique(np.round(points / (np.ptp(points, axis=0).max() * 1e-7)), axis=0, return_inverse=True)
    place = place.ravel()
    ends = np.sort(np.column_stack((place[nodes], place[nodes[following]])), axis=1)
    _, first, which = np.unique(ends, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    owner = np.repeat(element, np.diff(offsets))
    inner = np.ones(len(first), bool)
    np.logical_and.at(inner, which, owner == owner[first][which])
    kept = first[~inner | (np.bincount(which) == 1)]
    lines = np.column_stack((nodes[kept], nodes[following][kept])).ravel().astype(np.int64)
    cells, drawing = vtkCellArray(), vtkPolyData()
    cells.SetData(numpy_to_vtkIdTypeArray(np.arange(0, len(lines) + 1, 2, dtype=np.int64), deep=True),
                  numpy_to_vtkIdTypeArray(lines, deep=True))
    drawing.SetPoints(surface.GetPoints())
    drawing.SetLines(cells)
    return drawing


def cut_open(grid, normal, point):
    """The part of the grid behind a plane."""
    from vtkmodules.vtkCommonDataModel import vtkPlane
    from vtkmodules.vtkFiltersGeneral import vtkClipDataSet

    plane, clip = vtkPlane(), vtkClipDataSet()
    plane.SetNormal(normal)
    plane.SetOrigin(point)
    clip.SetInputData(grid)
    clip.SetClipFunction(plane)
    clip.InsideOutOn()
    clip.Update()
    if clip.GetOutput().GetNumberOfCells() == 0:
        sys.exit("dotyk-render: the plane of --clip cuts everything away")
    return clip.GetOutput()


def colours(name, limits):
    """A table of 256 colours."""
    from vtkmodules.vtkCommonCore import vtkLookupTable
    from vtkmodules.vtkRenderingCore import vtkColorTransferFunction

    table, ramp = vtkLookupTable(), vtkColorTransferFunction()
    if name == "coolwarm":
        ramp.SetColorSpaceToDiverging()
        ramp.AddRGBPoint(0, 0.230, 0.299, 0.754)
        ramp.AddRGBPoint(1, 0.706, 0.016, 0.150)
    elif name == "viridis":
        stops = ((0.267, 0.005, 0.329), (0.283, 0.141, 0.458), (0.254, 0.265, 0.530), (0.207, 0.372, 0.553),
                 (0.164, 0.471, 0.558), (0.128, 0.567, 0.551), (0.135, 0.659, 0.518), (0.267, 0.749, 0.441),
                 (0.478, 0.821, 0.318), (0.741, 0.873, 0.150), (0.993, 0.906, 0.144))
        for i, stop in enumerate(stops):
            ramp.AddRGBPoint(i / (len(stops) - 1), *stop)
    else:  # the polynomial of turbo's authors
        powers = ((0.13572138, 4.61539260, -42.66032258, 132.13108234, -152.94239396, 59.28637943),
                  (0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604),
                  (0.10667330, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973))
        for i in range(256):
            x = 0.06 + 0.91 * i / 255  # without the ends, which are nearly black
            ramp.AddRGBPoint(i / 255, *(min(1, max(0, sum(c * x**k for k, c in enumerate(p)))) for p in powers))
    table.SetNumberOfTableValues(256)
    for i in range(256):
        table.SetTableValue(i, *ramp.GetColor(i / 255))
    table.SetTableRange(limits)
    return table


def body_colours(n):
    """One quiet colour a body."""
    from vtkmodules.vtkCommonCore import vtkLookupTable

    quiet = ((0.55, 0.66, 0.80), (0.90, 0.72, 0.50), (0.62, 0.78, 0.60), (0.82, 0.60, 0.62), (0.70, 0.64, 0.80),
             (0.72, 0.62, 0.55), (0.85, 0.72, 0.82), (0.72, 0.72, 0.72))
    table = vtkLookupTable()
    table.SetNumberOfTableValues(n)
    for i in range(n):
        table.SetTableValue(i, *quiet[i % len(quiet)], 1)
    table.SetTableRange(0.5, n + 0.5)
    return table


def colour_bar(table, title, width):
    """The bar on the right."""
    from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor

    bar = vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetTitle(title + "\n ")
    bar.SetNumberOfLabels(6)
    bar.SetLabelFormat("%.3g")
    bar.SetMaximumNumberOfColors(256)
    bar.SetPosition(0.87, 0.12)
    bar.SetWidth(0.10)
    bar.SetHeight(0.76)
    bar.SetBarRatio(0.28)
    bar.UnconstrainedFontSizeOn()
    for text, size in ((bar.GetTitleTextProperty(), width / 66), (bar.GetLabelTextProperty(), width / 74)):
        text.SetColor(0.1, 0.1, 0.1)
        text.SetFontFamilyToArial()
        text.SetFontSize(int(size))
        text.ItalicOff()
        text.BoldOff()
        text.ShadowOff()
    return bar


def line_actor(lines, width, grey):
    """Dark lines a little in front of the faces."""
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    mapper, actor = vtkPolyDataMapper(), vtkActor()
    mapper.SetInputData(lines)
    mapper.ScalarVisibilityOff()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-1, -4)
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(grey, grey, grey)
    actor.GetProperty().SetLineWidth(width)
    actor.GetProperty().LightingOff()
    return actor


def aim(renderer, surface, options, plane, aspect, margin):
    """Point the camera so that all is in the picture, left of a margin for the colour bar (a part of the width)."""
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy

    back = np.array(options.view or ([0, 0, 1] if plane else [1, -2, 0.8]))
    back = back / np.linalg.norm(back)
    right = np.cross(options.up or ([0, 1, 0] if plane else [0, 0, 1]), back)
    if np.linalg.norm(right) < 1e-6:  # seen from above: y is up
        right = np.cross([0, 1, 0], back)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(back, right), back])
    seen = vtk_to_numpy(surface.GetPoints().GetData()) @ axes.T
    half = 1.0 if plane else np.tan(np.radians(12.0))  # half the height of the picture at distance 1
    room = np.array([half * aspect * 0.94 * (1 - margin), half * 0.94])
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    for _ in range(20):  # in perspective the nearest distance and the middle depend on each other
        offset = seen - middle
        distance = (offset[:, 2:] + np.abs(offset[:, :2]) / room).max()
        place = offset[:, :2] / (1 if plane else (distance - offset[:, 2:]))
        middle[:2] += (place.min(axis=0) + place.max(axis=0)) / 2 * (1 if plane else distance)
    height = (np.abs(offset[:, :2]) / room).max() / options.zoom
    focus = np.array(options.focus) if options.focus else middle @ axes
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(focus)
    camera.SetViewUp(axes[1])
    camera.SetPosition(focus + back * (surface.GetLength() if plane else distance / options.zoom))
    camera.SetViewAngle(24.0)
    camera.SetParallelProjection(plane)
    camera.SetParallelScale(height)
    camera.SetWindowCenter(margin, 0)
    renderer.ResetCameraClippingRange()


def render(options):
    """Read, deform, colour, draw, write."""
    import numpy as np
    import vtkmodules.vtkInteractionStyle  # noqa: F401  (the factories of the renderer)
    import vtkmodules.vtkRenderingFreeType  # noqa: F401
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkIOImage import vtkPNGWriter
    from vtkmodules.vtkRenderingCore import (vtkActor, vtkLightKit, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow,
                                             vtkTextActor, vtkWindowToImageFilter)

    of_faces = options.file.endswith(".vtu")
    grid = read_faces(options.file) if of_faces else read_grid(options.file)
    if of_faces:
        options.field, options.caption = "none", options.caption or ""
    cases = [] if of_faces else cases_of(options.file)
    if options.case:
        take_case(grid, options.file, options.case)
    n_bodies = int(grid.GetCellData().GetArray("body").GetRange()[1])
    if options.bodies:
        grid = only_bodies(grid, [int(number) for number in options.bodies.split(",")])
    factor = deform(grid, options.scale)
    place = colour_array(grid, options)
    data = grid.GetPointData() if place == "point" else grid.GetCellData()
    limits = options.limits or data.GetArray("colour").GetRange()
    if limits[0] == limits[1]:
        limits = (limits[0], limits[0] + (abs(limits[0]) or 1.0))
    element = numpy_to_vtk(np.arange(grid.GetNumberOfCells()), deep=True)
    element.SetName("element")
    grid.GetCellData().AddArray(element)
    bounds = grid.GetBounds()
    middle = [(bounds[2 * i] + bounds[2 * i + 1]) / 2 for i in range(3)]
    plane = bounds[5] - bounds[4] <= 1e-9 * grid.GetLength()
    if options.clip:
        grid = cut_open(grid, options.clip, options.clip_at or middle)
    surface, outline = surface_of(grid, options)

    by_body = options.field in ("none", "body")
    table = body_colours(n_bodies) if by_body else colours(options.map, limits)
    mapper, actor, renderer = vtkPolyDataMapper(), vtkActor(), vtkRenderer()
    mapper.SetInputData(surface)
    mapper.SetLookupTable(table)
    mapper.UseLookupTableScalarRangeOn()
    mapper.SetColorModeToMapScalars()
    if place == "point":
        mapper.SetScalarModeToUsePointFieldData()
        mapper.InterpolateScalarsBeforeMappingOn()
    else:
        mapper.SetScalarModeToUseCellFieldData()
    mapper.SelectColorArray("colour")
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 2)  # behind the lines
    actor.SetMapper(mapper)
    skin = actor.GetProperty()
    skin.SetInterpolationToPhong()
    skin.SetAmbient(1.0 if plane else 0.32)
    skin.SetDiffuse(0.0 if plane else 0.72)
    lights = vtkLightKit()
    lights.SetKeyLightWarmth(0.52)
    lights.SetFillLightWarmth(0.5)
    lights.SetBackLightWarmth(0.5)
    lights.SetHeadLightWarmth(0.5)
    lights.SetKeyLightAngle(40, 25)
    lights.SetKeyToFillRatio(1.8)
    lights.SetKeyToHeadRatio(2.0)
    lights.AddLightsToRenderer(renderer)
    renderer.SetBackground(1, 1, 1)
    renderer.AddActor(actor)
    width, height = (int(number) for number in options.size)
    thickness = width / 1600
    if options.edges:
        renderer.AddActor(line_actor(element_edges(surface), 1.0 * thickness, 0.25))
    renderer.AddActor(line_actor(outline, 2.0 * thickness, 0.1))
    if not by_body:
        names = {"von_mises": "von Mises stress", "contact_pressure": "contact pressure"}
        title = names.get(options.field, options.field) + (" [%s]" % options.unit if options.unit else "")
        renderer.AddActor2D(colour_bar(table, options.title or title, width))
    caption = options.caption
    if caption is None:
        caption = ["case '%s'" % (options.case or cases[0])] if cases else []
        caption += [] if factor == 1 else ["undeformed" if factor == 0 else "displacements \u00d7 %g" % factor]
        caption = ", ".join(caption)
    if caption:
        text = vtkTextActor()
        text.SetInput(caption)
        text.GetTextProperty().SetColor(0.3, 0.3, 0.3)
        text.GetTextProperty().SetFontSize(int(width / 66))
        text.GetTextProperty().SetJustificationToRight()
        text.SetPosition(width * 0.985, width / 50)
        renderer.AddActor2D(text)

    aim(renderer, surface, options, plane, width / height, 0 if by_body else 0.12)

    window, image, writer = vtkRenderWindow(), vtkWindowToImageFilter(), vtkPNGWriter()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(width, height)
    window.AddRenderer(renderer)
    window.Render()
    if of_faces:
        numbers = add_numbers(renderer, grid, int(width / 70))
        window.Render()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    image.Update()
    vtkObject.GlobalWarningDisplayOff()  # the message below says it
    output = options.output or str(pathlib.Path(options.file).with_suffix(".png"))
    writer.SetFileName(output)
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()
    if writer.GetErrorCode() or not pathlib.Path(output).is_file():
        sys.exit("dotyk-render: '%s' cannot be written" % output)
    if of_faces:
        print("%s: faces %s" % (output, ", ".join(map(str, numbers))))
        return
    of_case = ", case '%s'" % (options.case or cases[0]) if cases else ""
    print("%s: %s, %g to %g%s, displacements x %g" % (output, options.field, *limits, of_case, factor))
    if factor > 1:
        print("dotyk-render: magnified displacements let bodies seem to overlap: --scale 1 shows them as they are")


def main():
    """Parse, find VTK and a display, render."""
    options = arguments()
    try:
        import vtkmodules.vtkIOHDF  # noqa: F401
    except ImportError:
        sys.exit("dotyk-render: VTK for Python is missing (Debian: apt install python3-vtk9; elsewhere: pip install vtk)")
    if not os.environ.get("DISPLAY") and sys.platform.startswith("linux"):
        if shutil.which("xvfb-run") is None:
            sys.exit("dotyk-render: no display and no xvfb-run (Debian: apt install xvfb xauth)")
        command = ["xvfb-run", "-a", "-s", "-screen 0 1280x1024x24", sys.executable, "-B", *sys.argv]
        sys.exit(subprocess.run(command).returncode)
    render(options)


if __name__ == "__main__":
    main()
