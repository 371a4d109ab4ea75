#!/usr/bin/python3
"""Contact that is at the edge of being one: gaps of nothing, overlap, grazing, one point, surfaces beside surfaces;
peaks of load."""
import numpy as np

import extreme
from energy_norm import orthotropic
from extreme import Scene
from grid import Block, dimension, even, write_mesh
from stack import SHORTENING, Layer, stack

THETAS = ("1e-2", "1e-8", "0")


def scenes(grid):
    """Gaps; materials; one point; edges; peaks; two on one."""
    for theta in THETAS if grid else ("1e-8", "0"):
        for gap in (0.0, 1e-16, -1e-16, 1e-9, -1e-4, SHORTENING/3, SHORTENING*(1 - 1e-10), SHORTENING,
                    SHORTENING*(1 + 1e-10), 0.5):
            layers = [Layer(across=3), Layer(young=2.0)]
            words = "gap %.11g, theta %s" % (gap, theta)
            if grid or gap in (0.0, -1e-4, 0.5):
                yield stack(words + ", drawn", layers, float(theta), gap=gap,
                            allowed=max(1e-9, 1e-15/max(1e-30, abs(SHORTENING - gap))))
            yield stack(words, layers, float(theta), given_gap=gap,
                        allowed=max(1e-9, 1e-15/max(1e-30, abs(SHORTENING - gap))))
    yield from anisotropic(grid)
    for theta in THETAS if grid else ("0",):
        for kind in ("hex8", "tet4", "quad4", "tri3") if grid else ("hex8", "quad4"):
            yield one_point(kind, theta)
        yield peak(theta)
        yield two_on_one(theta)
    for overlap in (0.5, 1e-3, 1e-6, 1e-9, 0.0, -0.5):
        for theta in THETAS if grid else ("0",):
            yield overhang(overlap, theta)


def anisotropic(grid):
    """Moduli that differ by 1e4, the stiff axis along the stack or across it."""
    for along in (1e4, 1e-4):
        young = (1.0, 0.5, along)
        ratios, shear = (0.2, 0.2*min(1, 1/along), 0.1*min(1, 0.5/along)), (0.3, 0.2*min(1, along), 0.25*min(1, along))
        stiff = orthotropic(young, ratios, shear, (1, 0, 0), (0, 1, 0))[2, 2]
        keys = "young=%r,%r,%r, poisson=%r,%r,%r, shear=%r,%r,%r" % (*young, *ratios, *shear)
        for theta in THETAS if grid else ("0",):
            yield stack("moduli of 1 to %g, theta %s" % (along, theta),
                        [Layer(across=3), Layer(material=keys, stiff=stiff)], float(theta))


    for kind in ("quad9", "hex8") if grid else ("quad9",):
        yield refined(kind)


