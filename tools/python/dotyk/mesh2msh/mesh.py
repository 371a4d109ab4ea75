"""Elements with sets, as decks and unstructured grids tell them, made blocks of physical groups.

Sets of elements become volumes, in two dimensions surfaces; surfaces, and sets of nodes as the outer faces all of whose nodes are in the
set, become surfaces, in two dimensions curves. Nodes of a set that no such face has become points; where it has no face at all, its
edges become curves. Where elements belong to no set, all elements are the volume `Eall`.
"""
import numpy as np

from . import elements
from .elements import DIMENSION, KINDS, NAMES

ALL_ELEMENTS = "Eall"
# Greatest number of node sets in a remark.
MOST_LISTED = 5


class Fault(ValueError):
    """A mistake of the file; the message names its place."""


class Block:
    """Elements of one kind, in the same groups, and of one entity of a geometry (0 if unknown)."""

    def __init__(self, kind, tags, nodes, groups, entity=0):
        self.kind, self.tags, self.nodes, self.groups, self.entity = kind, tags, nodes, groups, entity


class Index:
    """Indices of numbers that are known; -1 for others."""

    def __init__(self, tags):
        self.order = np.argsort(tags, kind="stable")
        self.sorted = tags[self.order]
        # Numbers in a row need no search.
        self.first = self.sorted[0] if len(tags) and self.sorted[-1] - self.sorted[0] == len(tags) - 1 else None

    def repeated(self):
        """Index of a number that occurs a second time; None where none does."""
        twice = np.flatnonzero(self.sorted[1:] == self.sorted[:-1])
        return self.order[twice + 1].min() if len(twice) else None

    def find(self, tags):
        if not len(self.sorted):
            return np.full(np.shape(tags), -1)
        place = tags - self.first if self.first is not None else np.searchsorted(self.sorted, tags)
        place = np.clip(place, 0, len(self.sorted) - 1)
        return np.where(self.sorted[place] == tags, self.order[place], -1)


