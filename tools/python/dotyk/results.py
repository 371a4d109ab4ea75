"""Results files as numpy arrays. docs/results.md describes the file; names of fields are those of the file."""
import collections
import collections.abc
import functools
import os

import h5py
import numpy as np

from .scene import Scene

Cells = collections.namedtuple('Cells', 'type numbers nodes')
Cells.__doc__ = """The cells of one type of a body.

type: VTK's number, such as 24 for tet10. numbers (n): their places among the cells of the body, from 0. nodes (n, nodes of a cell):
numbers of their nodes in the body, from 0, in VTK's order.
"""


def _plain(value):
    """An attribute as a text, a number or an array."""
    if isinstance(value, bytes):
        return value.decode('utf-8', 'replace')
    return value.item() if isinstance(value, np.generic) else value


def _field(name, meaning):
    """A property that reads a field of the file."""
    return property(lambda self: self[name], doc=meaning)


class _Named(dict):
    """A dictionary whose KeyErrors tell the names that there are."""

    def __init__(self, items, what):
        super().__init__(items)
        self._what = what

    def __missing__(self, name):
        raise KeyError("%s '%s'; there are %s" % (self._what, name, ', '.join(map(str, self)) or 'none'))


class Record(collections.abc.Mapping):
    """Numbers of one group of the file by name: record['energy']. Arrays are read where they are asked for, each time; of an array and an
    attribute of one name the array, and the other one in record.attributes."""

    def __init__(self, group):
        self._group = group

    @functools.cached_property
    def attributes(self):
        """Attributes of the group: {name: text, number or array}."""
        return {name: _plain(value) for name, value in self._group.attrs.items()}

    def __getitem__(self, name):
        if isinstance(self._group.get(name), h5py.Dataset):
            return self._group[name][()]
        if name in self.attributes:
            return self.attributes[name]
        raise KeyError("%s: no '%s' in %s" % (self._group.file.filename, name, self._group.name))

    def __iter__(self):
        arrays = [name for name, entry in self._group.items() if isinstance(entry, h5py.Dataset)]
        return iter([name for name in self.attributes if name not in arrays] + arrays)

    def __len__(self):
        return sum(1 for _ in self)

    def __repr__(self):
        return '%s(%s)' % (type(self).__name__, ', '.join(self))


class Pair(Record):
    """A contact pair, with one entry for each of its n contact rows: a slave vertex or a quadrature point. pair['name'] reads any dataset
    or attribute of docs/results.md."""

    position = _field('position', 'Slave vertices or quadrature points (n, 3) [length].')
    normal = _field('normal', 'Unit normals from the slave into the master body (n, 3).')
    weight = _field('weight', 'Areas of the rows (n) [length^2]; in the plane per unit thickness, axisymmetric with 2 pi r.')
    theta = _field('theta', 'Penalty parameters of the rows (n) [length/pressure]; attributes["theta"] is that of the pair.')
    gap_initial = _field('gap_initial', 'Weighted gaps before deformation (n) [length], negative where the bodies overlap.')
    gap_uncertainty = _field('gap_uncertainty', 'How uncertain the gaps are (n) [length].')
    gap = _field('gap', 'Weighted gaps after deformation (n) [length]; with theta > 0 negative under pressure.')
    pressure = _field('pressure', 'Lagrange multipliers (n) [pressure], positive in compression.')
    pressure_projected = _field('pressure_projected', 'Pressures projected on the slave surface (n) [pressure]: the values to look at.')
    patch_area = _field('patch_area', 'Areas of the connected patches of the contact (m).')
    patch_force = _field('patch_force', 'Integrals of the pressure over them (m) [force].')
    patch_centre = _field('patch_centre', 'Their centres of pressure (m, 3) [length].')
    patch_half_axis_long = _field('patch_half_axis_long', 'Long half axes of their Hertzian ellipses (m) [length].')
    patch_half_axis_short = _field('patch_half_axis_short', 'Short half axes (m) [length].')
    force = _field('force', 'Contact force on the slave body (3) [force]; on the master body it is opposite.')

    @property
    def forces(self):
        """Forces of the rows on the slave body (n, 3) [force]: -weight pressure normal."""
        return -(self.weight*self.pressure)[:, None]*self.normal


