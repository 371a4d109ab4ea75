"""Tests of the scenes of assembly_scenes.py: each against its right answer, and turned by random rotations, which
changes no number by more than 1e-9."""
import re
import sys
import unittest

import assembly_scenes

SEEDS = (1, 2)


def main(section, same=1e-9, seeds=SEEDS):
    """Test the scenes of a section that are not pending."""
    class Assemblies(unittest.TestCase):
        """One test for each scene."""

    def test(scene):
        def run_it(self):
            first = scene()
            for seed in (0, *seeds):
                for row, still in zip(first, scene(seed) if seed else first):
                    words = "%s, turned %d" % (row.what, seed)
                    self.assertLessEqual(abs(still.value - still.right), still.allowed, words)
                    self.assertAlmostEqual(still.value, row.value, delta=same * max(1.0, abs(row.value)), msg=words)
        return run_it

    for part, name, scene in assembly_scenes.SCENES:
        if part == section and name not in assembly_scenes.PENDING:
            setattr(Assemblies, "test_" + re.sub(r"\W+", "_", name), test(scene))
    suite = unittest.defaultTestLoader.loadTestsFromTestCase(Assemblies)
    result = unittest.TextTestRunner(verbosity=2).run(suite)
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
