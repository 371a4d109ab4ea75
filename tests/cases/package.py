#!/usr/bin/python3
"""The Python package tools/python/dotyk: scenes written and read, runs and how they end, results against plain h5py."""
import copy
import os
import pathlib
import re
import signal
import subprocess
import sys

import h5py
import numpy as np

import dotyk_case
import dotyk
from dotyk.program import MARK

ENDLESS = {"scheme": "neumann", "theta_relative": 1e-9, "tolerance": 1e-12, "max_iterations": 100000000}


def column(**solver):
    """The column of inputs/ by the methods of a scene, its upper block bent, so that the joint opens."""
    scene = dotyk.Scene(title="column", mesh=dotyk_case.INPUTS / "column" / "column.geo")
    scene.material(name="steel", young=210e9, poisson=0.3)
    scene.material(name="concrete", young=np.float64(30e9), poisson=0.2)
    scene.body(name="lower", volume="lower", material="concrete")
    scene.body(name="upper", volume="upper", material="steel")
    scene.support(body="lower", surface="bottom", fix="z")
    for body in ("lower", "upper"):
        for axis in "xy":
            scene.support(body=body, surface="sides " + axis, fix=axis)
    scene.support(body="upper", surface="top", fix="z", value_formula=["0", "0", "1e-3*(0.3-x)"])
    scene.contact(name="joint", surface_a="upper:upper bottom", surface_b="lower:lower top")
    scene.solver(**(solver or {"theta": 0, "tolerance": 1e-8}))
    return scene


class Namelists(dotyk_case.Case):
    def test_all_examples(self):
        for path in sorted(dotyk_case.INPUTS.glob("*/*.nml")):
            scene = dotyk.Scene.read(path)
            self.assertEqual(str(scene), path.read_text(), path)
            self.assertEqual(scene.write(self.folder / "copy.nml").read_text(), path.read_text())
            again = dotyk.Scene.parse("".join(dotyk.Group(group.name, group).text for group in scene.groups))
            self.assertEqual([(a.name, [*a.items()]) for a in again.groups], [(a.name, [*a.items()]) for a in scene.groups])
            for group in scene.groups:
                for key, value in dict(group).items():
                    group[key] = value
            self.assertEqual([dict(a) for a in scene.groups], [dict(a) for a in again.groups])

    def test_values(self):
        values = {"title": "it's a / & ! \"x\" = 1, 2", "wide": "a" * 150, "yes": True, "no": np.False_, "many": np.arange(40) / 7,
                  "rows": [[1, 2], [3, 4]], "small": -1e-300, "texts": ["0", "x'y", ""], "count": np.int32(7), "none": None}
        scene = dotyk.Scene(**values)
        self.assertLess(max(len(line) for line in str(scene).replace("a" * 150, "").splitlines()), 110)
        group = dotyk.Scene.parse(str(scene)).find("scene")
        expected = {**values, "many": list(values["many"]), "rows": [1, 2, 3, 4]}
        del expected["none"]
        self.assertEqual(dict(group), expected)
        self.assertEqual([type(group[key]) for key in ("yes", "no", "small", "count")], [bool, bool, float, int])
        for wrong in (float("nan"), "two\nlines", b"bytes", {}, [], {1}, 1j):
            self.assertRaises((TypeError, ValueError), dotyk.Group, "scene", {"title": wrong})
        self.assertRaises(ValueError, dotyk.Group, "scene", {"a b": 1})

    def test_reads_what_the_program_reads(self):
        text = "\ufeff! comment / &x\n&A X =1 ! c, /\n y= 3*'b''', z\n=t ! v=1\n, w=2*1.5d3,\"!\"/ ! end\n"
        scene = dotyk.Scene.parse(text)
        self.assertEqual(dict(scene.find("a")), {"x": 1, "y": 3 * ["b'"], "z": True, "w": [1500, 1500, "!"]})
        self.assertEqual(str(scene), text)

    def test_changes_leave_all_else(self):
        scene = dotyk.Scene.parse("! steel\n&material name='a', ! its name\n  young=1, ! soft\n  poisson=0 /\n\n&solver /\n! end\n")
        scene.find("material", name="a").update(Young=2.5, shear=[1, 2, 3])
        scene.solver(theta=0)
        self.assertEqual(str(scene), "! steel\n&material name='a', ! its name\n  young=2.5, ! soft\n  poisson=0, shear=1,2,3 /\n\n"
                                     "&solver theta=0 /\n! end\n")
        group = scene.find("material")
        del group["poisson"], group["shear"], group["name"]
        self.assertEqual(dict(group), {"young": 2.5})
        self.assertEqual(group.text.count("! "), 2)
        for name in ("body", "material"):
            scene.add("material", name=name)
        self.assertRaisesRegex(KeyError, "0 groups &body", scene.find, "body")
        self.assertRaisesRegex(KeyError, "3 groups &material", scene.find, "material")
        self.assertEqual(len(scene.all("material", name="body")), 1)
        self.assertRaisesRegex(KeyError, "no key 'z'", lambda: group["z"])

    def test_mistakes(self):
        for text, message in (("&a x=1\n", "f:1: &a: no / at its end"), ("&a x=1\n&b /", "f:1: &a: no / before &b"),
                              ("\nx /", "f:2: 'x /' outside of a group"), ("&a\n x=1 x=2 /", "f:2: &a: key 'x' twice"),
                              ("&a 3 /", "&a: '3' without a key"), ("&a x=1,,2 /", "&a: x: a value is missing"),
                              ("&a x=y /", "&a: x: 'y' is neither a number nor a text"), ("&a\nx='y /\n", "f:2: &a: a quote without end"),
                              ("& /", "a name is missing"), ("&a x='y'z /", "&a: unexpected|a quote without end")):
            self.assertRaisesRegex(dotyk.NamelistError, message, dotyk.Scene.parse, text, "f")

    def test_copies_of_a_body(self):
        scene = dotyk.Scene.parse("&body name='a *', repeat=2 /\n&body name='b', x=1 /\n"
                                  "&body name='c *', repeat=3,2 /\n&body name='*d*e', repeat=2,2 /")
        self.assertEqual([name for name, _ in scene.bodies()],
                         ["a 1", "a 2", "b", "c 1 1", "c 2 1", "c 3 1", "c 1 2", "c 2 2", "c 3 2", "1d1e", "2d1e", "1d2e", "2d2e"])


