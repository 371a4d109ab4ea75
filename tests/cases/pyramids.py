#!/usr/bin/python3
"""Pyramids between hexahedra and tetrahedra: meshes conform, displacements that the elements contain are exact, errors fall
at the order of the elements, and surfaces of triangles and quadrilaterals touch."""
import os
import sys

import numpy as np

import cylinder
import dotyk_case
import estimate_scenes
import grid
from blocks import mesh

sys.path.insert(0, str(dotyk_case.ROOT / "tools"))
import energy_norm  # noqa: E402

MIXED = ("hex8, pyramid5 and tet4", "hex20, pyramid13 and tet10", "hex27, pyramid14 and tet10")
YOUNG, POISSON = 30.0, 0.3
LAME, SHEAR = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
LINEAR = ("0.3*x-0.7*y+0.2*z", "0.5*x+0.9*y-0.4*z", "-0.6*x+0.1*y+0.8*z")
QUADRATIC = ("x^2-y*z", "x*y+0.5*z^2", "y^2+2*x*z-0.3*z^2")
# minus the divergence of its stress
FORCE = [-(LAME + SHEAR) * slope - SHEAR * second for slope, second in zip((5, 0, -0.6), (2, 1, 1.4))]
# gmsh's transition: hexahedra below, pyramids in their upper layer, tetrahedra above
TRANSITION = """
Mesh.ElementOrder = %d; Mesh.SecondOrderIncomplete = %d;
Point(1) = {0, 0, 0}; line() = Extrude {1, 0, 0} { Point{1}; Layers{3}; };
face() = Extrude {0, 1, 0} { Curve{line(1)}; Layers{3}; Recombine; };
lower() = Extrude {0, 0, 0.5} { Surface{face(1)}; Layers{2}; Recombine; };
TransfQuadTri {lower(1)};
Transfinite Volume {lower(1)};
upper() = Extrude {0, 0, 0.7} { Surface{lower(0)}; };
Physical Volume("block") = {lower(1), upper(1)};
Physical Surface("outside") = {face(1), lower({2 : 5}), upper(0), upper({2 : 5})};
"""


def wavy(x):
    """The unit cube, its inside distorted: straight edges, warped quadrilaterals."""
    bump = np.prod(np.sin(np.pi * x), axis=1)[:, None]
    return x + 0.07 * bump * [1.0, -0.8, 0.6] * np.sin(5 * x[:, [1, 2, 0]] + 1)


def skew(x):
    """A linear image of the cube."""
    return x @ np.array([[1.0, 0.2, -0.1], [0.3, 0.8, 0.2], [-0.2, 0.1, 1.2]])


