#!/usr/bin/python3
"""Bodies that nothing holds, and that hardly anything holds: chains of them, balanced, turned against nothing, held by
one facet, hung on layers that are 1e18 times softer. Right by statics: forces, their moments, and uniaxial stress where
Poisson's ratio is 0.
"""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]/"cases"))
import extreme  # noqa: E402
from digits import column_of  # noqa: E402
from extreme import Scene  # noqa: E402
from free_extreme import DISC, RIDGE, SOCKET, balls  # noqa: E402
from grid import Block, dimension, even, write_mesh  # noqa: E402

THETAS = ("1e-2", "1e-8", "0")


def scenes(grid):
    """Towers; rows; one facet; soft layers; edges; motions that nothing stops; balls."""
    for kind in ("quad4", "tri3", "hex8", "tet4") if grid else ("quad4", "hex8"):
        for many in (2, 10, 100) if grid and kind != "tet4" else (10,):
            for contrast in ("1e-6", "1", "1e6") if grid else ("1e6",):
                for theta in THETAS if grid else ("0",):
                    yield tower(kind, many, contrast, theta)
    for many in (3, 30, 100) if grid else (30,):
        for theta in THETAS if grid else ("0",):
            yield row(many, theta)
    for kind in ("quad4", "tri3", "hex8", "tet4") if grid else ("hex8",):
        for size in ("1e-2", "1e-4", "1e-6") if grid else ("1e-4",):
            for theta in THETAS if grid else ("0",):
                yield one_facet(kind, size, theta)
    for kind in ("quad4", "hex8"):
        for soft in ["1e-%d" % k for k in (2, 4, 6, 8, 10, 12, 14, 16, 18)] if grid else ["1e-8"]:
            for theta in THETAS[1:] if grid else ("0",):
                yield hung(kind, soft, theta)
    for theta in THETAS if grid else ("0",):
        yield from edges(theta)
        yield from turned(theta)
        yield from alone(theta)
    for n in (2, 3, 5) if grid else ():
        for theta in ("theta_mesh=1e-2", "theta=0"):
            yield in_a_box(n, theta)


def text_of(kind, lines, theta, tolerance="1e-10", materials=("&material name='m', young=1, poisson=0 /",)):
    """The input."""
    analysis = "3d" if dimension(kind) == 3 else "plane_strain"
    return "\n".join(["&scene analysis='%s', mesh='blocks.msh' /" % analysis, *materials, *lines,
                      "&solver theta_relative=%s, tolerance=%s /" % (theta, tolerance)]) + "\n"


def written(blocks, kind):
    """What writes the mesh."""
    return lambda folder: write_mesh(folder/"blocks.msh", blocks, kind)


def tower(kind, many, contrast, theta):
    """Blocks on a held one, every other one so many times as stiff, pressed on top; bricks have weight too.

    Nothing holds them sideways: least motions, none of which is sideways.
    """
    d, pressure = dimension(kind), 1e-3
    weight = 1e-4 if kind in ("quad4", "hex8") else 0.0
    up = "xyz"[d - 1]
    young = [1.0 if k % 2 == 0 else float(contrast) for k in range(many + 1)]
    blocks = [Block(str(k), *[even(0, 1, 2 + k % 2)]*(d - 1), even(k, k + 1, 2)) for k in range(many + 1)]
    lines = ["&support body='0', surface='bottom', fix='%s' /" % "xyz"[:d],
             "&load body='%d', surface='top', pressure=%r /" % (many, pressure)]
    lines += ["&body name='%d', volume='%d', material='%d' /" % (k, k, k % 2) for k in range(many + 1)]
    lines += ["&contact name='%d', surface_a='%d:bottom', surface_b='%d:top' /" % (k, k, k - 1)
              for k in range(1, many + 1)]
    if weight > 0:
        lines += ["&load body='%d', force_density=%s%r /" % (k, "0,"*(d - 1), -weight) for k in range(many + 1)]
    materials = ["&material name='%d', young=%r, poisson=0 /" % (i, young[i]) for i in (0, 1)]
    joint = [pressure + weight*(many + 1 - k) for k in range(many + 2)]  # pressures at z = k
    # scheme of pairs: theta_relative (h_a/E_a + h_b/E_b), heights 1
    layer = float(theta)*(1 + 1/young[1])

    def check(answer):
        right, floor = np.zeros_like(answer.displacement), 0.0
        for k, here in ((k, answer.node_bodies() == k) for k in range(many + 1)):
            z = answer.points[here, d - 1] - k
            right[here, d - 1] = floor - (joint[k]*z - weight*z*z/2)/young[k]
            floor += -(joint[k] - weight/2)/young[k] - layer*joint[k + 1]
        forces = [abs(answer.pairs[str(k)]["force"][d - 1]/joint[k] - 1) for k in range(1, many + 1)]
        yield max(forces), 1e-9, "forces along %s" % up
        wrong = [np.abs(answer.pairs[str(k)]["pressure"]/joint[k] - 1).max() for k in range(1, many + 1)]
        # what alternates on the face of a stiff block does not move the soft one: last digits of gaps times the stiff
        # modulus
        digit = np.spacing(np.abs(right).max())*max(young)/pressure
        yield max(wrong), 1e-9 + 20*digit, "pressure"
        error = answer.energy_error(right)
        yield error, answer.reported(), "energy norm against the bound"
        yield np.abs(answer.displacement - right).max()/np.abs(right).max(), 1e-8, "displacement"

    return Scene("tower of %d, %s, contrast %s, theta %s" % (many, kind, contrast, theta),
                 text_of(kind, lines, theta, materials=materials), written(blocks, kind), check)


