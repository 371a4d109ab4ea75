"""Random scenes of two blocks with flat, cylindrical or round faces in contact, and the same scenes turned, mirrored,
or with their nodes, elements and bodies in another order: nothing but rounding may change in the answer."""
import os
import pathlib
import subprocess

import h5py
import numpy as np

import grid

KINDS = {2: ("quad4", "tri3", "quad8", "tri6"), 3: ("hex8", "tet4", "tet10")}
MOTIONS = "turned", "mirrored", "renumbered"
# nodes of a mirror image, by gmsh's type of the element
MIRRORED = {1: [1, 0], 2: [0, 2, 1], 3: [0, 3, 2, 1], 4: [0, 2, 1, 3], 5: [0, 3, 2, 1, 4, 7, 6, 5], 8: [1, 0, 2],
            9: [0, 2, 1, 5, 4, 3], 11: [0, 2, 1, 3, 6, 5, 4, 7, 9, 8], 16: [0, 3, 2, 1, 7, 6, 5, 4]}


class Scene:
    """One of them, by its seed."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.d = d = int(random.choice([2, 2, 3]))
        self.kind = str(random.choice(KINDS[d]))
        self.faces = [str(random.choice(["flat", "cylinder", "round"])) for _ in range(2)]
        self.radii = random.uniform(2, 8, 2)
        self.down = random.uniform(0.002, 0.02)
        shift = random.uniform(0, 0.1, d - 1)
        self.blocks = []
        for name, low, high, side in ("low", -0.6, 0, 1), ("up", 0, 0.6, -1):
            n = random.integers(3, 6 if d == 3 else 12, d)
            lines = [grid.even(-1, 1, int(k)) for k in n[:-1]] + [grid.even(low, high, 2 if d == 3 else int(n[-1]))]
            face, radius = self.faces[side < 0], self.radii[int(side < 0)]
            move = np.append(shift * (side < 0), 0)
            self.blocks.append(grid.Block(name, *lines, shape=self.shape(face, radius, side, high - low, move)))
        self.solver = str(random.choice(["theta=0", "theta_relative=0.1"])) + ", tolerance=1e-11"
        self.motion = np.linalg.qr(random.normal(size=(d, d)))[0]
        if np.linalg.det(self.motion) < 0:
            self.motion[:, 0] *= -1
        self.at = random.normal(size=d)

    def __str__(self):
        return "%s, %s on %s, %s" % (self.kind, *self.faces[::-1], self.solver)

    def shape(self, face, radius, side, height, move):
        """Take the sagitta of the face off, towards the other end of the block."""
        def shape(x):
            y = x + move
            square = {"flat": 0 * x[:, 0], "cylinder": x[:, 0]**2, "round": np.sum(x[:, :-1]**2, axis=1)}[face]
            y[:, -1] -= side * (1 - abs(x[:, -1]) / height) * (radius - np.sqrt(radius**2 - square))
            return y
        return shape

    def write(self, folder, motion):
        """The scene, moved; returns the matrix that moves vectors."""
        matrix, at, order = np.eye(self.d), np.zeros(self.d), 1
        if motion == "turned":
            matrix, at = self.motion, self.at
        if motion == "mirrored":
            matrix = np.diag([-1.0] + [1.0] * (self.d - 1))
        if motion == "renumbered":
            order = -1
        path = folder / "m.msh"
        grid.write_mesh(path, self.blocks, self.kind)
        move_mesh(path, matrix, at, motion == "mirrored", np.random.default_rng(1) if order < 0 else None)
        fix = "xyz"[:self.d]
        value = ",".join("%r" % float(c) for c in matrix[:, -1] * -self.down)
        bodies = ["&body name='%s', volume='%s', material='m' /" % (name, name) for name in ("low", "up")]
        plane = "" if self.d == 3 else ", analysis='plane_strain'"
        (folder / "case.nml").write_text("&scene mesh='m.msh'%s /\n" % plane + "\n".join(bodies[::order]) + """
&material name='m', young=1000, poisson=0.3 /
&support body='low', surface='bottom', fix='%s' /
&support body='up', surface='top', fix='%s', value=%s /
&contact name='c', surface_a='low:top', surface_b='up:bottom' /
&solver %s /\n""" % (fix, fix, value, self.solver))
        return matrix

    def run(self, folder, motion=""):
        """Exit code; energy, force in the frame of the scene, sum of gaps, greatest pressure, sum of their
        uncertainties."""
        folder = pathlib.Path(folder)
        matrix = self.write(folder, motion)
        done = subprocess.run([os.environ["DOTYK"], "case.nml", "--verbose", "--threads", "1"], cwd=folder, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode > 1:
            raise RuntimeError(done.stdout)
        with h5py.File(folder / "case.vtkhdf", "r") as file:
            contact = file["dotyk/contact/c"]
            force = contact.attrs["force"][:self.d] @ matrix
            return done.returncode, np.array([file["dotyk/summary"].attrs["energy"], *force,
                                              np.sum(contact["gap_initial"]),
                                              np.max(contact["pressure"]), np.sum(contact["gap_uncertainty"])])

    def differences(self, folder):
        """Greatest relative difference of each motion; infinite where the exit code differs."""
        code, here = self.run(folder)
        scale = np.maximum(abs(here), [1e-6] + [max(1e-3, np.max(abs(here[1:-3])))] * self.d + [1e-3, 1e-3, 1e-3])
        found = {}
        for motion in MOTIONS:
            other, there = self.run(folder, motion)
            found[motion] = np.inf if other != code else np.max(abs(there - here) / scale)
        return found


def move_mesh(path, matrix, at, is_mirrored, random):
    """Turn or mirror a mesh file, and put nodes and elements in another order."""
    lines = path.read_text().split("\n")
    start, stop = lines.index("$Nodes") + 2, lines.index("$EndNodes")
    first, last = lines.index("$Elements") + 2, lines.index("$EndElements")
    nodes = [line.split() for line in lines[start:stop]]
    d = len(at)
    x = np.array([words[1:] for words in nodes], float)
    x[:, :d] = x[:, :d] @ matrix.T + at
    number = {words[0]: k for k, words in enumerate(nodes)}
    new = np.arange(len(x)) if random is None else random.permutation(len(x))
    elements = []
    for line in lines[first:last]:
        words = line.split()
        kind, tags, own = int(words[1]), words[2:5], [new[number[n]] + 1 for n in words[5:]]
        if is_mirrored:
            own = [own[k] for k in MIRRORED[kind]]
        elements.append((words[1], *tags, *map(str, own)))
    if random is not None:
        elements = [elements[k] for k in random.permutation(len(elements))]
    place = np.empty_like(x)
    place[new] = x
    lines[start:stop] = ["%d %r %r %r" % (k + 1, *map(float, p)) for k, p in enumerate(place)]
    first, last = lines.index("$Elements") + 2, lines.index("$EndElements")
    lines[first:last] = ["%d %s" % (k + 1, " ".join(e)) for k, e in enumerate(elements)]
    path.write_text("\n".join(lines))
