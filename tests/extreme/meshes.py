#!/usr/bin/python3
"""Extreme meshes: layers of aspect 1e4, slivers, jumps of the mesh size across a pair, one element against ten
thousand.

The answer is linear in each body, so every mesh has it exactly.
"""
import numpy as np

import extreme
from stack import SHORTENING, Layer, stack

KINDS = ["quad4", "tri3", "hex8", "tet4"]


def scenes(grid):
    """Layers, slivers, jumps."""
    yield from layers(grid)
    yield from slivers(grid)
    yield from jumps(grid)


def layers(grid):
    """A thin layer between two blocks, as soft, as stiff as they and stiffer; elements as flat as the layer is thin.

    Where it is so thin and soft that it resists bending 1e12 times less than pressing, single forces on it have no
    digits: the answer has those that are left, or says that there are none. A layer that is shortened by more than its
    thickness lets the blocks pass through it, and the log says so.
    """
    for thickness in ["1e-2", "1e-4", "1e-6"] if grid else ["1e-4"]:
        for kind in KINDS if grid else ["tri3", "hex8"]:
            for young in ["1e-4", "1", "1e4"]:
                hopeless = (thickness, young) == ("1e-6", "1e-4")
                t, e = float(thickness), float(young)
                squeezed = SHORTENING*(t/e)/(t/e + 2) > t
                digits = 1e-19/(float(thickness)**2*float(young))
                for theta in ["1e-4", "0"] if grid else ["0"]:
                    parts = [Layer(across=3), Layer(young=float(young), height=float(thickness), across=2, along=1),
                             Layer(across=1, along=1)]
                    yield stack("layer of %s, E %s, %s, theta %s" % (thickness, young, kind, theta), parts,
                                float(theta), kind, solver="tolerance=%g" % max(1e-9, 10*digits),
                                allowed=1 if hopeless else max(1e-9, 10*digits),
                                code=1 if hopeless or squeezed else 0, message="penetration" if squeezed else ())


def slivers(grid):
    """Lines of the grid so near to each other that elements have hardly a volume left, in the bodies and on the faces
    that touch.

    Facets narrower than 1e-6 of their length count as the edge that they are beside.
    """
    for kind in ["tri3", "tet4"]:
        for least in ["1e-2", "1e-4", "1e-6", "1e-8"] if grid else ["1e-6"]:
            lines = [0, 0.5*float(least), 0.5, 1 - float(least), 1]
            parts = [Layer(across=lines, along=lines), Layer(across=3, along=2)]
            lost = 10*float(least) if least == "1e-6" and kind == "tet4" else 0.0
            refused = (least, kind) == ("1e-8", "tet4")
            yield stack("slivers of %s, %s" % (least, kind), parts, 0.0, kind, solver="tolerance=1e-9",
                        allowed=max(1e-7, lost),
                        unprojected=lost, code=3 if refused else 0, message="tet4.*degenerate" if refused else ())


def jumps(grid):
    """A few facets against many, either side with the contact points."""
    counts = {"quad4": [100, 1000, 10000], "tri3": [100, 1000], "hex8": [10, 30, 100], "tet4": [10, 30]}
    for kind in KINDS:
        for many in counts[kind] if grid else counts[kind][:1]:
            for swap in (False, True):
                for theta in ["1e-2", "1e-8", "0"] if grid else ["0"]:
                    fine = Layer(across=many, along=graded(many))
                    parts = [fine, Layer(young=3.0, across=1, along=1)]
                    name = "1 against %d, %s, theta %s%s" % (many**(1 if kind in ("quad4", "tri3") else 2), kind, theta,
                                                             ", swapped"*swap)
                    yield stack(name, parts, float(theta), kind, swap=swap)


def graded(many):
    """Few elements along the block, as small as its facets at the top."""
    line = [1.0]
    step = 1.0/many
    while line[-1] - 1.5*step > 0:
        line.append(line[-1] - step)
        step *= 3
    return np.array(line + [0.0])[::-1]


extreme.main(scenes) if __name__ == "__main__" else None
