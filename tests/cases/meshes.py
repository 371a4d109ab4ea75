"""Meshes that are not what they seem: cracks, hanging nodes, overlaps, mixed orders and loose parts within one body."""
import dotyk_case

# Two squares, the upper one with a lower edge of its own: in two pieces, of which the left one may be shared.
SQUARES = """
n = 4; m = %(upper)d; d = %(distance)r;
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0.5, 1, 0}; Point(5) = {0, 1, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 1};
Curve Loop(1) = {1:5}; Plane Surface(1) = {1};
Point(6) = {1, 2, 0}; Point(7) = {0, 2, 0}; Point(8) = {1, 1+d, 0}; Point(9) = {0.5, 1+d, 0}; Point(10) = {0, 1+d, 0};
// Points of the upper square's lower edge from right to left: none shared; the left half; all points, but no line
p() = {8, 9, 10};
If(%(shared)d == 1) p() = {8, 4, 5}; EndIf
If(%(shared)d == 2) p() = {3, 4, 5}; EndIf
Line(9) = {p(0), p(1)}; Line(10) = {p(1), p(2)}; Line(6) = {p(2), 7}; Line(7) = {7, 6}; Line(8) = {6, p(0)};
left = 10; If(%(shared)d == 1) left = 4; EndIf
Curve Loop(2) = {-8, -7, -6, -left, -9};
Plane Surface(2) = {2};
Transfinite Curve {3, 4} = n/2+1; Transfinite Curve {1, 2, 5, 6, 7, 8} = n+1; Transfinite Curve {9, 10} = m/2+1;
Physical Surface("both") = {1, 2}; Physical Surface("lower") = {1}; Physical Surface("upper") = {2};
Physical Curve("low") = {1}; Physical Curve("high") = {7}; Physical Curve("side") = {2, 8};
"""
MATERIAL = "&material name='steel', young=1e5, poisson=0.3 /\n"
ONE = MATERIAL + """&body name='block', volume='both', material='steel' %s /
&support body='block', surface='low', fix='xy' /
&support body='block', surface='high', fix='xy', value=0,1e-3 /
&load body='block', surface='side', pressure=-1 /
"""
TWO = MATERIAL + """&body name='lower', volume='lower', material='steel' /
&body name='upper', volume='upper', material='steel' /
&support body='lower', surface='low', fix='xy' /
&support body='upper', surface='high', fix='xy', value=0,1e-3 /
&load body='lower', surface='side', pressure=-1 /
&load body='upper', surface='side', pressure=-1 /
"""
DISCONNECTED = "the body is disconnected there. Join its parts in gmsh"


