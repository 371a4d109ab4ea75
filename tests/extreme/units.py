#!/usr/bin/python3
"""Units, places, orders: the same scene again, which must give the same answer.

The scene: an orthotropic block with a slope below, pressed on another that is not meshed alike, a third beside it;
partial contact. Coordinates are whole numbers of 2^-20, so that moves by powers of two do not round them; rotations and
other units do, and what that costs is allowed: gaps of 1e-4 from coordinates of size 1 keep 12 digits.
"""
import numpy as np

import extreme
from extreme import Scene
from grid import Block, even, write_mesh

GRAIN = 2.0**20
# tolerance 1e-12 of the energy norm; pressures are less exact than that by the square root of a point's part of the
# energy
CLOSE = 1e-9


def rotation(angle=0.7):
    """A rotation about a skew axis (Rodrigues)."""
    axis = np.array([1.0, 2.0, 3.0])/np.sqrt(14)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle)*k + (1 - np.cos(angle))*k @ k


def vector(x):
    """Text of a vector for the input."""
    return ",".join(repr(float(c)) for c in x)


def whole(x):
    """Coordinates on the grid of 2^-20."""
    return np.round(np.asarray(x)*GRAIN)/GRAIN


def slope(x):
    """The lower face of the upper block gets a slope."""
    y = x.copy()
    y[:, 2] += 2e-4*x[:, 0]*(2 - x[:, 2])
    return whole(y)


class Variant:
    """How the scene is written: x -> length (turn x + shift), stresses times stress, orders reversed, sides swapped."""

    def __init__(self, name, turn=np.eye(3), shift=(0, 0, 0), length=1.0, stress=1.0, backwards=False, swap=False,
                 close=CLOSE,
                 kind="hex8", solver="tolerance=1e-12", theta="theta=0.004"):
        self.name, self.turn, self.shift, self.length, self.stress = name, turn, np.array(shift, float), length, stress
        self.backwards, self.swap, self.close, self.kind, self.solver, self.theta = (backwards, swap, close, kind,
                                                                                     solver, theta)

    def blocks(self):
        """The bodies, moved."""
        def place(shape):
            return lambda x: self.length*(shape(x) @ self.turn.T + self.shift)
        low = Block("lower", even(0, 1.5, 6), even(0, 1.375, 6), even(0, 1, 3), shape=place(whole))
        high = Block("upper", even(0.125, 0.875, 4), even(0.1875, 1.1875, 4), even(1, 2, 3), shape=place(slope))
        other = Block("other", even(1.0625, 1.375, 2), even(0.1875, 1.1875, 2), even(1, 2, 2), shape=place(whole))
        return [low, high, other]

    def text(self):
        """The namelist."""
        stress, length, turn = self.stress, self.length, self.turn
        theta = self.theta
        if theta.startswith("theta="):
            theta = "theta=%r" % (float(theta[6:])*length/stress)
        bodies = ["&body name='%s', volume='%s', material='%s' /" % (body, body, "wood" if body == "upper" else "stone")
                  for body in ("lower", "upper", "other")]
        held = ["&support body='lower', surface='bottom', fix='xyz' /",
                "&support body='upper', surface='top', fix='n', value=0,0,%r /" % (-1.5e-4*length),
                "&support body='upper', surface='sides y', fix='n' /",
                "&support body='upper', surface='sides x', fix='n' /",
                "&support body='other', surface='top', fix='xyz', value=%s /"
                % vector(length*turn @ [1e-5, 2e-5, -3e-4]),
                "&load body='lower', surface='sides x', traction=%s /" % vector(stress*turn @ [0.01, 0.02, -0.015]),
                "&load body='other', surface='sides y', pressure=%r /" % (0.01*stress),
                "&load body='lower', force_density=%s /" % vector(stress/length*turn @ [0, 0.004, -0.01])]
        sides = ["'upper:bottom'", "'lower:top'"][::-1 if self.swap else 1]
        pairs = ["&contact name='touch', surface_a=%s, surface_b=%s /" % tuple(sides),
                 "&contact name='beside', surface_a='other:bottom', surface_b='lower:top' /"]
        material = ["&material name='stone', young=%r, poisson=0.25 /" % (100*stress),
                    "&material name='wood', young=%s, poisson=0.3,0.2,0.25, shear=%s, axis_1=%s, axis_2=%s /" % (
                        vector(stress*np.array([200, 60, 40])), vector(stress*np.array([30, 25, 20])),
                        vector(turn @ [1, 1, 0]), vector(turn @ [0, 0, 1]))]
        order = -1 if self.backwards else 1
        return "\n".join(material + bodies[::order] + held[::order] + pairs[::order] + [
            "&scene title='three blocks', mesh='blocks.msh' /", "&solver %s, %s /" % (theta, self.solver)]) + "\n"

    def write(self, folder):
        """The mesh."""
        write_mesh(folder/"blocks.msh", self.blocks()[::-1 if self.backwards else 1], self.kind)

    def back(self, answer):
        """Displacements in the units and places of the reference, bodies in its order."""
        body = answer.node_bodies()
        order = np.argsort(-body if self.backwards else body, kind="stable")
        return answer.displacement[order] @ self.turn/self.length

    def check(self, answer):
        """Against the reference with the same theta and elements."""
        reference = Variant("reference", kind=self.kind, theta=self.theta)
        found = solved(reference)
        exact, moved = found.displacement, self.back(answer)
        wrong = extreme.energy_norm(found.results, moved - exact)/extreme.energy_norm(found.results, exact)
        if self.swap:
            yield np.abs(moved - exact).max()/np.abs(exact).max(), self.close, "displacement"
            return
        yield wrong, self.close, "energy norm"
        yield wrong, self.close + answer.bound + found.bound, "energy norm against the bounds"
        for name in found.pairs:
            one, two = found.pairs[name]["pressure"], answer.pairs[name]["pressure"]/self.stress
            yield np.abs(two - one).max()/one.max(), 10*self.close, "pressure of " + name
        energy = answer.summary["energy"]/self.stress/self.length**3/found.summary["energy"]
        yield abs(energy - 1), self.close, "energy"

    def scene(self):
        """The scene to run."""
        return Scene(self.name, self.text(), self.write, self.check)


