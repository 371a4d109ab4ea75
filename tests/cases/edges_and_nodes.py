#!/usr/bin/python3
"""Loads, supports and springs on edges and nodes, against exact answers and beam theory."""
import itertools
import re

import numpy as np

import dotyk_case
from blocks import block_geo, dimension, mesh
from decks import CUBE

YOUNG, POISSON = 200.0, 0.3
SIZE = (1.0, 1.5, 2.0)
WARNING = "have no limit as the mesh is refined"
# A beam along x on planes y = 0 and z = 0, with its edges of length `width` along y.
BEAM = """
Point(1) = {0, 0, 0};
line() = Extrude {0, %(width)r, 0} { Point{1}; Layers{2}; };
face() = Extrude {0, 0, %(height)r} { Curve{line(1)}; Layers{2}; Recombine; };
beam() = Extrude {%(length)r, 0, 0} { Surface{face(1)}; Layers{20}; Recombine; };
Mesh.ElementOrder = 2;  Mesh.SecondOrderIncomplete = 1;
Physical Volume("beam") = {beam(1)};
Physical Surface("root") = {face(1)};
Physical Surface("roof") = Surface In BoundingBox {-1e-3, -1e-3, %(height)r - 1e-3, 1e3, 1e3, 1e3};
Physical Curve("bottom 1") = {line(1)};
Physical Curve("bottom 2") = Curve In BoundingBox {%(length)r - 1e-3, -1e-3, -1e-3, 1e3, 1e3, 1e-3};
Physical Curve("tip") = Curve In BoundingBox {%(length)r - 1e-3, -1e-3, %(height)r - 1e-3, 1e3, 1e3, 1e3};
Physical Point("corner") = {1};
Physical Point("corners") = Point In BoundingBox {%(length)r - 1e-3, -1e-3, %(height)r - 1e-3, 1e3, 1e3, 1e3};
"""


