#!/usr/bin/env python3
"""Random assemblies: every run must balance, without penetration, or say why not.

    tools/assembly_campaign.py OUT                     500 assemblies, pairs named by hand, into the folder OUT
    tools/assembly_campaign.py OUT --auto              pairs that find themselves
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


def judge(assembly, path):
    """What is wrong with results, or None; numbers."""
    bodies, pairs, _ = check.read(path)
    numbers, scale, moments = {}, 0.0, np.zeros(3)
    move = max(np.abs(body.u).max() for body in bodies)
    contact = []
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
    blind = False
    for name, (by_pair, active, normal) in pairs.items():
        sides = sides_of(assembly, name)
        if sides is None:
            return None, {"note": "pair %s" % name}
        given[sides[0]] += by_pair
        given[sides[1]] -= by_pair
        for side in sides:
            outward = normal if side == sides[0] else -normal
            blind |= hidden(*contact[side][:2], active, outward, assembly.parts[sides[0]].solid.length)
    faults = []
    for k, (body, held, force, own, inner) in enumerate(contact):
        if inner > BALANCE * max(own, floor):
            faults.append("part %d: force %.1e of %.1e inside" % (k + 1, inner, own))
        off = np.abs(force.sum(axis=0) - given[k]).max()
        if off > BALANCE * scale and not blind:
            faults.append("part %d: contact force off by %.1e of %.1e" % (k + 1, off, scale))
    numbers["blind"] = blind
    if scale > 0:
        whole = sum((force.sum(axis=0) for _, _, force, _, _ in contact), np.zeros(3))
        moments = sum((np.cross(body.x, force).sum(axis=0) for body, _, force, _, _ in contact), np.zeros(3))
        numbers["balance"] = float(np.abs(whole).max() / scale)
        numbers["moment"] = float(np.abs(moments).max() / scale)
        if max(numbers["balance"], numbers["moment"]) > BALANCE and not blind:
            faults.append("action is not reaction: force %.1e, moment %.1e" % (numbers["balance"], numbers["moment"]))
    size = max(part.solid.size for part in assembly.parts)
    if move > 0.5 * size:
        faults.append("moves by %.1e" % move)
    else:
        deep, where = 0.0, None
        for i, one in enumerate(bodies):
            for j in range(i):
                before, after = check.depth(one, bodies[j], 0.0), check.depth(one, bodies[j])
                share = max(np.abs(one.u).max(), np.abs(bodies[j].u).max()) + before
                curved = sum((part.solid.length**2 / (8 * part.solid.radius)) for part in (
                    assembly.parts[i], assembly.parts[j]) if hasattr(part.solid, "radius")) if before > 0 else 0.0
                part = max(0.0, after - curved) / share if share else 0.0
                if part > deep:
                    deep, where = part, (j + 1, i + 1, after)
        numbers["depth"] = float(deep)
        if deep > DEEP:
            faults.append("parts %d and %d penetrate by %.2e, %.0f %% of what they move" % (*where, 100 * deep))
    numbers["move"] = float(move / size)
    return "; ".join(faults) or None, numbers


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
    assembly = random_assembly.Assembly(seed, overlaps, options.auto)
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
            fault, entry["numbers"] = judge(assembly, folder / "scene.vtkhdf")
            entry["outcome"], entry["reason"] = ("silent", fault) if fault else ("balances", "")
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
    path = out / ("auto.jsonl" if options.auto else "hand.jsonl")
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
