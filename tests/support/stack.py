"""A stack of blocks between smooth walls, pushed together: uniaxial strain, so every mesh and every theta has an exact
answer."""
import numpy as np

from extreme import Scene
from grid import Block, dimension, even, write_mesh

SHORTENING = 1e-3


class Layer:
    """A block of a stack: height, Young's modulus, Poisson's ratio, lines of the grid (a number of divisions, or the
    line)."""

    def __init__(self, young=1.0, poisson=0.3, height=1.0, across=2, along=2, material=None, stiff=None):
        self.young, self.poisson, self.height, self.across, self.along = young, poisson, height, across, along
        # other materials bring their keys, and their stiffness along the stack where nothing can move sideways
        self.material = material or "young=%r, poisson=%r" % (young, poisson)
        self.stiff = stiff or young*(1 - poisson)/((1 + poisson)*(1 - 2*poisson))


def line(divisions, low, high):
    """A line of the grid between two coordinates, from a number of equal divisions or from fractions."""
    if np.ndim(divisions) == 0:
        return even(low, high, divisions)
    return low + (high - low)*np.asarray(divisions)


def exact(layers, theta, gap=0.0):
    """Pressure in a stack with these joints (theta absolute, one for all), and the displacements of the layers'
    ends."""
    pressure = (SHORTENING - gap*(len(layers) - 1))/(sum(q.height/q.stiff for q in layers) + (len(layers) - 1)*theta)
    if pressure < 0:  # the last layer comes down and touches nothing
        return 0.0, [(0.0, 0.0)]*(len(layers) - 1) + [(-SHORTENING, -SHORTENING)]
    ends, down = [], -SHORTENING
    for layer in reversed(layers):
        ends.append((down + pressure*layer.height/layer.stiff, down))
        down += pressure*layer.height/layer.stiff + theta*pressure + gap
    return pressure, ends[::-1]


def stack(name, layers, theta_relative=0.0, kind="hex8", gap=0.0, solver="tolerance=1e-12", width=1.0, allowed=1e-9,
          given_gap=None, swap=False, code=0, message=(), unprojected=0.0):
    """The scene; `gap` is drawn between all layers (overlap where negative), `given_gap` is what the input says
    instead.

    unprojected: fraction of the contact without projection, where facets are narrower than the resolution of the
    search.
    """
    d = dimension(kind)
    up = "xyz"[d - 1]
    bottoms = np.cumsum([0.0] + [q.height + gap for q in layers])
    blocks = [Block("layer %d" % i, *[line(q.across, 0, width)]*(d - 1), line(q.along, z, z + q.height))
              for i, (q, z) in enumerate(zip(layers, bottoms))]
    text = ["&scene analysis='%s', mesh='stack.msh' /" % ("3d" if d == 3 else "plane_strain")]
    for i, layer in enumerate(layers):
        text += ["&material name='%d', %s /" % (i, layer.material),
                 "&body name='%d', volume='layer %d', material='%d' /" % (i, i, i)]
        text += ["&support body='%d', surface='sides %s', fix='%s' /" % (i, axis, axis) for axis in "xy"[:d - 1]]
    down = ["0"]*(d - 1) + [repr(-SHORTENING)]
    text += ["&support body='0', surface='bottom', fix='%s' /" % up,
             "&support body='%d', surface='top', fix='%s', value=%s /" % (len(layers) - 1, up, ",".join(down))]
    for i in range(len(layers) - 1):
        sides = ["%d:bottom" % (i + 1), "%d:top" % i]
        text.append("&contact name='%d', surface_a='%s', surface_b='%s'%s /" % (
            i, *sides[::-1 if swap else 1], "" if given_gap is None else ", gap=%r" % given_gap))
    # one theta for all joints, from the ends, so that the formula stays short
    sizes = [min(width, q.height)/q.young for q in layers]
    theta = theta_relative*max(a + b for a, b in zip(sizes, sizes[1:]))
    text.append("&solver theta=%r, %s /" % (theta, solver))

    # Pointwise dilatations of rounding errors cost nearly incompressible elements, which project them, less than their
    # bulk modulus says.
    moduli = {"young": [q.young for q in layers], "poisson": [min(q.poisson, 0.45) for q in layers]}
    if not any(q.poisson > 0.45 for q in layers):
        moduli = None

    def check(answer):
        pressure, ends = exact(layers, theta, gap if given_gap is None else given_gap)
        right = np.zeros_like(answer.displacement)
        body = answer.node_bodies()
        for i, (layer, z, (low, high)) in enumerate(zip(layers, bottoms, ends)):
            here = body == i
            right[here, d - 1] = low + (high - low)*(answer.points[here, d - 1] - z)/layer.height
        error = answer.energy_error(right)
        # what the bound does not know of is the rounding of coordinates against what closes the gaps
        closing = SHORTENING - (gap if given_gap is None else given_gap)*(len(layers) - 1)
        coordinates = 1e-15*bottoms[-1]/closing if closing else np.inf
        if pressure < 1e-12*max(q.stiff for q in layers)*SHORTENING:
            # nothing but rounding of the gap can press
            least = 1/sum(q.height/q.stiff for q in layers)
            return [(answer.pressure_error(0.0), 1e-15*least, "pressure of no contact"),
                    (np.abs(answer.displacement - right).max(), 1e-15*bottoms[-1], "displacement")]
        return [(answer.pressure_error(pressure), allowed, "pressure"),
                (error, max(answer.reported(), coordinates, unprojected), "energy norm against the bound"),
                (error, max(allowed, coordinates, 4*answer.rounding()), "energy norm")]

    return Scene(name, "\n".join(text) + "\n", lambda folder: write_mesh(folder/"stack.msh", blocks, kind),
                 check, code, message, moduli)