class Body:
    """A body: its mesh and the fields on its nodes and cells. body['name'] reads any field of docs/results.md.

    name: name of the body in the scene. number: from 1, in the order of the scene. node_range, cell_range: slices of its nodes and cells
    among those of all bodies.
    """

    def __init__(self, grid, name, number, nodes, cells, entries, step=0):
        self._grid, self.name, self.number, self._step = grid, name, number, step
        self.node_range, self.cell_range, self._entries = nodes, cells, entries

    def __getitem__(self, name):
        for place, part in (('PointData', self.node_range), ('CellData', self.cell_range)):
            if name in self._grid[place]:
                first = _first(self._grid, place, name, self._step)
                return self._grid[place][name][first + part.start:first + part.stop]
        raise KeyError(_absent(self._grid, name))

    n_nodes = property(lambda self: self.node_range.stop - self.node_range.start, doc='Number of nodes.')
    n_cells = property(lambda self: self.cell_range.stop - self.cell_range.start, doc='Number of cells.')
    nodes = property(lambda self: self._grid['Points'][self.node_range], doc='Coordinates before deformation (n_nodes, 3) [length].')
    displacement = _field('displacement', 'Displacement (n_nodes, 3) [length].')
    contact_pressure = _field('contact_pressure', 'Contact pressure on the nodes (n_nodes) [pressure]; 0 off the contact surfaces.')
    penetration = _field('penetration', 'Depth of nodes that are too deep in another body (n_nodes) [length]; else 0.')
    nodal_stress = _field('nodal_stress', 'Recovered stresses at the nodes (n_nodes, 6) [pressure]: xx yy zz xy yz xz.')
    nodal_von_mises = _field('nodal_von_mises', 'Their von Mises stresses (n_nodes) [pressure].')
    node_tag = _field('node_tag', 'Node tags of the mesh file (n_nodes).')
    stress = _field('stress', 'Mean stresses of the cells (n_cells, 6) [pressure]: xx yy zz xy yz xz.')
    von_mises = _field('von_mises', 'Von Mises stresses (n_cells) [pressure].')
    discretization_error = _field('discretization_error', 'Estimated errors of the cells (n_cells), relative to the norm of all.')
    material = _field('material', 'Numbers of the materials of the cells in the namelist file, from 1 (n_cells).')
    element_tag = _field('element_tag', 'Element tags of the mesh file (n_cells).')

    @property
    def cells(self):
        """The cells by type: a list of Cells, one in most meshes."""
        types, first = self._grid['Types'][self.cell_range], self.cell_range.start + self.number - 1
        offsets = self._grid['Offsets'][first:first + len(types) + 1]
        entries, found = self._grid['Connectivity'][self._entries], []
        for kind in np.unique(types):
            numbers = np.flatnonzero(types == kind)
            width = offsets[numbers[0] + 1] - offsets[numbers[0]]
            found.append(Cells(int(kind), numbers, entries[offsets[numbers][:, None] + np.arange(width)]))
        return found

    def __repr__(self):
        return "<body '%s': %d nodes, %d cells>" % (self.name, self.n_nodes, self.n_cells)


def _first(grid, place, name, step):
    """Where a field begins in a load case, its number from 0; None: the file has cases, and none is chosen."""
    if 'Steps' not in grid:
        return 0
    offsets = grid['Steps/%sOffsets/%s' % (place, name)][:]
    if step is None and offsets.any():
        raise KeyError(_unchosen(grid.file))
    return int(offsets[step or 0])


def _case_names(file):
    """Names of the load cases of a file; none where it has no cases."""
    names = _plain(file['dotyk/cases'].attrs['names']) if 'dotyk/cases' in file else ''
    return names.split('\n') if names else []


def _unchosen(file):
    """The message where the file has load cases, and none is chosen."""
    return '%s has load cases: choose one by results.case(name); there are %s' % (file.filename, ', '.join(_case_names(file)))


def _absent(grid, name):
    """The message for a field that is not in the file."""
    return "%s: no field '%s' (&output fields asks for fields); there are %s" % (
        grid.file.filename, name, ', '.join([*grid['PointData'], *grid['CellData']]))


