#!/usr/bin/python3
"""The column of two blocks: uniform pressure, exact to round-off whatever the meshes of the two faces."""
import numpy as np

import dotyk_case
from blocks import KINDS, SHORTENING, block_geo, column_exact, column_nml, dimension, mesh

VTK = {"tet4": 10, "tet10": 24, "prism6": 13, "prism15": 26, "prism18": 32, "hex8": 12, "hex20": 25, "hex27": 29,
       "tri3": 5, "tri6": 22, "quad4": 9, "quad8": 23, "quad9": 28}


class Column(dotyk_case.Case):
    def column(self, kinds, divisions, analysis=None, contact="", gap=0.0, left=0.0, warp=0.0):
        """Solve the column; returns results, and the exact pressure and displacement of its nodes along the column.
        `warp` moves the nodes within the cross section."""
        d = dimension(kinds[0])
        for name, kind, n, z in zip(("lower", "upper"), kinds, divisions, (0.0, 1.0)):
            origin = [left] + [0.0] * (d - 1)
            origin[-1] = z
            geo = self.write(name + ".geo", block_geo(kind, n, origin, (1.0,) * d))
            if warp:
                side = warp if name == "lower" else -warp
                mesh(geo, d, lambda x: x + side * np.prod(np.sin(np.pi * x[:, :2]), axis=1)[:, None] * [1.0, 0.7, 0.0])
        text = column_nml(d, analysis, contact)
        self.write("column.nml", text.replace(".geo'", ".msh'") if warp else text)
        self.dotyk("column.nml")
        file = self.results("column.vtkhdf")
        theta = file["dotyk/contact/joint"].attrs["theta"]
        pressure, lower, upper = column_exact(theta, analysis, gap)
        points, n = file["VTKHDF/Points"][:], file["VTKHDF/NumberOfPoints"][0]
        height = points[:, d - 1]
        exact = np.where(np.arange(len(points)) < n, -lower * height, -SHORTENING + upper * (2 - height))
        return file, pressure, exact

    def check_exact(self, kind, analysis=None, **options):
        """1e-9 of pressure, displacement, penetration, force: the tolerance 1e-12 and round-off leave that."""
        file, pressure, exact = self.column((kind, kind), (2, 2), analysis, **options)
        d = dimension(kind)
        joint = file["dotyk/contact/joint"]
        theta = joint.attrs["theta"]
        close = 1e-9 * SHORTENING
        u = file["VTKHDF/PointData/displacement"][:]
        np.testing.assert_allclose(u[:, d - 1], exact, rtol=0, atol=close)
        if analysis != "plane_stress":
            np.testing.assert_allclose(np.delete(u, d - 1, axis=1), 0, rtol=0, atol=close)
        for name in ("pressure", "pressure_projected"):
            np.testing.assert_allclose(joint[name][:], pressure, rtol=1e-9)
        np.testing.assert_allclose(joint["gap"][:], -theta * pressure, rtol=1e-9)
        area = joint["weight"][:].sum()
        force = np.zeros(3)
        force[d - 1] = pressure * area
        np.testing.assert_allclose(joint.attrs["force"], force, rtol=1e-9, atol=1e-9 * pressure)
        stress = file["VTKHDF/CellData/stress"][:]
        np.testing.assert_allclose(stress[:, d - 1], -pressure, rtol=1e-8)
        np.testing.assert_allclose(stress[:, 3:], 0, rtol=0, atol=1e-8 * pressure)
        nodal = file["VTKHDF/PointData/contact_pressure"][:]
        at_joint = np.abs(file["VTKHDF/Points"][:, d - 1] - 1) < 1e-9
        np.testing.assert_allclose(nodal[~at_joint], 0)
        np.testing.assert_allclose(nodal[at_joint], pressure, rtol=1e-9)
        summary = file["dotyk/summary"].attrs
        self.assertEqual(summary["converged"], 1)
        self.assertAlmostEqual(summary["max_penetration"] / (theta * pressure), 1, delta=1e-9)
        # F at the minimum is half the work of the given displacement.
        self.assertAlmostEqual(summary["energy"] / (0.5 * SHORTENING * pressure * area), 1, delta=1e-9)
        # The terms of (19): no load works, the layer stores theta p^2/2 per area, the blocks the rest.
        layer = theta * pressure**2 / 2 * area
        self.assertAlmostEqual(summary["penalty_energy"] / layer, 1, delta=1e-9)
        self.assertAlmostEqual(summary["strain_energy"] / (summary["energy"] - layer), 1, delta=1e-9)
        self.assertAlmostEqual(summary["load_work"] / summary["energy"], 0, delta=1e-9)
        self.assertEqual(set(file["VTKHDF/Types"][:].tolist()), {VTK[kind]})
        return file

    def test_plane_stress(self):
        self.check_exact("quad8", "plane_stress")

    def test_ring(self):
        file = self.check_exact("quad8", "axisymmetric", left=0.5)
        self.assertAlmostEqual(file["dotyk/contact/joint/weight"][:].sum(), np.pi * (1.5**2 - 0.5**2), delta=1e-9)

    def test_shaft(self):
        self.check_exact("tri6", "axisymmetric")

    def test_quadrature_points(self):
        """The paper's literal form is exact too."""
        for kind in ("tet4", "hex20", "tri6"):
            file = self.check_exact(kind, contact=", discretization='quadrature'")
            # 8 triangles of 3 points, 4 quadrilaterals of 9, 2 lines of 3
            self.assertEqual(file["dotyk/contact/joint/weight"].shape[0], {"tet4": 24, "hex20": 36, "tri6": 6}[kind])

    def test_rows_are_vertices(self):
        file = self.check_exact("hex27")
        joint = file["dotyk/contact/joint"]
        x = joint["position"][:]
        grid = np.array([(i, j, 2) for j in range(3) for i in range(3)]) / 2
        np.testing.assert_allclose(x[np.lexsort(x.T)], grid, atol=1e-12)
        at_end = 1 + (np.abs(x[:, :2] - 0.5) < 0.1)
        np.testing.assert_allclose(joint["weight"][:], at_end.prod(axis=1) / 16, rtol=1e-12)

    def test_given_gap(self):
        file, pressure, exact = self.column(("hex8", "hex8"), (2, 2), contact=", gap=4e-4", gap=4e-4)
        np.testing.assert_allclose(file["dotyk/contact/joint/pressure"][:], pressure, rtol=1e-9)
        np.testing.assert_allclose(file["VTKHDF/PointData/displacement"][:, 2], exact, rtol=0, atol=1e-9 * SHORTENING)

    def test_one_conforming_mesh(self):
        """The blocks share the face, and its nodes, in one mesh: each body still has nodes of its own."""
        self.write("column.geo", """
Point(1) = {0, 0, 0};
line() = Extrude {1, 0, 0} { Point{1}; Layers{2}; };
face() = Extrude {0, 1, 0} { Curve{line(1)}; Layers{2}; };
lower() = Extrude {0, 0, 1} { Surface{face(1)}; Layers{2}; };
upper() = Extrude {0, 0, 1} { Surface{lower(0)}; Layers{2}; };
e = 1e-6;
Physical Volume("lower") = {lower(1)};
Physical Volume("upper") = {upper(1)};
Physical Surface("bottom") = {face(1)};
Physical Surface("joint") = {lower(0)};
Physical Surface("top") = {upper(0)};
Physical Surface("sides x") = {Surface In BoundingBox {-e, -e, -e, e, 1 + e, 2 + e},
                               Surface In BoundingBox {1 - e, -e, -e, 1 + e, 1 + e, 2 + e}};
Physical Surface("sides y") = {Surface In BoundingBox {-e, -e, -e, 1 + e, e, 2 + e},
                               Surface In BoundingBox {-e, 1 - e, -e, 1 + e, 1 + e, 2 + e}};
""")
        text = column_nml(3).replace("upper:bottom", "upper:joint").replace("lower:top", "lower:joint")
        for name in ("lower", "upper"):
            text = text.replace("mesh='%s.geo', volume='block'" % name, "mesh='column.geo', volume='%s'" % name)
        self.write("column.nml", text)
        self.dotyk("column.nml")
        file = self.results("column.vtkhdf")
        pressure = column_exact(file["dotyk/contact/joint"].attrs["theta"])[0]
        np.testing.assert_allclose(file["dotyk/contact/joint/pressure"][:], pressure, rtol=1e-9)
        self.assertEqual(file["VTKHDF/NumberOfPoints"][:].tolist(), [27, 27])

    def check_cut(self, kinds, divisions, analysis=None, left=0.0, warp=0.0, **options):
        """Facets that those of the other mesh cut are as exact as facets that match: 1e-10, with a layer and
        without."""
        discretization = options.get("discretization", "mortar")
        for theta in (1, 0) if discretization == "mortar" else (1,):
            contact = ", theta_relative=%r, discretization='%s'" % (theta, discretization)
            file, pressure, exact = self.column(kinds, divisions, analysis, contact=contact, left=left, warp=warp)
            d = dimension(kinds[0])
            joint = file["dotyk/contact/joint"]
            u = file["VTKHDF/PointData/displacement"][:]
            np.testing.assert_allclose(u[:, d - 1], exact, rtol=0, atol=1e-10 * SHORTENING)
            for name in ("pressure", "pressure_projected"):
                np.testing.assert_allclose(joint[name][:], pressure, rtol=1e-10)
            stress = file["VTKHDF/CellData/stress"][:]
            np.testing.assert_allclose(stress[:, d - 1], -pressure, rtol=1e-9)

    def test_not_matching_hexahedra(self):
        self.check_cut(("hex8", "hex8"), (3, 4))

    def test_not_matching_quadrature_points(self):
        for kinds in (("hex20", "tet10"), ("tet4", "hex8"), ("hex27", "prism6")):
            self.check_cut(kinds, (2, 3), discretization="quadrature")

    def test_not_matching_kinds(self):
        self.check_cut(("hex20", "tet10"), (2, 3))

    def test_not_matching_orders(self):
        for kinds in (("tet4", "prism18"), ("prism15", "hex8"), ("hex27", "tet4")):
            self.check_cut(kinds, (3, 2))

    def test_not_matching_in_the_plane(self):
        for kinds in (("tri3", "quad8"), ("quad9", "tri6"), ("quad4", "quad4")):
            self.check_cut(kinds, (5, 4))
            self.check_cut(kinds, (3, 4), discretization="quadrature")

    def test_not_matching_rings(self):
        self.check_cut(("tri6", "quad4"), (3, 4), "axisymmetric", left=0.5)

    def test_facets_of_any_shape(self):
        """Quadrilaterals that are no parallelograms: their shape functions are no polynomials on the pieces."""
        for kinds in (("hex8", "hex8"), ("tet4", "hex8")):
            for discretization in ("mortar", "quadrature"):
                self.check_cut(kinds, (3, 4), discretization=discretization, warp=0.15)

    def test_nearly_matching(self):
        """Slivers between facets, of all widths."""
        for warp in (1e-4, 1e-9):
            for discretization in ("mortar", "quadrature"):
                self.check_cut(("tet4", "hex8"), (3, 3), discretization=discretization, warp=warp)

    def test_plain_quadrature(self):
        """Points on whole facets: in the mean 4e-4 in displacement and pressure, single nodes 2e-3, and single
        pressures 5e-3 (found: 2.4e-4, 1.4e-3, 4.1e-3)."""
        for kinds, divisions in ((("hex8", "hex8"), (3, 4)), (("hex20", "tet10"), (2, 3)), (("tri3", "quad8"), (5, 4))):
            file, pressure, exact = self.column(kinds, divisions, contact=", quadrature='plain'")
            d = dimension(kinds[0])
            error = (file["VTKHDF/PointData/displacement"][:, d - 1] - exact) / SHORTENING
            self.assertLess(np.sqrt(np.mean(error**2)), 4e-4)
            self.assertLess(np.abs(error).max(), 2e-3)
            self.assertGreater(np.abs(error).max(), 1e-6)
            joint = file["dotyk/contact/joint"]
            w, p = joint["weight"][:], joint["pressure"][:]
            self.assertAlmostEqual(np.sum(w * p) / np.sum(w) / pressure, 1, delta=4e-4)
            np.testing.assert_allclose(joint["pressure_projected"][:], pressure, rtol=5e-3)


for _kind in KINDS:
    setattr(Column, "test_" + _kind, lambda self, kind=_kind: (self.check_exact(kind), None)[1])

dotyk_case.main()
