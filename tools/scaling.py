#!/usr/bin/env python3
"""Predicts time and memory of p-multigrid on many machines from counts measured on this one (docs/scaling.md).

usage: tools/scaling.py [options]                      tables of a machine, weak and strong scaling
       tools/scaling.py --unknowns 1e9 --nodes 100     one run, part by part
       tools/scaling.py --test                         the model against its own runs, 25 % allowed; exit code 1 beyond
       tools/scaling.py --search LOG...                search_seconds and search_repeated from logs of dotyk of one scene, on one and more ranks
       tools/scaling.py --write                        docs/scaling.md (tables) and docs/scaling.png

The model. n unknowns on N nodes with r ranks each, p = N r. A part of a run is work (seconds of a core for each unknown), traffic (bytes for
each unknown through the memory of a node) and exchange. Beside a part of m unknowns lie ghosts: s F(p) (m/3)^(2/3) nodes in layers, where
F(p) = 6 (1 - p^(-1/3)) faces are those of p cubes in a cube. An exchange costs neighbours*latency + bytes/(bandwidth of the network/r), a
reduction 2 log2(p) latency. Level 0 is the mesh, level 1 its corners (n/8), each further one smaller by `coarsening`. What has the size of
the contact surfaces, c n^(2/3) rows, is on every rank; their factor is on one rank of each node, which factorizes and solves. The search for
contact and the check for penetration are divided but for a part that every rank repeats, and their results gathered on every rank.
"""
import argparse
import json
import math
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
COUNTS = ROOT / "benchmarks" / "scaling.json"
PARTS = ("read", "contact search", "assembly", "set-up", "set-up, network", "iterations", "iterations, network", "contact rows", "estimates",
         "results")
EQUATIONS = 3
REAL = 8


# The model

def ranks_of(machine, nodes):
    return nodes * machine["ranks_per_node"]


def faces(p):
    """Faces that p equal cubes of a cube share with others, by cube."""
    return 6 * (1 - p ** (-1 / 3))


def ghost_nodes(unknowns, p, layers):
    """Nodes of others beside the part of one rank."""
    part = unknowns / EQUATIONS / p
    return min(layers * faces(p) * part ** (2 / 3), unknowns / EQUATIONS - part) if p > 1 else 0.0


def levels(unknowns, counts):
    """Unknowns of the levels from the mesh down."""
    sizes = [unknowns, unknowns / counts["corner_ratio"]]
    while sizes[-1] > counts["coarsest"]:
        sizes.append(sizes[-1] / counts["coarsening"])
    return sizes


def exchange_time(unknowns, p, counts, machine):
    """An exchange of one vector with all neighbours."""
    if p == 1:
        return 0.0
    neighbours = min(p - 1, counts["neighbours"])
    size = REAL * EQUATIONS * ghost_nodes(unknowns, p, counts["ghost_layers"])
    return neighbours * machine["latency"] + size * machine["ranks_per_node"] / machine["network"]


def reduction_time(p, machine, size=0.0):
    """A sum over all ranks of so many bytes, known to all: in the memory of each node, then among nodes."""
    if p == 1:
        return 0.0
    inside = 2 * size * machine["ranks_per_node"] / machine["bandwidth"]
    among = 2 * size / machine["network"] if p > machine["ranks_per_node"] else 0.0
    return 2 * math.ceil(math.log2(p)) * machine["latency"] + inside + among


def gather_time(p, machine, size):
    """So many bytes of all ranks together, known to all: among nodes once, then through the memory of each node to every rank."""
    if p == 1:
        return 0.0
    inside = 2 * size * machine["ranks_per_node"] / machine["bandwidth"]
    among = size / machine["network"] if p > machine["ranks_per_node"] else 0.0
    return math.ceil(math.log2(p)) * machine["latency"] + inside + among


def search_time(rows, p, counts, machine):
    """Search for contact and check for penetration: what every rank repeats, its part of the rest, and the parts of the others."""
    alone = counts["search_seconds"] * rows / machine["core_speed"]
    if p == 1 or not counts["search_is_shared"]:
        return alone
    repeated = counts["search_repeated"]
    return alone * (repeated + (1 - repeated) / p) + gather_time(p, machine, counts["row_exchange"] * rows)


def memory_bandwidth(machine, nodes):
    """Of all nodes; few ranks do not use up that of a node."""
    return nodes * min(machine["bandwidth"], machine["ranks_per_node"] * machine["bandwidth_of_rank"])


def contact_rows(unknowns, counts):
    return counts["rows"] * unknowns ** (2 / 3)


def row_factor_bytes(rows, counts):
    """Factor of the active rows: nested dissection of a surface mesh, (31/4) n log2(n) entries of a five-point one (George 1973)."""
    return counts["factor_entries"] * rows * max(1.0, math.log2(max(2.0, rows))) * REAL


