#!/usr/bin/python3
"""Bodies that nothing holds at their worst: many of them, balanced on an edge, turned against nothing, pressing on each
other alone."""
import os
import subprocess
import sys

import numpy as np

import dotyk_case
from blocks import block_geo

sys.path.insert(0, str(dotyk_case.ROOT / "benchmarks"))
import balls  # noqa: E402

YOUNG = 200.0
DISC = """SetFactory("OpenCASCADE");
Disk(1) = {0, 1, 0, 1};
Mesh.MeshSizeMax = 0.2;  Mesh.ElementOrder = 2;
Physical Surface("disc") = {1};
Physical Curve("rim") = {1};
"""
SOCKET = """SetFactory("OpenCASCADE");
Rectangle(1) = {-2, -1, 0, 4, 4};
Disk(2) = {0, 1, 0, 1};
BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }
Mesh.MeshSizeMax = 0.3;  Mesh.ElementOrder = 2;
Physical Surface("socket") = {1};
h() = Curve In BoundingBox {-1.1, -0.1, -0.1, 1.1, 2.1, 0.1};
Physical Curve("hole") = {h()};
b() = Curve In BoundingBox {-2.1, -1.1, -0.1, 2.1, -0.9, 0.1};
Physical Curve("bottom") = {b()};
"""
RIDGE = """Point(1) = {-1, 0, 0};  Point(2) = {1, 0, 0};  Point(3) = {0, 1, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 1};
Curve Loop(1) = {1, 2, 3};  Plane Surface(1) = {1};
Mesh.MeshSizeMax = 0.25;
Physical Surface("ridge") = {1};
Physical Curve("bottom") = {1};
Physical Curve("sides") = {2, 3};
"""
# Two squares that have one node in common.
HINGE = """
Point(1) = {0, 0, 0};  Point(2) = {1, 0, 0};  Point(3) = {1, 1, 0};  Point(4) = {0, 1, 0};
Point(5) = {2, 1, 0};  Point(6) = {2, 2, 0};  Point(7) = {1, 2, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Line(5) = {3, 5};  Line(6) = {5, 6};  Line(7) = {6, 7};  Line(8) = {7, 3};
Curve Loop(1) = {1, 2, 3, 4};  Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, 8};  Plane Surface(2) = {2};
Mesh.MeshSizeMax = 0.25;
Physical Surface("hinge") = {1, 2};
Physical Curve("bottom") = {1};
Physical Curve("low") = {5};
"""
# A square whose lower side begins with a facet of no length to speak of.
PINNED = """
Point(1) = {0, 1, 0, 1e-5};  Point(2) = {1e-5, 1, 0, 1e-5};
Point(3) = {1, 1, 0, 0.2};  Point(4) = {1, 2, 0, 0.2};  Point(5) = {0, 2, 0, 0.2};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};  Line(5) = {5, 1};
Curve Loop(1) = {1, 2, 3, 4, 5};  Plane Surface(1) = {1};
Physical Surface("pinned") = {1};
Physical Curve("pin") = {1};
Physical Curve("low") = {2};
"""


# A fork, a tie rod of 300 with an eye, and a pin with 0.02 of clearance; the ears of the fork are at x = 0.
TIE_ROD = """SetFactory("OpenCASCADE");
Mesh.MeshSizeMax = 8; Mesh.ElementOrder = 2;
r=6; c=0.02;
Box(1)={-50,-20,-12,12,40,24};
Box(2)={-38,-20,-12,38,8,24}; Box(3)={-38,12,-12,38,8,24};
Cylinder(4)={0,-20,0,0,8,0,12}; Cylinder(5)={0,12,0,0,8,0,12};
f()=BooleanUnion{Volume{1};Delete;}{Volume{2,3,4,5};Delete;};
Cylinder(6)={0,-30,0,0,60,0,r+c};
f()=BooleanDifference{Volume{f()};Delete;}{Volume{6};Delete;};
Box(10)={0,-11.5,-12,300,23,24}; Cylinder(11)={0,-11.5,0,0,23,0,12};
y()=BooleanUnion{Volume{10};Delete;}{Volume{11};Delete;};
Cylinder(12)={0,-30,0,0,60,0,r+c};
y()=BooleanDifference{Volume{y()};Delete;}{Volume{12};Delete;};
Cylinder(20)={0,-24,0,0,48,0,r};
MeshSize{PointsOf{Volume{20};}}=3;
Physical Volume("fork")={f()}; Physical Volume("eye")={y()}; Physical Volume("pin")={20};
e=1e-3;
Physical Surface("base")=Surface In BoundingBox{-50-e,-100,-100,-50+e,100,100};
Physical Surface("end")=Surface In BoundingBox{300-e,-100,-100,300+e,100,100};
"""


