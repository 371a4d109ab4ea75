#!/usr/bin/env python3
"""Random assemblies: every run must balance, without penetration, or say why not.

    tools/assembly_campaign.py OUT                     500 assemblies, pairs named by hand, into the folder OUT
    tools/assembly_campaign.py OUT --auto              pairs that find themselves
    tools/assembly_campaign.py OUT --loose             parts in clearance holes, on pins, that spin, roll or slide
    tools/assembly_campaign.py OUT --geometry          coarse sectors, slices, curved facets, bevels, corners, flush fits, ...
    tools/assembly_campaign.py OUT --seeds 100:200     some of them; what OUT/*.jsonl has already is not run again
    tools/assembly_campaign.py OUT --keep 17           one, with its files in OUT/17
    tools/assembly_campaign.py OUT --report            the table only

A run is silent where it ends with exit code 0 and forces or moments do not balance, bodies penetrate by more than a
part of their displacement, or a body moves by its size. Exit code 1 if one is silent or ends with a signal.
"""
import argparse
import collections
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/support"))
import numpy as np  # noqa: E402
import check_assembly as check  # noqa: E402
import geometry_assembly  # noqa: E402
import loose_assembly  # noqa: E402
import random_assembly  # noqa: E402

BALANCE = 1e-4  # largest resultant that does not balance, relative to the forces
DEEP = 0.35     # largest penetration relative to displacements and interference


def read_mesh(path):
    """Nodes and tetrahedra of a mesh file."""
    lines = path.read_text().split("\n")
    start = lines.index("$Nodes")
    x = np.array([line.split()[1:] for line in lines[start + 2:lines.index("$EndNodes")]], float)
    numbers = {line.split()[0]: k for k, line in enumerate(lines[start + 2:lines.index("$EndNodes")])}
    cells = [line.split() for line in lines[lines.index("$Elements") + 2:lines.index("$EndElements")]]
    cells = np.array([[numbers[n] for n in words[5:9]] for words in cells if words[1] in ("4", "11")])
    return check.Body(x, np.zeros_like(x), cells)


class Overlaps:
    """Whether a part overlaps the parts placed before."""

    def __init__(self, folder):
        self.folder = folder

    def body(self, part):
        """The part's mesh, in its place."""
        body = read_mesh(part.solid.mesh(self.folder))
        body.x = body.x @ part.turn.T + part.at
        return body

    def __call__(self, part, parts, allowed):
        body = self.body(part)
        return any(check.depth(body, self.body(other)) > allowed + 1e-6 for other in parts)


def judge(assembly, path, log=""):
    """What is wrong with results, or None; numbers."""
    bodies, pairs, _ = check.read(path)
    faults, numbers, held = balance(assembly, bodies, pairs, stated_imbalance(log))
    move = max(np.abs(body.u).max() for body in bodies)
    size = max(part.solid.size for part in assembly.parts)
    numbers["move"] = float(move / size)
    before = {(i, j): check.depth(bodies[i], bodies[j], 0.0) for i in range(len(bodies)) for j in range(i)}
    faults += rows_through(assembly, bodies, pairs, before)
    far = [k for k, body in enumerate(bodies)
           if np.linalg.norm(body.u, axis=1).max() > 0.5 * np.linalg.norm(np.ptp(body.x, axis=0))]
    for k in far:
        words = "part %d moves by more than half its size" % (k + 1)
        (held if "large motion     'part %d' moves" % (k + 1) in log else faults).append(words)
    if not far:
        found, numbers["depth"], told = penetrations(assembly, bodies, before, stated_depths(assembly, log))
        faults += found
        held += told
    return "; ".join(faults) or None, numbers, "; ".join(held)


