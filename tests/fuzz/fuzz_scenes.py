"""The scenes that tests/fuzz/fuzz.py begins with: small ones with meshes of fuzz_meshes, and the examples on coarse
meshes by gmsh.

A `Scene` is a namelist text and files, of which some are meshes that can be written again in another format.
"""
import pathlib
import re
import shutil
import subprocess
import tempfile

import fuzz_meshes

INPUTS = pathlib.Path(__file__).resolve().parents[2] / "inputs"
KINDS_3D = [kind for kind in fuzz_meshes.KINDS if fuzz_meshes.dimension(kind) == 3]
KINDS_2D = [kind for kind in fuzz_meshes.KINDS if fuzz_meshes.dimension(kind) == 2]
FORMATS = [("2.2", False), ("2.2", True), ("4.1", False), ("4.1", True)]
SCHEMES = ["auto", "dual", "neumann", "robin"]
# A run that does not converge must end in seconds.
SOLVER = "&solver %s max_iterations=300 /\n"
OUTPUTS = ["", "", "&output fields='contact', error_parts='' /\n"]


class Scene:
    """name, text of the namelist, meshes {file: Mesh}, files {file: bytes}."""

    def __init__(self, name, text, meshes=None, files=None):
        self.name, self.text, self.meshes, self.files = name, text, meshes or {}, files or {}


def up(d):
    """Name of the last axis."""
    return "xyz"[d - 1]


def vector(d, last):
    """A vector along the last axis."""
    return ",".join(["0"] * (d - 1) + [last])


def blocks(kind, n, bump=0.0, gap=0.0, names=("lower", "upper")):
    """Blocks above each other; the lower side of all but the first bulges by bump in the middle."""
    mesh = fuzz_meshes.Mesh()
    d = fuzz_meshes.dimension(kind)

    def bulge(x):
        r = sum((c - 0.5)**2 for c in x[:-1])
        return [*x[:-1], x[-1] + 4 * bump * r * (1 - x[-1])]

    for k, name in enumerate(names):
        origin = [0.0] * (d - 1) + [k * (1.0 + gap)]
        fuzz_meshes.add_block(mesh, name, kind, n if k == 0 else max(1, n - 1), origin, [1.0] * d,
                              bulge if k else lambda x: x)
    return mesh


def column(rng):
    """Two blocks pushed together, of any element kind, scheme and analysis."""
    d = rng.choice([2, 3])
    kind = rng.choice(KINDS_2D if d == 2 else KINDS_3D)
    analysis = "3d" if d == 3 else rng.choice(["plane_strain", "plane_stress", "axisymmetric"])
    n = rng.choice([1, 2]) if d == 3 else rng.choice([1, 2, 3])
    text = "&scene analysis='%s', mesh='a.msh' /\n" % analysis
    for name, young in (("lower", "30e9"), ("upper", "210e9")):
        text += "&material name='of %s', young=%s, poisson=0.3 /\n" % (name, young)
        text += "&body name='%s', volume='%s', material='of %s' /\n" % (name, name, name)
        text += "".join("&support body='%s', surface='sides %s', fix='%s' /\n" % (name, a, a) for a in "xy"[:d - 1])
    text += "&support body='lower', surface='low', fix='%s' /\n" % up(d)
    text += "&support body='upper', surface='high', fix='%s', value=%s /\n" % (up(d), vector(d, "-1e-3"))
    text += "&contact name='joint', surface_a='upper:low', surface_b='lower:high'%s /\n" % rng.choice(
        ["", ", gap=1e-4", ", gap_formula='1e-4*x^2'", ", discretization='quadrature'", ", geometry='elements'",
         ", quadrature='plain'"])
    text += SOLVER % ("scheme='%s', %s" % (rng.choice(SCHEMES), rng.choice(["theta_relative=1e-2,", "tolerance=1e-8,",
                                                                            "locking='ignore',", ""])))
    text += rng.choice(OUTPUTS)
    return Scene("column", text, {"a.msh": blocks(kind, n, rng.choice([0, 0, 0.05]), rng.choice([0, 0, 1e-4, -1e-4]))})


def stack(rng):
    """Free blocks on a held one, under pressure or weight."""
    d = rng.choice([2, 3])
    kind = rng.choice(KINDS_2D if d == 2 else KINDS_3D)
    names = ["a", "b", "c"][:rng.choice([2, 3])]
    text = "&scene analysis='%s', mesh='a.msh' /\n&material name='m', young=1e3, poisson=0.2 /\n" % (
        "3d" if d == 3 else "plane_strain")
    for i, name in enumerate(names):
        text += "&body name='%s', volume='%s', material='m' /\n" % (name, name)
        text += "&support body='a', surface='low', fix='%s' /\n" % "xyz"[:d] if i == 0 else rng.choice(
            ["&load body='%s', surface='high', pressure=1 /\n" % name,
             "&load body='%s', force_density=%s /\n" % (name, vector(d, "-1"))])
        if i > 0:
            text += "&contact name='%s', surface_a='%s:low', surface_b='%s:high' /\n" % (name, name, names[i - 1])
    text += SOLVER % rng.choice(["theta=0, tolerance=1e-8,", "theta_mesh=1e-3,",
                                 "scheme='dual', linear_solver='iterative',", "linear_solver='direct', theta=0,",
                                 "response='auto',", ""])
    text += rng.choice(OUTPUTS)
    return Scene("stack", text, {"a.msh": blocks(kind, rng.choice([1, 2]), rng.choice([0, 0.05]), 0.0, names)})


