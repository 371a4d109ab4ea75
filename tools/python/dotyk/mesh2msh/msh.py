"""Meshes written in gmsh's format MSH 4.1, binary."""
import numpy as np

from .elements import KINDS
from .mesh import Fault


def write(path, mesh):
    """Write the nodes, the groups of elements and the fields of a mesh."""
    groups, entities, used = {}, {0: [], 1: [], 2: [], 3: []}, set()
    greatest = max(block.entity for block in mesh.blocks)
    for block in mesh.blocks:
        dimension = KINDS[block.kind][1]
        for name in block.groups:
            groups.setdefault((dimension, name), len(groups) + 1)
        # Entities of geometries have positive numbers, other blocks negative ones: no faces of a geometry are known there.
        block.number = block.entity
        if block.entity <= 0:
            block.number = -1 - len(entities[dimension])
        elif (dimension, block.entity) in used:
            block.number = greatest = greatest + 1
        used.add((dimension, block.number))
        entities[dimension].append((block.number, [groups[dimension, name] for name in block.groups]))
    with open(path, "wb") as file:
        file.write(b"$MeshFormat\n4.1 1 8\n" + np.int32(1).tobytes() + b"\n$EndMeshFormat\n")
        file.write(b"$PhysicalNames\n%d\n" % len(groups))
        for (dimension, name), number in groups.items():
            file.write(b'%d %d "%s"\n' % (dimension, number, name.encode("utf-8", "surrogateescape")))
        file.write(b"$EndPhysicalNames\n$Entities\n" + np.array([len(entities[d]) for d in range(4)], dtype="<u8").tobytes())
        for dimension in range(4):
            for number, own in entities[dimension]:
                file.write(np.int32(number).tobytes() + np.zeros(6 if dimension else 3).tobytes() + np.uint64(len(own)).tobytes() +
                           np.array(own, dtype="<i4").tobytes() + (np.uint64(0).tobytes() if dimension else b""))
        n = len(mesh.node_tags)
        file.write(b"\n$EndEntities\n$Nodes\n" + np.array([1, n, mesh.node_tags.min(), mesh.node_tags.max()], dtype="<u8").tobytes())
        file.write(np.array([mesh.dimension, 0, 0], dtype="<i4").tobytes() + np.uint64(n).tobytes())
        file.write(mesh.node_tags.astype("<u8").tobytes() + np.ascontiguousarray(mesh.x, dtype="<f8").tobytes())
        total = sum(len(block.tags) for block in mesh.blocks)
        tags = np.concatenate([block.tags for block in mesh.blocks])
        file.write(b"\n$EndNodes\n$Elements\n" + np.array([len(mesh.blocks), total, tags.min(), tags.max()], dtype="<u8").tobytes())
        for block in mesh.blocks:
            number, dimension, n_nodes, order = KINDS[block.kind]
            file.write(np.array([dimension, block.number, number], dtype="<i4").tobytes() + np.uint64(len(block.tags)).tobytes())
            rows = np.empty((len(block.tags), n_nodes + 1), dtype="<u8")
            rows[:, 0] = block.tags
            rows[:, 1 + np.array(order or range(n_nodes))] = mesh.node_tags[block.nodes]
            file.write(rows.tobytes())
        file.write(b"\n$EndElements\n")
        for name, tags, values, step in mesh.fields:
            if len(tags) and tags.max() > np.iinfo(np.int32).max:
                raise Fault("field '%s': the format of gmsh has no room for the node number %d" % (name, tags.max()))
            file.write(b'$NodeData\n1\n"%s"\n1\n0\n3\n%d\n%d\n%d\n' % (
                name.encode("utf-8", "surrogateescape"), step, values.shape[1], len(tags)))
            rows = np.empty(len(tags), dtype=[("tag", "<i4"), ("value", "<f8", (values.shape[1],))])
            rows["tag"], rows["value"] = tags, values
            file.write(rows.tobytes() + b"\n$EndNodeData\n")
