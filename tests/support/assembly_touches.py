"""Assemblies that just touch: ridges on each other, round bodies between walls, a fine surface over a joint."""
import numpy as np

import point_contact as pc
from assembly import Scene, box, grid_mesh
from assembly_points import bar, point_rows
from assembly_rows import PRESS, Row, solved


def ridges(n=(1, 1), swap=False):
    """Two bars that lie on each other with their edges, n divisions along them: the upper one is moved down."""
    def run(seed=0, dotyk=None):
        low, high, move = bar(n[0], 0, True), bar(n[1], 0, False), (0, 0, -0.01)
        scene = Scene("3d").body("upper", high).body("lower", low)
        for mesh in (low, high):
            mesh.group("far", "back", "top")
        scene.fix("lower", "far", "xyz").fix("upper", "far", "xyz", move)
        answer = solved(scene.pair("touch", *["upper:ridge", "lower:ridge"][::-1 if swap else 1]), seed, dotyk)
        bodies = [pc.Body(mesh, 1.0, 0.3, [("back", value), ("top", value)])
                  for mesh, value in ((high, move), (low, (0, 0, 0)))]
        ends = [np.where((np.abs(np.abs(mesh.x[:, 0]) - 2) < 1e-9) & (np.linalg.norm(mesh.x[:, 1:], axis=1) < 1e-9))[0]
                for mesh in (high, low)]
        # the scene is symmetric: both ends carry half of the force
        force, u, v = pc.touch(*bodies, 0.0, (0, 0, -1), *[(list(nodes), [0.5, 0.5]) for nodes in ends])
        return point_rows(answer, swap, force, u, v, ("upper", "lower"), 2)
    return run


def between_walls(kind="quad4", n=4):
    """A round body between two walls that it merely touches: nothing is loaded, nothing carries."""
    def run(seed=0, dotyk=None):
        d = 3 if kind in ("hex8", "tet4") else 2
        body = grid_mesh(kind, *[np.linspace(-1, 1, n + 1)] * d)
        body.patch("rim", lambda c: True)
        square = [body.x[:, k]**2 for k in range(d)] + [np.zeros(len(body.x))] * (3 - d)
        factors = [np.sqrt(1 - square[k - 1]/2 - square[k - 2]/2 + square[k - 1]*square[k - 2]/3) for k in range(d)]
        body.move(lambda x: x * np.stack(factors, axis=1))
        scene = Scene("3d" if d == 3 else "plane_strain").body("body", body)
        for name, side in (("left", -1), ("right", 1)):
            low, high = sorted((side, 1.5 * side))
            wall = box("hex8" if d == 3 else "quad4", 2, (low, *[-1.0] * (d - 1)), (high, *[1.0] * (d - 1)))
            near, far = ("right", "left") if side < 0 else ("left", "right")
            scene.body(name, wall).fix(name, far, "xyz"[:d]).pair(name, "body:rim", "%s:%s" % (name, near))
        answer = solved(scene, seed, dotyk)
        return [Row("force on a wall", np.linalg.norm(answer.pairs["left"]["force"]), 0.0, 1e-12),
                Row("smallest gap", min(answer.pairs["left"]["gap_initial"]), 0.0, 1e-12)]
    return run


def joint(split=4.0, n=8, kind="hex8"):
    """A fine surface, n divisions, over the joint of two coarse blocks, without penalty."""
    def run(seed=0, dotyk=None):
        scene = Scene("3d", solver="theta=0, tolerance=1e-6")
        lid = box(kind, (n, n, 1), (0, 0, 4), (8, 8, 6))
        scene.body("lid", lid, 1.0, 0.0).load("lid", "top", pressure=PRESS)
        for name, low, high, side in (("one", 0.0, split, "left"), ("two", split, 8.0, "right")):
            scene.body(name, box(kind, 1, (low, 0, 0), (high, 8, 4)), 1.0, 0.0)
            scene.fix(name, "bottom", "n").fix(name, side, "n").fix(name, "front", "n")
            scene.pair(name, "lid:bottom", name + ":top")
        scene.fix("lid", "left", "n").fix("lid", "front", "n")
        answer = solved(scene, seed, dotyk, codes=(0, 1))
        force = sum(np.linalg.norm(pair["force"]) for pair in answer.pairs.values()) / (64 * PRESS)
        off = max(np.abs(pair["pressure"] / PRESS - 1).max() for pair in answer.pairs.values())
        return [Row("converged", float(answer.code), 0.0, 0.0), Row("force", force, 1.0, 1e-9),
                Row("bound above the tolerance", float(answer.summary["error_bound"] > 1e-6), 0.0, 0.0),
                Row("pressures off by 1e-3", float(off > 1e-3), 0.0, 0.0)]
    return run
