"""The examples on ranks: results files field by field against those of one rank of the program without MPI, or of the same program.

DOTYK_SERIAL names the program without MPI (build/release/dotyk where it is newer than the sources; without it one rank is the reference),
DOTYK_RANK_NUMBERS the numbers of ranks ("2 3"; "1 2 3 4" for all), DOTYK_EXAMPLES the examples, such as "hertz/fine wavy"; `all` has the
slow one, too.
"""
import os
import re
import subprocess

import h5py
import numpy as np

import dotyk_case
from mpi_case import ENVIRONMENT, RankCase

SERIAL = os.environ.get("DOTYK_SERIAL", "")
RANKS = [int(word) for word in os.environ.get("DOTYK_RANK_NUMBERS", "2 3").split()]
SLOW = ("ball_bearing/ball_bearing",)
# Differs from run to run.
OF_THE_RUN = re.compile("timing|seconds|memory|threads|ranks|host|date|time|version|command|bytes|path|flops|file|restart|started|elapsed")
# Several of them say the same: their values, but not how they were come by, are compared.
OF_THE_WAY = re.compile("iterations|history|solves|products|n_|factor|condition|residual|bound|error|convergence|gamma|penetration")


def program_without_mpi():
    """The one that DOTYK_SERIAL names, or that of the release build unless a source is newer; or an empty text."""
    if SERIAL:
        return SERIAL
    built = dotyk_case.ROOT / "build" / "release" / "dotyk"
    newest = max(path.stat().st_mtime for path in (dotyk_case.ROOT / "src").rglob("*.*"))
    return str(built) if os.access(built, os.X_OK) and built.stat().st_mtime > newest else ""


def differences(expected, found, tolerance):
    """Texts: what is in one file only, and fields and attributes that differ by more than the tolerance of the run."""
    texts = []

    def compare(name, a, b):
        if OF_THE_RUN.search(name) or OF_THE_WAY.search(name):
            return
        a, b = np.asarray(a), np.asarray(b)
        if a.shape != b.shape:
            texts.append("%s: shape %s, not %s" % (name, b.shape, a.shape))
        elif a.dtype.kind in "iubSO" or a.size == 0:
            if not np.array_equal(a, b):
                texts.append("%s: %s values differ" % (name, np.sum(a != b)))
        else:
            unknown = np.isnan(a)
            if not np.array_equal(unknown, np.isnan(b)):
                texts.append("%s: unknown in one" % name)
                return
            a, b = a[~unknown], b[~unknown]
            if a.size:
                scale, worst = np.max(np.abs(a)), np.max(np.abs(a - b))
                allowed = (tolerance[0] if "pressure" not in name else tolerance[1]) * scale
                if not worst <= max(allowed, 1e-14):
                    texts.append("%s: differs by %.1e of %.1e" % (name, worst, scale))

    names = {file: {} for file in (expected, found)}
    for file, items in names.items():
        file.visititems(lambda name, item, items=items: items.__setitem__(name, item))
    for name in sorted(set(names[expected]) ^ set(names[found])):
        if not OF_THE_RUN.search(name) and not OF_THE_WAY.search(name):
            texts.append("%s: in one file only" % name)
    for name in sorted(set(names[expected]) & set(names[found])):
        a, b = names[expected][name], names[found][name]
        if isinstance(a, h5py.Dataset):
            compare(name, a[()], b[()])
        for key in set(a.attrs) & set(b.attrs):
            compare(name + "@" + key, a.attrs[key], b.attrs[key])
    return texts


class Examples(RankCase):
    def compare(self, example):
        folder, case = example.split("/")
        target = self.copy(folder)
        namelist = target / (case + ".nml")
        found = re.search(r"[^_]tolerance=([^ ,/]+)", namelist.read_text())
        tolerance = float(found[1].lower().replace("d", "e")) if found else 1e-6
        # In the energy norm; single pressures depend on displacements by the stiffness of the mesh.
        tolerance = (10 * max(tolerance, 1e-10), 1e3 * max(tolerance, 1e-10))
        reference = target / "reference.vtkhdf"
        if program_without_mpi():
            done = subprocess.run([program_without_mpi(), str(namelist), "--output", str(reference), "--quiet"], env=ENVIRONMENT, capture_output=True, text=True,
                                  check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
        else:
            self.run_ranks(1, namelist, "--output", reference, "--quiet", seconds=600)
        for ranks in RANKS:
            output = target / ("%d.vtkhdf" % ranks)
            self.run_ranks(ranks, namelist, "--output", output, "--quiet", seconds=600)
            with h5py.File(reference, "r") as expected, h5py.File(output, "r") as results:
                texts = differences(expected, results, tolerance)
            self.assertEqual(texts, [], "%s on %d ranks:\n%s" % (example, ranks, "\n".join(texts[:30])))


def add_tests():
    """A test for each example."""
    wanted = os.environ.get("DOTYK_EXAMPLES", "").split()
    for path in sorted(dotyk_case.INPUTS.glob("*/*.nml")):
        example = "%s/%s" % (path.parent.name, path.stem)
        if wanted and "all" not in wanted and example not in wanted and path.parent.name not in wanted:
            continue
        if not wanted and example in SLOW:
            continue
        setattr(Examples, "test_" + re.sub(r"\W", "_", example), lambda self, example=example: self.compare(example))


add_tests()

if __name__ == "__main__":
    dotyk_case.main()
