#!/usr/bin/env python3
"""Counts the single tests of ctest's last run in a build folder: a table, then "N passed, N failed" as the last line.

usage: count_tests.py BUILD_FOLDER

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


def main(build):
    log = pathlib.Path(build) / "Testing" / "Temporary" / "LastTest.log"
    text = log.read_text(errors="replace") if log.exists() else ""
    entries = re.split(r"^\d+/\d+ Test: ", text, flags=re.M)[1:]
    total_passed = total_failed = 0
    for entry in sorted(entries):
        name = entry.split("\n", 1)[0]
        passed, failed = count(entry, re.search(r"^Test Passed\.$", entry, re.M))
        print("%-24s %5d passed, %d failed" % (name + ":", passed, failed))
        total_passed += passed
        total_failed += failed
    print("%d passed, %d failed" % (total_passed, total_failed))
    return 0 if total_passed > 0 and total_failed == 0 else 1


sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else __doc__)
