#!/usr/bin/python3
"""The check for penetration: bodies that nothing holds apart, with exact depths, turned by random rotations; and scenes
in which there is none."""
import os
import re
import subprocess
import tempfile
import unittest

import h5py
import numpy as np

import dotyk_case
from assembly import Mesh, Scene, box, grid_mesh, rotation

SEEDS = (0, 1, 2)


def moved(scene, name, mesh, by):
    """A body that is moved as a whole: all its boundary's nodes, exactly."""
    mesh.group("all", *mesh.patches)
    scene.body(name, mesh).fix(name, "all", "xyz"[:scene.d], by)


def held(scene, name, mesh):
    """A body that stays where it is."""
    moved(scene, name, mesh, [0] * scene.d)


def joined(*meshes):
    """One body of several parts."""
    shift = np.cumsum([0] + [len(mesh.x) for mesh in meshes])
    mesh = Mesh(meshes[0].kind, np.concatenate([m.x for m in meshes]),
                np.concatenate([m.cells + n for m, n in zip(meshes, shift)]))
    return mesh.patch("faces", lambda c: True)


class Penetration(unittest.TestCase):
    def check(self, scene, depth, bodies, place=None, words=r", \d+ nodes?", relative=1e-9, inside="is inside"):
        """Exit code, line of the log and results, for all rotations; depth 0: no penetration."""
        for seed in SEEDS:
            answer = scene.solve(seed)
            with self.subTest(seed=seed):
                lines = re.findall(r"(?m)^  penetration   .*$", answer.log)
                found = answer.summary["penetration_depth"]
                self.assertAlmostEqual(found, depth, delta=relative * max(depth, 1), msg=answer.log)
                self.assertEqual(answer.code, 1 if depth else 0, answer.log)
                self.assertEqual(len(lines), 1 if depth else 0, answer.log)
                if not depth:
                    continue
                self.assertIn(answer.summary["status"], (b"penetration", "penetration"))
                self.assertRegex(lines[0], "'%s' %s '%s' by " % (bodies[0], inside, bodies[1]))
                self.assertRegex(lines[0], words)
                if place is not None:
                    text = re.search(r"at \((.*?)\)", lines[0])[1]
                    np.testing.assert_allclose(np.array(text.split(","), float) @ rotation(seed, scene.d), [*place], atol=2e-3)

    def test_forgotten_pair(self):
        """A block moves into another one: by 0.05, with no pair. All nodes of its lower face are that deep."""
        for kind in ("quad4", "tri3", "hex8", "tet4"):
            d = 2 if kind in ("quad4", "tri3") else 3
            scene = Scene("3d" if d == 3 else "plane_strain")
            held(scene, "lower", box(kind, 2, [0] * d, [1] * d))
            moved(scene, "upper", box(kind, 3, [0.2] * (d - 1) + [1.02], [0.8] * (d - 1) + [1.5]),
                  [0] * (d - 1) + [-0.07])
            self.check(scene, 0.05, ("upper", "lower"), words=", %d nodes" % 4**(d - 1))

    def test_body_within_another(self):
        """A small block within a large one, before anything moves."""
        scene = Scene("3d")
        held(scene, "large", box("hex8", 3, (0, 0, 0), (1, 1, 1)))
        held(scene, "small", box("tet4", 1, (0.4, 0.4, 0.6), (0.6, 0.6, 0.7)))
        self.check(scene, 0.4, ("small", "large"))

    def test_sheet_through_a_plate(self):
        """A sheet moves through a plate and is outside again: its lower face is 0.25 below the upper one of the
        plate."""
        for d, kind in ((2, "quad4"), (3, "hex8"), (3, "tet4")):
            scene = Scene("3d" if d == 3 else "plane_strain")
            held(scene, "plate", box(kind, [4] * (d - 1) + [1], [0] * d, [1] * (d - 1) + [0.1]))
            moved(scene, "sheet", box(kind, [3] * (d - 1) + [1], [0.23] * (d - 1) + [0.15], [0.8] * (d - 1) + [0.17]),
                  [0] * (d - 1) + [-0.3])
            self.check(scene, 0.25, ("sheet", "plate"), inside="has passed through", words="nodes passed")

    def test_sheet_through_a_plate_that_it_touches(self):
        """The same from contact, obliquely."""
        scene = Scene("plane_strain")
        held(scene, "plate", box("quad4", (4, 1), (0, 0), (1, 0.1)))
        moved(scene, "sheet", box("quad4", (3, 1), (0.23, 0.1), (0.8, 0.12)), (0.05, -0.3))
        self.check(scene, 0.3, ("sheet", "plate"), inside="has passed through", words="nodes passed")

    def test_crossed_bars(self):
        """Two square bars on edge, crossed, without a node where they meet: edges pass through each other by 0.1. The
        point of an edge that is 0.1 deep is 0.1/sqrt(2) from the faces."""
        scene = Scene("3d")
        s = np.sqrt(0.5)

        def bar(along, shift):
            mesh = box("hex8", (5, 1, 1), (-1, 0, 0), (1, 0.5, 0.5))
            axes = np.array([along, np.cross((0, 0, 1), along) * s + np.array([0, 0, s]),
                             -np.cross((0, 0, 1), along) * s + np.array([0, 0, s])])
            return mesh.move(lambda x: x @ axes + [0, 0, shift])

        held(scene, "lower", bar((1, 0, 0), -1 / np.sqrt(2)))
        moved(scene, "upper", bar((0, 1, 0), 0.05), (0, 0, -0.15))
        self.check(scene, 0.1 * s, ("(upper|lower)", "(upper|lower)"), words=", \\d edges?", place=None)

    def test_tip_on_a_plane_of_symmetry(self):
        """Half of a blade and half of a block: the tip, on the faces that are flush, is 0.03 deep."""
        scene = Scene("plane_strain")
        held(scene, "block", box("quad4", 4, (0, -1), (1, 0)))
        x = np.array([[0.0, 0.01], [0.3, 1.0], [0.0, 1.0]])
        blade = Mesh("tri3", x, np.array([[0, 1, 2]]))
        blade.patch("faces", lambda c: True)
        moved(scene, "blade", blade, (0, -0.04))
        self.check(scene, 0.03, ("blade", "block"), place=(0, -0.03, 0), words=", 1 node")

    def test_parts_of_one_body(self):
        """Two parts of one body, of which one moves into the other."""
        scene = Scene("plane_strain")
        lower, upper = box("quad4", 3, (0, 0), (1, 1)), box("quad4", 4, (0.1, 1.1), (0.9, 2))
        both = joined(lower, upper)
        both.patch("low", lambda c: c[1] < 1.05).patch("high", lambda c: c[1] > 1.05)
        scene.body("both", both).fix("both", "low", "xy", (0, 0)).fix("both", "high", "xy", (0, -0.2))
        self.check(scene, 0.1, ("both", "both"))

    def test_common_motion(self):
        """A shallow penetration of two bodies is none the less one where both move far together."""
        for d, kind in ((2, "quad4"), (3, "hex8")):
            for far in (0, 0.3, 10):
                scene = Scene("3d" if d == 3 else "plane_strain")
                common = [far] + [-far] * (d - 1)
                moved(scene, "lower", box(kind, 2, [0] * d, [1] * d), common)
                moved(scene, "upper", box(kind, 3, [0.2] * (d - 1) + [1], [0.8] * (d - 1) + [1.5]),
                      common[:-1] + [common[-1] - 5e-4])
                self.check(scene, 5e-4, ("upper", "lower"), words=", %d nodes" % 4**(d - 1))

    def test_common_rotation(self):
        """The same where both rotate together, by 0.2 rad in the theory of small rotations: all lengths grow by 2 %."""
        scene = Scene("plane_strain")
        for name, mesh, down in (("lower", box("quad4", 2, (0, 0), (1, 1)), 0),
                                 ("upper", box("quad4", 3, (0.2, 1), (0.8, 1.5)), 5e-4)):
            mesh.group("all", *mesh.patches)
            scene.body(name, mesh).raw("&support body='%s', surface='all', fix='xy', value_formula='-0.2*y','0.2*x-%g'"
                                       % (name, down))
        answer = scene.solve()
        self.assertEqual(answer.code, 1, answer.log)
        self.assertAlmostEqual(answer.summary["penetration_depth"], 5e-4 / np.sqrt(1.04), delta=1e-9)

    def test_contact_that_is_right(self):
        """Blocks that do not match, pressed on each other, on flush planes of symmetry, with and without penalty; and with
        a given gap that is larger than that of the mesh."""
        for keys, solver in (("", "theta=0, tolerance=1e-10"), ("", "theta=0.3, tolerance=1e-10"),
                             ("gap=0.01", "theta=0, tolerance=1e-10"), ("gap=-0.01", "theta=0, tolerance=1e-10"),
                             ("gap_formula='1e-3'", "theta=0.01, tolerance=1e-10")):
            for kind in ("quad4", "hex8"):
                d = 2 if kind == "quad4" else 3
                scene = Scene("3d" if d == 3 else "plane_strain", solver)
                scene.body("lower", box(kind, 3, [0] * d, [1] * d)).body("upper", box(kind, 4, [0] * (d - 1) + [1],
                                                                                      [1] * (d - 1) + [2]), 2.0)
                for body in ("lower", "upper"):
                    scene.fix(body, "left", "n")
                    if d == 3:
                        scene.fix(body, "front", "n")
                scene.fix("lower", "bottom", "n").load("upper", "top", pressure=0.02)
                scene.pair("joint", "upper:bottom", "lower:top", keys)
                self.check(scene, 0, ())

    def test_faces_in_no_pair(self):
        """Blocks that touch and are in no pair are named; those that touch at an edge, or that a pair has, are not."""
        scene = Scene("3d")
        held(scene, "low", box("hex8", 2, (0, 0, 0), (1, 1, 1)))
        held(scene, "high", box("hex8", 3, (0, 0.2, 1), (0.8, 1, 2)))
        held(scene, "edge", box("hex8", 2, (1, 0, 1), (2, 1, 2)))
        for seed in SEEDS:
            answer = scene.solve(seed)
            self.assertEqual(answer.code, 0, answer.log)
            self.assertEqual(len(re.findall("  no pair  ", answer.log)), 1, answer.log)
            self.assertRegex(answer.log, "no pair +'low' and 'high' touch at .* and no &contact names them")
        answer = scene.pair("joint", "high:bottom", "low:top").solve()
        self.assertNotIn("  no pair  ", answer.log)

    def test_large_motion(self):
        """Motions beyond small-displacement theory: 31 times the size, and 0.1 rad."""
        scene = Scene("plane_strain")
        held(scene, "still", box("quad4", 2, (-5, 0), (-2, 4)))
        moved(scene, "fast", box("quad4", 2, (0, 0), (3, 4)), (0, 155))
        answer = scene.solve()
        self.assertRegex(answer.log, "large motion +'fast' moves by 31 times its size")
        self.assertNotIn("rotates", answer.log)
        scene = Scene("plane_strain")
        mesh = box("quad4", 2, (0, 0), (3, 4))
        mesh.group("all", *mesh.patches)
        scene.body("turned", mesh).raw("&support body='turned', surface='all', fix='xy', value_formula='-0.1*y','0.1*x'")
        answer = scene.solve()
        self.assertRegex(answer.log, r"large motion +'turned' rotates by 0\.1 rad; .* by 0\.5 %")
        self.assertNotIn("moves by", answer.log)

    def test_block_that_slides_off(self):
        """Weak springs let a block slide by many times its size: nodes of the face that it slides over get no contact rows."""
        scene = Scene("3d", "theta=0, tolerance=1e-9")
        scene.body("base", box("hex8", 4, (0, 0, 0), (1, 1, 1))).fix("base", "bottom", "xyz", [0, 0, 0])
        scene.body("block", box("hex8", 2, (.2, .2, 1), (.7, .7, 1.5)))
        scene.load("block", "top", traction=[0.01, 0.02, -0.01])
        scene.raw("&spring body='block', surface='top', fix='xyz', stiffness=1e-3")
        scene.pair("contact", "block:bottom", "base:top")
        answer = scene.solve()
        self.assertNotIn("(corners)", answer.log)
        self.assertRegex(answer.log, r"large motion +'block' moves by")
        np.testing.assert_allclose(answer.force(), [0, 0, 0.0025], atol=1e-5, err_msg=answer.log)

    def test_corners_on_corners(self):
        """Grids of four boxes that close their gaps: where four corners meet compression moves them into each other,
        until they have contact rows there."""
        added = 0
        for seed in range(1, 9):
            random = np.random.default_rng(seed)
            scene = Scene("3d", "theta=0, tolerance=1e-9")
            x, z = (np.append(0, np.cumsum(random.uniform(0.4, 0.8, 2))) for _ in "xz")
            depth = random.uniform(0.5, 0.8)
            for i in range(2):
                for j in range(2):
                    name, shift = "box %d%d" % (i, j), 0.01 * np.array([i, 0, j])
                    mesh = box(random.choice(["hex8", "tet4"]), random.integers(1, 4, 3),
                               (x[i], 0, z[j]) + shift, (x[i + 1], depth, z[j + 1]) + shift)
                    scene.body(name, mesh, float(random.uniform(700, 1500)))
                    scene.fix(name, "front", "n")
                    scene.raw("&spring body='%s', surface='*', fix='xyz', modulus=0.05" % name)
                    for at_wall, held_side, pressed in ((i == 0, "left", "right"), (j == 0, "bottom", "top")):
                        if at_wall:
                            scene.fix(name, held_side, "n")
                        else:
                            scene.load(name, pressed, pressure=float(random.uniform(1, 6)))
            for k in range(2):
                scene.pair("across %d" % k, "box 0%d:right" % k, "box 1%d:left" % k)
                scene.pair("up %d" % k, "box %d0:top" % k, "box %d1:bottom" % k)
            answer = scene.solve(seed)
            self.assertEqual(answer.code, 0, answer.log)
            self.assertEqual(answer.summary["penetration_depth"], 0, answer.log)
            added += " added there; solving again" in answer.log
        self.assertGreater(added, 3)

    def test_corner_meets_corner(self):
        """A stiff block that is moved up by 0.2 is drawn by springs of stiffness 4 to 0.2 on the right as well. Its corner
        meets that of a block at (0.1, 0.05) from it, comes through the face on the left, and stops: 4*(0.2 - 0.1)."""
        for seed in SEEDS:
            scene = Scene("plane_strain", "theta=0, tolerance=1e-9")
            mesh = box("quad4", 2, (0, 0), (1, 1))
            mesh.group("all", *mesh.patches)
            scene.body("moving", mesh, 1e7).raw("&spring body='moving', surface='all', fix='xy', modulus=1")
            scene.fix("moving", "bottom", "n", [0, -0.2]).fix("moving", "top", "n", [0, 0.2])
            scene.load("moving", "left", traction=[0.8, 0])
            held(scene, "still", box("quad4", 2, (1.1, 1.05), (2.1, 2.05)))
            held(scene, "floor", box("quad4", 2, (0, -1.5), (1, -0.5)))
            scene.pair("open", "moving:bottom", "floor:top")
            answer = scene.solve(seed)
            self.assertEqual(answer.code, 0, answer.log)
            self.assertEqual(answer.summary["penetration_depth"], 0, answer.log)
            names, force = re.search(r"(\w+ - \w+) \(corners\): .*contact force \((.*?)\)", answer.log).groups()
            expected = [-0.4 if names.startswith("moving") else 0.4, 0, 0]
            np.testing.assert_allclose(np.array(force.split(","), float),
                                       rotation(seed, 2) @ expected, atol=1e-4, err_msg=answer.log)

    def test_bodies_behind_each_other(self):
        """A penalty by which three cubes in a row pass wholly through each other explains nothing."""
        for kind in ("quad4", "hex8"):
            d = 2 if kind == "quad4" else 3
            for penetration in (1.5, 3, 100):
                scene = Scene("3d" if d == 3 else "plane_strain", "theta=%r, tolerance=1e-10" % (100 * penetration))
                for k, name in enumerate(("low", "middle", "high")):
                    scene.body(name, box(kind, k + 1, [0] * (d - 1) + [k], [1] * (d - 1) + [k + 1]))
                    scene.fix(name, "left", "n")
                    if d == 3:
                        scene.fix(name, "front", "n")
                scene.fix("low", "bottom", "n").load("high", "top", pressure=0.01)
                scene.pair("first", "middle:bottom", "low:top").pair("second", "high:bottom", "middle:top")
                answer = scene.solve(1)
                self.assertEqual(answer.code, 1, answer.log)
                self.assertRegex(answer.log, "penetration .* has passed through ")

    def test_press_fit_with_flush_sides(self):
        """A node that starts in the overlap, on a flush side, and slides outwards has passed through nothing."""
        scene = Scene("plane_strain")
        scene.body("lower", box("quad4", (3, 2), (0, 0), (1, 0.64027)), 994.0, 0.39)
        scene.body("upper", box("quad4", (3, 3), (0, 0.63927), (1, 1.33561)), 1891.0, 0.2)
        scene.materials[0] = scene.materials[0].replace(" /", ", expansion=1.57e-5 /")
        scene.fix("lower", "left", "n").fix("upper", "left", "n").fix("lower", "bottom", "n")
        scene.raw("&support body='upper', surface='top', fix='y', value=0,-0.0015907")
        scene.pair("joint", "lower:top", "upper:bottom")
        scene.raw("&temperature body='lower', formula='79.16+29.52*x-37.29*y'")
        self.check_unturned(scene)

    def test_ridge_of_one_body_and_of_two(self):
        """A plate on a curved surface whose facets meet at other places: in one piece, and in two that are tied."""
        def curved(mesh, bottom):
            def move(x):
                z = 1 + 0.0299 * np.sin(2 * x[:, 0])
                return np.column_stack([x[:, :2], z + x[:, 2] if bottom else z * x[:, 2]])
            return mesh.move(move)

        def along(lines, *other):
            mesh = grid_mesh("tet4", np.array(lines), *other)
            for axis, sides in enumerate((("left", "right"), ("front", "back"), ("bottom", "top"))):
                for name, at in zip(sides, (mesh.x[:, axis].min(), mesh.x[:, axis].max())):
                    mesh.patch(name, lambda c, axis=axis, at=at: abs(c[axis] - at) < 1e-9)
            return mesh

        y, z = np.linspace(0, 1, 3), np.linspace(0, 1, 3)
        force = "&load body='%s', acceleration=5.369,-0.0894,2.29"
        for pieces in ([0, 0.8, 1.25, 1.7],), ([0, 0.8], [0.8, 1.25, 1.7]):
            scene = Scene("3d")
            for k, lines in enumerate(pieces):
                name = "piece %d" % k
                scene.body(name, curved(along(lines, y, z), False), 632.8, 0.0).raw(force % name)
                scene.pair("on " + name, name + ":top", "plate:bottom", "geometry='elements'")
            scene.body("plate", curved(along([0.2588, 0.7219, 1.185], y, z / 2), True), 632.8, 0.0)
            scene.materials = [text.replace(" /", ", density=0.1 /") for text in scene.materials]
            if len(pieces) == 2:
                scene.raw("&tie name='tie', surface_a='piece 1:left', surface_b='piece 0:right'")
            scene.fix("piece 0", "left", "xyz", (0, 0, 0)).load("plate", "top", pressure=1)
            scene.fix("plate", "left", "n").fix("plate", "front", "n")
            self.check_unturned(scene)

    def test_rigid_punch(self):
        """A tilted punch turns by 0.05 rad until it lies on a block: as a rigid body, its surface alone, and stiff."""
        for form in ("rigid", "surface", "stiff"):
            scene = Scene("3d", "theta=0, tolerance=1e-9")
            scene.body("block", box("hex8", (8, 8, 4), (0, 0, 0), (2, 2, 1)), 1000.0)
            punch = box("hex8", (5, 5, 2), (0.5, 0.5, 1), (1.5, 1.5, 1.5))
            punch.move(lambda x: np.column_stack([x[:, :2], x[:, 2] + 0.05 * (x[:, 0] - 1) * (1.5 - x[:, 2]) * 2]))
            surface = "surface='bottom', facing=1,1,-5"
            scene.body("punch", punch, 1e9, part=surface if form == "surface" else None)
            scene.fix("block", "bottom", "xyz", (0, 0, 0))
            scene.raw("&load body='punch', surface='%s', force=0,0,-5.97, point=1.0667,0.8648,1.5"
                      % ("bottom" if form == "surface" else "top"))
            if form == "stiff":
                scene.raw("&spring body='punch', surface='top', fix='xy', modulus=1e7")
            else:
                scene.raw("&rigid_body body='punch', fix='x y rz', point=1,1,1.5")
            scene.pair("contact", "block:top", "punch:bottom")
            self.check_unturned(scene)

    def check_unturned(self, scene):
        """Exit code 0 without penetration."""
        answer = scene.solve()
        self.assertEqual(answer.code, 0, answer.log)
        self.assertNotRegex(answer.log, "(?m)^  penetration ")

    def test_field(self):
        """The field of the results file: the depth where nodes are too deep, 0 elsewhere."""
        scene = Scene("plane_strain")
        held(scene, "lower", box("quad4", 4, (0, 0), (1, 1)))
        moved(scene, "upper", box("quad4", 3, (0.2, 1), (0.8, 1.5)), (0, -0.05))
        with tempfile.TemporaryDirectory() as folder:
            scene.write(folder)
            subprocess.run([os.environ["DOTYK"], "scene.nml", "--quiet"], cwd=folder, check=False)
            with h5py.File(folder + "/scene.vtkhdf") as file:
                n = file["VTKHDF/NumberOfPoints"][:]
                x, depth = file["VTKHDF/Points"][:], file["VTKHDF/PointData/penetration"][:]
        deep = np.isclose(x[:, 1], 1) & ((np.arange(len(x)) >= n[0]) | (np.abs(x[:, 0] - 0.5) < 0.3))
        np.testing.assert_allclose(depth, np.where(deep, 0.05, 0), atol=1e-12)