class Mesh:
    """Nodes and elements by indices, in the order of the file.

    node_tags (n_nodes), x (n_nodes, 3); kind (index in NAMES), tag, entity (n_elements); rows: the nodes of the elements of each kind
    (n, n_nodes of the kind) and `row`, the row of each element there. Afterwards blocks, and fields (name, node tags, values (n, n_components), time step).
    """

    def __init__(self, node_tags, x, parts, dimension):
        """parts: (kind, element tags, nodes) in the order of the file."""
        self.node_tags, self.x, self.dimension = node_tags, x, dimension
        self.kind = np.concatenate([np.full(len(tags), NAMES.index(kind), dtype=np.int8) for kind, tags, _ in parts])
        self.tag = np.concatenate([tags for _, tags, _ in parts])
        self.entity = np.zeros(len(self.tag), dtype=np.int64)
        self.row = np.empty(len(self.tag), dtype=np.int64)
        self.rows = {kind: np.concatenate([nodes for own, _, nodes in parts if own == kind]) for kind in dict.fromkeys(p[0] for p in parts)}
        for kind, nodes in self.rows.items():
            self.row[self.kind == NAMES.index(kind)] = np.arange(len(nodes))
        self.blocks, self.fields, self._outer = [], [], None

    def check_dimension(self, place):
        """Elements of the dimension of space there must be, and none of a greater one."""
        own = DIMENSION[self.kind]
        if not len(own):
            raise Fault("the file has no elements")
        if (own > self.dimension).any() or not (own == self.dimension).any():
            e = np.flatnonzero(own > self.dimension)[0] if (own > self.dimension).any() else 0
            raise Fault("%selement %d is of %d dimensions, the analysis of %d" % (place(e), self.tag[e], own[e], self.dimension))

    def add_elements(self, sets):
        """Add the blocks of sets of elements, each (name, indices of elements)."""
        combination, members = np.zeros(len(self.tag), dtype=np.int64), [()]
        for s, (_, chosen) in enumerate(sets):
            before, inverse = np.unique(combination[chosen], return_inverse=True)
            combination[chosen] = len(members) + inverse
            members += [(*members[c], s) for c in before]
        own = DIMENSION[self.kind]
        has_all = ((combination == 0) & (own == self.dimension)).any() and not any(name == ALL_ELEMENTS for name, _ in sets)
        key = (combination*len(NAMES) + self.kind)*(self.entity.max() + 1) + self.entity
        key = np.where((own == self.dimension) | (own == self.dimension - 1), key, -1)
        order = np.argsort(key, kind="stable")
        for part in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
            e = part[0]
            groups = [sets[s][0] for s in members[combination[e]]]
            groups += [ALL_ELEMENTS] if has_all and own[e] == self.dimension else []
            if key[e] >= 0 and groups:
                name = NAMES[self.kind[e]]
                self.blocks.append(Block(name, self.tag[part], self.rows[name][self.row[part]], groups, self.entity[e]))

    def outer(self):
        """Faces that belong to one element only: elements, labels from 0, and for each node number in ascending order the faces."""
        if self._outer is not None:
            return self._outer
        found = []
        for kind, nodes in self.rows.items():
            if KINDS[kind][1] != self.dimension:
                continue
            own = np.flatnonzero(self.kind == NAMES.index(kind))
            for label, (_, face) in enumerate(elements.faces(kind)):
                n_corners = len(elements.words(elements.FACES[elements.corner_kind(kind)])[label])
                corners = np.full((len(own), 4), -1, dtype=np.int64)
                corners[:, :n_corners] = nodes[:, face[:n_corners]]
                found.append((np.sort(corners, axis=1), own, np.full(len(own), label, dtype=np.int64)))
        corners, element, label = (np.concatenate([f[i] for f in found]) for i in range(3))
        # Two corners make one key; -1, where there is no fourth one, is the least.
        first, second = (corners[:, k]*2**31 + corners[:, k + 1] for k in (0, 2))
        order = np.lexsort((second, first))
        same = (first[order[1:]] == first[order[:-1]]) & (second[order[1:]] == second[order[:-1]])
        single = order[~(np.append(same, False) | np.insert(same, 0, False))]
        single = single[np.lexsort((label[single], element[single]))]
        self._outer = element[single], label[single]
        return self._outer

    def face_rows(self, element, label):
        """Kind and nodes of faces, by kinds: (indices of the faces, kind, nodes)."""
        for k in np.unique(self.kind[element]):
            name = NAMES[k]
            for face in np.unique(label[self.kind[element] == k]):
                chosen = np.flatnonzero((self.kind[element] == k) & (label == face))
                kind, nodes = elements.faces(name)[face]
                yield chosen, kind, self.rows[name][self.row[element[chosen]]][:, nodes]

    def faces_of_nodes(self, nodes):
        """The outer faces all of whose nodes are given, the given nodes on none of these, and how many of them are on other outer faces."""
        element, label = self.outer()
        inside, on_face, on_chosen = (np.zeros(len(self.node_tags), dtype=bool) for _ in range(3))
        inside[nodes] = True
        whole = np.zeros(len(element), dtype=bool)
        for chosen, _, own in self.face_rows(element, label):
            on_face[own] = True
            whole[chosen] = inside[own].all(axis=1)
            on_chosen[own[whole[chosen]]] = True
        left = inside & ~on_chosen
        return (element[whole], label[whole]), np.flatnonzero(left), np.count_nonzero(left & on_face)

    def add_faces(self, name, element, label):
        """Add faces as a group."""
        for chosen, kind, nodes in self.face_rows(element, label):
            self.blocks.append(Block(kind, self.tag[element[chosen]], nodes, [name]))

    def add_edges(self, name, nodes):
        """Add the edges of outer faces all of whose nodes are given, in three dimensions, as a group."""
        inside, edges = np.zeros(len(self.node_tags), dtype=bool), []
        inside[nodes] = True
        for _, kind, own in self.face_rows(*self.outer()) if self.dimension == 3 else ():
            m = KINDS[elements.corner_kind(kind)][2]
            own = own[np.count_nonzero(inside[own], axis=1) > 1]
            for i in range(m):
                edge = own[:, [i, (i + 1) % m] + [m + i]*(own.shape[1] > m)]
                edges += edge[inside[edge].all(axis=1)].tolist()
        for kind, n in (("line", 2), ("line3", 3)):
            own = {tuple(sorted(edge[:2])): edge for edge in edges if len(edge) == n}
            if own:
                rows = np.array(list(own.values()))
                self.blocks.append(Block(kind, self.node_tags[rows[:, 0]], rows, [name]))

    def add_node_sets(self, sets):
        """Add the surfaces, or edges, and points of sets of nodes, each (name, indices of nodes); a remark on those with points and faces."""
        partly = []
        for name, nodes in sets:
            faces, left, n_left = self.faces_of_nodes(nodes)
            self.add_faces(name, *faces)
            if len(faces[0]) and n_left:
                partly.append("'%s' (%d of %d)" % (name, n_left, len(nodes)))
            elif not len(faces[0]):
                self.add_edges(name, nodes)
            if len(left):
                self.blocks.append(Block("vertex", self.node_tags[left], left[:, None], [name]))
        if not partly:
            return ""
        return ("node sets are the outer faces all of whose nodes they have; these sets have more nodes on outer faces than on those: " +
                ", ".join(partly[:MOST_LISTED]) + ", ..."*(len(partly) > MOST_LISTED))
