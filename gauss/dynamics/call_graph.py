"""Constrained articulated-body dynamics of large subsystems as a call graph of kernels: S = K M⁻¹ Kᵀ = Σ_joints uᵀ D⁻¹ u.

Kernels of links and loops are traced once for each kind; the work grows with their number. The unit wrench of every row is
carried inward along its branches, and u is its force on a joint of the branch: rows of loops that share no branch are
uncoupled in S. The unit forces of couplings act along joints, and are carried inward likewise. S + μ is factored block by
block, LDLᵀ, loops of least degree first: where few loops share a branch the factor has few blocks per loop. Where all loops
are coupled, as of platforms on each other, each is eliminated at its root (:mod:`gauss.dynamics.loop_fronts`).
"""

from collections.abc import Callable

import numpy as np

from gauss.backends.structure import GROUND
from gauss.codegen.kernels import CallRecorder, Operand
from gauss.dynamics.constrained_aba import MU
from gauss.dynamics.coupling_calls import CouplingCalls
from gauss.dynamics.link_frames import joint_sides, link_frames
from gauss.dynamics.link_kernels import (
    GROUND_POSE,
    LoopJointKind,
    acceleration,
    eliminate_link,
    force,
    forward_kinematics,
    link_acceleration,
    loop_joint_numbers,
    pose,
    residual_force,
)
from gauss.dynamics.loop_fronts import LoopFronts
from gauss.dynamics.tree_recursion import link_numbers, link_of
from gauss.system import Subsystem
from gauss.system.elimination_cost import elimination_roots, path_to_ground

MOST_LINK_KINDS = 24  # beyond, links are not distinguished by the zeros among their constants
DAMPED = float(np.sqrt(MU))  # regularisation: along rows with smaller pivots accelerations are undetermined


