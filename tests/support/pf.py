#!/usr/bin/env python3
"""The small test runner: turns pFUnit's .pf files into Fortran for the module `funit` of this folder.

usage: pf.py --driver NAME OUT.f90 A.pf B.pf ...   the main program that runs every test of the files
       pf.py A.pf OUT.f90                          one file; line numbers stay as they are
"""
import pathlib
import re
import sys

COMPARISONS = ("assertEqual", "assertGreaterThan", "assertLessThan")
ASSERTIONS = {name.lower(): name for name in COMPARISONS + ("assertTrue", "assertFalse")}


def arguments(text):
    """The arguments of a call, split at commas outside of brackets and strings; None where brackets or quotes do not match."""
    parts, depth, quote = [""], 0, ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
        elif c in "'\"":
            quote = c
        elif c in "([":
            depth += 1
        elif c in ")]":
            depth -= 1
        if depth < 0:
            return None
        if c == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += c
    return None if depth or quote else [part.strip() for part in parts]


def assertion(name, text, number, refuse):
    """The Fortran line of `@name(text)`."""
    parts = arguments(text)
    if parts is None or "" in parts:
        refuse(number, "the arguments of @%s do not parse" % name)
    n_values = 2 if name in COMPARISONS else 1
    if len(parts) < n_values:
        refuse(number, "@%s takes %d values" % (name, n_values))
    for part in parts[n_values:]:
        if not re.match(r"(tolerance|message)\s*=[^=]", part, re.I):
            refuse(number, "@%s understands tolerance= and message= after the values, not '%s'" % (name, part))
    if name in COMPARISONS:
        parts[:2] = ["funit_value(%s)" % part for part in parts[:2]]
    return "call %s(%s, line=%d); if (anyExceptions()) return" % (name, ", ".join(parts), number)


def translate(path):
    """The lines in Fortran, and the names of the tests, of the set-up and of the tear-down."""
    def refuse(number, message):
        sys.exit("%s:%d: %s" % (path, number, message))

    lines, tests, around, pending, disabled, module = [], [], {}, None, False, None
    for number, line in enumerate(path.read_text().splitlines(), 1):
        directive = re.match(r"(\s*)@(\w*)\s*(.*?)\s*$", line)
        procedure = re.match(r"\s*subroutine\s+(\w+)\s*(\(\s*\))?\s*(!.*)?$", line, re.I)
        begins = re.match(r"\s*module\s+(\w+)\s*$", line, re.I)
        if begins and not module:
            module = begins[1]
            if module != path.stem:
                refuse(number, "the module must be named '%s' as the file is" % path.stem)
        if directive:
            indent, name, rest = directive.groups()
            name = name.lower()
            if name == "disable" and pending == "test" and not rest:
                disabled = True
            elif pending:
                refuse(number, "a subroutine without arguments must follow @%s" % pending)
            elif name in ("test", "before", "after") and not rest:
                pending = name
                if name in around:
                    refuse(number, "a second @%s" % name)
            elif name in ASSERTIONS and rest.startswith("(") and rest.endswith(")"):
                line = indent + assertion(ASSERTIONS[name], rest[1:-1], number, refuse)
            else:
                refuse(number, "this runner does not understand '%s'" % line.strip())
            if pending:
                line = ""
        elif pending and procedure:
            if procedure[1].lower() == path.stem.lower():
                refuse(number, "a test must not bear the name of its module")
            if pending != "test":
                around[pending] = procedure[1]
            elif not disabled:
                tests.append(procedure[1])
            pending, disabled = None, False
        elif pending and line.strip() and not line.lstrip().startswith("!"):
            refuse(number, "a subroutine without arguments must follow @%s" % pending)
        lines.append(line)
    if not module or not tests or pending:
        refuse(max(1, len(lines)), "no module" if not module else "no test")
    return lines, tests, around


def driver(name, paths):
    """The main program."""
    uses, calls, n = [], [], 0
    for path in paths:
        _, tests, around = translate(path)
        for test in tests:
            n += 1
            steps = [around[step] if step != "test" else test for step in ("before", "test", "after") if step in ("test", *around)]
            uses += ["  use %s, only: t%d_%d => %s" % (path.stem, n, k, step) for k, step in enumerate(steps)]
            calls.append("  if (funit_begin('%s', '%s')) then" % (path, test))
            for k, step in enumerate(steps):
                # As in pFUnit: no test after a failed set-up; the tear-down comes in any case.
                guard = "if (.not. anyExceptions()) " if step == test and k else ""
                calls.append("    %scall t%d_%d()" % (guard, n, k))
            calls += ["    call funit_end()", "  end if"]
    uses.append("  use funit, only: funit_begin, funit_end, funit_close, anyExceptions")
    return ["program driver"] + uses + ["  implicit none"] + calls + ["  call funit_close('%s')" % name, "end program driver"]


def main(words):
    if len(words) >= 3 and words[0] == "--driver":
        out, lines = words[2], driver(words[1], [pathlib.Path(word) for word in words[3:]])
    elif len(words) == 2:
        out, lines = words[1], ['# 1 "%s"' % words[0]] + translate(pathlib.Path(words[0]))[0]
    else:
        sys.exit(__doc__)
    pathlib.Path(out).write_text("\n".join(lines) + "\n")


main(sys.argv[1:])
