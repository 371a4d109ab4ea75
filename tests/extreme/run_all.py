#!/usr/bin/python3
"""Extreme scenes, the whole grid: tests/extreme/run_all.py [NAME...] [--table FILE]      (all of them: three quarters
of an hour)

NAME is a module of tests/extreme, such as contrast, or a part of a scene's name. Prints a line for every scene: error,
what is allowed, bound, steps, time, and what is wrong; then a table of the modules. What a scene is and what is right:
the modules, and tests/support/extreme.py. Ends with 1 where anything is wrong.
"""
import argparse
import importlib.util
import os
import pathlib
import sys
import tempfile

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT/"tests"/"support"))
import extreme  # noqa: E402

HEAD = ("| %-58s | exit | %8s | %8s | %8s | %5s | %7s | wrong |"
        % ("scene", "error", "allowed", "bound", "steps", "seconds"))


def modules():
    """Name and module of every file of scenes."""
    for path in sorted(HERE.glob("*.py")):
        if path.name == pathlib.Path(__file__).name:
            continue
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        if hasattr(module, "scenes"):
            yield path.stem, module


def line(outcome):
    """A row of the table of scenes."""
    error, allowed, _ = outcome.worst() or (float("nan"), float("nan"), "")
    bound, steps = float("nan"), 0
    if outcome.answer:
        bound, steps = outcome.answer.bound, outcome.answer.summary["iterations"]
    return "| %-58s | %4s | %8.1e | %8.1e | %8.1e | %5d | %7.2f | %s |" % (
        outcome.scene.name, outcome.code, error, allowed, bound, steps, outcome.seconds, "; ".join(outcome.faults))


def summary(name, outcomes):
    """A row of the table of modules."""
    answers = [o for o in outcomes if o.code == 0]
    right = [o for o in outcomes if not o.faults]
    worst = max((row[0]/row[1] for o in answers for row in o.judged if row[1] > 0), default=float("nan"))
    bounds = max((error/allowed for o in answers for error, allowed, what in o.judged if "bound" in what
                  and allowed > 0),
                 default=float("nan"))
    return "| %s | %d | %d | %d | %.2g | %.2g | %d | %.3g |" % (
        name, len(outcomes), len(right), sum(o.code != 0 for o in outcomes), worst, bounds,
        max((o.answer.summary["iterations"] for o in outcomes if o.answer), default=0),
        sum(o.seconds for o in outcomes))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", nargs="*")
    parser.add_argument("--dotyk", default=os.environ.get("DOTYK", str(ROOT/"build"/"release"/"dotyk")))
    parser.add_argument("--table", help="write the tables to this file too")
    parser.add_argument("--timeout", type=float, default=600, help="seconds after which a scene is stopped")
    options = parser.parse_args()
    os.environ["DOTYK"] = os.path.abspath(options.dotyk)
    known, lines, rows, wrong = dict(modules()), [HEAD, "|---"*8 + "|"], [], 0
    print(lines[0])
    wanted = [n for n in options.name if n not in known]
    for name, module in known.items():
        if options.name and name not in options.name and not wanted:
            continue
        outcomes = []
        for scene in module.scenes(True):
            if options.name and name not in options.name and not any(word in scene.name for word in wanted):
                continue
            with tempfile.TemporaryDirectory(prefix="dotyk-") as folder:
                outcomes.append(extreme.run(scene, folder, options.timeout))
            lines.append(line(outcomes[-1]))
            print(lines[-1], flush=True)
        if outcomes:
            rows.append(summary(name, outcomes))
        wrong += sum(bool(o.faults) for o in outcomes)
    table = ["", "| module | scenes | right | of them refused | worst error over allowed | worst error over bound | "
             "most steps | seconds |",
             "|---|---|---|---|---|---|---|---|", *rows]
    print("\n".join(table))
    if options.table:
        pathlib.Path(options.table).write_text("\n".join(lines + table) + "\n")
    sys.exit(1 if wrong else 0)


main()