REFERENCES = {}


def solved(reference):
    """The answer of a reference, once."""
    key = reference.text() + reference.kind
    if key not in REFERENCES:
        REFERENCES[key] = extreme.solved(Scene("reference", reference.text(), reference.write))
    return REFERENCES[key]


def scenes(grid):
    """Units; moves; orders; sides."""
    for kind in ("hex8", "tet4") if grid else ("hex8",):
        thetas = ("theta=0.004", "theta_mesh=1e-2", "theta=1e-9", "theta=0") if grid else ("theta=0.004", "theta=0")
        for theta in thetas:
            words = ", %s, %s" % (kind, theta)
            options = {"kind": kind, "theta": theta}
            # gaps of 1e-4 come from coordinates of 1: their digits are 1e-12 of the gaps
            for name, length, stress in (("millimetres and megapascals", 1e3, 1e-6),
                                         ("micrometres and gigapascals", 1e6, 1e-9), ("lengths of 1e-9", 1e-9, 1.0),
                                         ("lengths of 1e30", 1e30, 1.0), ("stresses of 1e-30", 1.0, 1e-30),
                                         ("stresses of 1e30", 1.0, 1e30)):
                yield Variant(name + words, length=length, stress=stress, **options).scene()
            if theta == "theta_mesh=1e-2" or grid is False or theta == "theta=0.004":
                yield Variant("turned by a quarter" + words, turn=np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
                              **options).scene()
            for angle in (0.7, 1e-3, 1e-9):
                yield Variant("turned by %g%s" % (angle, words), turn=rotation(angle), **options).scene()
            for far in (2.0**10, 2.0**20):
                yield Variant("moved by %g%s" % (far, words), shift=(far, -far, far), **options).scene()
            # a shift that rounds coordinates: 1e6 sizes leave 1e-10, of gaps of 1e-4 that is 1e-6
            yield Variant("moved by 1e6 sizes" + words, shift=(1e6/3, -1e6/7, 1e6/11), close=1e-6, **options).scene()
            yield Variant("in another order" + words, backwards=True, **options).scene()
            yield Variant("sides swapped" + words, swap=True, close=0.05, **options).scene()


extreme.main(scenes) if __name__ == "__main__" else None
