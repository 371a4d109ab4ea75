#!/usr/bin/python3
"""Rigid bodies: held, moved and loaded, against exact solutions and very stiff elastic bodies."""
import subprocess
import sys

import numpy as np

import dotyk_case
from blocks import block_geo, dimension

YOUNG, HEIGHT = 200.0, 2.0
SIZE, ORIGIN = (1.0, 1.5, HEIGHT), (1.0, 2.0, 3.0)
SOLVER = "&solver theta=0, tolerance=1e-10 /"


DISC = """Mesh.ElementOrder = 2;  Mesh.MeshSizeMin = 0.15;  Mesh.MeshSizeMax = 0.15;  SetFactory("OpenCASCADE");
Disk(1) = {0, 0, 0, 1};  Physical Surface("disc") = {1};  Physical Curve("side") = {Boundary{Surface{1};}};
"""


class RigidBodies(dotyk_case.Case):
    solver = SOLVER

    def scene(self, lines, analysis="3d", poisson=0.0, code=0):
        self.write("case.nml", "\n".join([
            "&scene analysis='%s' /" % analysis, "&material name='steel', young=%r, poisson=%r /" % (YOUNG, poisson),
            "&material name='stiff', young=%r, poisson=0, density=2 /" % (1e6 * YOUNG), *lines, self.solver]) + "\n")
        return self.dotyk("case.nml", code=code)

    def column(self, kind, plate, more=(), name="plate", **options):
        """A clamped column without Poisson's ratio under a plate that is wider than the column."""
        d = dimension(kind)
        low = [ORIGIN[i] - 0.2 for i in range(d - 1)] + [ORIGIN[2] + HEIGHT]
        wide = [SIZE[i] + 0.4 for i in range(d - 1)] + [0.5]
        self.write("column.geo", block_geo(kind, 2, (*ORIGIN[:d - 1], ORIGIN[2]), (*SIZE[:d - 1], HEIGHT)))
        self.write("plate.geo", block_geo("hex8" if d == 3 else "quad4", 2, low, wide))
        printed = self.scene(["&body name='column', mesh='column.geo', volume='block', material='steel' /",
                              "&body name='plate', mesh='plate.geo', volume='block', material='stiff' /",
                              "&support body='column', surface='bottom', fix='%s' /" % "xyz"[:d], plate,
                              "&contact name='joint', surface_a='column:top', surface_b='plate:bottom' /", *more],
                             **options)
        file = self.results("case.vtkhdf")
        return file, file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:], printed

    def check_column(self, kind, plate, sunk, turned, more=(), **options):
        """The top of the column follows the plane of the plate: stress E/H times its displacement."""
        d = dimension(kind)
        file, x, u, printed = self.column(kind, plate, more, **options)
        up, across = d - 1, x[:, 0] - 1.5
        z = x[:, up] - ORIGIN[2]
        rigid = z > HEIGHT - 1e-9
        plane = -(sunk + turned * across)
        exact = plane * np.where(rigid, 1, z / HEIGHT)
        # Pressures that vary along the joint are those of the mortar elements.
        np.testing.assert_allclose(u[:, up], exact, atol=(5e-3 if turned else 1e-7) * sunk)
        np.testing.assert_allclose(u[rigid & (x[:, up] > HEIGHT + ORIGIN[up] + 0.1), up].mean(), -sunk, rtol=1e-7)
        own, area = file["dotyk"], 1.5 if d == 3 else 1.0
        plate = z > HEIGHT + 0.1
        motion = own["rigid_bodies"]
        self.assertEqual((motion.attrs["names"], list(motion["body"])), (b"plate", [2]))
        np.testing.assert_allclose(motion["displacement"][0] + np.cross(motion["rotation"][0], x[plate] - motion["point"][0]),
                                   u[plate], atol=1e-12)
        force = YOUNG / HEIGHT * sunk * area
        joint = own["contact/joint"].attrs
        np.testing.assert_allclose(joint["force"][up], -force, rtol=1e-7)
        np.testing.assert_allclose(joint["centre_of_pressure"][0], 1.5 + turned / sunk / 12,
                                   rtol=1e-7 if "load" in "".join(more) else 1e-3)
        self.assertLess(own["bodies"].attrs["force_error"], 1e-8)
        self.assertLess(own["bodies"].attrs["moment_error"], 1e-8)
        return own, printed

    def test_held_and_moved(self):
        """Plates that sink and turn about their point, in space and in the plane; the reaction is that of the motions
        held."""
        own, printed = self.check_column("hex20", "&rigid_body body='plate', fix='xyz rx ry rz', value=0,0,-0.01, "
                                         "rotation=0,0.004,0, point=1.5,2.75,6 /", 0.01, 0.004)
        self.assertIn("plate:rigid body     force (0, 0, -1.5)", printed)
        self.assertIn("  plate                (0, 0, -0.01), rotation (0, 0.004, 0) rad\n", printed)
        table = subprocess.run([sys.executable, "-Bm", "dotyk.summary", "--csv", "rigid_bodies", "case.vtkhdf"],
                               cwd=self.folder, text=True, capture_output=True, check=True).stdout
        self.assertEqual(table, "file,name,body,displacement_x,displacement_y,displacement_z,point_x,point_y,point_z,rotation_x,"
                         "rotation_y,rotation_z\ncase.vtkhdf,plate,2,0,0,-0.01,1.5,2.75,6,0,0.004,0\n")
        force = own["supports/force"][:]
        np.testing.assert_allclose(force, [(0, 0, 1.5), (0, 0, -1.5)], atol=1e-8)
        moment = own["supports/moment"][:]
        np.testing.assert_allclose(moment[0] + moment[1], 0, atol=1e-7)
        self.check_column("quad8", "&rigid_body body='plate', fix='x y rz', value=0,-0.01, rotation=-0.004, point=1.5,0 /",
                          0.01, 0.004, analysis="plane_strain")

    def test_loaded(self):
        """Forces and moments on free motions, and the weight of the plate."""
        inertia = 1.5 / 12
        for kind, fix, load, analysis in (
                ("hex20", "x y rx rz", "force=0,0,-1.5, moment=0,%r,0, point=1.5,2.75,9" % (100 * 0.004 * inertia), "3d"),
                ("quad8", "x", "force=0,-1, moment=%r, point=1.5,9" % (-100 * 0.004 / 12), "plane_stress")):
            with self.subTest(kind):
                own, _ = self.check_column(kind, "&rigid_body body='plate', fix='%s' /" % fix, 0.01, 0.004,
                                           ["&load body='plate', surface='top', %s /" % load], analysis=analysis)
                np.testing.assert_allclose(own["supports/force"][:][1], 0, atol=1e-8)
        weight = 2 * 1.4 * 1.9 * 0.5
        self.check_column("hex20", "&rigid_body body='plate', fix='x y rz' /", 0.01, 0,
                          ["&load body='plate', acceleration=0,0,%r /" % (-1.5 / weight)])

    def test_multigrid(self):
        """The same with p-multigrid: motions that are held, and loads on a plate that floats."""
        self.solver = SOLVER.replace(" /", ", response='multigrid' /")
        for plate, more in (("&rigid_body body='plate', fix='xyz rx ry rz', value=0,0,-0.01, rotation=0,0.004,0, point=1.5,2.75,6 /",
                             ()),
                            ("&rigid_body body='plate', fix='x y rx rz' /",
                             ("&load body='plate', surface='top', force=0,0,-1.5, moment=0,0.05,0, point=1.5,2.75,9 /",))):
            with self.subTest(plate=plate):
                printed = self.check_column("hex20", plate, 0.01, 0.004, more)[1]
                self.assertIn("with p-multigrid", printed)

    def test_far_from_the_point(self):
        """Motions are held about a point far away, too: the origin, if a scene is in the coordinates of a whole plant."""
        self.write("one.geo", block_geo("hex8", 1))
        found = []
        for x in 0, 3000, 1e6:
            self.write("far.nml", "&scene mesh='one.geo' /\n&material name='m', young=1, poisson=0 /\n"
                       "&body name='low', volume='block', material='m', at=%r,0,0 /\n"
                       "&body name='plate', volume='block', material='m', at=%r,0,1 /\n"
                       "&support body='low', surface='bottom', fix='xyz' /\n"
                       "&rigid_body body='plate', fix='xyz rx ry rz', value=0,0,-1e-3 /\n"
                       "&contact name='c', surface_a='low:top', surface_b='plate:bottom', theta=0 /\n" % (x, x))
            self.dotyk("far.nml")
            found.append(self.results("far.vtkhdf")["dotyk/contact/c"].attrs["force"][2])
        np.testing.assert_allclose(found, -1e-3, rtol=1e-8)

    def test_several_by_wildcards(self):
        """A temperature and supports of all bodies leave out those that are rigid."""
        self.write("one.geo", block_geo("hex8", 1))
        lines = ["&scene mesh='one.geo' /", "&material name='m', young=1, poisson=0, expansion=1e-3 /",
                 "&body name='low', volume='block', material='m' /", "&body name='plate', volume='block', material='m', at=0,0,1 /",
                 "&rigid_body body='plate', fix='xyz rx ry rz' /", "&support body='*', surface='bottom', fix='z' /",
                 "&temperature body='*', value=1 /", "&contact name='c', surface_a='low:top', surface_b='plate:bottom', theta=0 /"]
        self.write("all.nml", "\n".join(lines) + "\n")
        log = self.dotyk("all.nml")
        self.assertIn("  &support of line 6 leaves out 1 rigid body: 'plate'\n", log)
        self.assertIn("  &temperature of line 7 leaves out 1 rigid body: 'plate'\n", log)
        self.assertAlmostEqual(self.results("all.vtkhdf")["dotyk/contact/c"].attrs["force"][2], -1e-3, delta=1e-9)
        self.write("all.nml", "\n".join(lines).replace("body='*', value", "body='plat*', value") + "\n")
        self.assertIn("is rigid: it does not expand", self.dotyk("all.nml", code=2))

    def test_axisymmetric(self):
        """A plate about the axis, moved and loaded."""
        self.write("column.geo", block_geo("quad8", 2, (0.0, 0.0), (1.0, HEIGHT)))
        self.write("plate.geo", block_geo("quad4", 2, (0.0, HEIGHT), (1.2, 0.5)))
        for more in (["&rigid_body body='plate', fix='y', value=0,-0.01 /"],
                     ["&rigid_body body='plate' /", "&load body='plate', surface='top', force=0,%r /" % -np.pi]):
            self.scene(["&body name='column', mesh='column.geo', volume='block', material='steel' /",
                        "&body name='plate', mesh='plate.geo', volume='block', material='stiff' /",
                        "&support body='column', surface='bottom', fix='xy' /", *more,
                        "&contact name='joint', surface_a='plate:bottom', surface_b='column:top' /"], "axisymmetric")
            own = self.results("case.vtkhdf")["dotyk"]
            np.testing.assert_allclose(own["contact/joint"].attrs["force"], (0, np.pi, 0), rtol=1e-7)
            u = self.results("case.vtkhdf")["VTKHDF/PointData/displacement"][:]
            np.testing.assert_allclose(own["rigid_bodies/displacement"][0], (0, -0.01, 0), rtol=1e-7, atol=0)
            self.assertEqual(np.abs(own["rigid_bodies/rotation"][0]).max(), 0)
            np.testing.assert_allclose(u[:, 1].min(), -0.01, rtol=1e-7)

    def test_limit_of_stiff_bodies(self):
        """A punch on a wider block with Poisson's ratio: forces of a body a million times as stiff."""
        force = []
        free = "&load body='punch', surface='top', force=0,0,-1, moment=0.05,0.1,0 /"
        self.write("low.geo", block_geo("tet10", 3, (0.0, 0.0, 0.0), (2.0, 2.0, 1.0)))
        self.write("punch.geo", block_geo("hex8", 2, (0.5, 0.6, 1.0), (1.0, 1.0, 1.0)))
        for hold in ("&support body='punch', surface='top', fix='xyz', value=0,0,-0.01 /",
                     "&rigid_body body='punch', fix='xyz rx ry rz', value=0,0,-0.01 /",
                     free, free + "\n&rigid_body body='punch' /"):
            self.scene(["&body name='low', mesh='low.geo', volume='block', material='steel' /",
                        "&body name='punch', mesh='punch.geo', volume='block', material='stiff' /",
                        "&support body='low', surface='bottom', fix='xyz' /", hold,
                        "&contact name='joint', surface_a='low:top', surface_b='punch:bottom' /"], poisson=0.3)
            own = self.results("case.vtkhdf")["dotyk"]
            u = self.results("case.vtkhdf")["VTKHDF/PointData/displacement"][-27:]
            force.append(np.concatenate([own["contact/joint"].attrs["force"], own["contact/joint"].attrs["moment"],
                                         [own["contact/joint"].attrs["peak_pressure"]], 100 * u[:, 2]]))
        # A finer rigid mesh is the master side of pairs that are found.
        self.write("punch.geo", block_geo("hex8", 12, (0.5, 0.6, 1.0), (1.0, 1.0, 1.0)))
        self.scene(["&body name='low', mesh='low.geo', volume='block', material='steel' /",
                    "&body name='punch', mesh='punch.geo', volume='block', material='stiff' /",
                    "&support body='low', surface='bottom', fix='xyz' /", free + "\n&rigid_body body='punch' /",
                    "&contact auto=.true. /"], poisson=0.3)
        np.testing.assert_allclose(self.results("case.vtkhdf")["dotyk/contact/low - punch"].attrs["force"], (0, 0, -1),
                                   atol=1e-8)
        for elastic, rigid in (force[:2], force[2:]):
            np.testing.assert_allclose(rigid, elastic, atol=1e-5 * np.abs(elastic).max())
        np.testing.assert_allclose(force[3][:3], (0, 0, -1), atol=1e-8)

    def test_hertz(self):
        """A rigid ball on the elastic half-space, and the elastic ball on a rigid flat: radius and pressure of twice the
        stiffness of two like bodies."""
        folder = dotyk_case.INPUTS / "hertz_axisymmetric"
        self.copy("hertz_axisymmetric/hertz_axisymmetric.geo")
        text = (folder / "hertz_axisymmetric.nml").read_text()
        young, force, radius = 210e3 / (1 - 0.3**2), 12.0, 100.0
        a = (3 * force * radius / (4 * young))**(1 / 3)
        peak = 3 * force / (2 * np.pi * a**2)
        for rigid, hold in (("ball", ""), ("half-space", ", fix='y'")):
            with self.subTest(rigid):
                lines = "\n".join(line for line in text.split("\n") if "title" in line or not line.startswith("!"))
                groups, kept = lines.split("&")[1:], []
                for group in groups:
                    if not (group.startswith("support") and "body='%s'" % rigid in group):
                        kept.append("&" + group)
                self.write("hertz.nml", "".join(kept) + "\n&rigid_body body='%s'%s /\n" % (rigid, hold))
                self.dotyk("hertz.nml")
                file = self.results("hertz.vtkhdf")
                touch = file["dotyk/contact/touch"].attrs
                x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
                np.testing.assert_allclose(abs(touch["force"][1]), force, rtol=1e-8)
                np.testing.assert_allclose(touch["peak_pressure"], peak, rtol=2e-3)
                np.testing.assert_allclose(np.sqrt(touch["contact_area"] / np.pi), a, rtol=2e-3)
                if rigid == "ball":
                    ball = np.unique(np.round(u[x[:, 1] > 1e-3, 1], 12))
                    self.assertEqual(len(ball), 1)
                    np.testing.assert_allclose(-ball[0], a**2 / radius, rtol=2e-3)
                else:
                    centre = np.argmin(np.hypot(x[:, 0], x[:, 1] - radius))
                    np.testing.assert_allclose(-u[centre, 1], a**2 / radius, rtol=4e-3)
                    np.testing.assert_array_equal(u[x[:, 1] < -1e-3], 0)

    def test_spin(self):
        """A rigid disc in the plane: its spin moves it as a rotation, and where it is free nothing determines it."""
        self.write("disc.geo", DISC)
        self.write("floor.geo", block_geo("quad8", (6, 3), (-1.5, -2.0), (3.0, 1.0)))
        for fix, spin in (("rz", 1e-3), ("", 0.0)):
            printed = self.scene(["&body name='floor', mesh='floor.geo', volume='block', material='steel' /",
                                  "&body name='disc', mesh='disc.geo', volume='disc', material='stiff' /",
                                  "&support body='floor', surface='bottom', fix='xy' /",
                                  "&rigid_body body='disc', fix='x %s'%s /" % (fix, ", rotation=%r" % spin if spin else ""),
                                  "&load body='disc', acceleration=0,-0.1 /",
                                  "&contact name='touch', surface_a='floor:top', surface_b='disc:side', geometry='smooth' /"],
                                 "plane_strain")
            file = self.results("case.vtkhdf")
            touch = file["dotyk/contact/touch"].attrs
            np.testing.assert_allclose(touch["force"][1], -0.1 * 2 * np.pi, rtol=1e-3)
            x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
            disc = x[:, 1] > -0.95
            if not fix:
                # The polygon is not quite round: what hardly anything resists, the log tells.
                self.assertIn("not determined by contact: ", printed)
                spin = np.polyfit(x[disc, 1], -u[disc, 0], 1)[0]
            np.testing.assert_allclose(u[disc, 0], -spin * x[disc, 1], atol=1e-9)
            np.testing.assert_allclose(u[disc, 1] - u[disc, 1].mean(), spin * (x[disc, 0] - x[disc, 0].mean()), atol=1e-9)

    def test_mistakes(self):
        """Messages name line and remedy."""
        column = ["&body name='a', mesh='a.geo', volume='block', material='steel' /",
                  "&body name='b', mesh='a.geo', volume='block', material='steel', at=0,0,1 /"]
        self.write("a.geo", block_geo("hex8", 1))
        rigid = "&rigid_body body='a', "
        for lines, message in (([rigid + "fix='xw' /"], "case.nml:6: &rigid_body: fix: unknown motion 'w'"),
                               ([rigid + "fix='x', value=0,0,1 /"], "value has 1 for z, but fix does not name it"),
                               ([rigid + "fix='z', rotation=0,0,1 /"], "rotation has 1 for rz, but fix does not name it"),
                               ([rigid + "fix='xyz rz', rotation=0,0,57 /"], "57 is no small rotation, if it is not in degrees"),
                               ([rigid + "fix='xyz' /", rigid + "fix='xyz' /"], "is rigid already"),
                               ([rigid + "fix='xyz' /", "&support body='a', surface='bottom', fix='z' /"],
                                "case.nml:7: &support: body 'a' is rigid"),
                               ([rigid + "fix='xyz' /", "&spring body='a', surface='bottom', fix='z', modulus=1 /"],
                                "case.nml:7: &spring: body 'a' is rigid"),
                               (["&rigid_body body='*', fix='xyz rx ry rz' /",
                                 "&contact name='c', surface_a='a:top', surface_b='b:bottom' /"], "both bodies are rigid")):
            with self.subTest(message):
                self.assertIn(message, self.scene([*column, *lines], code=2))


if __name__ == "__main__":
    dotyk_case.main()
