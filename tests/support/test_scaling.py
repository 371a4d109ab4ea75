"""Tests of the model of tools/scaling.py: limits that are known, and its own predictions."""
import json
import math
import pathlib
import sys

import dotyk_case

sys.path.insert(0, str(dotyk_case.ROOT / "tools"))
import scaling  # noqa: E402



class Scaling(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.data = scaling.load(scaling.COUNTS)
        self.machine, self.counts = dict(self.data["machines"]["cluster"]), dict(self.data["counts"])

    def predict(self, unknowns, nodes, **other):
        counts, machine = dict(self.counts), dict(self.machine)
        for name, value in other.items():
            (machine if name in machine else counts)[name] = value
        return scaling.predict(unknowns, nodes, machine, counts)

    def test_one_rank_exchanges_nothing(self):
        seconds = self.predict(1e6, 1, ranks_per_node=1)["seconds"]
        self.assertEqual([seconds["set-up, network"], seconds["iterations, network"]], [0, 0])
        self.assertEqual(scaling.ghost_nodes(1e6, 1, 2), 0)

    def test_faces_of_cubes(self):
        """8 cubes have 3 faces beside others each, 27 cubes 4 in the mean, infinitely many 6."""
        self.assertAlmostEqual(scaling.faces(8), 3)
        self.assertAlmostEqual(scaling.faces(27), 4)
        self.assertAlmostEqual(scaling.faces(1e30), 6)

    def test_exchanged_bytes_follow_the_surface(self):
        """8 times the unknowns: 4 times the ghosts."""
        self.assertAlmostEqual(scaling.ghost_nodes(8e8, 640, 1) / scaling.ghost_nodes(1e8, 640, 1), 4)

    def test_ideal_machine(self):
        """Without network time, files, contact and imbalance, time is that of one node by the number of nodes."""
        ideal = {"latency": 0, "network": 1e99, "file_system": 1e99, "rows": 0, "imbalance": 1}
        one, many = (self.predict(1e8, nodes, **ideal)["total"] for nodes in (1, 50))
        self.assertAlmostEqual(one / many, 50)

    def test_reductions_are_a_tree(self):
        machine = {**self.machine, "latency": 1.0}
        self.assertEqual([scaling.reduction_time(p, machine) for p in (1, 2, 1024)], [0, 2, 20])

    def test_search_is_divided_but_for_what_is_repeated(self):
        machine = {**self.machine, "latency": 0, "network": 1e99, "bandwidth": 1e99, "core_speed": 1}
        counts = {**self.counts, "search_seconds": 2.0, "search_is_shared": 1, "search_repeated": 0.25}
        self.assertEqual([scaling.search_time(10, p, counts, machine) for p in (1, 3)], [20, 10])
        self.assertEqual(scaling.search_time(10, 3, {**counts, "search_is_shared": 0}, machine), 20)

    def test_search_of_logs(self):
        """Two rows a second on one rank; half of it repeated."""
        log = """case.nml, 3d, 2 bodies, 2 contact pairs, %s

  contact pair         constraints    area projected   smallest gap    largest gap          theta
  c                             15           100.0 %%      0.000E+00      0.000E+00      1.142E-04
    slave up:up low (31756 facets), master low:low up (31756 facets)
  at the side                    5            33.3 %%      0.000E+00      0.000E+00      1.142E-04

  time             read 1 s, search 99 s, check penetration 9 s, write 1 s; total 99 s
  processor time   read 1 s, search %s, recover 1 s, estimate errors 1 s, check penetration %s, write 1 s; total 9 s
"""
        logs = [log % ("3 ranks of 1 thread", "6 s", "667 ms"), log % ("1 thread", "9.5 s", "500 ms")]
        of_row, repeated = scaling.search_constants(logs)
        self.assertAlmostEqual(of_row, 0.5)
        self.assertEqual(repeated[0][0], 3)
        self.assertAlmostEqual(repeated[0][1], 0.5, places=3)

    def test_factor_of_rows_is_read_by_one_rank_of_a_node(self):
        machine = {"bandwidth": 100.0, "bandwidth_of_rank": 10.0, "ranks_per_node": 64}
        counts = {"factor_entries": 1.0, "row_solvers": 1}
        size = scaling.row_factor_bytes(1024, counts)
        self.assertEqual(size, 8 * 1024 * 10)
        told = 2 * 8 * 1024 * 64 / 100.0
        self.assertAlmostEqual(scaling.row_solve_time(1024, counts, machine), 2 * size / 10.0 + told)
        self.assertAlmostEqual(scaling.row_solve_time(1024, {**counts, "row_solvers": 64}, machine), 2 * size / 100.0 + told)

    def test_gathered_bytes_go_once_over_the_network_and_to_each_rank_of_a_node(self):
        machine = {"latency": 1.0, "network": 10, "bandwidth": 40, "ranks_per_node": 4}
        self.assertEqual([scaling.gather_time(p, machine, 100) for p in (1, 4, 8)], [0, 2 + 20, 3 + 10 + 20])

    def test_few_ranks_do_not_use_the_memory_of_a_node(self):
        self.assertEqual(scaling.memory_bandwidth({"ranks_per_node": 2, "bandwidth": 100, "bandwidth_of_rank": 10}, 3), 60)
        self.assertEqual(scaling.memory_bandwidth({"ranks_per_node": 64, "bandwidth": 100, "bandwidth_of_rank": 10}, 3), 300)

    def test_levels(self):
        sizes = scaling.levels(8e6, {**self.counts, "corner_ratio": 8, "coarsening": 10, "coarsest": 1000})
        self.assertEqual([round(size) for size in sizes], [8000000, 1000000, 100000, 10000, 1000])

    def test_predicts_its_own_runs(self):
        """Runs that are exact multiples of one are predicted exactly; one that takes twice as long is not."""
        base = {"unknowns": 1e6, "ranks": 1, "iterations": 20, "setups": 2, "rows": 0, "seconds": {"assembly": 3.0, "setup": 2.0, "solve": 8.0},
                "rank_bytes": 1e9}
        twice = {**base, "unknowns": 2e6, "seconds": {name: 2 * value for name, value in base["seconds"].items()}, "rank_bytes": 2e9}
        counts, chosen = scaling.calibrate(self.data, [twice, base])
        self.assertIs(chosen, base)
        seconds, size = scaling.predict_run(self.data, counts, twice)
        for name, value in twice["seconds"].items():
            self.assertAlmostEqual(seconds[name], value)
        self.assertAlmostEqual(size, 2e9, delta=1)
        self.assertTrue(scaling.self_test({**self.data, "runs": {"a": [base, twice]}})[1])
        slow = {**twice, "seconds": {"assembly": 6.0, "setup": 4.0, "solve": 32.0}}
        self.assertFalse(scaling.self_test({**self.data, "runs": {"a": [base, slow]}})[1])

    def test_measured_runs_are_predicted(self):
        """25 % from 0.2 to 2 million unknowns and from 1 to 2 ranks."""
        lines, good = scaling.self_test(self.data)
        self.assertTrue(good, "\n".join(lines))
        self.assertGreater(len(lines), 2)

    def test_counts_name_their_sources(self):
        for name, entry in json.loads(pathlib.Path(scaling.COUNTS).read_text())["constants"].items():
            self.assertEqual(len(entry), 3, name)
            self.assertTrue(math.isfinite(entry[0]) and entry[2], name)

    def test_page_is_current(self):
        """docs/scaling.md has the tables that `tools/scaling.py --write` makes."""
        text = (dotyk_case.ROOT / "docs" / "scaling.md").read_text()
        for name, lines in scaling.blocks(self.data, self.machine, self.counts).items():
            self.assertIn("\n".join(lines), text, name)


if __name__ == "__main__":
    dotyk_case.main()
