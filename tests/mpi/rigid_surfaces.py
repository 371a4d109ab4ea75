"""Rigid bodies that are surfaces without volume on ranks: results are those of one process to the bit, with load cases, too."""
import os

import h5py
import numpy as np

import dotyk_case
from blocks import block_geo
from mpi_case import RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]
SQUARE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
2 7 "face"
$EndPhysicalNames
$Nodes
4
1 0.2 0.2 0
2 0.8 0.2 0
3 0.8 0.9 0
4 0.2 0.9 0
$EndNodes
$Elements
2
1 2 2 7 1 1 2 3
2 2 2 7 1 3 1 4
$EndElements
"""


class RigidSurfaces(RankCase):
    def scene(self):
        """Two blocks, congruent, on each other; above and beside them plates of one mesh, loaded and moved in two load cases."""
        self.write("block.geo", block_geo("tet10", 2))
        self.write("face.msh", SQUARE)
        lines = ["&scene mesh='block.geo' /", "&material name='m', young=200, poisson=0.3 /", "&case name='pressed' /", "&case name='moved' /",
                 "&body name='low', volume='block', material='m' /", "&body name='high', volume='block', material='m', at=0,0,1 /",
                 "&body name='punch', mesh='face.msh', surface='face', facing=0.5,0.5,-1, at=0,0,2 /",
                 "&body name='wall', mesh='face.msh', surface='face', facing=0.5,0.5,-1, axis=0,1,0, angle=90, at=1,0,1.9 /",
                 "&support body='low', surface='bottom', fix='xyz' /", "&support body='high', surface='sides y', fix='y' /",
                 "&spring body='high', surface='sides y', modulus=10, fix='t' /",
                 "&rigid_body body='punch', fix='x y rz' /", "&load body='punch', surface='face', force=0,0,-1, moment=0.02,0.01,0, case='pressed' /",
                 "&load body='punch', surface='face', force=0,0,-0.5, case='moved' /",
                 "&rigid_body body='wall', fix='xyz rx ry rz', value=-0.01,0,0, case='moved' /",
                 "&contact name='joint', surface_a='high:bottom', surface_b='low:top' /",
                 "&contact name='head', surface_a='high:top', surface_b='punch:face' /",
                 "&contact name='side', surface_a='high:sides x', surface_b='wall:face' /",
                 "&solver theta_relative=1e-3, tolerance=1e-8 /"]
        return self.write("case.nml", "\n".join(lines) + "\n")

    def numbers(self, ranks, namelist):
        """All fields and forces."""
        path = self.folder / ("%d.vtkhdf" % ranks)
        self.run_ranks(ranks, namelist, "--output", path)
        found = {}
        with h5py.File(path) as file:
            for group in ("VTKHDF", *("dotyk/cases/%s/%s" % (case, of) for case in ("pressed", "moved") for of in ("contact", "supports", "loads"))):
                file[group].visititems(lambda name, item, group=group: found.update({group + "/" + name: item[()]})
                                       if isinstance(item, h5py.Dataset) else None)
        return found

    def test_ranks(self):
        namelist = self.scene()
        exact = self.numbers(1, namelist)
        force = exact["dotyk/cases/pressed/contact/head/pressure"] @ exact["dotyk/cases/pressed/contact/head/weight"]
        np.testing.assert_allclose(force, 1, rtol=1e-7)
        self.assertGreater(np.max(exact["dotyk/cases/moved/contact/side/pressure"]), 0.1)
        for ranks in RANKS:
            found = self.numbers(ranks, namelist)
            self.assertEqual(set(found), set(exact))
            for name, array in exact.items():
                np.testing.assert_array_equal(found[name], array, err_msg=name)


if __name__ == "__main__":
    dotyk_case.main()
