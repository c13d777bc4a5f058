"""Step of Moreau–Jean time stepping for free bodies: cost proportional to the number of near contacts.

The equations of the step are those of :mod:`gauss.dynamics.contact.moreau_step`, the laws those of
:mod:`gauss.dynamics.contact.contact_step`. The scene has no machine code of its own: bodies, pairs of shapes, the contact
problem and the step as a whole (:mod:`gauss.codegen.kernels.free_body_step`) are kernels that all scenes share; Python
repeats the steps that machine code leaves. Contacts enter the problem if they may close within the step: twice the largest
speed before and after the step bounds how fast a gap closes; a step that exceeds the bound is repeated with a larger one.
"""

from functools import cache

import numpy as np

from gauss.codegen.kernels import BlockContactSolver, ContactGraph, NearPairs
from gauss.dynamics.contact.compiled_free_body_step import FreeBodyMemory, KnownContacts, compiled_free_body_step
from gauss.dynamics.contact.compiled_step_memory import LoopOfSteps
from gauss.dynamics.contact.contact_changes import ModeRecord, ModesOfStep, modes_of_contacts
from gauss.dynamics.contact.contact_step import LAW_TOLERANCE, ContactLaws, ContactProblem
from gauss.dynamics.contact.convex_relaxation import CONVEX_ERROR, relaxed_impulses
from gauss.dynamics.contact.free_bodies import constants, free_body_kernels
from gauss.dynamics.contact.gap_laws import REST_STEPS, gap_to_close, is_impact, least_rate
from gauss.dynamics.contact.impact import resting
from gauss.dynamics.contact.moreau_step import MIDPOINT
from gauss.dynamics.contact.near_detection import NearContacts, NearDetection, confirmed
from gauss.dynamics.contact.overlaps import START_OVERLAP, UNSEEN_OVERLAP, penetration_error
from gauss.dynamics.contact.paradox import Paradox, sliding_above
from gauss.dynamics.contact.position_projection import ACCEPTED_DEPTH, depth_after, without_penetration
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.dynamics.contact.step_parts import BegunStep, FreeBodyStep
from gauss.errors import SimulationError
from gauss.system import State, System

UNSOLVED = 1e-3  # error of the laws, relative: beyond it the convex relaxation is solved
REACH_MARGIN = 1.5  # of the distance that bodies approach within a step by their speeds before contact
DENSE_CONTACTS = 200  # contacts up to which the convex relaxation is that of one matrix; of more, W stays a sparse product
ATTEMPTS = 8  # steps with ever larger bounds of the speeds
# Of speed² over the least radius of a body: second derivatives of gaps are of that size, unless edges are nearly parallel.
# Those that bend a gap by more than the way of the fastest point are of steps in which bodies turn too far to be predicted.
MOST_CURVED = 4.0
TWIST = 8  # doubles of a row of velocities