def row(many, theta):
    """Blocks on a smooth floor, pushed against a wall: the push arrives, the floor carries each."""
    blocks = []
    for k in range(many):
        low, high = float(k), float(k + 1)
        blocks.append(Block("b%d" % k, even(low, high, 2), even(0, 1, 2), patches={
            "left": lambda x, low=low: np.all(x[:, 0] == low), "right": lambda x, high=high: np.all(x[:, 0] == high)}))
    blocks += [Block("floor", even(0, many, many + 1), even(-1, 0, 2)),
               Block("wall", even(many, many + 1, 1), even(0, 1, 3), patches={
                   "left": lambda x: np.all(x[:, 0] == many), "right": lambda x: np.all(x[:, 0] == many + 1)})]
    lines = ["&body name='%s', volume='%s', material='m' /" % (block.name, block.name) for block in blocks]
    lines += ["&support body='floor', surface='bottom', fix='xy' /",
              "&support body='wall', surface='right', fix='xy' /",
              "&load body='b0', surface='left', pressure=1e-2 /"]
    lines += ["&load body='b%d', force_density=0,-1e-3 /" % k for k in range(many)]
    lines += ["&contact name='on %d', surface_a='b%d:bottom', surface_b='floor:top' /" % (k, k) for k in range(many)]
    following = ["b%d" % k for k in range(1, many)] + ["wall"]
    lines += ["&contact name='joint %d', surface_a='b%d:right', surface_b='%s:left' /" % (k, k, name)
              for k, name in enumerate(following)]

    def check(answer):
        yield max(abs(answer.pairs["joint %d" % k]["force"][0] + 1e-2) for k in range(many)), 1e-11, "push"
        yield max(abs(answer.pairs["on %d" % k]["force"][1] - 1e-3) for k in range(many)), 1e-11, "weight"
        yield answer.bound, 1e-10, "bound"

    return Scene("row of %d, theta %s" % (many, theta), text_of("quad4", lines, theta), written(blocks, "quad4"), check)


def resultant(answer, name):
    """Force of a pair along its normal, and where it acts."""
    pair = answer.pairs[name]
    force = pair["weight"]*pair["pressure"]
    return force.sum(), force @ pair["position"]/force.sum()


def one_facet(kind, size, theta):
    """A block under its weight on another, held sideways by one facet of this size near the ground, against a wind on
    its other side."""
    d, least = dimension(kind), float(size)
    up, wind, weight = d - 1, 0.1, 1.0
    tolerance = "1e-8" if least > 1e-5 else "1e-3"  # elements of aspect 1e6 leave 4 digits under a single force
    line, across = [0, least, 0.25, 0.5, 1], [0, 0.5, 1]
    spot = {"spot": lambda x: np.all(x[:, 0] == 1) and np.all(x[:, up] <= 1 + least)
            and (d == 2 or np.all(x[:, 1] <= 0.5)),
            "lee": lambda x: np.all(x[:, 0] == 0)}
    high = Block("block", *[[0, 0.3, 0.7, 1], across][:d - 1], np.array(line) + 1, patches=spot)
    blocks = [Block("ground", *[even(-0.5, 1.5, 5)]*(d - 1), even(0, 1, 3)), high]
    lines = ["&body name='%s', volume='%s', material='m' /" % (name, name) for name in ("ground", "block")]
    lines += ["&support body='ground', surface='bottom', fix='%s' /" % "xyz"[:d],
              "&support body='block', surface='spot', fix='%s' /" % "xy"[:d - 1],
              "&load body='block', force_density=%s%r /" % ("0,"*(d - 1), -weight),
              "&load body='block', surface='lee', traction=%r%s /" % (wind, ",0"*(d - 1)),
              "&contact name='joint', surface_a='block:bottom', surface_b='ground:top' /"]

    def check(answer):
        force, place = resultant(answer, "joint")
        yield abs(force/weight - 1), 1e-9, "weight"
        # the wind acts at the middle of the side, what holds against it on the spot
        yield abs(place[0] - 0.5 - wind*0.5/weight), wind*least + 1e-8, "where the weight acts"
        yield answer.bound, float(tolerance), "bound"

    return Scene("held by a facet of %s, %s, theta %s" % (size, kind, theta), text_of(kind, lines, theta, tolerance),
                 written(blocks, kind), check)


