"""Extreme scenes: what one is, how it is run, and how its answer is judged. Used by tests/extreme and by
tests/extreme/run_all.py.

A module of scenes has a function `scenes(grid)`: the scenes that run in seconds, with grid=True all. Its last line is
`extreme.main(scenes)`, which makes a test of each.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2]/"tools"))
from energy_norm import Results, energy_norm  # noqa: E402
import dotyk  # noqa: E402


# Distances below this are not judged: they are a few units of the last digit.
LEAST = 4e-15


class Scene:
    """A scene, and what is right.

    write(folder) writes its meshes, and the input where text is None. check(answer) gives pairs (error, allowed, what
    of). Where code is not 0 the scene must be refused with this code (one of these codes, where rounding decides) and a
    message that all of `message` (regular expressions) are found in. moduli: young and poisson of each body for the
    energy norm, where the input has a formula.
    """

    def __init__(self, name, text, write, check=None, code=0, message=(), moduli=None):
        self.name, self.text, self.write, self.check, self.moduli = name, text, write, check, moduli or {}
        self.codes = code if isinstance(code, tuple) else (code,)
        self.message = [message] if isinstance(message, str) else message


class Answer:
    """A results file: attributes of the summary, displacement, pairs; and the log."""

    def __init__(self, path, moduli, log):
        self.path, self.log, self.results = path, log, Results(path, **moduli)
        self.displacement, self.points = self.results.displacement, self.results.points
        with dotyk.Results(path) as file:
            self.summary, self.lost = file.summary.attributes, max(file.summary["digits_lost"])
            self.seconds, self.broken = file.timing["total"], []
            self.pairs = {name: {**pair, **pair.attributes} for name, pair in file.pairs.items()}
            self.stress = file["stress"] if "stress" in file else None
            file.file.visititems(self.look)
        self.bound = self.summary["error_bound"]

    def look(self, name, entry):
        """Remember arrays that have something which is not a number, but for errors that are said to be unknown."""
        if not hasattr(entry, "dtype") or entry.dtype.kind != "f" or name.startswith("dotyk/history"):
            return
        if name.endswith("/discretization_error") and np.isnan(self.summary["error_discretization"]):
            return
        values = entry[()]
        if name.endswith("/contact_gap"):
            # Where there is no constraint there is no gap.
            values = values[entry.parent["contact_status"][()] > 0]
        if not np.all(np.isfinite(values)):
            self.broken.append(name)

    def node_bodies(self):
        """Number of the body (from 0) of each node."""
        body = np.zeros(len(self.points), int)
        for block in self.results.blocks:
            body[block.nodes] = block.body - 1
        return body

    def centres(self):
        """Means of the nodes of every element, in the order of the file."""
        centre = np.empty((sum(len(block.nodes) for block in self.results.blocks), 3))
        for block in self.results.blocks:
            centre[block.cells] = self.points[block.nodes].mean(axis=1)
        return centre

    def energy_error(self, exact):
        """Energy norm of the displacement's distance to another one on its mesh, over that of the other."""
        norm = energy_norm(self.results, exact)
        return energy_norm(self.results, self.displacement - exact)/norm if norm > 0 else energy_norm(self.results)

    def rounding(self):
        """What the last digit of the displacements is worth in the energy norm, relative: no answer in doubles is
        better."""
        norm = energy_norm(self.results)
        signs = np.random.default_rng(1).choice([-1.0, 1.0], self.displacement.shape)
        return energy_norm(self.results, signs*np.spacing(np.abs(self.displacement)))/norm if norm > 0 else 0.0

    def reported(self):
        """The bound; an exact displacement to compare with is rounded, too."""
        return max(self.bound + self.rounding(), LEAST)

    def pressure_error(self, exact):
        """Largest distance of the pressures to a constant, over it where it is not zero."""
        return max(np.abs(pair["pressure"] - exact).max() for pair in self.pairs.values())/(abs(exact) or 1)


class Outcome:
    """What came of a scene."""

    def __init__(self, scene, code, text, seconds, answer, judged, faults):
        self.scene, self.code, self.text, self.seconds = scene, code, text, seconds
        self.answer, self.judged, self.faults = answer, judged, faults

    def worst(self):
        """(error, allowed, what) of the check that is nearest to failing."""
        return max(self.judged, key=lambda row: row[0]/row[1] if row[1] > 0 else np.inf*row[0] if row[0] else 0,
                   default=None)


def run(scene, folder, timeout=600, threads=2):
    """Run a scene in a folder; what is wrong is in the outcome's `faults`."""
    folder = pathlib.Path(folder)
    scene.write(folder)
    if scene.text is not None:
        (folder/"scene.nml").write_text(scene.text)
    results = folder/"scene.vtkhdf"
    results.unlink(missing_ok=True)
    begun, faults, answer, judged = time.monotonic(), [], None, []
    try:
        done = subprocess.run([os.environ["DOTYK"], "scene.nml", "--verbose", "--threads", str(threads)], cwd=folder, text=True,
                              timeout=timeout, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT)
        code, text = done.returncode, done.stdout
    except subprocess.TimeoutExpired:
        code, text = None, ""
        faults.append("stopped after %g s" % timeout)
    seconds = time.monotonic() - begun
    if code is not None and code not in scene.codes:
        faults.append("exit code %d, not %s" % (code, " or ".join(map(str, scene.codes))))
    if code not in scene.codes[:-1]:
        faults += ["no message like %r" % pattern for pattern in scene.message if not re.search(pattern, text)]
    if results.exists() != (code in (0, 1)):
        faults.append("results file " + ("left behind" if results.exists() else "missing"))
    if "NaN" in text or "Infinity" in text:
        faults.append("a number that is none in the log")
    if results.exists() and code in (0, 1):
        answer = Answer(results, scene.moduli, text)
        faults += ["%s has numbers that are none" % name for name in answer.broken]
        if not np.isfinite(answer.bound):
            faults.append("bound %g" % answer.bound)
        if scene.check:
            judged = [(float(error), float(allowed), what) for error, allowed, what in scene.check(answer)]
            faults += ["%s: error %.2e, allowed %.2e" % (what, error, allowed) for error, allowed, what in judged
                       if not error <= allowed]
    return Outcome(scene, code, text, seconds, answer, judged, faults)


def solved(scene):
    """The answer of a scene that others are compared with."""
    with tempfile.TemporaryDirectory(prefix="dotyk-") as folder:
        outcome = run(scene, folder)
    if outcome.faults:
        raise ValueError("%s: %s\n%s" % (scene.name, outcome.faults, outcome.text))
    return outcome.answer


def main(scenes):
    """Test the quick scenes of a module; what they are called is what the tests are called."""
    class Extreme(unittest.TestCase):
        """One test for each scene."""

    def test(scene):
        def run_it(self):
            with tempfile.TemporaryDirectory(prefix="dotyk-") as folder:
                outcome = run(scene, folder)
            self.assertEqual(outcome.faults, [], "%s\n%s" % (scene.name, outcome.text))
        return run_it

    for scene in scenes(False):
        name = "test_" + re.sub(r"\W+", "_", scene.name.replace("-", " minus "))
        assert not hasattr(Extreme, name), name
        setattr(Extreme, name, test(scene))
    suite = unittest.defaultTestLoader.loadTestsFromTestCase(Extreme)
    result = unittest.TextTestRunner(verbosity=2).run(suite)
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
