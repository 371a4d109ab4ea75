"""Scenes at the edge of what makes sense: a right answer, or a message with the exit code of docs/messages.md."""
import subprocess

import dotyk_case

SHORTENING = 1e-3
STIFF = 210e9*0.7/(1.3*0.4)  # uniaxial strain: E (1-v)/((1+v)(1-2v))


class Robustness(dotyk_case.Case):
    """Variations of the column example, made of one element on each side, which is exact."""

    def scene(self, name="case.nml", steps=1, change=lambda text: text, more=""):
        """The column with one material, so many elements along each edge, and its namelist changed."""
        geo = (dotyk_case.INPUTS/"column"/"column.geo").read_text()
        geo = geo.replace("Transfinite Curve{1:12}", "Transfinite Curve{1:24}").replace("= 5;", "= %d;" % (steps + 1))
        geo = geo.replace("Surface{1:6}", "Surface{1:12}").replace("Volume{1};\n\n", "Volume{1:2};\n\n")
        self.write("column.geo", geo)
        text = (dotyk_case.INPUTS/"column"/"column.nml").read_text().replace("'concrete'", "'steel'", 2)
        text = text.replace("&material name='steel', young=30e9,  poisson=0.2 /", "")
        lines = [line for line in text.splitlines() if "young=30e9" not in line]
        text = "\n".join(lines).replace("material='concrete'", "material='steel'") + "\n" + more
        return self.write(name, change(text))

    def pressure(self, name, contact="joint"):
        """Least and greatest pressure, and theta."""
        group = self.results(name)["dotyk/contact/" + contact]
        return min(group["pressure"]), max(group["pressure"]), group.attrs["theta"]

    def check_pressure(self, found, theta, factor=1.0):
        exact = factor*SHORTENING/(2/STIFF + theta)
        self.assertAlmostEqual(found/exact, 1, delta=1e-7)  # tolerance 1e-8 of the scene

    def test_one_element(self):
        self.dotyk(self.scene())
        least, most, theta = self.pressure("case.vtkhdf")
        self.check_pressure(least, theta)
        self.check_pressure(most, theta)

    def test_blanks_and_letters_in_paths(self):
        folder = self.folder/"a b дотик"
        folder.mkdir()
        self.scene().rename(folder/"к 1.nml")
        (self.folder/"column.geo").rename(folder/"column.geo")
        self.dotyk("a b дотик/к 1.nml")
        self.check_pressure(*self.pressure("a b дотик/к 1.vtkhdf")[1:])

    def test_lines_of_another_system(self):
        self.dotyk(self.scene(change=lambda text: text.replace("\n", "\r\n")))
        self.check_pressure(*self.pressure("case.vtkhdf")[1:])

    def test_a_pair_given_twice_counts_once(self):
        twin = "&contact name='twin', surface_a='upper:upper bottom', surface_b='lower:lower top' /\n"
        self.assertIn("same contact", self.dotyk(self.scene(more=twin)))
        self.check_pressure(*self.pressure("case.vtkhdf")[1:])

    def test_a_body_that_cannot_move(self):
        held = "".join("&support body='lower', surface='%s', fix='xyz' /\n" % s for s in ("bottom", "lower top"))
        self.dotyk(self.scene(more=held))
        _, most, theta = self.pressure("case.vtkhdf")
        self.assertAlmostEqual(most*(1/STIFF + theta)/SHORTENING, 1, delta=1e-7)

    def test_a_loose_part_stays_where_it_is(self):
        """The upper body has a part that touches nothing and that nothing pushes."""
        nodes = [(x, y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 1), (1, 1), (1, 2), (0, 2), (3, 3), (4, 3),
                                     (4, 4), (3, 4))]
        elements = [(3, 1, "1 2 3 4"), (3, 2, "5 6 7 8"), (3, 2, "9 10 11 12"), (1, 3, "1 2"), (1, 4, "3 4"),
                    (1, 5, "5 6"), (1, 6, "7 8")]
        self.write("parts.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n6\n2 1 \"lower\"\n"
                   "2 2 \"upper\"\n"
                   "1 3 \"ground\"\n1 4 \"lower top\"\n1 5 \"upper bottom\"\n1 6 \"upper top\"\n$EndPhysicalNames\n"
                   "$Nodes\n12\n"
                   + "".join("%d %d %d 0\n" % (i, *x) for i, x in enumerate(nodes, 1)) + "$EndNodes\n$Elements\n7\n"
                   + "".join("%d %d 2 %d %d %s\n" % (i, kind, group, group, few)
                             for i, (kind, group, few) in enumerate(elements, 1))
                   + "$EndElements\n")
        self.write("parts.nml", """&scene mesh='parts.msh', analysis='plane_strain' /
&material name='m', young=1000, poisson=0 /
&body name='lower', volume='lower', material='m' /
&body name='upper', volume='upper', material='m' /
&support body='lower', surface='ground', fix='xy' /
&load body='upper', surface='upper top', pressure=1 /
&contact name='joint', surface_a='upper:upper bottom', surface_b='lower:lower top' /
&solver theta=0, tolerance=1e-10 /
""")
        text = self.dotyk("parts.nml")
        self.assertIn("connected component 2 of 2", text)
        u = self.results("parts.vtkhdf")["VTKHDF/PointData/displacement"][()]
        self.assertAlmostEqual(u[:8, 1].min(), -2e-3, delta=1e-12)
        self.assertLess(abs(u[8:]).max(), 1e-12)

    def test_contradicting_supports(self):
        text = self.dotyk(self.scene(more="&support body='lower', surface='bottom', fix='z', value=0,0,1 /\n"), code=2)
        self.assertRegex(text, r"body 'lower': contradictory supports at node .*\(surfaces '.*' of line \d+, '.*' of line \d+\)")
        self.assertIn("'bottom'", text)
        self.assertFalse((self.folder/"case.vtkhdf").exists())

    def test_more_threads_than_bodies(self):
        self.dotyk(self.scene(steps=3), "--threads", "16")
        self.check_pressure(*self.pressure("case.vtkhdf")[1:])

    def lifted(self, text):
        """The scene with the upper block lifted off."""
        return text.replace("value=0,0,-1e-3", "value=0,0,1e-3")

    def test_open_contact_has_no_error(self):
        for scheme in ("dual", "neumann", "robin"):
            self.dotyk(self.scene(steps=2, change=lambda text: self.lifted(text).replace(
                "theta_relative=1e-2, tolerance=1e-8", "scheme='%s'" % scheme)))
            summary = self.results("case.vtkhdf")["dotyk/summary"].attrs
            for part in ("error_bound", "error_penalty", "error_discretization"):
                self.assertEqual(summary[part], 0, scheme + " " + part)

    def test_robin_reaches_its_tolerance(self):
        self.dotyk(self.scene(steps=3, change=lambda text: text.replace("theta_relative=1e-2",
                                                                        "scheme='robin', theta_mesh=1e-2")))
        self.check_pressure(*self.pressure("case.vtkhdf")[1:])

    def test_what_is_written_does_not_change_the_answer(self):
        found = []
        for parts in ("", "penalty", "penalty discretization"):
            self.dotyk(self.scene(steps=2, more="&output error_parts='%s' /\n" % parts,
                                  change=lambda text: text.replace(
                "theta_relative=1e-2, ", "")))
            found.append(self.pressure("case.vtkhdf"))
        self.assertEqual(found[0], found[1])
        self.assertEqual(found[0], found[2])

    def test_errors_that_nobody_asks_for_are_unknown(self):
        text = self.dotyk(self.scene(more="&output error_parts='' /\n"))
        self.assertRegex(text, r"\n  relative error +iteration <= \S+ %\n")

    def test_an_inverted_element_is_named(self):
        self.scene()
        self.dotyk("case.nml")
        mesh = next((self.folder/".dotyk").glob("*.msh"))
        subprocess.run(["gmsh", "-save", "-format", "msh22", "-o", self.folder/"bad.msh", mesh], check=True,
                       stdout=subprocess.DEVNULL)
        lines = (self.folder/"bad.msh").read_text().splitlines()
        # two nodes of one hexahedron (gmsh's type 5) changed over: it is twisted
        k = next(i for i, line in enumerate(lines) if len(line.split()) == 13 and line.split()[1] == "5")
        words = lines[k].split()
        words[-1], words[-2] = words[-2], words[-1]
        lines[k] = " ".join(words)
        self.write("bad.msh", "\n".join(lines) + "\n")
        text = self.dotyk(self.scene("bad.nml", change=lambda text: text.replace("column.geo", "bad.msh")), code=3)
        self.assertIn("element " + words[0], text)
        self.assertFalse((self.folder/"bad.vtkhdf").exists())


if __name__ == "__main__":
    dotyk_case.main()
