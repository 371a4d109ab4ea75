#!/usr/bin/env python3
"""Prints what a results file says of the run: how it was made, how it converged, the contacts, the time.

usage: tools/summary.py FILE.vtkhdf ...      --input: the input text too
"""
import argparse
import os
import sys

try:
    import h5py
    import numpy as np
except ImportError:
    if not os.path.samefile(sys.executable, "/usr/bin/python3"):
        os.execv("/usr/bin/python3", ["/usr/bin/python3", "-B", os.path.abspath(__file__)] + sys.argv[1:])
    sys.exit("summary: h5py is missing (Debian: apt install python3-h5py)")

# Attributes that are printed first; the others follow in alphabetical order.
FIRST = ("status", "converged", "error_bound", "error_penalty", "error_discretization", "error_contact", "force",
         "max_penetration", "iterations", "scheme")


def text_of(value):
    """An attribute as text."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.ndarray):
        return "  ".join(text_of(v) for v in value)
    return "%.6g" % value if isinstance(value, np.floating) else str(value)


def print_attributes(title, node, without=()):
    """A title and a table of attributes."""
    names = [name for name in FIRST if name in node.attrs]
    names += [name for name in node.attrs if name not in FIRST and name not in without]
    if not names:
        return
    print(title)
    for name in names:
        print("  %-26s %s" % (name, text_of(node.attrs[name])))


def print_file(path, with_input):
    """All of one file."""
    with h5py.File(path, "r") as file:
        grid, own = file["VTKHDF"], file["dotyk"]
        print("%s: %d bodies, %d nodes, %d elements" % (
            path, len(grid["NumberOfPoints"]), grid["Points"].shape[0], grid["Types"].shape[0]))
        print_attributes("run", own, without=("input",))
        print_attributes("summary", own["summary"])
        for name, contact in own["contact"].items():
            print_attributes("contact '%s'" % name, contact)
            for field in ("pressure", "pressure_projected", "gap"):
                if field in contact and len(contact[field]):
                    values = contact[field][:]
                    print("  %-26s %.6g to %.6g in %d rows" % (field, values.min(), values.max(), len(values)))
        print_attributes("seconds", own["timing"])
        if with_input and "input" in own.attrs:
            print("input\n" + text_of(own.attrs["input"]))


def main():
    """Parse and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="FILE")
    parser.add_argument("--input", action="store_true", help="print the input text too")
    options = parser.parse_args()
    for path in options.files:
        try:
            print_file(path, options.input)
        except (OSError, KeyError) as reason:
            sys.exit("summary: '%s' is not a results file: %s" % (path, reason))


main()
