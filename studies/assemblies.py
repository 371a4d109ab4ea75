#!/usr/bin/env python3
"""Scenes of tests/support/assembly_scenes.py against their right answers, as a table.

    studies/assemblies.py                        all scenes with build/release/dotyk
    studies/assemblies.py --dotyk EXE WORD...    scenes whose section and name contain one of the words
    studies/assemblies.py --turned 3             each turned by three random rotations as well
    studies/assemblies.py --save FILE            keep the numbers; --before FILE: a column of them
    studies/assemblies.py --short                one line for each scene, what is or was farthest from right
    studies/assemblies.py --keep FOLDER          inputs, meshes, logs and results stay in new folders of FOLDER
"""
import argparse
import json
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


def farthest(rows, old):
    """The row that is farthest from right, or was where all are right."""
    def distance(value, row):
        return 1e300 if isinstance(value, str) else abs(value - row[2]) / (row[3] or 1.0)

    wrong = [row for row in rows if not row[4]]
    if wrong:
        return max(wrong, key=lambda row: distance(row[1], row))
    return max(rows, key=lambda row: distance(old.get(row[0], row[1]), row))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", default=os.environ.get("DOTYK", str(ROOT / "build/release/dotyk")))
    parser.add_argument("--turned", type=int, default=0)
    parser.add_argument("--save")
    parser.add_argument("--before")
    parser.add_argument("--keep")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    assembly.KEEP += [options.keep] if options.keep else []
    before = json.loads(pathlib.Path(options.before).read_text()) if options.before else {}
    found, wrong = {}, 0
    print("| scene | what | right |%s now | |\n|---|---|---:|%s---:|---|" % (" before |" if before else "",
                                                                       "---:|" if before else ""))
    for section, name, scene in assembly_scenes.SCENES:
        if options.names and not any(word in section + ": " + name for word in options.names):
            continue
        old, seen = {row[0]: row[1] for row in before.get(name, [])}, set()
        for seed in range(options.turned + 1):
            rows = found[name + " (turned %d)" % seed * (seed > 0)] = measured(scene, seed, options.dotyk)
            wrong += sum(not row[4] for row in rows)
            if options.short:
                rows = [farthest(rows, old)] if seed == 0 else []
            for what, value, right, _, good in rows:
                if seed and good or (what, words(value, options.short)) in seen:
                    continue
                seen.add((what, words(value, options.short)))
                cells = [name + ", turned" * (seed > 0), what, words(right, True)]
                cells += [words(old.get(what, old.get("answer", "")), options.short)] if before else []
                cells += [words(value, options.short), "" if good else "wrong"]
                print("| " + " | ".join(cells) + " |", flush=True)
    if options.save:
        pathlib.Path(options.save).write_text(json.dumps(found, indent=1) + "\n")
    print("%d of %d numbers are wrong" % (wrong, sum(map(len, found.values()))), file=sys.stderr)


main()
