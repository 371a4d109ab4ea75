#!/usr/bin/python3
"""The campaign of random assemblies on a few of them, and what its check sees."""
import json
import os
import subprocess
import sys

import numpy as np

import check_assembly as check
import dotyk_case
from assembly import box

SEEDS = "10:13"


class Campaign(dotyk_case.Case):
    def run_seeds(self, *options, seeds=SEEDS, name="hand"):
        """Run some seeds; their entries."""
        script = str(dotyk_case.ROOT / "tools/assembly_campaign.py")
        done = subprocess.run([sys.executable, "-B", script, "out", "--dotyk", os.environ["DOTYK"], "--seeds", seeds,
                               *options], cwd=self.folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, done.stdout)
        return [json.loads(line) for line in (self.folder / "out" / (name + ".jsonl")).read_text().splitlines()], done.stdout

    def test_a_few_and_again(self):
        """Those that are known to be right are, and are not run again."""
        entries, _ = self.run_seeds()
        self.assertEqual([entry["seed"] for entry in entries], [10, 11, 12])
        self.assertEqual([entry["outcome"] for entry in entries], ["balances"] * 3)
        again, text = self.run_seeds("--report")
        self.assertEqual(again, entries)
        self.assertIn("| all | 3 |", text)

    def test_geometry(self):
        """One scene of each kind with forces that are known. A ball on one vertex (seed 10) and a quarter of a shaft in
        two facets (48, 128) give no wrong number in silence; the last one balances."""
        for seeds in ("2:11", "48:49", "128:129"):
            entries, _ = self.run_seeds("--geometry", seeds=seeds, name="geometry hand")
        outcome = {entry["seed"]: entry["outcome"] for entry in entries}
        self.assertEqual(list(outcome), [*range(2, 11), 48, 128])
        self.assertEqual([outcome[seed] for seed in (*range(2, 10), 128)], ["balances"] * 9)
        self.assertEqual(outcome[10], "says why not")
        self.assertNotEqual(outcome[48], "silent")

    def test_parts_in_clearance_holes(self):
        """A pin whose gaps the meshes tell well (52), and a shaft that stays where it is although its facets push it
        along its bore (59)."""
        for seeds in ("52:53", "59:60"):
            entries, _ = self.run_seeds("--loose", seeds=seeds, name="loose hand")
        self.assertEqual([entry["code"] for entry in entries], [0, 0])
        self.assertEqual(entries[0]["outcome"], "balances")
        self.assertLess(entries[1]["numbers"]["move"], 0.1)

    def test_strip_narrower_than_facets(self):
        """A cylinder with a vertex inside a narrow face gets a contact row there."""
        entries, _ = self.run_seeds(seeds="211:212")
        self.assertEqual([entry["outcome"] for entry in entries], ["balances"])

    def test_vertices_beyond_a_face(self):
        """The row of a vertex beside an edge of the other part is no deeper than the parts are in each other (443);
        that of a corner above a face is the corner's (101)."""
        for seed in (101, 443):
            entries, _ = self.run_seeds(seeds="%d:%d" % (seed, seed + 1))
        self.assertEqual([entry["outcome"] for entry in entries], ["balances"] * 2)

    def test_corners_that_overlap(self):
        """A corner with a meant interference is pushed out, where mean gaps of its pair are positive (207), beside a pair
        that has the interference (460), near the side of the other part (455), at an edge beside its end (15), and
        through the face, not into the bore beside it (341)."""
        for seed in (15, 207, 341, 455, 460):
            entries, _ = self.run_seeds(seeds="%d:%d" % (seed, seed + 1))
        self.assertEqual({entry["seed"]: entry["outcome"] for entry in entries},
                         {seed: "balances" for seed in (15, 207, 341, 455, 460)})

    def test_overlaps_that_are_told(self):
        """A forgotten pair is not excused by another body (89); facets that bend between rows are named (156), also
        those near the side of a part (97); contact narrower than skew facets is uncertain (150)."""
        for seed in (89, 97, 150, 156):
            entries, _ = self.run_seeds(seeds="%d:%d" % (seed, seed + 1))
        self.assertEqual([entry["outcome"] for entry in entries], ["says why not"] * 4)
        self.assertIn("penetrate", entries[0]["reason"])
        for entry, reason in zip(entries[1:], ("warning", "depend on gaps", "warning")):
            self.assertIn(reason, entry["reason"])

    def test_points_that_meet(self):
        """Edges that cross get a row with their common normal (80), also where one of them is at the rim of a contact
        surface (131), points of both bodies get rows at once (495)."""
        for seed in (80, 131, 495):
            entries, _ = self.run_seeds(seeds="%d:%d" % (seed, seed + 1))
        self.assertEqual([entry["outcome"] for entry in entries], ["balances"] * 3)

    def test_rounding_is_no_force(self):
        """A floating part that another one has left behind: forces of rounding are not called uncertain."""
        entries, _ = self.run_seeds(seeds="345:346")
        self.assertEqual([entry["outcome"] for entry in entries], ["balances"])

    def test_depth(self):
        """Cubes in each other, beside each other, displaced into each other, and an edge that has no node inside."""
        one = box("tet4", 2, (0, 0, 0), (1, 1, 1))
        still = check.Body(one.x, np.zeros_like(one.x), one.cells)
        for shift, right in ((0.9, 0.1), (1.0, 0.0), (1.1, 0.0)):
            other = check.Body(one.x + [shift, 0.05, 0.02], np.zeros_like(one.x), one.cells)
            self.assertAlmostEqual(check.depth(still, other), right, delta=1e-9 if right == 0 else 0.02)
        other = check.Body(one.x + [1, 0.05, 0.02], np.tile([-0.1, 0, 0], (len(one.x), 1)), one.cells)
        self.assertAlmostEqual(check.depth(still, other), 0.1, delta=0.02)
        self.assertAlmostEqual(check.depth(still, other, 0.0), 0.0, delta=1e-9)
        bar = box("tet4", (1, 1, 1), (-1, -0.1, -0.1), (2, 0.1, 0.1))
        bar.move(lambda x: x @ np.array([[1, 0, 0], [0, 1, 1], [0, -1, 1]]) / np.array([1, np.sqrt(2), np.sqrt(2)]))
        cross = check.Body(bar.x[:, [1, 0, 2]] + [0, 0, 0.2], np.zeros_like(bar.x), bar.cells)
        self.assertGreater(check.depth(check.Body(bar.x, np.zeros_like(bar.x), bar.cells), cross), 0.02)

    def test_internal_forces(self):
        """Uniaxial stress of a cube, from both kinds of tetrahedra."""
        one = box("tet4", 2, (0, 0, 0), (1, 1, 1))
        mids, cells = {}, []
        x = [*one.x]
        for cell in one.cells:
            if np.linalg.det(one.x[cell[1:]] - one.x[cell[0]]) < 0:
                cell = cell[[0, 2, 1, 3]]
            for i, j in check.EDGES:
                key = tuple(sorted((cell[i], cell[j])))
                if key not in mids:
                    mids[key] = len(x)
                    x.append((one.x[cell[i]] + one.x[cell[j]]) / 2)
            cells.append([*cell, *(mids[tuple(sorted((cell[i], cell[j])))] for i, j in check.EDGES)])
        for x, cells in ((one.x, one.cells), (np.array(x), np.array(cells))):
            body = check.Body(x, x * [-0.3, -0.3, 1.0] * 1e-3, cells)
            force = body.internal(2.0, 0.3)
            top = body.on_plane(np.array([0, 0, 1.0]), np.array([0, 0, 1.0]))
            np.testing.assert_allclose(force[top], body.pressure(top, -2e-3)[top], atol=1e-15)
            np.testing.assert_allclose(force[top].sum(axis=0), [0, 0, 2e-3], atol=1e-15)
            np.testing.assert_allclose(body.weight(np.array([0, 0, -3.0])).sum(axis=0), [0, 0, -3], atol=1e-13)


dotyk_case.main()