def hung(kind, soft, theta):
    """A block on another one, hanging on a soft layer at its top; v = 0, so that elements in a column are springs."""
    d, n = dimension(kind), 4
    axis = "xyz"[d - 1]
    blocks = [Block(name, *[even(0, 1, 2)]*(d - 1), even(z, z + 1, n)) for z, name in enumerate(("lower", "upper"))]
    lines = ["&body name='lower', volume='lower', material='m' /",
             "&body name='upper', volume='upper', material='hung' /",
             "&support body='lower', surface='bottom', fix='%s' /" % "xyz"[:d],
             "&support body='upper', surface='top', fix='%s' /" % "xyz"[:d],
             "&load body='upper', force_density=%s-1 /" % ("0,"*(d - 1)),
             "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /"]
    materials = ["&material name='m', young=1, poisson=0 /",
                 "&material name='hung', young=1, poisson=0, young_formula='%s > 1.75 ? %s : 1' /" % (axis, soft)]
    springs = [1.0]*(n - 1) + [float(soft)]
    # beside 1, what is left of these
    refused = {"code": (0, 3),
               "message": "body 'upper'.*no significant digit.*young_formula"} if float(soft) < 1e-15 else {}

    def check(answer):
        exact = float(column_of(springs, 1))
        yield answer.pressure_error(exact), 1e-11 + 10*float(theta), "pressure"
        yield np.abs(answer.displacement[:, :d - 1]).max(), 1e-11, "displacement to the side"
        yield answer.bound, 1e-7, "bound"

    return Scene("hung on a layer of %s, %s, theta %s" % (soft, kind, theta),
                 text_of(kind, lines, theta, "1e-7", materials),
                 written(blocks, kind), check, moduli={"young": [1.0, 1.0], "poisson": [0.0, 0.0]}, **refused)


def plane(name, lines, theta, geometries, blocks=(), check=None, **others):
    """A plane scene of bodies that gmsh meshes, and of blocks."""
    text = ["&scene analysis='plane_strain' /", "&material name='m', young=200, poisson=0.3 /", *lines]
    text += ["&body name='%s', mesh='%s.geo', volume='%s', material='m' /" % (key, key, key) for key in geometries]
    text += ["&body name='%s', mesh='blocks.msh', volume='%s', material='m' /" % (block.name, block.name)
             for block in blocks]
    text += ["&solver theta_relative=%s, tolerance=1e-8 /" % theta]

    def write(folder):
        for key, geometry in geometries.items():
            (folder/(key + ".geo")).write_text(geometry)
        if blocks:
            write_mesh(folder/"blocks.msh", blocks, "quad9")

    return Scene("%s, theta %s" % (name, theta), "\n".join(text) + "\n", write, check, **others)


