#!/usr/bin/python3
"""Compliance operators by solves with the factor and by their dense matrix: the same solutions, and the log says
which."""
import re

import numpy as np

import dotyk_case


class Responses(dotyk_case.Case):
    def run_form(self, name, form, solver):
        """Run an example with a form of the compliance operator; returns what is to be the same."""
        text = (dotyk_case.INPUTS / name / (name + ".nml")).read_text()
        text, n = re.subn(r"(?m)^&solver .*$", "&solver %s, %s /" % (form, solver), text)
        self.assertEqual(n, 1)
        self.write(name + "/case.nml", text)
        self.printed = self.dotyk(name + "/case.nml", "--output", "form.vtkhdf")
        file = self.results("form.vtkhdf")
        pairs = [pair["pressure"][:] for pair in file["dotyk/contact"].values()]
        return np.concatenate(pairs), file["VTKHDF/PointData/displacement"][:], file["dotyk/summary"].attrs["energy"]

    def check(self, name, solver):
        if not (self.folder / name).exists():
            self.copy(name)
        iterates = "neumann" in solver
        whole = self.run_form(name, "response='full'" if iterates else "linear_solver='iterative'", solver)
        self.assertNotIn("\n  compliance ", self.printed)
        compliance = self.run_form(name, "response='compliance'" if iterates else "linear_solver='direct'", solver)
        # The dual scheme forms the matrices that it needs itself.
        pattern = r"\n  compliance +\d+ bod(y|ies) with an explicit compliance matrix: a product costs \S+ % of a solve"
        self.assertEqual(bool(re.search(pattern, self.printed)), iterates)
        for one, two in zip(whole, compliance):
            np.testing.assert_allclose(one, two, rtol=0, atol=1e-10 * np.abs(one).max())

    def test_held_bodies(self):
        self.check("wavy", "theta_relative=0, tolerance=1e-12")
        self.check("wavy", "scheme='neumann', theta_relative=1, tolerance=1e-12")

    def test_free_bodies(self):
        self.check("receding", "theta_relative=0, tolerance=1e-12")
        self.check("bricks", "theta_relative=1e-3, tolerance=1e-12")

    def test_the_cheapest(self):
        """Many steps with few points: a matrix. The dual scheme, contact on both faces of thin plates: nothing but the
        whole factor."""
        self.copy("wavy")
        self.run_form("wavy", "response='auto'", "scheme='neumann', theta_relative=1, tolerance=1e-8")
        self.assertIn("\n  compliance ", self.printed)
        self.copy("free_stack")
        self.run_form("free_stack", "response='auto'", "theta_relative=0, tolerance=1e-8")
        self.assertNotIn("\n  compliance ", self.printed)


dotyk_case.main()
