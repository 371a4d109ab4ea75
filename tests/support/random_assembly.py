"""Random assemblies: convex solids by gmsh's OpenCASCADE that touch at faces, edges, corners and curved faces, blocks
in corners and shafts in holes; some with gaps, some with interference, some with a pair that was forgotten.

Two bodies touch where a plane separates them: a point of one body and a normal in the cone of its normals there, and a
feature of the other body turned against it. Bodies that would overlap others are left out.
"""
import hashlib
import os
import shutil
import subprocess

import numpy as np

from assembly import about, placed, rotation

HEAD = 'SetFactory("OpenCASCADE");\n'


class Solid:
    """A solid at the origin: text for gmsh, planar faces [(name, normal, point)], its size and length of elements."""

    def __init__(self, kind, geo, size, length, order):
        self.kind, self.size, self.length, self.faces, self.thin = kind, size, length, [], 1.0
        self.geo = HEAD + geo + "Mesh.MeshSizeMax = %r;  Mesh.MeshSizeMin = %r;\n" \
            "Mesh.MeshSizeExtendFromBoundary = 0;  Mesh.ElementOrder = %d;\n" \
            "Mesh.SecondOrderLinear = 1;\n" % (length, length, order)

    def mesh(self, folder):
        """The mesh file, made once for all seeds."""
        path = folder / (hashlib.sha256(self.geo.encode()).hexdigest()[:16] + ".msh")
        if not path.exists():
            own = path.with_suffix(".%d.geo" % os.getpid())
            own.write_text(self.geo)
            out = own.with_suffix(".tmp.msh")
            subprocess.run([shutil.which("gmsh"), "-3", "-format", "msh22", "-o", str(out), str(own)], check=True,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            own.unlink()
            out.rename(path)
        return path


class Extruded(Solid):
    """A convex polygon, counter-clockwise, extruded along z; the middle of its height is at z = 0.

    A half of the polygon is the surface 'grip 0' or 'grip 1' of its ends, by which it is held.
    """

    def __init__(self, kind, polygon, height, order):
        self.polygon, self.height, k = np.asarray(polygon, float), height, len(polygon)
        self.polygon = self.polygon - self.polygon.mean(axis=0)
        points = np.concatenate([self.polygon, self.polygon / 2])
        text = "".join("Point(%d) = {%r, %r, %r};\n" % (i + 1, float(p[0]), float(p[1]), -height / 2)
                       for i, p in enumerate(points))
        text += "".join("Line(%d) = {%d, %d};\n" % (i + 1, i + 1, i + 2 - (k if (i + 1) % k == 0 else 0))
                        for i in range(2 * k))
        text += "Curve Loop(1) = {1:%d};  Curve Loop(2) = {%d:%d};\n" % (k, k + 1, 2 * k)
        text += "Plane Surface(1) = {1, 2};  Plane Surface(2) = {2};\n"
        text += "v() = Extrude {0, 0, %r} { Surface{1, 2}; };\n" % height
        text += 'Physical Volume("body") = {v(1), v(%d)};\n' % (2 * k + 3)
        text += 'Physical Surface("skin") = {1, 2, v(0), v(%d), v({2:%d})};\n' % (2 * k + 2, k + 1)
        text += 'Physical Surface("face 0") = {1, 2};\nPhysical Surface("face 1") = {v(0), v(%d)};\n' % (2 * k + 2)
        text += 'Physical Surface("grip 0") = {2};\nPhysical Surface("grip 1") = {v(%d)};\n' % (2 * k + 2)
        text += "".join('Physical Surface("face %d") = {v(%d)};\n' % (i + 2, i + 2) for i in range(k))
        width = min(np.ptp(self.polygon, axis=0).min(), height)
        size = max(np.ptp(self.polygon, axis=0).max(), height)
        super().__init__(kind, text, size, max(0.6 * width, size / 4), order)
        self.thin = float(width / size)
        self.faces = [("face 0", np.array([0.0, 0, -1]), np.array([0, 0, -height / 2])),
                      ("face 1", np.array([0.0, 0, 1]), np.array([0, 0, height / 2]))]
        for i in range(k):
            a, b = self.polygon[i], self.polygon[(i + 1) % k]
            normal = np.array([b[1] - a[1], a[0] - b[0], 0]) / np.linalg.norm(b - a)
            self.faces.append(("face %d" % (i + 2), normal, np.append((a + b) / 2, 0)))

    def feature(self, random):
        """(what, point, normal, group) on a random face, edge or corner."""
        what = random.choice(["face", "edge", "corner"], p=[0.5, 0.3, 0.2])
        k, z = len(self.polygon), random.choice([-1, 1])
        i = random.integers(k)
        ends = [self.faces[2 + i][1], self.faces[2 + (i - 1) % k][1], np.array([0, 0, float(z)])]
        a, b = self.polygon[i], self.polygon[(i + 1) % k]
        part, middle = random.uniform(0.2, 0.8), random.uniform(-0.4, 0.4) * self.height
        if what == "face" and random.random() < 0.5:
            return what, np.append(a * random.uniform(0, 0.7), z * self.height / 2), ends[2], "face %d" % (z > 0)
        if what == "face":
            return what, np.append(a + part * (b - a), middle), ends[0], "face %d" % (2 + i)
        mix = random.uniform(0.25, 1, 3)
        if what == "edge" and random.random() < 0.5:
            mix[2], point = 0, np.append(a, middle)
        elif what == "edge":
            mix[1], point = 0, np.append(a + part * (b - a), z * self.height / 2)
        else:
            point = np.append(a, z * self.height / 2)
        normal = sum(m * n for m, n in zip(mix, ends))
        return what, point, normal / np.linalg.norm(normal), "skin"


class Round(Solid):
    """A cylinder along z, or a ball (height None)."""

    def __init__(self, radius, height, order):
        self.radius, self.height = radius, height
        if height:
            text = "Cylinder(1) = {0, 0, %r, 0, 0, %r, %r};\n" % (-height / 2, height, radius)
            text += 'Physical Surface("face 0") = {3};\nPhysical Surface("face 1") = {2};\n'
            text += 'Physical Surface("side") = {1};\nPhysical Surface("skin") = {1, 2, 3};\n'
        else:
            text = 'Sphere(1) = {0, 0, 0, %r};\nPhysical Surface("skin") = {1};\n' % radius
        super().__init__("cylinder" if height else "ball", text + 'Physical Volume("body") = {1};\n',
                         max(2 * radius, height or 0), min(0.6 * radius, height) if height else 0.55 * radius, order)
        if height:
            self.thin = min(1.0, height / (2 * radius))
            self.faces = [("face %d" % k, np.array([0, 0, s]), np.array([0, 0, s * height / 2]))
                          for k, s in enumerate((-1.0, 1.0))]

    def feature(self, random):
        """(what, point, normal, group) on the side, an end or its rim, or anywhere on a ball."""
        if not self.height:
            normal = rotation(random.integers(1, 2**31))[:, 0]
            return "curved", self.radius * normal, normal, "skin"
        angle, z = random.uniform(0, 2 * np.pi), random.choice([-1, 1])
        radial = np.array([np.cos(angle), np.sin(angle), 0])
        what = random.choice(["face", "curved", "edge"], p=[0.3, 0.5, 0.2])
        if what == "curved":
            return what, self.radius * radial + [0, 0, random.uniform(-0.4, 0.4) * self.height], radial, "side"
        axis = np.array([0, 0, float(z)])
        if what == "face":
            part = random.uniform(0, 0.7) * self.radius
            return what, part * radial + axis * self.height / 2, axis, "face %d" % (z > 0)
        normal = random.uniform(0.3, 1) * radial + random.uniform(0.3, 1) * axis
        return what, self.radius * radial + axis * self.height / 2, normal / np.linalg.norm(normal), "skin"


class Hollow(Solid):
    """A block with a corner cut out of it, or with a bore through it; it is the first body only."""

    def __init__(self, what, order):
        self.what = what
        if what == "bore":
            self.radius = 0.6
        text = "Box(1) = {-1, -1, -1, 2, 2, 2};\n"
        text += "Box(2) = {0, 0, 0, 2, 2, 2};\n" if what == "corner" else "Cylinder(2) = {0, 0, -2, 0, 0, 4, 0.6};\n"
        text += "BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };\n"
        text += 'Physical Volume("body") = {3};\ns() = Boundary{ Volume{3}; };\nPhysical Surface("skin") = {s()};\n'
        low = (-1.01, -1.01, -1.01, 1.01, 1.01, -0.99)
        text += 'Physical Surface("face 0") = {Surface In BoundingBox {%s}};\n' % ", ".join(map(repr, low))
        super().__init__(what, text, 2.0, 0.6 if what == "corner" else 0.4, order)
        self.faces = [("face 0", np.array([0.0, 0, -1]), np.array([0, 0, -1.0]))]


class Part:
    """A body of the assembly: solid, place, material, how it is held and loaded."""

    def __init__(self, solid, turn, at, random):
        self.solid, self.turn, self.at, self.note = solid, turn, np.asarray(at, float), ""
        self.young = float(np.round(10**random.uniform(-1, 1), 3))
        self.poisson = float(np.round(random.uniform(0, .35), 2))
        self.support = self.load = self.density = None  # (face, vector), (face, pressure), vector
        self.shift = 0.0  # gap (positive) or interference where it touches the body it was put to

    def normals(self):
        """[(face, normal)] of its planar faces, where they are."""
        return [(name, self.turn @ normal) for name, normal, _ in self.solid.faces]

    def grip_along(self, direction):
        """The surface by which the part is held best where `direction` looks away from what it touches."""
        if not isinstance(self.solid, Extruded):
            return self.face_along(direction)[1]
        return "grip %d" % (self.turn[:, 2] @ direction > 0)

    def face_along(self, direction):
        """The planar face that looks most along a direction, and how much."""
        return max(((float(normal @ direction), name) for name, normal in self.normals()), default=(-1.0, None))


def solid(random, order):
    """A random convex solid."""
    kind = random.choice(["box", "plate", "bar", "prism", "wedge", "hexagon", "cylinder", "disc", "ball"],
                         p=[0.15, 0.12, 0.12, 0.12, 0.12, 0.12, 0.1, 0.1, 0.05])
    pick = lambda *values: float(random.choice(values))  # noqa: E731
    if kind == "ball":
        return Round(pick(0.4, 0.6, 0.8), None, order)
    if kind in ("cylinder", "disc"):
        return Round(pick(0.4, 0.6), pick(0.8, 1.4) if kind == "cylinder" else pick(0.1, 0.2), order)
    if kind == "hexagon":
        angles = np.arange(6) * np.pi / 3
        return Extruded(kind, 0.6 * np.stack([np.cos(angles), np.sin(angles)], axis=1), pick(0.5, 1.0), order)
    if kind in ("prism", "wedge"):
        half = 0.5 if kind == "prism" else pick(0.15, 0.25)
        return Extruded(kind, [(-half, 0), (half, 0), (0, 1)], pick(0.5, 1.0), order)
    a, b, c = {"box": (pick(0.6, 1.0), pick(0.6, 1.0), pick(0.6, 1.0)), "plate": (1.2, pick(0.8, 1.2), pick(0.05, 0.1)),
               "bar": (0.3, 0.3, pick(1.2, 1.8))}[kind]
    return Extruded(kind, [(-a / 2, -b / 2), (a / 2, -b / 2), (a / 2, b / 2), (-a / 2, b / 2)], c, order)


def against(normal, other, random):
    """A rotation that turns the direction `other` against `normal`, with a random twist."""
    axis = np.cross(other, -normal)
    sine, cosine = np.linalg.norm(axis), float(-other @ normal)
    if sine < 1e-12:
        axis = np.cross(other, np.eye(3)[np.argmin(np.abs(other))])
    turn = about(axis, np.degrees(np.arctan2(sine, cosine)))
    return about(normal, random.choice([0.0, 90.0, float(random.uniform(0, 360))])) @ turn


class Assembly:
    """The assembly of a seed: parts, touching pairs, and the input."""

    balanced = True  # whether forces of the stresses are checked: elements have straight edges, supports hold all

    def fault(self, path, log):
        """What is wrong with results where the solution is known, or None; numbers; what the log states of it."""
        del path, log
        return None, {}, ""

    def __init__(self, seed, overlaps, auto=False):
        random = self.random = np.random.default_rng(seed)
        self.seed, self.parts, self.pairs, self.notes, self.auto = seed, [], [], [], auto
        order = 2 if random.random() < 0.2 else 1
        whole = rotation(int(random.integers(1, 2**31))) if random.random() < 0.5 else np.eye(3)
        special = random.choice(["", "corner", "bore"], p=[0.8, 0.1, 0.1])
        first = Hollow(special, order) if special else Extruded(
            "box", [(-1, -1), (1, -1), (1, 1), (-1, 1)], float(random.choice([0.1, 0.5, 1.0])), order) \
            if random.random() < 0.6 else solid(random, order)
        self.parts.append(Part(first, whole, (0, 0, 0), random))
        if special:
            self.put_inside(special, order)
        wanted = len(self.parts) + int(random.integers(0 if special else 1, 3))
        for _ in range(40):
            if len(self.parts) >= wanted:
                break
            self.add(order, overlaps)
        self.hold_first()
        self.solver = str(random.choice(["", "theta=0, tolerance=1e-6", "theta_mesh=1e-3, tolerance=1e-6"]))
        self.forgotten = -1
        if not auto and self.pairs and random.random() < 0.12:
            self.forgotten = int(random.integers(len(self.pairs)))

    def shift(self):
        """Gap (positive) or interference between touching bodies."""
        return float(self.random.choice([0.0, 1e-3, 5e-3, -1e-3, -5e-3], p=[0.6, 0.1, 0.1, 0.1, 0.1]))

    def put_inside(self, special, order):
        """A box in the corner, or a shaft in the bore."""
        random, base = self.random, self.parts[0]
        shift = self.shift()
        if special == "corner":
            inner = Extruded("box", [(-.4, -.4), (.4, -.4), (.4, .4), (-.4, .4)], 0.8, order)
            at, normal = np.full(3, 0.4 + shift), np.ones(3) / np.sqrt(3)
        else:
            inner = Round(0.6 - shift, 1.4, order)
            at, normal = np.array([0, 0, float(random.choice([0.0, 0.3]))]), np.eye(3)[0]
        part = Part(inner, base.turn, base.turn @ at, random)
        part.shift = shift * (np.sqrt(3) if special == "corner" else 1)
        part.note = special + (" gap" if shift > 0 else " interference" if shift < 0 else "")
        self.parts.append(part)
        self.pairs.append((1, 0, "skin", "skin"))
        self.drive(part, base.turn @ normal)

    def add(self, order, overlaps):
        """One more body that touches a body, if it overlaps no other."""
        random = self.random
        number = int(random.integers(len(self.parts)))
        old = self.parts[number]
        if isinstance(old.solid, Hollow):
            point, normal, what, theirs = [*random.uniform(-0.8, -0.2, 2), 1.0], np.array([0, 0, 1.0]), "face", "skin"
        else:
            what, point, normal, theirs = old.solid.feature(random)
        point, normal = old.turn @ point + old.at, old.turn @ normal
        new = solid(random, order)
        which, mine, direction, ours = new.feature(random)
        if what == which == "corner" or {what, which} == {"edge", "corner"}:
            return
        turn = against(normal, direction, random)
        shift = self.shift()
        part = Part(new, turn, point - turn @ mine + shift * normal, random)
        part.shift = shift
        if overlaps(part, self.parts, max(0.0, -shift)):
            return
        part.note = " on ".join([which, what]) + (" gap" if shift > 0 else " interference" if shift < 0 else "")
        self.parts.append(part)
        sides = [(len(self.parts) - 1, ours), (number, theirs)][::int(random.choice([1, -1]))]
        skin = random.random() < 0.5
        self.pairs.append((sides[0][0], sides[1][0], *["skin" if skin else group for _, group in sides]))
        self.drive(part, normal)

    def drive(self, part, normal):
        """Push a body against the normal of what it touches: by a support, a pressure, or a weight."""
        random = self.random
        push = float(random.choice([1e-3, 3e-3, 1e-2]))
        much, face = part.face_along(normal)
        how = random.choice(["held", "pressed", "weight"], p=[0.8, 0.1, 0.1])
        if how == "held" and face:
            part.support = (part.grip_along(normal), -push * normal)
        elif face and not (part.note.startswith("face on") or "curved" in part.note):
            part.support = (part.grip_along(normal), -push * normal)
        elif how == "pressed" and much > 0.999:
            part.load = (face, push * part.young * part.solid.thin**2)
        else:
            part.density = -push * part.young * part.solid.thin**2 * normal

    def hold_first(self):
        """The first body is held by a face that nobody touches most."""
        base = self.parts[0]
        away = -sum((part.at - base.at for part in self.parts[1:]), np.zeros(3))
        away = away / (np.linalg.norm(away) or 1.0)
        if isinstance(base.solid, Hollow):
            away = base.turn @ [0, 0, -1.0]
        grip = base.grip_along(away)
        if grip:
            base.support = (grip, np.zeros(3))
        else:
            base.density = np.zeros(3)

    def text(self, meshes):
        """The input, with mesh files of the parts."""
        vector = lambda v: ",".join(repr(float(c)) for c in v)  # noqa: E731
        lines = ["&scene title='assembly %d' /" % self.seed]
        for k, (part, mesh) in enumerate(zip(self.parts, meshes)):
            name = "part %d" % (k + 1)
            lines += ["&material name='of %s', young=%r, poisson=%r /" % (name, part.young, part.poisson),
                      "&body name='%s', mesh='%s', volume='body', material='of %s', at=%s%s /" % (
                          name, os.fspath(mesh), name, vector(part.at), placed(part.turn, 3))]
            if part.support:
                lines.append("&support body='%s', surface='%s', fix='xyz', value=%s /" % (
                    name, part.support[0], vector(part.support[1])))
            if part.load:
                lines.append("&load body='%s', surface='%s', pressure=%r /" % (name, *part.load))
            if part.density is not None and np.any(part.density):
                lines.append("&load body='%s', force_density=%s /" % (name, vector(part.density)))
        if self.auto:
            lines.append("&contact auto=.true. /")
        for k, (a, b, *surfaces) in enumerate(self.pairs if not self.auto else []):
            if k != self.forgotten:
                lines.append("&contact name='pair %d', surface_a='part %d:%s', surface_b='part %d:%s' /" % (
                    k + 1, a + 1, surfaces[0], b + 1, surfaces[1]))
        if self.solver:
            lines.append("&solver %s /" % self.solver)
        return "\n".join(lines) + "\n"
