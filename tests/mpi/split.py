"""Bodies that all ranks compute together (response='multigrid' on small scenes): the energy and the contact forces of
factors on one rank, within the bound that the run claims; held and floating bodies, linear and quadratic elements.

DOTYK_RANK_NUMBERS the numbers of ranks ("2 3").
"""
import os
import re
import subprocess

import h5py
import numpy as np

import dotyk_case
from blocks import block_geo
from mpi_case import ENVIRONMENT, RankCase

RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]
TOLERANCE = 1e-8
SPLIT = "all bodies are split over %d ranks"
MATERIALS = ["&scene /", "&material name='steel', young=200, poisson=0.3 /", "&material name='soft', young=20, poisson=0.2 /"]
SOLVER = "&solver theta=0, tolerance=%r / " % TOLERANCE
# A body with a floor and a wall, and a round one on it.
CORNER = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 3, 2, 1};  Box(2) = {0, 0, 1, 1, 2, 2};  v() = BooleanUnion{Volume{1}; Delete;}{Volume{2}; Delete;};
Mesh.MeshSizeMax = 0.35;  Mesh.MeshSizeMin = 0.35;  Mesh.ElementOrder = %d;
Physical Volume("block") = {v()};  e = 1e-6;
Physical Surface("bottom") = {Surface In BoundingBox{-e, -e, -e, 3 + e, 2 + e, e}};
Physical Surface("floor") = {Surface In BoundingBox{1 - e, -e, 1 - e, 3 + e, 2 + e, 1 + e}};
Physical Surface("wall") = {Surface In BoundingBox{1 - e, -e, 1 - e, 1 + e, 2 + e, 3 + e}};
"""
PUCK = """SetFactory("OpenCASCADE");
Cylinder(1) = {1.6, 1, 1, 0, 0, 0.5, 0.6};
Mesh.MeshSizeMax = 0.25;  Mesh.MeshSizeMin = 0.25;  Mesh.ElementOrder = %d;
Physical Volume("block") = {1};  e = 1e-4;
Physical Surface("bottom") = {Surface In BoundingBox{-9, -9, 1 - e, 9, 9, 1 + e}};
Physical Surface("top") = {Surface In BoundingBox{-9, -9, 1.5 - e, 9, 9, 1.5 + e}};
Physical Surface("side") = {1};
"""
PIN = """SetFactory("OpenCASCADE");
Cylinder(1) = {0.5, -0.7, 0.5, 0, 1.4, 0, 0.5};
Mesh.MeshSizeMax = 0.17;  Mesh.MeshSizeMin = 0.17;  Mesh.ElementOrder = 2;
Physical Volume("block") = {1};  Physical Surface("side") = {1};
"""
ROLLER = """SetFactory("OpenCASCADE");
Cylinder(1) = {1, 0, 1.5, 0, 2, 0, 0.5};
Mesh.MeshSizeMax = 0.2;  Mesh.MeshSizeMin = 0.2;  Mesh.ElementOrder = 2;
Physical Volume("block") = {1};  Physical Surface("side") = {1};  e = 1e-4;
Physical Surface("end") = {Surface In BoundingBox{-9, -e, -9, 9, e, 9}};
"""
# Hexahedra, pyramids on them, and tetrahedra above.
TRANSITION = """
Mesh.ElementOrder = %d;
Point(1) = {0, 0, 0}; line() = Extrude {2, 0, 0} { Point{1}; Layers{6}; };
face() = Extrude {0, 2, 0} { Curve{line(1)}; Layers{6}; Recombine; };
lower() = Extrude {0, 0, 0.5} { Surface{face(1)}; Layers{2}; Recombine; };
TransfQuadTri {lower(1)};
Transfinite Volume {lower(1)};
upper() = Extrude {0, 0, 0.5} { Surface{lower(0)}; };
Physical Volume("block") = {lower(1), upper(1)};
Physical Surface("bottom") = {face(1)};
Physical Surface("top") = {upper(0)};
"""
# A block of two parts.
TWO_BOXES = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};  Box(2) = {3, 0, 0, 1, 1, 1};  Mesh.MeshSizeMax = 0.5;  Mesh.ElementOrder = 2;
Physical Volume("block") = {1, 2};  e = 1e-6;
Physical Surface("bottom") = {Surface In BoundingBox{-e, -e, -e, 4 + e, 1 + e, e}};
Physical Surface("top") = {Surface In BoundingBox{-e, -e, 1 - e, 1 + e, 1 + e, 1 + e}};
"""