def row_solve_time(rows, counts, machine):
    """A solve with the factor, which is read forth and back, by the ranks of a node that share it, and telling all of them."""
    bandwidth = min(machine["bandwidth"], counts["row_solvers"] * machine["bandwidth_of_rank"])
    told = 2 * REAL * rows * machine["ranks_per_node"] / machine["bandwidth"] if machine["ranks_per_node"] > 1 else 0.0
    return 2 * row_factor_bytes(rows, counts) / bandwidth + told


def predict(unknowns, nodes, machine, counts):
    """Seconds of each part of a run and bytes: of a rank, of a node."""
    p = ranks_of(machine, nodes)
    speed = p * machine["core_speed"] / counts["imbalance"]
    bandwidth = memory_bandwidth(machine, nodes) / counts["imbalance"]
    files = machine["file_system"]
    if nodes == 1:
        files = min(files, machine["network"])
    sizes = levels(unknowns, counts)
    rows = contact_rows(unknowns, counts)
    on_levels = sum(exchange_time(size, p, counts, machine) for size in sizes)
    reduction = reduction_time(p, machine)
    setup_levels = len(sizes) - 1
    iterations, setups = counts["iterations"], counts["setups"]
    active = rows * counts["active"]
    factors = setups * counts["row_setup_seconds"] * active / machine["core_speed"] / counts["row_solvers"]
    seconds = {
        "read": counts["mesh_bytes"] * unknowns / files,
        "contact search": search_time(rows, p, counts, machine),
        "assembly": counts["assembly_seconds"] * unknowns / speed,
        "set-up": setups * counts["setup_seconds"] * unknowns / speed,
        "set-up, network": setups * (setup_levels * counts["setup_reductions"] * reduction + counts["setup_exchanges"] *
                                     sum(exchange_time(size, p, counts, machine) for size in sizes[1:])),
        "iterations": iterations * counts["cycle_bytes"] * unknowns / bandwidth,
        "iterations, network": iterations * (counts["exchanges"] * on_levels + counts["reductions"] * reduction),
        "contact rows": factors + iterations * (counts["row_solves"] * row_solve_time(active, counts, machine) +
                                                counts["row_sums"] * reduction_time(p, machine, REAL * rows)),
        "estimates": counts["estimate_seconds"] * unknowns / speed,
        "results": counts["result_bytes"] * unknowns / files,
    }
    own = counts["memory_bytes"] * unknowns / p * counts["imbalance"] * (counts["memory_of_many"] if p > 1 else 1)
    ghosts = counts["ghost_bytes"] * ghost_nodes(unknowns, p, counts["ghost_layers"])
    factor = row_factor_bytes(active, counts) if rows else 0.0
    of_rank = counts["memory_of_rank"] + own + ghosts + counts["row_bytes"] * rows
    node_bytes = of_rank * machine["ranks_per_node"] + factor
    return {"seconds": seconds, "total": sum(seconds.values()), "rank_bytes": of_rank + factor, "node_bytes": node_bytes,
            "ranks": p, "rows": rows, "levels": len(sizes)}


# Counts

def load(path):
    """Machines, constants and runs; constants are [value, unit, source]."""
    data = json.loads(path.read_text())
    data["counts"] = {name: entry[0] for name, entry in data["constants"].items()}
    return data


def this_machine(data, ranks):
    """The machine of the runs, with so many ranks on its one node."""
    return {**data["machines"]["measured"], "ranks_per_node": ranks}


def calibrate(data, runs):
    """Counts with what one run on one rank, the smallest, tells."""
    counts = dict(data["counts"])
    run = min((run for run in runs if run["ranks"] == 1), key=lambda run: run["unknowns"])
    machine, seconds = this_machine(data, 1), run["seconds"]
    n = run["unknowns"]
    counts.update(iterations=run["iterations"], setups=run["setups"], imbalance=1.0, rows=run.get("rows", 0) / n ** (2 / 3))
    if "assembly" in seconds:
        counts["assembly_seconds"] = seconds["assembly"] / n
    counts["setup_seconds"] = seconds["setup"] / n / max(1, run["setups"])
    counts["cycle_bytes"] = seconds["solve"] / n / run["iterations"] * memory_bandwidth(machine, 1)
    if run.get("rank_bytes"):
        counts["memory_bytes"] = run["rank_bytes"] / n
    return counts, run


def predict_run(data, counts, run):
    """What the model says of a measured run with its iterations and set-ups: seconds by the names of the run, and bytes of a rank beyond
    those of an idle one."""
    counts = {**counts, "iterations": run["iterations"], "setups": run["setups"]}
    found = predict(run["unknowns"], 1, this_machine(data, run["ranks"]), counts)
    s = found["seconds"]
    seconds = {"assembly": s["assembly"], "setup": s["set-up"] + s["set-up, network"],
               "solve": s["iterations"] + s["iterations, network"] + s["contact rows"]}
    return {name: seconds[name] for name in run["seconds"]}, found["rank_bytes"] - counts["memory_of_rank"]