def refined(kind):
    """Fibres 1e4 times as stiff as what is around them, askew, under a narrow block: on meshes of half the size answers
    come nearer.

    Linear elements askew to fibres lock: quad4 converge from 128 divisions on.
    """
    d = dimension(kind)

    def scene(n, check=None):
        blocks = [Block("lower", *[even(0, 1, n)]*d),
                  Block("upper", *[even(0.25, 0.75, max(2, n//2))]*(d - 1), even(1, 1.5, max(2, n//2)))]
        axes = "axis_1=1,2,0, axis_2=-2,1,0" if d == 2 else "axis_1=1,0.5,2, axis_2=0,1,0"
        text = ["&scene analysis='%s', mesh='blocks.msh' /" % ("3d" if d == 3 else "plane_strain"),
                "&material name='fibres', young=1e4,1,1, poisson=0.3,0.3,0.3, shear=0.4,0.4,0.4, %s /" % axes,
                "&material name='unit', young=1, poisson=0.3 /",
                "&body name='lower', volume='lower', material='fibres' /",
                "&body name='upper', volume='upper', material='unit' /",
                "&support body='lower', surface='bottom', fix='%s' /" % "xyz"[:d],
                "&support body='upper', surface='top', fix='%s', value=%s-1e-3 /" % ("xyz"[:d], "0,"*(d - 1)),
                "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                "&solver theta_relative=1e-4, tolerance=1e-10 /"]
        return Scene("fibres, %s" % kind, "\n".join(text) + "\n",
                     lambda folder: write_mesh(folder/"blocks.msh", blocks, kind), check)

    first = 8 if d == 2 else 3

    def check(answer):
        found = [answer, *(extreme.solved(scene(first*2**k)) for k in (1, 2))]
        energy = [each.summary["energy"] for each in found]
        mesh = [each.summary["error_discretization"] for each in found]
        yield abs(energy[2] - energy[1]), 0.7*abs(energy[1] - energy[0]), "change of the energy from mesh to mesh"
        yield mesh[2], 0.9*mesh[1], "estimated error of the mesh"
        yield mesh[1], 0.9*mesh[0], "estimated error of the mesh"
        yield answer.bound, 1e-10, "bound"

    return scene(first, check)


def pressed(name, blocks, kind, pairs, force, theta, more=(), check=None, **others):
    """The first block stands on its bottom; the others carry tractions on their tops and slide along walls.

    The contact forces of the pairs must balance `force`, which the tops of all of them carry together.
    """
    d = 2 if kind in ("quad4", "tri3") else 3
    up = "xyz"[d - 1]
    text = ["&scene analysis='%s', mesh='blocks.msh' /" % ("3d" if d == 3 else "plane_strain"),
            "&material name='unit', young=1, poisson=0.3 /",
            "&support body='%s', surface='bottom', fix='%s' /" % (blocks[0].name, "xyz"[:d])]
    text += ["&body name='%s', volume='%s', material='unit' /" % (block.name, block.name) for block in blocks]
    text += ["&support body='%s', surface='sides %s', fix='%s' /" % (block.name, axis, axis)
             for block in blocks[1:] for axis in "xy"[:d - 1]]
    text += ["&contact name='%s', surface_a='%s', surface_b='%s' /" % pair for pair in pairs]
    text += ["&solver theta_relative=%s, tolerance=1e-12 /" % theta, *more]

    def balance(answer):
        total = sum(pair["force"] for pair in answer.pairs.values())
        yield abs(total[d - 1] - force)/force, 1e-9, "balance of the %s axis" % up
        # tolerance 1e-12, and what the last digits of the displacements are worth
        yield answer.bound, 1e-12 + 4*answer.rounding(), "bound"
        if check:
            yield from check(answer)

    return Scene(name, "\n".join(text) + "\n", lambda folder: write_mesh(folder/"blocks.msh", blocks, kind),
                 balance if not others else None, **others)


def one_point(kind, theta):
    """A pyramid stands on its tip: one contact point carries all."""
    d = 2 if kind in ("quad4", "tri3") else 3

    def pyramid(x):
        y = x.copy()
        y[:, d - 1] += 0.1*np.abs(x[:, :d - 1] - 0.5).sum(axis=1)*(2 - x[:, d - 1])
        return y

    blocks = [Block("lower", *[even(-0.5, 1.5, 7)]*(d - 1), even(0, 1, 3)),
              Block("upper", *[even(0, 1, 4)]*d, shape=pyramid)]
    blocks[1].lines[-1] = even(1, 2, 4)

    def single(answer):
        yield abs(np.count_nonzero(answer.pairs["tip"]["pressure"] > 0) - 1), 0, "points in contact, less one"

    return pressed("one point, %s, theta %s" % (kind, theta), blocks, kind, [("tip", "upper:bottom", "lower:top")],
                   1e-5, theta,
                   ["&load body='upper', surface='top', pressure=1e-5 /"], single)


def peak(theta):
    """A load of 1e3 on a millionth of the top."""
    width = 2.0**-10
    line = [0, width, 0.25, 0.5, 1]
    blocks = [Block("lower", even(0, 1, 3), even(0, 1, 3), even(0, 1, 2)), Block("upper", line, line, even(1, 2, 3))]
    load = "&load body='upper', surface='top', pressure_formula='x < %r && y < %r ? 1e3 : 0' /" % (width, width)
    return pressed("peak of a load, theta " + theta, blocks, "hex8", [("joint", "upper:bottom", "lower:top")],
                   1e3*width**2, theta, [load])


def two_on_one(theta):
    """Two blocks side by side on one: both press on the same surface."""
    blocks = [Block("lower", even(0, 2, 5), even(0, 1, 3), even(0, 1, 2)),
              Block("left", even(0, 1, 2), even(0, 1, 2), even(1, 2, 2)),
              Block("right", even(1, 2, 4), even(0, 1, 4), even(1, 2, 3))]
    loads = ["&load body='%s', surface='top', pressure=%s /" % load for load in (("left", "1e-3"), ("right", "2e-3"))]

    def each(answer):
        for name, force in (("left", 1e-3), ("right", 2e-3)):
            yield abs(answer.pairs[name]["force"][2]/force - 1), 1e-9, "force on " + name

    pairs = [(name, name + ":bottom", "lower:top") for name in ("left", "right")]
    return pressed("two on one surface, theta " + theta, blocks, "hex8", pairs, 3e-3, theta, loads, each)


def overhang(overlap, theta):
    """The upper block stands on the edge of the lower one with so much of its width; walls keep it upright."""
    blocks = [Block("lower", even(0, 1, 4), even(0, 1, 3), even(0, 1, 2)),
              Block("upper", even(1 - overlap, 2 - overlap, 3), even(0, 1, 2), even(1, 2, 2))]
    refused = {"code": 2, "message": "'joint'.*none of the .* points.*has a projection"} if overlap <= 0 else {}
    return pressed("overhang, %g of the width stands, theta %s" % (overlap, theta), blocks, "hex8",
                   [("joint", "upper:bottom", "lower:top")], 1e-3, theta,
                   ["&load body='upper', surface='top', pressure=1e-3 /"], **refused)


extreme.main(scenes) if __name__ == "__main__" else None
