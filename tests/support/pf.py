#!/usr/bin/env python3
"""The small test runner: turns the .pf files of pFUnit into Fortran for the module `funit` of this folder.

usage: pf.py A.pf OUT.f90                          one file; line numbers stay as they are
       pf.py --driver NAME OUT.f90 A.pf B.pf ...   the main program that runs every test of the files
"""
import pathlib
import re
import sys


# The assertions that are understood: names in pFUnit, how many values each takes, and its arguments after them.
ASSERTIONS = {"assertTrue": (1, "message"), "assertFalse": (1, "message"), "assertEqual": (2, "tolerance|message"),
              "assertLessThan": (2, "message"), "assertLessThanOrEqual": (2, "message"),
              "assertGreaterThan": (2, "message"), "assertGreaterThanOrEqual": (2, "message")}


def arguments(text):
    """The arguments of a call, split at commas outside of brackets and strings; none where brackets or quotes do not
    match."""
    parts, depth, quote = [""], 0, ""
    for c in text:
        if c in "'\"" and quote in ("", c):
            quote = "" if quote else c
        elif not quote:
            depth += (c in "([") - (c in ")]")
        if c == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += c
        if depth < 0:
            return []
    return [] if depth or quote else [part.strip() for part in parts]


def assertion(name, text, refuse):
    """The Fortran call of `@name(text)`, left open for the line number."""
    n_values, keywords = ASSERTIONS[name]
    parts = arguments(text)
    if len(parts) < n_values or "" in parts:
        refuse("the arguments of @%s do not parse" % name)
    for part in parts[n_values:]:
        if not re.match(r"(%s)\s*=[^=]" % keywords, part, re.I):
            refuse("after the values, @%s takes %s=, not '%s'" % (name, keywords.replace("|", "= and "), part))
    values, procedure = ["funit_value(%s)" % part for part in parts[:n_values]], name
    if n_values == 1:
        expected = name[len("assert"):].lower()
        values = ["funit_value('%s')" % expected, "funit_value(merge('true ', 'false', %s))" % parts[0]]
        procedure = "assertEqual"
    return "call %s(%s" % (procedure, ", ".join(values + parts[n_values:]))


def translate(path):
    """The lines in Fortran, the names of the tests, and those of the set-up and the tear-down."""
    def refuse(message):
        sys.exit("%s:%d: %s" % (path, number, message))

    known = {name.lower(): name for name in ASSERTIONS}
    lines, tests, around, pending, disabled, module, number = [], [], {}, None, False, None, 1
    for number, line in enumerate(path.read_text().splitlines(), 1):
        directive = re.match(r"(\s*)@(\w*)\s*(.*?)\s*$", line)
        procedure = re.match(r"\s*subroutine\s+(\w+)\s*(\(\s*\))?\s*(!.*)?$", line, re.I)
        module = module or re.match(r"\s*module\s+(\w+)\s*$", line, re.I)
        if line.startswith("#"):
            refuse("the small runner has no preprocessor: '%s'" % line.strip())
        elif pending and not procedure and not re.match(r"\s*(@disable\s*|!.*)?$", line, re.I):
            refuse("a subroutine without arguments must follow @%s" % pending)
        elif directive:
            name, rest = directive[2].lower(), directive[3]
            if name == "disable" and pending == "test":
                disabled, line = True, ""
            elif name in ("test", "before", "after") and not rest and name not in around:
                pending, line = name, ""
            elif name in known and re.match(r"\(.*\)$", rest):
                call = assertion(known[name], rest[1:-1], refuse)
                line = "%s%s, line=%d); if (anyExceptions()) return" % (directive[1], call, number)
            else:
                refuse("the small runner does not understand '%s'" % line.strip())
        elif pending and procedure:
            if pending != "test":
                around[pending] = procedure[1]
            elif not disabled:
                tests.append(procedure[1])
            pending, disabled = None, False
        lines.append(line)
    if not module or module[1] != path.stem or path.stem in tests or not tests or pending:
        refuse("there must be a module named as the file is, and at least one test, named otherwise")
    return lines, tests, around


def driver(name, paths):
    """The main program. As in pFUnit: no test after a failed set-up; the tear-down comes in any case."""
    uses, calls = ["  use funit, only: funit_begin, funit_end, funit_close, anyExceptions"], []
    for n, path in enumerate(paths):
        _, tests, around = translate(path)
        alias = {p: "p%d_%d" % (n, k) for k, p in enumerate([*around.values(), *tests])}
        uses += ["  use %s, only: %s => %s" % (path.stem, alias[p], p) for p in alias]
        before, after = (["    call %s()" % alias[around[k]]] if k in around else [] for k in ("before", "after"))
        for test in tests:
            calls += ["  if (funit_begin('%s', '%s')) then" % (path, test), *before]
            calls += ["    if (.not. anyExceptions()) call %s()" % alias[test], *after]
            calls += ["    call funit_end()", "  end if"]
    return ["program driver", *uses, "  implicit none", *calls, "  call funit_close('%s')" % name, "end program driver"]


words = sys.argv[1:]
if len(words) > 3 and words[0] == "--driver":
    out, result = words[2], driver(words[1], [pathlib.Path(word) for word in words[3:]])
elif len(words) == 2:
    out, result = words[1], ['# 1 "%s"' % words[0]] + translate(pathlib.Path(words[0]))[0]
else:
    sys.exit(__doc__)
pathlib.Path(out).write_text("\n".join(result) + "\n")
