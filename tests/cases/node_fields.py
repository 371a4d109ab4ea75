#!/usr/bin/python3
"""Temperatures from fields of the nodes in mesh files: $NodeData of gmsh, *TEMPERATURE and *INITIAL CONDITIONS of decks. Each gives the
answer of the formula that it was made from. Arrays of .vtu files are in vtu.py."""
import re
import struct
import subprocess

import numpy as np

import dotyk_case
from decks import deck

MATERIAL = "&material name='m', young=30, poisson=0.3, expansion=1e-3 /\n"
BODY = "&body name='part', volume='block', material='m', at=1,2,0 /\n"
FORMULA = "20+3*x-2*y+z"
PLACED = "3*(x-1)-2*(y-2)+z"


def heat(x):
    return 20 + 3*x[0] - 2*x[1] + x[2]


def node_data(name, values, mode="text", step=0, components=1):
    """A section of one value at each node."""
    head = '$NodeData\n1\n"%s"\n1\n%r\n3\n%d\n%d\n%d\n' % (name, 10.0*step, step, components, len(values))
    if mode == "text":
        body = "".join("%d %s\n" % (tag, " ".join([repr(value)]*components)) for tag, value in values.items()).encode()
    else:
        body = b"".join(struct.pack("<id", tag, value) for tag, value in values.items()) + b"\n"
    return head.encode() + body + b"$EndNodeData\n"


