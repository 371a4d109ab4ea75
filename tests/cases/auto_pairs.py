#!/usr/bin/python3
"""Contact pairs that find themselves: against pairs named by hand, turned, excluded, named twice, forgotten."""
import numpy as np

import dotyk_case
from blocks import block_geo

PRESSURE = 0.3
TURN = ", axis=1,2,-0.7, angle=%r"


def scene(contacts, blocks, solver="theta=0, tolerance=1e-12", turn=0.0):
    """Blocks with rollers on their sides, turned as a whole; `blocks` maps names to keys of supports and loads. The
    geometry of a block has its name."""
    lines = ["&scene title='auto' /", "&material name='m', young=30, poisson=0.2 /"]
    for name, extra in blocks.items():
        lines.append("&body name='%s', mesh='%s.geo', volume='block', material='m'%s /" % (name, name, TURN % turn))
        lines += [line.replace("BODY", "body='%s'" % name) for line in extra]
    return "\n".join([*lines, *contacts, "&solver %s /" % solver]) + "\n"


SIDES = ["&support BODY, surface='sides x', fix='n' /", "&support BODY, surface='sides y', fix='n' /"]
HELD = [*SIDES, "&support BODY, surface='bottom', fix='n' /"]
PRESSED = [*SIDES, "&load BODY, surface='top', pressure=%r /" % PRESSURE]
NAMED = "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /"
AUTO = "&contact auto=.true. /"


