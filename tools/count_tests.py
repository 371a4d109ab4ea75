#!/usr/bin/env python3
"""Counts the single tests of ctest's last run in a build folder: a table, then "N passed, N failed" as the last line.

usage: count_tests.py BUILD_FOLDER
       count_tests.py BUILD_FOLDER BUILD_FOLDER...      unit tests of several builds side by side

The second form compares the runners of the unit tests, such as pFUnit and the small runner: the exit code is 1 unless
every build passes as many tests of each executable as its .pf files have.

Understands the small runner of tests/support, pFUnit and Python's unittest. An entry that prints no count (a crash, a
timeout) or runs no test counts as one failed test.
"""
import pathlib
import re
import sys

# (tests run, failed) by a runner's closing words.
CLOSINGS = (
    (r"^\S+: (\d+) tests, (\d+) failed$", lambda m: (int(m[1]), int(m[2]))),
    (r"^ *OK\s+\((\d+) tests?[,)]", lambda m: (int(m[1]), 0)),
    (r"^ *Tests run: *(\d+), Failures: *(\d+), *Errors: *(\d+)", lambda m: (int(m[1]), int(m[2]) + int(m[3]))),
    (r"^Ran (\d+) tests? in .*\s+(OK|FAILED)(.*)",
     lambda m: (int(m[1]), sum(int(n) for n in re.findall(r"(?:failures|errors)=(\d+)", m[3])))),
)


def count(output, passed):
    """(passed, failed) of one entry of ctest."""
    for pattern, numbers in CLOSINGS:
        found = list(re.finditer(pattern, output, re.M))
        if found:
            run, failed = numbers(found[-1])
            break
    else:
        run, failed = 0, 0
    if failed == 0 and (run == 0 or not passed):
        failed = 1
    return max(0, run - failed), failed


def counts_of(build):
    """{name: (passed, failed)} of the entries of ctest's last run."""
    log = pathlib.Path(build) / "Testing" / "Temporary" / "LastTest.log"
    text = log.read_text(errors="replace") if log.exists() else ""
    entries = re.split(r"^\d+/\d+ Test: ", text, flags=re.M)[1:]
    return {entry.split("\n", 1)[0]: count(entry, re.search(r"^Test Passed\.$", entry, re.M)) for entry in sorted(entries)}


def written():
    """{name: tests} of the executables made of .pf files, by their directives; disabled tests do not count."""
    tests = pathlib.Path(__file__).resolve().parent.parent / "tests"
    folders = {"test_" + folder.name: folder for folder in (tests / "unit").iterdir()}
    folders["test_solver"] = tests / "solver"
    found = {}
    for name, folder in sorted(folders.items()):
        texts = [path.read_text() for path in folder.glob("*.pf")]
        if texts:
            found[name] = sum(len(re.findall(r"^\s*@test\b(?!\s*\n\s*@disable\b)", text, re.M | re.I)) for text in texts)
    return found


def compare(builds):
    """Unit tests of several builds side by side."""
    expected, counts = written(), [counts_of(build) for build in builds]
    print("%-20s %10s" % ("", "in files") + "".join("  %24s" % pathlib.Path(build).name for build in builds))
    right = True
    totals = [[0, 0] for _ in builds]
    for name, n in expected.items():
        line = "%-20s %10d" % (name, n)
        for total, found in zip(totals, counts):
            passed, failed = found.get(name, (0, 0))
            line += "  %24s" % ("%d passed, %d failed" % (passed, failed) if name in found else "not run")
            right = right and (passed, failed) == (n, 0)
            total[:] = total[0] + passed, total[1] + failed
        print(line)
    print("%-20s %10d" % ("all", sum(expected.values())) + "".join("  %24s" % ("%d passed, %d failed" % tuple(total)) for total in totals))
    return 0 if right else 1


def main(builds):
    if len(builds) > 1:
        return compare(builds)
    total_passed = total_failed = 0
    for name, (passed, failed) in counts_of(builds[0]).items():
        print("%-24s %5d passed, %d failed" % (name + ":", passed, failed))
        total_passed += passed
        total_failed += failed
    print("%d passed, %d failed" % (total_passed, total_failed))
    return 0 if total_passed > 0 and total_failed == 0 else 1


sys.exit(main(sys.argv[1:]) if len(sys.argv) > 1 and "--help" not in sys.argv else __doc__)
