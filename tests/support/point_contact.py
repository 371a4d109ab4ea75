"""Bodies of linear elements that touch in one point: the discrete solution by dense linear algebra, as a reference.

The condition is that a point of body a and a point of body b, given as means of nodes, do not pass each other along a
normal. All supports fix all directions.
"""
import numpy as np

GAUSS = (-1 / np.sqrt(3), 1 / np.sqrt(3))


def elasticity(young, poisson, d):
    """Matrix of Hooke's law: xx yy (zz yz xz) xy with shear angles; in the plane, plane strain."""
    c = np.zeros((6, 6))
    c[:3, :3] = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    c[range(3), range(3)] += young / (1 + poisson)
    c[range(3, 6), range(3, 6)] = young / (2 * (1 + poisson))
    return c if d == 3 else c[np.ix_([0, 1, 5], [0, 1, 5])]


def gradients(kind):
    """Weights of the quadrature points, and derivatives of the shape functions there (points, nodes, d)."""
    if kind in ("tri3", "tet4"):
        d = 2 if kind == "tri3" else 3
        return [1 / (2 if d == 2 else 6)], [np.vstack([-np.ones(d), np.eye(d)])]
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    if kind == "hex8":
        corner = np.array([(*c, z) for z in (-1, 1) for c in corner])
    d = corner.shape[1]
    points = np.stack(np.meshgrid(*[GAUSS] * d), axis=-1).reshape(-1, d)
    shapes = []
    for point in points:
        factor = 1 + corner * point
        shapes.append(np.stack([corner[:, i] * np.delete(factor, i, 1).prod(axis=1) / 2**d for i in range(d)], axis=1))
    return np.ones(len(points)), shapes


def stiffness(mesh, young, poisson):
    """Stiffness matrix (n d, n d)."""
    d, law = mesh.d, elasticity(young, poisson, mesh.d)
    k = np.zeros((mesh.x.size, mesh.x.size))
    weights, shapes = gradients(mesh.kind)
    shear = [(1, 2), (0, 2), (0, 1)] if d == 3 else [(0, 1)]
    for cell in mesh.cells:
        x, dof = mesh.x[cell], (cell[:, None] * d + np.arange(d)).ravel()
        for weight, shape in zip(weights, shapes):
            jacobian = shape.T @ x
            g = shape @ np.linalg.inv(jacobian).T
            b = np.zeros((d + len(shear), len(cell), d))
            b[range(d), :, range(d)] = g.T
            for row, (i, j) in enumerate(shear, d):
                b[row, :, i], b[row, :, j] = g[:, j], g[:, i]
            b = b.reshape(len(b), -1)
            k[np.ix_(dof, dof)] += weight * abs(np.linalg.det(jacobian)) * b.T @ law @ b
    return k


class Body:
    """A body with its supports: [(patch, displacement)]."""

    def __init__(self, mesh, young, poisson, supports):
        self.mesh, d = mesh, mesh.d
        u = np.full(mesh.x.shape, np.nan)
        for patch, value in supports:
            for facet in mesh.patches[patch]:
                u[facet] = value
        self.u, self.free = u.ravel(), np.isnan(u.ravel())
        self.held = ~self.free
        k = stiffness(mesh, young, poisson)
        self.k = k[np.ix_(self.free, self.free)]
        self.load = -k[np.ix_(self.free, self.held)] @ self.u[self.held]
        self.u[self.free] = np.linalg.solve(self.k, self.load)
        self.d = d

    def row(self, nodes, weights, normal):
        """The row of the displacement of a point along a normal, over all unknowns."""
        row = np.zeros_like(self.u)
        for node, weight in zip(nodes, weights):
            row[node * self.d:(node + 1) * self.d] += weight * np.asarray(normal, float)[:self.d]
        return row


def touch(a, b, gap, normal, point_a, point_b):
    """Solve two bodies with one contact: point_a, point_b are (nodes, weights), normal points from a to b.

    Returns the force and the displacements (nodes, d) of both bodies.
    """
    rows = [a.row(*point_a, normal), -b.row(*point_b, normal)]
    columns = [np.linalg.solve(body.k, row[body.free]) for body, row in zip((a, b), rows)]
    approach = sum(row @ body.u for body, row in zip((a, b), rows)) - gap
    force = max(0.0, approach / sum(row[body.free] @ c for body, row, c in zip((a, b), rows, columns)))
    out = []
    for body, column in zip((a, b), columns):
        u = body.u.copy()
        u[body.free] -= force * column
        out.append(u.reshape(-1, body.d))
    return force, out[0], out[1]


def surface_point(mesh, patch, x):
    """Nodes and weights of a point of a patch of axis-parallel rectangles, or lines in two dimensions."""
    x = np.asarray(x, float)
    for facet in mesh.patches[patch]:
        low, high = mesh.x[facet].min(axis=0), mesh.x[facet].max(axis=0)
        if np.all(x >= low - 1e-12) and np.all(x <= high + 1e-12):
            along = high > low
            weights = [np.prod(1 - np.abs(x - mesh.x[node])[along] / (high - low)[along]) for node in facet]
            return list(facet), weights
    raise ValueError("no facet there")