class AutoPairs(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.write("lower.geo", block_geo("hex8", 2))
        self.write("upper.geo", block_geo("hex8", 3, origin=(0, 0, 1)))

    def run_scene(self, text, code=0, *options):
        """Run a scene; returns its pairs, name -> pressures."""
        self.write("case.nml", text)
        self.printed = self.dotyk("case.nml", *options, code=code)
        if code or options:
            return None
        file = self.results("case.vtkhdf")
        self.bound = file["dotyk/summary"].attrs["error_bound"]
        return {name: pair["pressure"][:] for name, pair in file["dotyk/contact"].items()}

    def test_as_by_hand_and_turned(self):
        """The finer side is the slave; the pressures are those of the named pair at any angle."""
        blocks = {"lower": HELD, "upper": PRESSED}
        by_hand = self.run_scene(scene([NAMED], blocks))["joint"]
        for turn in (0.0, 33.7, 211.9):
            found = self.run_scene(scene([AUTO], blocks, turn=turn))
            self.assertEqual(list(found), ["upper - lower"])
            np.testing.assert_allclose(found["upper - lower"], by_hand, rtol=1e-9)
            np.testing.assert_allclose(by_hand, PRESSURE, rtol=1e-9)
        self.assertIn("1 pair of faces", self.printed)

    def test_two_bodies_under_one(self):
        """Vertices over a joint have rows with two bodies, which depend on each other: the scheme converges with theta = 0
        all the same, also where both bodies are held all over."""
        self.write("left.geo", block_geo("hex8", 2, size=(0.5, 1, 1)))
        self.write("right.geo", block_geo("hex8", 3, origin=(0.5, 0, 0), size=(0.5, 1, 1)))
        self.write("upper.geo", block_geo("hex8", 6, origin=(0, 0, 1)))
        rigid = [line.replace("fix='n'", "fix='xyz'").replace("bottom", "*") for line in HELD[-1:]]
        for held in (HELD, rigid):
            for turn in (0.0, 47.1):
                found = self.run_scene(scene([AUTO], {"left": held, "right": held, "upper": PRESSED},
                                             "theta=0, tolerance=1e-6", turn))
                self.assertEqual({name for name in found if "upper" in name}, {"upper - left", "upper - right"})
                # The two pressures of a vertex over the joint are not unique; their resultants are.
                with self.results("case.vtkhdf") as file:
                    pairs = file["dotyk/contact"]
                    for name in ("upper - left", "upper - right"):
                        force = np.linalg.norm(pairs[name].attrs["force"])
                        self.assertAlmostEqual(force, PRESSURE / 2, delta=1e-5)

    def test_wildcards(self):
        """Pairs of bodies that wildcards name: only those that are near, with the surfaces that each body has."""
        for i in range(3):
            self.write("block %d.geo" % i, block_geo("hex8", 2 + i % 2, origin=(0, 0, i)))
        blocks = {"block 0": HELD, "block 1": SIDES, "block 2": PRESSED}
        stacked = "&contact name='stack', surface_a='block *:bottom', surface_b='block *:top' /"
        found = self.run_scene(scene([stacked], blocks))
        self.assertEqual(set(found), {"stack: block 1 - block 0", "stack: block 2 - block 1"})
        for pressure in found.values():
            np.testing.assert_allclose(pressure, PRESSURE, rtol=1e-9)
        self.assertIn("2 pairs of surfaces", self.printed)
        self.run_scene(scene(["&contact name='s', surface_a='* 7:bottom', surface_b='block *:top' /"], blocks), 2)
        self.assertIn("surface_a: no body has a name like '* 7'", self.printed)
        self.run_scene(scene(["&contact name='s', surface_a='block *:side', surface_b='block *:top' /"], blocks), 2)
        self.assertIn("case.nml:14: &contact 's': surface_a: no physical surface 'side' on 'block 0', 'block 1', 'block 2'",
                      self.printed)
        self.run_scene(scene(["&contact name='s', surface_a='block *:sides x', surface_b='block *:top' /"], blocks), 2)
        self.assertIn("case.nml:14: &contact 's': none of the surfaces of surface_a is near one of surface_b",
                      self.printed)
        self.run_scene(scene([stacked.replace(" /", ", exclude='block 1' /")], blocks), 2)
        self.assertIn("&contact 'stack': exclude removes all pairs (2)", self.printed)
        self.run_scene(scene(["&contact name='s', surface_a='block 1:no*', surface_b='block 0:top' /"], blocks), 2)
        self.assertIn("body 'block 1': mesh 'block 1.geo' has no physical surface like 'no*'", self.printed)

    def test_exclusions(self):
        """Bodies that are left out form no pair, and are not reminded of."""
        blocks = {"lower": HELD, "upper": [*HELD]}
        for text in ("'upper - lower'", "'low* - upper'", "'upper'"):
            self.run_scene(scene(["&contact auto=.true., exclude=%s /" % text], blocks), 0, "--check")
            self.assertIn("0 pairs of faces that face each other; 1 excluded", self.printed)
            self.assertIn("warning: exclude removes all pairs", self.printed)
            self.assertNotIn("in no pair", self.printed)
        self.run_scene(scene(["&contact auto=.true., exclude='nothing' /"], blocks), 2)
        self.assertIn("exclude: 'nothing' names no bodies", self.printed)
        self.write("aside.geo", block_geo("hex8", 1, origin=(3, 0, 0)))
        self.run_scene(scene(["&contact auto=.true., exclude='lower - aside' /"], {**blocks, "aside": HELD}), 0, "--check")
        self.assertIn("warning: exclude='lower - aside' removes nothing: these bodies form no pair", self.printed)
        # One mistake, one message.
        for text, message in (("auto=yes", "auto needs .true. or .false., got 'yes'"),
                              ("exclude='upper'", "exclude is for pairs that are searched")):
            self.run_scene(scene(["&contact %s /" % text], blocks), 2)
            self.assertEqual(self.printed.count("&contact: "), 1, self.printed)
            self.assertIn(message, self.printed)

    def test_beyond_the_search_distance(self):
        """A body in no pair, and the distance that would find one; the search distance is a tenth of a block's diameter,
        which is twice the greatest distance of a corner from the middle."""
        diameter = np.sqrt(3)
        blocks = {"lower": HELD, "upper": HELD, "far": HELD}
        for distance, named in ((2.9 * diameter / 10, True), (3.1 * diameter / 10, False)):
            self.write("far.geo", block_geo("hex8", 1, origin=(1 + distance, 0, 0)))
            for turn in (0.0, 29.3):
                self.run_scene(scene([AUTO], blocks, turn=turn), 0, "--check")
                self.assertEqual("not searched" in self.printed, named, self.printed)
                if named:
                    self.assertIn("'far' is in no pair: its distance from 'lower' is 0.502, and the search distance 0.173",
                                  self.printed)

    def test_initial_overlap(self):
        """Bodies that lie in each other are named before the solution; those that touch or interfere in a pair are not."""
        self.write("lost.geo", block_geo("hex8", 2, origin=(0.25, 0.25, 0.3), size=(0.5, 0.5, 0.5)))
        for turn in (0.0, 51.0):
            self.run_scene(scene([AUTO], {"lower": HELD, "upper": PRESSED, "lost": HELD}, turn=turn), 0, "--check")
            self.assertRegex(self.printed, r"overlap +'lost' is inside 'lower' by 0.3 at .*, 26 nodes before loading")
            self.assertIn("warning: no contact pair explains these overlaps", self.printed)
        self.write("upper.geo", block_geo("hex8", 3, origin=(0, 0, 0.97)))
        self.run_scene(scene([AUTO], {"lower": HELD, "upper": PRESSED}), 0, "--check")
        self.assertNotIn("overlap", self.printed)

    def test_named_twice(self):
        """The same contact named twice counts once; with other settings it is refused."""
        blocks = {"lower": HELD, "upper": PRESSED}
        theta = "theta=0.1, tolerance=1e-12"
        one = self.run_scene(scene([NAMED], blocks, theta))["joint"]
        turned = "&contact name='twin', surface_a='lower:top', surface_b='upper:bottom' /"
        again = NAMED.replace("joint", "twin")
        for second in (turned, again):
            found = self.run_scene(scene([NAMED, second], blocks, theta))
            self.assertEqual(list(found), ["joint"])
            np.testing.assert_allclose(found["joint"], one, rtol=1e-12)
            self.assertRegex(self.printed, r"same contact +'twin' \(line 12\) and 'joint' \(line 11\): .* 'joint' is used")
        # A pair of a part of the faces is contained in that of all.
        whole = "&contact name='whole', surface_a='upper:*', surface_b='lower:*' /"
        self.assertEqual(list(self.run_scene(scene([NAMED, whole], blocks, theta))), ["whole"])
        self.run_scene(scene([NAMED, turned.replace(" /", ", theta=1 /")], blocks, theta), 2)
        self.assertIn("case.nml:12: &contact 'twin' is the same contact as 'joint' (line 11), with another gap or "
                      "theta", self.printed)
        # Faces that two pairs share in part: bottom and top of the first, bottom and sides of the second.
        shared = ["&contact name='%s', surface_a='upper:%s', surface_b='lower:*' /" % pair
                  for pair in (("one", "*o*"), ("two", "??????*"))]
        self.run_scene(scene(shared, blocks, theta), 2)
        self.assertIn("case.nml:12: &contact 'two' and 'one' (line 11) are in part the same contact, which would count "
                      "twice: name each face of 'upper' and 'lower' in one pair only", self.printed)
        # What is named is not for auto.
        self.assertEqual(list(self.run_scene(scene([NAMED, AUTO], blocks, theta))), ["joint"])
        self.assertIn("1 pair of bodies named by other groups", self.printed)

    def test_forgotten(self):
        """Faces in no pair are named before the solution, bodies that carry nothing behind it."""
        self.write("nut.geo", block_geo("hex8", 1, origin=(0.3, 0.3, 2), size=(0.2, 0.2, 0.2)))
        blocks = {"lower": HELD, "upper": PRESSED, "nut": []}
        self.run_scene(scene([NAMED], blocks))
        self.assertRegex(self.printed, r"in no pair +'upper' and 'nut' touch at \(.*, 2\)")
        self.assertRegex(self.printed, r"carry nothing +'nut'")
        self.run_scene(scene([AUTO], blocks))
        self.assertNotIn("in no pair", self.printed)
        self.run_scene(scene([NAMED], {"lower": HELD, "upper": PRESSED}))
        self.assertNotIn("in no pair", self.printed)
        self.assertNotIn("carry nothing", self.printed)

    def test_rim_of_a_pair(self):
        """Flanks beside the end of a cylinder touch the other body by the rim of this end, which the pair has: quadratic facets, whose
        normals vary, are not told to be in no pair."""
        self.write("lower.geo", block_geo("tet10", 3, origin=(-1, -1, 0), size=(2, 2, 1)))
        for size in (0.25, 0.6):
            self.write("puck.geo", """SetFactory("OpenCASCADE"); Cylinder(1) = {0, 0, 1, 0, 0, 0.5, 0.6};
Mesh.MeshSizeMax = %r;  Mesh.MeshSizeMin = %r;  Mesh.ElementOrder = 2;
Physical Volume("block") = {1};  e = 1e-4;
Physical Surface("end") = {Surface In BoundingBox{-9, -9, 1 - e, 9, 9, 1 + e}};
""" % (size, size))
            blocks = {"lower": HELD, "puck": []}
            self.run_scene(scene(["&contact name='joint', surface_a='puck:end', surface_b='lower:top' /"], blocks), 0, "--check")
            self.assertNotIn("in no pair", self.printed)

    def test_exact_normals_hold_no_load(self):
        """Between flat faces, and on an edge, nothing resists a force along them: any, however small, is refused."""
        block = ("&load BODY, surface='top', pressure=1 /", "&support BODY, surface='top', fix='t' /")
        self.write("middle.geo", block_geo("hex8", 3, origin=(0, 0, 1)))
        self.write("upper.geo", block_geo("hex8", 2, origin=(0, 0, 2)))
        # A cube on its edge, between the same two blocks; it is pressed along its diagonal.
        self.write("edge.geo", block_geo("hex8", 2, origin=(-0.5, 0, -0.5)))
        self.write("lid.geo", block_geo("hex8", 2, origin=(0, 0, 1 + 2**0.5)))
        on_edge = ", axis=0,1,0, angle=45, at=0.5,0,%r" % (1 + 2**-0.5)
        for name, place, lid in (("middle", "", "upper"), ("edge", on_edge, "lid")):
            for part, code in ((1e-3, 3), (0, 0)):
                push = ["&load BODY, force_density=%r,0,0 /" % part] if part else []
                text = scene([AUTO], {"lower": HELD, name: push, lid: block}, "tolerance=1e-6").replace(TURN % 0.0, "")
                self.run_scene(text.replace("mesh='edge.geo'", "mesh='edge.geo'" + place), code)
                if part:
                    self.assertIn("no equilibrium", self.printed)

    def test_supports_of_many_bodies(self):
        """Wildcards in supports and loads: bodies without the surface are passed over, but one must have it."""
        blocks = {"lower": [], "upper": ["&load BODY, surface='top', pressure=%r /" % PRESSURE]}
        all_sides = ["&support body='*', surface='sides *', fix='n' /", "&support body='low*', surface='bottom', fix='n' /"]
        found = self.run_scene(scene([*all_sides, AUTO], blocks))
        np.testing.assert_allclose(found["upper - lower"], PRESSURE, rtol=1e-9)
        self.run_scene(scene([*all_sides, AUTO, "&load body='*', surface='rim', pressure=1 /"], blocks), 2)
        self.assertIn("&load: none of the bodies has such a surface", self.printed)


if __name__ == "__main__":
    dotyk_case.main()
