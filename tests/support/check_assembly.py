"""An independent check of results files of linear or straight quadratic tetrahedra: forces and moments by the stiffness
of the elements, penetration of the deformed bodies by points in tetrahedra. Needs nothing of the program but the
file."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools" / "python"))
import dotyk  # noqa: E402

# VTK's tet10: corners, mids of 01 12 20 03 13 23; eight tetrahedra and the sub-facets of its faces
SPLIT = [(0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3), (4, 5, 6, 8), (4, 6, 7, 8), (6, 5, 9, 8), (6, 9, 7, 8)]
EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]


class Body:
    """Nodes, displacement, elements of a body."""

    def __init__(self, x, u, cells):
        self.x, self.u, self.cells = x, u, cells
        self.tets = cells if cells.shape[1] == 4 else cells[:, SPLIT].reshape(-1, 4)
        faces = np.concatenate([self.tets[:, f] for f in ([0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3])])
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        first = first[count == 1]
        self.facets = faces[first]
        self.opposite = np.concatenate([self.tets[:, k] for k in (3, 2, 0, 1)])[first]

    def normals(self):
        """Normals of the boundary's facets, outward, as long as their areas, doubled."""
        a, b, c = (self.x[self.facets[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        return np.where(np.einsum("fi,fi->f", normal, self.x[self.opposite] - a) > 0, -1, 1)[:, None] * normal

    def internal(self, young, poisson):
        """Forces of the stresses at the nodes, (n, 3): stiffness times displacement."""
        corners = self.x[self.cells[:, :4]]
        edges = corners[:, 1:] - corners[:, :1]
        volume = np.abs(np.linalg.det(edges)) / 6
        inverse = np.linalg.inv(edges)
        lambda_, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
        force = np.zeros_like(self.x)
        for weight, shape in shapes(self.cells.shape[1]):
            g = np.einsum("eij,nj->eni", inverse, shape)
            h = np.einsum("eni,enj->eij", self.u[self.cells], g)
            strain = (h + h.transpose(0, 2, 1)) / 2
            stress = 2 * mu * strain + lambda_ * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            np.add.at(force, self.cells, np.einsum("eij,enj,e->eni", stress, g, weight * volume))
        return force

    def weight(self, density):
        """Forces of a force density at the nodes."""
        corners = self.x[self.cells[:, :4]]
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
        share = [0.25] * 4 if self.cells.shape[1] == 4 else [-0.05] * 4 + [0.2] * 6
        force = np.zeros_like(self.x)
        np.add.at(force, self.cells, volume[:, None, None] * np.array(share)[:, None] * density)
        return force

    def on_plane(self, point, normal):
        """Nodes on a plane."""
        return np.abs((self.x - point) @ normal) < 1e-7

    def pressure(self, nodes, pressure):
        """Forces at the nodes of a pressure on the facets of some nodes (a planar face)."""
        force = np.zeros_like(self.x)
        if self.cells.shape[1] == 4:
            facets, share = self.facets, [1 / 3] * 3
        else:
            faces = np.concatenate([self.cells[:, f] for f in ([0, 1, 2, 4, 5, 6], [0, 1, 3, 4, 8, 7],
                                                               [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9])])
            facets, share = faces[nodes[faces].all(axis=1)], [0, 0, 0, 1 / 3, 1 / 3, 1 / 3]
        facets = facets[nodes[facets].all(axis=1)]
        a, b, c = (self.x[facets[:, k]] for k in range(3))
        area = np.cross(b - a, c - a) / 2
        inward = -np.sign(np.einsum("fi,fi->f", area, a - self.x.mean(axis=0)))[:, None] * area  # of convex bodies
        np.add.at(force, facets, pressure * inward[:, None, :] * np.array(share)[:, None])
        return force


class Pair:
    """Force on the first body of a contact pair; positions, normals and gaps before deformation of its active rows."""

    def __init__(self, pair):
        active = pair.pressure > 0
        self.force = pair.force
        self.position, self.normal, self.gap, self.weight, self.pressure = (pair[key][active] for key in (
            "position", "normal", "gap_initial", "weight", "pressure"))


def shapes(nodes):
    """[(weight, derivatives (nodes, 3) by the coordinates of the last three corners)] of a tetrahedron."""
    low = np.vstack([-np.ones(3), np.eye(3)])
    if nodes == 4:
        return [(1.0, low)]
    out = []
    for k in range(4):
        b = np.full(4, 0.1381966011250105)
        b[k] = 0.5854101966249685
        rows = [(4 * b[i] - 1) * low[i] for i in range(4)] + [4 * (b[i] * low[j] + b[j] * low[i]) for i, j in EDGES]
        out.append((0.25, np.array(rows)))
    return out


def read(path):
    """Bodies, pairs and summary of a results file."""
    with dotyk.Results(path) as results:
        bodies = [Body(body.nodes, body.displacement, body.cells[0].nodes) for body in results.bodies.values()]
        return bodies, {name: Pair(pair) for name, pair in results.pairs.items()}, results.summary.attributes


def samples(facets):
    """Points on triangles (n, 3, 3): corners, points of edges, points inside."""
    weights = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6
    return np.einsum("kc,fci->fki", weights, facets).reshape(-1, 3)


def inside(points, tets, least=-1e-12):
    """Which points are in a tetrahedron (m, 4, 3), its boundary included."""
    found = np.zeros(len(points), bool)
    edges = tets[:, 1:] - tets[:, :1]
    good = np.abs(np.linalg.det(edges)) > 1e-14
    tets, inverse = tets[good], np.linalg.inv(edges[good])
    low, high = tets.min(axis=1), tets.max(axis=1)
    for tet, inv, a, b in zip(tets, inverse, low, high):
        near = np.where(~found & np.all((points >= a) & (points <= b), axis=1))[0]
        if len(near):
            c = (points[near] - tet[0]) @ inv
            found[near] = (c.min(axis=1) > least) & (c.sum(axis=1) < 1 - least)
    return found


def distance(points, triangles):
    """Distances of points to the nearest of triangles (m, 3, 3) (Ericson, Real-Time Collision Detection, 5.1.5)."""
    best = np.full(len(points), np.inf)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal) or 1.0
        d = points - a
        height = d @ normal
        flat = points - height[:, None] * normal
        over = np.ones(len(points), bool)
        edge = np.full(len(points), np.inf)
        for p, q in ((a, b), (b, c), (c, a)):
            over &= np.cross(q - p, flat - p) @ normal >= 0
            s = np.clip((points - p) @ (q - p) / max((q - p) @ (q - p), 1e-300), 0, 1)
            edge = np.minimum(edge, np.linalg.norm(points - p - s[:, None] * (q - p), axis=1))
        best = np.minimum(best, np.where(over, np.abs(height), edge))
    return best


def depth(a, b, factor=1.0):
    """How deep points of one body are in the other, displacements multiplied by a factor."""
    most = 0.0
    xa, xb = a.x + factor * a.u, b.x + factor * b.u
    low, high = np.maximum(xa.min(axis=0), xb.min(axis=0)), np.minimum(xa.max(axis=0), xb.max(axis=0))
    if np.any(low > high):
        return 0.0
    edge = 1e-9 * np.abs(high).max()
    low, high = low - edge, high + edge
    for x, facets, y, other in ((xa, a.facets, xb, b), (xb, b.facets, xa, a)):
        triangles = x[facets]
        triangles = triangles[np.all((triangles.min(axis=1) <= high) & (triangles.max(axis=1) >= low), axis=1)]
        points = samples(triangles)
        points = points[np.all((points >= low) & (points <= high), axis=1)]
        points = points[inside(points, y[other.tets])] if len(points) else points
        if len(points):
            most = max(most, distance(points, y[other.facets]).max())
    return most