def balance(assembly, bodies, pairs, stated):
    """Faults of the forces and moments; numbers; what the log states of it."""
    faults, told, contact, scale = [], [], [], 0.0
    move = max(np.abs(body.u).max() for body in bodies)
    for body, part in zip(bodies, assembly.parts):
        external = body.weight(part.density) if part.density is not None else np.zeros_like(body.x)
        if part.load:
            external += body.pressure(face_nodes(body, part, part.load[0]), part.load[1])
        rest = body.internal(part.young, part.poisson) - external
        held = face_nodes(body, part, part.support[0]) if part.support else np.zeros(len(body.x), bool)
        inner = np.ones(len(body.x), bool)
        inner[body.facets] = False
        force = rest.copy()
        force[held] = 0
        contact.append((body, held, force, np.abs(rest).sum(), np.abs(rest[inner & ~held]).max(initial=0.0)))
        scale = max(scale, np.abs(rest).sum())
    # forces of rounding, where nothing touches
    floor = (1e-9 * max(part.young * part.solid.size for part in assembly.parts) * max(move, 1e-6))
    scale = max(scale, floor)
    given = [np.zeros(3) for _ in bodies]
    blind, group = [False] * len(bodies), list(range(len(bodies)))
    for name, pair in pairs.items():
        i, j = sides_of(assembly, name)
        given[i] += pair.force
        given[j] -= pair.force
        for side, sign in ((i, 1), (j, -1)):
            blind[side] |= hidden(*contact[side][:2], pair.position, sign * pair.normal, assembly.parts[i].solid.length)
        if len(pair.position):
            group = [group[i] if k == group[j] else k for k in group]
    for k, (body, held, force, own, inner) in enumerate(contact):
        if inner > BALANCE * max(own, floor):
            # weak springs and held spins act on all nodes
            words = "part %d: force %.1e of %.1e inside" % (k + 1, inner, own)
            (told if inner <= (stated + BALANCE) * max(own, floor) else faults).append(words)
        off = np.abs(force.sum(axis=0) - given[k]).max()
        if off > BALANCE * scale and not blind[k]:
            words = "part %d: contact force off by %.1e of %.1e" % (k + 1, off, scale)
            (told if off <= (stated + BALANCE) * scale else faults).append(words)
    numbers = {"blind": any(blind), "balance": 0.0, "moment": 0.0}
    for one in set(group):
        members = [k for k in range(len(bodies)) if group[k] == one]
        if any(blind[k] for k in members):
            continue
        whole = sum((contact[k][2].sum(axis=0) for k in members), np.zeros(3))
        middle = np.mean(np.concatenate([bodies[k].x for k in members]), axis=0)
        moments = sum((np.cross(bodies[k].x - middle, contact[k][2]).sum(axis=0) for k in members), np.zeros(3))
        force, moment = (float(np.abs(v).max() / scale) for v in (whole, moments / size_of(assembly)))
        numbers["balance"], numbers["moment"] = max(numbers["balance"], force), max(numbers["moment"], moment)
        if max(force, moment) <= BALANCE:
            continue
        words = "action is not reaction: force %.1e, moment %.1e" % (force, moment)
        allowed = len(members) * stated + BALANCE
        (told if max(force, moment) <= allowed else faults).append(words)
    return faults, numbers, told


def size_of(assembly):
    """Length by which moments are divided."""
    return max(1.0, *(part.solid.size for part in assembly.parts))


def rows_through(assembly, bodies, pairs, before):
    """Active rows whose gap before deformation is deeper than the interference, facets of round parts included."""
    faults = []
    for name, pair in pairs.items():
        i, j = sides_of(assembly, name)
        round_off = sum(sagitta(assembly.parts[k], bodies[k]) for k in (i, j))
        # points of the samples may miss the overlap of crossed edges
        given = max([before[max(i, j), min(i, j)]] + [-assembly.parts[k].shift for k in (i, j)])
        limit = given + round_off + 1e-6 * size_of(assembly)
        if len(pair.gap) and pair.gap.min() < -limit:
            faults.append("%s: active row %.1e inside, bodies %.1e" % (name, -pair.gap.min(), limit))
    return faults


def sagitta(part, body):
    """Greatest distance of the facets of a round part from the round surface."""
    radius = getattr(part.solid, "radius", None)
    if radius is None:
        return 0.0
    body = check.Body(body.x, body.u, body.cells[:, :4])
    x = (body.x - part.at) @ part.turn
    axial = np.zeros(len(body.facets))
    if part.solid.kind != "ball":
        axial = (body.normals() / np.linalg.norm(body.normals(), axis=1)[:, None] @ part.turn)[:, 2]
        x = x[:, :2]
    on = np.abs(np.linalg.norm(x, axis=1) - radius) < 1e-6
    facets = body.facets[on[body.facets].all(axis=1) & (np.abs(axial) < 0.5)]
    middle = np.concatenate([x[facets].mean(axis=1)] + [x[facets[:, [k, k - 1]]].mean(axis=1) for k in range(3)])
    return float((radius - np.linalg.norm(middle, axis=1)).max(initial=0.0))


