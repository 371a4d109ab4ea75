#!/usr/bin/env python3
"""Scenes of tests/support/assembly_scenes.py against their right answers, as a table.

    studies/assemblies.py                        all scenes with build/release/dotyk
    studies/assemblies.py --dotyk EXE NAME...    scenes whose names contain one of the words
    studies/assemblies.py --turned 3             each turned by three random rotations as well
    studies/assemblies.py --save FILE            keep the numbers; --before FILE: a column of them
    studies/assemblies.py --keep FOLDER          inputs, meshes, logs and results stay in new folders of FOLDER
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/support"))
import assembly  # noqa: E402
import assembly_scenes  # noqa: E402


def number(value):
    """Text of a value."""
    return value if isinstance(value, str) else "%.4g" % value


def measured(scene, seed, dotyk):
    """Rows of a scene as lists, with whether each is right."""
    try:
        return [[*row, bool(abs(row.value - row.right) <= row.allowed)] for row in scene(seed, dotyk)]
    except assembly_scenes.Failed as failure:
        return [["answer", str(failure), "one", 0.0, False]]
    except subprocess.TimeoutExpired:
        return [["answer", "none after 120 s", "one", 0.0, False]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", default=os.environ.get("DOTYK", str(ROOT / "build/release/dotyk")))
    parser.add_argument("--turned", type=int, default=0)
    parser.add_argument("--save")
    parser.add_argument("--before")
    parser.add_argument("--keep")
    parser.add_argument("names", nargs="*")
    options = parser.parse_args()
    assembly.KEEP += [options.keep] if options.keep else []
    before = json.loads(pathlib.Path(options.before).read_text()) if options.before else {}
    found, wrong = {}, 0
    print("| scene | what | right |%s now |  |\n|---|---|---:|%s---:|---|" % (" before |" if before else "",
                                                                        "---:|" if before else ""))
    for section, name, scene in assembly_scenes.SCENES:
        if options.names and not any(word in section + ": " + name for word in options.names):
            continue
        begun, seen = time.monotonic(), set()
        for seed in range(options.turned + 1):
            rows = measured(scene, seed, options.dotyk)
            found[name + " (turned %d)" % seed * (seed > 0)] = rows
            for what, value, right, _, good in rows:
                if seed and good or (what, number(value)) in seen:
                    continue
                seen.add((what, number(value)))
                old = {row[0]: row[1] for row in before.get(name, [])}
                cells = [name + ", turned" * (seed > 0), what, number(right)]
                cells += [number(old.get(what, old.get("answer", "")))] if before else []
                print("| " + " | ".join(cells + [number(value), "" if good else "wrong"]) + " |", flush=True)
                wrong += not good
        if sys.stderr.isatty():
            print("%5.1f s %s" % (time.monotonic() - begun, name), file=sys.stderr)
    if options.save:
        pathlib.Path(options.save).write_text(json.dumps(found, indent=1) + "\n")
    print("%d of %d numbers are wrong" % (wrong, sum(map(len, found.values()))), file=sys.stderr)


main()
