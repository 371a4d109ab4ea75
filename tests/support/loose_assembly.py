"""Random assemblies of parts that contact hardly holds: shafts and screws in clearance holes, pins through plates, parts that
spin, roll or slide. All have an equilibrium; what contact does not determine should stay where it is."""
import numpy as np

from assembly import rotation
from random_assembly import Assembly, Extruded, Hollow, Part, Round, Solid


class Plate(Solid):
    """A plate with a bore along z, whose axis is off its middle; the lower face is 'face 0', the upper one 'face 1'."""

    def __init__(self, radius, off, height, order):
        self.radius, self.height, self.middle = radius, height, np.array([0, -off, 0])
        text = "Box(1) = {-1, %r, %r, 2, 2, %r};\n" % (-1 - off, -height / 2, height)
        text += "Cylinder(2) = {0, 0, %r, 0, 0, %r, %r};\n" % (-height, 2 * height, radius)
        text += "BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };\n"
        text += 'Physical Volume("body") = {3};\ns() = Boundary{ Volume{3}; };\nPhysical Surface("skin") = {s()};\n'
        for k, z in enumerate((-height / 2, height / 2)):
            text += 'Physical Surface("face %d") = Surface In BoundingBox {-3, -3, %r, 3, 3, %r};\n' % (k, z - 1e-3, z + 1e-3)
        super().__init__("plate with bore", text, 2.0 + 2 * off, 0.35, order)
        self.thin = height / 2
        self.faces = [("face %d" % k, np.array([0, 0, s]), np.array([0, 0, s * height / 2])) for k, s in enumerate((-1.0, 1.0))]


class Screw(Solid):
    """A shank below z = 0 and a head above it."""

    def __init__(self, radius, length, order):
        self.radius = radius
        text = "Cylinder(1) = {0, 0, %r, 0, 0, %r, %r}; Cylinder(2) = {0, 0, 0, 0, 0, 0.4, %r};\n" % (
            -length, length, radius, 1.8 * radius)
        text += "BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };\n"
        text += 'Physical Volume("body") = {3};\ns() = Boundary{ Volume{3}; };\nPhysical Surface("skin") = {s()};\n'
        text += 'Physical Surface("face 1") = Surface In BoundingBox {-3, -3, 0.399, 3, 3, 0.401};\n'
        super().__init__("screw", text, length + 0.4, 0.3, order)
        self.faces = [("face 1", np.array([0, 0, 1.0]), np.array([0, 0, 0.4]))]