def self_test(data, allowed=0.25):
    """Lines of a table: each series of runs, calibrated by its smallest on one rank, against all its others; whether all are within."""
    lines = ["| run | ranks | unknowns | iterations, set-ups | seconds | predicted | | memory of a rank | predicted | |", "|---|" + "---:|" * 9]
    good = True
    for series, runs in data["runs"].items():
        counts, base = calibrate(data, runs)
        for run in runs:
            if run is base:
                continue
            seconds, size = predict_run(data, counts, run)
            total, expected = sum(run["seconds"].values()), sum(seconds.values())
            ratios = [expected / total]
            row = [series, str(run["ranks"]), count(run["unknowns"]), "%d, %d" % (run["iterations"], run["setups"])]
            row += ["%.1f" % total, "%.1f" % expected, "%+.0f %%" % (100 * ratios[0] - 100)]
            if run.get("rank_bytes"):
                ratios.append(size / run["rank_bytes"])
                row += [memory(run["rank_bytes"]), memory(size), "%+.0f %%" % (100 * ratios[1] - 100)]
            else:
                row += ["", "", ""]
            lines.append("| %s |" % " | ".join(row))
            good = good and all(abs(ratio - 1) <= allowed for ratio in ratios)
    return lines, good


# Measuring

def read_search(text):
    """Ranks, rows, and processor seconds of the search and the check for penetration, from the log of a run."""
    ranks = re.search(r"(\d+) ranks of", text)
    line = re.search(r"processor time .*", text)
    if not line:
        sys.exit("scaling: the log has no line 'processor time': run with --verbose")
    units = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
    seconds = 0.0
    for stage in ("search", "check penetration"):
        number, unit = re.search(r", %s ([\d.E+-]+) (\w+)" % stage, line.group(0)).groups()
        seconds += float(number) * units[unit]
    table = text.split("\n  contact pair ", 1)[1].split("\n\n", 1)[0]
    rows = sum(int(found) for found in re.findall(r"^  \S.*?\s(\d+)\s+[\d.]+ %", table, re.M))
    return int(ranks.group(1)) if ranks else 1, rows, seconds


def search_constants(logs):
    """Seconds of a row on one rank, and the part that each run on more ranks repeats, exchanges included."""
    runs = sorted(read_search(text) for text in logs)
    if runs[0][0] != 1:
        sys.exit("scaling: none of the logs is of one rank")
    _, rows, alone = runs[0]
    return alone / rows, [(p, (p * seconds / alone - 1) / (p - 1)) for p, _, seconds in runs if p > 1]


# Tables and figure

def count(x):
    """1e6 as 1 million."""
    for limit, word in ((1e9, " billion"), (1e6, " million")):
        if x >= limit:
            return "%.3g%s" % (x / limit, word)
    return "%.0f" % x


def memory(size):
    return "%.3g GB" % (size / 1e9) if size >= 1e9 else "%.0f MB" % (size / 1e6)


def duration(seconds):
    return "%.0f s" % seconds if seconds >= 10 else "%.2g s" % seconds


def one_run(unknowns, nodes, machine, counts):
    """Lines: each part of one run."""
    found = predict(unknowns, nodes, machine, counts)
    lines = ["| part | seconds |", "|---|---:|"] + ["| %s | %s |" % (part, duration(found["seconds"][part])) for part in PARTS]
    form = "%s unknowns, %d ranks on %d nodes, %d levels, %s contact rows; %s in a rank, %s in a node."
    values = (count(unknowns), found["ranks"], nodes, found["levels"], count(found["rows"]), memory(found["rank_bytes"]),
              memory(found["node_bytes"]))
    return lines + ["| **all** | **%s** |" % duration(found["total"]), "", form % values]


def strong(sizes, nodes, machine, counts):
    """Lines: seconds and memory of a node by unknowns and nodes; a dash where a node's memory does not suffice."""
    lines = ["| nodes | %s |" % " | ".join("%s unknowns" % count(n) for n in sizes), "|---:|" + "---:|" * len(sizes)]
    for k in nodes:
        runs = [predict(n, k, machine, counts) for n in sizes]
        lines.append("| %d | %s |" % (k, " | ".join("%s, %s" % (duration(run["total"]), memory(run["node_bytes"]))
                                                     if run["node_bytes"] <= machine["memory"] else "–" for run in runs)))
    return lines


