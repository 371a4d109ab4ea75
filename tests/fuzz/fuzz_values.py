"""Mutations of whole scenes whose syntax stays right, for tests/fuzz/fuzz.py: numbers of the namelist, groups, meshes.

Each takes a random generator and a Scene, whose text and meshes it changes.
"""
import math
import re

SCALES = ["0", "-1", "1e-300", "1e-150", "1e-30", "1e-16", "1e-8", "1e-3", "0.5", "1", "3", "1e3", "1e8", "1e16",
          "1e30", "1e150", "1e300", "1e308", "-1e300", "-1e-300", "-0.0", "2.2250738585072014e-308", "4.9e-324"]
NUMBERS = {
    "young": SCALES, "shear": SCALES, "stiffness": SCALES,
    "poisson": ["0.5", "0.4999999999999999", "0.49999999", "0.499", "-1", "-0.999999999", "-0.5", "0", "1", "1e300",
                "1e-300"],
    "theta": SCALES, "theta_relative": SCALES, "theta_mesh": SCALES, "search_radius": SCALES, "gap": SCALES,
    "tolerance": ["0", "1e-300", "1e-17", "1e-14", "1e-3", "0.5", "1", "2", "1e300", "-1"],
    "gamma": ["1e-300", "0.1", "1", "1.999", "2", "1e300"],
    "max_iterations": ["1", "2", "0", "3", "500"], "value": SCALES, "pressure": SCALES, "traction": SCALES,
    "local_traction": SCALES,
    "force_density": SCALES, "at": SCALES, "axis": SCALES, "axis_1": SCALES, "axis_2": SCALES,
    "angle": ["0", "90", "180", "360", "1e-300", "45", "1e16", "1e300", "1e308", "-30"]}
NAMES = {
    "scheme": ["auto", "dual", "neumann", "robin"],
    "gamma_rule": ["spectral", "theory", "fixed"],
    "stop_rule": ["residual", "paper", "increment"], "discretization": ["mortar", "quadrature"],
    "geometry": ["smooth", "elements"], "quadrature": ["segments", "plain"],
    "linear_solver": ["auto", "direct", "iterative"], "response": ["auto", "full", "compliance"],
    "analysis": ["3d", "plane_strain", "plane_stress", "axisymmetric"],
    "fix": ["x", "xy", "xyz", "n", "t", "nt", "xi", "z", "y"],
    "locking": ["auto", "ignore"],
    "fields": ["", "displacement", "stress", "contact"], "error_parts": ["", "penalty", "discretization"]}
LOGICALS = {"layer", "reproducible"}
OF_GROUP = {
    "material": ["young", "poisson", "young", "poisson"],
    "solver": ["theta", "theta_relative", "theta_mesh", "tolerance", "gamma", "scheme", "gamma_rule", "stop_rule",
               "linear_solver", "response", "reproducible", "locking", "max_iterations"],
    "contact": ["theta", "theta_relative", "theta_mesh", "gap", "search_radius", "discretization", "geometry",
                "quadrature", "layer"],
    "support": ["fix", "value"], "load": ["pressure"], "body": ["at", "angle", "axis"],
    "output": ["fields", "error_parts"],
    "scene": ["analysis"]}
FORMULAS = ["0", "x", "1e300*x", "1/x", "1e-3*sin(50*x)", "sqrt(x-1)", "-x", "log(x)", "1e308*1e308", "exp(-1000*x^2)",
            "1e-320", "x>0.5 ? 1 : 0", "1/(x-0.5)", "tan(x*pi/2)", "0*x/0"]


def set_key(scene, i, key, value):
    """Set a key of the group in line i."""
    lines = scene.text.split("\n")
    pattern = r"\b%s=(?:'[^']*'|[^ ,=/]+)(?:, *(?:'[^']*'|[-+\d.]+[-+\w.]*))*" % key
    if re.search(pattern, lines[i]):
        lines[i] = re.sub(pattern, lambda _: "%s=%s" % (key, value), lines[i])
    else:
        lines[i] = re.sub(r" *,? */ *$", lambda _: " %s=%s /" % (key, value), lines[i])
    scene.text = "\n".join(lines)


