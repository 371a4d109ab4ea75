"""Supports, loads and temperatures of deformable bodies."""
import collections
import re

import numpy as np

from .cards import located, number
from .namelist import Namelist, quoted, text_of

# A nodal force of a traction may be off by the digits of the deck.
CONSISTENT = 2e-3


class Loads(Namelist):
    """&support, &load and &temperature."""

    def supports(self):
        """&support on the faces all of whose nodes have the same given displacements, and on other nodes; their values by load case."""
        given, place = collections.defaultdict(dict), {}
        for n, d in self.steps[0].displacement:
            if n in self.reference or n in self.turning or d > self.deck.dimension:
                continue
            entries = [step.displacement[n, d] for step in self.steps]
            given[n][d], place[n, d] = tuple(value for value, _ in entries), entries[0][1]
        for card in self.of("transform"):
            self.leave(card.place, "*TRANSFORM: supports and forces are taken in global axes")
        # Directions of a face are those that all its nodes have with one value.
        groups = collections.OrderedDict()
        for face, nodes in self.deck.outer.items():
            common = tuple(d for d in (1, 2, 3) if all(d in given.get(n, {}) for n in nodes) and len({given[n][d] for n in nodes}) == 1)
            if common and self.deck.body_of[face[0]] not in self.rigid:
                groups.setdefault((self.deck.body_of[face[0]], common, tuple(given[nodes[0]][d] for d in common)), []).append(face)
        held = collections.defaultdict(set)
        for (_, directions, _), faces in groups.items():
            for n in (n for face in faces for n in self.deck.outer[face]):
                held[n].update(directions)
        lost = collections.defaultdict(list)
        for n, of_node in given.items():
            left = tuple(d for d in sorted(of_node) if d not in held[n])
            b = self.deck.body_of_node.get(n)
            for d in left if b is None or b in self.rigid else ():
                lost[place[n, d], d, b is None].append(n)
            if left and b is not None and b not in self.rigid:
                groups.setdefault((b, left, tuple(of_node[d] for d in left), "nodes"), []).append(n)
        for i, ((b, directions, values, *of_nodes), members) in enumerate(groups.items(), 1):
            where = "nodes=" + quoted(self.node_set("fix_%d" % i, members)) if of_nodes else "surface=" + quoted(self.surface("fix_%d" % i, members))
            head = "&support body=%s, %s, fix='%s'" % (quoted(self.body(b)), where, "".join(self.axes[d - 1] for d in directions))
            cases = collections.OrderedDict()
            for k, case in enumerate(self.cases):
                cases.setdefault(tuple(value[k] for value in values), []).append(case)
            moved = [(value, of_value) for value, of_value in cases.items() if any(value)]
            for value, of_value in moved:
                full = [value[directions.index(d)] if d in directions else 0.0 for d in range(1, self.deck.dimension + 1)]
                self.lines.append("%s, value=%s%s /" % (head, text_of(full), self.keys_of_cases(of_value)))
            if not moved:
                self.lines.append(head + " /")
        for (at, d, alone), nodes in sorted(lost.items()):
            listed = "%s%s" % (", ".join(map(str, sorted(nodes)[:8])), ", ..." if len(nodes) > 8 else "")
            self.leave(at, "*BOUNDARY: direction %s of %d nodes %s (%s)" % (
                "xyz"[d - 1], len(nodes), "that no solid element has" if alone else "of a rigid body", listed))

    def nodal_forces(self, step):
        """&load of nodal forces: a traction where they are its nodal forces, on whole faces else a total force and moment, or those of nodes."""
        force, places, lines = collections.defaultdict(lambda: np.zeros(3)), collections.defaultdict(dict), []
        for (n, d), entries in step.force.items():
            if n in self.reference or n in self.turning:
                continue
            force[n][d - 1] = sum(value for _, value, _ in entries)
            for _, _, at in entries:
                places[self.deck.body_of_node.get(n), d - 1][at] = True

        def leave(b, d, message):
            self.leave(", ".join(places[b, d]), "*CLOAD: " + message)

        if force and self.deck.analysis == "axisymmetric":
            for b, d in places:
                leave(b, d, "axisymmetric elements: give tractions in their place")
            return lines
        for b in range(self.deck.n_bodies):
            for d in range(self.deck.dimension):
                nodes = {n for n, f in force.items() if self.deck.body_of_node.get(n) == b and f[d] != 0}
                if not nodes:
                    continue
                faces = [face for face, of_face in self.deck.outer.items() if nodes.issuperset(of_face)]
                unit = self.deck.unit_loads(faces)
                if set(unit) != nodes:
                    for value in sorted({force[n][d] for n in nodes}):
                        vector = np.zeros(self.deck.dimension)
                        vector[d] = value
                        own = self.node_set("force_%d_%s_nodes" % (b + 1, "xyz"[d]), [n for n in nodes if force[n][d] == value])
                        lines.append("&load body=%s, nodes=%s, traction=%s" % (quoted(self.body(b)), quoted(own), text_of(vector)))
                    continue
                patches = self.deck.patches(faces)
                units = [self.deck.unit_loads(patch) for patch in patches]
                order = sorted(nodes)
                matrix = np.array([[unit.get(n, 0.0) for unit in units] for n in order])
                right = np.array([force[n][d] for n in order])
                traction = np.linalg.lstsq(matrix, right, rcond=None)[0]
                names = ["force_%d_%s" % (b + 1, "xyz"[d]) + ("_%d" % (k + 1) if len(patches) > 1 else "") for k in range(len(patches))]
                exact = np.abs(matrix @ traction - right).max() <= CONSISTENT*np.abs(right).max()
                if not exact and (len(patches) > 1 or abs(right.sum()) < CONSISTENT*np.abs(right).sum()):
                    leave(b, d, "forces in direction %s on body %s: those of no uniform traction on each of %d faces, in all %.6g"
                          % ("xyz"[d], self.body(b), len(patches), right.sum()))
                    continue
                for name, patch, value in zip(names, patches, traction):
                    vector = np.zeros(self.deck.dimension)
                    vector[d] = value if exact else right.sum()
                    load = "traction=" + text_of(vector)
                    if not exact:
                        point = sum(f*np.array(self.deck.nodes[n]) for n, f in zip(order, right))/right.sum()
                        load = "force=%s, point=%s" % (text_of(vector), text_of(point[:self.deck.dimension]))
                    lines.append("&load body=%s, surface=%s, %s" % (quoted(self.body(b)), quoted(self.surface(name, patch)), load))
                if not exact:
                    leave(b, d, "forces in direction %s on body %s are those of no uniform traction: written as their total force "
                          "at its point, spread over the faces" % ("xyz"[d], self.body(b)))
        for b, d in places:
            if b is None:
                lost = [n for n, f in force.items() if n not in self.deck.body_of_node and f[d] != 0]
                leave(b, d, "forces on %d nodes that no solid element has" % len(lost))
        return lines

    def distributed_loads(self, step):
        """&load of *DLOAD and *DSLOAD."""
        pressures, lines, loaded = collections.OrderedDict(), [], {}

        def press(card, value, b, faces):
            for face in faces:
                if face in loaded:
                    self.leave(card.place, "several pressures on a face, the other one of %s: their sum is taken" % loaded[face])
                loaded[face] = card.place
            pressures.setdefault((b, value), []).extend(faces)

        for (keyword, target, label), entries in step.load.items():
            for _, card, fields in entries:
                if keyword == "dsload" and label == "P":
                    with located(card):
                        found = self.deck.faces_of_surface(fields[0])[1]
                    for b, faces in found.items():
                        press(card, number(fields[2]), b, faces)
                elif keyword == "dload" and re.fullmatch("P[1-6]", label):
                    press(card, number(fields[2]), self.deck.body_of[target], [(target, int(label[1]))])
                elif keyword == "dload" and label in ("GRAV", "CENTRIF"):
                    lines += self.volume_load(card, fields, label)
                else:
                    self.leave(card.place, "load %s" % label)
        for i, ((b, value), faces) in enumerate(pressures.items(), 1):
            if value:
                # A face that has the value twice needs two groups.
                times = collections.Counter(faces)
                while times:
                    name = self.surface("pressure_%d" % i, list(times))
                    lines.append("&load body=%s, surface=%s, pressure=%.12g" % (quoted(self.body(b)), quoted(name), value))
                    times -= collections.Counter(list(times))
        return lines

    def volume_load(self, card, fields, label):
        """Gravity or a centrifugal load on whole bodies."""
        with located(card):
            elements = set(self.deck.members(self.deck.element_sets, fields[0]) if fields[0] else self.deck.elements)
        lines = []
        for b in range(self.deck.n_bodies):
            own = [e for e, c in self.deck.body_of.items() if c == b]
            inside = [e for e in own if e in elements]
            if not inside:
                continue
            materials = {self.section.get(e) for e in own}
            density = {self.density.get(m) for m in materials}
            if len(inside) < len(own) or None in density:
                self.leave(card.place, "%s on body %s: on a part of it, or materials without density" % (label, self.body(b)))
                continue
            values = [number(f) for f in fields[2:]]
            if label == "GRAV":
                direction = np.array(values[1:4])/np.linalg.norm(values[1:4])*values[0]
                lines.append("&load body=%s, acceleration=%s" % (quoted(self.body(b)), text_of(direction[:self.deck.dimension])))
                continue
            axis = np.array(values[4:7])/np.linalg.norm(values[4:7])*values[0]**0.5
            keys = "angular_velocity=%s, centre=%s" % (text_of(axis), text_of(values[1:4]))
            if self.deck.dimension == 2:
                keys = "angular_velocity=%.12g" % np.linalg.norm(axis)
                if self.deck.analysis != "axisymmetric":
                    keys += ", centre=" + text_of(values[1:3])
            lines.append("&load body=%s, %s" % (quoted(self.body(b)), keys))
        return lines

    def initial_temperatures(self):
        self.start = {}
        for card in self.of("initialconditions"):
            if card.get("type").lower() != "temperature":
                self.leave(card.place, "initial conditions of type %s" % card.get("type"))
                continue
            with located(card):
                for fields in card.data:
                    self.start.update(dict.fromkeys(self.nodes_of(fields[0]), number(fields[1])))

    def temperatures(self, step):
        """&temperature of bodies: one change of temperature, or the field of the deck above one initial temperature."""
        lines = []
        for b in range(self.deck.n_bodies):
            if not any(self.expansion.get(self.section.get(e)) for e, c in self.deck.body_of.items() if c == b):
                continue
            own = [n for n, c in self.deck.body_of_node.items() if c == b]
            change = {step.temperature.get(n, (self.start.get(n, 0.0),))[0] - self.start.get(n, 0.0) for n in own}
            start = {self.start.get(n, 0.0) for n in own}
            if len(change) == 1:
                if change != {0.0}:
                    lines.append("&temperature body=%s, value=%.12g" % (quoted(self.body(b)), change.pop()))
            elif len(start) == 1 and all(n in step.temperature or n in self.start for n in own):
                field = "temperature" + (" step %d" % step.number if step.number else "")
                lines.append("&temperature body=%s, field='%s', reference=%.12g" % (quoted(self.body(b)), field, start.pop()))
            else:
                places = dict.fromkeys(step.temperature[n][1] for n in own if n in step.temperature)
                self.leave(", ".join(places), "temperatures of body %s of which some nodes have none, or above initial temperatures that "
                           "differ: give a formula" % self.body(b))
        return lines
