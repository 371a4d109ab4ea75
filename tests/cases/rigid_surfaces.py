#!/usr/bin/python3
"""Rigid bodies that are surfaces without volume: one facet is enough for a plate."""
import numpy as np

import dotyk_case
from blocks import block_geo

YOUNG, POISSON, HEIGHT = 200.0, 0.3, 1.0
SOLVER = "&solver theta=0, tolerance=1e-10 /"
LOW = ["&body name='low', mesh='low.geo', volume='block', material='steel' /",
       "&support body='low', surface='bottom', fix='xyz' /",
       "&contact name='joint', surface_a='low:top', surface_b='punch:bottom' /"]
# Kinds of gmsh by the number of nodes: in space, and of curves.
FACETS, CURVES = {3: 2, 4: 3}, {2: 1, 3: 8}


def msh(points, facets, name="bottom", dimension=3):
    """A surface as a mesh file; facets with nodes from 1."""
    kinds = FACETS if dimension == 3 else CURVES
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "1", '%d 7 "%s"' % (dimension - 1, name),
             "$EndPhysicalNames", "$Nodes", str(len(points))]
    lines += ["%d %r %r %r" % (i, *map(float, (*x, 0)[:3])) for i, x in enumerate(points, 1)]
    lines += ["$EndNodes", "$Elements", str(len(facets))]
    lines += ["%d %d 2 7 1 %s" % (e, kinds[len(f)], " ".join(map(str, f))) for e, f in enumerate(facets, 1)]
    return "\n".join(lines + ["$EndElements", ""])


SQUARE = [(0.5, 0.6, HEIGHT), (1.5, 0.6, HEIGHT), (1.5, 1.6, HEIGHT), (0.5, 1.6, HEIGHT)]
# The corners of a cube, and its faces, of which some are oriented inward.
CUBE = [*SQUARE, *[(x, y, z + 1) for x, y, z in SQUARE]]
SIDES = [(1, 2, 3, 4), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (4, 3, 7, 8), (1, 4, 8), (1, 8, 5)]