def penetrations(assembly, bodies, before, stated):
    """Faults of bodies in each other; the greatest depth relative to what they move; what the log states of it."""
    faults, told, most = [], [], 0.0
    for (i, j), first in before.items():
        after = check.depth(bodies[i], bodies[j])
        share = max(np.abs(bodies[i].u).max(), np.abs(bodies[j].u).max()) + first
        curved = sum(sagitta(assembly.parts[k], bodies[k]) for k in (i, j)) if first > 1e-9 else 0.0
        part = max(0.0, after - curved) / share if share else 0.0
        most = max(most, float(part))
        if part <= DEEP:
            continue
        words = "parts %d and %d penetrate by %.2e, %.0f %% of what they move" % (j + 1, i + 1, after, 100 * part)
        (told if stated.get((j + 1, i + 1), 0.0) >= 0.5 * after else faults).append(words)
    return faults, most, told


def stated_imbalance(log):
    """Forces along motions that contact does not determine, which the log states last, relative to those on the body."""
    found = re.findall(r"least motion taken; ([-\d.eE+]+) % of the loads rest on it", log)
    return float(found[-1]) / 100 if found else 0.0


def stated_depths(assembly, log):
    """Depths that the log states {(number, number): depth}: in warnings, or by the uncertainty of gaps."""
    found = {}
    for line in log.splitlines():
        words = re.search(r"warning +'part (\d+)' is inside 'part (\d+)' by ([-\d.eE+]+)", line)
        if words:
            pair = tuple(sorted((int(words[1]), int(words[2]))))
            found[pair] = max(found.get(pair, 0.0), float(words[3]))
        words = re.search(r"gaps of '(.+)' are known to .* normal displacements uncertain by ([-\d.eE+]+)", line)
        if words:
            pair = tuple(sorted(k + 1 for k in sides_of(assembly, words[1])))
            found[pair] = max(found.get(pair, 0.0), float(words[2]))
    return found


def hidden(body, held, points, outward, reach):
    """Whether rows at points may act on held nodes: on facets that look along the row and are within its reach."""
    some = held[body.facets].any(axis=1)
    facets, looks = body.x[body.facets[some]], body.normals()[some]
    looks = looks / np.linalg.norm(looks, axis=1)[:, None]
    for point, direction in zip(points, outward):
        facing = facets[looks @ direction > 0.2]
        if len(facing) and check.distance(point[None], facing)[0] < reach:
            return True
    return False


def face_nodes(body, part, face):
    """Nodes on a planar face of a part, or on the grip of one."""
    normal, point = next((n, p) for name, n, p in part.solid.faces if name == face.replace("grip", "face"))
    nodes = body.on_plane(part.turn @ point + part.at, part.turn @ normal)
    if face.startswith("grip"):
        x, polygon = (body.x - part.at) @ part.turn, part.solid.polygon / 2
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0)):
            nodes &= (b[0] - a[0]) * (x[:, 1] - a[1]) - (b[1] - a[1]) * (x[:, 0] - a[0]) > -1e-9
    return nodes


def sides_of(assembly, name):
    """Numbers of the bodies of a pair."""
    found = re.findall(r"part (\d+)", name)
    if len(found) >= 2:
        return int(found[0]) - 1, int(found[1]) - 1
    found = re.fullmatch(r"pair (\d+)", name)
    return assembly.pairs[int(found[1]) - 1][:2] if found else None


def reason(text):
    """The kind of message that a run ended with."""
    for kind in ("not converged: .*", "not valid: .*", "no equilibrium", "none of the", "scene.nml:.*", "[Ee]rror.*"):
        found = re.search(kind, text)
        if found:
            return re.sub(r"[-+]?\d[\d.e+-]*", "#", found[0])[:70]
    return (text.strip().splitlines() or ["nothing"])[-1][:70]


