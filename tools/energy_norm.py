#!/usr/bin/python3
"""Energy norms of results files: of a displacement, of a difference, of the error against exact stresses.

usage: tools/energy_norm.py FILE                     norm of the displacement, in all and of each body
       tools/energy_norm.py FILE --exact CHECK.py    norm of (stress - exact_stress), a function of CHECK.py (see below)
       tools/energy_norm.py FILE_1 FILE_2            norm of the difference of two runs; on two meshes the second is the finer one
           --cells OUT.npy                           write the norm on each cell, in the order of the (second) file

The norm is sqrt(int eps : C : eps dV), per unit thickness in the plane, over the full circle about the axis. As a library:

    energy_norm(file)                    norm of the displacement
    distance(file_1, file_2)             norm of the difference, same mesh
    distance_meshes(coarse, fine)        norm of u_coarse - u_fine by the quadrature of the fine mesh; orders may differ
    error(file, exact_stress)            norm of stress(u_h) - exact stress, in the norm of the compliance
    error(file, exact_strain=...)        the same for strains
with `cells=True` each gives (norm, norms of the cells). A file is a path, or Results(path, young=[...], poisson=[...]) where the
materials are not to be taken from the input text in the file; young and poisson are one number for each body.

exact_stress(x, y, z, body) gets arrays of the coordinates of many points and the number of the body (from 1), and gives an array
of 6 rows: xx yy zz xy yz xz as in the results file, or of 3: xx yy xy in plane strain and stress, or of 4: xx yy zz xy about the
axis (y is the axis, x the radius, zz the hoop). exact_strain is the same with tensor components (xy, not 2 xy).

Element kinds: all of dotyk's. Materials: isotropic, orthotropic, anisotropic; formulas of constants are refused.
"""
import argparse
import importlib.util
import itertools
import os
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), 'python'))
import dotyk  # noqa: E402

ANALYSES = ('3d', 'plane_strain', 'plane_stress', 'axisymmetric')
FILE_ORDER = [0, 1, 2, 5, 3, 4]  # xx yy zz xy yz xz of the results file from xx yy zz yz xz xy, which is used here
CHUNK = 100000


# Element kinds, with VTK's numbers and order of nodes

def middles(corners, edges):
    """Corners and then the means of these groups of corners."""
    return np.array(corners, float).tolist() + [np.mean([corners[i] for i in edge], axis=0).tolist() for edge in edges]