def edges(theta):
    """A beam whose weight is exactly above an edge, or above the rim of its support, or beside it."""
    for beside in (0.0, 1e-9, -1e-3, 0.1):
        beam = Block("beam", even(-2 + beside, 2 + beside, 4), even(1, 2, 4))
        lines = ["&support body='ridge', surface='bottom', fix='xy' /", "&load body='beam', force_density=0,-1 /",
                 "&contact name='joint', surface_a='ridge:sides', surface_b='beam:bottom' /"]
        # it would tip until it lies on the side of the ridge: no small rotation; weak springs carry less than 1 %
        refused = {"code": 3, "message": ["body 'beam'", "rotation about"]} if abs(beside) > 0.01 else {}

        def balanced(answer, beside=beside):
            yield abs(answer.pairs["joint"]["force"][1] + 4), 1e-5 if beside < 0 else 1e-7, "weight"
            yield answer.bound, 1e-8, "bound"

        yield plane("balanced on an edge, %g beside it" % beside, lines, theta, {"ridge": RIDGE}, [beam], balanced,
                    **refused)
    for beside in (-1e-3, 0.0, 1e-6, 0.1):
        blocks = [Block("post", even(-0.5, 0.5, 2), even(0, 1, 2)),
                  Block("beam", even(-1.5 + beside, 2.5 + beside, 4), even(1, 2, 4))]
        lines = ["&support body='post', surface='bottom', fix='xy' /", "&load body='beam', force_density=0,-1 /",
                 "&contact name='joint', surface_a='post:top', surface_b='beam:bottom' /"]
        refused = {} if beside <= 0.01 else {"code": 3, "message": ["body 'beam'", "rotation about"]}
        yield plane("on the rim of its support, %g beyond it" % beside, lines, theta, {}, blocks, balanced, **refused)


def turned(theta):
    """A disc in a frictionless socket, and on a floor."""
    socket = ["&support body='socket', surface='bottom', fix='xy' /",
              "&contact name='joint', surface_a='disc:rim', surface_b='socket:hole' /"]
    weight = ["&load body='disc', force_density=0,-1 /"]
    torque = ["&load body='disc', surface='rim', traction_formula='-0.1*(y-1)','0.1*x' /"]

    def carries(answer):
        yield abs(answer.pairs["joint"]["force"][1]/np.pi - 1), 1e-3, "weight"  # of facets inside the circle
        yield answer.bound, 1e-8, "bound"

    yield plane("disc in a socket", socket + weight, theta, {"disc": DISC, "socket": SOCKET}, check=carries)
    yield plane("disc in a socket, turned", socket + weight + torque, theta, {"disc": DISC, "socket": SOCKET}, code=3,
                message=["body 'disc'", "rotation about", "a rigid body mode that neither supports nor contact resist"])
    floor = [Block("floor", even(-3, 3, 12), even(-1, 0, 2))]
    ground = ["&support body='floor', surface='bottom', fix='xy' /",
              "&contact name='joint', surface_a='disc:rim', surface_b='floor:top' /"]
    yield plane("disc on a floor", ground + weight, theta, {"disc": DISC}, floor, carries)
    yield plane("disc on a floor, pushed", ground + ["&load body='disc', force_density=0.1,-1 /"], theta,
                {"disc": DISC}, floor, code=3,
                message=["body 'disc'", "translation along \\(1, 0\\)",
                         "a rigid body mode that neither supports nor contact resist"])


def alone(theta):
    """Two blocks that press on each other and nothing else; loads that do not balance; a body that nothing touches."""
    blocks = [Block("a", even(0, 1, 3), even(0, 1, 3)), Block("b", even(0, 1, 2), even(1, 2, 2))]
    for extra, code in (("0", 0), ("1e-3", 3), ("1e-6", 3)):
        lines = ["&contact name='joint', surface_a='b:bottom', surface_b='a:top' /",
                 "&load body='a', surface='bottom', pressure=1 /",
                 "&load body='b', surface='top', pressure=%r /" % (1 + float(extra))]

        def uniform(answer):
            yield answer.pressure_error(1.0), 1e-9, "pressure"
            yield np.abs(answer.displacement).max(), 2/200*(1 + 10*float(theta)), "displacement"

        yield plane("two alone, loads differ by " + extra, lines, theta, {}, blocks, uniform, code=code,
                    message=["translation along \\(0, 1\\)",
                             "a rigid body mode that neither supports nor contact resist"] if code else [])

    def nothing(answer):
        yield np.abs(answer.displacement).max(), 0.0, "displacement"

    yield plane("one alone", [], theta, {}, blocks[:1], nothing, message="not determined by contact: any motion of '")


def in_a_box(n, theta):
    """Balls on each other in a box under gravity (benchmarks/balls.py)."""
    def write(folder):
        balls.write_scene(folder, (n, n, n), theta + ", tolerance=1e-6")
        (folder/"balls.nml").rename(folder/"scene.nml")

    def check(answer):
        weight, spread, floor, _ = balls.check_statics(answer.path, answer.log)
        yield spread, 1e-10, "forces on a ball against its weight"
        yield floor, 1e-9*n**3, "the floor against all weights"
        yield answer.bound, 1e-6, "bound"

    return Scene("%d balls in a box, %s" % (n**3, theta), None, write, check)


extreme.main(scenes) if __name__ == "__main__" else None
