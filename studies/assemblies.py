#!/usr/bin/env python3
"""Scenes of tests/support/assembly_scenes.py against their right answers, as a table.

    studies/assemblies.py                        all scenes with build/release/dotyk
    studies/assemblies.py --dotyk EXE WORD...    scenes whose section and name contain one of the words
    studies/assemblies.py --turned 3             each turned by three random rotations as well
    studies/assemblies.py --short                one line for each scene, what is farthest from right
    studies/assemblies.py --keep FOLDER          inputs, meshes, logs and results stay in new folders of FOLDER
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/support"))
import assembly  # noqa: E402
import assembly_rows  # noqa: E402
import assembly_scenes  # noqa: E402


def measured(scene, seed, dotyk):
    """Rows of a scene: [what, value, right, allowed, whether it is right]."""
    try:
        return [[*row, bool(abs(row.value - row.right) <= row.allowed)] for row in scene(seed, dotyk)]
    except assembly_rows.Failed as failure:
        return [["answer", str(failure), 0.0, 0.0, False]]
    except subprocess.TimeoutExpired:
        return [["answer", "none after 120 s", 0.0, 0.0, False]]


def words(value, short):
    """Text of a value."""
    if isinstance(value, str):
        return re.sub(r"exit (\d).*", r"none, exit \1", value) if short else value
    return "%.4g" % (round(value, 12) + 0.0)


def farthest(rows):
    """The row that is farthest from right."""
    def distance(value, row):
        return 1e300 if isinstance(value, str) else abs(value - row[2]) / (row[3] or 1.0)

    return max([row for row in rows if not row[4]] or rows, key=lambda row: distance(row[1], row))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", default=os.environ.get("DOTYK", str(ROOT / "build/release/dotyk")))
    parser.add_argument("--turned", type=int, default=0)
    parser.add_argument("--keep")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    assembly.KEEP += [options.keep] if options.keep else []
    count, wrong = 0, 0
    print("| scene | what | right | found | |\n|---|---|---:|---:|---|")
    for section, name, scene in assembly_scenes.SCENES:
        if options.names and not any(word in section + ": " + name for word in options.names):
            continue
        seen = set()
        for seed in range(options.turned + 1):
            rows = measured(scene, seed, options.dotyk)
            count += len(rows)
            wrong += sum(not row[4] for row in rows)
            if options.short:
                rows = [farthest(rows)] if seed == 0 else []
            for what, value, right, _, good in rows:
                if seed and good or (what, words(value, options.short)) in seen:
                    continue
                seen.add((what, words(value, options.short)))
                cells = [name + ", turned" * (seed > 0), what, words(right, True), words(value, options.short),
                         "" if good else "wrong"]
                print("| " + " | ".join(cells) + " |", flush=True)
    print("%d of %d numbers are wrong" % (wrong, count), file=sys.stderr)


main()
