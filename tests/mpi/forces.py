"""Forces, moments, energies and nodal reactions on ranks are those of one process: of bodies that each rank has its own of, and of bodies
that are split.
"""
import os

import h5py
import numpy as np

import dotyk_case
from blocks import block_geo
from mpi_case import RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]


class Forces(RankCase):
    def scene(self, response):
        """A block on a block, which is held by a floor and a wall that share an edge, under loads on surfaces and in the volume."""
        lines = ["&scene /", "&material name='m', young=200, poisson=0.3 /"]
        for name, n, origin, size in (("lower", (5, 4, 4), (1, 2, 0), (2, 2, 1)), ("upper", (4, 4, 3), (1.3, 2.3, 1), (1.4, 1.4, 0.5))):
            self.write(name + ".geo", block_geo("hex20", n, origin, size))
            lines.append("&body name='%s', mesh='%s.geo', volume='block', material='m' /" % (name, name))
        lines += ["&support body='lower', surface='bottom', fix='xyz' /", "&support body='lower', surface='sides x', fix='x' /",
                  "&load body='upper', surface='top', pressure_formula='0.1*(1+0.5*(x-2))' /",
                  "&load body='*', force_density=0,0,-0.01 /", "&load body='lower', surface='sides y', traction=0.01,0.02,0 /",
                  "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                  "&solver theta=0, tolerance=1e-8, response='%s' /" % response, "&output fields='displacement contact reaction nodal_stress', error_parts='' /"]
        return self.write("%s.nml" % response, "\n".join(lines) + "\n")

    def numbers(self, ranks, namelist):
        """All forces of the results on ranks, by names."""
        path = self.folder / ("%d.vtkhdf" % ranks)
        printed = self.run_ranks(ranks, namelist, "--output", path)
        found = {}
        with h5py.File(path) as file:
            for group in ("supports", "loads", "bodies"):
                found.update(("%s/%s" % (group, name), array[()]) for name, array in file["dotyk"][group].items())
            for name in ("force", "moment", "centre_of_pressure", "contact_area", "peak_pressure", "peak_position", "least_gap"):
                found[name] = file["dotyk/contact/joint"].attrs[name]
            for name in ("reaction_force", "contact_traction", "contact_gap", "contact_status", "nodal_stress"):
                found[name] = file["VTKHDF/PointData"][name][()]
            errors = [file["dotyk/bodies"].attrs[name] for name in ("force_error", "moment_error")]
        return found, errors, printed

    def compare(self, response, tolerance, text):
        exact, errors, _ = self.numbers(1, self.scene("full"))
        self.assertLess(max(errors), 1e-9)
        for ranks in RANKS:
            found, errors, printed = self.numbers(ranks, self.scene(response))
            self.assertIn(text, printed)
            self.assertLess(max(errors), 1e-6)
            self.assertEqual(set(found), set(exact))
            for name, array in exact.items():
                if name == "least_gap":
                    self.assertLess(abs(found[name]), 1e-8)
                    continue
                np.testing.assert_allclose(found[name], array, atol=tolerance * np.nanmax(np.abs(array)) + 1e-9, err_msg=name)

    def test_bodies_of_their_own_ranks(self):
        self.compare("full", 1e-9, "ranks")

    def test_split_bodies(self):
        self.compare("multigrid", 1e-5, "all bodies are split over")


if __name__ == "__main__":
    dotyk_case.main()