class CallGraph:
    """A subsystem with loops, recorded section by section.

    ``subsystem``: one without relations and gear trains. ``q``, ``v``: slots of its coordinates and rates.
    """

    def __init__(self, subsystem: Subsystem, recorder: CallRecorder, q, v):
        self.subsystem, self.recorder, self.q, self.v = subsystem, recorder, q, v
        self.edges, links = subsystem.tree, link_frames(subsystem)
        self.order = {edge.outer: place for place, edge in enumerate(self.edges)}
        self.inner = {edge.outer: edge.inner for edge in self.edges}
        self.joint = {edge.outer: subsystem.joints[edge.constraint] for edge in self.edges}
        self.weight = np.concatenate([np.zeros(3), -np.asarray(subsystem.gravity)])
        left_out: dict[int, list[int]] = {index: [] for index in range(len(subsystem.joints))}
        for index, axis in subsystem.redundant:
            left_out[index].append(axis)
        self.loops = {index: LoopJointKind(subsystem.joints[index], left_out[index]) for index in subsystem.loop_joints}
        self.couplings = CouplingCalls(subsystem, recorder)
        self._classify(links)
        self._factor()

    def _classify(self, links):
        """Kinds of links and loop joints; numbers that all of a kind share are constants."""
        keys = {}
        for edge in self.edges:
            joint, numbers = self.joint[edge.outer], link_numbers(links[edge.outer])
            subspace = tuple(np.concatenate(joint.pair.subspace(np.array(joint.pair.reference))).ravel())
            keys[edge.outer] = (joint.pair.kind, subspace, edge.outer == joint.child), tuple(numbers == 0), numbers
        zeros = len({key[:2] for key in keys.values()}) <= MOST_LINK_KINDS
        kinds = list(dict.fromkeys(kind for kind, _, _ in keys.values()))
        self.kind = {body: kinds.index(kind) for body, (kind, _, _) in keys.items()}
        tables = {body: ((kind, pattern if zeros else ()), numbers) for body, (kind, pattern, numbers) in keys.items()}
        self.numbers = self._parameters(tables)
        found = {i: loop_joint_numbers(self.subsystem, i, joint_sides(self.subsystem, links, i)) for i in self.loops}
        loop_keys = {i: loop.key() for i, loop in self.loops.items()}
        loop_kinds = list(dict.fromkeys(loop_keys.values()))
        self.loop_kind = {i: loop_kinds.index(key) for i, key in loop_keys.items()}
        self.loop_numbers = self._parameters({i: ((loop_keys[i], tuple(n == 0)), n) for i, n in found.items()})

    def _parameters(self, tables) -> dict:
        """Numbers of members of kinds, {member: (kind, numbers)}, with slots for those that vary within a kind."""
        members: dict = {}
        for member, (kind, _) in tables.items():
            members.setdefault(kind, []).append(member)
        found = {}
        for some in members.values():
            table = np.array([tables[member][1] for member in some])
            varying = np.flatnonzero((table != table[0]).any(axis=0))
            for member, row in zip(some, table, strict=True):
                entries = row.astype(object)
                entries[varying] = self.recorder.keep(row[varying])
                found[member] = self.recorder.operand(entries)
        return found

    def at_link(self, name: str, body: int, function: Callable, *arguments):
        """Call of a kernel (link, pair, forward, …) at a link."""
        pair, forward = self.joint[body].pair, body == self.joint[body].child
        return self.recorder.call(
            (name, self.kind[body]),
            lambda numbers, *rest: function(link_of(numbers), pair, forward, *rest),
            self.numbers[body],
            *arguments,
        )

    def _at_loop(self, name: str, index: int, function: Callable, *arguments):
        loop = self.loops[index]
        return self.recorder.call(
            (name, self.loop_kind[index]),
            lambda numbers, *rest: function(loop, numbers, *rest),
            self.loop_numbers[index],
            *arguments,
        )

    def inward(self, name: str, body: int, function: Callable, *arguments):
        """The same where the last result is for the inner link; at the root it is left out."""
        if self.inner[body] >= 0:
            return self.at_link(name, body, function, *arguments)
        return *self.at_link(f"{name} root", body, lambda *given: function(*given)[:-1], *arguments), None

    def _own(self, vector, body: int):
        """Part of a vector of coordinates or rates that belongs to the joint of a link."""
        joint = self.joint[body]
        return vector[joint.q if vector is self.q else joint.v]

    # --- functions of the state alone

    def _factor(self):
        self.recorder.section("factor")
        self._kinematics()
        self._eliminate()
        self._loop_wrenches()
        self.factors = {MU: LoopFronts(self, MU, dict(zip(self.rows, elimination_roots(self.subsystem), strict=True)))}

    def _kinematics(self):
        self.omega, self.kinematics, self.bias, self.gyro = {GROUND: np.zeros(3)}, {}, {}, {}
        for edge in self.edges:
            body = edge.outer
            R, p, S, self.bias[body], self.omega[body], self.gyro[body] = self.at_link(
                "pass", body, forward_kinematics, self._own(self.q, body), self._own(self.v, body), self.omega[edge.inner]
            )
            self.kinematics[body] = R, p, S

    def _eliminate(self):
        self.collected = collected = {body: np.zeros(21) for body in (GROUND, *self.order)}  # inertia of links beyond
        self.eliminated = {}
        for edge in reversed(self.edges):
            body, inner = edge.outer, edge.inner
            more = collected[inner]
            *found, moved = self.inward("eliminate", body, eliminate_link, *self.kinematics[body], collected[body], more)
            self.eliminated[body] = found
            if inner >= 0:
                collected[inner] = moved

    def _loop_wrenches(self):
        self.held, self.free, self.scale = {}, {}, {}
        for index in self.loops:
            joint = self.subsystem.joints[index]
            on_parent, on_child, free_parent, free_child, self.scale[index] = self._at_loop(
                "forces", index, LoopJointKind.forces, self.q[joint.q], self.v[joint.v]
            )
            self.held[index] = {joint.parent: on_parent, joint.child: on_child}
            self.free[index] = {joint.parent: free_parent, joint.child: free_child}
        sizes = [scale.shape[0] for scale in self.scale.values()]
        ends = np.cumsum([0, *sizes], dtype=int)
        self.rows = {i: np.arange(end - m, end) for i, m, end in zip(self.loops, sizes, ends[1:], strict=True)}
        self.rows |= {block: ends[-1] + members for block, members in self.couplings.members.items()}
        self.scale |= self.couplings.scale

    def unit_forces(self):
        """Unit wrenches (6, m) on links, and unit forces along joints of the tree, {body: (1, m)}, of each block of rows."""
        for index, wrenches in self.held.items():
            yield index, wrenches, {}
        outer = {edge.constraint: edge.outer for edge in self.edges}
        for block, along in self.couplings.unit_forces.items():
            wrenches, forces = {}, {outer[joint]: own for joint, own in along.items() if joint in outer}
            for joint in along.keys() - outer.keys():
                for body, free in self.free[joint].items():
                    (more,) = self.recorder.call("along loop joint", lambda free, own: (free @ own,), free, along[joint])
                    wrenches[body] = self.sum(wrenches[body], more) if body in wrenches else more
            none = self.couplings.no_wrenches[len(self.couplings.members[block])]
            yield block, {body: none for body in forces} | wrenches, forces

    def path(self, body: int) -> list[int]:
        """Links from one to the ground."""
        return path_to_ground(body, self.inner)

    def sum(self, one, other) -> Operand:
        """Record the sum of two arrays."""
        return self.recorder.call("sum", lambda a, b: (a + b,), one, other)[0]

    # --- sections evaluated on the factorisation

    def factor_damped(self):
        """Record the factorisation of S + DAMPED, which only checks need."""
        self.factors[DAMPED] = self.factors[MU].damped(DAMPED)

    def multipliers(self, residual, mu: float = MU) -> np.ndarray:
        """Record (S + μ 1)⁻¹ residual, with scaled rows; μ is MU, or that of :meth:`factor_damped`."""
        return self.joined(self.factors[mu].solve({i: part for i, part in self.rows_of(residual).items() if part.size}))

    def motion(self, tau, multipliers, still: bool) -> tuple[np.ndarray, np.ndarray]:
        """Record joint accelerations (n_v,) under forces, and the residual of the scaled rows; still: by forces alone."""
        nothing, tau = np.zeros(6), self.couplings.less_forces(tau, self.rows_of(multipliers))
        forces = self._with_loop_forces(
            {body: nothing if still else self.gyro[body] for body in self.order}, tau, multipliers
        )
        u = {}
        for edge in reversed(self.edges):
            body, inner = edge.outer, edge.inner
            bias = nothing if still else self.bias[body]
            more = forces[inner] if inner >= 0 else nothing
            across, driven = (*self.kinematics[body], *self.eliminated[body]), self._own(tau, body)
            u[body], onward = self.inward("pull", body, force, *across, forces[body], bias, driven, more)
            if inner >= 0:
                forces[inner] = onward
        accelerations, rates = {GROUND: nothing if still else self.weight}, self._none()
        for edge in self.edges:
            body = edge.outer
            bias = nothing if still else self.bias[body]
            across, before = (*self.kinematics[body], *self.eliminated[body][:2]), accelerations[edge.inner]
            own, accelerations[body] = self.at_link("carry", body, acceleration, *across, u[body], bias, before)
            rates[self.joint[body].v] = self.recorder.array(own)
        return rates, self._values(rates, accelerations, still)

    def residual(self, rates, multipliers, tau) -> tuple[np.ndarray, np.ndarray]:
        """Record the residuals of the equations of motion (n_v,), by inverse dynamics, and of the scaled rows."""
        accelerations = self._accelerations(rates, still=False)
        tau = self.couplings.less_forces(tau, self.rows_of(multipliers))
        forces = self._with_loop_forces({body: np.zeros(6) for body in self.order}, tau, multipliers)
        residual = self._none()
        for edge in reversed(self.edges):
            body, inner = edge.outer, edge.inner
            place, more = self.joint[body].v, forces[inner] if inner >= 0 else np.zeros(6)
            own, onward = self.inward(
                "balance",
                body,
                residual_force,
                *self.kinematics[body],
                self.omega[body],
                accelerations[body],
                forces[body],
                tau[place],
                more,
            )
            residual[place] = self.recorder.array(own)
            if inner >= 0:
                forces[inner] = onward
        return residual, self._values(self._along_tree(rates), accelerations, still=False)

    def velocity_residual(self) -> tuple[np.ndarray, np.ndarray]:
        """Record rates (n_v,) with dependent ones of loop joints, and the velocity residual of the scaled rows."""
        rates = self._along_tree(self.v)
        return rates, self._values(rates, self._accelerations(self.v, still=True), still=True)

    def loop_residual(self) -> tuple[np.ndarray, np.ndarray]:
        """Record the position residual of the rows [rad, m], and the errors of the coordinates of loop joints (n_v,)."""
        poses = {GROUND: GROUND_POSE}
        for edge in self.edges:
            body = edge.outer
            (poses[body],) = self.at_link("pose", body, pose, self._own(self.q, body), poses[edge.inner])
        residuals, off = self.couplings.position_residuals(self.q), self._none()
        for index in self.loops:
            joint = self.subsystem.joints[index]
            here = poses[joint.parent], poses[joint.child]
            residuals[index], along = self._at_loop("gap", index, LoopJointKind.position_residual, self.q[joint.q], *here)
            off[joint.v] = self.recorder.array(along)
        return self.joined(residuals), off

    @property
    def scales(self) -> np.ndarray:
        """Factors of the rows."""
        return self.joined(self.scale)

    def _accelerations(self, rates, still: bool):
        nothing = np.zeros(6)
        found = {GROUND: nothing if still else self.weight}
        for edge in self.edges:
            body = edge.outer
            bias = nothing if still else self.bias[body]
            (found[body],) = self.at_link(
                "outward",
                body,
                link_acceleration,
                *self.kinematics[body],
                bias,
                rates[self.joint[body].v],
                found[edge.inner],
            )
        return found

    def _with_loop_forces(self, forces, tau, multipliers):
        """Forces on links, plus those of the multipliers, less generalised forces along loop joints."""
        parts = self.rows_of(multipliers)
        for index in self.loops:
            for body, held in self.held[index].items():
                if body >= 0:
                    along = tau[self.subsystem.joints[index].v]
                    given = forces[body], held, parts[index], self.free[index][body], along
                    (forces[body],) = self.recorder.call("push", lambda f, A, y, B, tau: (f + A @ y - B @ tau,), *given)
        return forces

    def _values(self, rates, accelerations, still: bool):
        """Record the left sides of the rows; rates of loop joints are added to ``rates``."""
        value = lambda loop, numbers, q, v, scale, *given: loop.value(numbers, q, v, scale, given, still)  # noqa: E731
        values, turning = {}, {body: np.zeros(3) for body in self.omega} if still else self.omega
        for index in self.loops:
            joint = self.subsystem.joints[index]
            ends = joint.parent, joint.child
            motions = *(turning[body] for body in ends), *(accelerations[body] for body in ends), accelerations[GROUND]
            values[index], own = self._at_loop(
                f"value {still}", index, value, self.q[joint.q], self.v[joint.v], self.scale[index], *motions
            )
            rates[joint.v] = self.recorder.array(own)
        return self.joined(values | self.couplings.values(rates))

    def joined(self, blocks: dict) -> np.ndarray:
        """Object array (m,) of all rows, given by blocks."""
        found = np.zeros(sum(map(len, self.rows.values()))).astype(object)
        for index, block in blocks.items():
            operand = block if isinstance(block, Operand) else self.recorder.operand(block)
            found[self.rows[index]] = self.recorder.array(operand)
        return found

    def rows_of(self, vector) -> dict[int, np.ndarray]:
        """Parts of a vector of all rows, by block."""
        return {index: vector[rows] for index, rows in self.rows.items()}

    def _along_tree(self, rates) -> np.ndarray:
        """Rates (n_v,) of joints of the tree alone."""
        found = self._none()
        for joint in self.joint.values():
            found[joint.v] = rates[joint.v]
        return found

    def _none(self) -> np.ndarray:
        return np.zeros(self.subsystem.n_v).astype(object)