class FreeBodyStepper:
    """Steps of one system of free bodies.

    Parameters
    ----------
    system : System
        Bodies on free joints from the ground, or fixed to it, without loads; contacts of shapes.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.
    """

    def __init__(self, system: System, removal: float = 0.0):
        self.system, self.kernels, self.removal = system, free_body_kernels(), removal
        self.table = ShapeTable(system)
        self.moving = [joint for joint in system.joints if joint.pair.n_v]
        Phi = system.Phi.reshape(-1, 6)
        self.child = np.array([joint.child for joint in self.moving])
        self.given = np.array([constants(joint, Phi[joint.child]) for joint in self.moving]).T.copy()
        self.q_places = np.array([np.arange(joint.q.start, joint.q.stop) for joint in self.moving]).T
        self.v_places = np.array([np.arange(joint.v.start, joint.v.stop) for joint in self.moving]).T
        self.n = len(self.moving)
        self.gravity = np.repeat(np.array(system.scene.gravity, dtype=float)[:, None], self.n, axis=1)
        self._index_bodies()
        code = NearPairs(compiled_free_body_step().code)
        self.detection = NearDetection(self.table, self.n + self.fixed.shape[1], system.scale.length, code)
        reach = np.zeros(self.n + self.fixed.shape[1])
        np.maximum.at(reach, self.table.body, self.table.length)
        self.reach = reach[: self.n]  # farthest point of the shapes of each moving body from its centre of mass [m]
        self.shares = (0.0,) if self.table.restitution.any() else (MIDPOINT, 0.0)
        self.coefficients = np.unique(self.table.restitution)
        self.elements = [contact.name for contact in self.table.contacts]
        self.first_set_valued, self.record = len(self.elements), ModeRecord(len(self.elements))
        self.graph: ContactGraph | None = None
        self.settings = {
            "margin": REACH_MARGIN,
            "unit": system.scale.length / system.scale.time,
            "tolerance": LAW_TOLERANCE,
            "unsolved": UNSOLVED,
            "removal": removal,
            "curved": MOST_CURVED / min(self.reach[self.reach > 0.0], default=np.inf),
            "accepted": np.inf if removal else ACCEPTED_DEPTH * system.scale.length,
        }
        self.memory = FreeBodyMemory(self)
        self.forget()

    def _index_bodies(self):
        """Columns of the bodies: moving ones in the order of their joints, then fixed ones, the ground last."""
        column = np.full(self.system.structure.n_bodies + 1, -1, dtype=np.int64)
        column[self.child] = np.arange(self.n)
        fixed = [joint for joint in self.system.joints if not joint.pair.n_v]
        self.fixed = np.zeros((24, len(fixed) + 1))
        for k, joint in enumerate(fixed):
            R = joint.R_parent @ joint.R_child.T
            self.fixed[:12, k] = np.concatenate([R.ravel(), joint.p_parent - R @ joint.p_child])
        self.fixed[:9, -1] = np.eye(3).ravel()
        places = {joint.child: self.n + k for k, joint in enumerate(fixed)}
        body = [places.get(b, column[b]) if b >= 0 else self.n + len(fixed) for b in self.table.body]
        self.table.body = np.array(body, dtype=np.int64)
        still = np.flatnonzero(self.table.body >= self.n)
        self.table.law[np.ix_(still, still)] = 0  # bodies that stand still need no forces between them

    inputs = np.zeros(0)
    asleep = np.zeros(0, dtype=np.int64)  # columns of bodies asleep, as of the stepper of all
    acceleration_error = 0.0  # accelerations of free bodies are Euler's equations themselves

    def check(self, state: State):
        """Nothing to check."""

    def projected(self, state: State) -> State:
        """State as it is: nothing closes loops."""
        return state

    def forget(self):
        """Forget the forces of the last step: a new motion begins."""
        self.detection.connect()
        self.known = KnownContacts(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((6, self.n)))
        self.record.forget()
        self.memory.connect()

    @property
    def known(self) -> KnownContacts:
        """Forces of the last step."""
        return self.memory.known

    @known.setter
    def known(self, found: KnownContacts):
        self.detection.expect(found.key.size)  # a new stepper that continues a motion has met no contacts yet
        self.memory = self.memory.fitting()
        self.memory.known = found

    def steps_from(self, begin: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> LoopOfSteps:
        """Steps by machine code, as of :meth:`gauss.dynamics.contact.compiled_step_memory.CompiledStepMemory.advance`."""
        self.memory = self.memory.fitting()
        if self.asleep.size:
            at, end = self.memory.at, 1 + self.system.n_q  # steps move the others alone
            at["end_q"][:], at["end_v"][:] = begin[1:end], begin[end:-3]
        return self.memory.advance(begin, ends, rows)

    def examined(self, state: State, h: float) -> list[Paradox]:
        """None: contacts of many free bodies are not examined for Painlevé's paradox."""
        return []

    def python_step(self, state: State, h: float) -> FreeBodyStep:
        """Step of length h; the forces of the last step are the initial guess.

        SimulationError if shapes overlap unseen by their gap functions, or no forces are found.
        """
        for share in self.shares:
            begun = self.begin(state, h, share)
            speed = max(self.speed(begun.both[..., k]) for k in range(2))
            near = self._near(state, begun, speed, h, share)
            known = rates(near, begun.both)
            if share == self.shares[-1] or not self._impacts(near, begun, known, h, share).any():
                break
        for _ in range(ATTEMPTS):
            force, added, error = self._solve(near, begun, known, h, share)
            after = begun.both[..., 1].copy()
            after[: self.n, :6] += added
            reached = self.speed(after)
            if reached <= REACH_MARGIN * speed:
                break
            speed = reached
            near = self._near(state, begun, speed, h, share)
            known = rates(near, begun.both)
        else:
            raise SimulationError(f"t = {state.t:.6g} s: contacts make bodies faster and faster; shorten the step.")
        self._keep(near, force, added.T / h if share else np.zeros((6, self.n)))
        found = state.q.copy(), state.v.copy()  # of bodies asleep, too
        change = (after - begun.both[..., 0])[: self.n, :6].T
        step = np.repeat([[h], [share]], self.n, axis=1)
        end = self.kernels.end(np.concatenate([begun.q, begun.v[self.v_places], self.given, change, step]))
        found[0][self.q_places], found[1][self.v_places] = end[:7], end[7:]
        reached_rates = rates(near, after[..., None])[..., 0]
        work = force * (known[..., 0] + reached_rates)
        modes = self._changed_modes(near, begun, known, force, reached_rates, work, h, share)
        hit = not share and bool(self._impacts(near, begun, known, h, share).any())
        depth = depth_after(near, reached_rates[:, 0], h * (1.0 - share), hit)
        if depth > self.settings["accepted"]:
            found = without_penetration(self, State(state.t + h, *found), h, depth), found[1]
        return FreeBodyStep(*found, near, force, np.array([0.0, 0.0, -0.5 * work.sum()]), error, [], modes)

    def _changed_modes(
        self, near, begun: BegunStep, known, force, reached, work, h: float, share: float
    ) -> ModesOfStep | None:
        """Contacts that bear a force in a step; None if their modes are those of the last step."""
        slow = sliding_above(self.system, begun.v)
        along = reached[:, 1:] + (h * (1.0 - share)) * near.bias[:, 1:]  # the velocities that the laws take
        modes = modes_of_contacts(self.table, near.law, force, np.hypot(*along.T), slow)
        if self.record.is_same(near.key, modes):
            return None
        pushed, hits = np.flatnonzero(modes), self._impacts(near, begun, known, h, share)
        return ModesOfStep(near.law[pushed], modes[pushed], hits[pushed] > 0.0, -0.5 * h * work[pushed].sum(axis=1))

    def begin(self, state: State, h: float, share: float) -> BegunStep:
        """Bodies after the share of a step of length h."""
        q, v = state.q[self.q_places], state.v[self.v_places]
        step = np.repeat([[h], [share]], self.n, axis=1)
        found = self.kernels.begin(np.concatenate([q, v, self.given, self.gravity, self.known.expected, step]))
        at, bodies, free, inertia = found[:7], found[7:31], found[31:37], found[37:]
        both = np.zeros((self.n + self.fixed.shape[1], TWIST, 2))
        both[: self.n, :6, 0] = bodies[12:18].T
        both[: self.n, :6, 1] = (bodies[12:18] + h * free).T
        mass = np.empty((self.n, 20))
        mass[:, :18], mass[:, 18], mass[:, 19] = inertia.T, self.given[27], 1.0 / self.given[27]
        return BegunStep(at, np.concatenate([bodies, self.fixed], axis=1), both, mass, state.v)

    def speed(self, twists: np.ndarray) -> float:
        """Largest speed of a point of a shape [m/s]."""
        turning, moving = (np.sqrt((part * part).sum(axis=1)) for part in (twists[: self.n, :3], twists[: self.n, 3:6]))
        return float((moving + turning * self.reach).max())

    def _near(self, state: State, begun: BegunStep, speed: float, h: float, share: float) -> NearContacts:
        """Contacts that may close within the rest of the step."""
        reach = 2.0 * REACH_MARGIN * (1.0 - share) * h * speed
        near, overlaps = self.detection.find(begun.bodies, reach, UNSEEN_OVERLAP)
        near = confirmed(near, overlaps, self.table, state.t)
        curved = np.abs(near.bias[:, 0])
        far = (curved > self.settings["curved"] * speed * speed) | (curved * (1.0 - share) * h > 2.0 * speed)
        near.bias[far, 0] = 0.0
        return near

    def _impacts(self, near: NearContacts, begun: BegunStep, known: np.ndarray, h: float, share: float) -> np.ndarray:
        before, after = known[:, 0].T
        speeds = REST_STEPS * np.abs(after - before + h * near.bias[:, 0]) + self._rest(begun)
        return is_impact(near.gap, before, speeds, h, share)

    def _rest(self, begun: BegunStep) -> float:
        """Rate below which a gap neither opens nor closes [m/s]."""
        return self.system.scale.length * resting(self.system, begun.v)

    def _solve(self, near: NearContacts, begun: BegunStep, known: np.ndarray, h: float, share: float):
        """Forces (m, 3), the velocities (n, 6) that they add, and the error of the laws."""
        m = near.gap.size
        if not m:
            return np.zeros((0, 3)), np.zeros((self.n, 6)), 0.0
        b = self.without_forces(near, begun, known, h, share)
        bodies = np.where(near.bodies < self.n, near.bodies, -1)
        if self.graph is None or not np.array_equal(self.graph.bodies, bodies):
            self.graph = block_contact_solver().graph(self.n, bodies)
        unit = self.settings["unit"]
        scale = unit + np.abs(b).max()
        start, friction = h * self._start(near), self.table.friction[near.law]
        f, added, (left, *_) = self.graph.solve(near.J, begun.mass, b, friction, start, LAW_TOLERANCE * scale)
        if left <= UNSOLVED * scale:
            return f / h, added, left / scale
        if m > DENSE_CONTACTS:
            other, pushed, error = relaxed_impulses(near.J, begun.mass, bodies, b / unit, friction, f / unit)
            if error * unit <= CONVEX_ERROR * scale:
                return other * unit / h, pushed * unit, None
            if error * unit < left:  # neither is found: the lesser error is told, and warned of at the end of the motion
                return other * unit / h, pushed * unit, error * unit / scale
            return f / h, added, left / scale
        f, added = self._dense(near, begun, bodies, b / unit, f / unit, friction)
        return f * unit / h, added * unit, None

    def pushed_apart(self, near: NearContacts, begun: BegunStep, b: np.ndarray) -> np.ndarray | None:
        """Velocities (n, 6) that contacts without friction add to relative velocities b (m, 3); None if none are found."""
        graph = block_contact_solver().graph(self.n, np.where(near.bodies < self.n, near.bodies, -1))
        scale, m = self.settings["unit"] + np.abs(b).max(), near.gap.size
        _, added, (left, *_) = graph.solve(near.J, begun.mass, b, np.zeros(m), np.zeros((m, 3)), LAW_TOLERANCE * scale)
        return added if left <= UNSOLVED * scale else None

    def without_forces(self, near: NearContacts, begun: BegunStep, known: np.ndarray, h: float, share: float) -> np.ndarray:
        """Relative velocities (m, 3) after a step without contact forces, less the least that gaps may have.

        Parameters
        ----------
        begun : BegunStep
            The bodies.
        known : ndarray, shape (m, 3, 2)
            Relative velocities before the step, and after it without contact forces [m/s].
        h, share : float
            Step [s], and the share of it that the bodies have moved.
        """
        time, before, rest = h * (1.0 - share), known[:, 0, 0], self._rest(begun)
        b, curved = known[..., 1] + time * near.bias, near.bias[:, 0]
        width = near.gap if self.removal else gap_to_close(near.gap, curved, time, np.inf)
        restitution, closed = self.table.restitution[near.law], self._start(near)[:, 0] * (self.removal > 0.0)
        for e in self.coefficients:
            mine = slice(None) if len(self.coefficients) == 1 else restitution == e
            given = h, rest, share, max(h, self.removal)
            b[mine, 0] -= least_rate(width[mine], before[mine], float(e), *given, closed[mine])
        return b

    def _dense(self, near: NearContacts, begun: BegunStep, bodies, b, f, friction):
        """Impulses of the problem in one matrix, by the convex relaxation where Coulomb's law has no solution."""
        m = near.gap.size
        rows, M = np.zeros((3 * m, 6 * self.n)), np.zeros((6 * self.n, 6 * self.n))
        for c, k in zip(*np.nonzero(bodies >= 0), strict=True):
            i = bodies[c, k]
            rows[[c, m + 2 * c, m + 2 * c + 1], 6 * i : 6 * i + 6] = near.J[c, k, :, :6]
        for i, own in enumerate(begun.mass):
            M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = own[9:18].reshape(3, 3)
            M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = own[19] * np.eye(3)
        across = np.arange(m, 3 * m).reshape(m, 2)
        laws = ContactLaws(np.arange(m), across, np.arange(m), friction, np.zeros(0, dtype=int), np.zeros(0))
        order = [np.concatenate([x[:, 0], x[:, 1:].ravel()]) for x in (b, f)]
        response = rows @ M
        found, _ = ContactProblem(response @ rows.T, order[0], laws).solve(order[1])
        return np.column_stack([found[:m], found[m:].reshape(m, 2)]), (found @ response).reshape(self.n, 6)

    def step_over(self, state: State, h: float) -> FreeBodyStep:
        """Step of length h in Python that expects its own forces."""
        self.known = self.known._replace(expected=np.zeros((6, self.n)))
        found = self.python_step(state, h)
        return self.python_step(state, h) if self.known.expected.any() else found

    def forces_over(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces over a step from a state that expects its own forces, as of :meth:`forces_of`."""
        return self.forces_of(self.step_over(state, h))

    def forces_of(self, step: FreeBodyStep) -> tuple[np.ndarray, np.ndarray]:
        """Forces of a step as normal forces (g,) of all gaps, and friction (g, 3) on the first bodies, world axes [N]."""
        near, places = step.contacts, self.table.gap_places(step.contacts.key)
        normal = np.zeros(self.table.gaps[-1])
        friction = np.zeros((normal.size, 3))
        normal[places] = step.force[:, 0]
        friction[places] = (step.force[:, 1:, None] * near.axes[:, 1:]).sum(axis=1) * self.table.sides(near.key)[:, None]
        return normal, friction

    def _start(self, near: NearContacts) -> np.ndarray:
        """Forces (m, 3) of the last step; zero of new contacts."""
        return near.known_forces(self.known.key, self.known.force)

    def _keep(self, near: NearContacts, force: np.ndarray, expected: np.ndarray):
        order = np.argsort(near.key)
        self.known = KnownContacts(near.key[order], force[order], expected)

    @property
    def gap_count(self) -> int:
        """Number of gap functions of the scene."""
        return int(self.table.gaps[-1])

    def gap_forces(self) -> np.ndarray:
        """Normal forces (g,) of all gaps in the last step [N]."""
        normal, (key, force, _) = np.zeros(self.gap_count), self.known
        normal[self.table.gap_places(key)] = force[:, 0]
        return normal

    def refuse_penetration(self, state: State, accepted: float = START_OVERLAP):
        """Raise a StateError for penetration at the start, deeper than accepted, relative to the scale of a gap."""
        near = self._near(state, self.begin(state, 0.0, 0.0), 0.0, 0.0, 0.0)
        worst = int(np.argmin(near.gap)) if near.gap.size else 0
        if near.gap.size and near.gap[worst] < -accepted * self.system.scale.length:
            raise penetration_error(state.t, -near.gap[worst], self.table.contacts[near.law[worst]].name)


def rates(near: NearContacts, twists: np.ndarray) -> np.ndarray:
    """Relative velocities (m, 3, k) of contacts by k sets of twists (n, 8, k) of the bodies."""
    found = near.J @ twists[near.bodies]
    return found[:, 0] + found[:, 1]


@cache
def block_contact_solver() -> BlockContactSolver:
    """Machine code of the contact problem: that of the step."""
    return BlockContactSolver(compiled_free_body_step().code)