class Meshes(dotyk_case.Case):
    def squares(self, upper=4, distance=0.0, shared=0):
        """Two squares: divisions of the upper one's lower edge, its distance, whether the left half is shared."""
        self.write("mesh.geo", SQUARES % {"upper": upper, "distance": distance, "shared": shared})

    def run_case(self, text, code=0, name="case", plane=True):
        """Run a case; what it prints."""
        analysis = ", analysis='plane_strain'" if plane else ""
        self.write(name + ".nml", "&scene mesh='mesh.geo'%s /\n" % analysis + text)
        return self.dotyk(name + ".nml", code=code)

    def test_cracks_are_refused_or_meant(self):
        """With the key, the answer is that of two bodies."""
        self.squares()
        text = self.run_case(ONE % "", code=2)
        self.assertRegex(text, r"case.nml:3: body 'block', mesh 'mesh.geo': nodes \d+ and \d+ lie at the same place \(")
        self.assertIn("(5 such pairs), and faces of the body touch there, over a length of about 1, near (", text)
        self.assertIn(DISCONNECTED, text)
        text = self.run_case(ONE % ", crack=.true.")
        self.assertIn("body 'block': cracked, as crack=.true. says: nodes ", text)
        self.assertIn("body 'block': 2 unconnected parts", text)
        self.run_case(TWO, name="two")
        energy = [self.results(name + ".vtkhdf")["dotyk/summary"].attrs["strain_energy"] for name in ("case", "two")]
        self.assertAlmostEqual(energy[0]/energy[1], 1, delta=1e-12)

    def test_cracks_that_nobody_sees(self):
        """Nodes 1e-11 apart, and on a part of the interface only."""
        self.squares(distance=1e-11)
        self.assertIn("(5 such pairs)", self.run_case(ONE % "", code=2))
        self.squares(shared=1)
        text = self.run_case(ONE % "", code=2)
        self.assertIn("(2 such pairs), and faces of the body touch there, over a length of about 0.5, near (", text)
        text = self.run_case(ONE % ", crack=.true.")
        self.assertIn("cracked, as crack=.true. says", text)
        self.assertNotIn("unconnected parts", text)

    def test_hanging_nodes_are_refused(self):
        self.squares(upper=6, shared=2)
        text = self.run_case(ONE % "", code=2)
        self.assertIn("faces of the body touch whose meshes do not match: nodes of one side hang on the other, over a "
                      "length of about 1, near (", text)
        self.assertIn(DISCONNECTED, text)
        self.write("mesh.geo", """SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1}; Box(2) = {0, 0, 1, 1, 1, 1};
            Mesh.MeshSizeMax = 0.4; MeshSize { PointsOf { Volume {2}; } } = 0.2;
            If(%d) BooleanFragments { Volume {1}; Delete; }{ Volume {2}; Delete; } EndIf
            Physical Volume("both") = {1, 2}; Physical Surface("low") = Surface In BoundingBox {-9, -9, -0.1, 9, 9, 0.1};
            """ % 0)
        solid = MATERIAL + ("&body name='block', volume='both', material='steel' /\n"
                            "&support body='block', surface='low', fix='xyz' /\n")
        text = self.run_case(solid, code=2, plane=False)
        self.assertIn(DISCONNECTED, text)
        self.assertRegex(text, r"over an area of about (0\.9|1)")
        geo = (self.folder/"mesh.geo").read_text()
        self.write("mesh.geo", geo.replace("If(0)", "If(1)"))
        self.assertNotIn("body 'block'", self.run_case(solid, plane=False))

    def test_slits_are_told(self):
        self.squares(distance=1e-5)
        text = self.run_case(ONE % "")
        self.assertIn("warning: body 'block': faces that are not connected are 1e-5 apart or less", text)
        self.squares(distance=1e-2)
        self.assertNotIn("warning: body", self.run_case(ONE % ""))

    def test_overlaps_are_refused(self):
        """A disc in a ring, each with polygons of its own for the common arc."""
        self.write("mesh.geo", """SetFactory("OpenCASCADE"); Disk(1) = {0, 0, 0, 2}; Disk(2) = {0, 0, 0, 1};
            Disk(3) = {0, 0, 0, 1}; BooleanDifference(4) = { Surface {1}; Delete; }{ Surface {2}; Delete; };
            Transfinite Curve {3} = 13; Mesh.MeshSizeMax = 0.4;
            Physical Surface("both") = {3, 4}; Physical Curve("low") = {1};
            """)
        text = self.run_case(MATERIAL + "&body name='block', volume='both', material='steel' /\n", code=2)
        self.assertIn("unconnected parts of the body overlap by up to 0.0", text)

    def test_mixed_orders_are_refused(self):
        """A quad4 beside a quad8."""
        x = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1), (1.5, 0), (2, 0.5), (1.5, 1), (1, 0.5)]
        self.write("mesh.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 \"both\"\n"
                   "$EndPhysicalNames\n$Nodes\n10\n%s\n$EndNodes\n$Elements\n2\n1 3 2 1 1 1 2 3 4\n"
                   "2 16 2 1 1 2 5 6 3 7 8 9 10\n$EndElements\n"
                   % "\n".join("%d %g %g 0" % (i + 1, *p) for i, p in enumerate(x)))
        self.write("case.nml", "&scene mesh='mesh.msh', analysis='plane_strain' /\n" + MATERIAL
                   + "&body name='block', volume='both', material='steel' /\n")
        self.assertIn("elements 1 and 2 near (1, 1) have other nodes on their common face (1 such face)",
                      self.dotyk("case.nml", "--check", code=2))

    def test_hinges_are_told(self):
        """Squares that share a corner only."""
        self.write("mesh.geo", """Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};
            Point(5) = {2, 1, 0}; Point(6) = {2, 2, 0}; Point(7) = {1, 2, 0};
            Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Line(5) = {3, 5}; Line(6) = {5, 6};
            Line(7) = {6, 7}; Line(8) = {7, 3}; Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
            Curve Loop(2) = {5:8}; Plane Surface(2) = {2}; Mesh.MeshSizeMax = 0.5;
            Physical Surface("both") = {1, 2}; Physical Curve("low") = {1}; Physical Curve("high") = {7};
            """)
        text = self.run_case((ONE % "").replace("&load body='block', surface='side', pressure=-1 /", ""))
        self.assertIn("warning: body 'block': edges or corners alone join its 2 pieces, as hinges do", text)

    def test_a_hinge_by_multigrid(self):
        """Two boxes with an edge in common, of which one rests on a prop and may turn about the edge: factors find the motion, iterations
        would follow it."""
        self.write("mesh.geo", """SetFactory("OpenCASCADE");
            Box(1) = {0, 0, 0, 1, 1, 1};  Box(2) = {1, 0, 1, 1, 1, 1};
            v() = BooleanFragments{Volume{1}; Delete;}{Volume{2}; Delete;};  Box(9) = {1.2, 0, 0.5, 1, 1, 0.5};
            Mesh.MeshSizeMax = 0.4;  Mesh.MeshSizeMin = 0.4;  Mesh.ElementOrder = 2;  e = 1e-6;
            Physical Volume("hinge") = {v()};  Physical Volume("prop") = {9};
            Physical Surface("low") = {Surface In BoundingBox{-e, -e, -e, 1 + e, 1 + e, e}};
            Physical Surface("foot") = {Surface In BoundingBox{1, -e, 0.5 - e, 3, 1 + e, 0.5 + e}};
            """)
        text = self.run_case("""
            &material name='m', young=1000, poisson=0.25 /
            &body name='hinge', volume='hinge', material='m' /
            &body name='prop', volume='prop', material='m' /
            &support body='hinge', surface='low', fix='xyz' /
            &support body='prop', surface='foot', fix='xyz' /
            &load body='hinge', force_density=0,0,-1 /
            &contact auto=.true. /
            &solver response='multigrid' /
            """, code=3, plane=False)
        self.assertIn("body 'hinge': the stiffness matrix is not positive definite", text)
        self.assertFalse((self.folder / "case.vtkhdf").exists())


if __name__ == "__main__":
    dotyk_case.main()