def weak(of_node, nodes, machine, counts):
    """Lines: the same unknowns on each node."""
    lines = ["| nodes | unknowns | seconds | search, contact rows | network | memory of a node | efficiency |", "|" + "---:|" * 7]
    base = predict(of_node, 1, machine, counts)["total"]
    for k in nodes:
        run = predict(of_node * k, k, machine, counts)
        s = run["seconds"]
        lines.append("| %d | %s | %s | %s | %s | %s | %.0f %% |" % (
            k, count(of_node * k), duration(run["total"]), duration(s["contact search"] + s["contact rows"]),
            duration(s["set-up, network"] + s["iterations, network"]),
            memory(run["node_bytes"]) + (", more than it has" if run["node_bytes"] > machine["memory"] else ""), 100 * base / run["total"]))
    return lines


SIZES, NODES, OF_NODE = (1e7, 1e8, 1e9), (1, 3, 10, 30, 100, 300, 1000), 1e7


def figure(path, machine, counts):
    """Strong scaling, and the parts of weak scaling, with the contact on every rank and shared."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, axes = plt.subplots(1, 3, figsize=(14, 4), constrained_layout=True)
    for n, colour in zip(SIZES, ("C0", "C1", "C2")):
        for chosen, style in ((counts, "o-"), (shared(counts), "o--")):
            fits = [(k, run["total"]) for k in NODES for run in [predict(n, k, machine, chosen)] if run["node_bytes"] <= machine["memory"]]
            axes[0].loglog(*zip(*fits), style, color=colour, label="%s unknowns" % count(n) if chosen is counts else None)
    axes[0].set(xlabel="nodes", ylabel="seconds", title="strong; dashed: contact shared")
    axes[0].legend()
    for axis, chosen, title in ((axes[1], counts, "contact on every rank"), (axes[2], shared(counts), "contact shared")):
        below = [0.0] * len(NODES)
        for part in PARTS:
            top = [a + predict(OF_NODE * k, k, machine, chosen)["seconds"][part] for a, k in zip(below, NODES)]
            axis.fill_between(NODES, below, top, label=part)
            below = top
        axis.set(xscale="log", xlabel="nodes", title="weak, %s on each; %s" % (count(OF_NODE), title))
    axes[1].legend(fontsize=7, loc="upper left")
    fig.savefig(path, dpi=100)


def shared(counts):
    """Counts of a program whose ranks share the whole search, and those of a node the row factor."""
    return {**counts, "search_is_shared": 1, "search_repeated": 0, "row_solvers": 64}


def blocks(data, machine, counts):
    """The tables of docs/scaling.md by their marks."""
    return {"test": self_test(data)[0], "strong": strong(SIZES, NODES, machine, counts), "weak": weak(OF_NODE, NODES, machine, counts),
            "weak, shared": weak(OF_NODE, NODES, machine, shared(counts)), "one": one_run(1e9, 100, machine, counts)}


def write(data, machine, counts):
    page = ROOT / "docs" / "scaling.md"
    text = page.read_text()
    for name, lines in blocks(data, machine, counts).items():
        mark = "<!-- %s -->" % name
        if text.count(mark) != 2:
            sys.exit("scaling: %s has not two marks %s" % (page, mark))
        before, _, after = text.split(mark)
        text = before + mark + "\n" + "\n".join(lines) + "\n" + mark + after
    page.write_text(text)
    figure(ROOT / "docs" / "scaling.png", machine, counts)


def main():
    parser = argparse.ArgumentParser(prog="scaling.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=pathlib.Path, default=COUNTS, help="file of counts (benchmarks/scaling.json)")
    parser.add_argument("--machine", default="cluster", help="a machine of this file (cluster)")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="other properties of the machine, or other counts")
    parser.add_argument("--unknowns", type=float)
    parser.add_argument("--nodes", type=int, default=1)
    parser.add_argument("--test", action="store_true")
    parser.add_argument("--search", nargs="+", type=pathlib.Path, metavar="LOG")
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    if args.search:
        of_row, repeated = search_constants([path.read_text() for path in args.search])
        print("search_seconds %.2g" % of_row)
        print("\n".join("search_repeated %.2f on %d ranks" % (part, p) for p, part in repeated))
        return 0
    data = load(args.counts)
    machine, counts = dict(data["machines"][args.machine]), dict(data["counts"])
    for pair in args.set:
        name, value = pair.split("=")
        owner = machine if name in machine else counts
        if name not in owner:
            parser.error("no property or count '%s': %s" % (name, ", ".join([*machine, *counts])))
        owner[name] = float(value)
    if args.test:
        lines, good = self_test(data)
        print("\n".join(lines))
        return 0 if good else 1
    if args.write:
        return write(data, machine, counts)
    if args.unknowns:
        print("\n".join(one_run(args.unknowns, args.nodes, machine, counts)))
    else:
        print("\n".join(["Strong", ""] + strong(SIZES, NODES, machine, counts) + ["", "Weak", ""] + weak(OF_NODE, NODES, machine, counts)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
