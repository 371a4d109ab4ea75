"""Ties at the end of slender bodies, whose bending is softer than their facets by many digits."""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from dotyk_case import Case, main  # noqa: E402


class SlenderTies(Case):
    def cantilever(self, order, length, contact, code=0):
        """A strip of height 1, held at its start; a block of length 4 lies on its end, tied to it over the last half, in
        contact without penalty over the first one. Their nodes meet."""
        for name, first, lengths, low, divisions in (("strip", 0.0, (length - 2.0, 2.0), 0.0, (int(length) - 2, 8)),
                                                     ("block", length - 4.0, (2.0, 2.0), 1.0, (8, 8))):
            self.write(name + ".geo", """
Mesh.ElementOrder = %d; Mesh.SecondOrderIncomplete = 1;
Point(1) = {%r, %r, 0};
line() = Extrude {%r, 0, 0} { Point{1}; Layers{%d}; };
more() = Extrude {%r, 0, 0} { Point{line(0)}; Layers{%d}; };
a() = Extrude {0, 1, 0} { Curve{line(1)}; Layers{2}; Recombine; };
b() = Extrude {0, 1, 0} { Curve{more(1)}; Layers{2}; Recombine; };
Physical Surface("body") = {a(1), b(1)};
Physical Curve("low 1") = {line(1)}; Physical Curve("low 2") = {more(1)};
Physical Curve("high 1") = {a(0)}; Physical Curve("high 2") = {b(0)}; Physical Curve("high") = {a(0), b(0)};
Physical Curve("start") = Curve In BoundingBox {%r, %r, -0.1, %r, %r, 0.1};
""" % (order, first, low, lengths[0], divisions[0], lengths[1], divisions[1],
       first - 0.01, low - 0.01, first + 0.01, low + 1.01))
        lines = [
            "&scene analysis='plane_strain' /", "&material name='steel', young=1e5, poisson=0.3 /",
            "&body name='strip', mesh='strip.geo', volume='body', material='steel' /",
            "&body name='block', mesh='block.geo', volume='body', material='steel' /",
            "&support body='strip', surface='start', fix='xy' /",
            "&tie name='joint', surface_a='block:low 2', surface_b='strip:high 2' /",
            "&contact name='beside', surface_a='block:low 1', surface_b='strip:high 1', theta=0%s /" % contact,
            "&load body='block', surface='high', pressure=1e-6 /"]
        self.write("cantilever.nml", "\n".join(lines) + "\n")
        log = self.dotyk("cantilever.nml", code=code)
        return log if code else self.results("cantilever.vtkhdf")

    def test_end_of_a_cantilever(self):
        """Pressures at the end of a strip do not know how long it is. 700 times as long as thick it yields by 1e9 times as
        much as its facets: rows beside the tie are not held for all that, and rounding of those that are is no overlap."""
        for order in (1, 2):
            with self.subTest(order=order):
                short = self.cantilever(order, 20, "")["dotyk/contact/beside/pressure"][:]
                file = self.cantilever(order, 700, "")
                self.assertLess(file["dotyk/summary"].attrs["error_bound"], 1e-6)
                self.assertGreater(short.max(), 1e-6)
                # Energies know pressures to the bound of the error, single ones in the norm of a facet.
                np.testing.assert_allclose(file["dotyk/contact/beside/pressure"][:], short, atol=1e-4 * short.max())

    def test_overlap_that_a_tie_holds(self):
        """The row at the edge of the tie cannot yield; those beside it, which overlap more, can."""
        for overlap in (1e-3, 1e-6):
            log = self.cantilever(1, 20, ", gap_formula='-%r - 0.01*(18 - x)'" % overlap, code=3)
            self.assertIn("cantilever.nml:7: &contact 'beside': the surfaces overlap by %s at (18, 1, 0)"
                          % ("0.001" if overlap == 1e-3 else "1e-6"), log)


if __name__ == "__main__":
    main()