class RigidSurfaces(dotyk_case.Case):
    def scene(self, lines, analysis="3d", code=0, solver=SOLVER):
        self.write("case.nml", "\n".join([
            "&scene analysis='%s' /" % analysis, "&material name='steel', young=%r, poisson=%r, density=3 /" % (
                YOUNG, POISSON), *lines, solver]) + "\n")
        return self.dotyk("case.nml", code=code)

    def test_as_volume(self):
        """A punch as a volume, as one facet, as two, and as a closed surface of facets of any orientation: held and
        moved, and loaded by a force and a moment."""
        self.write("low.geo", block_geo("tet10", 3, (0.0, 0.0, 0.0), (2.0, 2.0, HEIGHT)))
        self.write("volume.geo", block_geo("hex8", 1, SQUARE[0], (1.0, 1.0, 1.0)))
        self.write("quad.msh", msh(SQUARE, [(1, 2, 3, 4)]))
        self.write("two.msh", msh(SQUARE, [(1, 2, 3), (1, 3, 4)]).replace("2 7 1 1 3 4", "2 7 1 4 3 1"))
        self.write("cube.msh", msh(CUBE, SIDES))
        facing = ", facing=1,1,0.5"
        punches = ["mesh='volume.geo', volume='block', material='steel'", "mesh='quad.msh', surface='bottom'" + facing,
                   "mesh='two.msh', surface='bottom'" + facing, "mesh='cube.msh', surface='bottom'"]
        for hold, surface in (("&rigid_body body='punch', fix='xyz rx ry rz', value=0.01,0,-0.01, rotation=0,0.002,0, "
                               "point=1,1,2 /", None),
                              ("&rigid_body body='punch', fix='x y rz' /", "top"),
                              ("&rigid_body body='punch' /", "top")):
            expected = None
            for punch in punches:
                with self.subTest(punch=punch, hold=hold):
                    load = []
                    if surface:
                        at = "bottom" if "surface" in punch else surface
                        load = ["&load body='punch', surface='%s', force=0,0,-1, moment=0.05,0.1,0, "
                                "point=1,1.1,2 /" % at]
                    printed = self.scene(["&body name='punch', %s /" % punch, LOW[1], hold, *load, LOW[2],
                                LOW[0]])
                    file = self.results("case.vtkhdf")
                    parts = file["VTKHDF/NumberOfPoints"][:]
                    joint = file["dotyk/contact/joint"].attrs
                    moved = file["VTKHDF/PointData/displacement"][:]
                    punch_moved = moved[:4]
                    if "volume" in punch:
                        x = file["VTKHDF/Points"][:8]
                        punch_moved = moved[:8][x[:, 2] < HEIGHT + 1e-9]
                    found = np.concatenate([joint["force"], joint["moment"], [joint["peak_pressure"]],
                                            100 * moved[parts[0]:].ravel(), 100 * np.sort(punch_moved[:, 2])])
                    if expected is None:
                        expected = found
                    # Triangles in place of a quadrilateral have other mortar segments, with other rounding.
                    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
                    self.assertNotIn("overlap", printed)
                    self.assertLess(file["dotyk/bodies"].attrs["force_error"], 1e-8)
                    self.assertEqual(file["VTKHDF/PointData/displacement"].shape[0], parts.sum())
                    if surface:
                        np.testing.assert_allclose(joint["force"][2], -1, rtol=1e-8)

    def test_hertz(self):
        """The elastic ball on a rigid flat of one facet, in axisymmetry of one line."""
        self.copy("hertz_axisymmetric/hertz_axisymmetric.geo")
        text = (dotyk_case.INPUTS / "hertz_axisymmetric" / "hertz_axisymmetric.nml").read_text()
        young, force, radius = 210e3 / (1 - 0.3**2), 12.0, 100.0
        a = (3 * force * radius / (4 * young))**(1 / 3)
        self.write("flat.msh", msh([(0, 0), (2000, 0)], [(1, 2)], "flat", 2))
        plane = "&body name='half-space', mesh='flat.msh', surface='flat', facing=1,5 /\n&rigid_body body='half-space', fix='y' /"
        groups = ["&" + g for g in "\n".join(s for s in text.split("\n") if not s.startswith("!")).split("&")[1:]]
        kept = [g for g in groups if "body='half-space'" not in g and "name='half-space'" not in g]
        self.write("hertz.nml", "".join(kept).replace("half-space:up", "half-space:flat") + "\n" + plane + "\n")
        self.dotyk("hertz.nml")
        file = self.results("hertz.vtkhdf")
        touch = file["dotyk/contact/touch"].attrs
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        np.testing.assert_allclose(abs(touch["force"][1]), force, rtol=1e-8)
        np.testing.assert_allclose(touch["peak_pressure"], 3 * force / (2 * np.pi * a**2), rtol=2e-3)
        np.testing.assert_allclose(np.sqrt(touch["contact_area"] / np.pi), a, rtol=2e-3)
        centre = np.argmin(np.hypot(x[:, 0], x[:, 1] - radius))
        np.testing.assert_allclose(-u[centre, 1], a**2 / radius, rtol=4e-3)
        # The reaction of the plane.
        np.testing.assert_allclose(abs(file["dotyk/supports/force"][:][-1, 1]), force, rtol=1e-8)

    def test_plane(self):
        """A rigid line, and a closed curve of quadratic lines, on a column in the plane; and what is behind an open one
        does not touch it."""
        self.write("column.geo", block_geo("quad8", 2, (0.0, 0.0), (1.0, HEIGHT)))
        self.write("line.msh", msh([(-0.2, HEIGHT), (1.3, HEIGHT)], [(1, 2)], "up", 2))
        ring = [(-0.2, HEIGHT), (1.3, HEIGHT), (0.5, 3), (0.55, HEIGHT), (0.9, 2), (0.15, 2)]
        self.write("ring.msh", msh(ring, [(1, 2, 4), (3, 2, 5), (3, 1, 6)], "up", 2))
        for punch in ("mesh='line.msh', surface='up', facing=0.5,0", "mesh='ring.msh', surface='up'"):
            for more in ([], ["&body name='back', mesh='column.geo', volume='block', material='steel', at=0,1 /",
                              "&support body='back', surface='top', fix='xy' /"]):
                if more and "ring" in punch:
                    continue
                with self.subTest(punch, more=more):
                    printed = self.scene([
                        "&body name='column', mesh='column.geo', volume='block', material='steel' /",
                        "&body name='punch', %s /" % punch, "&support body='column', surface='bottom', fix='y' /",
                        "&support body='column', surface='sides x', fix='x' /", *more,
                        "&rigid_body body='punch', fix='x y rz', value=0,-0.01 /",
                        "&contact name='joint', surface_a='column:top', surface_b='punch:up' /"], "plane_stress")
                    self.assertNotIn("overlap", printed.replace("overlap by 0", ""))
                    np.testing.assert_allclose(self.results("case.vtkhdf")["dotyk/contact/joint"].attrs["force"],
                                               (0, -0.01 * YOUNG / (1 - POISSON**2), 0), atol=1e-9)

    def test_found_pairs(self):
        """Pairs that are found; stresses and errors of the faces are 0."""
        self.write("low.geo", block_geo("hex8", 3, (0.0, 0.0, 0.0), (2.0, 2.0, HEIGHT)))
        self.write("cube.msh", msh(CUBE, SIDES))
        self.write("quad.msh", msh(SQUARE, [(1, 2, 3, 4)]))
        for punch in ("mesh='cube.msh', surface='bottom'", "mesh='quad.msh', surface='bottom', facing=1,1,0"):
            self.scene([*LOW[:2], "&body name='punch', %s, at=0,0,1e-3 /" % punch,
                        "&rigid_body body='punch', fix='x y rz' /", "&load body='punch', surface='bottom', force=0,0,-1 /",
                        "&load body='*', acceleration=0,0,-1e-3 /", "&mass body='punch', surface='bottom', mass=1e3 /",
                        "&contact auto=.true. /", "&output fields='displacement stress contact error reaction nodal_stress' /"])
            file = self.results("case.vtkhdf")
            np.testing.assert_allclose(file["dotyk/contact/low - punch"].attrs["force"], (0, 0, -2), atol=1e-8)
            stress = file["VTKHDF/CellData/stress"][:]
            self.assertEqual(len(stress), file["VTKHDF/NumberOfCells"][:].sum())
            n = file["VTKHDF/NumberOfCells"][1]
            np.testing.assert_array_equal(stress[-n:], 0)
            self.assertTrue(np.all(np.isfinite(stress)))

    def test_mistakes(self):
        """Surfaces without two sides, or of which nothing tells the side of contact."""
        self.write("low.geo", block_geo("hex8", 1, (0.0, 0.0, 0.0), (2.0, 2.0, HEIGHT)))
        self.write("quad.msh", msh(SQUARE, [(1, 2, 3, 4)]))
        self.write("fan.msh", msh([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 2), (0, 0, 3)], [(1, 2, 3), (1, 2, 4), (1, 2, 5)]))
        self.write("apart.msh", msh(CUBE, SIDES[:2]))
        turns = np.arange(6) * np.pi / 3
        strip = [((2 + s * np.cos(t / 2)) * np.cos(t), (2 + s * np.cos(t / 2)) * np.sin(t), s * np.sin(t / 2))
                 for t in turns for s in (-1, 1)]
        self.write("moebius.msh", msh(strip, [(2 * k + 1, 2 * k + 2, 2 * k + 4, 2 * k + 3) for k in range(5)] +
                                      [(11, 12, 1, 2)]))
        rigid, quad = "&rigid_body body='punch' /", "mesh='quad.msh', surface='bottom'"
        for punch, lines, message in (
                (quad, [rigid], "case.nml:6: mesh 'quad.msh', surface 'bottom': it is open (element 1 has a free edge), and nothing tells which of its sides"),
                (quad + ", facing=5,1,1", [rigid], "facing does not tell the side of contact"),
                (quad + ", facing=5,1,0", [], "a surface without volume: it is rigid; add &rigid_body body='punch'"),
                (quad + ", material='steel'", [rigid], "material does not go together with surface"),
                ("mesh='quad.msh', surface='botom', facing=1,1,0", [rigid], "did you mean 'bottom'"),
                ("mesh='fan.msh', surface='bottom'", [rigid],
                 "more than two facets meet at an edge: element 1, element 2 and element 3"),
                ("mesh='apart.msh', surface='bottom'", [rigid],
                 "it is in pieces, 1 of its 2 facets (the first is element 2) are joined to element 1 by no edge"),
                ("mesh='moebius.msh', surface='bottom'", [rigid], "it has one side only, as a Moebius strip"),
                ("mesh='low.geo', volume='block'", [rigid], "'material' is missing"),
                ("mesh='low.geo', material='steel'", [rigid], "'volume' is missing"),
                ("mesh='low.geo', volume='block', material='steel', facing=1,1,1", [rigid], "it needs surface"),
                (quad + ", facing=1,1,0", [rigid, "&load body='punch', force_density=0,0,1 /"], "has neither volume nor mass for force_density"),
                (quad + ", facing=1,1,0", [rigid, "&load body='punch', acceleration=0,0,1 /"], "nor mass for acceleration"),
                (quad + ", facing=1,1,0", [rigid, "&load body='punch', angular_velocity=0,0,1 /"], "nor mass for angular_velocity"),
                (quad + ", facing=1,1,0", [rigid, "&support body='punch', surface='bottom', fix='x' /"], "is rigid")):
            with self.subTest(message):
                self.assertIn(message, self.scene([*LOW, "&body name='punch', %s /" % punch, *lines], code=2))


if __name__ == "__main__":
    dotyk_case.main()
