#!/usr/bin/env python3
"""Random scenes, and the same turned, mirrored, and in another order: the answer must be the same.

    tools/invariance.py DOTYK            100 scenes with the program DOTYK
    tools/invariance.py DOTYK 200:300    others

Prints those that differ by more than 1e-9, and the greatest difference. Exit code 1 if there are any.
"""
import os
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests/support"))
import moved_scenes  # noqa: E402

os.environ["DOTYK"] = str(pathlib.Path(sys.argv[1]).resolve())
SEEDS = range(*map(int, (sys.argv[2] if len(sys.argv) > 2 else "0:100").split(":")))
WORST, WRONG = dict.fromkeys(moved_scenes.MOTIONS, 0.0), 0
for seed in SEEDS:
    scene = moved_scenes.Scene(seed)
    with tempfile.TemporaryDirectory() as folder:
        found = scene.differences(folder)
    for motion, difference in found.items():
        WORST[motion] = max(WORST[motion], difference)
        if difference > 1e-9:
            WRONG += 1
            print("%4d  %-10s %8.1e  %s" % (seed, motion, difference, scene), flush=True)
print("%d scenes: %d of %d differ; greatest: %s" % (len(SEEDS), WRONG, len(SEEDS) * len(WORST), ", ".join(
    "%s %.1e" % item for item in WORST.items())))
sys.exit(WRONG > 0)