class Pyramids(dotyk_case.Case):
    def check_field(self, field, surfaces, force=(0, 0, 0), close=1e-12):
        """The block of block.msh under a displacement given on its surface: that of all nodes."""
        self.write("block.nml", "&scene mesh='block.msh' /\n&material name='m', young=%r, poisson=%r /\n"
                   "&body name='block', volume='block', material='m' /\n&load body='block', force_density=%r,%r,%r /\n"
                   % (YOUNG, POISSON, *force) +
                   "".join("&support body='block', surface='%s', fix='xyz', value_formula='%s','%s','%s' /\n" % (name, *field)
                           for name in surfaces))
        self.dotyk("block.nml")
        file = self.results("block.vtkhdf")
        x, u = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
        exact = np.stack([eval(f.replace("^", "**"), dict(zip("xyz", x.T))) for f in field], axis=1)
        np.testing.assert_allclose(u, exact, rtol=0, atol=close * np.abs(exact).max())
        return file

    def block(self, kind, shape, n=(3, 3, 4)):
        """Mesh of a block; surfaces of its sides."""
        grid.write_mesh(self.folder / "block.msh", [grid.Block("block", *(grid.even(0, 1, m) for m in n), shape=shape)], kind)
        return "bottom", "top", "sides x", "sides y"

    def test_patch_test(self):
        for kind in MIXED:
            with self.subTest(kind):
                file = self.check_field(LINEAR, self.block(kind, wavy))
                self.assertEqual(len(set(file["VTKHDF/Types"][:].tolist())), 3)
                h = np.array([[0.3, -0.7, 0.2], [0.5, 0.9, -0.4], [-0.6, 0.1, 0.8]])
                s = SHEAR * (h + h.T) + LAME * np.trace(h) * np.eye(3)
                stress = file["VTKHDF/CellData/stress"][:]
                expected = np.broadcast_to([s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[1, 2], s[0, 2]], stress.shape)
                np.testing.assert_allclose(stress, expected, rtol=0, atol=1e-11 * np.abs(s).max())

    def test_quadratic_displacements(self):
        for kind in MIXED[1:]:
            with self.subTest(kind):
                file = self.check_field(QUADRATIC, self.block(kind, skew), FORCE)
                self.assertLess(file["dotyk/summary"].attrs["error_discretization"], 1e-9)

    def test_meshes_of_gmsh(self):
        for order, incomplete in ((1, 0), (2, 1), (2, 0)):
            with self.subTest(order=order, incomplete=incomplete):
                mesh(self.write("block.geo", TRANSITION % (order, incomplete)), 3)
                file = self.check_field(LINEAR, ["outside"])
                types = set(file["VTKHDF/Types"][:].tolist())
                self.assertEqual(types, {1: {10, 12, 14}, 2: {24, 27, 29 - 4 * incomplete}}[order])
                # the whole block, nothing twice
                norm = file["dotyk/summary"].attrs["energy_norm"]
                h = np.array([[0.3, -0.7, 0.2], [0.5, 0.9, -0.4], [-0.6, 0.1, 0.8]])
                strain = (h + h.T) / 2
                self.assertAlmostEqual(norm**2 / (1.2 * (2 * SHEAR * (strain**2).sum() + LAME * np.trace(h)**2)), 1, delta=1e-11)

    def test_faces_with_other_nodes_are_refused(self):
        """Bases of eight nodes on faces of nine."""
        self.block(MIXED[2], None)
        path = self.folder / "block.msh"
        lines = [line.split() for line in path.read_text().split("\n")]
        path.write_text("\n".join(" ".join([*line[:1], "19", *line[2:-1]] if len(line) > 15 and line[1] == "14" else line) for line in lines))
        self.write("block.nml", "&scene mesh='block.msh' /\n&material name='m', young=1, poisson=0.3 /\n"
                   "&body name='block', volume='block', material='m' /\n&support body='block', surface='bottom', fix='xyz' /\n")
        self.assertIn("have other nodes on their common face (18 such faces)", self.dotyk("block.nml", code=2))

    def test_energy_norm_of_results(self):
        """tools/energy_norm.py finds the fourteenth node, which no cell of VTK has."""
        for kind in MIXED[1:]:
            with self.subTest(kind):
                file = self.check_field(QUADRATIC, self.block(kind, skew), FORCE)
                norm = file["dotyk/summary"].attrs["energy_norm"]
                results = energy_norm.Results(self.folder / "block.vtkhdf")
                self.assertEqual({block.kind.name for block in results.blocks}, set(kind.replace(" and", ",").split(", ")))
                self.assertAlmostEqual(energy_norm.energy_norm(results) / norm, 1, delta=1e-11)
                for block in results.blocks:
                    # the field, not only its energy
                    for xi in block.kind.quadrature(2)[0]:
                        shape = block.kind.shapes(xi[None])[0]
                        x, u = (np.einsum("n,cni->ci", shape, field[block.nodes]) for field in (results.points, results.displacement))
                        exact = np.stack([eval(f.replace("^", "**"), dict(zip("xyz", x.T))) for f in QUADRATIC], axis=1)
                        np.testing.assert_allclose(u, exact, rtol=0, atol=1e-11)
                self.assertLess(energy_norm.distance_meshes(results, results), 1e-9 * norm)

    def test_orders_and_estimates(self):
        """Errors of linear elements fall as h, of quadratic ones as h^2, and estimates are near them."""
        dotyk = os.environ["DOTYK"]
        exact = estimate_scenes.reference(self.folder, dotyk, "smooth")
        for kind in (*MIXED, "pyramid5", "pyramid13", "pyramid14"):
            with self.subTest(kind):
                coarse, fine = (estimate_scenes.ratio(self.folder, dotyk, "smooth", kind, n, exact) for n in (4, 8))
                self.assertBetween(0.85, np.log2(coarse[0] / fine[0]) / grid.KINDS[kind][2], 1.3)
                self.assertBetween(0.9, fine[1], 1.4)

    def test_free_expansion(self):
        """Temperatures that are constant, and in quadratic elements linear, make no stress."""
        for kind in MIXED:
            t = 30.0 * (kind != MIXED[0])
            u = ["1e-5*(80*x+%r*(x^2-y^2-z^2)/2)" % t, "1e-5*(80*y+%r*x*y)" % t, "1e-5*(80*z+%r*x*z)" % t]
            self.block(kind, skew if t else wavy)
            self.write("block.nml", "&scene mesh='block.msh' /\n&material name='m', young=%r, poisson=%r, expansion=1e-5 /\n"
                       "&body name='block', volume='block', material='m' /\n&temperature body='block', formula='80+%r*x' /\n"
                       "&support body='block', surface='bottom', fix='xyz', value_formula='%s','%s','%s' /\n" % (YOUNG, POISSON, t, *u))
            self.dotyk("block.nml")
            file = self.results("block.vtkhdf")
            with self.subTest(kind):
                x, found = file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:]
                exact = np.stack([eval(f.replace("^", "**"), dict(zip("xyz", x.T))) for f in u], axis=1)
                np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12 * np.abs(exact).max())
                np.testing.assert_allclose(file["VTKHDF/CellData/stress"][:], 0, rtol=0, atol=1e-11 * YOUNG * 1e-3)
            file.close()

    def test_nearly_incompressible(self):
        """The thick cylinder: errors stay near those that the same mesh has at Poisson's ratio 0.3."""
        sides = {"inside": lambda p: np.all(p[:, 0] == 1), "outside": lambda p: np.all(p[:, 0] == 2),
                 "along x": lambda p: np.all(p[:, 1] == 0), "along y": lambda p: np.all(p[:, 1] == 1),
                 "ends": lambda p: True}
        block = grid.Block("tube", grid.even(1, 2, 3), grid.even(0, 1, 4), grid.even(0, cylinder.HEIGHT, 4), patches=sides,
                           shape=lambda x: np.stack([x[:, 0] * np.cos(np.pi / 2 * x[:, 1]), x[:, 0] * np.sin(np.pi / 2 * x[:, 1]),
                                                     x[:, 2]], axis=1))
        # Measured: 0.3 to 1.3 and 0.1 to 2.9 times the errors at 0.3; with locking='ignore' the least are 2.1 and 17.
        for kind in (*MIXED, "pyramid5", "pyramid13", "pyramid14"):
            grid.write_mesh(self.folder / "tube.msh", [block], kind)
            errors = []
            for poisson in (0.3, 0.4999):
                self.write("tube.nml", cylinder.scene("3d", poisson))
                log = self.dotyk("tube.nml")
                self.assertEqual("elevated" in log, poisson > 0.4 and grid.KINDS[kind][2] == 1)
                file = self.results("tube.vtkhdf")
                mean = file["VTKHDF/CellData/stress"][:, :3].mean(axis=1)
                errors.append((cylinder.radial_error(file["VTKHDF/Points"][:], file["VTKHDF/PointData/displacement"][:], "3d", poisson),
                               np.abs(mean - cylinder.mean_stress(poisson)).max()))
                file.close()
            with self.subTest(kind):
                self.assertLess(errors[1][0], 1.5 * errors[0][0])
                self.assertLess(errors[1][1], 4 * errors[0][1])


