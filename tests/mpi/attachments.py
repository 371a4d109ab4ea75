"""Ties, a bolt, springs, a point mass and a rigid body on ranks: the forces are those of one process."""
import os

import h5py
import numpy as np

import dotyk_case
from blocks import block_geo
from mpi_case import RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]


class Attachments(RankCase):
    def scene(self):
        """Blocks that are tied to each other and tightened lie on springs; a rigid block presses them."""
        lines = ["&scene /", "&material name='m', young=200, poisson=0.3, density=2 /"]
        for name, kind, n, z in (("base", "hex8", 3, 0), ("foot", "tet10", 2, 1), ("head", "hex20", 2, 2), ("lid", "hex8", 1, 3)):
            self.write(name + ".geo", block_geo(kind, n, (0, 0, z), (1, 1, 1)))
            lines.append("&body name='%s', mesh='%s.geo', volume='block', material='m' /" % (name, name))
        lines += ["&spring body='base', surface='bottom', modulus=30, fix='xyz' /",
                  "&tie name='tie', surface_a='foot:bottom', surface_b='base:top' /",
                  "&bolt name='bolt', surface_a='foot:top', surface_b='head:bottom', force=0.5 /",
                  "&support body='head', surface='sides x', fix='n' /", "&support body='head', surface='sides y', fix='n' /",
                  "&spring body='head', surface='sides x', modulus=3, fix='t' /",
                  "&rigid_body body='lid', fix='x y rz' /", "&load body='lid', surface='top', force=0,0,-3, moment=0.1,0.2,0 /",
                  "&load body='*', acceleration=0,0,-0.1 /", "&mass body='foot', surface='sides x', mass=2, point=1.5,0.5,1.5 /",
                  "&contact name='pair', surface_a='head:top', surface_b='lid:bottom', theta=0 /", "&solver tolerance=1e-8 /"]
        return self.write("case.nml", "\n".join(lines) + "\n")

    def numbers(self, ranks, namelist):
        path = self.folder / ("%d.vtkhdf" % ranks)
        self.run_ranks(ranks, namelist, "--output", path)
        with h5py.File(path) as file:
            found = {"%s/%s" % (group, name): array[()] for group in ("ties", "supports", "loads", "bodies", "contact/pair")
                     for name, array in file["dotyk"][group].items()}
            found["displacement"] = file["VTKHDF/PointData/displacement"][()]
        return found

    def test_ranks(self):
        namelist = self.scene()
        exact = self.numbers(1, namelist)
        np.testing.assert_allclose(exact["ties/tension"][1], 0.5, rtol=1e-9)
        for ranks in RANKS:
            found = self.numbers(ranks, namelist)
            for name, array in exact.items():
                np.testing.assert_allclose(found[name], array, atol=1e-8 * max(1, np.abs(array).max()), err_msg=name)


if __name__ == "__main__":
    dotyk_case.main()
