#!/usr/bin/python3
"""dotyk-convert: decks of CalculiX and Abaqus become scenes, whose answers are exact; what is not carried over is said."""
import re
import subprocess
import sys

import numpy as np

import dotyk_case
from decks import CUBE, HEXAHEDRON, SHAPES, corners

TOOL = [sys.executable, "-Bm", "dotyk.convert", "deck.inp"]
YOUNG, AREA = 200.0, 1.0
# A unit cube on another one, 0.001 apart: nodes 11 to 18, element 2.
UPPER = "".join("%d, %g, %g, %g\n" % (11 + i, x, y, z + 1.001) for i, (x, y, z) in enumerate(HEXAHEDRON))
TWO = (CUBE + UPPER + "*ELEMENT, TYPE=C3D8, ELSET=Eall\n1, 1,2,3,4,5,6,7,8\n2, 11,12,13,14,15,16,17,18\n*NSET, NSET=foot\n1, 2, 3, 4\n"
       "*NSET, NSET=head, GENERATE\n15, 18\n*NSET, NSET=Nupper, GENERATE\n11,18\n*NSET, NSET=Nlower, GENERATE\n1,8\n*BOUNDARY\nfoot, 1, 3\n"
       "Nlower, 1, 2\nNupper, 1, 2\n*MATERIAL, NAME=M\n*ELASTIC\n200., 0.\n%s*SOLID SECTION, ELSET=Eall, MATERIAL=M\n*SURFACE, NAME=low\n1, S2\n"
       "*SURFACE, NAME=up\n2, S1\n*SURFACE, NAME=top\n2, S2\n*SURFACE INTERACTION, NAME=I\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=%s\n"
       "*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE\nup, low\n*STEP\n*STATIC\n%s*NODE PRINT, NSET=head\nU\n*END STEP\n")


