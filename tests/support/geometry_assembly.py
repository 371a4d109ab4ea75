"""Random scenes in which the geometry of facets decides: coarse sectors, slices of one layer, round bodies on curved
facets, bevels, corners on corners, pins below heads, tied pieces, flush fits. All have an equilibrium, so that each
refusal is wrong; where the solution is known, it is compared."""
import re

import numpy as np

import dotyk
from assembly import placed, rotation
from loose_assembly import Plate, Screw
from random_assembly import Assembly, Extruded, Hollow, Part, Round, Solid

FACES = 'Physical Surface("%s") = Surface In BoundingBox {%s};\n'


class Sector(Solid):
    """A quarter of a ring, or of a shaft (`inner` 0), about z; 'x0' and 'y0' are its planes of symmetry."""

    def __init__(self, inner, outer, height, facets, layers, order, curved):
        length = outer * np.pi / 2 / facets if not inner else inner * np.pi / 2 / facets
        text = "Disk(1) = {0, 0, 0, %r};\nRectangle(2) = {0, 0, 0, 9, 9};\n" % outer
        text += "BooleanIntersection(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };\n"
        if inner:
            text += "Disk(4) = {0, 0, 0, %r};\nBooleanDifference(5) = { Surface{3}; Delete; }{ Surface{4}; Delete; };\n" \
                % inner
        text += "s() = Surface{:};\nv() = Extrude {0, 0, %r} { Surface{s(0)}; Layers{%d}; };\n" % (height, layers)
        text += 'Physical Volume("body") = {v(1)};\nb() = Boundary{ Volume{v(1)}; };\nPhysical Surface("skin") = {b()};\n'
        wall = 9.0
        for name, box in (("x0", (-.001, -wall, -wall, .001, wall, wall)), ("y0", (-wall, -.001, -wall, wall, .001, wall)),
                          ("face 0", (-wall, -wall, -.001, wall, wall, .001)),
                          ("face 1", (-wall, -wall, height - .001, wall, wall, height + .001))):
            text += FACES % (name, ", ".join(map(repr, box)))
        super().__init__("ring" if inner else "shaft", text, 2 * outer, float(length), order)
        if curved:
            self.geo = self.geo.replace("SecondOrderLinear = 1", "SecondOrderLinear = 0")
        self.radius = inner or outer


class Bevelled(Solid):
    """A block with bevels around its lower face, at z = 0."""

    def __init__(self, side, height, bevel, length, order):
        text = "Box(1) = {%r, %r, 0, %r, %r, %r};\n" % (-side / 2, -side / 2, side, side, height)
        text += "e() = Curve In BoundingBox {-9, -9, -.001, 9, 9, .001};\nf() = Surface In BoundingBox {-9, -9, -.001, 9, 9, .001};\n"
        text += "Chamfer {1}{ e() }{ f(0), f(0), f(0), f(0) }{ %r }\n" % bevel
        text += 'Physical Volume("body") = {Volume{:}};\nPhysical Surface("skin") = {Surface{:}};\n'
        text += FACES % ("face 1", "-9, -9, %r, 9, 9, 9" % (height - 1e-3))
        super().__init__("bevelled", text, side, length, order)
        self.faces = [("face 1", np.array([0, 0, 1.0]), np.array([0, 0, height]))]


def curved(solid):
    """The solid with nodes of quadratic facets on its surface."""
    solid.geo = solid.geo.replace("SecondOrderLinear = 1", "SecondOrderLinear = 0")
    return solid


