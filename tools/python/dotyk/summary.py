"""Prints what a results file says of the run: how it was made, how it converged, the contacts, the time.

examples: dotyk-summary hertz.vtkhdf                        all of a file
          dotyk-summary --csv contacts step_*.vtkhdf        one table of many files, comma-separated
"""
import argparse
import csv
import os
import sys

import numpy as np

from .results import Results

# Attributes that are printed first; the others follow in alphabetical order.
FIRST = ("status", "converged", "error_bound", "error_penalty", "error_discretization", "error_contact", "force",
         "max_penetration", "iterations", "scheme")


def text_of(value):
    """An attribute as text."""
    if isinstance(value, np.ndarray):
        return "  ".join(text_of(v) for v in value)
    return "%.6g" % value if isinstance(value, float) else str(value)


def print_attributes(title, record, without=()):
    """A title and a table of attributes."""
    attributes = record.attributes
    names = [name for name in FIRST if name in attributes]
    names += [name for name in attributes if name not in FIRST and name not in without]
    if not names:
        return
    print(title)
    for name in names:
        print("  %-26s %s" % (name, text_of(attributes[name])))


def cases_of(results):
    """Results of all load cases of a file, or of the file where it has none."""
    return [results.case(name) for name in results.cases] if len(results.cases) > 1 else [results]


def print_results(results):
    """Summary and contacts of a load case."""
    print_attributes("summary", results.summary)
    for name, pair in results.pairs.items():
        print_attributes("contact '%s'" % name, pair)
        for field in ("pressure", "pressure_projected", "gap"):
            values = pair.get(field, ())
            if len(values):
                print("  %-26s %.6g to %.6g in %d rows" % (field, values.min(), values.max(), len(values)))


def print_file(path, with_input):
    """All of one file."""
    with Results(path) as results:
        bodies = results.bodies.values()
        print("%s: %d bodies, %d nodes, %d elements" % (
            path, len(bodies), sum(body.n_nodes for body in bodies), sum(body.n_cells for body in bodies)))
        print_attributes("run", results.run, without=("input",))
        for case in cases_of(results):
            if results.cases:
                print("case '%s'" % case.case_name)
            print_results(case)
        print_attributes("seconds", results.timing)
        if with_input and "input" in results.run:
            print("input\n" + text_of(results.run["input"]))


def csv_rows(path, table, with_cases):
    """Column names and rows of one table of a file: contact pairs, or resultants of supports, loads, ties or bodies, or motions; with the load cases if
    wanted."""
    columns, rows = ["file", *["case"] * with_cases, "name"], []
    with Results(path) as whole:
        for results in cases_of(whole):
            if table == "contacts":
                names, sources = list(results.pairs), [pair.attributes for pair in results.pairs.values()]
            else:
                try:
                    record = results.record(table)
                except KeyError:
                    if table not in ("quantities", "ties", "rigid_bodies"):  # A scene without any has no such group.
                        raise
                    continue
                names = record.attributes.get("names", "").splitlines()
                arrays = {name: record[name] for name in record if name not in record.attributes}
                sources = [{name: array[i] for name, array in arrays.items()} for i in range(len(names))]
            for name, source in zip(names, sources):
                row = [path, *[results.case_name or ""] * with_cases, name]
                for key in sorted(source, key=lambda key: (key != "body", not key.endswith("force"), key)):
                    values = np.atleast_1d(source[key])
                    if len(columns) < len(row) + len(values):
                        columns += [key] if len(values) == 1 else [key + "_" + axis for axis in "xyz"]
                    row += ["%.12g" % (value + 0.0) for value in values]  # no -0
                rows.append(row)
    return columns, rows


def has_cases(path):
    """Whether a file has load cases."""
    with Results(path) as results:
        return bool(results.cases)


def print_csv(paths, table):
    """The table of all files, with one line of titles."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    titles, with_cases = None, any(has_cases(path) for path in paths)
    for path in paths:
        columns, rows = csv_rows(path, table, with_cases)
        if rows and titles is None:
            titles = columns
            writer.writerow(titles)
        writer.writerows(rows)


def main():
    """Parse and print; a reader that leaves early, such as head, is no error of which to speak."""
    try:
        print_all()
        sys.stdout.flush()
    except BrokenPipeError:
        # Nothing is left to be flushed at the exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def print_all():
    """Parse and print."""
    parser = argparse.ArgumentParser("dotyk-summary", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="RESULTS.vtkhdf", help="results files")
    parser.add_argument("--input", action="store_true", help="print the input text too")
    parser.add_argument("--csv", choices=("contacts", "quantities", "supports", "loads", "ties", "bodies", "rigid_bodies"),
                        help="print one table, comma-separated: forces, moments, areas, extremes, motions")
    options = parser.parse_args()
    if options.csv:
        try:
            return print_csv(options.files, options.csv)
        except BrokenPipeError:
            raise
        except (OSError, KeyError) as reason:
            sys.exit("dotyk-summary: not a results file: %s" % reason)
    for path in options.files:
        try:
            print_file(path, options.input)
        except BrokenPipeError:
            raise
        except (OSError, KeyError) as reason:
            sys.exit("dotyk-summary: '%s' is not a results file: %s" % (path, reason))


if __name__ == "__main__":
    sys.exit(main())
