"""Dynamics of large parts with loops as calls of small functions, each traced once: the work grows with their number.

The tree answers to forces by the articulated-body recursion. The force of every closing row is carried inward along the
branches that it acts on; u, what a joint on the way feels of it, gives its share uᵀ D⁻¹ u of S = K M⁻¹ Kᵀ, so that only rows
that meet on a branch are tied in S. S, regularised, is factored block by block, LDLᵀ, loops of least degree first: where few
loops share a branch the factor has few blocks per loop.
"""

from collections.abc import Callable

import numpy as np

from gauss.codegen.kernels import BlockLDLT, CallRecorder, Operand
from gauss.dynamics.constrained_aba import MU
from gauss.dynamics.link_frames import joint_sides, link_frames
from gauss.dynamics.link_kernels import balance, carry, carry_row, eliminate_link, move_outward, pass_outward, place, pull
from gauss.dynamics.loop_kernels import STILL, LoopJointKind, cut_numbers
from gauss.dynamics.tree_recursion import link_numbers, link_of
from gauss.system import Subsystem

MOST_FORMS = 24  # of links, beyond which they are not told apart by the zeros among their numbers
GROUND = -1
DAMPED = float(np.sqrt(MU))  # regularisation of rows below which accelerations along them are not determined


class CallGraph:
    """A part with loops, its work written down section by section.

    Parameters
    ----------
    part : Subsystem
        One without couplings, relations and trains.
    cells : CallRecorder
        Where it is written down.
    q, v : ndarray
        Places of its coordinates and rates.
    """

    def __init__(self, part: Subsystem, cells: CallRecorder, q, v):
        self.subsystem, self.cells, self.q, self.v = part, cells, q, v
        self.edges, links = part.tree, link_frames(part)
        self.order = {edge.outer: place for place, edge in enumerate(self.edges)}
        self.inner = {edge.outer: edge.inner for edge in self.edges}
        self.joint = {edge.outer: part.joints[edge.constraint] for edge in self.edges}
        self.weight = np.concatenate([np.zeros(3), -np.asarray(part.gravity)])
        left_out: dict[int, list[int]] = {index: [] for index in range(len(part.joints))}
        for index, axis in part.redundant:
            left_out[index].append(axis)
        self.cuts = {index: LoopJointKind(part.joints[index], left_out[index]) for index in part.closing}
        self._tell_apart(links)
        self._factor()

    def _tell_apart(self, links):
        """Numbers of links and cuts; those that are the same in all of a kind are constants."""
        keys = {}
        for edge in self.edges:
            joint, numbers = self.joint[edge.outer], link_numbers(links[edge.outer])
            subspace = tuple(np.concatenate(joint.pair.subspace(np.array(joint.pair.reference))).ravel())
            keys[edge.outer] = (joint.pair.kind, subspace, edge.outer == joint.child), tuple(numbers == 0), numbers
        zeros = len({key[:2] for key in keys.values()}) <= MOST_FORMS
        kinds = list(dict.fromkeys(kind for kind, _, _ in keys.values()))
        self.kind = {body: kinds.index(kind) for body, (kind, _, _) in keys.items()}
        tables = {body: ((kind, pattern if zeros else ()), numbers) for body, (kind, pattern, numbers) in keys.items()}
        self.numbers = self._parameters(tables)
        found = {i: cut_numbers(self.subsystem, i, joint_sides(self.subsystem, links, i)) for i in self.cuts}
        keys = {i: cut.key() for i, cut in self.cuts.items()}
        kinds = list(dict.fromkeys(keys.values()))
        self.cut_kind = {i: kinds.index(key) for i, key in keys.items()}
        self.cut_numbers = self._parameters({i: ((keys[i], tuple(n == 0)), n) for i, n in found.items()})

    def _parameters(self, tables) -> dict:
        """Numbers of members of kinds, {member: (kind, numbers)}, those that vary within a kind as places."""
        members: dict = {}
        for member, (kind, _) in tables.items():
            members.setdefault(kind, []).append(member)
        found = {}
        for some in members.values():
            table = np.array([tables[member][1] for member in some])
            varying = np.flatnonzero((table != table[0]).any(axis=0))
            for member, row in zip(some, table, strict=True):
                entries = row.astype(object)
                entries[varying] = self.cells.keep(row[varying])
                found[member] = self.cells.block(entries)
        return found

    def _at_link(self, name: str, body: int, function: Callable, *arguments):
        """Call of a function (link, passage kind, …) for a link."""
        pair, forward = self.joint[body].pair, body == self.joint[body].child
        return self.cells.call(
            (name, self.kind[body]),
            lambda numbers, *rest: function(link_of(numbers), pair, forward, *rest),
            self.numbers[body],
            *arguments,
        )

    def _at_cut(self, name: str, index: int, function: Callable, *arguments):
        cut = self.cuts[index]
        return self.cells.call(
            (name, self.cut_kind[index]),
            lambda numbers, *rest: function(cut, numbers, *rest),
            self.cut_numbers[index],
            *arguments,
        )

    def _inward(self, name: str, body: int, function: Callable, *arguments):
        """The same where the last result is for the link on the inner side: the ground has no use for it."""
        if self.inner[body] >= 0:
            return self._at_link(name, body, function, *arguments)
        return *self._at_link(f"{name} root", body, lambda *given: function(*given)[:-1], *arguments), None

    def _own(self, vector, body: int):
        """Part of a vector of coordinates or rates that belongs to the joint of a link."""
        joint = self.joint[body]
        return vector[joint.q if vector is self.q else joint.v]

    # --- what depends on the state alone

    def _factor(self):
        self.cells.section("factor")
        self._passages()
        self._eliminate()
        self._cut()
        self._delassus()
        self.factors = {mu: BlockLDLT(self.cells, self.S, mu) for mu in (MU, DAMPED)}

    def _passages(self):
        self.omega, self.passage, self.bias, self.gyro = {GROUND: np.zeros(3)}, {}, {}, {}
        for edge in self.edges:
            body = edge.outer
            R, p, S, self.bias[body], self.omega[body], self.gyro[body] = self._at_link(
                "pass", body, pass_outward, self._own(self.q, body), self._own(self.v, body), self.omega[edge.inner]
            )
            self.passage[body] = R, p, S

    def _eliminate(self):
        collected = {body: np.zeros(21) for body in (GROUND, *self.order)}
        self.eliminated = {}
        for edge in reversed(self.edges):
            body, inner = edge.outer, edge.inner
            more = collected[inner]
            *found, moved = self._inward("eliminate", body, eliminate_link, *self.passage[body], collected[body], more)
            self.eliminated[body] = found
            if inner >= 0:
                collected[inner] = moved

    def _cut(self):
        self.held, self.free, self.scale = {}, {}, {}
        for index in self.cuts:
            joint = self.subsystem.joints[index]
            on_parent, on_child, free_parent, free_child, self.scale[index] = self._at_cut(
                "forces", index, LoopJointKind.forces, self.q[joint.q], self.v[joint.v]
            )
            self.held[index] = {joint.parent: on_parent, joint.child: on_child}
            self.free[index] = {joint.parent: free_parent, joint.child: free_child}

    def _delassus(self):
        """Blocks of S, of loops that meet at a joint."""
        feel: dict[int, list] = {body: [] for body in self.order}
        for index, pushes in self.held.items():
            waiting = {body: push for body, push in pushes.items() if body >= 0 and push.shape[1]}
            while waiting:
                body = max(waiting, key=self.order.__getitem__)
                across = *self.passage[body], *self.eliminated[body][:2]
                u, onward = self._inward("carry row", body, carry_row, *across, waiting.pop(body))
                feel[body].append((index, u))
                inner = self.inner[body]
                if inner >= 0:
                    waiting[inner] = self._sum(waiting[inner], onward) if inner in waiting else onward
        self.S: dict[tuple[int, int], np.ndarray] = {}
        for body, shares in feel.items():
            D_inverse = self.eliminated[body][1]
            for i, (one, u) in enumerate(shares):
                for other, w in shares[: i + 1]:
                    key, first, second = ((one, other), u, w) if one >= other else ((other, one), w, u)
                    known = self.S.get(key, np.zeros((first.shape[1], second.shape[1])))
                    (self.S[key],) = self.cells.call("gram", _gram, known, first, D_inverse, second)

    def _sum(self, one, other):
        return self.cells.call("sum", lambda a, b: (a + b,), one, other)[0]

    # --- what is asked of it then

    def multipliers(self, gap, mu: float = MU) -> np.ndarray:
        """Write (S + μ 1)⁻¹ gap, with scaled rows; μ is MU or DAMPED."""
        found = self.factors[mu].solve({i: part for i, part in self._rows_of(gap).items() if part.size})
        return self._joined(found[index] for index in self.cuts if index in found)

    def motion(self, effort, multipliers, still: bool) -> tuple[np.ndarray, np.ndarray]:
        """Write the accelerations of joints (n_v,) under forces, and what the scaled rows lack; still: forces alone."""
        nothing = np.zeros(6)
        forces = self._pushed({body: nothing if still else self.gyro[body] for body in self.order}, effort, multipliers)
        short = {}
        for edge in reversed(self.edges):
            body, inner = edge.outer, edge.inner
            bias = nothing if still else self.bias[body]
            more = forces[inner] if inner >= 0 else nothing
            across, driven = (*self.passage[body], *self.eliminated[body]), self._own(effort, body)
            short[body], onward = self._inward("pull", body, pull, *across, forces[body], bias, driven, more)
            if inner >= 0:
                forces[inner] = onward
        accelerations, rates = {GROUND: nothing if still else self.weight}, self._none()
        for edge in self.edges:
            body = edge.outer
            bias = nothing if still else self.bias[body]
            across, inner = (*self.passage[body], *self.eliminated[body][:2]), accelerations[edge.inner]
            own, accelerations[body] = self._at_link("carry", body, carry, *across, short[body], bias, inner)
            rates[self.joint[body].v] = self.cells.array(own)
        return rates, self._values(rates, accelerations, still)

    def residual(self, rates, multipliers, effort) -> tuple[np.ndarray, np.ndarray]:
        """Write what the equations of motion (n_v,), and the scaled rows, lack: by inverse dynamics."""
        accelerations = self._accelerations(rates, still=False)
        pushes = self._pushed({body: np.zeros(6) for body in self.order}, effort, multipliers)
        lacking = self._none()
        for edge in reversed(self.edges):
            body, inner = edge.outer, edge.inner
            place, more = self.joint[body].v, pushes[inner] if inner >= 0 else np.zeros(6)
            own, onward = self._inward(
                "balance",
                body,
                balance,
                *self.passage[body],
                self.omega[body],
                accelerations[body],
                pushes[body],
                effort[place],
                more,
            )
            lacking[place] = self.cells.array(own)
            if inner >= 0:
                pushes[inner] = onward
        return lacking, self._values(self._none(), accelerations, still=False)

    def slip(self) -> tuple[np.ndarray, np.ndarray]:
        """Write rates (n_v,), those of closing joints as they follow from the others, and by how much rows are missed."""
        rates = self._none()
        for joint in self.joint.values():
            rates[joint.v] = self.v[joint.v]
        return rates, self._values(rates, self._accelerations(self.v, still=True), still=True)

    def closure(self) -> tuple[np.ndarray, np.ndarray]:
        """Write the residual of the rows in position [rad, m], and what closing joints are off along free axes (n_v,)."""
        poses = {GROUND: STILL}
        for edge in self.edges:
            body = edge.outer
            (poses[body],) = self._at_link("pose", body, place, self._own(self.q, body), poses[edge.inner])
        gaps, off = {}, self._none()
        for index in self.cuts:
            joint = self.subsystem.joints[index]
            here = poses[joint.parent], poses[joint.child]
            gaps[index], along = self._at_cut("gap", index, LoopJointKind.gap, self.q[joint.q], *here)
            off[joint.v] = self.cells.array(along)
        return self._joined(gaps.values()), off

    @property
    def scales(self) -> np.ndarray:
        """What the rows are multiplied with."""
        return self._joined(self.scale.values())

    def _accelerations(self, rates, still: bool):
        nothing = np.zeros(6)
        found = {GROUND: nothing if still else self.weight}
        for edge in self.edges:
            body = edge.outer
            bias = nothing if still else self.bias[body]
            (found[body],) = self._at_link(
                "outward", body, move_outward, *self.passage[body], bias, rates[self.joint[body].v], found[edge.inner]
            )
        return found

    def _pushed(self, forces, effort, multipliers):
        """Force vectors that links need, with those of the multipliers, less those of efforts along closing joints."""
        parts = self._rows_of(multipliers)
        for index in self.cuts:
            for body, held in self.held[index].items():
                if body >= 0:
                    along = effort[self.subsystem.joints[index].v]
                    (forces[body],) = self.cells.call(
                        "push", _push, forces[body], held, parts[index], self.free[index][body], along
                    )
        return forces

    def _values(self, rates, accelerations, still: bool):
        """Write the left sides of the rows; rates of closing joints are added to ``rates``."""
        values, turning = [], {body: np.zeros(3) for body in self.omega} if still else self.omega
        for index in self.cuts:
            joint = self.subsystem.joints[index]
            ends = joint.parent, joint.child
            motions = *(turning[body] for body in ends), *(accelerations[body] for body in ends), accelerations[GROUND]
            function = _value_still if still else _value
            value, own = self._at_cut(
                f"value {still}", index, function, self.q[joint.q], self.v[joint.v], self.scale[index], *motions
            )
            rates[joint.v] = self.cells.array(own)
            values.append(value)
        return self._joined(values)

    def _joined(self, blocks) -> np.ndarray:
        """Object array of all entries of vectors."""
        return np.concatenate([np.zeros(0, dtype=object), *(self.cells.array(self._block(block)) for block in blocks)])

    def _block(self, vector):
        return vector if isinstance(vector, Operand) else self.cells.block(vector)

    def _rows_of(self, vector) -> dict[int, np.ndarray]:
        ends = np.cumsum([scale.shape[0] for scale in self.scale.values()], dtype=int)
        return {i: vector[end - scale.shape[0] : end] for (i, scale), end in zip(self.scale.items(), ends, strict=True)}

    def _none(self) -> np.ndarray:
        return np.zeros(self.subsystem.n_v).astype(object)


def _gram(known, one, D_inverse, other):
    return (known + one.T @ D_inverse @ other,)


def _push(force, held, multipliers, free, effort):
    return (force + held @ multipliers - free @ effort,)


def _value(cut: LoopJointKind, numbers, q, v, scale, *motions):
    return cut.value(numbers, q, v, scale, motions, still=False)


def _value_still(cut: LoopJointKind, numbers, q, v, scale, *motions):
    return cut.value(numbers, q, v, scale, motions, still=True)
