"""Bodies of several materials on ranks: displacements, stresses, materials and energies are those of one process, of bodies that each rank
has its own of, and of bodies that are split.
"""
import os

import h5py
import numpy as np

import dotyk_case
import grid
from mpi_case import RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]
FIELDS = ("VTKHDF/PointData/displacement", "VTKHDF/PointData/nodal_stress", "VTKHDF/CellData/stress", "VTKHDF/CellData/von_mises",
          "VTKHDF/CellData/discretization_error")


class Materials(RankCase):
    def scene(self, response):
        """Bars of a soft and a hard half on a bar whose halves are swapped, warm and loaded; with theta by the mesh."""
        block = grid.Block("bar", grid.even(0, 1, 4), grid.even(0, 1, 4), grid.even(0, 1, 4),
                           volume=lambda centre: "low" if centre[2] < 0.5 else "high")
        grid.write_mesh(self.folder / "bar.msh", [block], "hex20")
        lines = ["&scene mesh='bar.msh' /",
                 "&material name='soft', young=2, poisson=0.25, expansion=3e-4, density=1 /",
                 "&material name='hard', young=30, poisson=0.35, expansion=1e-4, density=5 /",
                 "&body name='lower', volume='low', 'high', material='soft', 'hard' /",
                 "&body name='upper', volume='low', 'high', material='hard', 'soft', at=0,0,1 /",
                 "&support body='lower', surface='bottom', fix='xyz' /", "&support body='upper', surface='sides *', fix='n' /",
                 "&load body='*', angular_velocity=0,0,0.05, centre=0.5,0.5,0 /", "&temperature body='*', formula='10+5*x' /",
                 "&load body='upper', surface='top', pressure_formula='0.05*(1+0.5*x)' /",
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top', theta_mesh=0.1 /",
                 "&solver tolerance=1e-9, response='%s' /" % response]
        return self.write("%s.nml" % response, "\n".join(lines) + "\n")

    def numbers(self, ranks, response):
        path = self.folder / ("%s-%d.vtkhdf" % (response, ranks))
        printed = self.run_ranks(ranks, self.scene(response), "--output", path)
        with h5py.File(path) as file:
            fields = {name: file[name][()] for name in FIELDS}
            fields["energy"] = file["dotyk/bodies/strain_energy"][()]
            material = file["VTKHDF/CellData/material"][()]
        theta = next(line.split()[-1] for line in printed.split("\n") if line.startswith("  joint   "))
        return fields, material, theta, printed

    def compare(self, response, tolerance, text):
        exact, material, theta, _ = self.numbers(1, "full")
        self.assertEqual(set(material), {1, 2})
        for ranks in RANKS:
            found, of_ranks, of_theta, printed = self.numbers(ranks, response)
            with self.subTest(ranks=ranks):
                self.assertIn(text, printed)
                np.testing.assert_array_equal(of_ranks, material)
                self.assertEqual(of_theta, theta)
                for name, array in exact.items():
                    np.testing.assert_allclose(found[name], array, atol=tolerance * np.abs(array).max(), err_msg=name)

    def test_bodies_of_their_own_ranks(self):
        self.compare("full", 1e-9, "ranks")

    def test_split_bodies(self):
        self.compare("multigrid", 1e-5, "split")


if __name__ == "__main__":
    dotyk_case.main()
