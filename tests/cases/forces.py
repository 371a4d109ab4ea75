#!/usr/bin/python3
"""Forces of contact pairs, supports and loads, their moments and the equilibrium; contact as fields of the nodes."""
import csv
import io
import subprocess
import sys

import numpy as np

import dotyk_case
from blocks import SHORTENING, block_geo, column_exact, column_nml

MATERIAL = "&material name='steel', young=200, poisson=0.3 /"
SOLVER = "&solver theta=0, tolerance=1e-10 /"
# A disc in a fitting bore: curved surfaces, quadratic elements.
DISC = """Mesh.ElementOrder = 2;  Mesh.SecondOrderIncomplete = 1;  Mesh.MeshSizeMin = 0.3;  Mesh.MeshSizeMax = 0.3;
SetFactory("OpenCASCADE");
Disk(1) = {2, 3, 0, 1};  Physical Surface("block") = {1};  Physical Curve("side") = {Boundary{Surface{1};}};
"""
BORE = """Mesh.ElementOrder = 2;  Mesh.SecondOrderIncomplete = 1;  Mesh.MeshSizeMin = 0.35;  Mesh.MeshSizeMax = 0.35;
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 1, 0, 4, 4};  Disk(2) = {2, 3, 0, 1.02};
s() = BooleanDifference{Surface{1}; Delete;}{Surface{2}; Delete;};  Physical Surface("block") = {s()};  e = 1e-6;
Physical Curve("side") = {Curve In BoundingBox{0.9, 1.9, -e, 3.1, 4.1, e}};
Physical Curve("bottom") = {Curve In BoundingBox{-e, 1 - e, -e, 4 + e, 1 + e, e}};
"""


class Table:
    """Resultants of a group of the results file, by names."""

    def __init__(self, group):
        self.names = group.attrs["names"]
        self.names = self.names.decode() if isinstance(self.names, bytes) else str(self.names)
        self.names = self.names.split("\n") if self.names else []
        self.array = {name: array[()] for name, array in group.items()}

    def __call__(self, field, name):
        return self.array[field][self.names.index(name)]


