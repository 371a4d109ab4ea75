"""Assemblies for tests and studies: meshes on grids with named patches, scenes that are turned as a whole, answers
turned back.

A patch is a part of the boundary that would be one face of a CAD body; groups are unions of patches. Patches have an
elementary entity of their own in the mesh file.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools" / "python"))
import dotyk  # noqa: E402

from grid import CUBE, FACES, SQUARE, TETRAHEDRA, TRIANGLES, TYPES

KEEP = []  # a folder where scenes, with their logs, stay

CORNERS = {2: SQUARE, 3: CUBE}
WHOLE = {"quad4": [(0, 1, 2, 3)], "hex8": [tuple(range(8))], "tri3": TRIANGLES, "tet4": TETRAHEDRA}
SPACE = {"quad4": 2, "tri3": 2, "hex8": 3, "tet4": 3}


class Mesh:
    """Nodes (n, d), elements (m, k) of one kind, patches: name -> facets (lists of nodes), groups: name -> patches."""

    def __init__(self, kind, x, cells):
        self.kind, self.d = kind, SPACE[kind]
        used, numbers = np.unique(cells, return_inverse=True)
        self.x, self.cells = np.asarray(x, float)[used], numbers.reshape(cells.shape)
        self.patches, self.groups = {}, {}
        self.facets = self.boundary()

    def boundary(self):
        """Facets that one element alone has."""
        found = {}
        for face in FACES[self.d, self.cells.shape[1]]:
            for nodes in self.cells[:, face]:
                found.setdefault(tuple(sorted(nodes)), []).append(nodes)
        return [facets[0] for facets in found.values() if len(facets) == 1]

    def centres(self):
        """Centres of the boundary's facets."""
        return np.array([self.x[facet].mean(axis=0) for facet in self.facets])

    def patch(self, name, holds, facets=None):
        """Name the boundary's facets (or the given ones) whose centre `holds`; a group of the same name."""
        facets = self.facets if facets is None else facets
        self.patches[name] = [facet for facet in facets if holds(self.x[facet].mean(axis=0))]
        if not self.patches[name]:
            raise ValueError("no facet on " + name)
        self.groups[name] = [name]
        return self

    def group(self, name, *patches):
        """Name a union of patches."""
        self.groups[name] = list(patches)
        return self

    def move(self, function):
        """New coordinates."""
        self.x = np.asarray(function(self.x), float)
        return self

    def write(self, path):
        """Write as gmsh 2.2."""
        entity = {name: k + 1 for k, name in enumerate(self.patches)}
        physical = {name: k + 2 for k, name in enumerate(self.groups)}
        lines = [(self.d, 1, 1, cell) for cell in self.cells]
        for name, patches in self.groups.items():
            lines += [(self.d - 1, physical[name], entity[patch], facet)
                      for patch in patches for facet in self.patches[patch]]
        x = np.hstack([self.x, np.zeros((len(self.x), 3 - self.d))])
        with open(path, "w", encoding="ascii") as file:
            file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n%d\n" % (1 + len(physical)))
            file.write('%d 1 "body"\n' % self.d)
            file.writelines('%d %d "%s"\n' % (self.d - 1, number, name) for name, number in physical.items())
            file.write("$EndPhysicalNames\n$Nodes\n%d\n" % len(x))
            file.writelines("%d %r %r %r\n" % (k + 1, *map(float, p)) for k, p in enumerate(x))
            file.write("$EndNodes\n$Elements\n%d\n" % len(lines))
            file.writelines("%d %d 2 %d %d %s\n" % (k + 1, TYPES[d, len(nodes)], p, e, " ".join(map(str, nodes + 1)))
                            for k, (d, p, e, nodes) in enumerate(lines))
            file.write("$EndElements\n")