def groups(scene, *names):
    """Lines with groups of these names."""
    return [i for i, line in enumerate(scene.text.split("\n")) if line.startswith(tuple("&" + name for name in names))
            and "/" in line]


def odd_value(rng, scene):
    """A number of the namelist is at the edge of what makes sense, or a choice is another one."""
    lines = groups(scene, *OF_GROUP)
    if not lines:
        return
    i = rng.choice(lines)
    line = scene.text.split("\n")[i]
    there = [key for key in re.findall(r"(\w+)=", line) if key in NUMBERS or key in NAMES]
    key = rng.choice(there) if there and rng.random() < 0.6 else rng.choice(OF_GROUP[re.match(r"&(\w+)", line)[1]])
    set_key(scene, i, key, value_of(rng, key, line))


def value_of(rng, key, line):
    """A value for a key."""
    if key in NAMES:
        return "'%s'" % rng.choice(NAMES[key])
    if key in LOGICALS:
        return rng.choice([".true.", ".false."])
    old = re.search(r"\b%s=([-+\w.]+(?:, *[-+\d.][-+\w.]*)*)" % key, line)
    n = old[1].count(",") + 1 if old else {"value": 3, "at": 3, "axis": 3}.get(key, 1)
    values = re.split(", *", old[1]) if old else ["0"] * n
    if rng.random() < 0.5:
        return ",".join([rng.choice(NUMBERS[key])] * n)
    values[rng.randrange(n)] = rng.choice(NUMBERS[key])
    return ",".join(values)


def odd_formula(rng, scene):
    """A formula where there was a number, or another one."""
    lines = groups(scene, "contact", "load", "support", "material")
    if not lines:
        return
    i = rng.choice(lines)
    line = scene.text.split("\n")[i]
    formula = "'%s'" % rng.choice(FORMULAS)
    if line.startswith("&contact"):
        set_key(scene, i, rng.choice(["gap_formula", "theta_formula"]), formula)
    elif line.startswith("&material"):
        set_key(scene, i, "young_formula", formula)
    else:
        n = max(2, line.count("xyz"[1]) + 1) if "analysis='3d'" not in scene.text and "analysis" in scene.text else 3
        old = re.search(r"(value|traction|force_density|pressure)(_formula)?=", line)
        key = old[1] if old else "value" if line.startswith("&support") else "pressure"
        text = scene.text.split("\n")
        text[i] = re.sub(r"(value|traction|force_density|pressure)(_formula)?=(?:'[^']*'|[^ ,=/]+)"
                         r"(?:, *(?:'[^']*'|[-+\d.]+[-+\w.]*))*", "",
                         line)
        scene.text = "\n".join(text)
        set_key(scene, i, key + "_formula", formula if key == "pressure" else ",".join([formula] * n))


def change_groups(rng, scene):
    """Supports, loads or pairs vanish, come twice, or change sides."""
    lines = scene.text.split("\n")
    found = groups(scene, "support", "load", "contact")
    if not found:
        return
    i = rng.choice(found)
    action = rng.randrange(6)
    if action == 0:
        del lines[i]
    elif action == 1:
        kind = re.match(r"&\w+", lines[i])[0]
        lines = [line for line in lines if not line.startswith(kind)]
    elif action == 2:
        lines.insert(i, re.sub(r"name='([^']*)'", r"name='\1 2'", lines[i]))
    elif action == 3:
        lines[i] = re.sub(r"surface_a='([^']*)'(.*)surface_b='([^']*)'", r"surface_a='\3'\2surface_b='\1'", lines[i])
    elif action == 4:
        lines[i] = re.sub(r"surface_a='([^']*)'(.*)surface_b='([^']*)'", r"surface_a='\1'\2surface_b='\1'", lines[i])
    else:
        surfaces = re.findall(r"surface(?:_[ab])?='(?:[^':]*:)?([^']*)'", scene.text)
        lines[i] = re.sub(r"(?<=[':])[^':]*(?='[^']*$)", lambda _: rng.choice(surfaces), lines[i]) \
            if "fix" not in lines[i] else \
            re.sub(r"surface='[^']*'", lambda _: "surface='%s'" % rng.choice(surfaces), lines[i])
    scene.text = "\n".join(lines)


