"""Assemblies whose right answer is known: an exact solution, one pair for each face, or a contact in one point.

Each scene is a function (seed, dotyk) -> list of Row. seed turns the scene by a random rotation (0: not). SCENES lists
them all; `studies/assemblies.py` makes a table, tests/cases/assemblies are tests.
"""
from assembly_edges import corner, hexagon, sheet
from assembly_faces import ball_in_grooves, left_out, press_fit, shells, wedge
from assembly_points import crossed, knife, vertex
from assembly_touches import between_walls, joint, ridges

# section of the issue, name, scene
SCENES = [("edges", "block in a corner, %d divisions" % n, corner(n=n)) for n in (2, 4, 8, 16)]
SCENES += [("edges", "block in a corner, one pair per wall", corner(wrapped=False)),
           ("edges", "block in a corner, the corner is the slave", corner(swap=True)),
           ("edges", "block in a corner, pressed on both walls", corner(pressed=("down", "across"))),
           ("edges", "block in a corner, triangles", corner("tri3")),
           ("edges", "cube in a corner", corner("hex8", 2)),
           ("edges", "cube in a corner, the corner is the slave", corner("hex8", 2, swap=True)),
           ("edges", "cube in a corner, pressed on three walls", corner("hex8", 2, pressed=("down", "across"))),
           ("edges", "cube in a corner, tetrahedra", corner("tet4", 2))]
SCENES += [("edges", "hexagonal shaft, %d facets per flat" % n, hexagon(n)) for n in (1, 2, 4, 8, 16)]
SCENES += [("edges", "hexagonal shaft, the hub is the slave", hexagon(4, swap=True)),
           ("edges", "hexagonal shaft, 4 facets in 3", hexagon(4, m=3)),
           ("radius", "sheet over a die", sheet()),
           ("radius", "thin sheet on a stiff die", sheet((0, 5), True))]
for swap in (False, True):
    side = ", the knife is the master" if swap else ""
    SCENES += [("points", "knife of %d degrees%s" % (angle, side), knife(angle, swap=swap)) for angle in (20, 50, 100)]
    side = ", the tip is the master" if swap else ""
    SCENES += [("points", "pyramid %s%s" % (word, side), vertex(height, swap=swap))
               for word, height in (("of 22 degrees", 0.2), ("of 45 degrees", 0.5), ("of 72 degrees", 1.5))]
SCENES += [("points", "crossed bars", crossed()), ("points", "crossed bars, swapped", crossed(swap=True)),
           ("points", "bars crossed at 40 degrees", crossed(40)),
           ("points", "crossed bars, away from the middle of facets", crossed(n=(5, 6), place=0.2)),
           ("thin", "two thin shells, both faces", shells()),
           ("thin", "two thin shells, both faces, not matching", shells(n=(16, 13))),
           ("thin", "two thin shells, geometry='elements'", shells("elements"))]
SCENES += [("smooth", "wedge of %d degrees, one facet per flank" % slope, wedge(slope)) for slope in (5, 12, 19)]
SCENES += [("smooth", "wedge of 12 degrees, the groove is the slave", wedge(12, swap=True)),
           ("smooth", "wedge of 12 degrees, two facets per flank", wedge(12, n=2)),
           ("smooth", "press fit, mid nodes on chords", press_fit()),
           ("smooth", "press fit, mid nodes on arcs", press_fit(0))]
SCENES += [("points", "ridge on ridge", ridges()), ("points", "ridge on ridge, swapped", ridges((1, 2), True)),
           ("points", "ridge on ridge, the other one finer", ridges((2, 1)))]
SCENES += [("smooth", "round body between walls, %s" % kind, between_walls(kind))
           for kind in ("quad4", "tri3", "hex8", "tet4")]
SCENES += [("joints", "fine surface over a joint at %g, %s" % (split, kind), joint(split, kind=kind))
           for split, kind in ((4.0, "hex8"), (3.3, "hex8"), (3.3, "tet4"))]
SCENES += [("neutral", "ball in grooves, size %g" % size, ball_in_grooves(size)) for size in (0.4, 0.3)]
SCENES += [("left out", "nut and bolt", left_out)]

# Scenes that the program does not solve yet: the tests leave them out, the table shows them.
PENDING = set()