class Geometry(Assembly):
    """The scene of a seed. Its kinds take turns."""

    KINDS = ("sector", "slice", "ball", "bevel", "corners", "pin", "tied", "flush")

    def __init__(self, seed, overlaps, auto=False):
        del overlaps
        random = self.random = np.random.default_rng([seed, 2])
        self.seed, self.parts, self.pairs, self.auto, self.forgotten = seed, [], [], auto, -1
        self.order = int(random.choice([1, 2]))
        self.whole = rotation(int(random.integers(1, 2**31))) if random.random() < 0.5 else np.eye(3)
        self.solver = str(random.choice(["", "theta=0, tolerance=1e-6", "theta_mesh=1e-3, tolerance=1e-6"]))
        self.extra, self.limits, self.balanced = [], None, True
        self.kind = self.KINDS[seed % len(self.KINDS)]
        getattr(self, self.kind)()

    def part(self, solid, at, note="", **held):
        """One more part; `held` gives values of supports by surface and direction: face_0_xyz=(0, 0, 0)."""
        part = Part(solid, self.whole, self.whole @ np.asarray(at, float), self.random)
        part.young, part.poisson, part.note = 1.0, 0.3, note
        part.held = [(*name.replace("face_", "face ").replace("grip_", "grip ").rsplit("_", 1), value)
                     for name, value in held.items()]
        for face, fix, value in part.held:
            if fix == "xyz":
                part.support = (face, self.whole @ np.asarray(value, float))
        self.parts.append(part)
        return part

    def press_fit(self, height, facets, layers):
        """A quarter of a shaft in a ring, without strain along z: the mean pressure is Lame's."""
        overlap, b, c = float(self.random.choice([1e-3, 5e-3])), 1.0, 2.0
        for solid, note in ((Sector(b, c, height, facets[0], layers, self.order, True), ""),
                            (Sector(0.0, b + overlap, height, facets[1], layers, self.order, True), self.kind)):
            self.part(solid, (0, 0, 0), note, x0_n=0.0, y0_n=0.0, face_0_n=0.0, face_1_n=0.0)
        self.pairs.append((1, 0, "skin", "skin"))
        pressure = overlap / b * (c**2 - b**2) / (2 * c**2) / (1 - 0.3**2)
        force = pressure * b * height * np.sqrt(2)
        self.limits, self.balanced = (0.6 * force, 1.5 * force), False

    def sector(self):
        """Few facets around a quarter."""
        self.press_fit(0.5, self.random.integers(2, 5, 2), 2)

    def slice(self):
        """One layer of elements along the axis."""
        self.press_fit(0.1, self.random.integers(4, 9, 2), 1)

    def ball(self):
        """A ball of curved facets above a block: without force if it is not moved as far as the gap, with Hertz's if it is,
        or a word of how uncertain it is: the contact is narrower than a facet."""
        gap, push, radius = float(self.random.choice([1e-4, 1e-3])), float(self.random.choice([0.5, 10.0])), 0.6
        self.order = 2
        self.part(Extruded("box", [(-1, -1), (1, -1), (1, 1), (-1, 1)], 0.5, 2), (0, 0, -0.25), face_0_xyz=(0, 0, 0))
        ball = self.part(curved(Round(radius, None, 2)), (0, 0, radius + gap), "ball on curved facets")
        ball.density = self.whole @ np.array([0, 0, 0.0])
        ball.held = [("skin", "xyz", (0, 0, -push * gap))]
        self.pairs.append((1, 0, "skin", "skin"))
        near = max(0.0, (push - 1) * gap)
        force = 4 / 3 / (1 - 0.3**2) * np.sqrt(radius) * near**1.5
        self.limits, self.balanced = (0.5 * force, 1.5 * force), False

    def bevel(self):
        """A block with bevels is pressed on one without."""
        side, height, bevel, push = 1.0, float(self.random.choice([0.5, 1.0])), float(self.random.choice([0.05, 0.2])), 1e-3
        length = float(self.random.choice([0.15, 0.25, 0.5]))
        self.part(Extruded("box", [(-.5, -.5), (.5, -.5), (.5, .5), (-.5, .5)], 0.5, self.order), (0, 0, -0.25),
                  face_0_xyz=(0, 0, 0))
        block = Bevelled(side, height, bevel, length, self.order)
        self.part(block, (0, 0, 0), "bevel", face_1_xyz=(0, 0, -push))
        self.pairs.append((1, 0, "skin", "skin"))
        self.limits = tuple(k * push / (0.5 + height) for k in (0.5, 1.35))

    def corners(self):
        """Blocks that meet at edges and corners are pressed on a base, and together."""
        base = self.part(Extruded("box", [(-1, -1), (1, -1), (1, 1), (-1, 1)], 0.5, self.order), (0, 0, -0.25))
        base.support = ("face 0", np.zeros(3))
        base.held = [("face 0", "xyz", (0, 0, 0))]
        push = float(self.random.choice([1e-4, 1e-3]))
        row, column = self.random.random(2), self.random.random(2)
        for i in (-1, 1):
            for j in (-1, 1):
                solid = Extruded("box", [(-.4, -.4), (.4, -.4), (.4, .4), (-.4, .4)], 0.6, self.order)
                part = self.part(solid, (0.4 * i, 0.4 * j, 0.3), "corner on corner")
                part.density = push * self.whole @ np.array([-i * row[j], -j * column[i], -1])
        self.auto = True

    def pin(self):
        """A pin fills its hole, and its head lies on the plate: forces balance the weight."""
        push = float(self.random.choice([1e-4, 1e-3]))
        plate, screw = Plate(0.4, 0.0, 0.5, self.order), Screw(0.4, 0.8, self.order)
        self.part(curved(plate) if self.order == 2 else plate, (0, 0, -0.25), face_0_xyz=(0, 0, 0))
        part = self.part(curved(screw) if self.order == 2 else screw, (0, 0, 0), "pin below its head")
        part.density = self.whole @ np.array([0, 0, -push])
        weight = push * np.pi * (0.4**2 * 0.8 + (1.8 * 0.4)**2 * 0.4)
        self.auto, self.limits, self.balanced = True, (0.85 * weight, 1.05 * weight), False

    def tied(self):
        """Two tied halves of a block are pressed on a third."""
        push, half = float(self.random.choice([1e-3, 1e-2])), [(-.4, -.4), (.4, -.4), (.4, .4), (-.4, .4)]
        self.part(Extruded("box", [(-1, -1), (1, -1), (1, 1), (-1, 1)], 0.5, self.order), (0, 0, -0.25), face_0_xyz=(0, 0, 0))
        lower = self.part(Extruded("box", half, float(self.random.choice([0.3, 0.5])), self.order), (0, 0, 0.25), "tied halves")
        lower.at = self.whole @ np.array([0, 0, lower.solid.height / 2])
        self.part(Extruded("box", half, 0.4, self.order), (0, 0, lower.solid.height + 0.2), face_1_xyz=(0, 0, -push))
        self.pairs.append((1, 0, "face 0", "face 1"))
        self.extra.append("&tie name='halves', surface_a='part 3:face 0', surface_b='part 2:face 1' /")
        self.balanced = False
        stiffness = 0.64 / (lower.solid.height + 0.4)
        self.limits = (0.5 * push * stiffness, 1.2 * push * stiffness)

    def flush(self):
        """A shaft ends flush with its hub: the least pressure is that of Lame's ring, the greatest that of a rigid hub."""
        overlap = float(self.random.choice([1e-3, 5e-3]))
        hub = self.part(Hollow("bore", self.order), (0, 0, 0), face_0_xyz=(0, 0, 0))
        del hub
        shaft = self.part(Round(0.6 + overlap, 2.0, self.order), (0, 0, 0), "flush press fit")
        shaft.shift = -overlap
        self.pairs.append((1, 0, "skin", "skin"))

    def text(self, meshes):
        """The input, with mesh files of the parts."""
        vector = lambda v: ",".join(repr(float(c)) for c in np.atleast_1d(v))  # noqa: E731
        lines = ["&scene title='%s %d' /" % (self.kind, self.seed), "&material name='m', young=1, poisson=0.3 /"]
        for k, (part, mesh) in enumerate(zip(self.parts, meshes)):
            name = "part %d" % (k + 1)
            lines.append("&body name='%s', mesh='%s', volume='body', material='m', at=%s%s /" % (
                name, mesh, vector(part.at), placed(part.turn, 3)))
            for face, fix, value in part.held:
                value = ", value=" + vector(self.whole @ np.asarray(value, float)) if fix == "xyz" else ""
                lines.append("&support body='%s', surface='%s', fix='%s'%s /" % (name, face, fix, value))
            if part.density is not None and np.any(part.density):
                lines.append("&load body='%s', force_density=%s /" % (name, vector(part.density)))
        if self.auto:
            lines.append("&contact auto=.true. /")
        for k, (a, b, *surfaces) in enumerate(self.pairs if not self.auto else []):
            lines.append("&contact name='pair %d', surface_a='part %d:%s', surface_b='part %d:%s' /" % (
                k + 1, a + 1, surfaces[0], b + 1, surfaces[1]))
        return "\n".join([*lines, *self.extra, "&solver %s /" % self.solver if self.solver else ""]) + "\n"

    def fault(self, path, log):
        """What is wrong with the contact force on the last body of a pair, or None; the force by that of the solution."""
        if self.limits is None:
            return None, {}, ""
        with dotyk.Results(path) as results:
            force = float(np.linalg.norm(sum((np.asarray(pair.force) for pair in results.pairs.values()), np.zeros(3))))
        low, high = self.limits
        numbers = {"force": force, "low": low, "high": high}
        if low - 1e-12 <= force <= high + 1e-12:
            return None, numbers, ""
        words = "contact force %.3g, not from %.3g to %.3g" % (force, low, high)
        told = re.search(r"uncertain by", log)
        return (None, numbers, words) if told else (words, numbers, "")