class Contact(dotyk_case.Case):
    YOUNG, POISSON = (30.0, 210.0), (0.2, 0.3)

    def block(self, name, kind, n, low, joint):
        """A block of height 1 whose side 0 or 1 along the lines' first direction, at the height `joint`, is the joint."""
        def at(axis, value):
            return lambda p: bool(np.all(np.abs(p[:, axis] - value) < 1e-9))

        sides = {"joint": at(0, joint), "wall": at(0, 1 - joint)}
        sides.update({"sides %s" % axis: lambda p, k=k: at(k, 0)(p) or at(k, 1)(p) for k, axis in ((1, "y"), (2, "x"))})
        # lines along -z, y, x, the height from above: hexahedra, pyramids and tetrahedra side by side
        block = grid.Block(name, *(grid.even(0, 1, m) for m in n), patches=sides,
                           shape=lambda x: np.stack([x[:, 2], x[:, 1], low + 1 - x[:, 0]], axis=1))
        grid.write_mesh(self.folder / (name + ".msh"), [block], kind)

    def check(self, lower, upper, n_lower, n_upper):
        """Uniform pressure, exact to round-off. Kinds of elements and their numbers; returns the numbers of facets."""
        self.block("lower", lower, n_lower, 0, 0)
        self.block("upper", upper, n_upper, 1, 1)
        text = ""
        for name, young, poisson in zip(("lower", "upper"), self.YOUNG, self.POISSON):
            text += ("&material name='%s', young=%r, poisson=%r /\n&body name='%s', mesh='%s.msh', volume='%s', material='%s' /\n"
                     % (name, young, poisson, *[name] * 4))
            text += "".join("&support body='%s', surface='sides %s', fix='%s' /\n" % (name, k, k) for k in "xy")
        self.write("column.nml", "&scene analysis='3d' /\n" + text + "&support body='lower', surface='wall', fix='z' /\n"
                   "&support body='upper', surface='wall', fix='z', value=0,0,-1e-3 /\n"
                   "&contact name='joint', surface_a='upper:joint', surface_b='lower:joint' /\n"
                   "&solver theta_relative=1, tolerance=1e-12 /\n")
        self.dotyk("column.nml")
        joint = self.results("column.vtkhdf")["dotyk/contact/joint"]
        stiffness = [e * (1 - v) / ((1 + v) * (1 - 2 * v)) for e, v in zip(self.YOUNG, self.POISSON)]
        pressure = 1e-3 / (1 / stiffness[0] + 1 / stiffness[1] + joint.attrs["theta"])
        np.testing.assert_allclose(joint["pressure"][:], pressure, rtol=1e-9)

    def test_triangles_and_quadrilaterals(self):
        for lower, upper in zip(MIXED, MIXED[1:] + MIXED[:1]):
            with self.subTest(lower):
                self.check(lower, upper, (2, 3, 4), (2, 2, 4))

    def test_bases_and_flanks(self):
        """Blocks of pyramids: of odd numbers of cells one has triangles on the joint, the other bases."""
        for kind in ("pyramid5", "pyramid13", "pyramid14"):
            with self.subTest(kind):
                self.check(kind, kind, (3, 3, 3), (3, 2, 2))


if __name__ == "__main__":
    dotyk_case.main()