def placed(rng):
    """One volume placed as several bodies of a crystal, with formulas and axes of surfaces."""
    kind = rng.choice(KINDS_3D)
    mesh = fuzz_meshes.Mesh()
    fuzz_meshes.add_block(mesh, "cube", kind, 1, [0, 0, 0], [1, 1, 1])
    material = rng.choice([
        "young=14,1,1, poisson=0.3,0.3,0.4, shear=0.5,0.5,0.35, axis_1=1,1,0, axis_2=0,1,0",
        "young=14, poisson=0.3, young_formula='1+z/2'",
        "young_formula='14+z', poisson_formula='0.3+0.1*sin(x)'",
        "young_formula='9+z','2+x^2','3', poisson=0.1,0.1,0.1, shear_formula='1','2','1+y^2', axis_1=1,1,0, axis_2=0,1,0",
        "stiffness=3,1,1,0,0,0, 3,1,0,0,0, 3,0,0,0, 1,0,0, 1,0, 1"])
    text = """&scene mesh='a.msh' /
&material name='m', %s /
&body name='a', volume='cube', material='m' /
&body name='b', volume='cube', material='m', at=0.25,0.25,1, axis=0,0,1, angle=90 /
&body name='c', volume='cube', material='m', at=-0.25,0,2, axis=1,1,1, angle=120 /
&support body='a', surface='low', fix='nt' /
&support body='a', surface='sides x', fix='n', value_formula='0','0','1e-4*y*z' /
&support body='b', surface='sides x', fix='n' /
&support body='b', surface='sides y', fix='xi' /
&support body='c', surface='high', fix='nt' /
&load body='b', surface='sides x', pressure_formula='1e-3*max(0, 1-x^2-y^2)' /
&load body='b', surface='sides y', local_traction=0,1e-4,0 /
&load body='c', force_density_formula='0','0','-1e-3*exp(-x^2)' /
&contact name='one', surface_a='b:low', surface_b='a:high', theta_relative=1e-3 /
&contact name='two', surface_a='c:sides y', surface_b='b:high', search_radius=0.5 /
""" % material + SOLVER % rng.choice(["", "reproducible=.true.,"])
    return Scene("placed", text, {"a.msh": mesh})


COARSE = {}  # example: Scene, or None where gmsh does not mesh it coarsely enough


def example(rng):
    """An example of inputs/ on a mesh as coarse as gmsh makes it; a column where there is no gmsh."""
    names = sorted(path.stem for path in INPUTS.glob("*/*.nml") if path.with_suffix(".geo").exists()
                   and path.stem != "fine")
    name = rng.choice(names)
    if name not in COARSE:
        COARSE[name] = coarse(next(INPUTS.glob("*/%s.nml" % name)))
    return COARSE[name] or column(rng)


def coarse(case):
    """The scene of an example with linear elements, about ten times as large; None where more than 400 nodes are
    left."""
    if not shutil.which("gmsh"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        for path in case.parent.glob("*.geo"):
            text = re.sub(r"Mesh.ElementOrder *=[^;]*;", "Mesh.ElementOrder = 1;", path.read_text())
            text = re.sub(r"(?m)^order *=.*?;", "order = 1;",
                          re.sub(r"DefineConstant\[n = \d+\]", "DefineConstant[n = 1]", text))
            pathlib.Path(folder, path.name).write_text(text)
        msh = pathlib.Path(folder, "a.msh")
        d = 2 if "analysis=" in case.read_text() else 3
        try:
            subprocess.run(["gmsh", "-%d" % d, "-clscale", "12", "-format", "msh22", "-nt", "1", "-o", str(msh),
                            str(pathlib.Path(folder, case.stem + ".geo"))], check=True, timeout=20,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        except (subprocess.SubprocessError, OSError):
            return None
        mesh = parse_22(msh.read_text())
    if len(mesh.nodes) > 400:
        return None
    text = re.sub(r"mesh='[^']*\.geo'", "mesh='a.msh'", case.read_text())
    return Scene(case.stem, re.sub(r"(?m)^(&solver .*)/ *$", r"\1, max_iterations=300 /", text), {"a.msh": mesh})


def parse_22(text):
    """A Mesh from gmsh's own text of format 2.2 with nodes numbered from 1."""
    mesh = fuzz_meshes.Mesh()
    lines = text.split("\n")

    def section(name):
        return lines[lines.index("$" + name) + 2:lines.index("$End" + name)]

    mesh.groups = [(int(d), int(tag), name.strip('"'))
                   for d, tag, name in (s.split(" ", 2) for s in section("PhysicalNames"))]
    number = {}
    for line in section("Nodes"):
        tag, *x = line.split()
        mesh.nodes.append([float(c) for c in x])
        number[tag] = len(mesh.nodes)
    dimensions = {kind[0]: kind[1] for kind in fuzz_meshes.KINDS.values()}
    for line in section("Elements"):
        words = line.split()
        kind, n_tags, group = int(words[1]), int(words[2]), int(words[3])
        d = dimensions.get(kind, 0 if kind == 15 else 1 if kind in (1, 8) else 2)
        if d > 0:
            mesh.elements.append((kind, d, group, [number[tag] for tag in words[3 + n_tags:]]))
    used = {(d, g) for _, d, g, _ in mesh.elements}
    mesh.groups = [(d, tag, name) for d, tag, name in mesh.groups if (d, tag) in used]
    return mesh


def choose(rng, with_examples):
    """A scene at random."""
    return rng.choice([column, column, stack, placed] + [example] * with_examples)(rng)
