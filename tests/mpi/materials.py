"""Bodies of several materials on ranks: displacements, stresses, materials and energies are those of one process, of bodies that each rank
has its own of, and of bodies that are split; with constants by formulas, too.
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
NUMBERS = ("young=2, poisson=0.25, expansion=3e-4, density=1", "young=30, poisson=0.35, expansion=1e-4, density=5")
# In global coordinates; the second is orthotropic in turned axes. Greatest K/G and least modulus are on one part alone.
FORMULAS = ("young_formula='2+x', poisson_formula='0.25+0.05*z', expansion_formula='3e-4*(1+y)', density_formula='1+x*z'",
            "young_formula='30','20+10*y','25', poisson_formula='0.3','0.2+0.05*x','0.25', shear_formula='10','9+z','8', "
            "axis_1=1,1,0, axis_2=0,0,1, expansion_formula='1e-4','2e-4*(1+x)','1e-4', density_formula='5-z'")


class Materials(RankCase):
    def scene(self, response, constants):
        """Bars of a soft and a hard half on a bar whose halves are swapped, warm and loaded; with theta by the mesh."""
        block = grid.Block("bar", grid.even(0, 1, 3), grid.even(0, 1, 2), grid.even(0, 1, 4),
                           volume=lambda centre: "low" if centre[2] < 0.5 else "high")
        grid.write_mesh(self.folder / "bar.msh", [block], "hex20")
        lines = ["&scene mesh='bar.msh' /",
                 *("&material name='%s', %s /" % pair for pair in zip(("soft", "hard"), constants)),
                 "&body name='lower', volume='low', 'high', material='soft', 'hard' /",
                 "&body name='upper', volume='low', 'high', material='hard', 'soft', at=0,0,1 /",
                 "&support body='lower', surface='bottom', fix='xyz' /", "&support body='upper', surface='sides *', fix='n' /",
                 "&load body='*', angular_velocity=0,0,0.05, centre=0.5,0.5,0 /", "&temperature body='*', formula='10+5*x' /",
                 "&load body='upper', surface='top', pressure_formula='0.05*(1+0.5*x)' /",
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top', theta_mesh=0.1 /",
                 "&solver tolerance=1e-9, response='%s' /" % response]
        return self.write("%s.nml" % response, "\n".join(lines) + "\n")

    def numbers(self, ranks, response, constants):
        path = self.folder / ("%s-%d.vtkhdf" % (response, ranks))
        printed = self.run_ranks(ranks, self.scene(response, constants), "--output", path)
        with h5py.File(path) as file:
            fields = {name: file[name][()] for name in FIELDS}
            fields["energy"] = file["dotyk/bodies/strain_energy"][()]
            material = file["VTKHDF/CellData/material"][()]
        theta = next(line.split()[-1] for line in printed.split("\n") if line.startswith("  joint   "))
        return fields, material, theta, printed

    def compare(self, response, tolerance, text, constants=NUMBERS):
        exact, material, theta, _ = self.numbers(1, "full", constants)
        self.assertEqual(set(material), {1, 2})
        for ranks in RANKS:
            found, of_ranks, of_theta, printed = self.numbers(ranks, response, constants)
            with self.subTest(ranks=ranks):
                self.assertIn(text, printed)
                np.testing.assert_array_equal(of_ranks, material)
                self.assertEqual(of_theta, theta)
                for name, array in exact.items():
                    np.testing.assert_allclose(found[name], array, atol=tolerance * np.abs(array).max(), rtol=0, err_msg=name)

    def test_bodies_of_their_own_ranks(self):
        self.compare("full", 1e-9, "ranks")

    def test_split_bodies(self):
        self.compare("multigrid", 1e-5, "split")

    def test_formulas(self):
        """To the bit where each rank has bodies of its own."""
        self.compare("full", 0, "ranks", FORMULAS)
        self.compare("multigrid", 1e-5, "split", FORMULAS)

    def test_a_formula_that_fails_on_one_part(self):
        """All ranks end, with the message that one process has."""
        constants = FORMULAS[0].replace("0.25+0.05*z", "x+y+z>3.9 ? 0.6 : 0.25"), NUMBERS[1]
        for response in "full", "multigrid":
            printed = self.run_ranks(3, self.scene(response, constants), code=2)
            self.assertRegex(printed, r"body 'upper': .*poisson_formula is 0.6, but must lie between -1 and 0.5 at \(")


if __name__ == "__main__":
    dotyk_case.main()