class NodeFields(dotyk_case.Case):
    def answers(self, mesh, groups, cases=("a", "b")):
        """Displacements and energies of load cases."""
        self.write("part.nml", "&scene mesh='%s' /\n" % mesh + MATERIAL + BODY + self.hold +
                   "".join("&case name='%s' /\n" % case for case in cases) + "".join("&temperature body='part', %s /\n" % g for g in groups))
        self.dotyk("part.nml")
        file = self.results("part.vtkhdf")
        found = file["VTKHDF/PointData/displacement"][:], [file["dotyk/cases"][case + "/summary"].attrs["energy_norm"] for case in cases]
        file.close()
        return found

    def compare(self, mesh, fields, formulas):
        """Fields of the mesh against formulas."""
        (u, energy), (v, other) = self.answers(mesh, fields), self.answers(mesh, formulas)
        self.assertGreater(np.abs(v).max(), 1e-3)
        np.testing.assert_allclose(u, v, rtol=0, atol=1e-12*np.abs(v).max())
        np.testing.assert_allclose(energy, other, rtol=1e-11)

    def refused(self, mesh, given, message):
        with self.subTest(message):
            self.write("part.nml", "&scene mesh='%s' /\n" % mesh + MATERIAL + BODY + self.hold + "&temperature body='part', %s /\n" % given)
            self.assertIn(message, self.dotyk("part.nml", code=2))

    def gmsh(self, order):
        """The mesh of a block in each format, and its nodes."""
        self.write("part.geo", 'SetFactory("OpenCASCADE"); Box(1) = {0,0,0,1,1,1}; Mesh.MeshSizeMin = 0.5; Mesh.ElementOrder = %d;\n'
                   'Physical Volume("block") = {1}; Physical Surface("foot") = {5};\n' % order)
        files = {}
        for version in ("2.2", "4.1"):
            for mode in ("text", "binary"):
                path = self.folder / "mesh.msh"
                command = ["gmsh", "-3", "part.geo", "-format", "msh" + version.replace(".", ""), "-o", path.name]
                subprocess.run(command + ["-bin"]*(mode == "binary"), cwd=self.folder, check=True, capture_output=True)
                files[version, mode] = path.read_bytes()
        lines = files["2.2", "text"].decode().split("\n")
        first = lines.index("$Nodes") + 2
        return files, {int(line.split()[0]): [float(c) for c in line.split()[1:]] for line in lines[first:lines.index("$EndNodes")]}

    def test_node_data(self):
        self.hold = "&support body='part', surface='foot', fix='xyz' /\n"
        for order in (1, 2):
            files, nodes = self.gmsh(order)
            for (version, mode), content in files.items():
                with self.subTest(order=order, version=version, mode=mode):
                    values = {tag: heat(x) for tag, x in nodes.items()}
                    # A field in two sections, as partitions write it.
                    some = {tag: value for tag, value in values.items() if tag % 3}
                    rest = {tag: value for tag, value in values.items() if tag % 3 == 0}
                    (self.folder / "mesh.msh").write_bytes(
                        content + node_data("T", values, mode) + node_data("other", {1: 7.0}, mode, 1) +
                        node_data("T 2", {n: 2*v for n, v in some.items()}, mode) + node_data("T 2", {n: 2*v for n, v in rest.items()}, mode))
                    self.compare("mesh.msh", ("field='T', reference=20, case='a'", "field='T 2', case='b'"),
                                 ("formula='%s', case='a'" % PLACED, "formula='40+2*(%s)', case='b'" % PLACED))
        mesh = files["4.1", "text"]
        for section, given, message in (
                (node_data("T", values), "field='heat'", "mesh.msh: the nodes have no field 'heat'; they have 'T'"),
                (b"", "field='T'", "the nodes have no field 'T'; they have none"),
                (node_data("T", values) + node_data("T", values, step=4), "field='T'", "field 'T' has several time steps, 0 and 4"),
                (node_data("T", values, components=3), "field='T'", "field 'T' has 3 components, it must have one"),
                (node_data("T", values).replace(b"$EndNodeData", b"9 1.0\n$EndNodeData"), "field='T'", "expected $EndNodeData"),
                (node_data("T", {tag: value for tag, value in values.items() if tag != 5}), "field='T'",
                 "part.nml:5: body 'part': the temperature: mesh.msh: field 'T' has no value at node 5"),
                (node_data("T", {**values, 5: float("nan")}), "field='T'", "expected a finite number")):
            (self.folder / "mesh.msh").write_bytes(mesh + section)
            self.refused("mesh.msh", given, message)
        self.refused("part.geo", "field='T'", "and this is a geometry, 'part.geo'")

    def test_temperatures_of_decks(self):
        """Nodes, sets, initial temperatures, and steps that go on, replace, and begin anew."""
        self.hold = "&support body='part', surface='foot', fix='xyz' /\n"
        for kind, shape in (("C3D8", "hex"), ("C3D10", "tet")):
            with self.subTest(kind):
                mesh = deck(kind, shape)
                nodes = {int(w[0]): [float(c) for c in w[1:]] for w in (line.split(",") for line in mesh.split("*Element")[0].split("\n")[1:-1])}
                mesh += "*NSET, NSET=foot\n" + "\n".join(str(n) for n, x in nodes.items() if x[2] == 0) + "\n"
                start = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nAll, 20.\n*INITIAL CONDITIONS, TYPE=STRESS\nblock, 1., 1., 1., 0., 0., 0.\n"
                each = "".join("%d, %r\n" % (n, heat(x)) for n, x in nodes.items())
                twice = "".join("%d, %r\n" % (n, 2*heat(x)) for n, x in nodes.items())
                self.write("part.inp", mesh + start + "*STEP\n*STATIC\n*TEMPERATURE\nAll, 1.\n" + each + "*END STEP\n*STEP, PERTURBATION\n"
                           "*TEMPERATURE\nALL, 99.\n*END STEP\n*STEP\n*STATIC\n*END STEP\n*STEP\n*TEMPERATURE, OP=NEW\n" + twice +
                           "*END STEP\n*STEP\n*TEMPERATURE, OP=NEW\n*END STEP\n")
                self.compare("part.inp", ("field='temperature step 1', reference=20, case='a'", "field='temperature step 4', case='b'"),
                             ("formula='%s', case='a'" % PLACED, "formula='40+2*(%s)', case='b'" % PLACED))
                self.compare("part.inp", ("field='temperature step 3', reference=20, case='a'", "field='temperature step 5', case='b'"),
                             ("formula='%s', case='a'" % PLACED, "value=20, case='b'"))
        self.refused("part.inp", "field='temperature'", "part.inp: the nodes have no field 'temperature'; they have 'initial_temperature', "
                     "'temperature step 1', 'temperature step 3', 'temperature step 4', 'temperature step 5'")
        self.refused("part.inp", "field='temperature step 6'", "the nodes have no field 'temperature step 6'; they have 'initial_temperature'")
        self.refused("part.inp", "field='temperature step 2'", "the nodes have no field 'temperature step 2'")
        self.write("part.inp", mesh + start + "*STEP\n*TEMPERATURE\n" + each)
        self.compare("part.inp", ("field='temperature', case='a'", "field='initial_temperature', case='b'"),
                     ("formula='20+%s', case='a'" % PLACED, "value=20, case='b'"))
        self.write("part.nml", "&scene mesh='part.inp' /\n" + MATERIAL + BODY + self.hold)
        self.assertIn("part.inp, read as a mesh: fields at nodes: 'initial_temperature', 'temperature', 'temperature step 1'; not read: ",
                      self.dotyk("--check", "part.nml"))
        self.refused("part.inp", "field='T'", "the nodes have no field 'T'; they have 'initial_temperature', 'temperature', 'temperature step 1'")
        self.write("part.inp", mesh + "*STEP\n*TEMPERATURE\n" + re.sub("(?m)^5, .*\n", "", each))
        self.refused("part.inp", "field='temperature'",
                     "part.nml:5: body 'part': the temperature: part.inp: field 'temperature' has no value at node 5")
        self.refused("part.inp", "field='initial_temperature'", "they have 'temperature', 'temperature step 1'")
        lines = mesh.count("\n")
        for more, message in (("*TEMPERATURE\nnone, 3.\n", "part.inp:%d: there is no node set 'none' above this line" % (lines + 2)),
                              ("*TEMPERATURE\n5, hot\n", "part.inp:%d: expected a finite number, found 'hot'" % (lines + 2)),
                              ("*TEMPERATURE, FILE=hot.frd\n", "the nodes have no field 'temperature'; they have none"),
                              ("", "the nodes have no field 'temperature'; they have none")):
            self.write("part.inp", mesh + more)
            self.refused("part.inp", "field='temperature'", message)
        self.write("part.inp", mesh + "*TEMPERATURE, FILE=hot.frd\n")
        self.write("part.nml", "&scene mesh='part.inp' /\n" + MATERIAL + BODY + self.hold)
        self.assertIn("not read: *TEMPERATURE with FILE or USER (part.inp:%d)" % (lines + 1), self.dotyk("--check", "part.nml"))


if __name__ == "__main__":
    dotyk_case.main()
