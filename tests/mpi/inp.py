"""Decks of Abaqus and CalculiX on ranks: results are those of one process, of bodies that each rank has its own of, and of
bodies that are split.
"""
import os

import h5py
import numpy as np

import dotyk_case
from decks import deck
from mpi_case import RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]


class Inp(RankCase):
    def scene(self, response):
        """A block of hexahedra on a block of tetrahedra; supports and loads on faces that a node set, and element faces, name."""
        self.write("lower.inp", deck("C3D10", "tet", 3) + "*NSET, NSET=foot\n" +
                   ",\n".join(line.split(",")[0] for line in deck("C3D10", "tet", 3).split("\n")[1:] if line.endswith(" 0.0")) +
                   "\n*SURFACE, NAME=top, TYPE=NODE\n" +
                   "\n".join(line.split(",")[0] for line in deck("C3D10", "tet", 3).split("\n")[1:] if line.endswith(" 3.0")) + "\n")
        self.write("upper.inp", deck("C3D20R", "hex", 2, (0.5, 0.4, 3)) +
                   "*ELSET, ELSET=low\n1, 3, 5, 7\n*ELSET, ELSET=high\n2, 4, 6, 8\n*SURFACE, NAME=bottom\nlow, S1\n*SURFACE, NAME=head\nhigh, S2\n")
        return self.write("%s.nml" % response, "&scene /\n&material name='m', young=200, poisson=0.3 /\n"
                          "&body name='lower', mesh='lower.inp', volume='block', material='m' /\n"
                          "&body name='upper', mesh='upper.inp', volume='block', material='m' /\n"
                          "&support body='lower', surface='foot', fix='xyz' /\n"
                          "&load body='upper', surface='head', pressure_formula='0.1*(1+0.3*(x-1.5))' /\n"
                          "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /\n"
                          "&solver theta=0, tolerance=1e-9, response='%s' /\n&output error_parts='' /\n" % response)

    def test_as_one_process(self):
        for response in ("full", "multigrid"):
            numbers = []
            for ranks in (1, *RANKS):
                namelist = self.scene(response)
                self.run_ranks(ranks, namelist.name)
                with h5py.File(namelist.with_suffix(".vtkhdf")) as file:
                    summary = file["dotyk/summary"].attrs
                    numbers.append([summary["strain_energy"], np.abs(file["VTKHDF/PointData/displacement"][:]).sum()])
            for other in numbers[1:]:
                np.testing.assert_allclose(other, numbers[0], rtol=1e-7, err_msg=response)


if __name__ == "__main__":
    dotyk_case.main()
