"""Bolts that cut a body of the mesh: closed forms, the body without a cut, halves that the user has made."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import blocks  # noqa: E402
from dotyk_case import Case, main  # noqa: E402

MATERIAL = "&material name='steel', young=1e5, poisson=%r /"
# A rotation of 33 degrees about (1, 2, 3), then a shift.
PLACED = ", at=1,2,3, axis=1,2,3, angle=33"


def in_place(points):
    """Points or vectors of the mesh as PLACED rotates them."""
    a = np.array([1, 2, 3]) / np.sqrt(14)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    angle = np.radians(33)
    return np.asarray(points) @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross).T


def numbers(values):
    return ",".join("%.17g" % v for v in values)


CLAMP = """SetFactory("OpenCASCADE");
Mesh.MeshSizeMax = 1.4; Mesh.ElementOrder = 2;
Box(1) = {-4, -4, -2, 8, 8, 2}; Box(2) = {-1.5, -1.5, -2, 3, 3, 2};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Box(4) = {-4, -4, 0, 8, 8, 2}; Box(5) = {-1.5, -1.5, 0, 3, 3, 2};
BooleanDifference(6) = { Volume{4}; Delete; }{ Volume{5}; Delete; };
Box(7) = {-1, -1, -2, 2, 2, 4}; Box(8) = {-2.5, -2.5, 2, 5, 5, 1}; Box(9) = {-2.5, -2.5, -3, 5, 5, 1};
BooleanUnion(10) = { Volume{7}; Delete; }{ Volume{8, 9}; Delete; };
Physical Volume("base") = {3}; Physical Volume("plate") = {6}; Physical Volume("bolt") = {10};
Physical Surface("side") = Surface In BoundingBox {-4.1, -4.1, -2.1, -3.9, 4.1, 0.1};
Physical Surface("head") = Surface In BoundingBox {-2.6, -2.6, 2.9, 2.6, 2.6, 3.1};
"""
CLAMPED = ["&scene mesh='clamp.geo' /", "&material name='steel', young=210e3, poisson=0.3 /",
           *("&body name='%s', volume='%s', material='steel' /" % (name, name) for name in ("base", "plate", "bolt")),
           "&support body='base', surface='side', fix='xyz' /", "&contact auto=.true. /"]


class Bolts(Case):
    def solve(self, name, lines, code=0):
        """Log and results of a scene."""
        self.write(name + ".nml", "\n".join(lines) + "\n")
        log = self.dotyk(name + ".nml", code=code)
        return log, None if code else self.results(name + ".vtkhdf")

    def bar(self, kind, poisson=0.3):
        """A bar of height 3 between walls."""
        d = blocks.dimension(kind)
        n = {"tet10": 2, "tet4": 3, "tri6": 3}.get(kind, (2, 3, 5)[3 - d:])
        self.write("bar.geo", blocks.block_geo(kind, n, (0, 0, 0)[:d], (1, 1, 3)[3 - d:]))
        return ["&scene mesh='bar.geo'%s /" % (", analysis='plane_stress'" if d == 2 else ""), MATERIAL % poisson,
                "&body name='bar', volume='block', material='steel'%s /" % (PLACED if d == 3 else ""),
                "&support body='bar', surface='bottom', fix='n' /", "&support body='bar', surface='top', fix='n' /"]

    def test_bar(self):
        """F L = E A s, given either, on cuts as jagged as the elements leave them."""
        point, normal = in_place([0.4, 0.5, 1.3]) + [1, 2, 3], in_place([0, 0, 1])
        for kind, key, value in (("tet10", "shortening", 1e-3), ("tet4", "force", 100 / 3), ("hex20", "force", 100 / 3),
                                 ("tri6", "shortening", 1e-3)):
            with self.subTest(kind=kind):
                cut = "point=%s, normal=%s" % (numbers(point), numbers(normal))
                if kind == "tri6":
                    cut = "point=0,1.3, normal=0,2"
                log, file = self.solve("bar", [*self.bar(kind), "&bolt name='b', body='bar', %s, %s=%r /" % (cut, key, value)])
                self.assertAlmostEqual(file["dotyk/ties/tension"][0] / (100 / 3), 1, delta=1e-9)
                self.assertAlmostEqual(file["dotyk/ties/shortening"][0] / 1e-3, 1, delta=1e-9)
                summary = file["dotyk/summary"].attrs
                self.assertAlmostEqual(summary["energy_norm"]**2 / (1e-3 * 100 / 3), 1, delta=1e-9)
                self.assertLess(summary["error_discretization"], 1e-9)
                self.assertIn("bar (1)", log)

    def test_half_that_is_free(self):
        """The tension balances the pull on the upper half, which is free along the normal: any shortening fits."""
        lines = [*self.bar("hex8")[:3], "&support body='bar', surface='bottom', fix='xyz' /",
                 "&load body='bar', surface='top', pressure=-2 /",
                 "&bolt name='b', body='bar', point=%s, normal=%s, force=2 /" % (
                     numbers(in_place([0.4, 0.5, 1.3]) + [1, 2, 3]), numbers(in_place([0, 0, 1])))]
        log, file = self.solve("free", lines)
        self.assertIn("nothing determines its shortening", log)
        self.assertUnknown(file["dotyk/ties/shortening"][:])
        self.assertAlmostEqual(file["dotyk/ties/tension"][0] / 2, 1, delta=1e-9)
        # A pull that the tension does not balance: no equilibrium.
        lines[4] = "&load body='bar', surface='top', pressure=-3 /"
        self.solve("pulled", lines, code=3)

    def test_without_shortening(self):
        """A cut that is not shortened leaves the displacements of the whole body, of quadratic elements, too."""
        lines = [*self.bar("tet10")[:4], "&load body='bar', surface='sides x', pressure_formula='x+2*z' /",
                 "&support body='bar', surface='top', fix='xyz' /"]
        whole = self.solve("whole", lines)[1]
        cut = self.solve("cut", [*lines, "&bolt name='b', body='bar', point=%s, normal=%s, shortening=0 /"
                                 % (numbers(in_place([0.4, 0.5, 1.3]) + [1, 2, 3]), numbers(in_place([0.2, 0, 1])))])[1]
        found = {}
        for file in whole, cut:
            x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
            for a, b in zip(np.round(x, 9), u):
                found.setdefault(tuple(a + 0.0), []).append(b)
        scale = np.abs(whole["VTKHDF/PointData/displacement"][:]).max()
        self.assertGreater(sum(len(values) == 3 for values in found.values()), 10)
        for values in found.values():
            self.assertGreater(len(values), 1)
            self.assertLess(np.ptp(values, axis=0).max(), 1e-9 * scale)

    def test_tied_across_the_cut(self):
        """A body that is tied to both halves, with facets over the cut, moves as it does on the whole body."""
        self.write("bar.geo", blocks.block_geo("hex8", (8, 2, 2), (0, 0, 0), (1, 1, 1)))
        self.write("top.geo", blocks.block_geo("hex8", (2, 2, 1), (0, 0, 1), (1, 1, 0.5)))
        energy = []
        for tie, bolt in (("surface_a='bar:top', surface_b='top:bottom'", ""), ("surface_a='top:bottom', surface_b='bar:top'", ""),
                          ("surface_a='top:bottom', surface_b='bar:top'", "&bolt name='b', body='bar', point=0.3,0,0, normal=1,0,0, shortening=0 /")):
            file = self.solve("tied", [
                "&scene /", MATERIAL % 0.3, *("&body name='%s', mesh='%s.geo', volume='block', material='steel' /" % (b, b)
                                              for b in ("bar", "top")),
                "&support body='bar', surface='bottom', fix='xyz' /", "&load body='top', surface='top', traction=3,1,-5 /",
                "&tie name='weld', %s /" % tie, bolt])[1]
            energy.append(file["dotyk/summary"].attrs["energy"])
        self.assertAlmostEqual(energy[2] / energy[0], 1, delta=1e-10)
        self.assertGreater(abs(energy[1] / energy[0] - 1), 1e-3)

    def test_before_it_is_tightened(self):
        """In load cases before, the bolt is the whole body; a negative shortening is told."""
        lines = [*self.bar("hex20")[:4], "&load body='bar', surface='sides x', pressure_formula='x+2*z' /",
                 "&support body='bar', surface='top', fix='xyz' /"]
        whole = self.solve("whole", lines)[1]["dotyk/summary"].attrs["energy"]
        cut = "&bolt name='b', body='bar', point=%s, normal=%s, " % (numbers(in_place([0.4, 0.5, 1.3]) + [1, 2, 3]),
                                                                    numbers(in_place([0, 0, 1])))
        log, file = self.solve("cases", [*lines, cut + "force=7, case='tight' /", "&case name='before' /", "&case name='tight' /"])
        before, tight = (file["dotyk/cases"][name] for name in ("before", "tight"))
        self.assertAlmostEqual(before["summary"].attrs["energy"] / whole, 1, delta=1e-9)
        self.assertAlmostEqual(before["ties/shortening"][0], 0, delta=1e-15)
        self.assertAlmostEqual(tight["ties/tension"][0] / 7, 1, delta=1e-9)
        self.assertNotIn("negative", log)
        log, file = self.solve("pushed", [*lines, cut + "shortening=-1e-3 /"])
        self.assertIn("warning: the shortening of &bolt 'b' (line 7) is negative: it pushes the halves apart", log)
        self.assertLess(file["dotyk/ties/tension"][0], 0)

    def test_oblique(self):
        """A normal off the shank is told: between walls that slide the shank carries F/cos of the angle."""
        lines = self.bar("hex20")
        for degrees in 0, 30:
            normal = in_place([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
            log, file = self.solve("oblique", [*lines, "&bolt name='b', body='bar', point=%s, normal=%s, force=100 /"
                                               % (numbers(in_place([0.4, 0.5, 1.3]) + [1, 2, 3]), numbers(normal))])
            self.assertAlmostEqual(np.linalg.norm(file["dotyk/supports/force"][0]) * np.cos(np.radians(degrees)), 100, delta=1e-7)
            self.assertEqual("30 degrees off the shank" in log, degrees == 30)

    def test_search_for_contact(self):
        """Inner faces of a jagged cut touch nothing; exclude and the search distance are those of the whole."""
        self.write("beam.geo", blocks.block_geo("tet4", (2, 6, 2), (0, 0, -0.01), (1, 4, 1)))
        self.write("plate.geo", blocks.block_geo("hex8", (3, 9, 2), (-1, -1, -1), (3, 6, 1)))
        lines = ["&scene /", MATERIAL % 0.3, *("&body name='%s', mesh='%s.geo', volume='block', material='steel' /" % (b, b)
                                               for b in ("beam", "plate")),
                 "&support body='plate', surface='bottom', fix='xyz' /", "&support body='beam', surface='top', fix='xyz' /",
                 "&solver theta=0 /"]
        bolt = "&bolt name='b', body='beam', point=0.5,2,0.5, normal=0,1,%s, shortening=0 /"
        auto = "&contact auto=.true. /"
        whole = self.solve("beam", [*lines, auto])[1]["dotyk/summary"].attrs["energy"]
        for slope in 0, -0.9:
            cut = self.solve("beam", [*lines, auto, bolt % slope])[1]["dotyk/summary"].attrs["energy"]
            self.assertAlmostEqual(cut / whole, 1, delta=1e-9)
        log = self.solve("beam", [*lines, "&contact auto=.true., exclude='beam - plate' /", bolt % 0], code=1)[0]
        self.assertIn("0 pairs of faces that face each other; 2 excluded", log)

    def test_halves_of_the_user(self):
        """A bolt clamps a plate between two caps, and is locked while one of them is pulled off: the same as with halves
        that are bodies of their own."""
        self.write("plate.geo", blocks.block_geo("hex8", (2, 2, 2)))
        self.write("cap.geo", blocks.block_geo("hex8", (6, 2, 2), (0, 0, 1), (3, 1, 0.5)))
        self.write("base.geo", blocks.block_geo("hex8", (6, 2, 1), (0, 0, -0.5), (3, 1, 0.5)))
        self.write("post.geo", blocks.block_geo("hex8", (2, 2, 2), (2, 0, 0)))
        self.write("half.geo", blocks.block_geo("hex8", (2, 2, 1), (2, 0, 0), (1, 1, 0.5)))
        body = "&body name='%s', mesh='%s.geo', volume='block', material='steel'%s /"
        found = []
        for parts, low, up, cut in (([("post", "post", "")], "post", "post", "body='post', point=0,0,0.52, normal=0,0,1"),
                                    ([("low", "half", ""), ("up", "half", ", at=0,0,0.5")], "low", "up",
                                     "surface_a='low:top', surface_b='up:bottom'")):
            lines = ["&scene /", MATERIAL % 0.3, *(body % (name, name, "") for name in ("plate", "cap", "base")),
                     *(body % part for part in parts),
                     "&tie name='above', surface_a='%s:top', surface_b='cap:bottom' /" % up,
                     "&tie name='below', surface_a='%s:bottom', surface_b='base:top' /" % low,
                     "&bolt name='bolt', %s, force=50 /" % cut,
                     "&contact name='top', surface_a='plate:top', surface_b='cap:bottom', theta=0 /",
                     "&contact name='bottom', surface_a='plate:bottom', surface_b='base:top', theta=0 /",
                     "&support body='base', surface='bottom', fix='xyz' /",
                     "&load body='cap', surface='top', pressure=-3, case='pulled' /",
                     "&load body='*', force_density=0,0,-0.1 /", "&solver tolerance=1e-10 /",
                     "&case name='tight' /", "&case name='pulled' /"]
            found.append(self.solve("clamp", lines)[1]["dotyk/cases"])
            found[-1] = {case: (file["summary"].attrs["energy"], file["ties/tension"][2], file["ties/force"][:],
                                file["contact/top"].attrs["force"]) for case, file in found[-1].items()}
        for case in "tight", "pulled":
            for one, two in zip(found[0][case], found[1][case]):
                np.testing.assert_allclose(one, two, rtol=1e-8, atol=1e-8, err_msg=case)
        self.assertGreater(found[0]["pulled"][1], 51)

    def test_weak_springs(self):
        """A bolt clamps a plate on a base that is held. A spring on the head of the bolt, however weak, carries what its
        stiffness times the motion of the head is, and changes nothing else."""
        self.write("clamp.geo", CLAMP)
        lines = [*CLAMPED, "&bolt name='b', body='bolt', point=0,0,0, normal=0,0,1, force=1e3 /"]
        spring = "&spring body='bolt', surface='head', fix='%s', stiffness=%r /"
        _, file = self.solve("clamp", lines)
        energy = file["dotyk/summary"].attrs["energy"]
        shortening = file["dotyk/ties/shortening"][0]
        motion = []
        for fix, stiffness in (("xyz", 20.0), ("xyz", 1.0), ("xyz", 1e-3), ("n", 20.0)):
            with self.subTest(fix=fix, stiffness=stiffness):
                _, file = self.solve("clamp", [*lines, spring % (fix, stiffness)])
                summary = file["dotyk/summary"].attrs
                self.assertLess(summary["error_bound"], 1e-8)
                # The stiffness of the clamp along the shank is 1e5: springs of 20 change 2e-4 of anything at most.
                change = 1e-5 * stiffness
                self.assertAlmostEqual(file["dotyk/ties/tension"][0] / 1e3, 1, delta=1e-9)
                self.assertAlmostEqual(file["dotyk/ties/shortening"][0] / shortening, 1, delta=change + 1e-8)
                self.assertAlmostEqual(summary["energy"] / energy, 1, delta=change + 1e-8)
                supports = file["dotyk/supports"]
                springs = supports.attrs["names"].decode().split("\n").index("bolt (2):head (spring)")
                motion.append(supports["force"][springs, 2] / stiffness)
        # At the head it is 3e4.
        np.testing.assert_allclose(motion, motion[2], rtol=1e-3)

    def test_multigrid(self):
        """p-multigrid tightens bolts as factors do: tension exact, shortening to the bound."""
        self.write("clamp.geo", CLAMP)
        lines = [*CLAMPED, "&bolt name='b', body='bolt', point=0,0,0, normal=0,0,1, force=1e3 /"]
        _, exact = self.solve("clamp", [*lines, "&solver response='full', theta=0, tolerance=1e-8 /"])
        log, file = self.solve("clamp", [*lines, "&solver response='multigrid', theta=0, tolerance=1e-7 /"])
        self.assertIn("with p-multigrid", log)
        self.assertAlmostEqual(file["dotyk/ties/tension"][0] / 1e3, 1, delta=1e-7)
        self.assertAlmostEqual(file["dotyk/ties/shortening"][0] / exact["dotyk/ties/shortening"][0], 1, delta=1e-6)
        bound, strain = (file["dotyk/summary"].attrs[name] for name in ("error_bound", "strain_energy"))
        self.assertLess(bound, 1e-7)
        self.assertLess(abs(strain / exact["dotyk/summary"].attrs["strain_energy"] - 1), 2 * bound + 1e-12)

    def test_along_a_surface(self):
        """A surface that the mesh has inside the body."""
        self.write("inside.geo", 'Point(1) = {0,0,0}; l() = Extrude {1,0,0} { Point{1}; Layers{2}; };\n'
                   'f() = Extrude {0,1,0} { Curve{l(1)}; Layers{2}; Recombine; };\n'
                   'low() = Extrude {0,0,1} { Surface{f(1)}; Layers{2}; Recombine; };\n'
                   'up() = Extrude {0,0,2} { Surface{low(0)}; Layers{3}; Recombine; };\n'
                   'Physical Volume("bar") = {low(1), up(1)}; Physical Surface("middle") = {low(0)};\n'
                   'Physical Surface("bottom") = {f(1)}; Physical Surface("top") = {up(0)};\n')
        lines = ["&scene mesh='inside.geo' /", MATERIAL % 0.3, "&body name='bar', volume='bar', material='steel' /",
                 "&support body='bar', surface='bottom', fix='z' /", "&support body='bar', surface='top', fix='z' /"]
        file = self.solve("inside", [*lines, "&bolt name='b', body='bar', surface='middle', shortening=1e-3 /"])[1]
        self.assertAlmostEqual(file["dotyk/ties/tension"][0] / (100 / 3), 1, delta=1e-9)
        text = self.solve("inside", [*lines, "&bolt name='b', body='bar', surface='top', shortening=1e-3 /"], code=2)[0]
        self.assertIn("the surface 'top' leaves 1 of the body, not two halves", text)

    def test_sides_of_a_sector(self):
        """A cut that leaves other lines on both sides of a sector is refused: what meets the other half is not tied."""
        self.write("ring.geo", "Point(1) = {1, 0, 0}; Point(2) = {2, 0, 0}; Point(3) = {1/Sqrt(2), 1/Sqrt(2), 0};\n"
                   "Point(4) = {Sqrt(2), Sqrt(2), 0}; Point(5) = {0, 0, 0}; Line(1) = {1, 2}; Line(2) = {3, 4};\n"
                   "Circle(3) = {1, 5, 3}; Circle(4) = {2, 5, 4}; Curve Loop(1) = {1, 4, -2, -3}; Plane Surface(1) = {1};\n"
                   "Transfinite Curve{1} = 5; Transfinite Curve{2} = 8; Transfinite Curve{3, 4} = 6;\n"
                   'Physical Surface("ring") = {1}; Physical Curve("a") = {1}; Physical Curve("b") = {2};\n')
        log = self.solve("ring", ["&scene mesh='ring.geo', analysis='plane_stress' /", MATERIAL % 0.3,
                                  "&body name='ring', volume='ring', material='steel' /",
                                  "&tie name='sides', surface_a='ring:b', surface_b='ring:a', angle=45 /",
                                  "&bolt name='t', body='ring', point=%s, normal=%s, shortening=0 /" % (
                                      numbers(1.5 * np.array([np.cos(np.pi / 8), np.sin(np.pi / 8)])),
                                      numbers([np.cos(np.pi / 8), np.sin(np.pi / 8)]))], code=2)[0]
        self.assertRegex(log, r"ring.nml:4: &tie 'sides': .* % of 'b' of body 'ring \(.\)' meets the other half")

    def test_refusals(self):
        """What cannot be cut, and what would act twice."""
        lines = self.bar("hex20")
        inner = [line.replace("bar.geo", "inner.geo") for line in lines]
        self.write("inner.geo", 'Point(1) = {0,0,0}; l() = Extrude {1,0,0} { Point{1}; Layers{1}; };\n'
                   'f() = Extrude {0,1,0} { Curve{l(1)}; Layers{1}; Recombine; };\n'
                   'low() = Extrude {0,0,1} { Surface{f(1)}; Layers{2}; Recombine; };\n'
                   'up() = Extrude {0,0,2} { Surface{low(0)}; Layers{3}; Recombine; };\n'
                   'Physical Volume("block") = {low(1), up(1)}; Physical Surface("middle") = {low(0)};\n'
                   'Physical Surface("bottom") = {f(1)}; Physical Surface("top") = {up(0)};\n')
        log = self.solve("bad", [*inner, "&load body='bar', surface='middle', pressure=1 /",
                                 "&bolt name='b', body='bar', surface='middle', force=1 /"], code=2)[0]
        self.assertIn("'middle' lies inside the body", log)
        # Inside one of the halves.
        log = self.solve("bad", [*inner, "&load body='bar', surface='middle', pressure=1 /",
                                 "&bolt name='b', body='bar', point=%s, normal=%s, force=1 /"
                                 % (numbers(in_place([0.4, 0.5, 2]) + [1, 2, 3]), numbers(in_place([0, 0, 1])))], code=2)[0]
        self.assertIn("bad.nml:6: body 'bar (1)': mesh 'inner.geo': 'middle' lies inside the body", log)
        log = self.solve("bad", [*self.bar("tet10"), "&bolt name='b', body='bar', point=%s, normal=%s, force=1 /"
                                 % (numbers(in_place([0.5, 0.5, 0.5]) + [1, 2, 3]), numbers(in_place([0, 0, 1])))], code=2)[0]
        self.assertIn("along faces of elements the plane takes 25 % of its section", log)
        self.assertEqual(log.count("cannot be cut"), 1)
        lines = self.bar("hex20")
        for bolt, text in (
                ("body='bar', point=0,0,9, normal=0,0,1", "the plane leaves all elements on one side of it"),
                ("body='bar', point=0,0,1, normal=0,0,0", "normal has no direction"),
                ("body='bar', point=0,0,1", "cut by a plane, 'point' and 'normal', or along a 'surface' inside it"),
                ("body='bolt', point=0,0,1, normal=0,0,1", "unknown body 'bolt'"),
                ("surface_a='bar:top'", "'surface_b' is missing, or body, which the program cuts"),
                ("body='bar', surface_a='bar:top', point=0,0,1, normal=0,0,1", "surface_a does not go together with body"),
                ("body='bar', surface='inside'", "body 'bar' cannot be cut by the &bolt of line 6: mesh 'bar.geo'")):
            with self.subTest(bolt=bolt):
                log = self.solve("bad", [*lines, "&bolt name='b', %s, force=1 /" % bolt], code=2)[0]
                self.assertIn(text, log)
        cut = "&bolt name='b', body='bar', point=%s, normal=%s, force=1 /" % (
            numbers(in_place([0.4, 0.5, 1.3]) + [1, 2, 3]), numbers(in_place([0, 0, 1])))
        log = self.solve("twice", [*lines, cut, "&load body='bar', surface='sides x', force=0,0,1 /"], code=2)[0]
        self.assertIn("&load: the surface lies on both halves of body 'bar', and each would get the whole force", log)
        log = self.solve("again", [*lines, cut, cut.replace("'b'", "'c'")], code=2)[0]
        self.assertIn("body 'bar' is cut already in line 6", log)
        self.solve("one", [*lines, cut, "&load body='bar (2)', surface='top', force=%s /"
                           % numbers(in_place([0, 0, 1]))])


if __name__ == "__main__":
    main()