def grid_mesh(kind, *lines, keep=None, ring=False):
    """A grid; cells whose centre `keep` refuses are left out. ring: the first direction is closed."""
    d, counts = SPACE[kind], [len(line) for line in lines]
    number = np.arange(np.prod(counts)).reshape(counts)
    x = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, d)
    if ring:
        number = np.concatenate([number, number[:1]])
        counts[0] += 1
    corners = np.stack([number[tuple(slice(o, n - 1 + o) for o, n in zip(offset, counts))].ravel()
                        for offset in CORNERS[d]], axis=1)
    if keep:
        corners = corners[[bool(keep(x[cell].mean(axis=0))) for cell in corners]]
    return Mesh(kind, x, np.concatenate([corners[:, part] for part in WHOLE[kind]]))


def box(kind, n, low, high):
    """A box with n (or n[0], n[1], ...) divisions, patches 'left', 'right', ('front', 'back',) 'bottom', 'top'."""
    d = SPACE[kind]
    n = np.broadcast_to(n, d)
    mesh = grid_mesh(kind, *[np.linspace(a, b, k + 1) for a, b, k in zip(low, high, n)])
    names = [("left", "right"), ("front", "back"), ("bottom", "top")] if d == 3 else [("left", "right"),
                                                                                      ("bottom", "top")]
    for axis, sides in enumerate(names):
        for name, place in zip(sides, (low[axis], high[axis])):
            mesh.patch(name, lambda c, axis=axis, place=place: abs(c[axis] - place) < 1e-9 * (high[axis] - low[axis]))
    return mesh


def rotation(seed, d=3):
    """A random rotation; seed 0: none."""
    if seed == 0:
        return np.eye(3)
    random = np.random.default_rng(seed)
    if d == 2:
        return about((0, 0, 1), random.uniform(0, 360))
    q = random.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2*(y*y + z*z), 2*(x*y - z*w), 2*(x*z + y*w)],
                     [2*(x*y + z*w), 1 - 2*(x*x + z*z), 2*(y*z - x*w)],
                     [2*(x*z - y*w), 2*(y*z + x*w), 1 - 2*(x*x + y*y)]])


def about(axis, degrees):
    """Rotation about an axis through the origin (Rodrigues)."""
    a, angle = np.asarray(axis, float) / np.linalg.norm(axis), np.radians(degrees)
    k = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


