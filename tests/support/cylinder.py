"""The thick cylinder under inner pressure (Lame), exact at any Poisson's ratio: meshes of a quarter or of its section,
scene, answer."""
import blocks
import numpy as np

INNER, OUTER, HEIGHT = 1.0, 2.0, 0.5


def geometry(kind, n, axisymmetric=False, inner=INNER, outer=OUTER):
    """Geometry for gmsh: n elements across the wall."""
    d, order, incomplete, faces, volume = blocks.KINDS[kind]
    recombine = "Recombine;" * faces

    def within(entity, low, high):
        box = [*(np.array(low) - 1e-4), *(np.array(high) + 1e-4)]
        return "%s In BoundingBox {%s}" % (entity, ", ".join("%r" % float(x) for x in box))

    text = "Mesh.ElementOrder = %d;  Mesh.SecondOrderIncomplete = %d;\n" % (order, incomplete)
    text += ("Point(1) = {%r, 0, 0};\nwall() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };\n"
             % (inner, outer - inner, n))
    if axisymmetric:
        text += ("face() = Extrude {0, %r, 0} { Curve{wall(1)}; Layers{%d}; %s };\n"
                 % (HEIGHT, max(1, n // 2), recombine))
    else:
        text += ("face() = Extrude {{0, 0, 1}, {0, 0, 0}, Pi/2} { Curve{wall(1)}; Layers{%d}; %s };\n"
                 % (2 * n, recombine))
    z, entity = 0.0, "Curve"
    if d == 2:
        text += 'Physical Surface("tube") = {face(1)};\n'
    else:
        z, entity = HEIGHT, "Surface"
        text += ("body() = Extrude {0, 0, %r} { Surface{face(1)}; Layers{%d}; %s };\n"
                 % (z, max(1, n // 2), "Recombine;" * volume))
        text += 'Physical Volume("tube") = {body(1)};\n'
        text += 'Physical Surface("ends") = {face(1), %s};\n' % within(entity, (-3, -3, z), (3, 3, z))
    if axisymmetric:
        text += 'Physical Curve("ends") = {%s, %s};\n' % (within(entity, (inner, 0, 0), (outer, 0, 0)),
                                                          within(entity, (inner, HEIGHT, 0), (outer, HEIGHT, 0)))
        text += 'Physical Curve("inside") = {%s};\n' % within(entity, (inner, 0, 0), (inner, HEIGHT, 0))
        text += 'Physical Curve("outside") = {%s};\n' % within(entity, (outer, 0, 0), (outer, HEIGHT, 0))
    else:
        for name, low, high in (("along x", (inner, 0, 0), (outer, 0, z)), ("along y", (0, inner, 0), (0, outer, z)),
                                ("inside", (0, 0, 0), (inner, inner, z))):
            text += 'Physical %s("%s") = {%s};\n' % (entity, name, within(entity, low, high))
        # what is neither inside nor a plane: the box of the outer side holds all
        text += "all() = Abs(Boundary{ %s{%s}; });\n" % (("Surface", "face(1)") if d == 2 else ("Volume", "body(1)"))
        known = "%s, %s, %s" % tuple(within(entity, low, high) for low, high in (
            ((inner, 0, 0), (outer, 0, z)), ((0, inner, 0), (0, outer, z)), ((0, 0, 0), (inner, inner, z))))
        if d == 3:
            known += ", face(1), " + within(entity, (-3, -3, z), (3, 3, z))
        text += 'all() -= {%s};\nPhysical %s("outside") = {all()};\n' % (known, entity)
    return text


def held(body, analysis):
    """The supports of a quarter between smooth walls."""
    lines = []
    if analysis == "axisymmetric":
        return ["&support body='%s', surface='ends', fix='y' /" % body]
    lines += ["&support body='%s', surface='along x', fix='y' /" % body,
              "&support body='%s', surface='along y', fix='x' /" % body]
    if analysis == "3d":
        lines += ["&support body='%s', surface='ends', fix='z' /" % body]
    return lines


def scene(analysis, poisson, solver="", mesh="tube.msh"):
    """The input."""
    lines = ["&scene analysis='%s', mesh='%s' /" % (analysis, mesh),
             "&material name='rubber', young=1, poisson=%r /" % poisson,
             "&body name='tube', volume='tube', material='rubber' /",
             "&load body='tube', surface='inside', pressure=1 /", "&solver %s /" % solver, "&output /",
             *held("tube", analysis)]
    return "\n".join(lines) + "\n"


def displacement(radius, poisson):
    """Lame's, radial."""
    return (1 + poisson) * INNER**2 / (OUTER**2 - INNER**2) * ((1 - 2 * poisson) * radius + OUTER**2 / radius)


def mean_stress(poisson):
    """A third of the trace."""
    return 2 * (1 + poisson) / 3 * INNER**2 / (OUTER**2 - INNER**2)


def work(analysis, poisson):
    """Of the pressure: the square of the energy norm."""
    area = {"axisymmetric": 2 * np.pi * HEIGHT, "3d": np.pi / 2 * HEIGHT, "plane_strain": np.pi / 2}[analysis] * INNER
    return area * displacement(INNER, poisson)


def radial_error(x, u, analysis, poisson):
    """Largest error of the radial displacement, relative."""
    radius = x[:, 0] if analysis == "axisymmetric" else np.hypot(x[:, 0], x[:, 1])
    radial = u[:, 0] if analysis == "axisymmetric" else (u[:, 0] * x[:, 0] + u[:, 1] * x[:, 1]) / radius
    exact = displacement(radius, poisson)
    return np.max(np.abs(radial - exact)) / np.max(exact)
