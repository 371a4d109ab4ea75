#!/usr/bin/python3
"""The Python package starts ranks, and what interrupts it reaches them."""
import os
import shlex

import dotyk_case
import dotyk
from mpi_case import ENDLESS, ENVIRONMENT, MPIRUN, RankCase


class Package(RankCase):
    def setUp(self):
        super().setUp()
        before = dict(os.environ)
        os.environ.update(ENVIRONMENT)
        self.addCleanup(os.environ.update, before)

    def test_two_ranks(self):
        case, lines = self.scene(), []
        options = {"launcher": shlex.join([*MPIRUN, "-n", "2"])} if MPIRUN != ["mpirun"] else {"ranks": 2}
        results = dotyk.run(case, on_progress=lines.append, **options)
        self.assertEqual((results.run["ranks"], results.status, results.log.splitlines()), (2, "converged", lines))
        self.write("bad.nml", case.read_text().replace("young", "yuong"))
        with self.assertRaisesRegex(dotyk.Error, "bad.nml:3: &material: unknown key 'yuong'") as caught:
            dotyk.run(self.folder / "bad.nml", **options)
        self.assertEqual(caught.exception.code, 2)

    def test_an_exception_ends_ranks_with_results(self):
        def interrupt(line):
            if "iteration" in line:
                raise KeyboardInterrupt

        with self.assertRaises(KeyboardInterrupt):
            dotyk.run(self.scene(ENDLESS), on_progress=interrupt, launcher=shlex.join([*MPIRUN, "-n", "2"]))
        self.assertEqual(dotyk.Results(self.folder / "case.vtkhdf").status, "interrupted")


if __name__ == "__main__":
    dotyk_case.main()
