"""Stresses at nodes: those of Lame's tubes at their surfaces, where they converge faster than the means of elements,
and those of uniform stress in rotated copies with temperatures and initial stresses."""
import pathlib
import re
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import blocks  # noqa: E402
from dotyk_case import INPUTS, Case, main  # noqa: E402

sys.path.insert(0, str(INPUTS / "press_fit"))
import check  # noqa: E402

NAMES = {"nodal_stress", "nodal_von_mises", "nodal_principal_stress"}


def mises(stress):
    xx, yy, zz, xy, yz, xz = np.asarray(stress).T
    return np.sqrt(((xx - yy)**2 + (yy - zz)**2 + (zz - xx)**2) / 2 + 3 * (xy**2 + yz**2 + xz**2))


def principal(stress):
    xx, yy, zz, xy, yz, xz = np.asarray(stress).T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.linalg.eigvalsh(np.moveaxis(tensor, 2, 0))[:, ::-1]


class NodalStress(Case):
    def test_tubes(self):
        """The press fit of two tubes: nodal stresses against Lame at the bore, at both sides of the joint (one-sided: the hoop stress
        jumps there) and outside, of linear and quadratic elements on two meshes; the least hoop stress of a cell for comparison."""
        self.copy("press_fit")
        geo = (self.folder / "press_fit/press_fit.geo").read_text()
        for order, limit, least_ratio in ((1, 0.04, 3), (2, 0.006, 3.5)):
            worst, of_cells = [], []
            for n in (8, 16):
                text, changes = re.subn(r"^h = a/4;", "h = a/%d;" % n, geo, flags=re.M)
                text, more = re.subn(r"^order = 2", "order = %d" % order, text, flags=re.M)
                self.assertEqual(changes + more, 2)
                self.write("press_fit/press_fit.geo", text)
                self.dotyk("press_fit/press_fit.nml", "--output", "tubes.vtkhdf")
                with self.results("tubes.vtkhdf") as file:
                    x, stress = file["VTKHDF/Points"][:], file["VTKHDF/PointData/nodal_stress"][:]
                    body = np.repeat([1, 2], file["VTKHDF/NumberOfPoints"][:])
                    exact = check.exact_stress(x[:, 0], x[:, 1], body=body).T
                    cells = file["VTKHDF/CellData/stress"][:]
                    np.testing.assert_allclose(file["VTKHDF/PointData/nodal_von_mises"][:], mises(stress), rtol=1e-12)
                    np.testing.assert_allclose(file["VTKHDF/PointData/nodal_principal_stress"][:], principal(stress),
                                               atol=1e-12 * abs(stress).max())
                radius = np.hypot(x[:, 0], x[:, 1])
                surface = np.min([abs(radius - r) for r in (10, 20, 30)], axis=0) < 1e-6 * radius
                if order == 1:
                    # Nodes of linear elements are on the circles, too.
                    self.assertGreater(surface.sum(), 20)
                scale = abs(exact).max()
                worst.append(abs(stress - exact)[surface].max() / scale)
                of_cells.append(abs(cells.min() - exact.min()) / scale)
            with self.subTest(order=order, worst=worst, of_cells=of_cells):
                self.assertLess(worst[0], limit)
                self.assertGreater(worst[0] / worst[1], least_ratio)
                self.assertBetween(1.7, of_cells[0] / of_cells[1], 2.3)
                self.assertLess(worst[1], 0.5 * of_cells[1])

    def test_nearly_incompressible(self):
        """A rotating cylinder between walls, s_r ~ 1 - r^2: of second order in quadratic elements whose dilatation is constant."""
        for kind in "quad8", "tri6":
            errors = []
            for n in 6, 12:
                self.write("disc.geo", blocks.block_geo(kind, (n, 2), (0, 0), (1, 1.2 / n)))
                self.write("disc.nml", "&scene analysis='axisymmetric', mesh='disc.geo' /\n"
                           "&material name='rubber', young=200, poisson=0.4999, density=1 /\n"
                           "&body name='disc', volume='block', material='rubber' /\n"
                           "&support body='disc', surface='bottom', fix='y' /\n&support body='disc', surface='top', fix='y' /\n"
                           "&load body='disc', angular_velocity=1 /\n")
                self.dotyk("disc.nml")
                file = self.results("disc.vtkhdf")["VTKHDF"]
                radius, k = file["Points"][:, 0], 1 / (8 * (1 - 0.4999))
                radial = k * (3 - 2 * 0.4999) * (1 - radius**2)
                errors.append(np.abs(file["PointData/nodal_stress"][:, 0] - radial).max() / radial.max())
            self.assertLess(errors[1], 0.015, kind)
            self.assertGreater(errors[0] / errors[1], 2.5, kind)

    def test_rotated_copies(self):
        """Congruent bodies, the second rotated, of an orthotropic material that expands differently along its axes, hot and with an
        initial stress of global axes: at the nodes the uniform stress of the cells."""
        self.write("block.geo", blocks.block_geo("tet10", 2, (0, 0, 0), (1, 1, 1)))
        self.write("copies.nml", "\n".join([
            "&scene mesh='block.geo' /",
            "&material name='wood', young=10, 1, 2, poisson=0.1, 0.2, 0.3, shear=0.6, 0.5, 0.4, "
            "expansion=1e-3, 2e-3, 3e-3, axis_1=1,0.5,0, axis_2=0,0,1 /",
            "&body name='straight', volume='block', material='wood' /",
            "&body name='rotated', volume='block', material='wood', at=9,0,0, axis=1,1,0, angle=40 /",
            "&support body='*', surface='bottom', fix='xyz', value_formula='1e-3*x', '0', '2e-3*y+1e-3*z' /",
            "&support body='*', surface='sides *', fix='xyz', value_formula='1e-3*x', '0', '2e-3*y+1e-3*z' /",
            "&support body='*', surface='top', fix='xyz', value_formula='1e-3*x', '0', '2e-3*y+1e-3*z' /",
            "&temperature body='*', value=3 /",
            "&initial_stress body='rotated', value=0.1, 0.2, 0.3, 0.4, 0.5, 0.6 /"]) + "\n")
        self.dotyk("copies.nml")
        with self.results("copies.vtkhdf") as file:
            nodal, cells = file["VTKHDF/PointData/nodal_stress"][:], file["VTKHDF/CellData/stress"][:]
            n, m = file["VTKHDF/NumberOfPoints"][0], file["VTKHDF/NumberOfCells"][0]
            self.assertEqual(file["dotyk/summary/congruence_class"][:].tolist(), [1, 1])
        for first, of_cell in ((nodal[:n], cells[0]), (nodal[n:], cells[m])):
            np.testing.assert_allclose(first, of_cell + 0 * first, atol=1e-10)
        self.assertGreater(abs(cells[0] - cells[m]).min(), 1e-4)

    def test_not_written(self):
        """Fields that are not asked for are absent; nodal stresses alone are computed without the others."""
        for name in ("lower", "upper"):
            self.write(name + ".geo", blocks.block_geo("hex8", 2, (0, 0, 1.0 * (name == "upper"))))
        self.write("column.nml", blocks.column_nml(3, output="fields='displacement stress contact error reaction'"))
        self.dotyk("column.nml")
        with self.results("column.vtkhdf") as file:
            self.assertFalse(NAMES & set(file["VTKHDF/PointData"]))
            stress = file["VTKHDF/CellData/stress"][:]
        self.write("column.nml", blocks.column_nml(3, output="fields='nodal_stress', error_parts=''"))
        self.dotyk("column.nml")
        with self.results("column.vtkhdf") as file:
            self.assertEqual(set(file["VTKHDF/PointData"]), NAMES | {"node_tag"})
            nodal = file["VTKHDF/PointData/nodal_stress"][:]
        # The material of the upper block is another one: one half of the nodes and cells for each.
        for at_nodes, of_cells in zip(np.split(nodal, 2), np.split(stress, 2)):
            np.testing.assert_allclose(at_nodes, of_cells[0] + 0 * at_nodes, atol=1e-8 * abs(stress).max())


main()