class Forces(dotyk_case.Case):
    def body(self, name, geo, more=""):
        self.write(name + ".geo", geo)
        return "&body name='%s', mesh='%s.geo', volume='block', material='steel' %s /" % (name, name, more)

    def run_scene(self, lines, analysis="3d"):
        """Results of a scene, and what the program printed."""
        self.write("case.nml", "\n".join(["&scene analysis='%s' /" % analysis, MATERIAL, *lines]) + "\n")
        printed = self.dotyk("case.nml")
        file = self.results("case.vtkhdf")
        return file["dotyk"], printed

    def check_equilibrium(self, own, tolerance=1e-12):
        """Loads, contact forces and reactions of each body balance; contact forces and moments are opposite."""
        bodies = {name: array[()] for name, array in own["bodies"].items()}
        for kind in ("force", "moment"):
            self.assertLess(own["bodies"].attrs[kind + "_error"], tolerance)
            parts = np.array([bodies["%s_%s" % (what, kind)] for what in ("load", "contact", "reaction")])
            size = np.abs(parts).max() + 1e-300
            np.testing.assert_allclose(parts.sum(axis=0) / size, 0, atol=tolerance)
            np.testing.assert_allclose(parts[1].sum(axis=0) / size, 0, atol=tolerance)
        self.assertAlmostEqual(bodies["strain_energy"].sum() / own["summary"].attrs["strain_energy"], 1, delta=1e-8)

    def test_contact_forces_that_are_rounding(self):
        """Faces that lie on each other without a force are no contact: no row is active, and no node has a pressure, be
        the sides of a body loaded."""
        for name, n, z in (("low", 3, 0), ("up", 2, 1)):
            self.write(name + ".geo", block_geo("hex8", n, (0, 0, z)))
        self.write("rest.nml", "\n".join([
            "&scene /", "&material name='m', young=1e5, poisson=0 /",
            *("&body name='%s', mesh='%s.geo', volume='block', material='m' /" % (b, b) for b in ("low", "up")),
            "&support body='low', surface='bottom', fix='z' /", "&support body='up', surface='top', fix='xyz' /",
            "&load body='low', surface='sides x', pressure=-123 /", "&load body='low', surface='sides y', pressure=57 /",
            "&contact name='k', surface_a='up:bottom', surface_b='low:top', theta=0 /", ""]))
        self.dotyk("rest.nml")
        file = self.results("rest.vtkhdf")
        pair, nodes = file["dotyk/contact/k"], file["VTKHDF/PointData"]
        self.assertEqual(pair.attrs["active"], 0)
        self.assertUnknown(pair.attrs["centre_of_pressure"])
        self.assertEqual(max(np.abs(field[()]).max() for field in (
            pair["pressure"], pair["pressure_projected"], nodes["contact_pressure"], nodes["contact_traction"])), 0)
        self.assertEqual(set(nodes["contact_status"][()]), {0, 1})

    def test_column(self):
        """Uniform pressure: force, moment, centre, area; reactions of floor and walls; nodal fields."""
        for name, z in (("lower", 0.0), ("upper", 1.0)):
            self.write(name + ".geo", block_geo("hex20", (2, 3, 2) if z else (3, 2, 1), (2.0, 5.0, z), (1.0, 1.0, 1.0)))
        self.write("column.nml", column_nml(3, solver="theta=0, tolerance=1e-12"))
        printed = self.dotyk("column.nml")
        file = self.results("column.vtkhdf")
        own, pressure = file["dotyk"], column_exact(0.0)[0]
        self.check_equilibrium(own, 1e-11)
        joint = own["contact/joint"].attrs
        for name, exact in (("force", (0, 0, pressure)), ("moment", (5.5 * pressure, -2.5 * pressure, 0)),
                            ("centre_of_pressure", (2.5, 5.5, 1)), ("contact_area", 1), ("peak_pressure", pressure)):
            np.testing.assert_allclose(joint[name], exact, atol=1e-8 * np.max(np.abs(exact)), err_msg=name)
        self.assertEqual(joint["active"], 12)
        self.assertIn(joint["peak_position"][2], (1,))
        # Opposite walls balance each other; the floor has the whole force, whose moment is that of the contact.
        support = Table(own["supports"])
        self.assertEqual(support.names, [body + ":" + side for body in ("lower", "upper") for side in
                                         ("sides x", "sides y", "bottom" if body == "lower" else "top")])
        for name in support.names:
            sign = {"bottom": 1, "top": -1}.get(name[6:], 0)
            np.testing.assert_allclose(support("force", name), (0, 0, sign * pressure), atol=1e-8 * pressure)
            np.testing.assert_allclose(support("moment", name), np.cross((2.5, 5.5, 0), (0, 0, sign * pressure)),
                                       atol=1e-7 * pressure)
        self.assertIn("  lower:bottom         force (0, 0, ", printed)
        self.assertIn("  equilibrium  ", printed)
        # Fields: tractions on both sides, gaps and status on the slave side.
        points, data, n = file["VTKHDF/Points"][:], file["VTKHDF/PointData"], file["VTKHDF/NumberOfPoints"][0]
        at_joint, is_upper = np.abs(points[:, 2] - 1) < 1e-9, np.arange(len(points)) >= n
        exact = np.zeros(points.shape)
        exact[at_joint, 2] = np.where(is_upper[at_joint], pressure, -pressure)
        np.testing.assert_allclose(data["contact_traction"][:], exact, atol=1e-8 * pressure)
        slave = at_joint & is_upper
        self.assertEqual(data["contact_status"][:].tolist(), np.where(slave, 2, 0).tolist())
        np.testing.assert_allclose(data["contact_gap"][:][slave], 0, atol=1e-9 * SHORTENING)
        self.assertUnknown(data["contact_gap"][:][~slave])
        reaction = data["reaction_force"][:]
        for of_body, low, name in ((~is_upper, 0, "lower:bottom"), (is_upper, 2, "upper:top")):
            at = of_body & (np.abs(points[:, 2] - low) < 1e-9)
            np.testing.assert_allclose(reaction[at].sum(axis=0)[2], support("force", name)[2], rtol=1e-12)
            self.assertGreater(np.abs(reaction[at, 0]).max(), 0)
        inside = np.all((points > (2, 5, 0)) & (points < (3, 6, 2)), axis=1)
        np.testing.assert_array_equal(reaction[inside], 0)

    def test_reactions_are_opposite_to_loads(self):
        """A clamped block under traction, pressure and weight: force and moment to rounding, in two and three
        dimensions; a body that touches no other, and one of several kinds of loads."""
        for analysis, kind, loads in (
                ("3d", "hex20", ("traction=0.3,-0.2,0.7", "pressure_formula='x*y'")),
                ("plane_strain", "quad9", ("traction=0.3,-0.2", "pressure_formula='x*x'"))):
            with self.subTest(analysis):
                d = 3 if analysis == "3d" else 2
                lines = [self.body("block", block_geo(kind, 2, (1.0, 2.0, 3.0)[:d], (1.0, 1.5, 2.0)[:d])),
                         "&support body='block', surface='bottom', fix='%s' /" % "xyz"[:d],
                         "&load body='block', force_density=%s /" % ("0.1,0.2,0.3" if d == 3 else "0.1,0.2"),
                         *("&load body='block', surface='top', %s /" % load for load in loads), SOLVER]
                own, _ = self.run_scene(lines, analysis)
                self.check_equilibrium(own)
                support, load = Table(own["supports"]), Table(own["loads"])
                self.assertEqual(load.names, ["block:force_density", "block:top", "block:top"])
                for kind_of in ("force", "moment"):
                    total = load.array[kind_of].sum(axis=0)
                    np.testing.assert_allclose(support(kind_of, "block:bottom"), -total, atol=1e-12 * abs(total).max())
                volume = 3.0 if d == 3 else 1.5
                np.testing.assert_allclose(load("force", "block:force_density"), np.array((0.1, 0.2, 0.3 * (d == 3))) * volume,
                                           rtol=1e-12)

    def test_shared_nodes(self):
        """A floor and two walls that share edges: each has the force along its own direction. Two supports that
        prescribe the same share nodes: together they have all, and nothing counts twice."""
        block = self.body("block", block_geo("hex8", 2, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
        self.write("block.geo", (self.folder / "block.geo").read_text() + """e = 1e-6;
Physical Surface("wall x") = {Surface In BoundingBox{-e, -e, -e, e, 1 + e, 1 + e}};
Physical Surface("wall y") = {Surface In BoundingBox{-e, -e, -e, 1 + e, e, 1 + e}};
Physical Surface("end") = {Surface In BoundingBox{1 - e, -e, -e, 1 + e, 1 + e, 1 + e}};
""")
        walls = ["&support body='block', surface='wall %s', fix='%s' /" % (axis, axis) for axis in "xy"]
        own, _ = self.run_scene([block, *walls, "&support body='block', surface='bottom', fix='z' /",
                                 "&load body='block', surface='top', traction=0,0,-2 /",
                                 "&load body='block', surface='end', traction=-3,0,0 /", SOLVER])
        support = Table(own["supports"])
        for name, force in (("wall x", (3, 0, 0)), ("wall y", (0, 0, 0)), ("bottom", (0, 0, 2))):
            np.testing.assert_allclose(support("force", "block:" + name), force, atol=1e-12)
        np.testing.assert_allclose(support("moment", "block:bottom"), (1, -1, 0), atol=1e-12)
        # The wall has the same condition as the floor on their edge.
        own, _ = self.run_scene([block, "&support body='block', surface='bottom', fix='xyz' /",
                                 "&support body='block', surface='wall x', fix='xyz' /",
                                 "&load body='block', surface='top', traction=0.5,0,-2 /", SOLVER])
        self.check_equilibrium(own)
        support = Table(own["supports"])
        self.assertGreater(abs(support("force", "block:wall x")[2]), 0.1)
        np.testing.assert_allclose(support.array["force"].sum(axis=0), (-0.5, 0, 2), atol=1e-12)
        # Several supports of one surface have one reaction.
        own, _ = self.run_scene([block, *("&support body='block', surface='bottom', fix='%s' /" % fix for fix in ("x", "yz")),
                                 "&load body='block', surface='top', traction=0.5,0,-2 /", SOLVER])
        self.check_equilibrium(own)
        support = Table(own["supports"])
        self.assertEqual(support.names, ["block:bottom"])
        np.testing.assert_allclose(support("force", "block:bottom"), (-0.5, 0, 2), atol=1e-12)

    def test_eccentric_press(self):
        """The centre of pressure of a block that nothing but contact and smooth walls hold lies under its load."""
        top = "&load body='upper', surface='top', pressure_formula='1+0.8*(x-3)+0.3*(y-5)' /"
        lines = [self.body("lower", block_geo("hex8", (5, 4, 2), (2.0, 4.0, 0.0), (2.0, 2.0, 1.0))),
                 self.body("upper", block_geo("hex8", (3, 3, 2), (2.5, 4.5, 1.0), (1.0, 1.0, 0.5))),
                 "&support body='lower', surface='bottom', fix='xyz' /", top,
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", SOLVER]
        own, printed = self.run_scene(lines)
        # The resultant of 1 + 0.8 x + 0.3 y on the unit square about its centre: moments 0.8/12 and 0.3/12.
        joint = own["contact/joint"].attrs
        np.testing.assert_allclose(joint["force"], (0, 0, 1), atol=1e-9)
        np.testing.assert_allclose(joint["centre_of_pressure"], (3 + 0.8 / 12, 5 + 0.3 / 12, 1), atol=1e-8)
        np.testing.assert_allclose(joint["moment"], np.cross((3 + 0.8 / 12, 5 + 0.3 / 12, 1), (0, 0, 1)), atol=1e-8)
        self.check_equilibrium(own, 1e-8)
        self.assertIn("centre of pressure (3.0667, 5.025, 1)", printed)
        weight, gap = own["contact/joint/weight"][:], own["contact/joint/gap"][:]
        active = own["contact/joint/pressure"][:] > 0
        self.assertAlmostEqual(joint["contact_area"], weight[active].sum(), delta=1e-12)
        self.assertEqual(joint["least_gap"], gap.min())

    def test_curved_surfaces(self):
        """A disc in a bore, pushed obliquely: contact moments on the two bodies are opposite, and the line of action
        goes through the axis of the disc, wherever the forces act."""
        force = (0.3, -0.4)
        lines = [self.body("disc", DISC), self.body("plate", BORE), "&support body='plate', surface='bottom', fix='xy' /",
                 "&load body='disc', force_density=%r,%r /" % force,
                 "&contact name='bore', surface_a='disc:side', surface_b='plate:side' /", SOLVER]
        own, _ = self.run_scene(lines, "plane_strain")
        joint = own["contact/bore"].attrs
        area = np.linalg.norm(joint["force"]) / 0.5
        self.assertAlmostEqual(area, np.pi, delta=0.02)
        np.testing.assert_allclose(joint["force"], np.array((-0.3, 0.4, 0)) * area, atol=1e-6)
        bodies = own["bodies"]
        np.testing.assert_allclose(bodies["contact_moment"][:].sum(axis=0), 0, atol=1e-12)
        np.testing.assert_allclose(bodies["contact_moment"][0], joint["moment"], atol=1e-12)
        along = np.cross(joint["centre_of_pressure"] - (2, 3, 0), joint["force"])
        np.testing.assert_allclose(along, 0, atol=1e-3)
        np.testing.assert_allclose(np.cross(joint["centre_of_pressure"], joint["force"]), joint["moment"], atol=1e-10)
        # The slave surface moves down to the right, where the disc touches.
        self.assertGreater(joint["peak_position"][0], 2)
        self.assertLess(joint["peak_position"][1], 3)
        # A polygon is not quite round: nothing but friction could bear what the force leaves about its axis.
        self.assertLess(own["bodies"].attrs["moment_error"], 1e-4)

    def test_peak_covered(self):
        """The peak is that of vertices that the master covers, not of one that stands out beyond its edge by 0.7; where it
        covers a sliver of all, the log says so."""
        for x, load, at, covered in ((0, "force=0,-1, moment=0.35", 0, 1), (0, "force=0,-1", 1, 0.755),
                                     (1.15, "force=0,-1", 1, (0.85**2 - 0.7**2) / 2)):
            lines = [self.body("lower", block_geo("quad4", (4, 2), (x, -1.0), (1.3 - x, 1.0))),
                     self.body("upper", block_geo("quad4", (2, 2), (0.0, 0.0), (2.0, 1.0))),
                     "&support body='lower', surface='bottom', fix='xy' /",
                     "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top', theta=0 /"]
            own, printed = self.run_scene([*lines, "&support body='upper', surface='sides x', fix='x' /",
                                           "&load body='upper', surface='top', %s, point=0.65,0 /" % load], "plane_strain")
            joint = own["contact/joint"].attrs
            self.assertAlmostEqual(joint["peak_position"][0], at, delta=1e-12)
            self.assertAlmostEqual(joint["peak_covered"], covered, delta=1e-9)
            if at == 1 and x == 0:  # of the vertex at 2 it covers 9 %
                self.assertGreater(own["contact/joint/pressure_projected"][:].max(), 1.2 * joint["peak_pressure"])
            self.assertEqual("where the master covers 12 % of the vertex" in printed, x > 0)

    def test_moments_far_from_the_origin(self):
        """What is left of the moments does not look smaller where the bodies are far from the origin."""
        found = []
        for place in ("", ", at=1e3,2e3"):
            lines = [self.body(name, geo)[:-2] + place + " /" for name, geo in (("disc", DISC), ("plate", BORE))]
            lines += ["&support body='plate', surface='bottom', fix='xy' /", "&load body='disc', force_density=0.3,-0.4 /",
                      "&contact name='bore', surface_a='disc:side', surface_b='plate:side' /", SOLVER]
            own, _ = self.run_scene(lines, "plane_strain")
            found.append(own["bodies"].attrs["moment_error"])
        self.assertGreater(found[0], 1e-9)
        self.assertBetween(0.9, found[1] / found[0], 1.1)

    def test_axisymmetric(self):
        """Forces are those on the full circumference; radial ones are no resultants."""
        lines = [self.body("lower", block_geo("quad8", (4, 2), (0.0, 0.0), (1.5, 1.0))),
                 self.body("upper", block_geo("quad8", (3, 2), (0.0, 1.0), (1.0, 1.0))),
                 "&support body='lower', surface='bottom', fix='xy' /",
                 "&load body='upper', surface='top', pressure=2 /",
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", SOLVER]
        own, printed = self.run_scene(lines, "axisymmetric")
        total = 2 * np.pi
        joint, support = own["contact/joint"].attrs, Table(own["supports"])
        np.testing.assert_allclose(joint["force"], (0, total, 0), rtol=1e-9)
        np.testing.assert_allclose(joint["centre_of_pressure"], (0, 1, 0), atol=1e-12)
        self.assertAlmostEqual(joint["contact_area"], np.pi, delta=1e-9)
        np.testing.assert_allclose(support("force", "lower:bottom"), (0, total, 0), rtol=1e-9)
        np.testing.assert_array_equal(support("moment", "lower:bottom"), 0)
        self.assertGreater(abs(support.array["radial_force"][0]), 0.1)
        self.check_equilibrium(own, 1e-9)
        self.assertIn("lower:bottom         force (0, 6.2832, 0), radial ", printed)

    def test_without_displacements(self):
        """Contact forces are there, reactions are not."""
        for name, z in (("lower", 0.0), ("upper", 1.0)):
            self.write(name + ".geo", block_geo("hex8", 2, (0.0, 0.0, z), (1.0, 1.0, 1.0)))
        self.write("column.nml", column_nml(3, solver="theta=1e-5, tolerance=1e-8", output="fields='', error_parts=''"))
        printed = self.dotyk("column.nml")
        own = self.results("column.vtkhdf")["dotyk"]
        self.assertGreater(own["contact/joint"].attrs["contact_area"], 0.99)
        self.assertEqual(set(own["bodies"]) | set(own["supports"]), set())
        self.assertNotIn("reaction", printed)

    def column_of(self, analysis, load, size=(1.0, 1.5, 2.0), origin=(1.0, 2.0, 3.0), kind=None, poisson=0.0):
        """A block, clamped at the bottom and loaded at the top; without Poisson's ratio the clamp hinders nothing."""
        d = 3 if analysis == "3d" else 2
        body = self.body("block", block_geo(kind or ("hex20" if d == 3 else "quad8"), 2, origin[:d], (*size[:d - 1], size[2])))
        self.write("case.nml", "\n".join([
            "&scene analysis='%s' /" % analysis, "&material name='steel', young=200, poisson=%r /" % poisson, body,
            "&support body='block', surface='bottom', fix='%s' /" % "xyz"[:d], "&load body='block', surface='top', %s /" % load,
            SOLVER]) + "\n")
        return "case.nml"

    def total(self, analysis, load, **options):
        """Results of this block."""
        self.dotyk(self.column_of(analysis, load, **options))
        return self.results("case.vtkhdf")

    def test_total_force_and_moment(self):
        """Stresses of beam theory, exact for quadratic elements: tension and bending about both axes."""
        file = self.total("3d", "force=0,0,6, moment=0.7,-0.4,0")
        points, cells = file["VTKHDF/Points"][:], file["VTKHDF/Connectivity"][:].reshape(8, -1)
        middle = points[cells[:, :8]].mean(axis=1) - (1.5, 2.75, 4)
        # The moments of inertia of 1 x 1.5: about x, and about y.
        exact = 6 / 1.5 + 0.7 / (1.5**3 / 12) * middle[:, 1] + 0.4 / (1.5 / 12) * middle[:, 0]
        stress = file["VTKHDF/CellData/stress"][:]
        np.testing.assert_allclose(stress[:, 2], exact, rtol=1e-9)
        np.testing.assert_allclose(np.delete(stress, 2, axis=1), 0, atol=1e-9)
        file = self.total("plane_strain", "force=0,6, moment=0.4")
        points, cells = file["VTKHDF/Points"][:], file["VTKHDF/Connectivity"][:].reshape(4, -1)
        middle = points[cells[:, :4]].mean(axis=1) - (1.5, 3, 0)
        np.testing.assert_allclose(file["VTKHDF/CellData/stress"][:, 1], 6 + 0.4 * 12 * middle[:, 0], rtol=1e-9)

    def test_total_load_on_any_surface(self):
        """Force and moment, about the centroid or a point, are the given ones: on both sides of a block, and on a curved
        surface; the reactions are opposite."""
        force, moment, point = np.array((0.3, -0.5, 0.7)), np.array((0.2, 0.4, -0.6)), np.array((3.0, 1.0, -2.0))
        given = "force=0.3,-0.5,0.7, moment=0.2,0.4,-0.6"
        rod = """SetFactory("OpenCASCADE");  Mesh.ElementOrder = 2;  Mesh.MeshSizeMax = 0.5;  Mesh.MeshSizeMin = 0.5;
Cylinder(1) = {2, 1, 0, 0, 0, 2, 0.7};  Physical Volume("block") = {1};  e = 1e-3;
Physical Surface("bottom") = {Surface In BoundingBox{-9, -9, -e, 9, 9, e}};  Physical Surface("sides x") = {1};
"""
        for kind, geo, centre in (("tet10", block_geo("tet10", 2, (1, 2, 3), (1.0, 1.5, 2.0)), (1.5, 2.75, 4)),
                                  ("rod", rod, (2, 1, 1))):
            for more, about in (("", centre), (", point=3,1,-2", point)):
                with self.subTest(kind + more):
                    own, _ = self.run_scene([self.body("block", geo), "&support body='block', surface='bottom', fix='xyz' /",
                                             "&load body='block', surface='sides x', %s%s /" % (given, more), SOLVER])
                    self.check_equilibrium(own)
                    load, support = Table(own["loads"]), Table(own["supports"])
                    # The mesh of the rod has a polygon's centroid only to the accuracy of its facets.
                    exact, close = moment + np.cross(about, force), 1e-12 if more or kind != "rod" else 1e-3
                    np.testing.assert_allclose(load.array["force"][0], force, rtol=1e-12)
                    np.testing.assert_allclose(load.array["moment"][0], exact, atol=close * np.abs(exact).max())
                    np.testing.assert_allclose(support.array["moment"][0], -load.array["moment"][0], atol=1e-11)

    def test_total_force_of_axisymmetric_and_of_several_bodies(self):
        """On the full circumference along the axis; each of several bodies gets the whole force."""
        own, _ = self.run_scene([self.body("ring", block_geo("quad8", 2, (0.5, 0.0), (1.0, 1.0))),
                                 "&support body='ring', surface='bottom', fix='xy' /",
                                 "&load body='ring', surface='top', force=0,-5 /", SOLVER], "axisymmetric")
        np.testing.assert_allclose(Table(own["supports"])("force", "ring:bottom"), (0, 5, 0), atol=1e-12)
        lines = [self.body("block %d" % k, block_geo("hex8", 1, (3.0 * k, 0.0, 0.0), (1.0, 1.0, 1.0))) for k in range(2)]
        own, _ = self.run_scene([*lines, "&support body='*', surface='bottom', fix='xyz' /",
                                 "&load body='block *', surface='top', force=0,0,-2 /", SOLVER])
        np.testing.assert_allclose(Table(own["supports"]).array["force"], [(0, 0, 2)] * 2, atol=1e-12)

    def test_total_loads_without_meaning(self):
        """Refused with file, line and surface."""
        for analysis, load, code, text in (
                ("axisymmetric", "force=1,2", 2, "in axisymmetric analyses only a force along the axis y"),
                ("axisymmetric", "force=0,2, moment=1", 2, "in axisymmetric analyses only a force along the axis y"),
                ("plane_strain", "moment=1,0,0", 2, "moment: the x and y components must be 0 in two dimensions"),
                ("3d", "moment=1", 2, "moment needs 3 values, got 1"),
                ("3d", "force=1,2", 2, "force needs 3 values in three dimensions, got 2"),
                ("3d", "force=1,2,3, pressure=1", 2, "got pressure, force and moment"),
                ("3d", "pressure=1, point=0,0,0", 2, "point goes together with force and moment only")):
            with self.subTest(load):
                printed = self.dotyk(self.column_of(analysis, load), code=code)
                self.assertRegex(printed, r"case.nml:5: .*" + text.replace("(", r"\("))
                if analysis == "axisymmetric":
                    self.assertIn("load on surface 'top': ", printed)

    def test_tables(self):
        """dotyk-summary prints them as CSV."""
        for name, z in (("lower", 0.0), ("upper", 1.0)):
            self.write(name + ".geo", block_geo("hex8", 2, (0.0, 0.0, z), (1.0, 1.0, 1.0)))
        self.write("column.nml", column_nml(3))
        self.dotyk("column.nml")
        own = self.results("column.vtkhdf")["dotyk"]
        for table, n in (("contacts", 1), ("supports", 6), ("bodies", 2), ("loads", 0)):
            done = subprocess.run([sys.executable, "-Bm", "dotyk.summary", "--csv", table, "column.vtkhdf"],
                                  cwd=self.folder, text=True, capture_output=True, check=True)
            rows = list(csv.DictReader(io.StringIO(done.stdout)))
            self.assertEqual(len(rows), n, done.stderr)
            if table == "contacts":
                self.assertEqual(rows[0]["name"], "joint")
                self.assertAlmostEqual(float(rows[0]["force_z"]), own["contact/joint"].attrs["force"][2], delta=1e-10)
            if table == "supports":
                self.assertEqual(rows[2]["name"], "lower:bottom")
                self.assertAlmostEqual(float(rows[2]["force_z"]), own["supports/force"][2, 2], delta=1e-10)


dotyk_case.main()
