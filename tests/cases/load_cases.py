#!/usr/bin/python3
"""Load cases: each is the scene of its own with the same loads, supports, temperatures, gaps and theta."""
import subprocess
import sys

import numpy as np

import dotyk_case
import dotyk
from blocks import block_geo, mesh

SOLVER = "&solver theta=0, tolerance=1e-12 /"
NAMES = "weight", "pressed", "tilted", "hot", "strained", "lifted", "twisted", "tight", "soft"
# Lines of a scene, and the cases that they belong to: '' for all.
LINES = [
    ("&load body='upper', force_density=0,0,-2 /", ""),
    ("&load body='upper', surface='top', pressure=0.4 /", "pressed,tilted"),
    ("&load body='upper', surface='top', pressure_formula='4*x-2.5' /", "t*ted"),
    ("&temperature body='upper', value=40 /", "hot"),
    ("&temperature body='upper', formula='30*z' /", "strained"),
    ("&initial_stress body='lower', value=0.1,-0.2,0.3,0,0,0.1 /", "strained"),
    ("&support body='lower', surface='bottom', fix='xyz', value=1e-3,0,2e-3 /", "lifted"),
    ("&support body='lower', surface='bottom', fix='xyz', value_formula='0','0','1e-3*x' /", "twisted,tight"),
]
CHANGES = [("tight", "gap=-1e-3"), ("soft", "theta_mesh=0.5"), ("tilted", "gap_formula='1e-4*x*y'")]


def belongs(name, cases):
    """Whether a line belongs to a case."""
    return not cases or any(name == case or (case == "t*ted" and name.startswith("t") and name.endswith("ted"))
                            for case in cases.split(","))


def names_of(file):
    """Names of the load cases of a file."""
    names = file["dotyk/cases"].attrs["names"]
    return (names.decode() if isinstance(names, bytes) else str(names)).split("\n")


