"""Rigid bodies and pre-tension sections, by their reference nodes."""
import collections

import numpy as np

from .cards import located, number
from .namelist import Namelist, quoted, text_of


class Rigid(Namelist):
    """&rigid_body and &bolt."""

    def find_references(self):
        """Nodes that stand for rigid bodies and pre-tensions: `reference` and `turning` (rotations) by node, `rigid` by body."""
        self.reference, self.turning, self.tension, self.rigid = {}, {}, {}, {}
        for card in self.of("rigidbody"):
            for prefix, _ in self.deck.scopes(card):
                if card.get("elset"):
                    with located(card):
                        elements = set(self.deck.members(self.deck.element_sets, card.get("elset"), prefix))
                else:
                    nodes = card.get("nset") or card.get("tienset") or card.get("pinnset")
                    if not nodes:
                        self.leave(card.place, "*RIGID BODY without a set of elements or nodes")
                        continue
                    with located(card):
                        nodes = set(self.deck.members(self.deck.node_sets, nodes, prefix))
                    elements = {e for e, own in self.deck.elements.items() if nodes.issuperset(own)}
                    touched = {self.deck.body_of_node[n] for n in nodes if n in self.deck.body_of_node}
                    if not touched <= {self.deck.body_of[e] for e in elements}:
                        elements = set()
                bodies = {self.deck.body_of[e] for e in elements}
                whole = sum(b in bodies for b in self.deck.body_of.values()) == len(elements)
                at, turn = self.one_node(card, "refnode", prefix), self.one_node(card, "rotnode", prefix)
                if len(bodies) != 1 or not whole or at is None:
                    self.leave(card.place, "*RIGID BODY that is not one whole body with a reference node; give its surface a body of its own "
                               "or supports")
                    continue
                b = bodies.pop()
                self.rigid[b] = at, turn, card
                self.reference[at] = b
                if turn is not None:
                    self.turning[turn] = b
        for card in self.of("pretensionsection"):
            for prefix, _ in self.deck.scopes(card):
                node = self.one_node(card, "node", prefix)
                if node is None or node in self.tension:
                    self.leave(card.place, "*PRE-TENSION SECTION without a node of its own")
                else:
                    self.tension[node] = card

    def tensions(self):
        """&bolt of pre-tension sections: flat surfaces inside a body."""
        for node, card in self.tension.items():
            said = ["%s %.6g (%s)" % step.tension[node] for step in self.steps if node in step.tension]
            said = "*PRE-TENSION SECTION, NODE=%d, with %s" % (node, ", ".join(dict.fromkeys(said)) or "neither force nor shortening")
            bodies = {}
            for prefix, _ in self.deck.scopes(card):
                if card.get("surface"):
                    with located(card):
                        name = "%s.%s" % (prefix, card.get("surface")) if prefix else card.get("surface")
                        spelled, bodies = self.deck.faces_of_surface(name)
            acts = [step.tension.get(node, ("free", 0.0, ""))[:2] for step in self.steps]
            kinds = [kind for kind, _ in acts]
            # Forces come first, and a bolt stays locked.
            forces = kinds.count("force")
            right = len(set(acts)) == 1 if forces == 0 else len(set(acts[:forces])) == 1 and set(kinds[forces:]) <= {"locked"}
            if len(bodies) != 1 or len(self.deck.scopes(card)) != 1:
                self.leave(card.place, said + ": it has no surface inside one body")
            elif not right or acts[0][0] not in ("force", "shortening") or kinds[0] == "force" and not acts[0][1] > 0:
                self.leave(card.place, said + ": &bolt has one positive force, in the first load cases, or one shortening")
            elif not self.is_outward(card, next(iter(bodies.values()))):
                self.leave(card.place, said + ": its normal is not that of the surface, outwards from its elements")
            else:
                b = next(iter(bodies))
                keys = self.keys_of_cases(self.cases[:forces]) if forces else ""
                if len(self.cases) > 1 and forces == len(self.cases):
                    keys = ", case=" + ", ".join(map(quoted, self.cases))
                self.lines.append("&bolt name=%s, body=%s, surface=%s, %s=%.12g%s /" % (
                    quoted(spelled), quoted(self.body(b)), quoted(spelled), *acts[0], keys))

    def is_outward(self, card, faces):
        """Whether the normal of a section, if it is given, is that of its faces."""
        given = np.array([number(f) for f in (card.data or [[]])[0]] + [0.0]*3)[:3]
        if not given.any():
            return True
        for element, label in faces:
            x = np.array([self.deck.nodes[n] for n in self.deck.face(element, label)])
            inside = np.mean([self.deck.nodes[n] for n in self.deck.elements[element]], axis=0)
            n = np.cross(x[1] - x[0], x[2] - x[0] if self.deck.dimension == 3 else [0, 0, 1])
            n *= np.sign(n @ (x[0] - inside))/np.linalg.norm(n)
            if n @ given < 0.99*np.linalg.norm(given):
                return False
        return True

    def motions(self):
        """&rigid_body with the motions of its reference node, and &load with its forces."""
        plane, axial = self.deck.dimension == 2, self.deck.analysis == "axisymmetric"
        names = {1: "x", 2: "y", 3: "z", 4: "rx", 5: "ry", 6: "rz"}
        for d in ([3, 4, 5] if plane else []) + ([1, 6] if axial else []):
            del names[d]
        for b, (at, turn, card) in self.rigid.items():
            point = self.deck.nodes[at][:self.deck.dimension]
            if axial:
                point = [0.0, point[1]]

            def values(where, pick):
                found = {}
                for (n, d), entry in where.items():
                    if n == at or n == turn:
                        found[d + (3 if n == turn and d <= 3 else 0)] = pick(entry)
                return {d: value for d, value in found.items() if d in names}

            held = sorted(values(self.steps[0].displacement, lambda entry: 0))
            cases = collections.OrderedDict()
            for step, case in zip(self.steps, self.cases):
                moved = values(step.displacement, lambda entry: entry[0])
                cases.setdefault(tuple(moved[d] for d in held), []).append(case)
            head = "&rigid_body body=%s, point=%s, fix=%s" % (quoted(self.body(b)), text_of(point), quoted(" ".join(names[d] for d in held)))
            moved = [(value, of_value) for value, of_value in cases.items() if any(value)]
            for value, of_value in moved:
                of = dict(zip(held, value))
                keys = ", value=" + text_of([of.get(d, 0.0) for d in range(1, self.deck.dimension + 1)])
                if any(of.get(d) for d in (4, 5, 6)):
                    keys += ", rotation=" + text_of([of.get(d, 0.0) for d in ([6] if plane else [4, 5, 6])])
                self.lines.append("%s%s%s /" % (head, keys, self.keys_of_cases(of_value)))
            if not moved:
                self.lines.append(head + " /")
            faces = [face for face in self.deck.outer if self.deck.body_of[face[0]] == b]

            def forces(step):
                force = values(step.force, lambda entries: sum(value for _, value, _ in entries))
                if not any(force.values()):
                    return []
                keys = "force=" + text_of([force.get(d, 0.0) for d in range(1, self.deck.dimension + 1)])
                if any(force.get(d) for d in (4, 5, 6)):
                    keys += ", moment=" + text_of([force.get(d, 0.0) for d in ([6] if plane else [4, 5, 6])])
                if not axial:
                    keys += ", point=" + text_of(point)
                return ["&load body=%s, surface=%s, %s" % (quoted(self.body(b)), quoted(self.surface("rigid_%d" % (b + 1), faces)), keys)]

            self.by_case(forces)