def energy(printed):
    """Of the log."""
    return float(re.search(r"potential energy +(\S+)", printed)[1])


def forces(path):
    """Contact forces of all constraints, pair by pair, and the largest one."""
    with h5py.File(path) as file:
        found = {name: pair["weight"][()] * pair["pressure"][()] for name, pair in file["dotyk/contact"].items()}
    return found, max(np.max(force) for force in found.values())


class Split(RankCase):
    def body(self, name, geo, material):
        self.write(name + ".geo", geo)
        return "&body name='%s', mesh='%s.geo', volume='block', material='%s' /" % (name, name, material)

    def compare(self, namelist, rank_numbers=RANKS, reference="&solver"):
        """The scene on ranks, split, against the same on one rank: with factors, unless the reference says otherwise."""
        text = namelist.read_text()
        namelist.write_text(text.replace("&solver", reference))
        expected = self.folder / "factors.vtkhdf"
        done = subprocess.run([os.environ["DOTYK"], str(namelist), "--verbose", "--output", str(expected)], env=ENVIRONMENT, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        namelist.write_text(text.replace("&solver", "&solver response='multigrid', "))
        for ranks in rank_numbers:
            found = self.folder / ("%d.vtkhdf" % ranks)
            printed = self.run_ranks(ranks, namelist, "--output", found)
            self.assertIn(SPLIT % ranks, printed)
            bound = float(re.search(r"error bound +(\S+) of the energy norm", printed)[1])
            self.assertLessEqual(bound, TOLERANCE)
            # To the digits of the log; its error is of the order of the square of the bound, and of the tolerance for theta = 0.
            self.assertLessEqual(abs(energy(printed) / energy(done.stdout) - 1), 2e-9)
            # Distances of solutions, with the bounds of both.
            penalties = [self.penalty(path) for path in (expected, found)]
            self.assertLessEqual(abs(penalties[1] - penalties[0]), 1e-3 * penalties[0] + 1e-5)
            (a, largest), (b, _) = forces(expected), forces(found)
            for pair, force in a.items():
                np.testing.assert_allclose(b[pair], force, atol=100 * TOLERANCE * largest, err_msg="%s on %d ranks" % (pair, ranks))
                self.assertLessEqual(abs(np.sum(b[pair]) - np.sum(force)), TOLERANCE * max(np.sum(force), largest), pair)

    @staticmethod
    def penalty(path):
        """Error by the penalty, as estimated."""
        with h5py.File(path) as file:
            return file["dotyk/summary"].attrs["error_penalty"]

    def puck(self, order):
        """A puck, pushed to floor and wall: nothing but contact holds it, and it may slide along the wall and turn."""
        return self.write("case.nml", "\n".join(MATERIALS + [
            self.body("corner", CORNER % order, "steel"), self.body("puck", PUCK % order, "soft"),
            "&support body='corner', surface='bottom', fix='xyz' /", "&load body='puck', surface='top', traction=-0.05,0,-0.1 /",
            "&contact name='floor', surface_a='puck:bottom', surface_b='corner:floor' /",
            "&contact name='wall', surface_a='puck:side', surface_b='corner:wall' /", SOLVER]))

    def test_an_error_inside_petsc(self):
        """PETSC_OPTIONS ask for a preconditioner that does not exist: no call goes on after the one that fails."""
        namelist = self.puck(2)
        namelist.write_text(namelist.read_text().replace("&solver", "&solver response='multigrid', "))
        options = "-corner_pc_type none_such -plain_corner_pc_type none_such"
        printed = self.run_ranks(2, namelist, code=5, before="export PETSC_OPTIONS='%s'" % options)
        self.assertRegex(printed, r"PETSc: .*none_such.* \(error code 86\)")
        self.assertNotIn("SIGSEGV", printed)

    def test_puck_of_linear_elements(self):
        self.compare(self.puck(1))

    def test_puck_of_quadratic_elements(self):
        """Moments hold its spin: how far they let it go differs between pressures and displacements by 3e-7 of the energy."""
        self.compare(self.puck(2), reference="&solver response='multigrid', ")

    def test_pegs_under_a_lid(self):
        """Five floating bodies, one on top of the others; the second scene has linear elements beside quadratic ones."""
        for kinds in (("tet4", "hex8"), ("hex20", "tet4")):
            with self.subTest(kinds):
                lines = MATERIALS + [self.body("base", block_geo(kinds[0], (6, 6, 2), (0, 0, 0), (4, 4, 1)), "steel"),
                                     self.body("lid", block_geo(kinds[1], (7, 7, 2), (0, 0, 2), (4, 4, 0.5)), "soft"),
                                     "&support body='base', surface='bottom', fix='xyz' /"]
                for i, (x, y) in enumerate(((0.5, 0.5), (0.5, 2.6), (2.7, 0.5), (2.7, 2.6))):
                    lines += [self.body("peg %d" % i, block_geo(kinds[i % 2], (3, 2, 3), (x, y, 1), (0.8, 0.8, 1)), "soft"),
                              "&contact name='foot %d', surface_a='peg %d:bottom', surface_b='base:top' /" % (i, i),
                              "&contact name='head %d', surface_a='peg %d:top', surface_b='lid:bottom' /" % (i, i)]
                lines += ["&load body='lid', surface='top', traction_formula='0','0','-0.1*(1+0.3*x)' /", SOLVER]
                self.compare(self.write("case.nml", "\n".join(lines)), RANKS[-1:])

    def test_a_block_that_opens(self):
        """Pressed at a corner, a floating block opens at the other side."""
        for kind in ("prism6", "hex20"):
            with self.subTest(kind):
                lines = MATERIALS + [self.body("lower", block_geo(kind, (6, 6, 3), (0, 0, 0), (2, 2, 1)), "soft"),
                                     self.body("upper", block_geo(kind, (5, 5, 3), (0.3, 0.3, 1), (1.4, 1.4, 0.5)), "steel"),
                                     "&support body='lower', surface='bottom', fix='xyz' /",
                                     "&load body='upper', surface='top', traction_formula='0','0','-0.1*exp(-8*((x-1.2)^2+(y-1.1)^2))' /",
                                     "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", SOLVER]
                self.compare(self.write("case.nml", "\n".join(lines)))

    def test_a_layer_of_pyramids(self):
        """Pyramids join hexahedra to tetrahedra, and parts are cut through them."""
        for order in (1, 2):
            with self.subTest(order=order):
                lines = [*MATERIALS, self.body("lower", TRANSITION % order, "soft"),
                         self.body("upper", block_geo("hex8" if order == 1 else "hex27", (5, 5, 3), (0.3, 0.3, 1), (1.4, 1.4, 0.5)), "steel"),
                         "&support body='lower', surface='bottom', fix='xyz' /",
                         "&load body='upper', surface='top', traction_formula='0','0','-0.1*(1+0.2*x)' /",
                         "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", SOLVER]
                self.compare(self.write("case.nml", "\n".join(lines)))

    def test_a_roller_that_is_free_to_slide(self):
        """Three motions are free, and loads of one side tilt it. From rigid bodies at rest the active sets are few; from bodies where they
        were, each set is far from the next, and they come again."""
        lines = [*MATERIALS, self.body("floor", block_geo("hex20", (8, 8, 3), (0, 0, 0), (2, 2, 1)), "soft"), self.body("roller", ROLLER, "steel"),
                 "&support body='floor', surface='bottom', fix='xyz' /", "&support body='roller', surface='end', fix='y' /",
                 "&load body='roller', force_density_formula='0','0','-0.02*(1+3*(y-1)^2)' /",
                 "&contact name='line', surface_a='roller:side', surface_b='floor:top' /", SOLVER.replace("theta=0", "theta_relative=1e-3")]
        namelist = self.write("case.nml", "\n".join(lines))
        self.compare(namelist, RANKS[:1], reference="&solver response='multigrid', ")
        printed = self.run_ranks(2, namelist, "--output", self.folder / "split.vtkhdf")
        self.assertLessEqual(int(re.search(r"displacements +(\d+) active sets", printed)[1]), 10)

    def test_heated_bodies(self):
        """A warm block with an initial stress, which rotates, under a floating one that heats up: each rank has temperatures and stresses of its part."""
        hot = [line.replace("name='", "expansion=1e-3, density=0.1, name='") if line.startswith("&material") else line for line in MATERIALS]
        lines = [*hot, self.body("lower", block_geo("tet10", (5, 5, 3), (0, 0, 0), (2, 2, 1)), "soft"),
                 self.body("upper", block_geo("hex8", (6, 6, 4), (0.3, 0.3, 1), (1.4, 1.4, 0.5)), "steel"),
                 "&support body='lower', surface='bottom', fix='xyz' /", "&temperature body='upper', formula='3 + 4*x*y - z' /",
                 "&temperature body='lower', value=2 /", "&initial_stress body='lower', formula='0.01*z','0','0.02*x','0','0','0.01' /",
                 "&load body='upper', surface='top', traction_formula='0','0','-0.1*(1+x)' /", "&load body='lower', angular_velocity=0,0.2,0.5 /",
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /", SOLVER]
        self.compare(self.write("case.nml", "\n".join(lines)))
        stress, error = [], []
        for name in "factors", *map(str, RANKS):
            with h5py.File(self.folder / (name + ".vtkhdf")) as file:
                stress.append(file["VTKHDF/CellData/stress"][()])
                error.append(file["VTKHDF/CellData/discretization_error"][()])
        for i in range(1, len(stress)):
            np.testing.assert_allclose(stress[i], stress[0], atol=1e-6 * np.max(np.abs(stress[0])))
            np.testing.assert_allclose(error[i], error[0], rtol=1e-3, atol=1e-3 * np.max(error[0]))

    def test_what_results_say(self):
        """The energy is the sum of its terms, and what nobody has measured has no number."""
        lines = [*MATERIALS, self.body("lower", block_geo("tet10", (4, 4, 2), (0, 0, 0), (2, 2, 1)), "soft"),
                 self.body("upper", block_geo("hex20", (3, 3, 2), (0.3, 0.3, 1), (1.4, 1.4, 0.5)), "steel"),
                 "&support body='lower', surface='bottom', fix='xyz', value=0,0,0.001 /",
                 "&load body='upper', surface='top', traction_formula='0','0','-0.1*exp(-8*((x-1.2)^2+(y-1.1)^2))' /",
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top', discretization='quadrature' /",
                 "&solver response='multigrid', theta_relative=1e-3, tolerance=0.01 /"]
        found, factors = self.folder / "split.vtkhdf", self.folder / "factors.vtkhdf"
        self.run_ranks(2, self.write("case.nml", "\n".join(lines)), "--output", found)
        self.run_ranks(1, self.write("full.nml", "\n".join(lines).replace("'multigrid'", "'full'")), "--output", factors)
        # Extrapolated from other solutions than with factors.
        self.assertLessEqual(abs(self.penalty(found) / self.penalty(factors) - 1), 0.05)
        with h5py.File(found) as file:
            summary = file["dotyk/summary"]
            terms = [summary.attrs[name] for name in ("strain_energy", "load_work", "penalty_energy")]
            self.assertLessEqual(abs(terms[0] - terms[1] + terms[2] - summary.attrs["energy"]), 1e-12 * terms[0])
            self.assertTrue(np.all(np.isnan(summary["condition_number"][()])))
            self.assertEqual(summary["digits_lost"][()].tolist(), [-1, -1])
            self.assertEqual(summary["congruence_class"][()].tolist(), [0, 0])
            self.assertEqual(summary.attrs["factorizations"], 0)
            self.assertEqual(summary.attrs["bodies_by_multigrid"], 2)
            self.assertNotIn("stiffness_bytes", summary.attrs)

    def test_more_iterations_than_factors_are_worth(self):
        """A plate of four layers: its factor is cheap, the tolerance small. The scene is built anew, and its tables are printed once."""
        lines = [*MATERIALS, self.body("plate", block_geo("hex8", (92, 92, 4), (0, -2, -0.08), (4, 4, 0.08)), "steel"),
                 self.body("foot", block_geo("hex8", (8, 8, 4), (2.5, -0.5, 0), (1, 1, 0.5)), "steel"),
                 "&support body='plate', surface='sides x', fix='xyz' /", "&support body='foot', surface='top', fix='xy' /",
                 "&load body='foot', surface='top', pressure=1e-5 /", "&contact name='joint', surface_a='foot:bottom', surface_b='plate:top' /",
                 "&solver theta=0, tolerance=1e-9 /"]
        printed = self.run_ranks(2, self.write("case.nml", "\n".join(lines)), seconds=300)
        self.assertIn(SPLIT % 2, printed)
        self.assertIn("p-multigrid would take longer than factors", printed)
        self.assertIn("guaranteed (tolerance 1e-9)", printed)
        self.assertEqual(printed.count("  load                 resultant"), 1)
        self.assertEqual(printed.count("slave foot:bottom"), 1)

    def test_examples(self):
        """A floating layer in the plane; rows between held nodes, whose entries are rounding errors."""
        for folder in ("receding", "composite"):
            with self.subTest(folder):
                self.compare(self.copy(folder) / (folder + ".nml"), RANKS[:1])

    def test_modulus_field_on_elements_of_many_sizes(self):
        """Penalty parameters follow the mean of the field over the volume, not over the elements."""
        graded = block_geo("tet10", (3, 3, 2), (0, 0, 0), (2, 2, 1)).replace("Layers{2}", "Layers{{4, 1}, {0.1, 1}}")
        lines = [*MATERIALS, "&material name='ground', young=20, poisson=0.2, young_formula='1+9*z^2' /", self.body("lower", graded, "ground"),
                 self.body("upper", block_geo("hex20", (3, 3, 2), (0.3, 0.3, 1), (1.2, 1.2, 0.5)), "steel"),
                 "&support body='lower', surface='bottom', fix='xyz' /", "&support body='upper', surface='sides x', fix='xy' /",
                 "&load body='upper', surface='top', pressure=0.1 /", "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                 SOLVER.replace("theta=0", "theta_relative=1e-2")]
        self.compare(self.write("case.nml", "\n".join(lines)), RANKS[:1])

    def test_a_body_whose_nodes_are_all_held(self):
        """It moves by given displacements, and has no equation; its one element belongs to one rank."""
        lines = [*MATERIALS, self.body("lower", block_geo("hex20", (4, 4, 2), (0, 0, 0), (2, 2, 1)), "soft"),
                 self.body("upper", block_geo("tet10", (3, 3, 2), (0.3, 0.3, 1), (1.2, 1.2, 0.5)), "steel"),
                 self.body("stamp", block_geo("hex8", 1, (0.5, 0.5, 1.5), (0.8, 0.8, 0.5)), "steel"),
                 "&support body='lower', surface='bottom', fix='xyz' /", "&support body='stamp', surface='top', fix='xyz' /",
                 "&support body='stamp', surface='bottom', fix='xyz', value=0,0,-0.01 /",
                 "&contact name='foot', surface_a='upper:bottom', surface_b='lower:top' /",
                 "&contact name='head', surface_a='upper:top', surface_b='stamp:bottom' /", SOLVER.replace("theta=0", "theta_relative=1e-3")]
        self.compare(self.write("case.nml", "\n".join(lines)), RANKS[-1:])

    def test_nearly_incompressible_bodies_keep_factors(self):
        """The log says why, and the run has the accuracy of factors."""
        lines = [*MATERIALS, "&material name='rubber', young=1, poisson=0.499 /", self.body("lower", TWO_BOXES, "steel"),
                 self.body("upper", block_geo("hex20", 2, (0, 0, 1)), "rubber"), "&support body='lower', surface='bottom', fix='xyz' /",
                 "&load body='upper', surface='top', pressure=1e-3 /", "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                 SOLVER.replace("&solver", "&solver response='multigrid', ")]
        # Where elements may be elevated, each rank reads whole bodies at once; else shares, and the scene is built anew.
        for locking in ("auto", "ignore"):
            with self.subTest(locking):
                text = "\n".join(lines).replace("&solver", "&solver locking='%s', " % locking)
                printed = self.run_ranks(2, self.write("case.nml", text))
                self.assertEqual(printed.count("'upper' is nearly incompressible: bodies are not split over ranks"), 1)
                self.assertNotIn(SPLIT % 2, printed)
                self.assertEqual(printed.count("body 'lower': 2 unconnected parts"), 1)

    def test_all_wrong_volumes_are_told(self):
        lines = [*MATERIALS, self.body("lower", block_geo("tet10", 2), "steel"), self.body("upper", block_geo("hex20", 2, (0, 0, 1)), "soft"),
                 "&support body='lower', surface='bottom', fix='xyz' /", "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                 SOLVER.replace("&solver", "&solver response='multigrid', ")]
        printed = self.run_ranks(2, self.write("case.nml", "\n".join(lines).replace("volume='block'", "volume='blok'")), code=2)
        for line, name in ((4, "lower"), (5, "upper")):
            self.assertRegex(printed, r"case\.nml:%d: mesh '\S*%s\.geo' has no physical volume 'blok'" % (line, name))

    def test_a_modulus_field_that_is_negative(self):
        """On the part of one rank: all ranks end, and the message names the body."""
        lines = [*MATERIALS, "&material name='ground', young=20, poisson=0.2, young_formula='x+y>3.5 ? -1 : 1' /",
                 self.body("lower", block_geo("hex8", 6, (0, 0, 0), (2, 2, 2)), "ground"), self.body("upper", block_geo("hex8", 6, (0, 0, 2)), "soft"),
                 "&support body='lower', surface='bottom', fix='xyz' /", "&load body='upper', surface='top', pressure=0.1 /",
                 "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                 SOLVER.replace("&solver", "&solver response='multigrid', ")]
        printed = self.run_ranks(3, self.write("case.nml", "\n".join(lines)), code=2)
        self.assertIn("body 'lower': young_formula: the modulus factor must be positive, it is -1 at ", printed)

    def test_a_hinge_is_not_split(self):
        """Two boxes with one edge in common: nothing resists a turn about it, and the loads are not in equilibrium. Beside them a body
        that could be split."""
        hinge = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};  Box(2) = {1, 0, 1, 1, 1, 1};  v() = BooleanFragments{Volume{1}; Delete;}{Volume{2}; Delete;};
Mesh.MeshSizeMax = 0.3;  Mesh.MeshSizeMin = 0.3;  Mesh.ElementOrder = 2;
Physical Volume("block") = {v()};  e = 1e-6;
Physical Surface("bottom") = {Surface In BoundingBox{-e, -e, -e, 1 + e, 1 + e, e}};
"""
        lines = [*MATERIALS, self.body("hinge", hinge, "steel"), "&support body='hinge', surface='bottom', fix='xyz' /",
                 self.body("block", block_geo("hex20", 3, (3, 0, 0)), "steel"), "&support body='block', surface='bottom', fix='xyz' /",
                 "&load body='hinge', force_density=0,0,-0.1 /", SOLVER.replace("&solver", "&solver response='multigrid', ")]
        printed = self.run_ranks(2, self.write("case.nml", "\n".join(lines)), code=3)
        self.assertIn("edges or corners alone join pieces of 'hinge': bodies are not split over ranks", printed)
        self.assertNotIn(SPLIT % 2, printed)

    def test_a_motion_that_is_held_needs_factors(self):
        """Between floor and wall, a pin is turned: only the facets of its mesh resist. The scene is built anew, and the answer is that of
        factors to the bit."""
        floor = block_geo("hex8", (92, 92, 4), (0, -2, -0.16), (4, 4, 0.16))
        lines = [*MATERIALS, self.body("floor", floor, "steel"),
                 self.body("wall", block_geo("hex8", (4, 8, 8), (-1, -1, 0), (1, 2, 2)), "steel"), self.body("pin", PIN, "steel"),
                 "&support body='floor', surface='bottom', fix='xyz' /", "&support body='wall', surface='bottom', fix='xyz' /",
                 "&load body='pin', force_density_formula='-0.1+0.02*(z-0.5)', '0', '-0.1' /",
                 "&contact name='floor', surface_a='pin:side', surface_b='floor:top' /",
                 "&contact name='wall', surface_a='pin:side', surface_b='wall:sides x' /",
                 "&solver theta=0, tolerance=1e-3 /"]
        namelist = self.write("case.nml", "\n".join(lines))
        text = namelist.read_text()
        printed = self.run_ranks(2, namelist, "--output", self.folder / "auto.vtkhdf", seconds=300)
        self.assertIn(SPLIT % 2, printed)
        self.assertRegex(printed, "the contact needs factors|would take longer than factors")
        namelist.write_text(text.replace("&solver", "&solver response='full', "))
        self.run_ranks(2, namelist, "--output", self.folder / "full.vtkhdf")
        (a, _), (b, _) = forces(self.folder / "full.vtkhdf"), forces(self.folder / "auto.vtkhdf")
        for pair, force in a.items():
            np.testing.assert_array_equal(b[pair], force)


if __name__ == "__main__":
    dotyk_case.main()