class EdgesAndNodes(dotyk_case.Case):
    def run_scene(self, lines, analysis="3d", poisson=POISSON, code=0, more=()):
        """Run a scene; what it prints, positions, displacements, and the file."""
        self.write("case.nml", "\n".join(["&scene analysis='%s' /" % analysis, "&material name='m', young=%r, poisson=%r, density=2 /" % (
            YOUNG, poisson), *lines]) + "\n")
        printed = self.dotyk("case.nml", *more, code=code)
        if code or more:
            return printed
        file = self.results("case.vtkhdf")
        return printed, file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:], file

    def block(self, kind, n=2, name="block", size=SIZE, origin=(0.0, 0.0, 0.0), more=""):
        d = dimension(kind)
        self.write(name + ".geo", block_geo(kind, n, origin[:d], (*size[:d - 1], size[2])))
        return "&body name='%s', mesh='%s.geo', volume='block', material='m' %s /" % (name, name, more)

    def beam(self, length=10.0, width=1.0, height=0.5):
        self.write("beam.geo", BEAM % {"length": length, "width": width, "height": height})
        return "&body name='beam', mesh='beam.geo', volume='beam', material='m' /"

    @staticmethod
    def three_two_one(name="block", size=SIZE):
        return ["&support body='%s', nodes_at=0,0,0, fix='xyz' /" % name,
                "&support body='%s', nodes_at=%r,0,0, fix='yz' /" % (name, size[0]),
                "&support body='%s', nodes_at=0,%r,0, fix='z' /" % (name, size[1])]

    def consistent(self, kind, n=2):
        """Consistent nodal forces of a unit traction on a face at right angles to z, in two dimensions y: {position: force}."""
        weights = {"hex8": [0.5, 1, 0.5], "quad8": [1/3, 4/3, 2/3, 4/3, 1/3], "hex27": [1/3, 4/3, 2/3, 4/3, 1/3]}[kind]
        d, m = dimension(kind), len(weights)
        cells = itertools.product(range(m), repeat=d - 1)
        return {tuple(SIZE[k]*i[k]/(m - 1) for k in range(d - 1)): np.prod([SIZE[k]/n/(1 if m == 3 else 2)*weights[i[k]] for k in range(d - 1)])
                for i in cells}

    def test_patch_of_nodal_forces(self):
        """A block that three nodes hold, pulled by the nodal forces of uniform tension on both ends: the exact linear field, without
        reactions."""
        for kind in ("hex8", "hex27", "quad8"):
            with self.subTest(kind):
                d, stress = dimension(kind), 3.0
                loads = []
                forces = self.consistent(kind)
                for value in sorted(set(np.round(list(forces.values()), 12))):
                    for z, sign in ((0.0, -1), (SIZE[2], 1)):
                        at = [(*x, z) for x, f in forces.items() if abs(f - value) < 1e-9]
                        loads.append("&load body='block', nodes_at=%s, traction=%s /" % (
                            ", ".join("%.9f" % c for x in at for c in x), ", ".join(["0"]*(d - 1) + ["%.15g" % (sign*stress*value)])))
                supports = self.three_two_one() if d == 3 else ["&support body='block', nodes_at=0,0, fix='xy' /",
                                                                "&support body='block', nodes_at=%r,0, fix='y' /" % SIZE[0]]
                printed, x, u, file = self.run_scene([self.block(kind), *supports, *loads], "3d" if d == 3 else "plane_stress")
                exact = stress/YOUNG*x*np.array([-POISSON]*(d - 1) + [1] + [0]*(3 - d))
                np.testing.assert_allclose(u, exact, atol=1e-10*np.abs(exact).max())
                np.testing.assert_allclose(file["dotyk/supports/force"][:], 0, atol=1e-9*stress)
                self.assertIn("'block': a load on an edge or nodes: stress and displacement there " + WARNING, printed)
                self.assertNotIn("a reaction on", printed)

    def test_three_nodes_stress_as_symmetry_does(self):
        """A block under pressures that vary, the same on both ends: its upper half has the stresses of a half model."""
        load = "&load body='block', surface='%s', pressure_formula='1 + x + y*y' /"
        size = (1.0, 1.5, 2.0)
        printed, x, _, file = self.run_scene([self.block("hex20", (2, 2, 4), size=size), *self.three_two_one(), load % "top", load % "bottom"])
        self.assertNotIn(WARNING, printed)
        whole = self.stresses(file)
        _, x, _, file = self.run_scene([self.block("hex20", 2, size=(1.0, 1.5, 1.0), origin=(0.0, 0.0, 1.0)), load % "top",
                                        "&support body='block', surface='bottom', fix='z' /", "&support body='block', nodes_at=0,0,1, fix='xy' /",
                                        "&support body='block', nodes_at=1,0,1, fix='y' /"])
        half = self.stresses(file)
        self.assertEqual(len(half), 8)
        for centre, stress in half.items():
            np.testing.assert_allclose(stress, whole[centre], atol=1e-8*np.abs(stress).max())

    @staticmethod
    def stresses(file):
        """Stresses of the elements by their centres."""
        own = file["VTKHDF"]
        x, ends = own["Points"][:], own["Offsets"][:]
        nodes = own["Connectivity"][:]
        centres = [tuple(np.round(x[nodes[a:b]][:8].mean(axis=0), 6).tolist()) for a, b in zip(ends[:-1], ends[1:])]
        return dict(zip(centres, own["CellData/stress"][:]))

    def test_line_load_on_a_cantilever(self):
        """A force per length on the edge of a beam, its total, and half of it on each of two nodes bend it as beam theory says."""
        length, width, height, load = 10.0, 1.0, 0.5, -0.01
        inertia, force = width*height**3/12, load*width
        exact = force*length**3/(3*YOUNG*inertia) + force*length/(5/6*YOUNG/2*width*height)
        for given in ("edge='tip', traction=0,0,%r" % load, "edge='t?p', force=0,0,%r" % force, "nodes='corners', force=0,0,%r" % force,
                      "nodes='corners', traction=0,0,%r" % (force/2)):
            with self.subTest(given):
                printed, x, u, file = self.run_scene([self.beam(length, width, height), "&support body='beam', surface='root', fix='xyz' /",
                                                      "&load body='beam', %s /" % given], poisson=0.0)
                below = (x[:, 0] > length - 1e-6) & (x[:, 2] < 1e-6)
                self.assertAlmostEqual(u[below, 2].mean()/exact, 1, delta=0.005)
                np.testing.assert_allclose(file["dotyk/supports/force"][:], [(0, 0, -force)], atol=1e-10)
                np.testing.assert_allclose(file["dotyk/loads/moment"][:], [(width/2*force, -length*force, 0)], atol=1e-12)
                self.assertIn(WARNING, printed)

    def test_beam_on_edges(self):
        """Two edges bear a beam under uniform pressure: 5 q l^4/(384 E I) and the shear; each has half of the load."""
        length, width, height, load = 10.0, 1.0, 0.5, 0.001
        inertia = width*height**3/12
        exact = -5*load*width*length**4/(384*YOUNG*inertia) - load*width*length**2/(8*5/6*YOUNG/2*width*height)
        printed, x, u, file = self.run_scene([self.beam(length, width, height), "&support body='beam', edge='bottom 1', fix='xz' /",
                                              "&support body='beam', edge='bottom 2', fix='z' /", "&support body='beam', nodes='corner', fix='y' /",
                                              "&load body='beam', surface='roof', pressure=%r /" % load], poisson=0.0)
        middle = np.abs(x[:, 0] - length/2) < 1e-6
        self.assertAlmostEqual(u[middle, 2].mean()/exact, 1, delta=0.01)
        np.testing.assert_allclose(file["dotyk/supports/force"][:], [(0, 0, load*length/2)]*2 + [(0, 0, 0)], atol=1e-8)
        names = file["dotyk/supports"].attrs["names"]
        self.assertEqual(getattr(names, "decode", lambda: names)(), "beam:edge bottom 1\nbeam:edge bottom 2\nbeam:nodes corner")
        self.assertIn("'beam': a reaction on an edge or nodes: stress and displacement there " + WARNING, printed)
        self.assertNotIn("a load on an edge", printed)

    def test_springs_of_nodes_and_edges(self):
        """Springs at the corners of a block of one element, or along its edges, sink by force over stiffness; by factors and p-multigrid."""
        corners = ", ".join("%r,%r,0" % (x, y) for x in (0.0, SIZE[0]) for y in (0.0, SIZE[1]))
        held = ["&support body='block', nodes_at=0,0,0, fix='xy' /", "&support body='block', nodes_at=%r,0,0, fix='y' /" % SIZE[0]]
        for spring in ("stiffness=40", "modulus=10"):
            printed, x, u, file = self.run_scene([self.block("hex8", 1), *held, "&load body='block', surface='top', force=0,0,-2 /",
                                                  "&spring body='block', nodes_at=%s, fix='z', %s /" % (corners, spring)], poisson=0.0)
            np.testing.assert_allclose(u[x[:, 2] < 1e-9, 2], -2/40, rtol=1e-9)
            self.assertIn("40 in total along z", printed)

    def test_contact(self):
        """A block that only contact and two nodes hold is pressed on another one by a force on a node; so is a rigid one."""
        bodies = [self.block("hex8", name="lower"), self.block("hex8", name="upper", origin=(0.0, 0.0, SIZE[2]))]
        held = ["&support body='upper', nodes_at=0,0,4, fix='xy' /\n&support body='upper', nodes_at=1,0,4, fix='y' /",
                "&rigid_body body='upper', fix='xy rz' /"]
        for of_upper, slave, master in zip(held, ("upper:bottom", "lower:top"), ("lower:top", "upper:bottom")):
            printed, _, _, file = self.run_scene([*bodies, "&support body='lower', surface='bottom', fix='xyz' /", of_upper,
                                                  "&load body='upper', nodes_at=0.5,0.75,4, force=0,0,-3 /",
                                                  "&contact name='joint', surface_a='%s', surface_b='%s' /" % (slave, master)])
            np.testing.assert_allclose(np.abs(file["dotyk/contact/joint"].attrs["force"][2]), 3, rtol=1e-9)
            # A rigid body has no stress that could grow.
            self.assertEqual(WARNING in printed, "rigid" not in of_upper)

    def test_estimate(self):
        """The estimate does not count the elements at the force: they have no limit."""
        found = []
        for n in (2, 4):
            _, _, _, file = self.run_scene([self.block("hex20", n), "&support body='block', surface='bottom', fix='xyz' /",
                                            "&load body='block', nodes_at=0.5,0.75,2, force=0,0,-1 /"])
            found.append(file["dotyk/summary"].attrs["error_discretization"])
        self.assertBetween(0.01, min(found), 0.3)
        self.assertLess(max(found), 0.3)

    def test_axisymmetric(self):
        """The force of a node is that on its circumference; one node holds a ring along its axis."""
        printed, x, u, file = self.run_scene([self.block("quad8", origin=(0.5, 0.0)), "&support body='block', nodes_at=0.5,0, fix='y' /",
                                              "&load body='block', nodes_at=1.5,2, force=0,-5 /"], "axisymmetric")
        np.testing.assert_allclose(file["dotyk/supports/force"][:], [(0, 5, 0)], atol=1e-10)
        printed, x, u, file = self.run_scene([self.block("quad8"), "&support body='block', surface='bottom', fix='y' /",
                                              "&load body='block', nodes_at=0,2, force=0,-5 /"], "axisymmetric")
        np.testing.assert_allclose(file["dotyk/supports/force"][:], [(0, 5, 0)], atol=1e-10)

    def test_cases_and_copies(self):
        """Nodal forces by load case; positions are those of copies in place, and wildcards take the copies that have the node."""
        geo = self.block("hex8", name="block", more=", repeat=2, shift=3,0,0").replace("'block'", "'block *'", 1)
        printed, x, u, file = self.run_scene([geo, "&support body='block *', surface='bottom', fix='xyz' /", "&case name='one' /", "&case name='two' /",
                                              "&load body='block *', nodes_at=3,0,2, force=0,0,-1, case='one' /",
                                              "&load body='block 1', nodes_at=1,0,2, traction=0,0,-3, case='two' /"])
        self.assertIn("block 2:node (3, 0, 2)", printed)
        for case, expected in (("one", [(0, 0, 0), (0, 0, 1)]), ("two", [(0, 0, 3), (0, 0, 0)])):
            np.testing.assert_allclose(file["dotyk/cases/%s/supports/force" % case][:], expected, atol=1e-10)
        printed = self.run_scene([geo, "&support body='block 2', nodes_at=0,0,0, fix='xyz' /"], code=2)
        self.assertIn("body 'block 2': no node is at (0, 0, 0); the nearest one is node ", printed)
        self.assertIn("at (3, 0, 0), 3 away: give its position, or make a point of the geometry there", printed)
        printed = self.run_scene([geo, "&support body='block *', nodes_at=0,0,0.1, fix='xyz' /"], code=2)
        self.assertIn("case.nml:4: &support: none of the bodies has such an edge or nodes", printed)

    def test_formats_and_multigrid(self):
        """The points and curves of a mesh of format 2.2 are those of 4.1; p-multigrid gives the answer of factors."""
        lines = [self.beam(), "&support body='beam', nodes='corner', fix='xyz' /", "&support body='beam', edge='bottom 1', fix='z' /",
                 "&support body='beam', edge='bottom 2', fix='yz' /", "&load body='beam', edge='tip', traction=0,0,1e-3 /",
                 "&load body='beam', surface='roof', pressure=1e-3 /"]
        _, _, u, _ = self.run_scene(lines)
        mesh(self.folder / "beam.geo", 3)
        _, _, other, _ = self.run_scene([line.replace("beam.geo", "beam.msh") for line in lines])
        np.testing.assert_allclose(other, u, atol=1e-9*np.abs(u).max())
        _, _, other, _ = self.run_scene([*lines, "&solver response='multigrid' /"])
        np.testing.assert_allclose(other, u, atol=1e-5*np.abs(u).max())

    def test_check(self):
        printed = self.run_scene([self.beam(), "&support body='beam', nodes='corner', fix='xyz' /", "&load body='beam', edge='tip', force=0,0,1 /"],
                                 more=["--check"])
        self.assertIn("beam:edge tip        force (0, 0, 1)", printed)

    def test_mistakes(self):
        """Told with line and name, and what to do."""
        fix = "&support body='beam', surface='root', fix='xyz' /"
        for lines, message in (
                (["&load body='beam', edge='tap', force=0,0,1 /"], r"case.nml:5: body 'beam': mesh '.*beam.geo' has no physical curve 'tap' "
                 r"\(did you mean 'tip'\?\); its physical curves: 'bottom 1', 'bottom 2', 'tip'"),
                (["&load body='beam', nodes='tap', force=0,0,1 /"], "has no physical point 'tap'.*; its physical points: 'corner', 'corners'"),
                (["&load body='beam', nodes_at=1,2, force=0,0,1 /"], "case.nml:5: &load: nodes_at needs 3 values for each node, got 2"),
                (["&load body='beam', nodes_at=1,0.1,0, force=0,0,1 /"], r"case.nml:5: body 'beam': no node is at \(1, 0.1, 0\)"),
                (["&load body='beam', edge='tip', pressure=1 /"], "&load: pressure is along the normal and axes of a surface: edges and nodes"),
                (["&load body='beam', edge='tip', surface='roof', force=0,0,1 /"], "surface and edge are both given"),
                (["&load body='beam', nodes='corner', acceleration=0,0,1 /"], "nodes does not go together with acceleration"),
                (["&load body='beam', nodes='corner', moment=0,0,1 /"], "load on surface 'nodes corner': moment: what lies on a line takes no"),
                (["&support body='beam', edge='tip', fix='n' /"], "fix: edges and nodes have no normal: give directions of xyz"),
                (["&support body='beam', fix='x' /"], "'surface' is missing \\(or edge, nodes, nodes_at\\)")):
            with self.subTest(lines[0]):
                self.assertRegex(re.sub(r"\s+", " ", self.run_scene([self.beam(), fix, *lines], code=2)), message)
        printed = self.run_scene([self.block("quad8"), "&support body='block', edge='bottom', fix='xy' /"], "plane_strain", code=2)
        self.assertIn("edge: in two dimensions an edge of a body is a surface: give surface", printed)

    def test_sets_of_nodes_of_a_deck(self):
        """A cube of one element: its sets of a single node, of an edge and of a face with a node more are what they are."""
        sets = "*NSET, NSET=origin\n1\n*NSET, NSET=right\n2\n*NSET, NSET=back\n4\n*NSET, NSET=front\n5, 6\n*NSET, NSET=more\n5, 6, 7, 8, 1\n"
        self.write("cube.inp", CUBE + "*ELEMENT, TYPE=C3D8, ELSET=Eall\n1, 1,2,3,4,5,6,7,8\n" + sets)
        held = ["&body name='cube', mesh='cube.inp', volume='Eall', material='m' /", "&support body='cube', nodes='origin', fix='xyz' /",
                "&support body='cube', nodes='right', fix='yz' /", "&support body='cube', nodes='back', fix='z' /"]
        for load, total in (("edge='front', traction=0,0,1", 1), ("nodes='front', traction=0,0,1", 2), ("surface='more', traction=0,0,1", 1),
                            ("nodes='more', traction=0,0,1", 5)):
            _, _, _, file = self.run_scene([*held, "&load body='cube', %s /" % load])
            np.testing.assert_allclose(file["dotyk/loads/force"][:], [(0, 0, total)], atol=1e-12)
            np.testing.assert_allclose(file["dotyk/supports/force"][:].sum(axis=0), (0, 0, -total), atol=1e-10)


dotyk_case.main()