class Scene:
    """Bodies, supports, loads and pairs, before the scene is turned. Vectors have as many values as dimensions."""

    def __init__(self, analysis, solver="theta=0, tolerance=1e-10", output="error_parts=''"):
        self.d = 3 if analysis == "3d" else 2
        self.analysis, self.solver, self.output = analysis, solver, output
        self.meshes, self.parts, self.lines, self.materials, self.geo = {}, {}, [], [], ""

    def body(self, name, mesh, young=1.0, poisson=0.3, part=None):
        """A body. mesh: a Mesh, or text for gmsh with a physical group 'body'. part: keys in place of volume and
        material."""
        self.meshes[name] = mesh
        self.parts[name] = part or "volume='body', material='of %s'" % name
        self.materials.append("&material name='of %s', young=%r, poisson=%r /" % (name, young, poisson))
        return self

    def fix(self, body, surface, fix, value=None):
        """A support. Values of fix='n' are along the outward normal; others are zero, or all directions are fixed."""
        self.lines.append(("&support body='%s', surface='%s', fix='%s'" % (body, surface, fix), "value", value,
                           "n" not in fix))
        return self

    def load(self, body, surface, **keys):
        """A load: pressure=number, traction=vector or local_traction=vector."""
        for key, value in keys.items():
            self.lines.append(("&load body='%s', surface='%s'" % (body, surface), key, value, key == "traction"))
        return self

    def pair(self, name, a, b, keys=""):
        """A contact pair."""
        self.lines.append(("&contact name='%s', surface_a='%s', surface_b='%s'%s" % (name, a, b, keys and ", " + keys),
                           None, None, False))
        return self

    def raw(self, text):
        """A line of input without vectors."""
        self.lines.append((text, None, None, False))
        return self

    def write(self, folder, turn=np.eye(3), name="scene"):
        """Write the meshes and the input, turned."""
        folder = pathlib.Path(folder)
        text = ["&scene analysis='%s' /" % self.analysis, *self.materials]
        for number, (body, mesh) in enumerate(self.meshes.items()):
            stem = "%s_%d" % (name, number)
            if isinstance(mesh, Mesh):
                file = stem + ".msh"
                x = mesh.x
                mesh.x = (np.hstack([x, np.zeros((len(x), 3 - self.d))]) @ turn.T)[:, :self.d]
                mesh.write(folder / file)
                mesh.x, place = x, ""
            else:
                file = stem + ".geo"
                (folder / file).write_text(mesh)
                place = placed(turn, self.d)
            text.append("&body name='%s', mesh='%s', %s%s /" % (body, file, self.parts[body], place))
        for words, key, value, turned in self.lines:
            if value is not None:
                value = np.atleast_1d(np.asarray(value, float))
                if turned:
                    value = (turn @ np.append(value, np.zeros(3 - len(value))))[:self.d]
                words += ", %s=%s" % (key, ",".join(repr(float(v)) for v in value))
            text.append(words + " /")
        text += ["&solver %s /" % self.solver, "&output %s /" % self.output]
        (folder / (name + ".nml")).write_text("\n".join(text) + "\n")

    def solve(self, seed=0, dotyk=None, turn=None, timeout=120):
        """Run turned by the rotation of a seed or by `turn`; the answer turned back."""
        turn = rotation(seed, self.d) if turn is None else turn
        with tempfile.TemporaryDirectory(prefix="dotyk-") as temporary:
            folder = pathlib.Path(temporary)
            if KEEP:
                folder = pathlib.Path(KEEP[0]) / ("%03d" % len(list(pathlib.Path(KEEP[0]).glob("*"))))
                folder.mkdir(parents=True)
            self.write(folder, turn)
            done = subprocess.run([dotyk or os.environ["DOTYK"], "scene.nml", "--verbose", "--threads", "1"], cwd=folder, text=True,
                                  timeout=timeout, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT)
            (folder / "scene.log").write_text(done.stdout)
            return Answer(done.returncode, done.stdout, folder / "scene.vtkhdf", list(self.meshes), turn)


def placed(turn, d):
    """The keys of &body for a rotation."""
    angle = np.degrees(np.arctan2(np.linalg.norm(twist(turn)), np.trace(turn) - 1))
    if angle == 0:
        return ""
    if d == 2:
        return ", angle=%r" % float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0])))
    return ", axis=%s, angle=%r" % (",".join(repr(float(v)) for v in twist(turn)), float(angle))


def twist(turn):
    """Twice the sine of the angle, along the axis."""
    return np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])


class Answer:
    """Exit code, log, and, where there are results, bodies and pairs, turned back."""

    def __init__(self, code, log, path, names, turn):
        self.code, self.log, self.bodies, self.pairs, self.summary = code, log, {}, {}, {}
        if code not in (0, 1) or not path.exists():
            return
        with dotyk.Results(path) as results:
            self.summary = results.summary.attributes
            self.bodies = {name: (body.nodes @ turn, body.displacement @ turn) for name, body in results.bodies.items()}
            for name, pair in results.pairs.items():
                self.pairs[name] = {key: pair[key] @ turn if key in ("position", "normal", "force") else pair[key] for key in pair}

    def force(self, body=None):
        """Sum of the forces of all pairs on their bodies a."""
        return sum((pair["force"] for pair in self.pairs.values()), np.zeros(3))

    def peak(self):
        """Largest pressure of all pairs."""
        return max((pair["pressure"].max() for pair in self.pairs.values() if len(pair["pressure"])), default=0.0)

    def at(self, body, *point):
        """Displacement of the node of a body that is nearest to a point."""
        x, u = self.bodies[body]
        point = np.append(point, np.zeros(3 - len(point)))
        return u[np.argmin(np.linalg.norm(x - point, axis=1))]

    def error(self):
        """The last line of the log that says error, or its last line."""
        lines = [line for line in self.log.splitlines() if line.strip()]
        found = [line for line in lines if re.search(r"not converged|not valid|error: |scene.nml:\d", line)]
        return (found or lines or [""])[-1].strip()