def run(seed, out, options):
    """Run a seed; its entry of the list."""
    meshes = out / "meshes"
    meshes.mkdir(parents=True, exist_ok=True)
    overlaps = Overlaps(meshes)
    kind = loose_assembly.Loose if options.loose else random_assembly.Assembly
    kind = geometry_assembly.Geometry if options.geometry else kind
    assembly = kind(seed, overlaps, options.auto)
    with tempfile.TemporaryDirectory(prefix="dotyk-") as temporary:
        folder = pathlib.Path(temporary)
        if options.keep is not None:
            folder = out / str(seed)
            folder.mkdir(exist_ok=True)
        files = [part.solid.mesh(meshes).resolve() for part in assembly.parts]
        (folder / "scene.nml").write_text(assembly.text(files))
        begun = time.monotonic()
        try:
            done = subprocess.run([options.dotyk, "scene.nml", "--threads", "1"], cwd=folder, text=True, timeout=60,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
            code, log = done.returncode, done.stdout
        except subprocess.TimeoutExpired:
            code, log = None, "stopped after 60 s"
        seconds = time.monotonic() - begun
        (folder / "scene.log").write_text(log)
        entry = {"seed": seed, "bodies": len(assembly.parts), "kinds": [part.solid.kind for part in assembly.parts],
                 "notes": [part.note for part in assembly.parts[1:]], "forgotten": assembly.forgotten >= 0,
                 "code": code, "seconds": round(seconds, 2), "numbers": {}, "reason": ""}
        if code == 0:
            fault, numbers, told = assembly.fault(folder / "scene.vtkhdf", log)
            if assembly.balanced:
                found, more, held = judge(assembly, folder / "scene.vtkhdf", log)
                told = "; ".join(filter(None, [told, held]))
                fault, numbers = "; ".join(filter(None, [fault, found])) or None, {**numbers, **more}
            entry["numbers"] = numbers
            entry["outcome"], entry["reason"] = ("silent", fault) if fault else (
                "says why not", "warning: " + re.sub(r"\d[\d.e+-]*", "#", told)) if told else ("balances", "")
        elif code in (1, 2, 3):
            entry["outcome"], entry["reason"] = "says why not", "exit %d: %s" % (code, reason(log))
        else:
            entry["outcome"], entry["reason"] = "crash", "exit %s: %s" % (code, reason(log))
    return entry


def report(entries):
    """Print the tables; whether none is silent."""
    count = collections.Counter(entry["outcome"] for entry in entries)
    names = ["balances", "says why not", "silent", "crash"]
    print("\n| touching | runs | " + " | ".join(names) + " |\n|---|---:|" + "---:|" * len(names))
    groups = collections.defaultdict(list)
    for entry in entries:
        for note in set(re.sub(" (gap|interference)", "", note) for note in entry["notes"]):
            groups[note].append(entry)
        for word in ("gap", "interference"):
            if any(word in note for note in entry["notes"]):
                groups["with " + word].append(entry)
        if entry["forgotten"]:
            groups["a pair forgotten"].append(entry)
    for name, found in [*sorted(groups.items(), key=lambda item: -len(item[1])), ("all", entries)]:
        here = collections.Counter(entry["outcome"] for entry in found)
        print("| %s | %d | %s |" % (name, len(found), " | ".join(str(here[n]) for n in names)))
    reasons = collections.Counter(entry["reason"] for entry in entries if entry["outcome"] == "says why not")
    for words, number in reasons.most_common():
        print("%5d  %s" % (number, words))
    print("%d runs with exit code 0 in which contact at held nodes hides a part of the balance" % sum(
        entry["numbers"].get("blind", False) for entry in entries))
    times = sorted(entry["seconds"] for entry in entries)
    print("seconds per run: median %.2f, largest %.2f" % (times[len(times) // 2], times[-1]))
    for entry in entries:
        if entry["outcome"] in ("silent", "crash"):
            print("%s %d (%s; %s%s): %s" % (entry["outcome"], entry["seed"], ", ".join(entry["kinds"]),
                                           ", ".join(entry["notes"]), "; a pair forgotten" * entry["forgotten"],
                                           entry["reason"]))
    return count["silent"] + count["crash"] == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--dotyk", default=os.environ.get("DOTYK", str(ROOT / "build/release/dotyk")))
    parser.add_argument("--seeds", default="1:501")
    parser.add_argument("--auto", action="store_true")
    parser.add_argument("--loose", action="store_true")
    parser.add_argument("--geometry", action="store_true")
    parser.add_argument("--keep", type=int)
    parser.add_argument("--report", action="store_true")
    options = parser.parse_args()
    options.dotyk = str(pathlib.Path(options.dotyk).resolve())
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    if options.keep is not None:
        entry = run(options.keep, out, options)
        print(json.dumps(entry, indent=1))
        sys.exit(entry["outcome"] in ("silent", "crash"))
    first, last = map(int, options.seeds.split(":"))
    path = out / ("loose " * options.loose + "geometry " * options.geometry + ("auto.jsonl" if options.auto else "hand.jsonl"))
    known = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    known = {entry["seed"]: entry for entry in known}
    for seed in range(first, last):
        if seed not in known and not options.report:
            known[seed] = run(seed, out, options)
            with open(path, "a", encoding="utf-8") as file:
                file.write(json.dumps(known[seed]) + "\n")
    entries = [known[seed] for seed in sorted(known) if first <= seed < last]
    sys.exit(0 if entries and report(entries) else 1)


main()