class Copies(dotyk_case.Case):
    def test_body_almost_in_its_copy(self):
        """Two discs 0.002 of their radius apart: no node is deep, the middle of an element is."""
        self.write("disc.geo", 'SetFactory("OpenCASCADE");\nDisk(1) = {0, 0, 0, 1};\nMesh.MeshSizeMax = 0.3;\n'
                   'Mesh.ElementOrder = 2;\nPhysical Surface("disc") = {1};\nPhysical Curve("rim") = {1};\n')
        text = "&scene mesh='disc.geo', analysis='plane_strain' /\n&material name='m', young=1, poisson=0.3 /\n"
        for name, at in (("one", 0), ("two", 0.002)):
            text += ("&body name='%s', volume='disc', material='m', at=%g,0 /\n&support body='%s', surface='rim', "
                     "fix='xy' /\n&load body='%s', force_density=0,-1e-3 /\n" % (name, at, name, name))
        self.write("case.nml", text)
        log = self.dotyk("case.nml", code=1)
        self.assertRegex(log, r"overlap +'one' is inside 'two' by 0\.[89]\d* at .* before loading")
        self.assertRegex(log, r"penetration +'one' is inside 'two' by 0\.[89]\d*")


class Pins(dotyk_case.Case):
    GEO = """
SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, -14, 0, 0, 14, 5};  Cylinder(2) = {0, 0, 0, 0, 0, 3, 8};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Box(4) = {-15, -15, -10, 30, 30, 10};  Cylinder(5) = {0, 0, -10, 0, 0, 10, 5};
BooleanDifference(6) = { Volume{4}; Delete; }{ Volume{5}; Delete; };
Box(7) = {0, 0, -20, 20, 20, 40};  Box(8) = {0, 0, -20, 20, 20, 40};
BooleanIntersection(9) = { Volume{3}; Delete; }{ Volume{7}; Delete; };
BooleanIntersection(10) = { Volume{6}; Delete; }{ Volume{8}; Delete; };
Physical Volume("pin") = {9};  Physical Volume("plate") = {10};
e = 1e-3;
For body In {9:10}
  x() = {};  y() = {};  end() = {};
  sides() = Boundary{ Volume{body}; };
  For k In {0:#sides()-1}
    b() = BoundingBox Surface{Abs(sides(k))};
    If (b(3) < e) x() += {Abs(sides(k))}; EndIf
    If (b(4) < e) y() += {Abs(sides(k))}; EndIf
    If (b(5) < (body == 9 ? -13.9 : -9.9)) end() += {Abs(sides(k))}; EndIf
  EndFor
  Physical Surface(Sprintf("%g x", body)) = x();
  Physical Surface(Sprintf("%g y", body)) = y();
  Physical Surface(Sprintf("%g end", body)) = end();
EndFor
Mesh.MeshSizeMin = 2.5;  Mesh.MeshSizeMax = 2.5;  Mesh.ElementOrder = 2;  Mesh.HighOrderOptimize = 0;
"""

    def test_pin_in_a_hole_of_its_radius(self):
        """The chords of the rim of the hole are within the shank of the pin, the curved edge is not."""
        self.write("pin.geo", self.GEO)
        self.write("case.nml", """&scene mesh='pin.geo' /
&material name='steel', young=210e3, poisson=0.3 /
&body name='pin', volume='pin', material='steel' /
&body name='plate', volume='plate', material='steel' /
&support body='p*', surface='* x', fix='x' /
&support body='p*', surface='* y', fix='y' /
&support body='plate', surface='10 end', fix='z' /
&load body='pin', surface='9 end', force=0,0,-2500 /
&contact auto=.true. /
&solver theta=0 /
&output error_parts='' /
""")
        log = self.dotyk("case.nml")
        self.assertNotRegex(log, "(?m)^  (penetration|warning) .* is inside ")


dotyk_case.main()