class FreeExtreme(dotyk_case.Case):
    """Plane scenes, and balls."""

    def block(self, name, n, origin, size):
        """Lines of a block."""
        self.write(name + ".geo", block_geo("quad8", n, origin, size))
        return "&body name='%s', mesh='%s.geo', volume='block', material='m' /\n" % (name, name)

    def scene(self, text, solver="theta=0, tolerance=1e-8", errors=""):
        self.write("case.nml", "&scene analysis='plane_strain' /\n&material name='m', young=%r, poisson=0.3 /\n"
                   "%s&solver %s /\n"
                   "&output fields='displacement contact', error_parts='%s' /\n" % (YOUNG, text, solver, errors))

    def solve(self):
        """Run; returns log and results."""
        log = self.dotyk("case.nml")
        file = self.results("case.vtkhdf")
        self.assertEqual(file["dotyk/summary"].attrs["converged"], 1)
        return log, file

    def by_both(self):
        """The results with factors, then those by displacements with p-multigrid; their logs."""
        text = (self.folder / "case.nml").read_text()
        for response in "full", "multigrid":
            self.write("case.nml", text.replace("&solver ", "&solver response='%s', " % response))
            with self.subTest(response):
                log, file = self.solve()
                self.assertEqual("conjugate gradients with p-multigrid" in log, response == "multigrid")
                yield log, file

    def refuse(self, *parts):
        done = subprocess.run([os.environ["DOTYK"], "case.nml", "--verbose"], cwd=self.folder, text=True, timeout=60,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.assertEqual(done.returncode, 3, done.stdout + done.stderr)
        for part in parts:
            self.assertIn(part, done.stderr)

    def test_balls_in_a_box(self):
        """27 balls on each other, with and without layers: each is in equilibrium, but for what rests on weak springs along
        motions that facets alone resist; the floor carries all."""
        for options in ("theta_mesh=1e-2, tolerance=1e-6", "theta=0, tolerance=1e-6"):
            with self.subTest(options):
                n_balls, _ = balls.write_scene(self.folder, (3, 3, 3), options)
                log = self.dotyk("balls.nml")
                weight, spread, floor, summary = balls.check_statics(self.folder / "balls.vtkhdf")
                self.assertEqual((summary["converged"], summary["rigid_body_modes"]), (1, 6 * n_balls))
                self.assertLessEqual(summary["error_bound"], 1e-6)
                self.assertAlmostEqual(weight / (4 * np.pi / 3), 1, delta=0.1)  # of a ball of triangles
                # The springs that hold the spins, which facets resist, carry moments alone.
                self.assertLess(spread, 1e-4)
                self.assertNotIn("large motion", log)
                self.assertLess(floor, 1e-3)
                # Active sets alone had not ended after 60.
                self.assertLess(summary["iterations"], 30)

    def test_network_of_balls(self):
        """64 balls, whose 384 modes take conjugate gradients on their network: the solution of one factor of everything."""
        energy = []
        for solver in ("", ", linear_solver='direct'"):
            n_balls, _ = balls.write_scene(self.folder, (4, 4, 4), "theta_mesh=1e-2, tolerance=1e-6" + solver)
            self.dotyk("balls.nml")
            _, spread, floor, summary = balls.check_statics(self.folder / "balls.vtkhdf")
            self.assertEqual((summary["converged"], summary["rigid_body_modes"]), (1, 6 * n_balls))
            self.assertLessEqual(summary["error_bound"], 1e-6)
            self.assertLess(spread, 1e-4)
            self.assertLess(floor, 1e-3)
            energy.append(summary["energy"])
        self.assertAlmostEqual(energy[0] / energy[1], 1, delta=1e-6)

    def test_hinge(self):
        """A tie rod in its hinge, pulled along its axis: by symmetry it does not swing, though nothing but errors of
        the mesh resists. It swung by 50 times its elongation, less than two facets at the pin."""
        self.write("hinge.geo", TIE_ROD)
        self.write("case.nml", "&scene mesh='hinge.geo' /\n&material name='steel', young=210e3, poisson=0.3 /\n" +
                   "".join("&body name='%s', volume='%s', material='steel' /\n" % (name, name)
                           for name in ("fork", "eye", "pin")) +
                   "&support body='fork', surface='base', fix='xyz' /\n"
                   "&load body='eye', surface='end', traction=20,0,0 /\n"
                   "&contact auto=.true. /\n&solver theta=0, tolerance=1e-8 /\n"
                   "&output fields='displacement contact', error_parts='' /\n")
        for log, file in self.by_both():
            self.assertRegex(log, "not determined by contact: .* of .*'eye'")
            u = np.abs(file["VTKHDF/PointData/displacement"][:]).max(axis=0)
            # Facets of 3 on a radius of 6 tilt normals: no more than the pin's clearance and the pull leave.
            self.assertLess(u[2], u[0])

    def test_row_of_a_hundred(self):
        """A hundred blocks on a frictionless floor, pushed against a wall: the push arrives, and weight does not
        matter."""
        n = 100
        self.write("one.geo", block_geo("quad8", 1, (0, 0), (1, 1)).replace(
            'Physical Surface("block")',
            'l() = Curve In BoundingBox {-0.1, -0.1, -0.1, 0.1, 1.1, 0.1};\nPhysical Curve("left") = {l()};\n'
            'r() = Curve In BoundingBox {0.9, -0.1, -0.1, 1.1, 1.1, 0.1};\nPhysical Curve("right") = {r()};\n'
            'Physical Surface("block")'))
        text = self.block("floor", 4, (0, -1), (n, 1)) + self.block("wall", 1, (n, 0), (1, 1))
        text += "".join("&support body='%s', surface='bottom', fix='xy' /\n" % name for name in ("floor", "wall"))
        text += "&support body='wall', surface='top', fix='xy' /\n"
        for k in range(n):
            text += "&body name='b%d', mesh='one.geo', volume='block', material='m', at=%d,0 /\n" % (k, k)
            text += "&load body='b%d', force_density=0,-1e-3 /\n" % k
            text += "&contact name='on %d', surface_a='b%d:bottom', surface_b='floor:top' /\n" % (k, k)
            if k < n - 1:
                text += "&contact name='joint %d', surface_a='b%d:right', surface_b='b%d:left' /\n" % (k, k, k + 1)
        text += "&contact name='joint %d', surface_a='b%d:right', surface_b='wall:sides x' /\n" % (n - 1, n - 1)
        text += "&load body='b0', surface='left', pressure=1e-2 /\n"
        self.scene(text)
        file = self.solve()[1]
        self.assertEqual(file["dotyk/summary"].attrs["rigid_body_modes"], 3 * n)
        self.assertLessEqual(file["dotyk/summary"].attrs["iterations"], 20)
        for k in range(n):
            self.assertAlmostEqual(file["dotyk/contact/joint %d" % k].attrs["force"][0], -1e-2, delta=1e-11)
            self.assertAlmostEqual(file["dotyk/contact/on %d" % k].attrs["force"][1], 1e-3, delta=1e-11)

    def test_balanced_on_an_edge(self):
        """The weight exactly above the edge: the tilt is not determined, and there is none."""
        self.write("ridge.geo", RIDGE)
        text = ("&body name='ridge', mesh='ridge.geo', volume='ridge', material='m' /\n" +
                self.block("beam", 4, (-2, 1), (4, 1)))
        text += "&support body='ridge', surface='bottom', fix='xy' /\n&load body='beam', force_density=0,-1 /\n"
        text += "&contact name='edge', surface_a='ridge:sides', surface_b='beam:bottom' /\n"
        self.scene(text)
        log, file = self.solve()
        self.assertIn("not determined by contact: sliding along (1, 0) and spin about (0, 1.5) of 'beam'; least motion taken\n",
                      log)
        self.assertAlmostEqual(file["dotyk/contact/edge"].attrs["force"][1], -4, delta=1e-10)
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        ends = [np.argmin(np.abs(x[:, :2] - [side, 1.5]).sum(axis=1)) for side in (-2, 2)]
        self.assertAlmostEqual(u[ends[0], 1], u[ends[1], 1], delta=1e-9)
        # The weight beside the edge, by less than one percent of the beam: weak springs carry it. By more the beam tips
        # until it lies on a side of the ridge, by no small rotation.
        self.scene(text.replace("ridge.geo'", "ridge.geo', at=1e-4,0"))
        self.assertRegex(self.solve()[0], r"of 'beam'; least motion taken; [\d.]+ % of the loads rest on it\n")
        # What they may carry is a key: less than there is here, and more than there is farther out.
        self.scene(text.replace("ridge.geo'", "ridge.geo', at=0.1,0"), "theta=0, max_unbalanced=0.2")
        self.assertRegex(self.solve()[0], r"'beam'; least motion taken; [\d.]+ % of the loads rest on it\n")
        (self.folder / "case.vtkhdf").unlink()
        for place, solver in ("1e-4,0", "theta=0, max_unbalanced=1e-6"), ("0.1,0", "theta=0"):
            self.scene(text.replace("ridge.geo'", "ridge.geo', at=" + place), solver)
            self.refuse("body 'beam'", "no equilibrium", "rotation about", "max_unbalanced")
        for wrong, told in (("theta=0, max_unbalanced=1.5", "from 0 to 1, got 1.5"), ("max_unbalanced=-1", "max_unbalanced"),
                            ("scheme='neumann', max_unbalanced=0.1", "max_unbalanced is about floating bodies")):
            self.scene(text, wrong)
            self.assertIn(told, self.dotyk("case.nml", code=2))

    def test_on_the_rim_of_its_support(self):
        """A beam whose weight stands exactly above the last point of its support, by 1e-6 beyond it, which weak springs carry,
        and farther out."""
        for centre in (0.5, 0.5 + 1e-6, 0.6):
            text = self.block("post", 2, (-0.5, 0), (1, 1)) + self.block("beam", 4, (centre - 2, 1), (4, 1))
            text += "&support body='post', surface='bottom', fix='xy' /\n&load body='beam', force_density=0,-1 /\n"
            text += "&contact name='joint', surface_a='post:top', surface_b='beam:bottom' /\n"
            self.scene(text)
            if centre > 0.51:
                self.refuse("body 'beam'", "rotation about")
                continue
            self.assertAlmostEqual(self.solve()[1]["dotyk/contact/joint"].attrs["force"][1] / -4, 1, delta=1e-9)

    def test_turned_against_nothing(self):
        """A disc in a frictionless socket: it carries the weight, and no torque."""
        self.write("disc.geo", DISC)
        self.write("socket.geo", SOCKET)
        text = "".join("&body name='%s', mesh='%s.geo', volume='%s', material='m' /\n" % (name, name, name)
                       for name in ("disc", "socket"))
        text += "&support body='socket', surface='bottom', fix='xy' /\n&load body='disc', force_density=0,-1 /\n"
        text += "&contact name='joint', surface_a='disc:rim', surface_b='socket:hole' /\n"
        self.scene(text)
        # Facets are inside the circle.
        for log, file in self.by_both():
            self.assertAlmostEqual(file["dotyk/contact/joint"].attrs["force"][1] / np.pi, 1, delta=1e-3)
            self.assertRegex(log, "not determined by contact: .* of 'disc'")
        (self.folder / "case.vtkhdf").unlink()
        self.scene(text + "&load body='disc', surface='rim', traction_formula='-0.1*(y-1)','0.1*x' /\n")
        self.refuse("body 'disc'", "rotation about", "resultant 0.628",
                    "a rigid body mode that neither supports nor contact resist")

    def test_disc_in_a_ring(self):
        """A disc that rests in a ring of facets: they turn 5e-6 of its weight into a moment about its axis, which nothing
        resists. Its weight is carried, and the log tells what is not."""
        self.write("disc.geo", """SetFactory("OpenCASCADE");
Cylinder(1) = {0, -0.649, 0, 0, 0, 0.2, 0.2};
Cylinder(2) = {0, 0, 0, 0, 0, 0.2, 1}; Cylinder(3) = {0, 0, 0, 0, 0, 0.2, 0.85};
BooleanDifference(4) = { Volume{2}; Delete; }{ Volume{3}; Delete; };
Physical Volume("disc") = {1}; Physical Volume("ring") = {4};
all[] = Surface{:}; flat[] = Surface In BoundingBox{-2, -2, -1e-3, 2, 2, 1e-3};
flat[] += Surface In BoundingBox{-2, -2, 0.199, 2, 2, 0.201};
Physical Surface("flat") = {flat[]};
b[] = Boundary{ Volume{4}; };
For i In {0:#b[]-1}
  q[] = BoundingBox Surface{Abs(b[i])};
  If (q[3] > 0.99 && q[5] - q[2] > 0.1) Physical Surface("out") = {Abs(b[i])}; EndIf
EndFor
Mesh.MeshSizeMax = 0.06; Mesh.MeshSizeMin = 0.06; Mesh.ElementOrder = 1; Mesh.RandomFactor = 1e-4;
""")
        self.write("case.nml", "&scene mesh='disc.geo' /\n&material name='m', young=1e9, poisson=0.3, density=1000 /\n"
                   "&body name='disc', volume='disc', material='m' /\n&body name='ring', volume='ring', material='m' /\n"
                   "&support body='ring', surface='out', fix='xyz' /\n&support body='*', surface='flat', fix='z' /\n"
                   "&load body='disc', acceleration=0,-9.81,0 /\n&contact auto=.true. /\n&solver theta=0 /\n"
                   "&output fields='displacement contact', error_parts='' /\n")
        for log, file in self.by_both():
            self.assertRegex(log, "not determined by contact: .*(spin|rocking) about the axis .* of 'disc'; least motion taken; 0.* % of the loads")
            force = file["dotyk/contact/disc - ring"].attrs["force"]
            # The polygon of facets of 0.06 on a radius of 0.2 has 1.5 % less volume than the circle.
            self.assertAlmostEqual(force[1] / (1000 * 9.81 * 0.2 * np.pi * 0.04), 1, delta=0.02)
            self.assertLess(abs(force[0]) / force[1], 1e-3)

    def test_pushed_along_the_floor(self):
        """Nothing stops a disc sideways. A torque rolls it until its next points carry it, and the log says how far."""
        self.write("disc.geo", DISC)
        text = ("&body name='disc', mesh='disc.geo', volume='disc', material='m' /\n" +
                self.block("floor", 6, (-3, -1), (6, 1)))
        text += "&support body='floor', surface='bottom', fix='xy' /\n"
        text += "&contact name='joint', surface_a='disc:rim', surface_b='floor:top' /\n"
        self.scene(text + "&load body='disc', force_density=0.1,-1 /\n")
        self.refuse("body 'disc'", "translation along (1, 0)",
                    "a rigid body mode that neither supports nor contact resist")
        self.scene(text + "&load body='disc', force_density=0,-1 /\n"
                   "&load body='disc', surface='rim', traction_formula='-0.1*(y-1)','0.1*x' /\n")
        log, file = self.solve()
        self.assertIn("large rotation   'disc': rotation moves nodes by up to", log)
        # The resultant moves to where it balances the torque.
        joint = file["dotyk/contact/joint"]
        force = joint["weight"][:] * joint["pressure"][:]
        self.assertAlmostEqual(-np.sum(force * joint["position"][:, 0]), 0.2 * np.pi, delta=5e-3)
        self.assertNotIn("large rotation", self.still(text))

    def test_rotation_beyond_small_displacements(self):
        """A beam whose other end meets the floor five of its lengths below: linear kinematics find an equilibrium, which
        is no solution, and the exit code says so."""
        text = (self.block("step", 2, (-0.5, -1), (0.75, 1)) + self.block("floor", 2, (0.5, -6), (1, 1)) +
                self.block("beam", 8, (0, 0), (1, 0.1)))
        text += "".join("&support body='%s', surface='bottom', fix='xy' /\n" % name for name in ("step", "floor"))
        text += "".join("&contact name='on %s', surface_a='%s:top', surface_b='beam:bottom', search_radius=10 /\n" %
                        (name, name) for name in ("step", "floor"))
        load = "&load body='beam', force_density=0,-1 /\n"
        self.scene(text.replace("&support body='floor', surface='bottom', fix='xy' /", "") + load)
        self.refuse("body 'beam'", "no equilibrium", "without loads of their own, 'floor' (line ", ") would move with it")
        self.scene(text + load)
        log = self.dotyk("case.nml", code=1)
        self.assertIn("not valid: rotation of a body beyond small displacements", log)
        summary = self.results("case.vtkhdf")["dotyk/summary"].attrs
        self.assertEqual((summary["converged"], summary["status"]), (0, b"large_rotation"))

    def test_slave_elements_larger_than_the_contact(self):
        """A disc of few facets on a floor: bounds and estimates in the energy norm say little, and the contact error is
        large. It touches at a vertex, whose gap is exact."""
        self.write("disc.geo", DISC.replace("ElementOrder = 2", "ElementOrder = 1"))
        text = self.block("floor", 8, (-3, -1), (6, 1)) + "&support body='floor', surface='bottom', fix='xy' /\n"
        disc = "&body name='disc', mesh='disc.geo', volume='disc', material='m' /\n"
        load = "&load body='disc', force_density=0,-1 /\n"
        touch = "&contact name='joint', surface_a='disc:%s', surface_b='floor:top' /\n"
        self.scene(text + disc + load + touch % "rim", errors="discretization")
        log = self.dotyk("case.nml")
        error = self.results("case.vtkhdf")["dotyk/summary"].attrs["error_contact"]
        self.assertGreater(error, 0.3)
        self.assertNotIn("uncertain ", log)
        self.scene(text + self.block("disc", 4, (-1, 0), (2, 1)) + load + touch % "bottom", errors="discretization")
        self.dotyk("case.nml")
        self.assertLess(self.results("case.vtkhdf")["dotyk/summary"].attrs["error_contact"], 0.3)

    def still(self, text):
        """The log of the disc under its weight alone."""
        self.scene(text + "&load body='disc', force_density=0,-1 /\n")
        return self.solve()[0]

    def test_pressing_on_each_other_alone(self):
        """Two free blocks under opposite loads: the joint's pressure is exact, where they are is not determined, and
        they stay."""
        text = self.block("a", 3, (0, 0), (1, 1)) + self.block("b", 2, (0, 1), (1, 1))
        text += ("&contact name='joint', surface_a='b:bottom', surface_b='a:top' /\n"
                 "&load body='a', surface='bottom', pressure=1 /\n")
        self.scene(text + "&load body='b', surface='top', pressure=1 /\n")
        log, file = self.solve()
        self.assertIn("not determined by contact: any motion of 'a', 'b'; least motion taken\n", log)
        np.testing.assert_allclose(file["dotyk/contact/joint/pressure"][:], 1, rtol=1e-9)
        u = file["VTKHDF/PointData/displacement"][:]
        self.assertLess(np.abs(u).max(), 2 / YOUNG)
        self.assertAlmostEqual(u[:, 1].max(), -u[:, 1].min(), delta=1e-3 / YOUNG)
        (self.folder / "case.vtkhdf").unlink()
        self.scene(text + "&load body='b', surface='top', pressure=1.1 /\n")
        self.refuse("translation along (0, 1)", "a rigid body mode that neither supports nor contact resist")

    def test_several_loose_bodies(self):
        """A message that names all of them, each with what moves it."""
        text = (self.block("held", 1, (0, 0), (1, 1)) + self.block("down", 1, (3, 0), (1, 1)) +
                self.block("side", 1, (6, 0), (1, 1)))
        text += "&support body='held', surface='bottom', fix='xy' /\n&load body='held', force_density=0,-5 /\n"
        text += "&load body='down', force_density=0,-1 /\n&load body='side', force_density=2,0 /\n"
        self.scene(text)
        self.refuse("body 'side': no equilibrium: the loads do work on a rigid body mode that neither supports nor "
                    "contact resist: "
                    "translation along (1, 0), resultant 2;",
                    "likewise body 'down' (line 4): translation along (0, 1), resultant 1;")
        text = ""
        for k in range(7):
            text += "&body name='b%d', mesh='box.geo', volume='block', material='m', at=%d,0 /\n" % (k, 3 * k)
            text += "&load body='b%d', force_density=0,-1 /\n" % k
        self.write("box.geo", block_geo("quad8", 1, (0, 0), (1, 1)))
        self.scene(text)
        self.refuse("likewise body 'b3'", "; likewise 3 more; add a &support")

    def test_held_by_one_node(self):
        """A part that hangs on one node can turn inside of its body: that is no free motion of a body, and refused."""
        self.write("hinge.geo", HINGE)
        text = ("&body name='hinge', mesh='hinge.geo', volume='hinge', material='m' /\n" +
                self.block("post", 2, (1.75, 0), (0.5, 1)))
        text += "".join("&support body='%s', surface='bottom', fix='xy' /\n" % name for name in ("hinge", "post"))
        text += "&contact name='stop', surface_a='hinge:low', surface_b='post:top' /\n"
        self.scene(text + "&load body='hinge', force_density=0,-1 /\n")
        self.refuse("body 'hinge'", "connected by single nodes or edges only", "add a &support")

    def test_held_by_one_facet(self):
        """A support on a facet of 1e-5 bears all forces and no torque: contact does, and the other way round it hardly
        turns."""
        self.write("pinned.geo", PINNED)
        text = ("&body name='pinned', mesh='pinned.geo', volume='pinned', material='m' /\n" +
                self.block("post", 2, (0.75, 0), (0.5, 1)))
        text += ("&support body='pinned', surface='pin', fix='xy' /\n"
                 "&support body='post', surface='bottom', fix='xy' /\n")
        text += "&contact name='stop', surface_a='pinned:low', surface_b='post:top' /\n"
        self.scene(text + "&load body='pinned', force_density=0,-1 /\n")
        joint = self.solve()[1]["dotyk/contact/stop"]
        force = joint["weight"][:] * joint["pressure"][:]
        self.assertAlmostEqual(np.sum(force * joint["position"][:, 0]), 0.5, delta=1e-4)

    def hung_blocks(self, n, load):
        """Forces from block to block of a row against a wall; each hangs on a layer of 1e-8 of its stiffness."""
        self.write("hung.geo", block_geo("quad8", 4, (0, 0), (1, 2)) + "".join(
            'c() = Curve In BoundingBox {%g, -0.1, -0.1, %g, 2.1, 0.1};\nPhysical Curve("%s") = {c()};\n'
            % (x - 0.1, x + 0.1, name)
            for x, name in ((0, "left"), (1, "right"))))
        text = "&material name='s', young=%r, poisson=0, young_formula='(y > 1.5) ? 1e-8 : 1' /\n" % YOUNG
        text += self.block("wall", 2, (n, 0), (1, 2))
        text += "".join("&support body='wall', surface='%s', fix='xy' /\n" % side for side in ("top", "bottom"))
        for k in range(n):
            text += "&body name='h%d', mesh='hung.geo', volume='block', material='s', at=%d,0 /\n" % (k, k)
            text += "&support body='h%d', surface='top', fix='xy' /\n" % k
            text += "&contact name='joint %d', surface_a='h%d:right', surface_b='%s' /\n" % (
                k, k, "h%d:left" % (k + 1) if k < n - 1 else "wall:sides x")
        self.scene(text + load)
        file = self.solve()[1]
        self.assertEqual(file["dotyk/summary"].attrs["near_null_modes"], 3 * n)
        self.assertLessEqual(file["dotyk/summary"].attrs["iterations"], 4)
        return np.array([file["dotyk/contact/joint %d" % k].attrs["force"][0] for k in range(n)])

    def test_many_nearly_free_bodies(self):
        """Fifty blocks on supports of 1e-8 of their stiffness: a push arrives at the wall, and weights add up."""
        # Layers take half of what acts on them: a push on 2 arrives as one on 1.75, and so does the weight of each
        # block. Loads are so small that the first block moves by a part of its size.
        for n, part in ((50, 1e-4), (120, 1e-3)):
            force = self.hung_blocks(n, "&load body='h0', surface='left', pressure=1e-6 /\n")
            np.testing.assert_allclose(force, -1.75e-6, rtol=part)
            self.assertIncreasing(force)
        n = 50
        force = self.hung_blocks(n, "".join("&load body='h%d', force_density=1e-7,0 /\n" % k for k in range(n)))
        np.testing.assert_allclose(force, -1.75e-7 * np.arange(1, n + 1), rtol=1e-3)

    def test_nothing_at_all(self):
        """A free body without contact and load stays where it is."""
        self.scene(self.block("alone", 1, (0, 0), (1, 1)))
        log, file = self.solve()
        self.assertIn("not determined by contact: any motion of 'alone'; least motion taken\n", log)
        np.testing.assert_array_equal(file["VTKHDF/PointData/displacement"][:], 0)


if __name__ == "__main__":
    dotyk_case.main()