def hold_everything(rng, scene):
    """Supports on all surfaces of all bodies, with a value here and there."""
    bodies = re.findall(r"&body +name='([^']*)'", scene.text)
    surfaces = sorted({name for mesh in scene.meshes.values() for d, _, name in mesh.groups
                       if any(e[1] == d for e in mesh.elements)})
    fix = rng.choice(["xyz" if "analysis" not in scene.text or "'3d'" in scene.text else "xy", "n", "nt", "x"])
    value = rng.choice(["", "", "value=0,0,0", "value=1e-3,0,0", "value=1e300,0,0", "value=0,1e-300"])
    for body in bodies:
        for surface in rng.sample(surfaces, rng.randrange(len(surfaces) + 1)):
            scene.text += "&support body='%s', surface='%s', fix='%s' %s /\n" % (body, surface, fix, value)


def change_nodes(rng, scene):
    """Coordinates are scaled, moved, turned inside out, collapsed, disturbed, or one of them lies far away."""
    mesh = rng.choice(list(scene.meshes.values()))
    action = rng.randrange(9)
    axis = rng.randrange(3)
    factor = rng.choice([1e-300, 1e-155, 1e-150, 1e-30, 1e-9, 1e-3, 1e3, 1e9, 1e30, 1e150, 1e155, 1e300])
    one = rng.randrange(len(mesh.nodes))
    other = rng.randrange(len(mesh.nodes))
    if action == 0:
        mesh.nodes = [[c * factor for c in x] for x in mesh.nodes]
    elif action == 1:
        mesh.nodes = [[c * factor if i == axis else c for i, c in enumerate(x)] for x in mesh.nodes]
    elif action == 2:
        mesh.nodes = [[c + factor if i == axis else c for i, c in enumerate(x)] for x in mesh.nodes]
    elif action == 3:
        mesh.nodes = [[-c if i == axis else c for i, c in enumerate(x)] for x in mesh.nodes]
    elif action == 4:
        mesh.nodes = [[0.0 if i == axis else c for i, c in enumerate(x)] for x in mesh.nodes]
    elif action == 5:
        size = rng.choice([1e-15, 1e-9, 1e-3, 0.05, 0.3])
        mesh.nodes = [[c + size * (rng.random() - 0.5) for c in x] for x in mesh.nodes]
    elif action == 6:
        mesh.nodes[one][axis] = rng.choice([factor, -factor, 0.0, math.nextafter(mesh.nodes[one][axis], 9.0)])
    elif action == 7:
        mesh.nodes[one] = list(mesh.nodes[other])
    else:
        mesh.nodes[one] = [a + (b - a) * rng.choice([0.5, 0.999999, 1 - 1e-15])
                           for a, b in zip(mesh.nodes[one], mesh.nodes[other])]


def change_elements(rng, scene):
    """Elements with nodes changed over, doubled or missing, elements that come twice, are missing or belong to another
    group."""
    mesh = rng.choice(list(scene.meshes.values()))
    for _ in range(rng.choice([1, 1, 1, 5])):
        if len(mesh.elements) < 2:
            return
        i = rng.randrange(len(mesh.elements))
        kind, d, group, nodes = mesh.elements[i]
        nodes = list(nodes)
        action = rng.randrange(7)
        a, b = rng.randrange(len(nodes)), rng.randrange(len(nodes))
        if action == 0:
            nodes[a], nodes[b] = nodes[b], nodes[a]
        elif action == 1:
            nodes[a] = nodes[b]
        elif action == 2:
            nodes[a] = rng.randrange(1, len(mesh.nodes) + 1)
        elif action == 3:
            nodes = nodes[::-1]
        elif action == 4:
            mesh.elements.append((kind, d, group, nodes))
        elif action == 5:
            del mesh.elements[i]
            continue
        else:
            group = rng.choice([g for e, g, _ in mesh.groups if e == d])
        mesh.elements[i] = (kind, d, group, nodes)


MUTATORS = [odd_value, odd_value, odd_value, odd_value, odd_formula, change_groups, change_groups, hold_everything,
            change_nodes, change_nodes, change_elements, change_elements]