class Loose(Assembly):
    """The assembly of a seed."""

    def __init__(self, seed, overlaps, auto=False):
        del overlaps
        random = self.random = np.random.default_rng([seed, 1])
        self.seed, self.parts, self.pairs, self.notes, self.auto = seed, [], [], [], auto
        self.order = 2 if random.random() < 0.25 else 1
        self.whole = rotation(int(random.integers(1, 2**31))) if random.random() < 0.5 else np.eye(3)
        self.clearance = float(random.choice([1e-3, 5e-3, 2e-2]))
        self.push = float(random.choice([1e-4, 1e-3]))
        self.forgotten = -1
        what = str(random.choice(["shaft", "pin", "screw", "on a plate", "row"]))
        getattr(self, what.replace(" ", "_"))()
        self.solver = str(random.choice(["", "theta=0, tolerance=1e-6", "theta_mesh=1e-3, tolerance=1e-6"]))

    def part(self, solid, at, note="", turn=None):
        """One more part, in coordinates of the assembly before it is turned."""
        part = Part(solid, self.whole @ (np.eye(3) if turn is None else turn), self.whole @ np.asarray(at, float), self.random)
        part.note = note
        self.parts.append(part)
        return part

    def weigh(self, part, direction):
        """Weight along a direction of the assembly."""
        part.density = self.push * part.young * self.whole @ np.asarray(direction, float)

    def aside(self):
        """A direction across z."""
        angle = self.random.uniform(0, 2 * np.pi)
        return np.array([np.cos(angle), np.sin(angle), 0.0])

    def shaft(self):
        """A shaft lies in a bore: it may spin, and slide along the bore."""
        base = self.part(Hollow("bore", self.order), (0, 0, 0))
        base.support = ("face 0", np.zeros(3))
        shaft = self.part(Round(0.6 - self.clearance, 1.4, self.order), (0, 0, float(self.random.choice([0.0, 0.3]))),
                          "shaft in clearance")
        self.weigh(shaft, self.aside())
        self.pairs.append((1, 0, "skin", "skin"))

    def pin(self):
        """A plate hangs on a pin through two others, which are held; it may slide on the pin, which may slide and spin."""
        off = float(self.random.choice([0.0, 0.4]))
        for k, z in enumerate((-0.55, 0.0, 0.55)):
            plate = self.part(Plate(0.4, off if k == 1 else 0.0, 0.5, self.order), (0, 0, z), "plate on a pin" if k == 1 else "")
            if k != 1:
                plate.support = ("face %d" % (k // 2), np.zeros(3))
        self.part(Round(0.4 - self.clearance, 1.9, self.order), (0, 0, 0), "pin in clearance")
        self.weigh(self.parts[1], (0, -1, 0))
        self.pairs += [(3, k, "side", "skin") for k in range(3)] + [(k, k + 1, "face 1", "face 0") for k in range(2)]

    def screw(self):
        """The head of a screw lies on a plate; in half of them it is pushed to the side of its hole."""
        plate = self.part(Plate(0.4, 0.0, 0.5, self.order), (0, 0, -0.25))
        plate.support = ("face 0", np.zeros(3))
        screw = self.part(Screw(0.4 - self.clearance, 0.8, self.order), (0, 0, 0), "screw in clearance")
        aside = self.random.choice([0.0, 0.1])
        self.weigh(screw, np.array([0, 0, -1.0]) + aside * self.aside())
        self.pairs.append((1, 0, "skin", "skin"))

    def on_a_plate(self):
        """A cylinder, standing or lying, a ball or a block on a plate, by its weight."""
        base = self.part(Extruded("box", [(-1, -1), (1, -1), (1, 1), (-1, 1)], 0.5, self.order), (0, 0, -0.25))
        base.support = ("face 0", np.zeros(3))
        how = str(self.random.choice(["standing", "lying", "ball", "block"]))
        turn = None
        if how == "ball":
            solid, height = Round(0.6, None, self.order), 0.6
        elif how == "block":
            solid, height = Extruded("box", [(-.4, -.4), (.4, -.4), (.4, .4), (-.4, .4)], 0.6, self.order), 0.3
        else:
            solid, height = Round(0.5, 0.8, self.order), 0.4
            if how == "lying":
                turn, height = np.array([[1, 0, 0], [0, 0, -1], [0, 1.0, 0]]), 0.5
        part = self.part(solid, (*self.random.uniform(-0.3, 0.3, 2), height), how + " on a plate", turn)
        self.weigh(part, (0, 0, -1))
        self.pairs.append((1, 0, "skin", "face 1"))

    def row(self):
        """Blocks in a row, pushed against a wall: they may slide along their faces."""
        wall = self.part(Extruded("box", [(-1, -1), (1, -1), (1, 1), (-1, 1)], 0.5, self.order), (0, 0, -0.25))
        wall.support = ("face 0", np.zeros(3))
        z = 0.0
        for k in range(int(self.random.integers(2, 4))):
            height = float(self.random.choice([0.4, 0.8]))
            block = self.part(Extruded("box", [(-.4, -.4), (.4, -.4), (.4, .4), (-.4, .4)], height, self.order),
                              (*self.random.uniform(-0.1, 0.1, 2), z + height / 2), "row")
            z += height
            self.pairs.append((k + 1, k, "face 0", "face 1"))
        block.load = ("face 1", self.push * block.young)