class LoadCases(dotyk_case.Case):
    def setUp(self):
        super().setUp()
        mesh(self.write("lower.geo", block_geo("hex8", (3, 2, 2), (0, 0, 0), (1, 1, 1))), 3)
        mesh(self.write("upper.geo", block_geo("tet10", (2, 2, 1), (0, 0, 1), (1, 1, 0.5))), 3)

    expected_code = 0

    def scene(self, file, lines, solver=SOLVER, contact="", options=()):
        """Write and run a scene of two blocks; its group /dotyk and its fields."""
        self.write(file + ".nml", "\n".join([
            "&scene /", "&material name='steel', young=200, poisson=0.3, expansion=1e-5 /", solver,
            *("&body name='%s', mesh='%s.msh', volume='block', material='steel' /" % (name, name)
              for name in ("lower", "upper")),
            "&support body='upper', surface='sides x', fix='x' /", "&support body='upper', surface='sides y', fix='y' /",
            "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' %s /" % contact, *lines]) + "\n")
        self.log = self.dotyk(file + ".nml", *options, code=self.expected_code)
        return self.results(file + ".vtkhdf") if self.expected_code < 2 else None

    def with_cases(self, names=NAMES, more="", **options):
        """The scene with all its cases."""
        lines = ["&case name='%s' %s /" % (name, more if k else "") for k, name in enumerate(names)]
        for line, cases in LINES:
            cases = [case for case in cases.split(",") if case and any(belongs(name, case) for name in names)] if cases else None
            if cases != []:
                lines.append(line[:-1] + ", case=%s /" % ", ".join(map(repr, cases)) if cases else line)
        lines += ["&contact_case case='%s', contact='jo*', %s /" % change for change in CHANGES if change[0] in names]
        return self.scene("cases", lines, **options)

    def alone(self, name, **options):
        """The scene of one case."""
        lines = [line for line, cases in LINES if belongs(name, cases)]
        if not any("bottom" in line for line in lines):
            lines.append("&support body='lower', surface='bottom', fix='xyz' /")
        return self.scene(name, lines, contact="".join(", " + change for case, change in CHANGES if case == name), **options)

    def compare(self, file, step, alone, tolerance):
        """Fields and groups of a case are those of a run of its own, to a tolerance relative to the size."""
        size = {}
        for place in ("PointData", "CellData"):
            for field, values in alone["VTKHDF"][place].items():
                own = file["VTKHDF"][place][field]
                first = file["VTKHDF/Steps/%sOffsets/%s" % (place, field)][step - 1]
                size[field] = np.nanmax(np.abs(values)) + 1e-300
                np.testing.assert_allclose(own[first:first + len(values)] / size[field], values[:] / size[field],
                                           atol=tolerance, err_msg=field)
        name = names_of(file)[step - 1]
        group = file["dotyk/cases/" + name]
        self.assertEqual(group.attrs["step"], step)
        self.assertEqual(set(group), set(alone["dotyk"]) - {"timing"})
        for part in ("supports", "loads", "bodies", "contact/joint", "rigid_bodies"):
            if part not in group:
                continue
            self.assertEqual(set(group[part]), set(alone["dotyk"][part]), part)
            for array, values in alone["dotyk"][part].items():
                scale = np.abs(values[()]).max(initial=1e-300)
                if array.endswith(("force", "moment")):
                    scale = max(scale, *(np.abs(alone["dotyk/bodies/%s_%s" % (kind, array[-6:].strip("_"))]).max()
                                         for kind in ("load", "contact", "reaction")))
                np.testing.assert_allclose(group[part][array][()] / scale, values[()] / scale, atol=tolerance,
                                           err_msg=part + " " + array)
        for key in ("energy", "error_discretization", "energy_norm"):
            one, other = group["summary"].attrs[key], alone["dotyk/summary"].attrs[key]
            self.assertAlmostEqual(one / other, 1, delta=max(tolerance, 1e-12) * 10, msg=key)
        self.assertEqual(group["summary"].attrs["converged"], 1)

    def test_each_case_alone(self):
        """Every case equals its own run to rounding; where nothing is prescribed, in every digit."""
        file = self.with_cases()
        self.assertEqual(names_of(file), list(NAMES))
        printed = self.log
        for name in NAMES:
            self.assertIn("case '%s' (%d of %d)" % (name, NAMES.index(name) + 1, len(NAMES)), printed)
        self.assertEqual(printed.count("factorization  "), 1)
        for step, name in enumerate(NAMES, 1):
            with self.subTest(name=name):
                self.compare(file, step, self.alone(name), 1e-10)

    def rigid_scene(self, file, lines, code=0):
        """A rigid block on an elastic one."""
        self.write(file + ".nml", "\n".join([
            "&scene /", "&material name='steel', young=200, poisson=0.3 /", SOLVER,
            *("&body name='%s', mesh='%s.msh', volume='block', material='steel' /" % (name, name)
              for name in ("lower", "upper")),
            "&support body='lower', surface='bottom', fix='xyz' /",
            "&contact name='joint', surface_a='lower:top', surface_b='upper:bottom' /", *lines]) + "\n")
        self.log = self.dotyk(file + ".nml", code=code)
        return self.results(file + ".vtkhdf") if code < 2 else None

    def test_rigid_body(self):
        """Given motions of a rigid body, and its loads, by load cases: each is its own run."""
        held = "&rigid_body body='upper', fix='xyz rx ry rz', point=0.5,0.5,1"
        free = "&rigid_body body='upper', fix='x y rz' /"
        pressed = "&load body='upper', surface='top', %s"
        for name, cases, common in (
                ("held", {"down": held + ", value=0,0,-1e-3", "turned": held + ", value=0,0,-2e-3, rotation=0,1e-3,0",
                          "still": "&load body='lower', force_density=0,0,1"}, ""),
                ("free", {"even": pressed % "pressure=0.4", "tilted": pressed % "pressure_formula='4*x+0.5'"}, free)):
            both = self.rigid_scene(name, ["&case name='%s' /" % case for case in cases] + [common] +
                                    ["%s, case='%s' /" % (line, case) for case, line in cases.items()])
            for step, (case, line) in enumerate(cases.items(), 1):
                with self.subTest(case=case):
                    alone = self.rigid_scene(case, [common, line + " /"] + [held + " /"] * (case == "still"))
                    self.compare(both, step, alone, 1e-9)
        one, other = held + ", value=0,0,-1e-3, case='a', 'b' /", held + ", case='b', 'c' /"
        names = ["&case name='%s' /" % case for case in "abc"]
        self.assertIsNone(self.rigid_scene("twice", names + [one, other], code=2))
        self.assertIn("one group per body and load case", self.log)
        self.rigid_scene("other", names + [one, other.replace("'b', ", "").replace(" rz'", "'")], code=2)
        self.assertIn("has another fix or point", self.log)

    def test_history_of_bolts(self):
        """Cases that start from the one before, also from one in which a bolt is tightened, have the solution of their own."""
        self.write("third.geo", block_geo("hex8", (2, 2, 4), (3, 0, 0), (1, 1, 2)))
        found = {}
        for more in "", ", history=.true.":
            names = ["&case name='c%d'%s /" % (k, more if k > 1 else "") for k in range(1, 6)]
            file = self.scene("bolted", [
                "&body name='third', mesh='third.geo', volume='block', material='steel' /",
                "&support body='lower', surface='bottom', fix='xyz' /", *("&support body='third', surface='%s', fix='xyz' /" % s
                                                                          for s in ("bottom", "top")),
                "&bolt name='b', body='third', point=3.5,0.5,1, normal=0,0,1, force=0.1, case='c2' /",
                "&load body='upper', force_density=0,0,-2 /", *names])
            found[more] = [(file["dotyk/cases/c%d/ties/tension" % k][0], file["dotyk/cases/c%d/summary" % k].attrs["energy"])
                           for k in range(1, 6)]
        for cold, warm in zip(*found.values()):
            self.assertAlmostEqual(cold[0], warm[0], delta=1e-10)
            self.assertAlmostEqual(cold[1] / warm[1], 1, delta=1e-10)
        self.assertAlmostEqual(found[""][4][0], 0.1, delta=1e-9)

    def test_superposition(self):
        """Where the contact stays closed, the solution of both loads is the sum of those of each and of the weight."""
        names = "weight", "one", "other", "both"
        loads = ["&load body='upper', surface='top', pressure=0.4, case='one', 'both' /",
                 "&load body='lower', force_density=0.1,0.2,-0.3, case='other', 'both' /",
                 "&temperature body='upper', value=9, case='*o*' /".replace("*o*", "*oth*"),
                 "&support body='lower', surface='bottom', fix='xyz', value=1e-4,0,-1e-3, case='one', 'both' /"]
        file = self.scene("sum", ["&case name='%s' /" % name for name in names] + [LINES[0][0]] + loads)
        results = {name: dotyk.Results(self.folder / "sum.vtkhdf", case=name) for name in names}
        for field in ("displacement", "stress", "contact_pressure", "reaction_force", "nodal_stress"):
            weight, one, other, both = (results[name][field] for name in names)
            np.testing.assert_allclose(both - one - other + weight, 0, atol=1e-11 * np.abs(both).max(), err_msg=field)
        self.assertEqual([results[name].pairs["joint"]["active"] for name in names], [9] * 4)
        self.assertEqual(file["dotyk/cases/both/summary"].attrs["converged"], 1)

    def test_nothing_acts(self):
        """Cases in which nothing acts, before and after one with a load: no forces and no strain, whatever gap, theta and
        solver; bodies that overlap come apart. Forces are those of rounding otherwise, which no norm tells from a solution,
        and a small theta would magnify."""
        turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [0.48, 0.64, 0.6]])
        for name, kind, n, origin, size in (("lower", "hex8", (3, 2, 2), (0, 0, 0), (1, 1, 1)),
                                            ("upper", "tet10", (2, 2, 1), (0, 0, 1), (1, 1, 0.5))):
            mesh(self.write(name + " turned.geo", block_geo(kind, n, origin, size)), 3, lambda x: x @ turn.T + 3)
        more = {"floats": [], "held": ["&support body='upper', surface='top', fix='xyz' /"],
                "on springs": ["&spring body='upper', surface='top', fix='xyz', stiffness=1 /"],
                "moved": []}
        grids = "response='multigrid'"
        for upper, gap, solver in ([("floats", -2e-3, solver)
                                    for solver in ("theta=0", "theta_relative=1e-4, tolerance=1e-10", "", grids)] +
                                   [("floats", 0.0, ""), ("floats", 0.0, grids), ("floats", 1e-3, ""), ("held", 0.0, ""),
                                    ("held", 0.0, grids), ("on springs", 0.0, ""), ("moved", 0.0, ""),
                                    ("moved", 0.0, grids), ("held", 1e-3, "scheme='neumann', theta_relative=0.1")]):
            with self.subTest(upper=upper, gap=gap, solver=solver):
                self.write("idle.nml", "\n".join([
                    "&scene /", "&material name='steel', young=200, poisson=0.3 /", "&solver %s /" % solver,
                    *("&body name='%s', mesh='%s turned.msh', volume='block', material='steel' /" % (name, name)
                      for name in ("lower", "upper")),
                    "&support body='lower', surface='bottom', fix='xyz' %s /" % (
                        ", value=1e-3,0,2e-3, case='yet'" if upper == "moved" else ""),
                    "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top', gap=%r /" % gap,
                    "&case name='still' /", "&case name='pressed' /", "&case name='yet', history=.true. /",
                    "&load body='upper', surface='top', pressure=0.3, case='pressed' /", *more[upper]]) + "\n")
                log = self.dotyk("idle.nml")
                self.assertNotIn("penalty term is", log)
                file = self.results("idle.vtkhdf")
                for name in ("still", "yet"):
                    own = file["dotyk/cases"][name]
                    summary = own["summary"].attrs
                    self.assertEqual((summary["converged"], summary["error_bound"], summary["penalty_energy"]), (1, 0, 0))
                    np.testing.assert_array_equal(own["contact/joint/pressure"][:], 0)
                    np.testing.assert_allclose(own["supports/force"][:], 0, atol=1e-15)
                    self.assertLess(abs(summary["strain_energy"]), 1e-30)
                    u = file["VTKHDF/PointData/displacement"][:]
                    n = len(file["VTKHDF/Points"])
                    u = u[(own.attrs["step"] - 1) * n:][:n].reshape(-1, 3)
                    u = u[file["VTKHDF/NumberOfPoints"][0]:]
                    if upper == "moved" and name == "yet":
                        self.assertGreater((u @ turn[:, 2]).min(), np.array([1e-3, 0, 2e-3]) @ turn[:, 2] - 1e-14)
                    else:
                        # Motions by p-multigrid end at the tolerance, 1e-6.
                        np.testing.assert_allclose(u, max(0.0, -gap) * np.tile(turn[:, 2], (len(u), 1)),
                                                   atol=1e-6 * abs(gap) if solver == grids and gap < 0 else 1e-14)

    def test_history_and_restart(self):
        """From the contact of the case before, or of an earlier run, the same solution within the error bound."""
        cold = self.with_cases()
        energies = [cold["dotyk/cases"][name]["summary"].attrs["energy"] for name in NAMES]
        for more, options in ((", history=.true.", ()), ("", ("--restart", "first.vtkhdf"))):
            (self.folder / "first.vtkhdf").write_bytes((self.folder / "cases.vtkhdf").read_bytes())
            warm = self.with_cases(more=more, options=options)
            for name, energy in zip(NAMES, energies):
                summary = warm["dotyk/cases"][name]["summary"].attrs
                self.assertAlmostEqual(summary["energy"] / energy, 1, delta=1e-12)
                if options:
                    self.assertLessEqual(summary["iterations"], 1)
        self.assertIn("no load case 'new'", self.dotyk("new.nml", "--restart", "first.vtkhdf", code=2)
                      if self.write("new.nml", (self.folder / "cases.nml").read_text().replace("'weight'", "'new'")) else "")
        self.alone("weight")
        self.assertIn("has load cases, and the case has none",
                      self.dotyk("weight.nml", "--restart", "first.vtkhdf", "--check", code=2))

    def test_package(self):
        """Load cases by the Python package, as tables, and as a picture."""
        self.with_cases()
        alone = {name: (self.alone(name), dotyk.Results(self.folder / (name + ".vtkhdf")))[1] for name in ("hot", "twisted")}
        with dotyk.Results(self.folder / "cases.vtkhdf") as results:
            self.assertEqual(results.cases, list(NAMES))
            self.assertTrue(results.converged)
            with self.assertRaisesRegex(KeyError, "choose one by results.case"):
                results.summary["energy"]
            with self.assertRaisesRegex(KeyError, "choose one by results.case"):
                results["displacement"]
            with self.assertRaisesRegex(KeyError, "no load case 'cold'"):
                results.case("cold")
            self.assertEqual(results["element_tag"].shape, alone["hot"]["element_tag"].shape)
            for name, own in alone.items():
                case = results.case(name)
                for body in ("lower", "upper"):
                    for field in ("displacement", "stress", "node_tag", "nodes"):
                        one, other = (r.bodies[body] for r in (case, own))
                        one, other = (r.nodes if field == "nodes" else r[field] for r in (one, other))
                        np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(other).max())
                np.testing.assert_allclose(case.pairs["joint"].force, own.pairs["joint"].force, atol=1e-12)
        rows = subprocess.run([sys.executable, "-Bm", "dotyk.summary", "--csv", "supports", "cases.vtkhdf"], cwd=self.folder, check=True,
                              capture_output=True, text=True).stdout.splitlines()
        self.assertEqual(rows[0].split(",")[:3], ["file", "case", "name"])
        self.assertEqual([row.split(",")[1] for row in rows[1:]], [name for name in NAMES for _ in range(3)])
        text = subprocess.run([sys.executable, "-Bm", "dotyk.summary", "cases.vtkhdf"], cwd=self.folder, check=True,
                              capture_output=True, text=True).stdout
        self.assertEqual(text.count("\ncase '"), len(NAMES))

    def test_vtk(self):
        """VTK reads each case as a step of time (from 9.3 on; before, the first one)."""
        try:
            from vtkmodules.util.numpy_support import vtk_to_numpy
            from vtkmodules.vtkCommonCore import vtkLogger, vtkVersion
            from vtkmodules.vtkIOHDF import vtkHDFReader
        except ImportError as reason:
            self.skipTest(str(reason))
        file = self.with_cases()
        draw = [sys.executable, "-Bm", "dotyk.render", "cases.vtkhdf", "--size", "160,100", "--field", "displacement"]
        for case in (), ("--case", "hot"):
            done = subprocess.run([*draw, *case], cwd=self.folder, text=True, capture_output=True)
            self.assertIn(", case '%s', displacements x " % (case or (0, NAMES[0]))[1], done.stdout, done.stderr)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
        reader = vtkHDFReader()
        reader.SetFileName(str(self.folder / "cases.vtkhdf"))
        n_points, n_cells = len(file["VTKHDF/Points"]), len(file["VTKHDF/Types"])
        reads_steps = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) >= (9, 3)
        for step in range(len(NAMES) if reads_steps else 1):
            if reads_steps:
                reader.UpdateTimeStep(step + 1.0)
            reader.Update()
            grid = reader.GetOutputDataObject(0)
            grids = [grid]
            if grid.IsA("vtkPartitionedDataSet"):
                grids = [grid.GetPartition(i) for i in range(grid.GetNumberOfPartitions())]
            for place, n, data in (("PointData", n_points, [g.GetPointData() for g in grids]),
                                   ("CellData", n_cells, [g.GetCellData() for g in grids])):
                for name, values in file["VTKHDF"][place].items():
                    read = np.concatenate([vtk_to_numpy(d.GetArray(name)) for d in data])
                    first = step * n if len(values) > n else 0
                    np.testing.assert_array_equal(read, values[first:first + n], err_msg="%d %s" % (step, name))

    def test_refused(self):
        """Mistakes name file and line; a case without equilibrium names itself and leaves no results."""
        for lines, text in (
                (["&load body='upper', surface='top', pressure=1, case='hot' /"], "the file has no &case"),
                (["&case name='cold' /", "&load body='upper', surface='top', pressure=1, case='hot' /"],
                 "case: unknown case 'hot'"),
                (["&case name='cold' /", "&load body='upper', surface='top', pressure=1, case='h*' /"],
                 "no case has a name like 'h*'"),
                (["&case name='a/b' /"], "cannot name a folder"),
                (["&case name='a', history=.true. /"], "no case before it"),
                (["&case name='a' /", "&case name='a' /"], "a second case 'a'"),
                (["&case name='a' /", "&contact_case case='a', contact='other', gap=1 /"], "no &contact has a name like 'other'"),
                (["&case name='a' /", "&contact_case case='a', contact='joint' /"], "a gap or a theta is missing"),
                (["&case name='a' /", "&contact_case case='a', contact='joint', gap_formula='1/(x-x)' /"],
                 "&contact_case 'joint': gap_formula is"),
                (["&case name='a' /", "&case name='b' /", "&temperature body='upper', value=1, case='a' /",
                  "&temperature body='*', value=1 /"], "a second &temperature of body 'upper' in one load case"),
                (["&case name='a' /", "&output interval=1 /"], "interval"),
                (["&case name='a' /", "&support body='upper', surface='top', fix='x', case='a' /"], "what is held is the same in all"),
                (["&case name='a' /", "&case name='b' /",
                  "&support body='upper', surface='top', fix='x', value=1,0,0, case='b' /"], "contradictory supports")):
            with self.subTest(text=text):
                self.expected_code = 2
                self.scene("wrong", lines)
                self.assertIn(text, self.log)
                self.assertFalse((self.folder / "wrong.vtkhdf").exists())
        self.expected_code = 3
        self.scene("wrong", ["&case name='down' /", "&case name='up' /",
                             "&support body='lower', surface='bottom', fix='xyz' /",
                             "&load body='upper', force_density=0,0,-2, case='down' /",
                             "&load body='upper', force_density=0,0,2, case='up' /"])
        self.assertIn("in case 'up'", self.log)
        self.assertFalse((self.folder / "wrong.vtkhdf").exists())
        self.assertEqual(list(self.folder.glob("*.vtkhdf*")), [])

    def test_remarks(self):
        """Loads that act twice, and cases that no group names, are told; other loads and cases are not."""
        lines = ["&case name='a' /", "&case name='b' /", "&support body='lower', surface='bottom', fix='xyz' /",
                 "&load body='upper', surface='top', pressure=1, case='a' /", "&load body='*', surface='top', pressure=1 /"]
        self.write("twice.nml", "\n".join([
            "&scene /", "&material name='steel', young=200, poisson=0.3 /",
            *("&body name='%s', mesh='%s.msh', volume='block', material='steel' /" % (b, b) for b in ("lower", "upper")),
            "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", *lines]) + "\n")
        log = self.dotyk("twice.nml", "--check")
        self.assertIn("warning: the &load of line 10 is that of line 9 once more: it acts twice", log)
        self.assertIn("case 'b' (line 7) has nothing of its own", log)
        for old, new in (("body='*'", "body='lower'"), ("pressure=1 /", "pressure=2 /"), ("pressure=1 /", "pressure=1, case='b' /")):
            self.write("once.nml", (self.folder / "twice.nml").read_text().replace(old, new))
            log = self.dotyk("once.nml", "--check")
            self.assertNotIn("acts twice", log)
            self.assertEqual("nothing of its own" in log, "case" not in new)
        self.write("all.nml", (self.folder / "twice.nml").read_text().replace(", case='a'", ", case='*'"))
        self.assertNotIn("nothing of its own", self.dotyk("all.nml", "--check"))

    def test_worst_code(self):
        """The exit code is that of the worst case; all cases are written."""
        self.expected_code = 1
        file = self.with_cases(("weight", "twisted", "hot"), solver="&solver theta=0, tolerance=1e-12, max_iterations=2 /")
        found = {name: file["dotyk/cases"][name]["summary"].attrs["converged"] for name in names_of(file)}
        self.assertEqual(found, {"weight": 1, "twisted": 0, "hot": 1})
        self.assertIn("max_iterations", self.log)


if __name__ == "__main__":
    dotyk_case.main()
