#!/usr/bin/python3
"""The error budget: what is reported, how near it is to the truth, and the rules that use it."""
import re
import sys

import numpy as np

import dotyk_case

sys.path[:0] = [str(dotyk_case.ROOT / "tools"), str(dotyk_case.ROOT / "studies")]
import energy_norm  # noqa: E402
import convergence  # noqa: E402


class ErrorBudget(dotyk_case.Case):
    def example(self, name, solver="", refine=1, order=2, **groups):
        """Run an example with another &solver group and mesh; its results file."""
        folder = self.folder / name
        if not folder.exists():
            self.copy(name)
        geo = (dotyk_case.INPUTS / name / (name + ".geo")).read_text()
        if name != "column":
            geo = convergence.set_parameter(convergence.set_parameter(geo, "h", "%g*({})" % refine), "order",
                                            str(order))
        (folder / (name + ".geo")).write_text(geo)
        text, n = re.subn(r"(?m)^&solver .*$", "&solver %s /" % solver if solver else "",
                          (dotyk_case.INPUTS / name / (name + ".nml")).read_text())
        self.assertEqual(n, 1)
        for group, keys in groups.items():
            text += "\n&%s %s /\n" % (group, keys)
        (folder / "case.nml").write_text(text)
        self.printed = self.dotyk("%s/case.nml" % name)
        self.path = str(folder / "case.vtkhdf")
        return self.results("%s/case.vtkhdf" % name)

    def test_discretization(self):
        """Against exact stresses; the estimate tends to the truth as h does to 0."""
        for name, order, refine, low, high in (("wavy", 1, 1, 0.9, 1.1), ("wavy", 2, 1, 0.9, 1.15),
                                               ("groove_row", 1, 2, 0.9, 1.1), ("groove_row", 2, 2, 0.9, 1.15),
                                               ("press_fit", 1, 0.5, 0.9, 1.1), ("press_fit", 2, 0.5, 0.9, 1.1)):
            file = self.example(name, "theta_relative=0", refine, order)
            check = convergence.load(self.folder / name / "check.py")
            truth = energy_norm.error(self.path, check.exact_stress) / energy_norm.energy_norm(self.path)
            ratio = file["dotyk/summary"].attrs["error_discretization"] / truth
            self.assertBetween(low, ratio, high, (name, order))

    def test_soft_layer(self):
        """A gasket between blocks: what the penalty lets the upper block sink has no energy. Uniaxial strain is exact."""
        height, young, pressure = (1.0, 0.05, 1.0), (2000.0, 1.0, 2000.0), 1e-3
        geo, text, z = 'SetFactory("OpenCASCADE");\n', "&scene analysis='plane_strain', mesh='stack.geo' /\n", 0.0
        for k, h in enumerate(height):
            geo += ("Rectangle(%d) = {0, %r, 0, 1, %r}; Recombine Surface{%d}; Physical Surface(\"b%d\") = {%d};\n"
                    % (k+1, z, h, k+1, k+1, k+1))
            for side, name in enumerate(("low", "right", "up", "left")):
                geo += 'Physical Curve("%s%d") = {%d};\n' % (name, k+1, 4*k + side + 1)
            geo += "Transfinite Curve{%d, %d} = %d; Transfinite Curve{%d, %d} = %d; Transfinite Surface{%d};\n" % (
                4*k + 1, 4*k + 3, 6 + k, 4*k + 2, 4*k + 4, 2 if h < 0.5 else 5, k+1)
            text += ("&material name='m%d', young=%r, poisson=0.3 /\n&body name='b%d', volume='b%d', material='m%d' /\n"
                     "&support body='b%d', surface='left%d', fix='x' /\n&support body='b%d', surface='right%d', fix='x' /\n"
                     % (k+1, young[k], k+1, k+1, k+1, k+1, k+1, k+1, k+1))
            z += h
        text += ("&support body='b1', surface='low1', fix='xy' /\n&load body='b3', surface='up3', pressure=%r /\n"
                 "&contact auto=.true. /\n" % pressure)
        self.write("stack.geo", geo)
        oedometer = 0.7/(1.3*0.4)
        exact = -pressure*sum(h/(e*oedometer) for h, e in zip(height, young))
        self.write("stack.nml", text)
        printed = self.dotyk("stack.nml")
        file = self.results("stack.vtkhdf")
        top = file["VTKHDF/Points"][:, 1] > 2.0499
        self.assertLess(abs(file["VTKHDF/PointData/displacement"][:][top, 1].mean()/exact - 1), 1e-6)
        self.assertNotIn("the penalty term is", "".join(re.findall("warning.*", printed)))
        self.write("stack.nml", text + "&solver theta=0.01 /\n")
        self.assertRegex(self.dotyk("stack.nml"), r"warning +the penalty term is \d+ % of the strain energy")

    def test_discretization_field(self):
        """Squares of the elements add up to those of the bodies, and these to the whole; it is largest where the mesh
        is too coarse."""
        file = self.example("wavy", refine=2)
        summary = file["dotyk/summary"].attrs
        cells = file["VTKHDF/CellData/discretization_error"][:]
        body = file["VTKHDF/CellData/body"][:]
        of_bodies = [np.linalg.norm(cells[body == b]) for b in (1, 2)]
        np.testing.assert_allclose(summary["error_discretization_bodies"], of_bodies, rtol=1e-12)
        self.assertAlmostEqual(np.linalg.norm(of_bodies) / summary["error_discretization"], 1, delta=1e-12)
        self.assertAlmostEqual(summary["energy_norm"] / energy_norm.energy_norm(self.path), 1, delta=1e-9)
        # True errors of the cells: the same ones are large.
        check = convergence.load(self.folder / "wavy" / "check.py")
        _, true = energy_norm.error(self.path, check.exact_stress, cells=True)
        self.assertGreater(np.corrcoef(true, cells)[0, 1], 0.9)

    def test_no_discretization_error(self):
        """A uniform stress: nothing but rounding."""
        summary = self.example("column", "theta_relative=1e-3").get("dotyk/summary").attrs
        self.assertLess(summary["error_discretization"], 1e-12)
        self.assertLess(summary["error_contact"], 1e-6)

    def test_penalty(self):
        """The distance to the answer without penalty, for each kind of points and for another scheme."""
        for solver in ("theta_mesh=1, tolerance=1e-10", "theta_mesh=0.1, tolerance=1e-10",
                       "scheme='neumann', theta_mesh=0.3, tolerance=1e-9"):
            self.example("wavy", "theta_relative=0, tolerance=1e-10", 2)
            exact = self.path.replace("case", "exact")
            (self.folder / "wavy/case.vtkhdf").rename(exact)
            file = self.example("wavy", solver, 2)
            truth = energy_norm.distance(self.path, exact) / energy_norm.energy_norm(self.path)
            self.assertAlmostEqual(file["dotyk/summary"].attrs["error_penalty"] / truth, 1, delta=1e-4, msg=solver)

    def test_newcomer(self):
        """Neither theta nor tolerance: the mesh makes the error."""
        for name in ("wavy", "column", "receding"):
            if name == "receding":
                self.copy(name)
                text = (self.folder / "receding/receding.nml").read_text()
                self.write("receding/case.nml", re.sub(r"(?m)^&solver .*$", "", text))
                self.printed = self.dotyk("receding/case.nml")
                file = self.results("receding/case.vtkhdf")
            else:
                file = self.example(name)
            summary = file["dotyk/summary"].attrs
            self.assertEqual(summary["converged"], 1)
            self.assertLessEqual(summary["error_bound"], 1e-6)
            self.assertEqual(summary["error_penalty"], 0)
            self.assertRegex(self.printed,
                             r"\n  relative error +iteration <= \S+ %, discretization ~ \S+ %, largest in '")

    def test_theta_of_the_mesh(self):
        """theta_mesh (h_a/E_a + h_b/E_b), point by point."""
        file = self.example("wavy", "theta_mesh=0.2, tolerance=1e-9")
        wave = file["dotyk/contact/wave"]
        x, theta = wave["position"][:, 0], wave["theta"][:]
        h = np.diff(np.sort(x)).mean()
        self.assertAlmostEqual(wave.attrs["theta"] / (0.2 * 2 * h), 1, delta=1e-6)
        np.testing.assert_allclose(theta, 0.2 * 2 * h, rtol=1e-6)
        np.testing.assert_allclose(wave["pressure"][:], np.maximum(0, -wave["gap"][:]) / theta,
                                   atol=1e-9 * wave["pressure"][:].max())
        # E of one side times ten, by a formula.
        text = (self.folder / "wavy/case.nml").read_text()
        text = text.replace("&body     name='lower', volume='lower', material='unit' /",
                            "&material name='stiff', young=1, poisson=0.3, young_formula='10+0*x' /\n"
                            "&body     name='lower', volume='lower', material='stiff' /")
        self.write("wavy/case.nml", text)
        self.dotyk("wavy/case.nml")
        np.testing.assert_allclose(self.results("wavy/case.vtkhdf")["dotyk/contact/wave/theta"][:], 0.2 * 1.1 * h,
                                   rtol=1e-6)

    def test_what_is_not_asked_for(self):
        """No parts of the error, no time for them."""
        file = self.example("wavy", "theta_mesh=0.1, tolerance=1e-9", output="fields='displacement', error_parts=''")
        summary = file["dotyk/summary"].attrs
        for name in ("error_penalty", "error_discretization", "error_contact"):
            self.assertUnknown(summary[name], name)
        self.assertNotIn("discretization_error", file["VTKHDF/CellData"])
        self.assertLess(file["dotyk/timing"].attrs["estimate"], 1e-3)
        self.assertRegex(self.printed, r"\n  relative error +iteration <= \S+ %\n")
        file = self.example("wavy", "theta_mesh=0.1, tolerance=1e-9", output="error_parts='penalty'")
        self.assertUnknown(file["dotyk/summary"].attrs["error_discretization"])
        self.assertGreater(file["dotyk/summary"].attrs["error_penalty"], 0)

    def test_far_from_the_end(self):
        """An iteration that got nowhere: its answer's other errors are not known."""
        self.copy("wavy")
        text = (self.folder / "wavy/wavy.nml").read_text()
        for solver in ("gamma_rule='fixed', gamma=10, theta_relative=1e-1",
                       "scheme='neumann', theta_relative=1e-2, max_iterations=1"):
            self.write("wavy/case.nml", re.sub(r"(?m)^&solver .*$", "&solver %s /" % solver, text))
            printed = self.dotyk("wavy/case.nml", code=1)
            self.assertRegex(printed, "penalty unknown, discretization unknown\n")
            file = self.results("wavy/case.vtkhdf")
            self.assertUnknown(file["dotyk/summary"].attrs["error_penalty"])
            self.assertUnknown(file["dotyk/summary"].attrs["error_discretization"])
            self.assertUnknown(file["VTKHDF/CellData/discretization_error"][:])
            file.close()

    def test_contradictions(self):
        self.copy("wavy")
        text = (self.folder / "wavy/wavy.nml").read_text()
        for solver, message in (("theta=1, theta_mesh=1", "theta and theta_mesh are both given"),
                                ("scheme='dual', stop_rule='paper'", "stop_rule='paper' is for scheme='neumann'")):
            self.write("wavy/case.nml", re.sub(r"(?m)^&solver .*$", "&solver %s /" % solver, text))
            self.assertIn(message, self.dotyk("wavy/case.nml", code=2))


dotyk_case.main()
