#!/usr/bin/python3
"""Bounds of iterates that are far from done: each scheme stopped at loose tolerances, against the answer at 1e-12.

The scene is that of units.py, blocks of stone or of wood so many times as stiff.
"""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import extreme  # noqa: E402
from extreme import Scene  # noqa: E402
from units import Variant, vector  # noqa: E402

SCHEMES = ("neumann", "robin", "dual")
ANSWERS = {}


def scenes(grid):
    """Scheme by contrast by tolerance."""
    for contrast in ("1e-6", "1e-2", "1", "1e2", "1e6") if grid else ("1", "1e6"):
        for scheme in SCHEMES:
            for tolerance in ("3e-1", "1e-1", "1e-2", "1e-4", "1e-7") if grid else ("1e-1", "1e-4"):
                yield loose(contrast, scheme, tolerance)


def loose(contrast, scheme, tolerance):
    """The scene with one scheme, stopped early."""
    variant = Variant("", theta="theta=0.05")
    # only ever stiffer, so that loads and theta keep their meaning
    stone, wood = max(1.0, float(contrast)), max(1.0, 1/float(contrast))

    def text(solver):
        changed = variant.text().replace("young=100.0,", "young=%r," % (100*stone)).replace("tolerance=1e-12", solver)
        changed = changed.replace("young=" + vector((200, 60, 40)), "young=" + vector(wood*np.array([200, 60, 40])))
        changed = changed.replace("shear=" + vector((30, 25, 20)), "shear=" + vector(wood*np.array([30, 25, 20])))
        if (stone, wood) != (1, 1) and changed == variant.text().replace("tolerance=1e-12", solver):
            raise ValueError("the scene of units.py has other materials")
        return changed

    def check(answer):
        if contrast not in ANSWERS:
            ANSWERS[contrast] = extreme.solved(Scene("reference", text("tolerance=1e-12"), variant.write))
        right = ANSWERS[contrast]
        yield answer.bound, float(tolerance), "bound"
        yield answer.energy_error(right.displacement), answer.bound + 1e-11, "energy norm against the bound"

    return Scene("contrast %s, %s, tolerance %s" % (contrast, scheme, tolerance),
                 text("scheme='%s', tolerance=%s" % (scheme, tolerance)), variant.write, check)


extreme.main(scenes) if __name__ == "__main__" else None