TRI, TET = [(0, 0), (1, 0), (0, 1)], [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
QUAD = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
HEX = [(*p, z) for z in (-1, 1) for p in QUAD]
PRISM = [(*p, z) for z in (-1, 1) for p in TRI]
PYRAMID = [(*p, 0) for p in QUAD] + [(0, 0, 1)]
TRI_EDGES, QUAD_EDGES = [(0, 1), (1, 2), (2, 0)], [(0, 1), (1, 2), (2, 3), (3, 0)]
TET_EDGES = TRI_EDGES + [(0, 3), (1, 3), (2, 3)]
HEX_EDGES = QUAD_EDGES + [(4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
HEX_FACES = [(0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 1, 2, 3), (4, 5, 6, 7), tuple(range(8))]
PRISM_EDGES = TRI_EDGES + [(3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
PRISM_FACES = [(0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
PYRAMID_EDGES = QUAD_EDGES + [(0, 4), (1, 4), (2, 4), (3, 4)]


def powers(dimension, largest, keep):
    """Exponents of the monomials up to this power in each direction that are kept."""
    return [p for p in itertools.product(range(largest + 1), repeat=dimension) if keep(p)]


def superlinear(p):
    """Degree of a monomial without its linear factors: at most 2 in the serendipity elements."""
    return sum(a for a in p if a > 1)


def gauss_jacobi(n, k):
    """Gauss points and weights on [0, 1] for the weight (1 - x)^k, from the eigenvalues of the recurrence."""
    i = np.arange(1, n)
    middle = np.concatenate([[-k/(k + 2)], -k**2/((2*i + k)*(2*i + k + 2))])
    beside = np.sqrt(4*i**2*(i + k)**2/((2*i + k)**2*((2*i + k)**2 - 1)))
    x, vectors = np.linalg.eigh(np.diag(middle) + np.diag(beside, 1) + np.diag(beside, -1))
    return (x + 1)/2, vectors[0]**2/(k + 1)


class Kind:
    """Shape functions of one kind of element: monomials, and their coefficients from the nodes."""

    def __init__(self, name, family, nodes, exponents):
        self.name, self.family, self.nodes = name, family, np.array(nodes, float)
        self.exponents = np.array(exponents)
        self.dimension = self.nodes.shape[1]
        self.order = self.exponents.max()
        self.coefficients = np.linalg.inv(self.monomials(self.nodes))

    def monomials(self, xi, derivative=None):
        """Monomials at the points xi (n, dimension), or their derivatives in one direction."""
        value = 1
        for k in range(self.dimension):
            x, one = xi[:, k], np.ones(len(xi))
            table = np.stack([0*one, one, 2*x] if k == derivative else [one, x, x*x], axis=1)
            value = value*table[:, self.exponents[:, k]]
        return value

    def shapes(self, xi):
        """Shape functions (n, nodes)."""
        return self.monomials(xi) @ self.coefficients

    def gradients(self, xi):
        """Their derivatives (n, nodes, dimension)."""
        return np.stack([self.monomials(xi, k) @ self.coefficients for k in range(self.dimension)], axis=2)

    def quadrature(self, n):
        """Points and weights on the reference element: Gauss, on simplices Gauss-Jacobi folded; exact to degree 2n - 1."""
        line = [gauss_jacobi(n, k) for k in range(3)]
        if self.family in ('quad', 'hex'):
            x, w = 2*line[0][0] - 1, 2*line[0][1]
            points = np.array(list(itertools.product(x, repeat=self.dimension)))
            return points, np.prod(np.array(list(itertools.product(w, repeat=self.dimension))), axis=1)
        if self.family == 'tet':
            rule = [(r, s*(1 - r), t*(1 - r)*(1 - s), a*b*c)
                    for r, a in zip(*line[2]) for s, b in zip(*line[1]) for t, c in zip(*line[0])]
        else:
            rule = [(r, s*(1 - r), a*b) for r, a in zip(*line[1]) for s, b in zip(*line[0])]
        if self.family == 'prism':
            rule = [(r, s, 2*t - 1, 2*a*c) for r, s, a in rule for t, c in zip(*line[0])]
        rule = np.array(rule)
        return rule[:, :-1], rule[:, -1]

    def outside(self, xi):
        """How far points are outside of the reference element; 0 or less inside."""
        if self.family in ('quad', 'hex'):
            return np.abs(xi).max(axis=1) - 1
        plane = xi[:, :2] if self.family == 'prism' else xi
        far = np.maximum((-plane).max(axis=1), plane.sum(axis=1) - 1)
        return np.maximum(far, (np.abs(xi[:, 2]) - 1)/2) if self.family == 'prism' else far

    def clamped(self, xi):
        """The points, those outside moved to the boundary."""
        if self.family in ('quad', 'hex'):
            return np.clip(xi, -1, 1)
        xi = xi.copy()
        plane = xi[:, :2] if self.family == 'prism' else xi
        np.maximum(plane, 0, out=plane)
        plane /= np.maximum(plane.sum(axis=1), 1)[:, None]
        if self.family == 'prism':
            xi[:, 2] = np.clip(xi[:, 2], -1, 1)
        return xi


class Pyramid(Kind):
    """A pyramid: monomials a^i b^j t^k of t = 1 - z, a = x/t, b = y/t."""

    def __init__(self, name, nodes, exponents):
        super().__init__(name, 'pyramid', nodes, exponents)

    def monomials(self, xi, derivative=None):
        """Monomials or derivatives, as of other kinds. At the apex, where a and b have no limit, derivatives are those on the axis."""
        t = 1 - xi[:, 2]
        above = np.maximum(t, 1e-9)
        ab = np.where((t > 0)[:, None], np.clip(xi[:, :2]/above[:, None], -2, 2), 0)
        if derivative is None:
            return super().monomials(np.column_stack([ab, t]))
        place = np.column_stack([ab, above])
        if derivative < 2:
            return super().monomials(place, derivative)/above[:, None]
        by_height = -super().monomials(place, 2)
        for k in range(2):
            by_height += ab[:, k, None]*super().monomials(place, k)/above[:, None]
        return by_height

    def quadrature(self, n):
        """Gauss on the squares, Gauss-Jacobi over the height."""
        x, w = gauss_jacobi(n, 0)
        rule = np.array([((1 - z)*(2*r - 1), (1 - z)*(2*s - 1), z, 4*a*b*c)
                         for z, c in zip(*gauss_jacobi(n, 2)) for r, a in zip(x, w) for s, b in zip(x, w)])
        return rule[:, :-1], rule[:, -1]

    def outside(self, xi):
        """How far points are outside of the reference element; 0 or less inside."""
        return np.maximum(-xi[:, 2], np.abs(xi[:, :2]).max(axis=1) + xi[:, 2] - 1)

    def clamped(self, xi):
        """The points, those outside moved to the boundary."""
        z = np.clip(xi[:, 2:], 0, 1)
        return np.hstack([np.clip(xi[:, :2], z - 1, 1 - z), z])


def prism_powers(keep):
    """Exponents for prisms: keep(degree in the triangle, degree along it)."""
    return powers(3, 2, lambda p: p[0] + p[1] <= 2 and keep(p[0] + p[1], p[2]))


def pyramid_powers(order):
    """Exponents for pyramids."""
    return powers(3, order, lambda p: max(p[:2]) <= p[2])


KINDS = {5: Kind('tri3', 'tri', TRI, powers(2, 1, lambda p: sum(p) <= 1)),
         22: Kind('tri6', 'tri', middles(TRI, TRI_EDGES), powers(2, 2, lambda p: sum(p) <= 2)),
         9: Kind('quad4', 'quad', QUAD, powers(2, 1, lambda p: True)),
         23: Kind('quad8', 'quad', middles(QUAD, QUAD_EDGES), powers(2, 2, lambda p: superlinear(p) <= 2 and sum(p) <= 3)),
         28: Kind('quad9', 'quad', middles(QUAD, QUAD_EDGES + [(0, 1, 2, 3)]), powers(2, 2, lambda p: True)),
         10: Kind('tet4', 'tet', TET, powers(3, 1, lambda p: sum(p) <= 1)),
         24: Kind('tet10', 'tet', middles(TET, TET_EDGES), powers(3, 2, lambda p: sum(p) <= 2)),
         12: Kind('hex8', 'hex', HEX, powers(3, 1, lambda p: True)),
         25: Kind('hex20', 'hex', middles(HEX, HEX_EDGES), powers(3, 2, lambda p: superlinear(p) <= 2)),
         29: Kind('hex27', 'hex', middles(HEX, HEX_EDGES + HEX_FACES), powers(3, 2, lambda p: True)),
         13: Kind('prism6', 'prism', PRISM, prism_powers(lambda a, b: a <= 1 and b <= 1)),
         26: Kind('prism15', 'prism', middles(PRISM, PRISM_EDGES), prism_powers(lambda a, b: b <= 1 or a <= 1)),
         32: Kind('prism18', 'prism', middles(PRISM, PRISM_EDGES + PRISM_FACES), prism_powers(lambda a, b: True)),
         14: Pyramid('pyramid5', PYRAMID, pyramid_powers(1)),
         27: Pyramid('pyramid13', middles(PYRAMID, PYRAMID_EDGES), [p for p in pyramid_powers(2) if p != (2, 2, 2)])}
# VTK has no cell of this kind: its last node, at the centre of the base, is in the results file a point without a cell
PYRAMID14 = Pyramid('pyramid14', middles(PYRAMID, PYRAMID_EDGES + [(0, 1, 2, 3)]), pyramid_powers(2))


# Materials

def isotropic(young, poisson):
    """Stiffness (6, 6), order xx yy zz yz xz xy with engineering shear strains."""
    lame, shear = young*poisson/((1 + poisson)*(1 - 2*poisson)), young/(2*(1 + poisson))
    stiffness = np.diag([2*shear]*3 + [shear]*3)
    stiffness[:3, :3] += lame
    return stiffness


def orthotropic(young, poisson, shear, axis_1, axis_2):
    """Stiffness in global axes from the moduli along the axes 1, 2, 3."""
    compliance = np.diag([1/e for e in young] + [1/shear[2], 1/shear[1], 1/shear[0]])
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), poisson):
        compliance[i, j] = compliance[j, i] = -ratio/young[i]
    return turned(np.linalg.inv(compliance), axis_1, axis_2)


def turned(stiffness, axis_1, axis_2):
    """A stiffness in global axes from that in the axes of the material."""
    one = np.array(axis_1, float)/np.linalg.norm(axis_1)
    two = np.array(axis_2, float) - np.dot(axis_2, one)*one
    two /= np.linalg.norm(two)
    axes = np.array([one, two, np.cross(one, two)])
    # strains in the material's axes from the global ones, both with engineering shear strains
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    turn = np.empty((6, 6))
    for column, (i, j) in enumerate(pairs):
        strain = np.zeros((3, 3))
        strain[i, j] = strain[j, i] = 1 if i == j else 0.5
        local = axes @ strain @ axes.T
        turn[:, column] = [local[p]*(1 if p[0] == p[1] else 2) for p in pairs]
    return turn.T @ stiffness @ turn


def stiffness_of(group):
    """The stiffness of a &material group."""
    for key in ('young_formula', 'poisson_formula', 'shear_formula', 'stiffness_formula'):
        if key in group:
            group.fail('energy_norm does not evaluate ' + key, key)
    axes = group.get('axis_1', [1, 0, 0]), group.get('axis_2', [0, 1, 0])
    if 'stiffness' in group:
        stiffness = np.zeros((6, 6))
        stiffness[np.triu_indices(6)] = group['stiffness']
        return turned(stiffness + np.triu(stiffness, 1).T, *axes)
    young, poisson = group['young'], group['poisson']
    return isotropic(young, poisson) if np.isscalar(young) else orthotropic(young, poisson, group['shear'], *axes)


# Results files

class Block:
    """The cells of one kind of one body: their numbers in the file, nodes (n, nodes), kind, body (from 1)."""

    def __init__(self, kind, body, cells, nodes):
        self.kind, self.body, self.cells, self.nodes = kind, body, cells, nodes


class Results:
    """Mesh, displacement and materials of a results file. young, poisson: numbers for each body, or one for all."""

    def __init__(self, path, young=None, poisson=None, analysis=None):
        with dotyk.Results(path) as file:
            self.path, scene, self.blocks = file.path, file.scene, []
            if 'displacement' not in file:
                raise ValueError("%s: no displacement; ask for it in &output fields" % self.path)
            self.points, self.displacement = file.nodes, file['displacement']
            for body in file.bodies.values():
                for cells in body.cells:
                    if cells.type not in KINDS:
                        raise ValueError('%s: cells of the unknown type %d' % (self.path, cells.type))
                    self.blocks.append(Block(KINDS[cells.type], body.number, cells.numbers + body.cell_range.start,
                                             cells.nodes + body.node_range.start))
        self.complete_pyramids(np.concatenate([block.nodes.ravel() for block in self.blocks]))
        self.n_cells = sum(len(block.cells) for block in self.blocks)
        self.body_names = [name for name, _ in scene.bodies()]
        self.n_bodies = len(self.body_names)
        self.analysis = analysis or scene.find('scene').get('analysis', '3d')
        if self.analysis not in ANALYSES:
            raise ValueError('%s: analysis %r' % (self.path, self.analysis))
        if young is not None:
            pairs = zip(np.broadcast_to(young, self.n_bodies), np.broadcast_to(poisson, self.n_bodies))
            self.stiffness = [isotropic(e, v) for e, v in pairs]
        else:
            for _, group in scene.bodies():
                if not isinstance(group['material'], str):
                    group.fail('energy_norm knows bodies of one material', 'material')
            self.stiffness = [stiffness_of(scene.find('material', name=group['material'])) for _, group in scene.bodies()]
        self.dimension = 3 if self.analysis == '3d' else 2
        self.rows = {'3d': [0, 1, 2, 3, 4, 5], 'axisymmetric': [0, 1, 2, 5]}.get(self.analysis, [0, 1, 5])

    def complete_pyramids(self, of_cells):
        """Pyramids of 14 nodes, whose last node no cell has, or another cell on their base."""
        alone = np.setdiff1d(np.arange(len(self.points)), of_cells)
        for i, block in enumerate(self.blocks):
            if block.kind.name != 'pyramid13':
                continue
            faces = [other.nodes[:, {'hex27': slice(20, 26), 'prism18': slice(15, 18)}[other.kind.name]].ravel()
                     for other in self.blocks if other.body == block.body and other.kind.name in ('hex27', 'prism18')]
            centres = np.concatenate([alone, *faces])
            if not len(centres):
                continue
            from scipy.spatial import cKDTree
            base = self.points[block.nodes[:, [0, 1, 2, 3, 5, 6, 7, 8]]]
            # where functions of eight nodes are, at the centre of the base
            middle = base[:, 4:].mean(axis=1)*2 - base[:, :4].mean(axis=1)
            away, nearest = cKDTree(self.points[centres]).query(middle)
            found = away < 0.1*np.linalg.norm(base[:, 2] - base[:, 0], axis=1)
            if found.all():
                self.blocks[i] = Block(PYRAMID14, block.body, block.cells, np.column_stack([block.nodes, centres[nearest]]))
            elif found.any():
                raise ValueError('%s: body %d has pyramids of 13 and of 14 nodes' % (self.path, block.body))

    def elasticity(self, body):
        """Stiffness of a body for the strains of the analysis: all six, or xx yy (zz) xy."""
        full = self.stiffness[body - 1]
        if self.analysis == 'plane_stress':
            return np.linalg.inv(np.linalg.inv(full)[np.ix_(self.rows, self.rows)])
        return full[np.ix_(self.rows, self.rows)]

    def chunks(self):
        """The blocks in pieces that fit the memory."""
        for block in self.blocks:
            for some in np.array_split(np.arange(len(block.cells)), len(block.cells)//CHUNK + 1):
                if len(some):
                    yield Block(block.kind, block.body, block.cells[some], block.nodes[some])


def opened(file):
    """Results of a path, or as they are."""
    return file if isinstance(file, Results) else Results(file)


def strain_of(results, gradient, radius, radial):
    """Strains (n, rows), engineering shear, from the gradients of the displacement (n, i, k) = du_i/dx_k."""
    h = gradient
    if results.analysis == '3d':
        return np.stack([h[:, 0, 0], h[:, 1, 1], h[:, 2, 2], h[:, 1, 2] + h[:, 2, 1], h[:, 0, 2] + h[:, 2, 0],
                         h[:, 0, 1] + h[:, 1, 0]], axis=1)
    columns = [h[:, 0, 0], h[:, 1, 1], h[:, 0, 1] + h[:, 1, 0]]
    if results.analysis == 'axisymmetric':
        columns.insert(2, radial/radius)
    return np.stack(columns, axis=1)


def inverse(matrix):
    """Inverses of many matrices of two or three rows (n, d, d). (numpy wakes all threads of its BLAS for each.)"""
    a = matrix.transpose(2, 0, 1)
    if len(a) == 2:
        rows = [np.stack([a[1][:, 1], -a[1][:, 0]], axis=1), np.stack([-a[0][:, 1], a[0][:, 0]], axis=1)]
    else:
        rows = [np.cross(a[1], a[2]), np.cross(a[2], a[0]), np.cross(a[0], a[1])]
    return np.stack(rows, axis=1)/np.einsum('ni,ni->n', a[0], rows[0])[:, None, None]


def integrate(results, n, integrand, displacement=None, cells=False):
    """sqrt of the sum over the quadrature points of integrand(block, x, strain) times the weight; n Gauss points a direction.

    integrand gives the energy density (n) from positions (n, 3) and strains (n, rows) at one quadrature point of many cells.
    """
    d, squares = results.dimension, np.zeros(results.n_cells)
    values = results.displacement if displacement is None else displacement
    for block in results.chunks():
        x, u = results.points[block.nodes], values[block.nodes][:, :, :d]
        xi, weights = block.kind.quadrature(n)
        for shape, slope, weight in zip(block.kind.shapes(xi), block.kind.gradients(xi), weights):
            jacobian = x[:, :, :d].transpose(0, 2, 1) @ slope
            size = weight*np.abs(np.linalg.det(jacobian))
            gradient = u.transpose(0, 2, 1) @ slope @ inverse(jacobian)
            position = np.einsum('cni,n->ci', x, shape)
            if results.analysis == 'axisymmetric':
                size *= 2*np.pi*position[:, 0]
            strain = strain_of(results, gradient, position[:, 0], np.einsum('cn,n->c', u[:, :, 0], shape))
            squares[block.cells] += size*integrand(block, position, strain)
    squares = np.maximum(squares, 0)
    return (np.sqrt(squares.sum()), np.sqrt(squares)) if cells else np.sqrt(squares.sum())


def energy_density(results, block, strain):
    """eps : C : eps at many points."""
    return np.einsum('ci,ij,cj->c', strain, results.elasticity(block.body), strain)


def energy_norm(file, displacement=None, cells=False, n=3):
    """Energy norm of the displacement of a results file, or of another displacement (nodes, 3) on its mesh."""
    results = opened(file)
    return integrate(results, n, lambda block, _, strain: energy_density(results, block, strain), displacement, cells)


def same_mesh(one, two):
    """Whether two results are on the same mesh."""
    return (one.points.shape == two.points.shape and len(one.blocks) == len(two.blocks)
            and all(a.kind is b.kind and np.array_equal(a.cells, b.cells) and np.array_equal(a.nodes, b.nodes)
                    for a, b in zip(one.blocks, two.blocks))
            and np.allclose(one.points, two.points, rtol=0, atol=1e-12*np.ptp(one.points, axis=0).max()))


def distance(file_1, file_2, cells=False, n=3):
    """Energy norm of the difference of the displacements of two runs on the same mesh."""
    one, two = opened(file_1), opened(file_2)
    if not same_mesh(one, two):
        raise ValueError('%s and %s are on different meshes' % (one.path, two.path))
    return energy_norm(one, one.displacement - two.displacement, cells, n)


def components(results, tensor, shear):
    """What the user gave (6, 4 or 3 rows in the file's order) as (n, rows) in the order used here; shear times `shear`."""
    tensor = np.array(tensor, float)
    if len(tensor) == 6:
        tensor = np.stack([tensor[FILE_ORDER.index(row)] for row in results.rows])
    elif len(tensor) != len(results.rows):
        raise ValueError('exact tensors have 6 rows, or %d for %s, not %d' % (len(results.rows), results.analysis, len(tensor)))
    tensor[[i for i, row in enumerate(results.rows) if row > 2]] *= shear
    return tensor.T


def error(file, exact_stress=None, exact_strain=None, cells=False, n=4):
    """Energy norm of the error against exact stresses (or strains), a function of (x, y, z, body) as told above.

    From an exact stress with sqrt-type ends or singular points only what n Gauss points a direction see is counted.
    """
    results = opened(file)

    def integrand(block, x, strain):
        given = (exact_stress or exact_strain)(x[:, 0], x[:, 1], x[:, 2], block.body)
        if exact_stress is not None:
            exact = components(results, given, 1) @ np.linalg.inv(results.elasticity(block.body))
        else:
            exact = components(results, given, 2)
        return energy_density(results, block, strain - exact)

    return integrate(results, n, integrand, cells=cells)


# Another mesh

class Locator:
    """Finds points in the cells of one body."""

    def __init__(self, results, body):
        from scipy.spatial import cKDTree
        self.results = results
        self.blocks = [block for block in results.blocks if block.body == body]
        d = results.dimension
        nodes = [results.points[block.nodes][:, :, :d] for block in self.blocks]
        centres = [x.mean(axis=1) for x in nodes]
        self.start = np.cumsum([0] + [len(c) for c in centres])
        self.radius = np.concatenate([np.linalg.norm(x - c[:, None], axis=2).max(axis=1) for x, c in zip(nodes, centres)])
        self.tree = cKDTree(np.concatenate(centres))

    def local(self, block, cells, x):
        """Local coordinates of x in these cells (Newton's method, damped to a neighbourhood of the cell)."""
        d = self.results.dimension
        nodes = self.results.points[block.nodes[cells]][:, :, :d]
        xi = np.repeat(block.kind.nodes.mean(axis=0)[None], len(x), axis=0)
        for _ in range(20):
            rest = x - np.einsum('cni,cn->ci', nodes, block.kind.shapes(xi))
            jacobian = nodes.transpose(0, 2, 1) @ block.kind.gradients(xi)
            # a Jacobian of zero, far outside of a curved cell, gives no step
            bad = np.linalg.det(jacobian) == 0
            jacobian[bad], rest[bad] = np.eye(d), 0
            step = np.linalg.solve(jacobian, rest[:, :, None])[:, :, 0]
            xi = np.clip(xi + step, -3, 3)
            if np.abs(step).max() < 1e-10:
                break
        return xi

    def strain(self, x, most=48):
        """Strains (n, rows) at the points x (n, 3) in the cell that holds each, or the one that it is nearest to."""
        results, d = self.results, self.results.dimension
        n, tried = len(x), 0
        best, where, local = np.full(n, np.inf), np.zeros(n, int), np.zeros((n, d))
        most = min(most, self.start[-1])
        todo = np.arange(n)
        # More and more neighbours; at last only for points that are far from every cell so far.
        for k, close in ((min(4, most), 1e-8), (min(16, most), 1e-8), (most, 0.1)):
            todo = todo[best[todo] > close]
            if not len(todo) or k <= tried:
                continue
            away, near = (a.reshape(len(todo), k) for a in self.tree.query(x[todo, :d], k))
            for column in range(tried, k):
                left = (best[todo] > close) & ((column == 0) | (away[:, column] < 1.2*self.radius[near[:, column]]))
                for block, first, last in zip(self.blocks, self.start, self.start[1:]):
                    mine = np.flatnonzero(left & (near[:, column] >= first) & (near[:, column] < last))
                    if not len(mine):
                        continue
                    which = todo[mine]
                    xi = self.local(block, near[mine, column] - first, x[which, :d])
                    far = block.kind.outside(xi)
                    better = far < best[which]
                    which = which[better]
                    best[which], where[which], local[which] = far[better], near[mine[better], column], xi[better]
            tried = k
        strain = np.empty((n, len(results.rows)))
        for block, first, last in zip(self.blocks, self.start, self.start[1:]):
            mine = np.flatnonzero((where >= first) & (where < last))
            if not len(mine):
                continue
            xi, nodes = block.kind.clamped(local[mine]), block.nodes[where[mine] - first]
            slope, u = block.kind.gradients(xi), results.displacement[nodes][:, :, :d]
            jacobian = results.points[nodes][:, :, :d].transpose(0, 2, 1) @ slope
            gradient = u.transpose(0, 2, 1) @ slope @ inverse(jacobian)
            radial = np.einsum('cn,cn->c', u[:, :, 0], block.kind.shapes(xi))
            strain[mine] = strain_of(results, gradient, x[mine, 0], radial)
        return strain


def distance_meshes(coarse, fine, cells=False, n=2):
    """Energy norm of u_coarse - u_fine, integrated on the fine mesh; the bodies correspond by their numbers.

    Points of the fine mesh that lie outside of the coarse one (its boundary is less round) take the strain of the nearest place.
    """
    coarse, fine = opened(coarse), opened(fine)
    if coarse.n_bodies != fine.n_bodies or coarse.analysis != fine.analysis:
        raise ValueError('%s and %s are of different scenes' % (coarse.path, fine.path))
    locators = {}

    def integrand(block, x, strain):
        if block.body not in locators:
            locators[block.body] = Locator(coarse, block.body)
        return energy_density(fine, block, strain - locators[block.body].strain(x))

    return integrate(fine, n, integrand, cells=cells)


def load(path):
    """A python file as a module."""
    spec = importlib.util.spec_from_file_location('check', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main():
    """Parse and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('files', nargs='+', metavar='FILE', help='one or two results files')
    parser.add_argument('--exact', metavar='CHECK.py', help='its exact_stress(x, y, z, body) is the exact solution')
    parser.add_argument('--cells', metavar='OUT.npy', help='write the norm on each cell')
    options = parser.parse_args()
    if len(options.files) > 2 or options.exact and len(options.files) > 1:
        parser.error('one file, or two without --exact')
    try:
        results = [Results(path) for path in options.files]
        norm, parts = energy_norm(results[-1], cells=True)
        print('energy norm        %.10g' % norm)
        for block_body in sorted({block.body for block in results[-1].blocks}):
            mine = np.concatenate([block.cells for block in results[-1].blocks if block.body == block_body])
            print('  body %-12s %.10g' % (results[-1].body_names[block_body - 1], np.sqrt(np.sum(parts[mine]**2))))
        if options.exact:
            found, parts = error(results[0], load(options.exact).exact_stress, cells=True)
            print('error              %.6e\nrelative           %.6e' % (found, found/norm))
        elif len(results) == 2:
            function = distance if same_mesh(*results) else distance_meshes
            found, parts = function(*results, cells=True)
            print('distance           %.6e\nrelative           %.6e' % (found, found/norm))
        if options.cells:
            np.save(options.cells, parts)
    except (OSError, KeyError, ValueError, AttributeError) as reason:
        sys.exit('energy_norm: %s' % reason)


if __name__ == '__main__':
    main()
