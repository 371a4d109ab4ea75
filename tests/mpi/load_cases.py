"""Load cases on ranks are those of one process: loads, given displacements, temperatures, gaps, error estimates;
bodies that would be split are not."""
import os

import h5py
import numpy as np

import dotyk_case
from blocks import block_geo
from mpi_case import RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]
NAMES = "pressed", "moved", "hot"


class LoadCases(RankCase):
    def scene(self, response):
        """Three blocks on each other, congruent the upper two, which float but for walls."""
        lines = ["&scene /", "&material name='m', young=200, poisson=0.3, expansion=1e-4 /", *("&case name='%s' /" % name for name in NAMES)]
        for name, n, z in (("lower", (4, 3, 3), 0), ("upper", (3, 3, 2), 1)):
            self.write(name + ".geo", block_geo("hex20", n, (0, 0, z), (1, 1, 1)))
        for name, mesh, at in (("lower", "lower", 0), ("middle", "upper", 0), ("top", "upper", 1)):
            lines.append("&body name='%s', mesh='%s.geo', volume='block', material='m', at=0,0,%d /" % (name, mesh, at))
        lines += ["&support body='lower', surface='bottom', fix='xyz', value=0,0,1e-3, case='moved' /",
                  "&support body='middle', surface='sides x', fix='x', value=2e-3,0,0, case='moved' /",
                  "&support body='top', surface='sides x', fix='x' /", "&support body='middle', surface='sides y', fix='y' /",
                  "&support body='top', surface='sides y', fix='y' /",
                  "&load body='top', surface='top', pressure=0.5 /", "&load body='top', surface='top', pressure_formula='3*x-1', case='pressed' /",
                  "&load body='middle', force_density=0,0.1,-0.2, case='p*', 'hot' /", "&temperature body='middle', value=3, case='hot' /",
                  "&contact name='one', surface_a='lower:top', surface_b='middle:bottom' /",
                  "&contact name='two', surface_a='middle:top', surface_b='top:bottom' /",
                  "&contact_case case='hot', contact='two', gap_formula='1e-3*x' /",
                  "&solver theta=0, tolerance=1e-8, response='%s' /" % response]
        return self.write("%s.nml" % response, "\n".join(lines) + "\n")

    def numbers(self, ranks, namelist):
        """Fields and forces of all cases, and what was printed."""
        path = self.folder / ("%d.vtkhdf" % ranks)
        printed = self.run_ranks(ranks, namelist, "--output", path)
        with h5py.File(path) as file:
            found = {name: file["VTKHDF"][place][name][()] for place in ("PointData", "CellData") for name in file["VTKHDF"][place]}
            for case in NAMES:
                for group in ("supports", "loads", "bodies", "contact/one", "contact/two"):
                    for name, array in file["dotyk/cases"][case][group].items():
                        found["%s/%s/%s" % (case, group, name)] = array[()]
                errors = file["dotyk/cases"][case]["summary"].attrs
                found.update({"%s/%s" % (case, name): errors[name] for name in ("error_discretization", "error_discretization_bodies", "error_penalty")
                              if name in errors})
        return found, printed

    def compare(self, response, tolerance):
        exact, _ = self.numbers(1, self.scene("full"))
        for ranks in RANKS:
            found, printed = self.numbers(ranks, self.scene(response))
            self.assertEqual(set(found), set(exact))
            for name, array in exact.items():
                size = max(np.nanmax(np.abs(array), initial=0), 1e-3 if "gap" in name or "penetration" in name else 1)
                np.testing.assert_allclose(found[name], array, atol=tolerance * size, err_msg=name)
            self.assertNotIn("are split", printed)
            self.assertEqual(printed.count("there are load cases: bodies are not split"), 1 if response == "multigrid" else 0)

    def test_bodies_of_their_own_ranks(self):
        self.compare("full", 1e-9)

    def test_no_split_bodies(self):
        """What would be split for one case has factors on a rank each, and the log says so."""
        self.compare("multigrid", 1e-9)


if __name__ == "__main__":
    dotyk_case.main()
