#!/usr/bin/python3
"""Input that nobody expects: runs dotyk on mutated namelists, meshes and scenes, and holds every outcome against what
it promises.

    tests/fuzz/fuzz.py --dotyk build/asan/dotyk --seed 1 --cases 2000
    tests/fuzz/fuzz.py --dotyk build/asan/dotyk --seed 1 --case 1234      # one of them again, with what it prints

Promised: an exit code from 0 to 5; for 2 to 5 a message on the standard error, no results and no other file left, an
older results file as it was; for 0 and 1 results with finite numbers that say which; never a report of a sanitizer or
of gfortran's run-time library, a hang, or memory without bounds. A case is made from seed and number alone (and gmsh,
with --examples). Exit code 1 where there was a fault. What failed is kept, made small, with the command that repeats
it.
"""
import argparse
import collections
import pathlib
import random
import re
import sys

import fuzz_mesh_files
import fuzz_meshes
import fuzz_namelists
import fuzz_scenes
import fuzz_values
from fuzz_run import CASE, Case, Runner

KINDS = ["namelist", "mesh text", "mesh binary", "scene"]


def make_case(seed, number, kinds, with_examples):
    """A case from its seed and number."""
    kind = kinds[number % len(kinds)]
    rng = random.Random("%d %d %s" % (seed, number, kind))
    scene = fuzz_scenes.choose(rng, with_examples)
    scene.meshes = {name: mesh.copy() for name, mesh in scene.meshes.items()}
    version, binary = rng.choice(fuzz_scenes.FORMATS)
    n = rng.choice([1, 1, 1, 2, 3] if kind == "scene" else [1, 1, 1, 2, 3, 6])
    used = []

    def mutate(pool, thing):
        for _ in range(n):
            used.append(rng.choice(pool))
            thing = used[-1](rng, thing) if kind != "scene" else (used[-1](rng, thing), thing)[1]
        return thing

    if kind == "scene":
        mutate(fuzz_values.MUTATORS, scene)
    if kind.startswith("mesh"):
        binary = kind == "mesh binary"
    files = {name: fuzz_meshes.write(mesh, version, binary) for name, mesh in scene.meshes.items()}
    files[CASE] = scene.text.encode()
    if kind == "namelist":
        files[CASE] = mutate(fuzz_namelists.MUTATORS, files[CASE])
    elif kind.startswith("mesh"):
        pool = fuzz_mesh_files.BINARY_MUTATORS if binary else fuzz_mesh_files.TEXT_MUTATORS
        files["a.msh"] = mutate(pool, files["a.msh"])
    check = kind != "scene" and rng.random() < 0.5
    arguments = [CASE, "--threads", rng.choice("1112")] + ["--check"] * check + ["--quiet"] * (rng.random() < 0.2)
    return Case(number, kind, scene.name, [f.__name__ for f in used], arguments, files)


