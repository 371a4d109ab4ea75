#!/usr/bin/python3
"""benchmarks/speed.py: its stiffness matrices have the unknowns and the energy of dotyk's, for all elements that it
knows; its tables."""
import csv
import os
import subprocess
import sys

import numpy as np

import dotyk_case

BENCHMARKS = dotyk_case.ROOT / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
import stiffness_matrices  # noqa: E402
import speed_scenes  # noqa: E402


class Benchmark(dotyk_case.Case):
    def check_matrix(self, scene):
        """Unknowns, and the energy norm of the answer."""
        scene.write(self.folder)
        self.dotyk(scene.case("run", "theta_relative=1e-2", ""), "--output", "run.vtkhdf", "--quiet")
        file = self.results("run.vtkhdf")
        displacement, materials = file["VTKHDF/PointData/displacement"][:], scene.materials()
        unknowns = energy = first = 0
        bodies = list(stiffness_matrices.bodies(self.folder / "run.vtkhdf"))
        self.assertEqual(len(bodies), len(scene.supports()))
        for (points, kind, element), (material, supports) in zip(bodies, scene.supports()):
            dimension = stiffness_matrices.KINDS[kind][1]
            unknowns += np.count_nonzero(~scene.fixed(points, dimension, supports))
            free = np.zeros((len(points), dimension), dtype=bool)
            matrix = stiffness_matrices.stiffness(points, kind, element, *materials[material], free)
            u = displacement[first:first + len(points), :dimension].ravel()
            first += len(points)
            energy += 2*(u @ (matrix @ u)) - u @ (matrix.diagonal()*u)
        summary = file["dotyk/summary"].attrs
        self.assertEqual(unknowns, summary["unknowns"])
        # the energy of dotyk comes from the contact forces: as exact as the iteration and the solves are
        self.assertAlmostEqual(np.sqrt(energy)/summary["energy_norm"], 1, delta=1e-6)

    def test_matrices(self):
        scenes = speed_scenes.scenes()
        wavy, composite = scenes["wavy"].planes, scenes["composite"].planes
        for scene in (speed_scenes.changed_input("wave", "", "wavy", "wavy", [("h = l/80;", "h = l/16;")], wavy),
                      speed_scenes.changed_input("plates", "", "composite", "composite", [], composite),
                      speed_scenes.chain("boxes", "", 2, 0.5), speed_scenes.chain("bricks", "", 2, None, layers=2)):
            with self.subTest(scene.name):
                self.check_matrix(scene)

    def test_planes_of_supports(self):
        """A body whose matrix is not that of the scene is seen: another plane, another number of unknowns."""
        scene = speed_scenes.chain("bricks", "", 1, None, layers=2)
        points = np.array(np.meshgrid(*[np.linspace(0, 1, 3)]*3)).reshape(3, -1).T
        supports = scene.supports()[0][1]
        self.assertEqual(np.count_nonzero(scene.fixed(points, 3, supports)), 3*18)
        self.assertEqual(np.count_nonzero(scene.fixed(points, 3, [([0], [(0, 1)])])), 9)

    def test_tables(self):
        """All columns of a small scene, against the reference and on two threads."""
        program = ("import runpy, sys; sys.path.insert(0, %r); import speed_scenes as s; "
                   "small = s.chain('small', 'two boxes', 2, 0.4, bound=1, threads=0.9); "
                   "s.scenes = lambda: {'small': small}; "
                   "sys.argv = ['benchmark', '--dotyk', %r, '--repeat', '2', '--theta', '1e-2', 'default', '--', "
                   "'ratios', 'threads']; "
                   "runpy.run_path(%r, run_name='__main__')"
                   % (str(BENCHMARKS), os.environ["DOTYK"], str(BENCHMARKS / "speed.py")))
        done = subprocess.run([sys.executable, "-B", "-c", program], cwd=self.folder, text=True, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        self.assertEqual(done.returncode, 0, done.stdout)
        with open(self.folder / "benchmark/ratios.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([(row["theta"], row["errors"]) for row in rows],
                         [("1e-2", "with"), ("1e-2", "without"), ("default", "with"), ("default", "without")])
        with open(self.folder / "benchmark/runs.csv", newline="") as file:
            runs = list(csv.DictReader(file))
        self.assertEqual(len(runs), 2*(1 + 4) + 2*(1 + 1 + 2))
        plain = min(float(run["wall"]) for run in runs if run["program"] == "cholmod")
        for row in rows:
            self.assertAlmostEqual(float(row["ratio"])*plain, float(row["total"]), places=12)
            self.assertGreater(float(row["memory"]), 1)
        self.assertEqual(len({run["stiffness_entries"] for run in runs if run["program"] == "cholmod"}), 1)
        text = (self.folder / "benchmark/benchmark.md").read_text()
        self.assertIn("| small | 1e-2 | with |", text)
        self.assertIn("| small | total |", text)


dotyk_case.main()