class Runs(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        self.case = self.folder / "case.vtkhdf"

    def failing(self, scene, code, message, **options):
        """A run that raises an error, which is returned."""
        with self.assertRaisesRegex(dotyk.Error, message) as caught:
            dotyk.run(scene, self.case, **options)
        self.assertEqual(caught.exception.code, code)
        return caught.exception

    def test_results(self):
        lines = []
        results = dotyk.run(column(), self.case, threads=1, on_progress=lines.append)
        self.assertEqual(results.log.splitlines(), lines)
        self.assertIn("converged after", results.log)
        self.assertEqual((results.converged, results.status, results.run["threads"]), (True, "converged", 1))
        self.assertEqual(list(results.bodies), ["lower", "upper"])
        self.assertEqual(dict(results.scene.find("contact")), dict(column().find("contact")))
        with h5py.File(self.case) as file:
            grid, first = file["VTKHDF"], np.cumsum([0, *file["VTKHDF/NumberOfPoints"]])
            for k, body in enumerate(results.bodies.values()):
                here = slice(first[k], first[k + 1])
                np.testing.assert_array_equal(body.nodes, grid["Points"][here])
                np.testing.assert_array_equal(body.displacement, grid["PointData/displacement"][here])
                mine = grid["CellData/body"][:] == k + 1
                for name in ("stress", "von_mises", "discretization_error", "element_tag"):
                    np.testing.assert_array_equal(getattr(body, name), grid["CellData"][name][:][mine])
                self.assertEqual([cells.type for cells in body.cells], np.unique(grid["Types"][:][mine]).tolist())
                # Both are unit cubes, the lower one of hexahedra along the axes.
                corners = body.nodes[body.cells[0].nodes]
                volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6 if k else np.ptp(corners, axis=1).prod(axis=1)
                self.assertAlmostEqual(volumes.sum(), 1, 12)
            np.testing.assert_array_equal(results["displacement"], grid["PointData/displacement"])
            np.testing.assert_array_equal(results.nodes, grid["Points"])
            pair, group = results.pairs["joint"], file["dotyk/contact/joint"]
            self.assertEqual(set(pair), set(group) | set(group.attrs))
            for name in group:
                np.testing.assert_array_equal(getattr(pair, name), group[name])
            np.testing.assert_array_equal(pair.force, group.attrs["force"])
            np.testing.assert_allclose(pair.forces.sum(axis=0), pair.force, atol=1e-9 * np.abs(pair.force).max())
            self.assertTrue(0 < (pair.pressure > 0).sum() < len(pair.pressure))
            summary = file["dotyk/summary"]
            self.assertEqual(set(results.summary), set(summary) | set(summary.attrs))
            self.assertEqual(results.summary["energy"], summary.attrs["energy"])
            np.testing.assert_array_equal(results.summary["condition_number"], summary["condition_number"])
            np.testing.assert_array_equal(results.history["energy"], file["dotyk/history/energy"])
            self.assertEqual(results.timing["total"], file["dotyk/timing"].attrs["total"])
            self.assertEqual(dict(results.record("timing")), dict(results.timing))
        self.assertRaisesRegex(KeyError, "no field 'x'", lambda: results["x"])
        self.assertRaisesRegex(KeyError, "no field 'x'", lambda: body["x"])
        self.assertRaisesRegex(KeyError, "no 'x' in /dotyk/contact/joint", lambda: pair["x"])
        with results:
            pass
        self.assertIn("closed", repr(results))

    def test_names_that_are_not_there(self):
        """KeyErrors name the file and what there is; zero threads or ranks are not taken for none given."""
        results = dotyk.run(column(), self.case, threads=1)
        for get, message in ((lambda: results.bodies["middle"], "case.vtkhdf: no body 'middle'; there are lower, upper"),
                             (lambda: results.pairs["gap"], "case.vtkhdf: no contact pair 'gap'; there are joint"),
                             (lambda: results.record("beams"), "case.vtkhdf: no group /dotyk 'beams'; there are bodies, ")):
            with self.assertRaises(KeyError) as caught:
                get()
            self.assertIn(message, str(caught.exception))
        names = results.supports["names"].splitlines()
        self.assertEqual(len(names), len(results.supports["force"]))
        self.assertIn("lower:bottom", names)
        np.testing.assert_allclose(results.supports["force"].sum(axis=0), 0, atol=1e-6 * abs(results.supports["force"]).max())
        self.assertEqual(len(results.forces["strain_energy"]), 2)
        self.assertEqual(len(results.loads["force"]), 0)
        with self.assertRaisesRegex(dotyk.Error, "threads"):
            dotyk.run(column(), self.case, threads=0)
        with self.assertRaisesRegex(ValueError, "ranks must be 1 or more, not 0"):
            dotyk.run(column(), self.case, ranks=0)

    def test_summary_into_a_closed_pipe(self):
        """dotyk-summary FILE | head says nothing about the reader that has left."""
        dotyk.run(column(), self.case, threads=1)
        for more in ([], ["--csv", "supports"]):
            reader, writer = os.pipe()
            os.close(reader)
            done = subprocess.run([sys.executable, "-Bm", "dotyk.summary", *more, str(self.case)], stdout=writer, stderr=subprocess.PIPE,
                                  text=True, check=False)
            os.close(writer)
            self.assertEqual(done.stderr, "")

    def test_a_scene_by_methods_is_that_of_the_namelist(self):
        scene = column()
        del scene.groups[-3]  # the bent top
        scene.support(body="upper", surface="top", fix="z", value=np.array([0, 0, -1e-3]))
        scene.solver(theta=None, theta_relative=1e-2)
        one = dotyk.run(scene, self.case)
        two = dotyk.run(dotyk_case.INPUTS / "column/column.nml", output=self.folder / "two.vtkhdf")
        np.testing.assert_array_equal(one["displacement"], two["displacement"])

    def test_groups_without_a_method(self):
        scene = column()
        warm = copy.deepcopy(scene)
        warm.find("material", name="steel")["expansion"] = 1e-5
        warm.temperature(body="upper", value=1.0)
        self.assertEqual(str(scene), str(column()))
        self.assertFalse(hasattr(scene, "_x"))
        cold, hot = (dotyk.run(one, self.folder / name) for one, name in ((scene, "cold.vtkhdf"), (warm, "hot.vtkhdf")))
        self.assertGreater(hot.pairs["joint"].pressure.max(), 1.01 * cold.pairs["joint"].pressure.max())
        scene.materail(name="x")
        self.failing(scene, 2, "unknown group '?&materail'?")

    def test_stiffness_over_several_lines(self):
        scene = column()
        young, poisson = 30e9, 0.2
        lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
        stiffness = np.diag([2 * shear] * 3 + [shear] * 3)
        stiffness[:3, :3] += lame
        first = dotyk.run(scene, self.case)
        scene.find("material", name="concrete").update(young=None, poisson=None, stiffness=stiffness[np.triu_indices(6)])
        second = dotyk.run(scene, self.folder / "two.vtkhdf")
        np.testing.assert_allclose(second["displacement"], first["displacement"], atol=1e-12)

    def test_where_namelists_and_results_go(self):
        self.assertRaisesRegex(ValueError, "give output=", dotyk.run, column())
        scene = column()
        self.assertEqual(scene.write(self.folder / "own.nml"), self.folder / "own.nml")
        self.assertEqual(dotyk.run(scene).path, str(self.folder / "own.vtkhdf"))
        scene.scene(output="other.vtkhdf")
        self.assertEqual(dotyk.run(scene.write(scene.path)).path, str(self.folder / "other.vtkhdf"))
        for _ in range(2):
            dotyk.run(column(), self.case)
        text = (self.folder / "case.nml").read_text()
        self.assertTrue(text.startswith(MARK))
        self.write("case.nml", "! by hand\n" + text)
        self.assertRaisesRegex(FileExistsError, "was not written by dotyk.run", dotyk.run, column(), self.case)
        for write in (lambda: column().write(self.folder / "none" / "own.nml"), lambda: dotyk.run(column(), self.folder / "none" / "own.vtkhdf")):
            self.assertRaisesRegex(FileNotFoundError, "cannot be written: there is no folder '.*none'; make it first", write)

    def test_bad_input(self):
        self.write("case.vtkhdf", "no results")
        scene = column()
        scene.material(name="x", yuong=1)
        scene.find("contact")["surface_a"] = "uper:upper bottom"
        error = self.failing(scene, 2, r"case.nml:\d+: &material: unknown key 'yuong' \(did you mean 'young'\?\)")
        self.assertIn("did you mean 'upper'?", error.message)
        self.assertEqual(str(error), error.message)
        self.write("bad.nml", "&scene x=,,")
        self.failing(self.folder / "bad.nml", 2, "bad.nml:1")
        self.failing(self.folder / "none.nml", 2, "none.nml")

    def test_not_solvable_not_written_not_started(self):
        scene = column()
        scene.groups.remove(scene.find("support", fix="z", body="upper"))
        scene.load(body="upper", force_density=[0, 0, 1])
        error = self.failing(scene, 3, "no equilibrium")
        self.assertIn("column", error.log)
        self.case = self.folder / "none" / "case.vtkhdf"
        self.failing(column().write(self.folder / "own.nml"), 4, "none")
        self.failing(column().write(self.folder / "own.nml"), None, "no program /none", program="/none")
        self.failing(column().write(self.folder / "own.nml"), None, "built without MPI", ranks=2, program="true")
        self.write("mpi", "#!/bin/sh\necho MPI\n").chmod(0o755)
        self.failing(column().write(self.folder / "own.nml"), None, "no program /srun", launcher="/srun -n 2",
                     program=self.folder / "mpi")

    def test_not_converged(self):
        results = dotyk.run(column(**{**ENDLESS, "max_iterations": 3}), self.case)
        self.assertEqual((results.converged, results.status), (False, "max_iterations"))
        self.assertEqual(results.summary["iterations"], len(results.history["energy"]))

    def test_halves_of_a_body(self):
        scene = column()
        scene.bolt(name="cut", body="lower", point=[0, 0, 0.5], normal=[0, 0, 1], shortening=0)
        results = dotyk.run(scene, self.case)
        self.assertEqual(list(results.bodies), ["lower (1)", "lower (2)", "upper"])
        whole = dotyk.run(column(), self.folder / "whole.vtkhdf")
        np.testing.assert_allclose(results.bodies["upper"].displacement, whole.bodies["upper"].displacement, atol=1e-9)
        self.assertEqual(results.ties["names"].splitlines(), ["cut"])
        self.assertEqual(results.ties["shortening"].shape, (1,))
        scene.case(name="one")
        scene.case(name="two")
        self.assertIn("lower (2)", dotyk.run(scene, self.case).case("two").bodies)

    def test_status_of_load_cases(self):
        scene = column(**{**ENDLESS, "max_iterations": 3})
        scene.case(name="idle")
        scene.case(name="loaded")
        results = dotyk.run(scene, self.case)
        self.assertEqual((results.converged, results.status), (False, "max_iterations"))
        self.assertEqual(results.case("idle").status, "max_iterations")
        scene = column()
        scene.case(name="one")
        scene.case(name="two")
        self.assertEqual(dotyk.run(scene, self.case).status, "converged")

    def test_restart(self):
        solver = {"scheme": "neumann", "theta_relative": 1e-2, "tolerance": 1e-8}
        first = dotyk.run(column(**solver), self.case)
        again = dotyk.run(column(**solver), self.folder / "again.vtkhdf", restart=self.case)
        self.assertLess(again.summary["iterations"], first.summary["iterations"])

    def test_a_killed_run_gives_no_older_results(self):
        dotyk.run(column(), self.case)

        def kill(line):
            if "iteration" in line:
                for process in children(os.getpid()):
                    os.kill(process, signal.SIGKILL)

        self.assertEqual(self.failing(column(**ENDLESS), 137, "ended by signal 9", on_progress=kill).code, 137)
        self.assertTrue(dotyk.Results(self.case).converged)

    def test_exceptions_end_runs_with_results(self):
        for reason in (KeyboardInterrupt, ZeroDivisionError):
            def interrupt(line):
                if "iteration" in line:
                    raise reason

            self.case.unlink(missing_ok=True)
            with self.assertRaises(reason):
                dotyk.run(column(**ENDLESS), self.case, on_progress=interrupt)
            self.assertEqual(dotyk.Results(self.case).status, "interrupted")

    def test_signals_are_passed_on(self):
        column(**ENDLESS).write(self.folder / "case.nml")
        script = "import sys, dotyk; dotyk.run(sys.argv[1], on_progress=lambda line: print(line, flush=True))"
        for number in (signal.SIGINT, signal.SIGTERM):
            self.case.unlink(missing_ok=True)
            with subprocess.Popen([sys.executable, "-B", "-c", script, self.folder / "case.nml"], stdout=subprocess.PIPE, text=True,
                                  stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(pathlib.Path(dotyk.__file__).parents[1])}) as process:
                for line in process.stdout:
                    if "iteration" in line:
                        process.send_signal(number)
                        break
                process.communicate(timeout=60)
            self.assertEqual(process.returncode, -number)
            self.assertEqual(dotyk.Results(self.case).status, "interrupted")


