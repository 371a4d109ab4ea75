"""Exact pressures on the mesh of a contact surface, for scripts that compare results with theory. Needs h5py and numpy.

With discretization='mortar' the pressure of row i is a mean, (integral of p phi_i)/w_i, phi_i the linear shape function of a vertex of
surface_a and w_i its integral. On curved or coarse meshes a mean is not the value at the vertex, so theory is taken to the rows
here: `means` are the rows that an exact pressure would have, and `projection` is the function of the shape functions nearest to a
given one in the mean square. As (integral of p f) = (integral of p times the projection of f) + (the product of two small errors),
    sum_i w_i p_i f_i,   f = surface.projection(f),
is the integral of p f to a higher order than with values f_i at the vertices.
"""
import numpy as np

from .results import Results

# Corners and mid nodes of the facets of an element in VTK's order of nodes, by VTK's number of the element.
FACETS = {5: [(0, 1), (1, 2), (2, 0)], 9: [(0, 1), (1, 2), (2, 3), (3, 0)],
          22: [(0, 1, 3), (1, 2, 4), (2, 0, 5)], 23: [(0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7)],
          10: [(0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
          24: [(0, 1, 2, 4, 5, 6), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9)],
          13: [(0, 1, 2), (3, 4, 5)], 26: [(0, 1, 2, 6, 7, 8), (3, 4, 5, 9, 10, 11)]}
FACETS[28] = FACETS[23]
PLANE = (5, 9, 22, 23, 28)


class ContactSurface:
    """The rows of a pair (position, weight, pressure, projected, force) and the facets of surface_a around them.

    Facets are lines in two dimensions, triangles in three. `body` is the number of surface_a's body in the scene, from 0.
    """

    def __init__(self, path, pair, body=0, axisymmetric=False, n_gauss=12):
        with Results(path) as results:
            rows, body = results.pairs[pair], list(results.bodies.values())[body]
            self.position, self.weight, self.pressure, self.projected = rows.position, rows.weight, rows.pressure, rows.pressure_projected
            self.force, self.converged, points = rows.force, results.converged, body.nodes
            facet, n_corners = body_facets(body)
        self.row = self.rows_at(points[facet[:, :n_corners]])
        self.row, facet = self.row[(self.row >= 0).all(1)], facet[(self.row >= 0).all(1)]
        self.shape, self.at, self.measure = quadrature(points[facet], n_corners, n_gauss)
        if axisymmetric:
            self.measure = self.measure*2*np.pi*self.at[:, :, 0]

    def rows_at(self, x):
        """Numbers of the rows at points, -1 where there is none."""
        size = 1e-7*np.ptp(self.position, axis=0).max()
        number = {tuple(key): i for i, key in enumerate(np.round(self.position/size).astype(np.int64))}
        keys = np.round(x.reshape(-1, 3)/size).astype(np.int64)
        return np.array([number.get(tuple(key), -1) for key in keys]).reshape(x.shape[:-1])

    def moments(self, function):
        """Integrals of a function of the positions (..., 3) with the shape functions of the rows."""
        out = np.zeros(len(self.weight))
        np.add.at(out, self.row, np.einsum('fg,gk->fk', function(self.at)*self.measure, self.shape))
        return out

    def means(self, function):
        """The rows of a function: its moments over the weights."""
        return self.moments(function)/self.weight

    def projection(self, function):
        """Values at the vertices of the nearest combination of the shape functions in the mean square."""
        local = np.einsum('fg,gj,gk->fjk', self.measure, self.shape, self.shape)
        mass = np.zeros(2*self.weight.shape)
        np.add.at(mass, (self.row[:, :, None], self.row[:, None, :]), local)
        return np.linalg.solve(mass, self.moments(function))



def hertz_radius_and_peak(surface, pressure):
    """Contact radius a and peak pressure p0 of the rows of a pressure that is axisymmetric or nearly so (about x = y = 0, in two
    dimensions about x = 0); nothing is taken from Hertz's theory but the form sqrt(1 - r^2/a^2) of the pressure.

    a: the integral of p r^2 is 2/5 a^2 times that of p. All rows count, none is chosen.
    p0: the force on the rows within a/2, over what it is for p0 = 1.
    """
    force = surface.weight*pressure
    a = np.sqrt(2.5*np.sum(force*surface.projection(lambda x: distance(surface, x)**2))/np.sum(force))
    inside = distance(surface, surface.position) < a/2
    unit = surface.weight*surface.means(lambda x: hertz_profile(distance(surface, x)/a))
    return a, np.sum(force[inside])/np.sum(unit[inside])


def hertz_profile(s):
    """sqrt(1 - s^2), and 0 beyond s = 1."""
    return np.sqrt(np.maximum(0, 1 - s*s))


def distance(surface, x):
    """Distance of points (..., 3) from the axis."""
    return np.abs(x[..., 0]) if surface.row.shape[1] == 2 else np.hypot(x[..., 0], x[..., 1])


def body_facets(body):
    """The facets on the boundary of a body as node numbers (n, nodes of a facet), and how many of these are corners."""
    cells = body.cells
    facet = np.concatenate([kind.nodes[:, nodes] for kind in cells for nodes in FACETS[kind.type]])
    _, index, count = np.unique(np.sort(facet, axis=1), axis=0, return_index=True, return_counts=True)
    return facet[index[count == 1]], 2 if cells[0].type in PLANE else 3


def quadrature(x, n_corners, n):
    """Linear shape functions (g, corners), points (f, g, 3) and areas (f, g) at Gauss points of facets with nodes x (f, nodes, 3)."""
    t, w = np.polynomial.legendre.leggauss(n)
    t, w = (t + 1)/2, w/2
    if n_corners == 2:
        shape = np.column_stack([1 - t, t])
        gradient = [np.array([[-1, 1]])]
        edges = [(0, 1)]
    else:
        first, second = [v.ravel() for v in np.meshgrid(t, t)]
        w = (np.outer(w, w)*(1 - t)).ravel()
        shape = np.column_stack([1 - first - second*(1 - first), first, second*(1 - first)])
        gradient = [np.array([[-1, 1, 0]]), np.array([[-1, 0, 1]])]
        edges = [(0, 1), (1, 2), (2, 0)]
    values, slopes = shape, [np.broadcast_to(g, shape.shape) for g in gradient]
    if x.shape[1] > n_corners:  # quadratic: corners l (2 l - 1), mid nodes 4 l m
        values = np.column_stack([shape*(2*shape - 1)] + [4*shape[:, i]*shape[:, j] for i, j in edges])
        slopes = [np.column_stack([(4*shape - 1)*g] + [4*(shape[:, i]*g[:, j] + shape[:, j]*g[:, i]) for i, j in edges])
                  for g in slopes]
    tangent = [np.einsum('gk,fkd->fgd', s, x) for s in slopes]
    area = np.linalg.norm(tangent[0] if n_corners == 2 else np.cross(*tangent), axis=2)
    return shape, np.einsum('gk,fkd->fgd', values, x), area*w