class Inp2Dotyk(dotyk_case.Case):
    def convert(self, text, code=0):
        """The namelist of a deck, and what the tool says."""
        self.write("deck.inp", text)
        done = subprocess.run([*TOOL, "-o", "deck.nml"], cwd=self.folder, text=True, capture_output=True)
        self.assertEqual(done.returncode, code, done.stderr)
        return (self.folder / "deck.nml").read_text() if code < 2 else "", done.stderr

    def shortening(self, text, code=0):
        """Mean displacement of the top of the upper cube, downwards."""
        self.convert(text, code)
        self.dotyk("deck.nml")
        file = self.results("deck.vtkhdf")
        tags = file["VTKHDF/PointData/node_tag"][:]
        return -file["VTKHDF/PointData/displacement"][:][(tags >= 15) & (tags <= 18), 2].mean()

    def test_overwriting(self):
        """A scene beside the deck, perhaps made by hand, is kept."""
        self.write("deck.inp", TWO % ("", "HARD", "*CLOAD\nhead, 3, -1.\n"))
        self.write("deck.nml", "by hand")
        done = subprocess.run(TOOL, cwd=self.folder, text=True, capture_output=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("deck.nml exists", done.stderr)
        self.assertEqual((self.folder / "deck.nml").read_text(), "by hand")

    def test_column(self):
        """Gap, penalty 1/K, and one force as nodal forces, pressure and pressure of a surface."""
        exact = 0.001 + 2*4/(YOUNG*AREA)
        for load in ("*CLOAD\nhead, 3, -1.\n", "*DLOAD\n2, P2, 4.\n", "*DSLOAD\ntop, P, 4.0D0\n"):
            with self.subTest(load):
                self.assertAlmostEqual(self.shortening(TWO % ("", "HARD", load)), exact, delta=1e-10)
                self.assertAlmostEqual(self.shortening(TWO % ("", "LINEAR\n1.E4, 1.", load)), exact + 4e-4, delta=1e-10)

    def test_given_displacement(self):
        self.assertAlmostEqual(self.shortening(TWO % ("", "HARD", "*BOUNDARY\nhead, 3, 3, -0.02\n")), 0.02, delta=1e-12)
        self.assertIn("fix='xyz', value=0, 0, -0.02 /", (self.folder / "deck.nml").read_text())

    def test_loads_of_volumes(self):
        """Gravity, rotation about x through the foot, and heat: by hand."""
        density = "*DENSITY\n2.\n*EXPANSION\n1.e-3\n"
        # rho g (L^2/2 of the lower one, and the upper one's weight, and its own)/E
        self.assertAlmostEqual(self.shortening(TWO % (density, "HARD", "*DLOAD\nEall, GRAV, 10., 0., 0., -2.\n")),
                               0.001 + 2*10*(0.5 + 1 + 0.5)/YOUNG, delta=1e-10)
        text, _ = self.convert(TWO % (density, "HARD", "*DLOAD\nEall, CENTRIF, 4., 0.5, 0.5, 0., 0., 0., 3.\n"))
        self.assertIn("&load body='body_1', angular_velocity=0, 0, 2, centre=0.5, 0.5, 0 /", text)
        self.assertIn("density=2, expansion=0.001 /", text)
        heat = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 20.\n"
        deck = TWO.replace("*NODE\n", "*NODE, NSET=Nall\n") % (density, "HARD", "*TEMPERATURE\nNall, 30.\n*CLOAD\nhead, 3, -1.\n")
        self.assertAlmostEqual(self.shortening(deck.replace("*STEP\n", heat + "*STEP\n")), 0.001 + 2*4/YOUNG - 2*10*1e-3, delta=1e-10)
        # only above one initial temperature of a body
        text, said = self.convert(deck.replace("*STEP\n", heat + "foot, 25.\n*STEP\n"), code=1)
        self.assertIn("deck.inp:56: temperatures of body body_1 of which some nodes have none, or above initial temperatures that differ", said)

    def test_temperatures_of_nodes(self):
        """Heat that differs from node to node, in two steps: free cubes bend as by a formula."""
        nodes = {int(w[0]): [float(c) for c in w[1:]] for w in re.findall(r"(?m)^(\d+), *([-\d.]+), *([-\d.]+), *([-\d.]+)$", CUBE)}
        upper = "".join("%d, %r\n" % (n + 10, 20 + 30*x[2]) for n, x in nodes.items())
        heat = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNall, 20.\n"
        deck = TWO.replace("*NODE\n", "*NODE, NSET=Nall\n").replace("*STEP\n", heat + "*STEP\n", 1) % (
            "*EXPANSION\n1.e-3\n", "HARD", "*TEMPERATURE\n" + upper + "*CLOAD\nhead, 3, -1.\n*END STEP\n*STEP\n*STATIC\n*TEMPERATURE\n11, 50.\n")
        text, _ = self.convert(deck)
        for step in (1, 2):
            self.assertIn("&temperature body='body_2', field='temperature step %d', reference=20, case='step %d' /" % (step, step), text)
        self.assertNotIn("&temperature body='body_1'", text)
        by_field = self.results_by_case()
        self.write("deck.nml", text.replace("field='temperature step 1', reference=20", "formula='30*(z-1.001)'"))
        self.assertAlmostEqual(by_field[0], self.results_by_case()[0], delta=1e-12)
        self.assertGreater(abs(by_field[1] - by_field[0]), 1e-3)
        said = self.convert(deck.replace("Nall, 20.", "11, 20."), code=1)[1]
        self.assertIn("temperatures of body body_2 of which some nodes have none", said)

    def test_forces_of_quadratic_elements(self):
        """Nodal forces of a uniform traction: -1/12 and 1/3 of a face with eight nodes, 0 and 1/3 of one with six."""
        for kind, shape, corner, side, area in (("C3D20", "hex", -1/12, 1/3, 1.0), ("C3D10", "tet", 0.0, 1/3, 0.5)):
            x = [HEXAHEDRON[i] for i in (range(8) if shape == "hex" else (0, 1, 3, 4))]
            edges = corners(SHAPES[shape][0])
            x += [tuple((x[a][k] + x[b][k])/2 for k in range(3)) for a, b in edges]
            n = len(x)
            face = [i for i in range(n) if x[i][2] == 0]
            force = "".join("%d, 1, %.9f\n" % (i + 1, 7*(corner if i < (8 if shape == "hex" else 4) else side)) for i in face)
            nodes = [i + 1 for i in range(n)]
            deck = ("*NODE\n" + "".join("%d, %g, %g, %g\n" % (i + 1, *p) for i, p in enumerate(x)) + "*ELEMENT, TYPE=%s, ELSET=E\n1, " % kind +
                    ",\n".join(", ".join(map(str, nodes[i:i + 10])) for i in range(0, n, 10)) +
                    "\n*MATERIAL, NAME=M\n*ELASTIC\n1, 0.3\n*SOLID SECTION, ELSET=E, MATERIAL=M\n*STEP\n*STATIC\n*CLOAD\n" + force + "*END STEP\n")
            if shape == "tet":
                # nodes without force are no part of what is loaded
                text, _ = self.convert(deck)
                self.assertIn("&load body='E', nodes='force_1_x_nodes', traction=2.333333333, 0, 0 /", text)
                continue
            found = re.search(r"&load body='E', surface='force_1_x', traction=(\S+), 0, 0 /", self.convert(deck)[0])
            self.assertAlmostEqual(float(found.group(1)), 7/area, delta=1e-6)

    def test_nodes_of_no_whole_face(self):
        """A cube that three nodes hold, under forces of single nodes in two steps: stress and reactions as the deck has them."""
        deck = (CUBE + "*ELEMENT, TYPE=C3D8, ELSET=E\n1, 1,2,3,4,5,6,7,8\n*NSET, NSET=two\n5, 6\n*BOUNDARY\n1, 1, 3\n2, 2, 3\n4, 3\n"
                "*MATERIAL, NAME=M\n*ELASTIC\n200., 0.\n*SOLID SECTION, ELSET=E, MATERIAL=M\n*STEP\n*STATIC\n*CLOAD\ntwo, 3, 1.\n7, 3, 2.\n"
                "*END STEP\n*STEP\n*STATIC\n*CLOAD\n7, 3, 1.\n8, 3, 1.\n1, 3, -1.\n2, 3, -1.\n3, 3, -1.\n4, 3, -1.\n*BOUNDARY\n4, 3, 3, 0.5\n*END STEP\n")
        text, said = self.convert(deck.replace("3, 3, 0.5", "3"))
        self.assertEqual(said, "")
        for line in ("&support body='E', nodes='fix_1', fix='xyz' /", "&support body='E', nodes='fix_2', fix='yz' /",
                     "&support body='E', nodes='fix_3', fix='z' /", "&load body='E', nodes='force_1_z_nodes', traction=0, 0, 1, case='step 1' /",
                     "&load body='E', nodes='force_1_z_nodes_', traction=0, 0, 2, case='step 1' /"):
            self.assertIn(line, text)
        self.dotyk("deck.nml")
        cases = self.results("deck.vtkhdf")["dotyk/cases"]
        force = cases["step 1/supports/force"][:]
        np.testing.assert_allclose(force.sum(axis=0), (0, 0, -4), atol=1e-9)
        np.testing.assert_allclose(cases["step 2/supports/force"][:], 0, atol=1e-9)
        stress = self.results("deck.vtkhdf")["VTKHDF/CellData/stress"][:]
        self.assertEqual(stress.shape, (2, 6))
        np.testing.assert_allclose(stress[1], (0, 0, 4, 0, 0, 0), atol=1e-9)
        self.assertIn("value=0, 0, 0.5, case='step 2' /", self.convert(deck)[0])

    def test_materials(self):
        """Orthotropic and anisotropic constants, and engineering ones of the same material, give one answer."""
        young, poisson, shear = (200.0, 100.0, 50.0), (0.2, 0.1, 0.15), (60.0, 40.0, 30.0)
        compliance = np.diag([1/e for e in young])
        for (i, j), nu in zip(((0, 1), (0, 2), (1, 2)), poisson):
            compliance[i, j] = compliance[j, i] = -nu/young[i]
        d = np.linalg.inv(compliance)
        ortho = [d[0, 0], d[0, 1], d[1, 1], d[0, 2], d[1, 2], d[2, 2], *shear]
        rows = np.zeros((6, 6))
        rows[:3, :3] = d
        rows[range(3, 6), range(3, 6)] = shear
        aniso = [rows[i, j] for j in range(6) for i in range(j + 1)]

        def lines(values):
            return "\n".join(", ".join("%.10g" % v for v in values[i:i + 8]) for i in range(0, len(values), 8)) + "\n"

        orientation = "*ORIENTATION, NAME=O\n0., 1., 0., 0., 0., 1.\n"
        for section in ("", ", ORIENTATION=O"):
            answers = []
            for elastic in (", TYPE=ENGINEERING CONSTANTS\n" + lines([*young, *poisson, *shear]), ", TYPE=ORTHO\n" + lines(ortho),
                            ", TYPE=ANISO\n" + lines(aniso)):
                deck = TWO % ("", "HARD", "*CLOAD\nhead, 3, -1.\n")
                deck = deck.replace("*ELASTIC\n200., 0.\n", "*ELASTIC" + elastic).replace("MATERIAL=M\n", "MATERIAL=M%s\n" % section)
                answers.append(self.shortening(deck.replace("*MATERIAL", orientation + "*MATERIAL")))
            for other in answers[1:]:
                self.assertAlmostEqual(other/answers[0], 1, delta=1e-8)
            # sides held: the stiffness of the axis along z
            self.assertAlmostEqual(answers[0], 0.001 + 2*4/d[1, 1] if section else 0.001 + 2*4/d[2, 2], delta=1e-8)

    def test_rotation_of_an_orientation(self):
        """A further rotation by 0, as preprocessors write it, is none; another one is told."""
        for angle, left in ("0.", False), ("30.", True):
            deck = (TWO % ("", "HARD", "*CLOAD\nhead, 3, -1.\n")).replace("MATERIAL=M\n", "MATERIAL=M, ORIENTATION=O\n")
            deck = deck.replace("*MATERIAL", "*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n3, %s\n*MATERIAL" % angle)
            self.assertEqual("the further rotation of the orientation" in self.convert(deck, code=int(left))[1], left)

    def test_op_new_of_both_kinds_of_loads(self):
        deck = TWO % ("", "HARD", "*DSLOAD\ntop, P, 4.\n*END STEP\n*STEP\n*STATIC\n*DLOAD, OP=NEW\n2, P2, 1.\n")
        self.assertIn("*DLOAD, OP=NEW: *DSLOAD of earlier steps goes on, as in Abaqus; CalculiX ends it, too", self.convert(deck, code=1)[1])

    def test_what_is_not_carried_over(self):
        """Each in a comment and on the standard error; exit code 1."""
        deck = TWO % ("*PLASTIC\n1., 0.\n", "EXPONENTIAL\n1., 2.\n*FRICTION\n0.1, 1000.", "*CLOAD\n18, 4, -1.\n*BOUNDARY\n5, 11\n")
        deck = deck.replace("*STEP\n", "*EQUATION\n2\n1,1,1.,2,1,-1.\n*STEP, NLGEOM\n", 1) + "*STEP\n*STATIC\n*END STEP\n"
        text, said = self.convert(deck, code=1)
        for message in ("material M: *PLASTIC; dotyk is linear elastic", "pressure-overclosure EXPONENTIAL: taken for hard contact",
                        "friction: contact is frictionless", "*EQUATION", "NLGEOM: displacements are small",
                        "moments and other loads of nodes (degree of freedom 4)", "degree of freedom 11 of nodes (temperature, rotation)"):
            self.assertIn(message, said)
            self.assertIn(message, text)
        self.assertEqual(said.count("\n"), text.count("! Not carried over"))

    def test_ties(self):
        """Joined by *TIE, or by tied contact: pulled as one bar."""
        for behaviour, tie in (("TIED", ""), ("HARD", "*TIE, NAME=t, POSITION TOLERANCE=0.01\nup, low\n")):
            deck = (TWO % ("", behaviour, "*CLOAD\nhead, 3, 1.\n")).replace("*STEP\n", tie + "*STEP\n")
            if tie:
                deck = deck.replace("*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE\nup, low\n", "")
            self.assertAlmostEqual(self.shortening(deck), -2*4/YOUNG, delta=1e-9)
        self.assertIn("&tie name='up - low', surface_a='body_2:up', surface_b='body_1:low', search_radius=0.01 /",
                      (self.folder / "deck.nml").read_text())
        said = self.convert(TWO % ("", "HARD", "*TIE, NAME=t, CYCLIC SYMMETRY\nup, low\n"), code=1)[1]
        self.assertIn("*TIE with cyclic symmetry", said)

    def test_refused(self):
        for text, message in ((TWO.replace("C3D8", "S8") % ("", "HARD", ""), "S8"),
                              (TWO % ("", "HARD", "*DSLOAD\nnone, P, 1.\n"), "deck.inp:49: *DSLOAD: there is no surface 'none'"),
                              ("*INCLUDE, INPUT=none.inp\n", "none.inp"), (TWO % ("", "HARD", "*CLOAD\nnone, 1, 1.\n"), "there is no set 'none'"),
                              (TWO % ("", "HARD", "*CLOAD\nEall, 1, 1.\n"), "*CLOAD: 'Eall' is a set of elements; one of nodes is needed here: "
                               "*NSET, NSET=..., ELSET=Eall makes it"),
                              (TWO % ("", "HARD", "*DLOAD\nhead, P2, 1.\n"), "*DLOAD: 'head' is a set of nodes; one of elements is needed here"),
                              (TWO % ("", "HARD", "*CLOAD\nhead, 3, -1,5\n"), "*CLOAD: 'head, 3, -1, 5' has 4 numbers, 3 at most are read: "
                               "decimals of a deck have a point"),
                              (TWO.replace("200., 0.", "200,5, 0,3") % ("", "HARD", ""), "deck.inp:34: *ELASTIC: '200, 5, 0, 3' has 4 numbers"),
                              ((TWO % ("", "HARD", "")).replace(UPPER, re.sub(r"(?<=\d)\.(?=\d)", ",", UPPER)), "decimals of a deck have a point"),
                              ("*PART, NAME=p\n" + CUBE + "*END PART\n*INSTANCE, NAME=a, PART=q\n", "deck.inp:12: there is no part 'q'")):
            self.assertIn(message, self.convert(text, code=2)[1])

    def displacements(self, name):
        """Displacements of all load cases, and the nodes."""
        self.dotyk(name + ".nml")
        file = self.results(name + ".vtkhdf")["VTKHDF"]
        return file["Points"][:], file["PointData/displacement"][:]

    def test_instances(self):
        """Two instances of an orthotropic part, the second one on its side: as a scene that copies the bodies."""
        part = ("*PART, NAME=Cube\n" + CUBE + "*ELEMENT, TYPE=C3D8, ELSET=all\n1, 1,2,3,4,5,6,7,8\n*NSET, NSET=foot\n1, 2, 3, 4\n*NSET, NSET=head, "
                "GENERATE\n5, 8\n*SURFACE, NAME=low\nall, S1\n*SURFACE, NAME=side\n1, S4\n*SURFACE, NAME=up\nall, S2\n*ORIENTATION, NAME=O\n"
                "1., 1., 0., -1., 1., 0.\n*SOLID SECTION, ELSET=all, MATERIAL=Wood, ORIENTATION=O\n,\n*END PART\n")
        assembly = ("*ASSEMBLY, NAME=A\n*INSTANCE, NAME=Lower-1, PART=Cube\n*END INSTANCE\n*INSTANCE, NAME=Upper-1, PART=Cube\n0., 1., 1.001\n"
                    "0., 1., 1.001, 1., 1., 1.001, 90.\n*END INSTANCE\n*NSET, NSET=held, INSTANCE=Lower-1\nfoot\n*NSET, NSET=one, INSTANCE=Upper-1\n"
                    "1, 4\n*ELSET, ELSET=_top, INTERNAL, INSTANCE=Upper-1\n1\n*SURFACE, NAME=top\n_top, %s\n*END ASSEMBLY\n")
        material = "*MATERIAL, NAME=Wood\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n200., 100., 50., 0.2, 0.1, 0.15, 60., 40.\n30.\n"
        contact = ("*SURFACE INTERACTION, NAME=I\n1.,\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD\n*CONTACT PAIR, INTERACTION=I\n"
                   "Upper-1.%s, Lower-1.up\n*BOUNDARY\nheld, ENCASTRE\nUpper-1.%s, 1, 2\n")
        step = "*STEP, NAME=press, NLGEOM=NO\n*STATIC\n1., 1.\n*DSLOAD\ntop, P, 3.\n*OUTPUT, FIELD\n*END STEP\n"
        # turned by 90 degrees about x through its corner, y becomes z and z becomes -y: the face y=0 is below
        text, said = self.convert(part + assembly % "S5" + material + contact % ("S3", "foot") + step, code=2)
        self.assertIn("*CONTACTPAIR: there is no surface 'Upper-1.S3'", said)
        deck = (part.replace("*SURFACE, NAME=side\n1, S4", "*SURFACE, NAME=side\n1, S3") + assembly % "S5" + material +
                contact % ("side", "foot") + step)
        text, said = self.convert(deck)
        self.assertIn("surface_a='Upper-1:Upper-1.side', surface_b='Lower-1:Lower-1.up'", text)
        self.write("cube.inp", part[part.index("*NODE"):part.index("*ORIENTATION")].replace("1, S4", "1, S3") + "*SURFACE, NAME=back\n1, S5\n")
        self.write("twin.nml", "&scene mesh='cube.inp' /\n&material name='w', young=200,100,50, poisson=0.2,0.1,0.15, shear=60,40,30, "
                   "axis_1=1,1,0, axis_2=-1,1,0 /\n&body name='l', volume='all', material='w' /\n&body name='u', volume='all', material='w', "
                   "axis=1,0,0, angle=90, at=0,1,1.001 /\n&support body='l', surface='low', fix='xyz' /\n&support body='u', surface='low', fix='xy' /\n"
                   "&load body='u', surface='back', pressure=3 /\n&contact name='c', surface_a='u:side', surface_b='l:up' /\n&solver theta=0 /\n")
        x, u = self.displacements("deck")
        y, v = self.displacements("twin")
        np.testing.assert_allclose(x, y, atol=1e-12)
        np.testing.assert_allclose(u, v, atol=1e-9)
        self.assertLess(u[:, 2].min(), -0.02)

    def test_steps(self):
        """Steps are load cases: loads go on, are replaced, and end by OP=NEW; values of supports by case."""
        more = ("*END STEP\n*STEP, NAME=Pull\n*STATIC\n*CLOAD\nhead, 3, -2.\n*END STEP\n*STEP\n*STATIC\n*DSLOAD\ntop, P, 4.\n*END STEP\n"
                "*STEP\n*STATIC\n*CLOAD, OP=NEW\n*END STEP\n*STEP, PERTURBATION\n*STATIC\n*DSLOAD\ntop, P, 9.\n*END STEP\n"
                "*STEP\n*STATIC\n*BOUNDARY\nhead, 3, 3, -0.1\n*END STEP\n*STEP\n*FREQUENCY\n3\n")
        deck = TWO % ("", "HARD", "*CLOAD\nhead, 3, -1.\n" + more)
        text, said = self.convert(deck, code=1)
        steps = [n for n, line in enumerate(deck.splitlines(), 1) if line.startswith("*STEP")]
        for n, message in ((5, "a perturbation is left out"), (7, "*FREQUENCY, not *STATIC, is left out"),
                           (6, "it holds other nodes or directions than step 1")):
            self.assertIn("deck.inp:%d: step %d: %s" % (steps[n - 1], n, message), said)
        self.assertEqual(re.findall("&case name='(.*)'", text), ["step 1", "Pull", "step 3", "step 4"])
        lines = self.results_by_case()
        for found, force in zip(lines, (4, 8, 12, 4)):
            self.assertAlmostEqual(found, 0.001 + 2*force/YOUNG, delta=1e-9)
        deck = (TWO % ("", "HARD", "*BOUNDARY\nhead, 3, 3, -0.02\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY\nhead, 3, 3\n*END STEP\n*STEP\n*STATIC\n"
                       "*BOUNDARY\nhead, 3, 3, -0.03\n"))
        self.convert(deck)
        np.testing.assert_allclose(self.results_by_case(), (0.02, 0, 0.03), atol=1e-12)

    def results_by_case(self):
        """Mean displacement of the top of the upper cube, downwards, in each load case."""
        self.dotyk("deck.nml")
        file = self.results("deck.vtkhdf")["VTKHDF"]
        tags = file["PointData/node_tag"][:]
        n = file["Points"].shape[0]
        u = file["PointData/displacement"][:].reshape(-1, n, 3)
        return -u[:, (tags[:n] >= 15) & (tags[:n] <= 18), 2].mean(axis=1)

    def test_rigid_bodies(self):
        """The upper cube is rigid: moved by its reference node, then pressed by a force there."""
        rigid = "*NODE, NSET=R\n99, 0.5, 0.5, 3.\n*ELSET, ELSET=EU\n2\n*RIGID BODY, ELSET=EU, REF NODE=%s\n*STEP\n"
        base = (TWO % ("", "HARD", "%s")).replace("Nupper, 1, 2\n", "").replace("*STEP\n", rigid, 1)
        self.convert(base % ("R", "*BOUNDARY\nR, 1, 6\nR, 3, 3, -0.021\n"))
        self.assertAlmostEqual(self.shortening_now(), 0.021, delta=1e-12)
        reaction = self.results("deck.vtkhdf")["VTKHDF/PointData/displacement"][:][:, 2]
        self.assertAlmostEqual(np.sort(reaction)[4], -0.021, delta=1e-12)
        self.convert(base % ("99", "*BOUNDARY\n99, 1, 2\n99, 4, 6\n*CLOAD\n99, 3, -4.\n"))
        self.assertAlmostEqual(self.shortening_now(), 0.001 + 4/YOUNG, delta=1e-9)
        # a part of a body is none of dotyk's, and what its node has is told
        deck = (base % ("99", "*BOUNDARY\n99, 1, 2\n*CLOAD\n99, 3, -4.\n")).replace("ELSET=EU, REF", "NSET=head, REF")
        said = self.convert(deck, code=1)[1]
        line = deck.splitlines().index("*RIGID BODY, NSET=head, REF NODE=99") + 1
        for message in ("deck.inp:%d: *RIGID BODY that is not one whole body" % line, "direction x of 1 nodes that no solid element has (99)",
                        "forces on 1 nodes that no solid element has"):
            self.assertIn(message, said)

    def shortening_now(self):
        return self.results_by_case()[0]

    def test_pretension(self):
        """A bar between walls, cut in the middle of its mesh: F L = E A s, given either; then locked, and its end pulled."""
        nodes = CUBE + "".join("%d, %g, %g, 2\n" % (9 + i, *x[:2]) for i, x in enumerate(HEXAHEDRON[:4]))
        deck = (nodes + "99, 0, 0, 0\n*ELEMENT, TYPE=C3D8, ELSET=E\n1, 1,2,3,4,5,6,7,8\n2, 5,6,7,8,9,10,11,12\n*NSET, NSET=all, GENERATE\n1, 12\n"
                "*NSET, NSET=end\n1, 2, 3, 4\n*NSET, NSET=head\n9, 10, 11, 12\n*SURFACE, NAME=cut\n1, S2\n*SURFACE, NAME=side\nE, S3\n"
                "*MATERIAL, NAME=M\n*ELASTIC\n200., 0.\n*SOLID SECTION, ELSET=E, MATERIAL=M\n*PRE-TENSION SECTION, SURFACE=cut, NODE=99\n%s"
                "*BOUNDARY\nall, 1, 2\nend, 3\nhead, 3\n*STEP\n*STATIC\n%s*END STEP\n")
        for normal in ("", "0., 0., 2.\n"):
            for load in ("*CLOAD\n99, 1, 5.\n", "*BOUNDARY\n99, 1, 1, 0.05\n"):
                self.convert(deck % (normal, load))
                self.dotyk("deck.nml")
                ties = self.results("deck.vtkhdf")["dotyk/ties"]
                self.assertAlmostEqual(ties["tension"][0], 5, delta=1e-8)
                self.assertAlmostEqual(ties["shortening"][0], 0.05, delta=1e-10)
        locked = "*CLOAD\n99, 1, 5.\n*END STEP\n*STEP\n*STATIC\n*BOUNDARY, FIXED\n99, 1\n*BOUNDARY\nhead, 3, 3, 0.01\n"
        self.convert(deck % ("", locked))
        self.dotyk("deck.nml")
        cases = self.results("deck.vtkhdf")["dotyk/cases"]
        tension = [cases[case]["ties/tension"][0] for case in sorted(cases)]
        np.testing.assert_allclose(tension, [5, 6], atol=1e-8)
        for more, message in (("*CLOAD\n99, 1, 5.\n*END STEP\n*STEP\n*STATIC\n*CLOAD\n99, 1, 6.\n", "one positive force, in the first load cases"),
                              ("", "neither force nor shortening")):
            text = deck % ("", more)
            line = text[:text.index("*PRE-TENSION")].count("\n") + 1
            said = self.convert(text, code=1)[1]
            self.assertIn("deck.inp:%d: *PRE-TENSION SECTION" % line, said)
            self.assertIn(message, said)
        self.assertIn("its normal is not that of the surface", self.convert(deck % ("0., 0., -1.\n", "*CLOAD\n99, 1, 5.\n"), code=1)[1])

    def test_plane(self):
        """Two squares under a pressure on an edge, axisymmetric and plane: analysis, supports and loads by edges."""
        x = [(1, 0), (2, 0), (2, 1), (1, 1), (1, 1), (2, 1), (2, 2), (1, 2)]
        for kind, analysis in (("CPE4", "plane_strain"), ("CPS4", "plane_stress"), ("CAX4", "axisymmetric")):
            deck = ("*NODE\n" + "".join("%d, %g, %g\n" % (i + 1, *p) for i, p in enumerate(x)) + "*ELEMENT, TYPE=%s, ELSET=a\n1, 1,2,3,4\n" % kind +
                    "*ELEMENT, TYPE=%s, ELSET=b\n2, 5,6,7,8\n*MATERIAL, NAME=M\n*ELASTIC\n10, 0\n*SOLID SECTION, ELSET=a, MATERIAL=M\n1.\n"
                    "*SOLID SECTION, ELSET=b, MATERIAL=M\n*SURFACE, NAME=s\na, S3\n*SURFACE, NAME=t\nb, S1\n*CONTACT PAIR, INTERACTION=I\nt, s\n"
                    "*SURFACE INTERACTION, NAME=I\n*BOUNDARY\n1, 2\n2, 2\n1, 1\n4, 1\n5, 1\n8, 1\n*STEP\n*STATIC\n*DLOAD\nb, P3, 2.\n*END STEP\n" % kind)
            text, _ = self.convert(deck)
            self.assertIn("analysis='%s'" % analysis, text)
            self.dotyk("deck.nml")
            u = self.results("deck.vtkhdf")["VTKHDF/PointData/displacement"][:]
            self.assertAlmostEqual(u[:, 1].min(), -2*2/10, delta=1e-9)


if __name__ == "__main__":
    dotyk_case.main()
