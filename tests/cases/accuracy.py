#!/usr/bin/python3
"""Meshes that the program chooses until the error is as small as asked for (&accuracy)."""
import re
import shutil

import numpy as np

import dotyk_case

# A quarter of the lower half of a sphere on a quarter of a block, without a size of elements.
HERTZ = """SetFactory("OpenCASCADE");
R = 0.01;
Sphere(1) = {0, 0, R, R};
Box(2) = {0, 0, 0, R, R, R};
ball() = BooleanIntersection{ Volume{1}; Delete; }{ Volume{2}; Delete; };
Box(3) = {0, 0, -R, R, R, R};
Physical Volume("ball") = {ball(0)};
Physical Volume("block") = {3};
e = 1e-6;
Physical Surface("plane x") = {Surface In BoundingBox{-e, -1, -1, e, 1, 1}};
Physical Surface("plane y") = {Surface In BoundingBox{-1, -e, -1, 1, e, 1}};
Physical Surface("bottom") = {Surface In BoundingBox{-1, -1, -R - e, 1, 1, -R + e}};
Physical Surface("cut") = {Surface In BoundingBox{-1, -1, R - e, 1, 1, R + e}};
Physical Surface("up") = {Surface In BoundingBox{-1, -1, -e, 1, 1, e}};
Physical Surface("skin") = {Abs(Boundary{ Volume{ball(0)}; })};
Mesh.ElementOrder = 2;
"""

SPHERE = """
&scene mesh='s.geo' /
&material name='steel', young=210e9, poisson=0.3 /
&body name='ball', volume='ball', material='steel' /
&body name='block', volume='block', material='steel' /
&support body='ball', surface='cut', fix='z', value=0,0,-3e-5 /
&support body='ball', surface='plane x', fix='x' /
&support body='ball', surface='plane y', fix='y' /
&support body='block', surface='bottom', fix='xyz' /
&support body='block', surface='plane x', fix='x' /
&support body='block', surface='plane y', fix='y' /
&contact name='touch', surface_a='ball:skin', surface_b='block:up' /
"""

# A block with a step, stretched: the error is at the re-entrant corner. Two copies, one of them turned.
STEP = """
Point(1) = {0, 0, 0};  Point(2) = {2, 0, 0};  Point(3) = {2, 1, 0};
Point(4) = {1, 1, 0};  Point(5) = {1, 2, 0};  Point(6) = {0, 2, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};  Line(5) = {5, 6};  Line(6) = {6, 1};
Curve Loop(1) = {1:6};
Plane Surface(1) = {1};
Physical Surface("step") = {1};
Physical Curve("low") = {1};
Physical Curve("up") = {5};
Mesh.ElementOrder = 2;
"""

STEPS = """
&scene mesh='step.geo', analysis='plane_strain' /
&material name='m', young=1, poisson=0.3 /
&body name='a', volume='step', material='m' /
&body name='b', volume='step', material='m', at=5,0,0, angle=90 /
&support body='a', surface='low', fix='xy' /
&support body='b', surface='low', fix='xy' /
&load body='a', surface='up', traction=0,1e-3 /
&load body='b', surface='up', traction=-1e-3,0 /
"""