def children(parent):
    """Processes that a process has started."""
    found = []
    for path in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(path.read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


class Package(dotyk_case.Case):
    def test_examples_of_the_page(self):
        """docs/python.md: pressures on the page and those that are found are Hertz's; a scene that is read and changed."""
        page = (dotyk_case.ROOT / "docs" / "python.md").read_text()
        first, second = re.findall(r"(?s)```python\n(.*?)```", page)
        (self.folder / "inputs").mkdir()
        self.copy("hertz").rename(self.folder / "inputs" / "hertz")
        environment = {**os.environ, "PYTHONPATH": str(dotyk_case.ROOT / "tools" / "python")}
        for code in (first, second + "print(results.converged, results.scene.find('solver'), results.pairs['touch'].force)"):
            done = subprocess.run([sys.executable, "-B", "-c", code], cwd=self.folder, env=environment, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            if code == first:
                for text in (page, done.stdout):
                    errors = re.findall(r"(?m)^ +(\d+) .* ([-+][\d.]+) % +[\d.]+ %$", text)
                    self.assertEqual([force for force, _ in errors], ["1", "10", "100"])
                    self.assertLess(max(abs(float(error)) for _, error in errors), 0.4)
        self.assertRegex(done.stdout, "True &solver +tolerance=1e-06, theta=0 /")
        self.assertIn("! A quarter of a steel sphere", (self.folder / "shallow.nml").read_text())

    def test_version(self):
        version = re.search(r"project\(dotyk VERSION ([\d.]+)", (dotyk_case.ROOT / "CMakeLists.txt").read_text())[1]
        self.assertEqual(dotyk.__version__, version)

    def test_everything_is_described(self):
        for name in dotyk.__all__:
            thing = getattr(dotyk, name)
            for member in [thing] + [value for key, value in vars(thing).items() if not key.startswith("_") and (
                    callable(value) or isinstance(value, property))]:
                self.assertTrue(member.__doc__, (name, member))


if __name__ == "__main__":
    dotyk_case.main()
