#!/usr/bin/python3
"""The results file: its whole layout, read back with h5py and with VTK; what happens to older files; the choice of
fields."""
import os
import pathlib
import re
import subprocess
import sys

import numpy as np

import dotyk_case
from blocks import block_geo, column_nml, dimension


# Of Theorems 3 and 4.
CONSTANTS = ("coercivity", "penalty_constant", "smoothness", "gamma_limit", "gamma_2", "gamma_theory", "q_theory",
             "q_paper")


class Results(dotyk_case.Case):
    def column(self, kinds=("hex8", "hex8"), code=0, **options):
        """Write the column's files and run it; returns what the program printed."""
        d = dimension(kinds[0])
        for name, kind, n, z in zip(("lower", "upper"), kinds, (2, 2), (0.0, 1.0)):
            self.write(name + ".geo", block_geo(kind, n, (0.0,) * (d - 1) + (z,), (1.0,) * d))
        options.setdefault("solver", "theta_relative=1, tolerance=1e-8")
        self.write("column.nml", column_nml(d, **options))
        return self.dotyk("column.nml", "--threads", 1, code=code)

    def check_shapes(self, group, shapes):
        """The group has these datasets (shape, kind of number), and no others."""
        found = {name: (item.shape, item.dtype.kind) for name, item in group.items() if hasattr(item, "shape")}
        self.assertEqual(found, shapes)

    def check_attributes(self, group, kinds):
        """The group has these attributes, scalars of these types, and no others; vectors are given by their length."""
        self.assertEqual(set(group.attrs), set(kinds))
        for name, kind in kinds.items():
            value = group.attrs[name]
            if isinstance(kind, int):
                self.assertEqual(value.shape, (kind,), name)
            else:
                self.assertEqual(np.shape(value), (), name)
                self.assertIsInstance(value, kind, name)

    def check_layout(self, d, scheme="dual"):
        """The whole layout, for the column in d dimensions."""
        file = self.results("column.vtkhdf")
        root = file["VTKHDF"]
        self.assertEqual(root.attrs["Version"].tolist(), [2, 0])
        self.assertEqual(root.attrs["Type"], b"UnstructuredGrid")
        self.assertEqual(root.attrs.get_id("Type").dtype.itemsize, len("UnstructuredGrid"))
        points, cells = root["NumberOfPoints"][:].sum(), root["NumberOfCells"][:].sum()
        ids = root["NumberOfConnectivityIds"][:].sum()
        self.check_shapes(root, {
            "NumberOfPoints": ((2,), "i"), "NumberOfCells": ((2,), "i"), "NumberOfConnectivityIds": ((2,), "i"),
            "Points": ((points, 3), "f"), "Connectivity": ((ids,), "i"), "Offsets": ((cells + 2,), "i"),
            "Types": ((cells,), "u")})
        self.assertEqual(root["Types"].dtype, np.uint8)
        self.check_shapes(root["PointData"], {
            "displacement": ((points, 3), "f"), "contact_pressure": ((points,), "f"), "penetration": ((points,), "f"),
            "contact_traction": ((points, 3), "f"), "contact_gap": ((points,), "f"), "contact_status": ((points,), "i"),
            "reaction_force": ((points, 3), "f"), "nodal_stress": ((points, 6), "f"), "nodal_von_mises": ((points,), "f"),
            "nodal_principal_stress": ((points, 3), "f"), "node_tag": ((points,), "i")})
        self.check_shapes(root["CellData"], {
            "body": ((cells,), "i"), "material": ((cells,), "i"), "element_tag": ((cells,), "i"), "stress": ((cells, 6), "f"),
            "von_mises": ((cells,), "f"),
            "discretization_error": ((cells,), "f")})
        self.assertEqual(root["CellData/body"][:].tolist(), np.repeat([1, 2], root["NumberOfCells"][:]).tolist())
        # von Mises of the mean stress, from its components xx yy zz xy yz xz
        xx, yy, zz, xy, yz, xz = root["CellData/stress"][:].T
        mises = np.sqrt(((xx - yy)**2 + (yy - zz)**2 + (zz - xx)**2) / 2 + 3 * (xy**2 + yz**2 + xz**2))
        np.testing.assert_allclose(root["CellData/von_mises"][:], mises, rtol=1e-9)

        own = file["dotyk"]
        self.assertEqual(set(own), {"summary", "history", "contact", "timing", "bodies", "supports", "loads"})
        for name in ("version", "command_line", "compiler", "started", "input"):
            self.assertIsInstance(own.attrs[name], (str, bytes), name)
        self.assertEqual(own.attrs["threads"], 1)
        self.assertEqual(as_text(own.attrs["input"]).strip(), (self.folder / "column.nml").read_text().strip())
        self.assertIn("column.nml --verbose --threads 1", as_text(own.attrs["command_line"]))
        self.assertRegex(as_text(own.attrs["started"]), r"^20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d")

        summary = own["summary"].attrs
        real, integer = np.floating, np.integer
        kinds = {"converged": integer, "iterations": integer, "body_solves": integer, "gamma": real, "lambda_max": real,
                 "q_predicted": real, "q_measured": real, "error_bound": real, "error_bound_paper": real,
                 "energy": real, "strain_energy": real, "load_work": real, "penalty_energy": real,
                 **{name: real for name in CONSTANTS},
                 "error_penalty": real, "error_discretization": real, "error_contact": real, "energy_norm": real,
                 "max_penetration": real, "penetration_depth": real}
        for name, kind in kinds.items():
            self.assertEqual(np.shape(summary[name]), (), name)
            self.assertIsInstance(summary[name], kind, name)
        self.assertEqual(as_text(summary["scheme"]), scheme)
        n = summary["iterations"]
        self.assertGreaterEqual(n, 1)
        if scheme == "neumann":
            self.assertGreater(summary["body_solves"], n)
            self.assertAlmostEqual(summary["gamma"], 2 / (2 + summary["lambda_max"]), delta=1e-12)
            # G = A in the energy norm: B = 1, D = L.
            large = 1 + summary["lambda_max"]
            for name, value in (("coercivity", 1), ("penalty_constant", large - 1), ("smoothness", large),
                                ("gamma_limit", 2 / large), ("gamma_2", 2 / large**2), ("gamma_theory", 1 / large**2),
                                ("q_theory", np.sqrt(1 - 1 / large**2))):
                self.assertAlmostEqual(summary[name] / value, 1, delta=1e-12, msg=name)
            self.assertUnknown(summary["q_paper"])
        else:
            for name in ("gamma", *CONSTANTS):
                self.assertUnknown(summary[name])
        self.assertAlmostEqual(summary["strain_energy"] - summary["load_work"] + summary["penalty_energy"],
                               summary["energy"], delta=1e-12 * summary["strain_energy"])

        history = own["history"]
        self.check_shapes(history, {"iteration": ((n,), "i"), "active": ((n,), "i"), **{
            name: ((n,), "f") for name in ("seconds", "increment", "error_bound", "error_bound_paper", "error_penalty",
                                           "error_discretization", "energy", "max_penetration")}})
        self.assertTrue(np.isnan(history["error_bound_paper"][:]).all())
        self.assertEqual(history["iteration"][:].tolist(), list(range(1, n + 1)))
        for name in ("error_bound", "error_penalty", "error_discretization", "energy", "max_penetration"):
            self.assertEqual(history[name][-1], summary[name], name)
        self.assertGreaterEqual(np.diff(history["seconds"][:]).min(initial=0), 0)
        # F falls to its minimum.
        energy = history["energy"][:]
        self.assertLessEqual(np.diff(energy).max(initial=0), 1e-9 * abs(energy[-1]))

        self.assertEqual(set(own["contact"]), {"joint"})
        joint = own["contact/joint"]
        m = joint["weight"].shape[0]
        self.check_shapes(joint, {
            **{name: ((m,), "f") for name in ("weight", "theta", "gap_initial", "gap_uncertainty", "gap", "pressure",
                                              "pressure_projected")},
            **{name: ((m, 3), "f") for name in ("position", "normal")},
            **{"patch_" + name: ((1,), "f") for name in ("area", "force", "half_axis_long", "half_axis_short")},
            "patch_centre": ((1, 3), "f")})
        self.assertEqual(joint.attrs["force"].shape, (3,))
        for name in ("theta", "force_uncertainty", "contact_area_uncertainty", "displacement_uncertainty"):
            self.assertEqual(np.shape(joint.attrs[name]), (), name)
        normal = joint["normal"][:]
        # n = -n_b: into surface_b, which lies below.
        np.testing.assert_allclose(normal, np.eye(3)[[d - 1] * m] * -1, rtol=0, atol=1e-12)
        weighted = joint["weight"][:] * joint["pressure"][:]
        np.testing.assert_allclose(joint.attrs["force"], -weighted @ normal, rtol=1e-9, atol=1e-12)
        if d == 2:
            for array in (root["Points"], root["PointData/displacement"], joint["position"], joint["normal"]):
                np.testing.assert_array_equal(array[:, 2], 0)

        timing = {name: real for name in ("read", "assemble", "order", "factorize", "search", "iterate", "recover",
                                          "estimate", "check", "write", "total")}
        self.check_attributes(own["timing"], timing)
        times = own["timing"].attrs
        parts = sum(times[name] for name in timing if name != "total")
        self.assertLessEqual(parts, times["total"] * (1 + 1e-9) + 1e-3)
        self.assertGreater(parts, 0.8 * times["total"])

    def check_vtk(self, *options):
        """VTK's own reader sees the same; skipped where VTK is not installed."""
        script = dotyk_case.ROOT / "tests/support/check_vtk.py"
        done = subprocess.run([sys.executable, "-B", script, self.folder / "column.vtkhdf", *options],
                              text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode == 77:
            self.skipTest(done.stdout.strip())
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_layout(self):
        self.column(("hex20", "tet10"))
        self.check_layout(3)
        self.assertEqual([path.name for path in self.folder.iterdir() if "tmp" in path.name], [])

    def test_layout_of_the_neumann_scheme(self):
        self.column(("hex8", "tet10"), solver="scheme='neumann', response='full', theta_relative=1e-1")
        self.check_layout(3, "neumann")

    def test_layout_in_the_plane(self):
        self.column(("quad9", "tri6"))
        self.check_layout(2)

    def test_greatest_values_in_the_log(self):
        """Values, bodies and places are those of the fields."""
        for kinds in (("hex20", "tet10"), ("tri6", "quad8")):
            log = self.column(kinds)
            root = self.results("column.vtkhdf")["VTKHDF"]
            ends = np.cumsum(root["NumberOfPoints"][:])
            for word, field in (("displacement", np.linalg.norm(root["PointData/displacement"][:], axis=1)),
                                ("von Mises", root["PointData/nodal_von_mises"][:])):
                found = re.search(r"^  %s +greatest (\S+) in '(\w+)' at \((\S+), (\S+), (\S+)\)$" % word, log, re.M)
                self.assertAlmostEqual(float(found[1]) / field.max(), 1, delta=1e-4)
                # Both bodies have nodes where they touch.
                body = slice(0, ends[0]) if found[2] == "lower" else slice(ends[0], ends[1])
                at = np.linalg.norm(root["Points"][body] - [float(v) for v in found.groups()[2:]], axis=1).argmin()
                self.assertAlmostEqual(field[body][at] / field.max(), 1, delta=1e-6)

    def test_vtk(self):
        self.column(("prism18", "hex27"))
        self.check_vtk("--straight", "--volumes", "1", "1")

    def test_vtk_in_the_plane(self):
        self.column(("tri6", "quad8"))
        self.check_vtk("--straight", "--volumes", "1", "1")

    def test_replaced(self):
        """New results take the place of older ones by renaming: who has the older file open still reads it."""
        self.column()
        path = self.folder / "column.vtkhdf"
        with open(path, "rb") as file:
            older = file.read()
            node = os.fstat(file.fileno()).st_ino
            self.dotyk("column.nml")
            self.assertNotEqual(os.stat(path).st_ino, node)
            file.seek(0)
            self.assertEqual(file.read(), older)
        self.assertEqual(sorted(p.suffix for p in self.folder.iterdir() if p.name.startswith("column")),
                         [".nml", ".vtkhdf"])

    def test_kept_after_a_failure(self):
        """Runs that fail leave older results as they are: bad input, a body that is not held."""
        self.column()
        older = (self.folder / "column.vtkhdf").read_bytes()
        text = (self.folder / "column.nml").read_text()
        for pattern, new, code in (("volume='block'", "volume='blok'", 2),
                                   ("surface='bottom', fix='z' /",
                                    "surface='bottom', fix='x' /\n&load body='lower', surface='bottom', pressure=-1 /",
                                    3)):
            self.assertIn(pattern, text)
            self.write("column.nml", text.replace(pattern, new))
            self.dotyk("column.nml", code=code)
            self.assertEqual((self.folder / "column.vtkhdf").read_bytes(), older)
        self.assertEqual(sorted(p.suffix for p in self.folder.iterdir() if p.name.startswith("column")),
                         [".nml", ".vtkhdf"])

    def test_described(self):
        """docs/results.md has every group, dataset and attribute of the file in its tables, and no other."""
        self.column()
        file = self.results("column.vtkhdf")
        described = described_names((dotyk_case.ROOT / "docs/results.md").read_text())
        self.assertEqual(described.pop("/VTKHDF"), set(file["VTKHDF"]) - {"PointData", "CellData"} | {
            "%s/%s" % (group, name) for group in ("PointData", "CellData") for name in file["VTKHDF"][group]})
        found = {"/dotyk": set(file["dotyk"].attrs)}
        for name in ("summary", "history", "timing", "bodies", "supports", "loads"):
            found["/dotyk/" + name] = {*file["dotyk"][name], *file["dotyk"][name].attrs}
        found["/dotyk/contact/NAME"] = {*file["dotyk/contact/joint"], *file["dotyk/contact/joint"].attrs}
        self.write("tied.nml", re.sub(r"&contact[^/]*(surface_a=\S+ *surface_b='[^']*')[^/]*/", r"&tie name='joint', \1 /",
                                      (self.folder / "column.nml").read_text()))
        self.dotyk("tied.nml")
        ties = self.results("tied.vtkhdf")["dotyk/ties"]
        found["/dotyk/ties"] = {*ties, *ties.attrs}
        self.write("rigid.nml", re.sub(r"&support body='lower'[^/]*/", "", (self.folder / "column.nml").read_text())
                   + "&rigid_body body='lower', fix='xyz rx ry rz' /\n")
        self.dotyk("rigid.nml")
        rigid = self.results("rigid.vtkhdf")["dotyk/rigid_bodies"]
        found["/dotyk/rigid_bodies"] = {*rigid, *rigid.attrs}
        self.write("bars.nml", re.sub(r"&output", "&output quantity='force:*', ", (self.folder / "column.nml").read_text()))
        self.dotyk("bars.nml")
        bars = self.results("bars.vtkhdf")["dotyk/quantities"]
        found["/dotyk/quantities"] = {*bars, *bars.attrs}
        self.maxDiff = None
        self.assertEqual(described, found)

    def test_nodes_of_several_pairs(self):
        """A block on two others, and beside a wall: the pressures of all nodes are those of the load, on the edge
        between two pairs, too; at the edge of two faces the greater one, with the tractions of both."""
        self.write("up.geo", block_geo("hex20", 3, (0, 0, 1), (2, 1, 1)))
        self.write("low.geo", block_geo("hex8", 2))
        self.write("wall.geo", block_geo("hex8", 2, (-1, 0, 1)))
        lines = ["&scene /", "&material name='m', young=1e3, poisson=0 /", "&solver theta=0, tolerance=1e-10 /"]
        for name, mesh, at in ("up", "up", 0), ("left", "low", 0), ("right", "low", 1), ("wall", "wall", 0):
            lines.append("&body name='%s', mesh='%s.geo', volume='block', material='m', at=%d,0,0 /" % (name, mesh, at))
        for name in "left", "right", "wall":
            lines.append("&support body='%s', surface='*', fix='xyz' /" % name if name == "wall" else
                         "&support body='%s', surface='bottom', fix='xyz' /" % name)
        lines += ["&support body='up', surface='sides y', fix='y' /",
                  "&load body='up', surface='top', pressure=2 /", "&load body='up', force_density=-0.5,0,0 /",
                  "&contact name='left', surface_a='up:bottom', surface_b='left:top' /",
                  "&contact name='right', surface_a='right:top', surface_b='up:bottom' /",
                  "&contact name='wall', surface_a='up:sides x', surface_b='wall:sides x', search_radius=0.1 /"]
        self.write("several.nml", "\n".join(lines) + "\n")
        self.dotyk("several.nml")
        file = self.results("several.vtkhdf")
        n = file["VTKHDF/NumberOfPoints"][0]
        x, p = file["VTKHDF/Points"][:n], file["VTKHDF/PointData/contact_pressure"][:n]
        traction = file["VTKHDF/PointData/contact_traction"][:n]
        low, side = np.isclose(x[:, 2], 1), np.isclose(x[:, 0], 0)
        self.assertTrue((low & np.isclose(x[:, 0], 1)).any())
        np.testing.assert_allclose(p[low], 2, rtol=1e-6)
        np.testing.assert_allclose(p[side & ~low], 1, rtol=1e-6)
        np.testing.assert_allclose(traction[low & ~side], np.tile([0, 0, 2], (sum(low & ~side), 1)), atol=1e-6)

    def test_kernels(self):
        """OpenBLAS takes kernels for the processor, also for one that is newer than it; or those that the user wants."""
        self.column()
        name = str(self.results("column.vtkhdf")["dotyk"].attrs["blas"])
        flags = re.search(r"(?m)^flags.*", pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        if flags and {"avx2", "fma"} <= set(flags[0].split()):
            self.assertNotIn("[Prescott]", name)
            self.dotyk("column.nml", OPENBLAS_CORETYPE="Nehalem")
            self.assertIn("[Nehalem]", str(self.results("column.vtkhdf")["dotyk"].attrs["blas"]))

    def test_no_fields(self):
        self.column(output="fields=''")
        root = self.results("column.vtkhdf")["VTKHDF"]
        self.assertEqual(set(root["PointData"]), {"node_tag"})
        self.assertEqual(set(root["CellData"]), {"body", "material", "element_tag"})

    def test_stress_only(self):
        self.column(output="fields='stress'")
        file = self.results("column.vtkhdf")
        self.assertEqual(set(file["VTKHDF/PointData"]), {"node_tag"})
        self.assertEqual(set(file["VTKHDF/CellData"]), {"body", "material", "element_tag", "stress", "von_mises"})
        pressure = abs(file["dotyk/contact/joint"].attrs["force"][2])
        zz = file["VTKHDF/CellData/stress"][:, 2]
        np.testing.assert_allclose(zz, zz[0], rtol=1e-6)
        self.assertAlmostEqual(zz[0] / -pressure, 1, delta=1e-6)

    def test_named_output(self):
        """--output is relative to the working directory, output to the namelist file; other folders, blanks in
        names."""
        (self.folder / "my results").mkdir()
        self.column()
        self.dotyk("column.nml", "--output", "my results/a.vtkhdf")
        self.results("my results/a.vtkhdf")
        (self.folder / "scene").mkdir()
        for name in ("column.nml", "lower.geo", "upper.geo"):
            (self.folder / name).rename(self.folder / "scene" / name)
        text = (self.folder / "scene/column.nml").read_text()
        self.write("scene/column.nml", text.replace("&scene ", "&scene output='../my results/b.vtkhdf', "))
        self.dotyk("scene/column.nml")
        self.results("my results/b.vtkhdf")


def described_names(page):
    """Names in the first columns of the page's tables, by the group that the section's title names."""
    names = {}
    for line in page.splitlines():
        title = re.match(r"## `(/[^`]*)`", line)
        if title:
            group = names.setdefault(title.group(1), set())
        elif line.startswith("| `"):
            group.update(re.findall(r"`([^`]+)`", line.split("|")[1]))
    return names


def as_text(value):
    """An attribute as str."""
    return value.decode() if isinstance(value, bytes) else str(value)


dotyk_case.main()
