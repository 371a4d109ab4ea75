"""Bodies whose stiffness is ill-conditioned: right to the digits that the data allow, or refused with the reason."""
from fractions import Fraction

import blocks
import dotyk_case
import numpy as np

N = 4  # elements along each edge


def column_of(stiffness, pull):
    """Pressure of the column: N elements of Young's modulus 1 below N elements of given ones, heights and sections 1, both
    ends held, under a load per volume on the upper half; exactly."""
    k = [Fraction(N)]*N + [Fraction(value)*N for value in stiffness]
    f = [Fraction(0)]*(2*N + 1)
    for i in range(N, 2*N):
        f[i] -= Fraction(pull)/(2*N)
        f[i + 1] -= Fraction(pull)/(2*N)
    # Elimination from the top: what is left is a spring and a force on the node below.
    spring, force = k[2*N - 1], Fraction(0)
    for i in range(2*N - 1, 0, -1):
        force += f[i]
        if i == 1:
            return -k[0]*force/(k[0] + spring)
        series = k[i - 1] + spring
        spring, force = k[i - 1]*spring/series, force*k[i - 1]/series
    raise AssertionError


class WeakSupports(dotyk_case.Case):
    """A block on another one, hanging on a soft layer at its top; v = 0, so that elements in a column are springs."""

    def scene(self, soft, more="", solver="theta=0, tolerance=1e-12"):
        for name, z in (("lower", 0), ("upper", 1)):
            blocks.mesh(self.write(name + ".geo", blocks.block_geo("hex8", N, (0, 0, z))), 3)
        lines = ["&scene output='case.vtkhdf' /", "&material name='even', young=1, poisson=0 /",
                 "&material name='hung', young=1, poisson=0, young_formula='(z > 1.75) ? %r : 1' /" % soft]
        for name, material in (("lower", "even"), ("upper", "hung")):
            lines += ["&body name='%s', mesh='%s.msh', volume='block', material='%s' /" % (name, name, material)]
        lines += ["&support body='lower', surface='sides %s', fix='%s' /" % (axis, axis) for axis in "xy"]
        lines += ["&support body='lower', surface='bottom', fix='z' /", "&support body='upper', surface='top', fix='xyz' /",
                  "&load body='upper', force_density=0,0,-1 /",
                  "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                  "&solver %s /" % solver, more]
        return self.write("case.nml", "\n".join(lines) + "\n")

    def check(self, soft, delta):
        """Every pressure of the joint is that of the column."""
        exact = float(column_of([1]*(N - 1) + [soft], 1))
        self.dotyk(self.scene(soft))
        found = self.results("case.vtkhdf")
        pressure = found["dotyk/contact/joint/pressure"][()]
        self.assertLess(abs(pressure/exact - 1).max(), delta, "soft layer of %g" % soft)
        self.assertLess(found["dotyk/summary"].attrs["error_bound"], delta)
        return found["dotyk/summary"]

    def test_soft_layers_hold_a_block_against_contact(self):
        for soft in (1e-2, 1e-6, 1e-10, 1e-14):
            # Without any care 1e-16 over the stiffness of the layer is lost.
            summary = self.check(soft, 1e-12)
            self.assertEqual(summary.attrs["soft_motions"], 0 if soft > 1e-3 else 6)
            condition = summary["condition"][1]
            if soft < 1e-3:
                self.assertTrue(0.1 < condition*soft < 100*N**2, "condition %g of a layer of %g" % (condition, soft))


if __name__ == "__main__":
    dotyk_case.main()
