"""Bodies whose stiffness is ill-conditioned: right to the digits that the data allow, or refused with the reason."""
from fractions import Fraction

import blocks
import cylinder
import dotyk_case
import numpy as np

N = 4  # elements along each edge


def column_of(stiffness, pull):
    """Pressure of the column: N elements of Young's modulus 1 below N elements of given ones, heights and sections 1,
    both ends held, under a load per volume on the upper half; exactly."""
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

    def scene(self, soft, where="z > 1.75", solver="theta=0, tolerance=1e-8"):
        for name, z in (("lower", 0), ("upper", 1)):
            blocks.mesh(self.write(name + ".geo", blocks.block_geo("hex8", N, (0, 0, z))), 3)
        lines = ["&scene output='case.vtkhdf' /", "&material name='even', young=1, poisson=0 /",
                 "&material name='hung', young=1, poisson=0, young_formula='(%s) ? %r : 1' /" % (where, soft)]
        for name, material in (("lower", "even"), ("upper", "hung")):
            lines += ["&body name='%s', mesh='%s.msh', volume='block', material='%s' /" % (name, name, material)]
        lines += ["&support body='lower', surface='sides %s', fix='%s' /" % (axis, axis) for axis in "xy"]
        lines += ["&support body='lower', surface='bottom', fix='z' /",
                  "&support body='upper', surface='top', fix='xyz' /", "&load body='upper', force_density=0,0,-1 /",
                  "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                  "&solver %s /" % solver]
        return self.write("case.nml", "\n".join(lines) + "\n")

    def check(self, soft, layer, where):
        """Every pressure of the joint is that of the column, and nothing moves to the side; the motions are those of a
        rigid block."""
        exact = float(column_of([soft if i == layer else 1 for i in range(N)], 1))
        self.dotyk(self.scene(soft, where))
        found = self.results("case.vtkhdf")
        pressure = found["dotyk/contact/joint/pressure"][()]
        # Without any care 1e-16 over the stiffness of the layer is lost.
        self.assertLess(abs(pressure/exact - 1).max(), 1e-12, "soft layer of %g" % soft)
        upper = found["VTKHDF/PointData/displacement"][()][found["VTKHDF/NumberOfPoints"][0]:]
        self.assertLess(abs(upper[:, :2]).max(), 1e-12)
        summary = found["dotyk/summary"]
        self.assertEqual(summary.attrs["near_null_modes"], 0 if soft > 1e-3 else 6)
        self.assertEqual(summary.attrs["rigid_body_modes"], 0)
        # What is rounded of forces can move the block against its layer: 1e-16 over the root of its stiffness.
        self.assertLess(summary.attrs["error_bound"], 1e-8)
        condition = summary["condition_number"][1]
        if soft < 1e-3:
            self.assertBetween(1, condition*soft, 1e3, "condition %g with a layer of %g" % (condition, soft))

    def test_soft_layers_hold_a_block_against_contact(self):
        for soft in (1e-2, 1e-6, 1e-10, 1e-14):
            self.check(soft, N - 1, "z > 1.75")

    def test_a_soft_layer_between_stiff_ones(self):
        for soft in (1e-6, 1e-12):
            self.check(soft, 2, "z > 1.5 && z < 1.75")

    def test_no_digit_left(self):
        text = self.dotyk(self.scene(1e-19, "z > 1.5 && z < 1.75"), code=3)
        self.assertIn("body 'upper'", text)
        self.assertIn("no significant digit of the stiffness matrix remains", text)
        self.assertIn("young_formula", text)


class FlatElements(dotyk_case.Case):
    """A clamped plate of linear elements, pressed on a block with so flat elements that their stiffness loses
    digits."""

    def scene(self, thickness, turn=None, tolerance=1e-10):
        turn = np.eye(3) if turn is None else turn
        for name, place in (("lower", lambda x: x), ("upper", lambda x: x*[1, 1, thickness] + [0, 0, 1])):
            blocks.mesh(self.write(name + ".geo", blocks.block_geo("hex8", N, (0, 0, 0))), 3,
                        lambda x: place(x) @ turn.T)
        lines = ["&scene output='case.vtkhdf' /", "&material name='even', young=1, poisson=0 /"]
        for name in ("lower", "upper"):
            lines += ["&body name='%s', mesh='%s.msh', volume='block', material='even' /" % (name, name)]
        lines += ["&support body='lower', surface='sides %s', fix='n' /" % axis for axis in "xy"]
        lines += ["&support body='lower', surface='bottom', fix='n' /",
                  "&support body='upper', surface='sides x', fix='xyz' /",
                  "&load body='upper', surface='top', pressure=1e-3 /",
                  "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                  "&solver theta=0, tolerance=%r /" % tolerance]
        return self.write("case.nml", "\n".join(lines) + "\n")

    def run_scene(self, *arguments):
        self.dotyk(self.scene(*arguments))
        found = self.results("case.vtkhdf")
        force = np.linalg.norm(found["dotyk/contact/joint"].attrs["force"])
        summary = found["dotyk/summary"]
        result = (force, summary.attrs["energy"], summary.attrs["error_bound"], summary["refinement_steps"][1],
                  summary["condition_number"][1], summary.attrs["full_solves"])
        found.close()
        return result

    def test_layers_of_aspect_ten_thousand_do_not_depend_on_their_direction(self):
        # The last digits of coordinates of a turned plate change its strains by 1e-16 times the aspect.
        c, s = np.cos(0.7), np.sin(0.7)
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        straight = self.run_scene(2.5e-5)
        turned = self.run_scene(2.5e-5, turn)
        for force, energy, bound, steps, condition, full_solves in (straight, turned):
            self.assertGreater(condition, 1e9)
            self.assertGreater(steps, 0)
            # The loaded plate without contact; both bodies before, for and after each correction of the contact.
            self.assertGreaterEqual(full_solves, 1 + 3*2)
            self.assertLess(bound, 1e-10)
            self.assertLess(abs(force/straight[0] - 1), 1e-9)
            self.assertLess(abs(energy/straight[1] - 1), 1e-9)

    def test_elements_too_flat(self):
        # Of aspect 1e9.
        text = self.dotyk(self.scene(1e-9), code=3)
        self.assertIn("body 'upper'", text)
        self.assertIn("no significant digit of", text)
        self.assertIn("elements of aspect ratio", text)

    def test_plate_of_a_hundredth(self):
        # Held against sliding alone, it gives the block what lies on it.
        self.write("lower.geo", blocks.block_geo("hex8", N))
        self.write("upper.geo", blocks.block_geo("hex8", N, (0, 0, 1), (1, 1, 0.01)))
        lines = ["&scene output='case.vtkhdf' /", "&material name='even', young=1, poisson=0 /"]
        for name in ("lower", "upper"):
            lines += ["&body name='%s', mesh='%s.geo', volume='block', material='even' /" % (name, name)]
            lines += ["&support body='%s', surface='sides %s', fix='n' /" % (name, axis) for axis in "xy"]
        lines += ["&support body='lower', surface='bottom', fix='n' /",
                  "&load body='upper', surface='top', pressure=1e-3 /",
                  "&contact name='joint', surface_a='upper:bottom', surface_b='lower:top' /",
                  "&solver theta=0, tolerance=1e-8 /"]
        self.dotyk(self.write("case.nml", "\n".join(lines) + "\n"))
        np.testing.assert_allclose(self.results("case.vtkhdf")["dotyk/contact/joint/pressure"][()], 1e-3, rtol=1e-10)


class Incompressible(dotyk_case.Case):
    """A thick cylinder whose bulk modulus takes the digits: what refinement alone wins back, and where that ends."""

    def solve(self, poisson, code=0):
        self.write("tube.geo", cylinder.geometry("quad4", 4))
        blocks.mesh(self.folder/"tube.geo", 2)
        self.write("tube.nml", cylinder.scene("plane_strain", 0.3).replace("poisson=0.3", "poisson=" + poisson))
        text = self.dotyk("tube.nml", code=code)
        if code:
            return text
        with self.results("tube.vtkhdf") as file:
            summary = file["dotyk/summary"]
            return (file["VTKHDF/PointData/displacement"][()], summary["refinement_steps"][0],
                    summary["digits_lost"][0],
                    summary.attrs["error_bound"])

    def test_refinement_alone(self):
        # 12 to 14 of 16 digits are not in the factors any more. The answers differ by 1e-7, as Poisson's ratios do.
        coarse, *_ = self.solve("0.4999999")
        for poisson in ("0.4999999999", "0.499999999999"):
            found, steps, lost, bound = self.solve(poisson)
            self.assertGreater(steps, 0)
            self.assertGreaterEqual(lost, 12)
            self.assertLess(abs(found - coarse).max(), 2e-7*abs(coarse).max())
            # The bulk modulus times the last digits of the displacement: sqrt(K/G) 1e-16.
            self.assertBetween(1e-14, bound, 1e-8)

    def test_no_digit_of_the_pressures(self):
        # K/G = 5e14. From 2e15 on rounding decides whether the factorization fails instead.
        text = self.solve("0.499999999999999", code=3)
        self.assertIn("body 'tube': no significant digit remains in the pressures of the nearly incompressible "
                      "material 'rubber'", text)


if __name__ == "__main__":
    dotyk_case.main()