class Results:
    """A results file. Arrays are read where they are asked for, each time; the file stays open until close(), the end of a with, or
    until nobody uses it.

    path: of the file. log: what the program printed, where dotyk.run made the results.
    bodies['ball'].displacement, pairs['touch'].pressure, summary['error_bound'], history['error_bound'], timing['total'],
    run['version'] and results['displacement'], which is that of all bodies, are numpy arrays, numbers and texts.
    cases: names of the load cases, none where the scene has none; results.case('hot') has the results of one of them.
    """

    def __init__(self, path, log='', case=None):
        self.path, self.log = os.fspath(path), log
        self.file = h5py.File(self.path, 'r')
        self.cases = _case_names(self.file)
        self._is_chosen = case is not None
        self.case_name = case if case is not None or len(self.cases) != 1 else self.cases[0]
        if self.case_name is not None and self.case_name not in self.cases:
            raise KeyError("%s: no load case '%s'; there are %s" % (self.path, case, ', '.join(self.cases) or 'none'))

    def case(self, name):
        """The results of a load case: Results with its summary, history, pairs and fields."""
        return Results(self.path, self.log, case=name)

    @property
    def _step(self):
        """Number of the load case from 0; None where one is to be chosen."""
        if not self.cases:
            return 0
        return None if self.case_name is None else self.cases.index(self.case_name)

    @property
    def _root(self):
        """The group with the results of the load case, or of a scene without any."""
        if not self.cases:
            return self.file['dotyk']
        if self.case_name is None:
            raise KeyError(_unchosen(self.file))
        return self.file['dotyk/cases'][self.case_name]

    summary = functools.cached_property(lambda self: self.record('summary'))
    summary.__doc__ = 'How the run ended: errors, energies, numbers of iterations, ... (docs/results.md); Record.'
    history = functools.cached_property(lambda self: self.record('history'))
    history.__doc__ = 'Arrays with one entry per iteration (n_iterations): error_bound, energy, active, ...; Record.'
    timing = functools.cached_property(lambda self: Record(self.file['dotyk/timing']))
    timing.__doc__ = 'Wall times of the stages [s]; Record.'
    run = functools.cached_property(lambda self: Record(self.file['dotyk']))
    run.__doc__ = 'How the results were made: version, command_line, threads, started, input, ...; Record.'

    def record(self, name):
        """Another group of /dotyk by its name (docs/results.md); Record."""
        groups = _Named(self._root, '%s: no group /dotyk' % self.path)
        return Record(groups[name])

    supports = property(lambda self: self.record('supports'), doc="""Reactions, one entry per support: force, moment, body, ...; Record.
        Its names are .supports['names'].splitlines(), likewise those of the next five.""")
    quantities = property(lambda self: self.record('quantities'), doc='Quantities of &output and &accuracy: value, error (bar of the mesh), estimate; Record.')
    loads = property(lambda self: self.record('loads'), doc='Resultants of the loads: force, moment, body, ...; Record.')
    ties = property(lambda self: self.record('ties'), doc='Ties and bolts: force, moment, tension, shortening, ...; Record.')
    motions = property(lambda self: self.record('rigid_bodies'), doc='Motions of rigid bodies: displacement of their point, rotation; Record.')
    forces = property(lambda self: self.record('bodies'), doc='Sums of forces on each body, and strain energies; Record.')

    def _n_missing(self):
        """Number of load cases of the scene that an interrupted run did not compute."""
        return int(self.file['dotyk/cases'].attrs.get('n_missing', 0)) if self.cases else 0

    @property
    def converged(self):
        """Whether the stop rule was met; of load cases none of which is chosen: in all of them, and none is missing."""
        if self.cases and not self._is_chosen:
            return not self._n_missing() and all(self.file['dotyk/cases'][name]['summary'].attrs['converged'] for name in self.cases)
        return bool(self.summary['converged'])

    @property
    def status(self):
        """How the run ended: 'converged', 'max_iterations', 'interrupted', ... (docs/results.md). Of load cases none of
        which is chosen: 'converged' where all are, or that of the first one that is not."""
        if self.cases and not self._is_chosen:
            ends = [self.case(name).status for name in self.cases]
            return next((end for end in ends if end != 'converged'), 'interrupted' if self._n_missing() else 'converged')
        return self.summary['status']

    @functools.cached_property
    def scene(self):
        """The Scene that was run, from the text of the namelist in the file."""
        return Scene.parse(self.run['input'], self.path + ' (input)')

    @functools.cached_property
    def bodies(self):
        """The bodies by name, in the order of the scene: {name: Body}. Of a body that a &bolt cuts both halves, 'name (1)' and 'name (2)'."""
        grid = self.file['VTKHDF']
        root = self.file['dotyk/cases'][self.cases[0]] if self.cases else self._root
        names = _plain(root['bodies'].attrs['names']).splitlines() if 'bodies' in root else [name for name, _ in self.scene.bodies()]
        ranges = []
        for what in ('Points', 'Cells', 'ConnectivityIds'):
            ends = np.cumsum(grid['NumberOf' + what][:]).tolist()
            ranges.append([slice(*ends) for ends in zip([0] + ends, ends)])
        if len(names) != len(ranges[0]):
            raise ValueError('%s: %d bodies in place of the %d of its input' % (self.path, len(ranges[0]), len(names)))
        return _Named({name: Body(grid, name, number, *parts, step=self._step) for number, (name, *parts) in enumerate(zip(names, *ranges), 1)},
                      '%s: no body' % self.path)

    @functools.cached_property
    def pairs(self):
        """The contact pairs by name: {name: Pair}. A / in a name is _ here; pairs that were found are called 'name: body - body'."""
        return _Named({name: Pair(group) for name, group in self._root.get('contact', {}).items()}, '%s: no contact pair' % self.path)

    @property
    def nodes(self):
        """Coordinates before deformation, all bodies one after another (n, 3) [length]."""
        return self.file['VTKHDF/Points'][:]

    def __getitem__(self, name):
        """A field of the nodes or cells of all bodies, one body after another."""
        grid = self.file['VTKHDF']
        for place in ('PointData', 'CellData'):
            if name in grid[place]:
                first = _first(grid, place, name, self._step)
                size = int(grid['NumberOfPoints' if place == 'PointData' else 'NumberOfCells'][:].sum())
                return grid[place][name][first:first + size]
        raise KeyError(_absent(grid, name))

    def __contains__(self, name):
        """Whether the file has a field of nodes or cells."""
        return any(name in self.file['VTKHDF'][place] for place in ('PointData', 'CellData'))

    def close(self):
        """Close the file; what was not read cannot be read any more."""
        self.file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        if self.file and self.cases and self.case_name is None:
            return "<results '%s': %d load cases>" % (self.path, len(self.cases))
        return "<results '%s': %s>" % (self.path, self.status if self.file else 'closed')
