"""Stiffness matrices of the bodies of a run, for the reference of benchmarks/speed.py: independent of how dotyk makes them.

bodies(results) reads the meshes that a results file holds; stiffness(body, young, poisson, fixed) is the lower triangle of the
matrix without the unknowns of the supports; write(path, matrix) stores it for cholmod_reference.
"""
import os
import sys

import numpy as np
import scipy.sparse

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '../tools/python'))
import dotyk  # noqa: E402

GAUSS = np.sqrt(0.6)*np.array([-1, 0, 1]), np.array([5, 8, 5])/9


def shape_tri6(xi):
    """Derivatives (points, 6, 2) on a triangle: corners, then the edges 01, 12, 20."""
    return simplex(xi, [(0, 1), (1, 2), (2, 0)])


def shape_tet10(xi):
    """Derivatives (points, 10, 3) on a tetrahedron: corners, then the edges as in VTK."""
    return simplex(xi, [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])


def simplex(xi, edges):
    """Derivatives of the quadratic functions l (2 l - 1) of the corners and 4 l m of the edges."""
    n = xi.shape[1] + 1
    value = np.column_stack([1 - xi.sum(axis=1), xi])
    slope = np.vstack([-np.ones(n - 1), np.eye(n - 1)])
    corners = [(4*value[:, [a]] - 1)*slope[a] for a in range(n)]
    middles = [4*(value[:, [a]]*slope[b] + value[:, [b]]*slope[a]) for a, b in edges]
    return np.stack(corners + middles, axis=1)


def shape_hex20(xi):
    """Derivatives (points, 20, 3) on a hexahedron: corners, then the edges as in VTK."""
    corner = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    node = np.array([*corner, *[(corner[a] + corner[b])/2 for a, b in edges]])
    found = np.zeros((len(xi), 20, 3))
    for k, place in enumerate(node):
        factor = 1 + xi*place
        middle = np.flatnonzero(place == 0)
        if len(middle):
            factor[:, middle] = 1 - xi[:, middle]**2
        slope = np.broadcast_to(place, xi.shape).copy()
        slope[:, middle] = -2*xi[:, middle]
        product = factor.prod(axis=1)
        others = np.stack([np.delete(factor, i, axis=1).prod(axis=1) for i in range(3)], axis=1)
        if len(middle):
            found[:, k] = slope*others/4
        else:
            total = xi @ place - 2
            found[:, k] = (slope*others*total[:, None] + product[:, None]*place)/8
    return found


def tensor_rule():
    """27 Gauss points."""
    x, w = GAUSS
    points = np.stack(np.meshgrid(x, x, x, indexing='ij'), axis=-1).reshape(-1, 3)
    return points, np.einsum('i,j,k->ijk', w, w, w).ravel()


TETRAHEDRON = 0.1381966011250105 + 0.4472135954999580*np.vstack([np.zeros(3), np.eye(3)]), np.full(4, 1/24)
TRIANGLE = np.array([[1/6, 1/6], [2/3, 1/6], [1/6, 2/3]]), np.full(3, 1/6)
KINDS = {22: (6, 2, shape_tri6, TRIANGLE), 24: (10, 3, shape_tet10, TETRAHEDRON), 25: (20, 3, shape_hex20, tensor_rule())}


def bodies(results):
    """Coordinates (nodes, 3), VTK's type and connectivity (elements, nodes) of each body in a results file."""
    with dotyk.Results(results) as file:
        for body in file.bodies.values():
            kinds = [cells.type for cells in body.cells]
            if len(kinds) != 1 or kinds[0] not in KINDS:
                raise ValueError('%s: elements of the types %s; only %s are known' % (results, kinds, sorted(KINDS)))
            yield body.nodes, kinds[0], body.cells[0].nodes


def stiffness(points, kind, element, young, poisson, fixed):
    """Lower triangle of the stiffness (plane strain in the plane) by columns; fixed (nodes, dimension): not unknowns."""
    n_nodes, dimension, shape, (xi, weight) = KINDS[kind]
    lame = young*poisson/((1 + poisson)*(1 - 2*poisson))
    shear = young/(2*(1 + poisson))
    number = np.full(fixed.shape, -1, dtype=np.int64)
    number[~fixed] = np.arange(np.count_nonzero(~fixed))
    total, chunk = None, max(1, 8_000_000//(n_nodes*dimension)**2)
    for first in range(0, len(element), chunk):
        part = element[first:first + chunk]
        local = np.zeros((len(part), n_nodes, dimension, n_nodes, dimension))
        for slope, w in zip(shape(xi), weight):
            jacobian = np.einsum('eai,aj->eij', points[part, :dimension], slope)
            g = np.einsum('aj,eji->eai', slope, np.linalg.inv(jacobian))
            w = w*np.linalg.det(jacobian)
            if np.any(w <= 0):
                raise ValueError('an inverted element')
            outer = np.einsum('e,eai,ebj->eaibj', w, g, g)
            local += lame*outer + shear*outer.transpose(0, 1, 4, 3, 2)
            dot = shear*np.einsum('eaibi->eab', outer)
            for i in range(dimension):
                local[:, :, i, :, i] += dot
        unknown = number[part].reshape(len(part), -1)
        row, column = np.broadcast_arrays(unknown[:, :, None], unknown[:, None, :])
        keep = (column >= 0) & (row >= column)
        n = number.max() + 1
        more = scipy.sparse.coo_matrix((local.reshape(row.shape)[keep], (row[keep], column[keep])), shape=(n, n)).tocsc()
        total = more if total is None else total + more
    total.sort_indices()
    return total


def write(path, matrix):
    """Store a lower triangle for cholmod_reference."""
    with open(path, 'wb') as file:
        np.array([matrix.shape[0], matrix.nnz], dtype=np.int64).tofile(file)
        matrix.indptr.astype(np.int64).tofile(file)
        matrix.indices.astype(np.int64).tofile(file)
        matrix.data.astype(np.float64).tofile(file)