def reduce_case(runner, case, fault, most_runs=120):
    """Leave out lines, then pieces of lines, as long as the fault is the same."""
    runs = 0
    files = dict(case.files)
    for name in sorted(files, key=lambda file: file != CASE):
        if b"\x00" in files[name][:200]:
            continue  # binary
        for separator in (b"\n", b" "):
            parts = files[name].split(separator)
            size = max(1, len(parts) // 2)
            while size >= 1 and runs < most_runs:
                i = 0
                while i < len(parts) and runs < most_runs:
                    fewer = parts[:i] + parts[i + size:]
                    runs += 1
                    smaller = {**files, name: separator.join(fewer)}
                    if runner.run(case._replace(files=smaller)).fault == fault:
                        parts, files = fewer, smaller
                    else:
                        i += size
                size //= 2
    return case._replace(files=files)


def keep(folder, case, outcome, command):
    """Write a case that failed, with what it printed."""
    place = folder / re.sub(r"\W+", "-", outcome.fault)[:80] / ("case-%d" % case.number)
    place.mkdir(parents=True, exist_ok=True)
    for name, data in case.files.items():
        (place / name).write_bytes(data)
    (place / "fault.txt").write_text("%s\ndotyk %s\n%s\n%s\n%s\n" % (
        command, " ".join(case.arguments), " ".join(case.mutators), outcome.fault, outcome.detail))
    return place


def table(counts, faults):
    """Cases by mutator and exit code, and faults."""
    codes = [0, 1, 2, 3, 4, 5]
    lines = ["| what | cases | %s | faults |" % " | ".join("exit %d" % code for code in codes),
             "|---" * (len(codes) + 3) + "|"]
    for name in sorted(counts, key=lambda name: (name == "all", name)):
        count = counts[name]
        lines.append("| %s | %d | %s | %d |"
                     % (name, sum(count.values()), " | ".join(str(count[code]) for code in codes), count["fault"]))
    return "\n".join(lines + [""] + ["%6d  %s" % (len(numbers), fault) for fault, numbers in faults.most()])


class Faults(collections.OrderedDict):
    """Numbers of cases by fault."""

    def most(self):
        """The most frequent first."""
        return sorted(self.items(), key=lambda item: -len(item[1]))


def campaign(options, runner):
    """Run many cases; the number of faults."""
    counts, faults = collections.defaultdict(collections.Counter), Faults()
    slowest, largest, samples = (0, 0), (0, 0), {}
    folder = pathlib.Path(options.keep)
    for number in range(options.first, options.first + options.cases):
        try:
            case = make_case(options.seed, number, options.kinds, options.examples)
            outcome = runner.run(case)
        except KeyboardInterrupt:
            break
        result = "fault" if outcome.fault else outcome.code
        for name in {"%s: %s" % (case.kind, mutator) for mutator in case.mutators} | {"all", case.kind}:
            counts[name][result] += 1
        slowest, largest = max(slowest, (outcome.seconds, number)), max(largest, (outcome.megabytes, number))
        if outcome.code in (2, 3, 4, 5):
            samples.setdefault(random.Random(number).random(), (number, outcome.message))
        if not outcome.fault:
            continue
        numbers = faults.setdefault(outcome.fault, [])
        numbers.append(number)
        if len(numbers) <= 2:
            command = "tests/fuzz/fuzz.py --dotyk DOTYK --seed %d --case %d%s%s" % (
                options.seed, number, " --kinds '%s'" % ",".join(options.kinds) if options.kinds != KINDS else "",
                " --examples" * options.examples)
            small = reduce_case(runner, case, outcome.fault) if options.reduce and len(numbers) == 1 else case
            print("%s: %s\n    kept in %s" % (command, outcome.fault, keep(folder, small, outcome, command)),
                  flush=True)
    done = sum(counts["all"].values())
    print("\n%s\nseed %d, cases %d to %d\n" % (runner.version, options.seed, options.first, options.first + done - 1))
    print(table(counts, faults))
    print("slowest: %.2f s (case %d); largest: %.0f MB (case %d)" % (*slowest, *largest))
    for _, (number, message) in sorted(samples.items())[:options.messages]:
        print("--- case %d\n%s" % (number, message.rstrip()))
    return sum(map(len, faults.values()))


def replay(options, runner):
    """Run one case and show it."""
    case = make_case(options.seed, options.case, options.kinds, options.examples)
    place = pathlib.Path(options.keep)
    place.mkdir(parents=True, exist_ok=True)
    for name, data in case.files.items():
        (place / name).write_bytes(data)
    outcome = runner.run(case)
    print("%s of %s: %s\nfiles in %s: dotyk %s"
          % (case.kind, case.scene, " ".join(case.mutators), place, " ".join(case.arguments)))
    print("exit code %s, %.2f s, %.0f MB\n%s" % (outcome.code, outcome.seconds, outcome.megabytes, outcome.message))
    print("fault: " + (outcome.fault or "none"), outcome.detail if outcome.detail != outcome.message else "")
    return bool(outcome.fault)


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dotyk", required=True, help="the executable, of any build")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=1000, help="how many")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--case", type=int, help="run this one alone, and show it")
    parser.add_argument("--kinds", default=",".join(KINDS), type=lambda text: text.split(","),
                        help="of these: %(default)s")
    parser.add_argument("--examples", action="store_true", help="begin with the examples too, meshed coarsely by gmsh")
    parser.add_argument("--seconds", type=float, default=20, help="processor time of a run at most")
    parser.add_argument("--megabytes", type=int, default=1500, help="limit of a run")
    parser.add_argument("--keep", default="fuzz-faults", help="folder for what failed (%(default)s)")
    parser.add_argument("--reduce", action="store_true", help="make the first case of each fault small")
    parser.add_argument("--messages", type=int, default=0, help="print so many messages at random, to be read")
    options = parser.parse_args()
    if set(options.kinds) - set(KINDS):
        parser.error("kinds are: " + ", ".join(KINDS))
    runner = Runner(options.dotyk, options.seconds, options.megabytes)
    return 1 if (campaign(options, runner) if options.case is None else replay(options, runner)) else 0


if __name__ == "__main__":
    sys.exit(main())
