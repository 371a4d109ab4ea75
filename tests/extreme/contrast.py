#!/usr/bin/python3
"""Stiffness contrast from 1e-8 to 1e8, and theta_relative from 1e2 to 1e-12 and 0: a stack of two blocks of different
meshes."""
import itertools

import extreme
from stack import Layer, stack

CONTRASTS = ["1e%d" % k for k in (-8, -6, -4, -2, 0, 2, 4, 6, 8)]
THETAS = ["1e2", "1", "1e-2", "1e-4", "1e-6", "1e-8", "1e-10", "1e-12", "0"]
WAYS = ["linear_solver='direct'", "linear_solver='iterative'"]


def scenes(grid):
    """Contrast by theta; then the ways to solve, and the schemes where they converge."""
    quick = [("1e-8", "0"), ("1e-8", "1e2"), ("1", "1e-12"), ("1e4", "1e-8"), ("1e8", "1e-12"), ("1e8", "1e-2"),
             ("1e8", "0")]
    for contrast, theta in itertools.product(CONTRASTS, THETAS) if grid else quick:
        yield two_blocks("contrast %s theta %s" % (contrast, theta), contrast, theta)
    for contrast, theta in itertools.product(("1e-8", "1e8"), ("1e-12", "0") if grid else ("0",)):
        for way in WAYS:
            yield two_blocks("contrast %s theta %s %s" % (contrast, theta, way), contrast, theta,
                             "tolerance=1e-12, " + way)
    for contrast in ("1e-8", "1e8"):
        for scheme in ("neumann", "robin"):
            yield two_blocks("contrast %s theta 1 %s" % (contrast, scheme), contrast, "1",
                             "tolerance=1e-10, scheme='%s'" % scheme)


def two_blocks(name, contrast, theta, solver="tolerance=1e-12"):
    """The upper block is so many times as stiff."""
    layers = [Layer(young=2e11, poisson=0.2, across=3), Layer(young=2e11*float(contrast), across=2, along=3)]
    return stack(name, layers, float(theta), solver=solver)


extreme.main(scenes) if __name__ == "__main__" else None
