"""Parts of large bodies as files: made by one process before a run, or by the first rank; used again as long as nothing that they depend on
has changed."""
import os

import h5py
import numpy as np

import dotyk_case
from blocks import block_geo
from mpi_case import RankCase


class Parts(RankCase):
    def scene(self, pressure=0.1, surface="top", response="multigrid"):
        for name, kind, n, at, size in (("lower", "tet10", (4, 4, 2), (0, 0, 0), (2, 2, 1)), ("upper", "hex20", (3, 3, 2), (0.3, 0.3, 1), (1.4, 1.4, 0.5))):
            # A file that is newer is meshed again.
            if not (self.folder / (name + ".geo")).exists():
                self.write(name + ".geo", block_geo(kind, n, at, size))
        lines = ["&scene /", "&material name='m', young=200, poisson=0.3 /", "&body name='lower', mesh='lower.geo', volume='block', material='m' /",
                 "&body name='upper', mesh='upper.geo', volume='block', material='m' /", "&support body='lower', surface='bottom', fix='xyz' /",
                 "&load body='upper', surface='%s', pressure=%r /" % (surface, pressure),
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                 "&solver response='%s', theta_relative=1e-3, tolerance=1e-8 /" % response]
        return self.write("case.nml", "\n".join(lines) + "\n")

    def files(self, ranks=2):
        """When each part was written."""
        return {path.name: path.stat().st_mtime_ns for path in (self.folder / ".dotyk").glob("case.nml.%d-*.part" % ranks)}

    def fields(self, name):
        """All numbers of a results file."""
        found = {}
        with h5py.File(self.folder / name) as file:
            for group in "VTKHDF", "dotyk/contact":
                file[group].visititems(lambda name, item, group=group: found.update({group + "/" + name: item[()]})
                                       if isinstance(item, h5py.Dataset) else None)
        return found

    def run_split(self, name):
        self.assertIn("all bodies are split over 2 ranks", self.run_ranks(2, "case.nml", "--output", name))
        return self.fields(name)

    def assertSame(self, found, expected):
        self.assertEqual(set(found), set(expected))
        for name, array in expected.items():
            np.testing.assert_array_equal(found[name], array, err_msg=name)

    def test_made_before_the_run(self):
        self.scene()
        self.assertIn("2 parts written: .dotyk/case.nml.2-*.part", self.run_ranks(1, "case.nml", "--partition", 2))
        made = self.files()
        self.assertEqual(set(made), {"case.nml.2-1.part", "case.nml.2-2.part"})
        self.assertIn("2 parts are there", self.run_ranks(1, "case.nml", "--partition", 2))
        before = self.run_split("before.vtkhdf")
        self.assertEqual(self.files(), made)
        for name in made:
            (self.folder / ".dotyk" / name).unlink()
        self.assertSame(self.run_split("itself.vtkhdf"), before)
        self.assertEqual(set(self.files()), set(made))

    def test_what_they_depend_on(self):
        self.scene()
        first = self.run_split("first.vtkhdf")
        made = self.files()
        # Other loads on the same surfaces.
        self.scene(pressure=0.2)
        self.run_split("loads.vtkhdf")
        self.assertEqual(self.files(), made)
        # Another surface, and another mesh.
        self.scene(surface="sides x")
        self.run_ranks(2, "case.nml", "--check")
        other = self.files()
        self.assertTrue(all(other[name] > time for name, time in made.items()))
        self.scene()
        self.write("lower.geo", block_geo("tet10", (5, 4, 2), (0, 0, 0), (2, 2, 1)))
        found = self.run_split("mesh.vtkhdf")
        self.assertGreater(len(found["VTKHDF/Points"]), len(first["VTKHDF/Points"]))
        # A part that another program has cut short.
        (self.folder / "lower.geo").unlink()
        self.scene()
        path = self.folder / ".dotyk" / "case.nml.2-2.part"
        self.run_split("again.vtkhdf")
        os.truncate(path, path.stat().st_size - 8)
        self.assertSame(self.run_split("short.vtkhdf"), first)

    def test_parts_that_are_of_no_use(self):
        self.scene(response="full")
        self.assertIn("no body is split over ranks: the case needs no parts", self.run_ranks(1, "case.nml", "--partition", 2))
        self.assertEqual(self.files(), {})

    def test_mistakes(self):
        self.scene(surface="lid")
        self.assertOnce("'lid'", self.run_ranks(1, "case.nml", "--partition", 2, code=2))
        self.assertOnce("'lid'", self.run_ranks(2, "case.nml", code=2))
        self.assertEqual(self.files(), {})
        for number in ("1", "two", "-3"):
            self.assertOnce("option --partition needs a number from 2 to", self.run_ranks(1, "case.nml", "--partition", number, code=2))
        self.assertOnce("--partition needs one process", self.run_ranks(2, "case.nml", "--partition", 2, code=2))


if __name__ == "__main__":
    dotyk_case.main()