class Accuracy(dotyk_case.Case):
    def run_scene(self, nml, geometry, code=0):
        """Log of a scene, and the summary of its results."""
        name = re.search("mesh='([^']*)'", nml)[1]
        self.write(name, geometry)
        self.write("case.nml", nml)
        log = self.dotyk("case.nml", code=code)
        return log, self.results("case.vtkhdf")["dotyk/summary"].attrs

    def meshes(self, log):
        """Unknowns and errors of the meshes that the log tells."""
        found = re.findall(r"accuracy +mesh \d+: (\d+) unknowns, error ~ ([\d.e+-]+) %", log)
        return [int(n) for n, _ in found], [float(e) / 100 for _, e in found]

    def test_sphere_without_sizes_reaches_hertz(self):
        log, summary = self.run_scene(SPHERE + "&accuracy error=0.05 /", HERTZ)
        unknowns, _ = self.meshes(log)
        self.assertLessEqual(summary["error_discretization"], 0.05)
        self.assertLessEqual(len(unknowns), 4, log)
        self.assertLess(unknowns[-1], 80000, log)
        # Hertz: 4/3 E* sqrt(R) d^(3/2), both bodies of finite size.
        force = 4 / 3 * 210e9 / (2 * 0.91) * 0.1 * 3e-5**1.5 / 4
        got = self.results("case.vtkhdf")["dotyk/contact/touch"].attrs["force"][2]
        self.assertBetween(0.96 * force, got, 1.04 * force)
        # one log, that of the last mesh
        self.assertEqual(log.count("factorization"), 1, log)
        self.assertEqual(list(self.folder.glob(".dotyk/*.pos")), [])

    def test_sphere_reaches_the_error_bar_of_its_force(self):
        log, _ = self.run_scene(SPHERE + "&accuracy error=0.01, quantity='force:block - ball' /", HERTZ)
        unknowns, errors = self.meshes(log)
        self.assertIn("reached: 1 % were asked for", log)
        self.assertLessEqual(errors[-1], 0.01)
        # The energy norm asks for more elements.
        self.assertLess(unknowns[-1], 45000, log)
        group = self.results("case.vtkhdf")["dotyk/quantities"]
        value, bar = group["value"][0], group["error"][0]
        self.assertLessEqual(bar, 0.01 * value)
        # 147,000 unknowns of error=0.0006 say 655.72 +- 0.21, the graded mesh of inputs/hertz at 0.6 h 655.7.
        self.assertLess(abs(value - 655.7), 1.2 * bar, log)

    def test_pressures_near_contact_take_fewer_elements(self):
        log, _ = self.run_scene(SPHERE + "&accuracy error=0.02, aim='contact' /", HERTZ)
        unknowns, _ = self.meshes(log)
        self.assertIn("% near contact", log)
        # The energy norm takes 80,000 for the same error of the pressure.
        self.assertLess(unknowns[-1], 30000, log)
        touch = self.results("case.vtkhdf")["dotyk/contact/touch"]
        modulus, radius, force = 210e9 / (2 * 0.91), 0.01, 4 * touch.attrs["force"][2]
        a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
        r = np.hypot(*touch["position"][:, :2].T)
        exact = 3 * force / (2 * np.pi * a**2) * np.sqrt(np.maximum(0, 1 - (r / a) ** 2))
        w, p = touch["weight"][:], touch["pressure_projected"][:]
        self.assertLess(np.sqrt(np.sum(w * (p - exact) ** 2) / np.sum(w * exact**2)), 0.025, log)
        self.write("both.nml", SPHERE + "&accuracy error=0.02, aim='contact', quantity='force:*' /\n")
        self.assertIn("aim does not go together with quantity", self.dotyk("both.nml", code=2))

    def test_peak_of_a_sphere_reaches_hertz(self):
        log, _ = self.run_scene(SPHERE + "&accuracy error=0.03, quantity='peak:touch', 'mean_pressure:touch' /", HERTZ)
        self.assertIn("reached: 3 % were asked for", log)
        group = self.results("case.vtkhdf")["dotyk/quantities"]
        (peak, mean), bars = group["value"][:], group["error"][:]
        self.assertTrue((bars <= 0.03 * group["value"][:]).all(), log)
        touch = self.results("case.vtkhdf")["dotyk/contact/touch"]
        modulus, radius, force = 210e9 / (2 * 0.91), 0.01, 4 * touch.attrs["force"][2]
        a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
        # Hertz for the force that was found: a/R of 0.05 changes the peak by 0.07 %.
        self.assertLess(abs(peak - 3 * force / (2 * np.pi * a**2)), 1.2 * bars[0] + 0.001 * peak, log)
        self.assertLess(abs(mean - force / (np.pi * a**2)), 1.2 * bars[1] + 0.001 * mean, log)

    def test_quantities_without_a_limit_end_the_search(self):
        """The stress at a re-entrant corner."""
        log, _ = self.run_scene(STEPS + "&accuracy error=0.01, quantity='mises:a' /", STEP, code=1)
        self.assertIn("'mises:a', which grows from mesh to mesh and has no limit", log)
        # That of the loaded face has one, and so has its greatest displacement.
        log, _ = self.run_scene(STEPS + "&accuracy error=0.01, quantity='mises:a:up', 'displacement:b' /", STEP)
        self.assertIn("reached", log)
        group = self.results("case.vtkhdf")["dotyk/quantities"]
        x = self.results("case.vtkhdf")["VTKHDF/PointData/displacement"][:]
        self.assertAlmostEqual(group["value"][1], np.linalg.norm(x, axis=1).max(), delta=1e-9 * group["value"][1])

    def test_quantities_without_contact_are_never_called_reached(self):
        log, _ = self.run_scene(SPHERE.replace("-3e-5", "1e-4") + "&accuracy error=0.01, quantity='force:touch', max_meshes=2 /",
                                HERTZ, code=1)
        self.assertIn("no constraint is active", log)
        self.assertIn("not reached", log)

    def test_copies_share_a_mesh_and_its_errors_concentrate_at_the_corner(self):
        log, summary = self.run_scene(STEPS + "&accuracy error=0.01 /", STEP)
        self.assertLessEqual(summary["error_discretization"], 0.01)
        x = self.results("case.vtkhdf")["VTKHDF/Points"][:, :2]
        # the corners of the two bodies
        for corner in ((1.0, 1.0), (4.0, 1.0)):
            self.assertLess(np.sort(np.linalg.norm(x - corner, axis=1))[9], 0.02, log)

    def test_meshes_of_another_run_do_not_count(self):
        """The same geometry under another load: its meshes are those of a run in a folder of its own."""
        def unknowns(nml):
            self.write("case.nml", nml)
            return self.meshes(self.dotyk("case.nml"))[0]
        self.write("step.geo", STEP)
        pulled = STEPS + "&accuracy error=0.01 /"
        sheared = pulled.replace("traction=0,1e-3", "traction=1e-3,0")
        first = unknowns(pulled)
        shutil.rmtree(self.folder / ".dotyk")
        alone = unknowns(sheared)
        self.assertNotEqual(alone, first)
        shutil.rmtree(self.folder / ".dotyk")
        unknowns(pulled)
        self.assertEqual(unknowns(sheared), alone)

    def test_limit_ends_with_exit_code_1(self):
        log, summary = self.run_scene(STEPS + "&accuracy error=0.001, max_meshes=2 /", STEP, code=1)
        unknowns, errors = self.meshes(log)
        self.assertEqual(len(unknowns), 2)
        self.assertIn("max_meshes = 2", log)
        self.assertGreater(errors[0], errors[1])
        self.assertAlmostEqual(summary["error_discretization"], errors[1], delta=0.06 * errors[1])
        log, _ = self.run_scene(STEPS + "&accuracy error=1e-5, max_unknowns=3000 /", STEP, code=1)
        self.assertIn("max_unknowns = 3000", log)
        self.assertLess(max(self.meshes(log)[0]), 6000)

    def test_patches_of_the_own_kernel_of_gmsh(self):
        """An eighth of a sphere, its curvature is not known at the corners of its three-sided patch."""
        eighth = """
Point(1) = {0, 0, 0};  Point(2) = {1, 0, 0};  Point(3) = {0, 1, 0};  Point(4) = {0, 0, 1};
Circle(1) = {2, 1, 3};  Circle(2) = {3, 1, 4};  Circle(3) = {4, 1, 2};
Line(4) = {1, 2};  Line(5) = {1, 3};  Line(6) = {1, 4};
Curve Loop(1) = {1, 2, 3};  Surface(1) = {1} In Sphere {1};
Curve Loop(2) = {4, 1, -5};  Plane Surface(2) = {2};
Curve Loop(3) = {5, 2, -6};  Plane Surface(3) = {3};
Curve Loop(4) = {6, 3, -4};  Plane Surface(4) = {4};
Surface Loop(1) = {1:4};  Volume(1) = {1};
Physical Volume("ball") = {1};
Physical Surface("skin") = {1};
Physical Surface("z") = {2};
Physical Surface("x") = {3};
Physical Surface("y") = {4};
Mesh.ElementOrder = 2;
Mesh.MeshSizeMax = 0.4;
"""
        nml = """
&scene mesh='eighth.geo' /
&material name='m', young=1, poisson=0.3 /
&body name='ball', volume='ball', material='m' /
&support body='ball', surface='x', fix='x' /
&support body='ball', surface='y', fix='y' /
&support body='ball', surface='z', fix='z' /
&load body='ball', surface='skin', pressure=1e-3 /
&accuracy error=0.9, quantity='displacement:ball' /
"""
        log, _ = self.run_scene(nml, eighth)
        self.assertIn("mesh 2:", log)
        # The radius shrinks by p (1 - 2 nu)/E.
        value = self.results("case.vtkhdf")["dotyk/quantities"]["value"][0]
        self.assertAlmostEqual(value, 1e-3 * (1 - 2 * 0.3), delta=1e-5 * value)

    def test_groups_that_have_the_numbers_of_their_faces(self):
        """A thick tube under pressure inside, Lame's stress at its bore."""
        ring = """
Point(1) = {0, 0, 0};  Point(2) = {1, 0, 0};  Point(3) = {2, 0, 0};  Point(4) = {0, 2, 0};  Point(5) = {0, 1, 0};
Line(2) = {2, 3};  Circle(3) = {3, 1, 4};  Line(4) = {4, 5};  Circle(5) = {5, 1, 2};
Curve Loop(1) = {2:5};  Plane Surface(1) = {1};
Physical Surface("tube", 1) = {1};
Physical Curve("y", 2) = {2};
Physical Curve("x", 4) = {4};
Physical Curve("bore", 5) = {5};
Mesh.ElementOrder = 2;
"""
        self.run_scene("""
&scene mesh='ring.geo', analysis='plane_strain' /
&material name='m', young=1000, poisson=0 /
&body name='tube', volume='tube', material='m' /
&support body='tube', surface='x', fix='x' /
&support body='tube', surface='y', fix='y' /
&load body='tube', surface='bore', pressure=1 /
&accuracy error=0.005, quantity='mises:tube' /
""", ring)
        group = self.results("case.vtkhdf")["dotyk/quantities"]
        # Hoop 5/3, radial -1, axial 0.
        self.assertLess(abs(group["value"][0] - np.sqrt(25 / 9 + 5 / 3 + 1)), 1.2 * group["error"][0])

    def test_mesh_that_the_geometry_fixes_is_told(self):
        rectangle = """
Point(1) = {0, 0, 0};  Point(2) = {2, 0, 0};  Point(3) = {2, 2, 0};  Point(4) = {0, 2, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 1};
Curve Loop(1) = {1:4};
Plane Surface(1) = {1};
Transfinite Curve {1:4} = 4;
Transfinite Surface {1};
Physical Surface("step") = {1};
Physical Curve("low") = {1};
Physical Curve("up") = {3};
"""
        log, _ = self.run_scene(STEPS + "&accuracy error=1e-3 /", rectangle, code=1)
        self.assertIn("Transfinite", log)

    def test_meshes_and_quadrilaterals_are_refused_by_name(self):
        self.write("step.geo", STEP)
        self.write("part.msh", "")
        self.write("case.nml", STEPS.replace("step.geo", "part.msh") + "&accuracy error=0.01 /")
        log = self.dotyk("case.nml", code=2)
        self.assertIn("case.nml:10: &accuracy", log)
        self.assertIn("part.msh", log)
        self.write("step.geo", STEP + "Recombine Surface {1};\n")
        self.write("case.nml", STEPS + "&accuracy error=0.01 /")
        log = self.dotyk("case.nml", code=2)
        self.assertIn("step.geo", log)
        self.assertIn("'a'", log)
        self.assertFalse((self.folder / "case.vtkhdf").exists())

    def test_percent_and_restarts_are_refused(self):
        self.write("step.geo", STEP)
        self.write("case.nml", STEPS + "&accuracy error=5 /")
        self.assertIn("case.nml:10: &accuracy: error", self.dotyk("case.nml", code=2))
        self.write("case.nml", STEPS + "&accuracy error=0.01 /")
        self.write("earlier.vtkhdf", "")
        self.assertIn("--restart", self.dotyk("case.nml", "--restart", "earlier.vtkhdf", code=2))

    def test_results_that_are_not_valid_are_refined(self):
        """A small approach, which the first mesh of the sphere does not resolve, however large an error is allowed."""
        log, summary = self.run_scene("""
&scene mesh='s.geo' /
&material name='steel', young=210e9, poisson=0.3 /
&body name='ball', volume='ball', material='steel' /
&body name='block', volume='block', material='steel' /
&support body='ball', surface='cut', fix='z', value=0,0,-3e-7 /
&support body='ball', surface='plane x', fix='x' /
&support body='ball', surface='plane y', fix='y' /
&support body='block', surface='bottom', fix='xyz' /
&support body='block', surface='plane x', fix='x' /
&support body='block', surface='plane y', fix='y' /
&contact name='touch', surface_a='ball:skin', surface_b='block:up' /
&accuracy error=0.6 /""", HERTZ)
        # The first mesh has an error below 0.6.
        self.assertGreater(len(self.meshes(log)[0]), 1)
        self.assertLess(self.meshes(log)[1][0], 0.6)
        force = 4 / 3 * 210e9 / (2 * 0.91) * 0.1 * 3e-7**1.5 / 4
        self.assertBetween(0.8 * force, self.results("case.vtkhdf")["dotyk/contact/touch"].attrs["force"][2], 1.2 * force)


if __name__ == "__main__":
    dotyk_case.main()
