#!/usr/bin/python3
"""What must not change the answer: motions of the scene, units, the order of bodies and pairs, threads, and which side
is a.

The scene: an orthotropic block, inclined below, pressed on another that is not meshed alike, under tractions, and a
third beside it; partial contact, non-zero displacements in all directions.
"""
import numpy as np

import dotyk_case
from blocks import block_geo, mesh
import moved_scenes

# The iteration stops at 1e-11 of the energy norm; displacements are then as near as this, relative to the largest.
CLOSE = 1e-8


def incline(x):
    """The lower face of the upper block gets a slope."""
    y = x.copy()
    y[:, 2] += 2e-4 * x[:, 0] * (2 - x[:, 2])
    return y


def rotation():
    """A rotation about a skew axis (Rodrigues)."""
    axis, angle = np.array([1.0, 2.0, 3.0]) / np.sqrt(14), 0.7
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def vector(x):
    """Text of a vector for the input."""
    return ",".join(repr(float(c)) for c in x)


class Invariance(dotyk_case.Case):
    def scene(self, name="scene", turn=np.eye(3), shift=(0, 0, 0), length=1.0, stress=1.0, order=1, swap=False,
              solver="theta_relative=0.3, tolerance=1e-11", threads=2, divisions=(3, 2)):
        """Solve the scene moved by turn and shift, in units in which lengths are multiplied by length and stresses by
        stress.

        Returns the results, and the displacements of the bodies in their first order, moved and scaled back.
        """
        def place(x):
            return length * (x @ turn.T + np.array(shift))

        blocks = {"lower": ((0, 0, 0), divisions[0], lambda x: x), "upper": ((0.1, 0.2, 1), divisions[1], incline),
                  "other": ((1.1, 0.2, 1), 2, lambda x: x)}
        size = {"lower": (1.5, 1.4, 1), "upper": (0.8, 1, 1), "other": (0.3, 1, 1)}
        for body, (origin, n, shape) in blocks.items():
            geo = self.write("%s_%s.geo" % (name, body), block_geo("hex8", n, origin, size[body]))
            mesh(geo, 3, lambda x, shape=shape: place(shape(x)))
        bodies = ["&body name='%s', mesh='%s_%s.msh', volume='block', material='%s' /" % (
            body, name, body, "wood" if body == "upper" else "stone") for body in blocks]
        held = ["&support body='lower', surface='bottom', fix='xyz' /",
                "&support body='upper', surface='top', fix='n', value=0,0,%r /" % (-1.5e-4 * length),
                "&support body='upper', surface='sides y', fix='n' /",
                "&support body='upper', surface='sides x', fix='n' /",
                "&support body='other', surface='top', fix='xyz', value=%s /"
                % vector(length * turn @ [1e-5, 2e-5, -3e-4]),
                "&load body='lower', surface='sides x', traction=%s /" % vector(stress * turn @ [0.01, 0.02, -0.015]),
                "&load body='other', surface='sides y', pressure=%r /" % (0.01 * stress),
                "&load body='lower', force_density=%s /" % vector(stress / length * turn @ [0, 0.004, -0.01])]
        sides = ["'upper:bottom'", "'lower:top'"]
        if swap:
            sides.reverse()
        pairs = ["&contact name='touch', surface_a=%s, surface_b=%s /" % tuple(sides),
                 "&contact name='beside', surface_a='other:bottom', surface_b='lower:top' /"]
        material = ["&material name='stone', young=%r, poisson=0.25 /" % (100 * stress),
                    "&material name='wood', young=%s, poisson=0.3,0.2,0.25, shear=%s, axis_1=%s, axis_2=%s /" % (
                        vector(stress * np.array([200, 60, 40])), vector(stress * np.array([30, 25, 20])),
                        vector(turn @ [1, 1, 0]), vector(turn @ [0, 0, 1]))]
        self.write(name + ".nml", "\n".join(material + bodies[::order] + held[::order] + pairs[::order] +
                                            ["&scene title='three blocks' /", "&solver %s /" % solver]) + "\n")
        self.dotyk(name + ".nml", "--threads", threads)
        file = self.results(name + ".vtkhdf")
        first = np.concatenate([[0], np.cumsum(file["VTKHDF/NumberOfPoints"][:])])
        u = file["VTKHDF/PointData/displacement"][:]
        parts = [u[i:j] for i, j in zip(first[:-1], first[1:])][::order]
        return file, np.concatenate(parts) @ turn / length

    def check_same(self, close=CLOSE, stress=1.0, length=1.0, **options):
        """The reference and the changed scene agree; returns both files."""
        one, u = self.scene("one")
        two, v = self.scene("two", stress=stress, length=length, **options)
        np.testing.assert_allclose(v, u, rtol=0, atol=close * np.abs(u).max())
        for pair in ("touch", "beside"):
            a, b = one["dotyk/contact/" + pair], two["dotyk/contact/" + pair]
            np.testing.assert_allclose(b["pressure"][:] / stress, a["pressure"][:], rtol=0,
                                       atol=close * a["pressure"][:].max())
            self.assertAlmostEqual(b.attrs["theta"] * stress / length / a.attrs["theta"], 1, delta=1e-12)
        energies = [file["dotyk/summary"].attrs["energy"] for file in (one, two)]
        self.assertAlmostEqual(energies[1] / energies[0] / stress / length**3, 1, delta=close)
        return one, two

    def test_the_scene_is_worth_it(self):
        file, u = self.scene()
        pressure = file["dotyk/contact/touch/pressure"][:]
        self.assertBetween(0.1, np.mean(pressure > 0), 0.9)
        self.assertGreater(file["dotyk/contact/beside/pressure"][:].max(), 0)
        self.assertGreater(np.abs(u).max(axis=0).min(), 1e-5)

    def test_rotated(self):
        """Nodes and vectors at any angle."""
        turn = rotation()
        one, u = self.scene("one")
        two, v = self.scene("two", turn=turn, shift=(0.3, -2, 5))
        np.testing.assert_allclose(v, u, rtol=0, atol=CLOSE * np.abs(u).max())
        for pair in ("touch", "beside"):
            a, b = one["dotyk/contact/" + pair], two["dotyk/contact/" + pair]
            np.testing.assert_allclose(b["pressure"][:], a["pressure"][:], rtol=0, atol=CLOSE * a["pressure"][:].max())
            np.testing.assert_allclose(b["normal"][:], a["normal"][:] @ turn.T, rtol=0, atol=1e-12)
            np.testing.assert_allclose(b["gap_initial"][:], a["gap_initial"][:], rtol=0, atol=1e-12)
            np.testing.assert_allclose(b.attrs["force"], turn @ a.attrs["force"], rtol=0,
                                       atol=CLOSE * np.abs(a.attrs["force"]).max())

    def test_quarter_turn(self):
        """Axes along axes: nothing but the order of the coordinates changes."""
        self.check_same(turn=np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))

    def test_random_scenes(self):
        """Turned, mirrored, renumbered, with other bodies first: 100 of them by tools/invariance.py."""
        n_touching = 0
        for seed in range(20):
            scene = moved_scenes.Scene(seed)
            with self.subTest(seed=seed, scene=str(scene)):
                found = scene.differences(self.folder)
                self.assertLess(max(found.values()), 1e-9, found)
                n_touching += scene.run(self.folder)[1][0] > 1e-6
        self.assertGreater(n_touching, 10)

    def test_translated(self):
        self.check_same(shift=(100.0, -50.0, 20.0))

    def test_units(self):
        """Metres and pascals to millimetres and megapascals."""
        self.check_same(length=1e3, stress=1e-6)

    def test_order_of_bodies_pairs_and_supports(self):
        self.check_same(order=-1)

    def test_swapped_sides(self):
        """The other side's points: the same within the discretization error (found: 0.006 and 0.011)."""
        solver = "theta_relative=0.3, tolerance=1e-6"
        one, u = self.scene("one", divisions=(6, 5), solver=solver)
        two, v = self.scene("two", divisions=(6, 5), solver=solver, swap=True)
        np.testing.assert_allclose(v, u, rtol=0, atol=0.02 * np.abs(u).max())
        forces = [file["dotyk/contact/touch"].attrs["force"] for file in (one, two)]
        np.testing.assert_allclose(forces[1], -forces[0], rtol=0, atol=0.05 * np.abs(forces[0]).max())

    def test_again(self):
        """The same digits from run to run."""
        self.check_equal(self.scene("one")[0], self.scene("two")[0])

    def test_reproducible(self):
        """The same digits on one thread and on two; that BLAS threads are not taken:
        tests/unit/control/test_parallel.pf."""
        solver = "theta_relative=0.3, tolerance=1e-6, reproducible=.true."
        files = [self.scene("threads%d" % n, threads=n, solver=solver)[0] for n in (1, 2)]
        self.assertEqual([file["dotyk"].attrs["threads"] for file in files], [1, 2])
        self.check_equal(*files)

    def check_equal(self, one, two):
        """Every array of the results is the same to the bit, but for the times."""
        names = []
        one.visit(names.append)
        self.assertIn("VTKHDF/PointData/displacement", names)
        for name in names:
            if hasattr(one[name], "shape") and name != "dotyk/history/seconds":
                np.testing.assert_array_equal(one[name][:], two[name][:], err_msg=name)
        for name, value in one["dotyk/summary"].attrs.items():
            np.testing.assert_array_equal(value, two["dotyk/summary"].attrs[name], err_msg=name)


dotyk_case.main()
