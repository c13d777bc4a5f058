"""Step of Moreau–Jean time stepping for mechanisms with many contacts: kernels of the mechanism, kernels of pairs of shapes.

    v₁ = v₀ + h (q̈_free + H Kᵀ f),   H = M⁻¹ (1 − Gᵀ (G M⁻¹ Gᵀ)⁺ G M⁻¹)

The equations of the step are those of :mod:`gauss.dynamics.contact.moreau_step`, the laws those of
:mod:`gauss.dynamics.contact.contact_step`. The scene's own machine code holds no contact
(:mod:`gauss.dynamics.contact.mechanism_kernels`); rows K exist for near contacts alone. G are the rows of loops.
"""

from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from gauss.codegen.kernels.mechanism_step import FINISHED, IMPACT
from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.constraint_scales import gap_scales, set_valued_scales
from gauss.dynamics.contact.compiled_mechanism_step import CompiledStepMemory
from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.contact.free_body_step import ATTEMPTS, REACH_MARGIN
from gauss.dynamics.contact.impact import jammed_error, resting
from gauss.dynamics.contact.mechanism_kernels import (
    MechanismTerms,
    is_coupled_tree,
    mechanism_kernels,
    other_gaps,
)
from gauss.dynamics.contact.moreau_step import (
    MIDPOINT,
    MISSED_CLOSING_RATE,
    REST_STEPS,
    START_OVERLAP,
    UNSEEN_OVERLAP,
    is_impact,
    least_rate,
)
from gauss.dynamics.contact.near_contacts import NearContacts, confirmed
from gauss.dynamics.contact.near_detection import NearDetection
from gauss.dynamics.contact.paradox import Paradox, sliding, sliding_above, undetermined_sliding
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, acceleration_scale, centrifugal_scale
from gauss.dynamics.inverse_dynamics_residual import inverse_dynamics_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.store import cached
from gauss.errors import SimulationError, StateError
from gauss.scene import JointDryFriction
from gauss.system import State, System, sides

REDUNDANT_LOOPS = 1e-10  # eigenvalue of the scaled G M⁻¹ Gᵀ, relative to the largest one: smaller ones are redundant rows
JAMMED_RESPONSE = 1e-12  # response along a contact, relative to that of single coordinates: loops forbid its motion


class MechanismStep(NamedTuple):
    """Result of one step.

    Attributes
    ----------
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates at its end.
    contacts : NearContacts or None
        Near contacts; None of a step by machine code.
    force : ndarray, shape (m, 3), or None
        Mean forces with impulses along their normals and tangents [N].
    others : ndarray, shape (g + s,), or None
        Those of other unilateral constraints, and of set-valued elements [N, N m].
    power : ndarray, shape (3,)
        Mean power of drives, of forces on bodies, and of dissipation [W].
    error : float or None
        Error of the laws in units of the scene; None for the convex relaxation.
    paradoxes : list of Paradox
        Contacts with undetermined forces.
    """

    q: np.ndarray
    v: np.ndarray
    contacts: NearContacts | None
    force: np.ndarray | None
    others: np.ndarray | None
    power: np.ndarray
    error: float | None
    paradoxes: list[Paradox]


class _FreeStep(NamedTuple):
    """Terms after the share of a step, compliance H, accelerations and power without contact forces."""

    q: np.ndarray
    terms: MechanismTerms
    H: np.ndarray
    acceleration: np.ndarray
    power: np.ndarray


class _StepRows(NamedTuple):
    """Rows of a step: normals of contacts, other gaps, tangents of rough contacts, set-valued elements.

    Gap functions, restitution of the gaps; Jacobian, rates before the step, biases of all rows, each in its unit.
    """

    gap: np.ndarray
    restitution: np.ndarray
    K: np.ndarray
    rate: np.ndarray
    bias: np.ndarray
    unit: np.ndarray
    rough: np.ndarray
    friction: np.ndarray


class MechanismStepper:
    """Steps of one system.

    Parameters
    ----------
    system : System
        A system with contacts of shapes, whose loads are traced.
    """

    def __init__(self, system: System):
        self.system, self.smooth, self.table = system, smooth_system(system), ShapeTable(system)
        carriers = tuple(sorted({int(body) for body in self.table.body if body >= 0}))
        self.kernels = mechanism_kernels(system, self.smooth, carriers)
        self.n = len(carriers)
        places = {body: k for k, body in enumerate(carriers)}
        self.table.body = np.array([places.get(int(body), self.n) for body in self.table.body], dtype=np.int64)
        self.detection = NearDetection(self.table, self.n + 1, system.scale.length)
        self.reach = np.zeros(self.n + 1)
        np.maximum.at(self.reach, self.table.body, self.table.length)
        self._index_others()
        coupled = is_coupled_tree(self.smooth)
        self.free_columns = _null_space(self.smooth) if coupled else None
        self.shares = (0.0,) if self.smooth.closes or self.restitution.any() else (MIDPOINT, 0.0)
        self.acceleration_error = 0.0
        single = self.free_columns is not None and (np.count_nonzero(self.free_columns, axis=1) <= 1).all()
        self.memory = CompiledStepMemory(self) if single else None
        self.forget()

    def _index_others(self):
        """Units, restitution and limits of what is no contact of shapes."""
        system, scene = self.system, self.system.scene
        others = {side.name for side in other_gaps(system)}
        gaps = sides(scene)
        mine = np.array([side.name in others for side in gaps], dtype=bool)
        self.others = [side for side in gaps if side.name in others]
        self.other_places = np.flatnonzero(mine)
        self.gap_count = len(gaps)
        scales = gap_scales(system)[mine] if mine.any() else np.zeros(0)
        time, length = system.scale.time, system.scale.length
        self.contact_unit, self.other_unit = time / length, time / scales
        self.set_unit = time / set_valued_scales(system)
        self.other_restitution = np.array([side.whole.restitution for side in self.others])
        self.restitution = np.concatenate([self.table.restitution, self.other_restitution])
        elements = cast(list[JointDryFriction], [*scene.set_valued.values()])  # others are refused
        self.coefficients = np.unique(self.restitution)
        self.limit = np.array([element.limit for element in elements]) / self.set_unit
        self.lossy = np.array([element.lossy for element in elements], dtype=bool)

    @cached_property
    def _loops(self) -> ForceResponses | None:
        """Engine that projects onto the loop constraints; None where couplings alone hold by themselves."""
        return None if self.free_columns is not None else ForceResponses(self.smooth)

    def projected(self, state: State) -> State:
        """State on the loop constraints."""
        return state if self._loops is None else self._loops.solver.project(self.smooth, state)

    def check(self, state: State):
        """Check the accelerations without contacts by inverse dynamics of the bodies of the scene.

        Raises
        ------
        SimulationError
            If they do not agree.
        """
        begun, system = self._begin(state, 0.0, 0.0), self.smooth
        motion, own = kinematics(system, state), 1.0 / system.scale.coordinates
        left = begun.H @ inverse_dynamics_residual(motion, Applied(motion), begun.acceleration)
        size = np.abs(begun.acceleration * own).max() + acceleration_scale(system) + centrifugal_scale(system, state.v)
        error = float(np.abs(left * own).max() / size)
        self.acceleration_error = max(self.acceleration_error, error)
        if not error <= ACCELERATION_TOLERANCE:
            raise SimulationError(
                f"t = {state.t:.6g} s: accelerations do not agree with inverse dynamics, by {error:.1e} relative; "
                "bodies of very different inertia, or a singular configuration."
            )

    def forget(self):
        """Forget the forces of the last step: a new motion begins."""
        self.detection.connect()
        self.known = np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(len(self.others) + self.limit.size)
        if self.memory is not None:
            self.memory.connect()

    @property
    def known(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces of the last step: keys of its contacts in order, forces (m, 3) of these, and of other constraints."""
        return self._known if self.memory is None else self.memory.known

    @known.setter
    def known(self, found: tuple[np.ndarray, np.ndarray, np.ndarray]):
        if self.memory is None:
            self._known = found
        else:
            self.memory.known = found

    def step(self, state: State, h: float) -> MechanismStep:
        """Step of length h; the forces of the last step are the initial guess.

        Raises
        ------
        SimulationError
            If shapes overlap unseen by their gap functions, or no forces are found.
        """
        rest = self.system.scale.time * resting(self.system, state.v)
        return self._compiled_step(state, h, rest) or self._python_step(state, h, rest)

    def _compiled_step(self, state: State, h: float, rest: float) -> MechanismStep | None:
        """The step by machine code; None where it is not finished."""
        memory = self.memory
        if memory is None:
            return None
        scale = self.system.scale
        settings = {
            "t": state.t,
            "h": h,
            "rest": rest,
            "slow": sliding_above(self.system, state.v) * scale.time / scale.length,
            "margin": REACH_MARGIN,
            "missed": MISSED_CLOSING_RATE,
            "jammed": JAMMED_RESPONSE,
            "contact_unit": self.contact_unit,
        }
        for share in self.shares:
            status = memory.step(state, settings | {"share": share})
            if status != IMPACT:
                break
        if status != FINISHED:
            return None
        *power, error, doubtful = memory.at["results"]
        paradoxes = self._examined(state, h, rest) if doubtful else []
        q, v = memory.at["end_q"].copy(), memory.at["end_v"].copy()
        return MechanismStep(q, v, None, None, None, np.array(power), error, paradoxes)

    def _examined(self, state: State, h: float, rest: float) -> list[Paradox]:
        """Painlevé's paradoxes of a step by machine code."""
        known = self.known
        found = self._python_step(state, h, rest).paradoxes
        self.known = known
        return found

    def _python_step(self, state: State, h: float, rest: float) -> MechanismStep:
        for share in self.shares:
            begun = self._begin(state, h, share)
            speed = max(self._speed(begun, state.v), self._speed(begun, state.v + h * begun.acceleration))
            near = self._near(state, begun, speed, h, share)
            rows = self._rows(begun.terms, near)
            if share == self.shares[-1] or not self._impacts(rows, begun, h, rest, share).any():
                break
        for _ in range(ATTEMPTS):
            force, added, error = self._solve(state, rows, begun, near, h, rest, share)
            acceleration = begun.acceleration + added
            reached = self._speed(begun, state.v + h * acceleration)
            if reached <= REACH_MARGIN * speed:
                break
            speed = reached
            near = self._near(state, begun, speed, h, share)
            rows = self._rows(begun.terms, near)
        else:
            raise SimulationError(f"t = {state.t:.6g} s: contacts make bodies faster and faster; shorten the step.")
        v = state.v + h * acceleration
        q = self.kernels.move(np.concatenate([begun.q, ((1.0 - share) * h) * v]))
        work = force * (rows.K @ (state.v + 0.5 * h * acceleration))
        lossy = np.ones(work.size, dtype=bool)
        lossy[work.size - self.lossy.size :] = self.lossy
        power = begun.power + np.array([work[~lossy].sum(), 0.0, -work[lossy].sum()])
        contacts, others = self._split(rows, near, force * rows.unit)
        self._keep(near, contacts, others)
        paradoxes = self._paradoxes(state, rows, begun, near, force)
        return MechanismStep(q, v, near, contacts, others, power, error, paradoxes)

    def _begin(self, state: State, h: float, share: float) -> _FreeStep:
        kernels, t = self.kernels, state.t + share * h
        q = kernels.move(np.concatenate([state.q, (share * h) * state.v])) if share else state.q
        terms = kernels.terms(t, q, state.v)
        H, offset = self._compliance(terms)
        acceleration, power = H @ terms.tau + offset, terms.power
        if share:
            ahead = kernels.forces(np.concatenate([[t], q, state.v + (share * h) * acceleration]))
            acceleration, power = H @ ahead[:-3] + offset, ahead[-3:]
        return _FreeStep(q, terms, H, acceleration, power)

    def _compliance(self, terms: MechanismTerms) -> tuple[np.ndarray, np.ndarray]:
        """Compliance H (n_v, n_v), and accelerations (n_v,) by the biases of loops."""
        M = terms.M
        if self.free_columns is not None:
            N = self.free_columns
            return N @ np.linalg.inv(N.T @ M @ N) @ N.T, np.zeros(len(M))
        tree = M.diagonal() > 0.0
        H = np.zeros_like(M)
        H[np.ix_(tree, tree)] = np.linalg.inv(M[np.ix_(tree, tree)])
        Y = H @ terms.G.T
        S = terms.G @ Y
        sizes = S.diagonal()
        scale = 1.0 / np.sqrt(np.maximum(sizes, REDUNDANT_LOOPS * sizes.max()))
        P = scale[:, None] * np.linalg.pinv(scale[:, None] * S * scale, rcond=REDUNDANT_LOOPS, hermitian=True) * scale
        return terms.B @ (H - Y @ P @ Y.T) @ terms.B.T, terms.B @ (Y @ (P @ terms.gamma)) + terms.beta

    def _speed(self, begun: _FreeStep, v: np.ndarray) -> float:
        """Largest speed of a point of a shape [m/s]."""
        if not self.n:
            return 0.0
        twists = begun.terms.J[: self.n] @ v
        turning, moving = (np.sqrt((part * part).sum(axis=1)) for part in (twists[:, :3], twists[:, 3:]))
        return float((moving + turning * self.reach[: self.n]).max())

    def _near(self, state: State, begun: _FreeStep, speed: float, h: float, share: float) -> NearContacts:
        """Contacts that may close within the rest of the step."""
        reach = 2.0 * REACH_MARGIN * (1.0 - share) * h * speed
        near, overlaps = self.detection.find(begun.terms.bodies, reach, UNSEEN_OVERLAP)
        return confirmed(near, overlaps, self.table, state.t)

    def _rows(self, terms: MechanismTerms, near: NearContacts) -> _StepRows:
        g, m = len(self.others), near.gap.size
        contacts = (near.J[..., :6] @ terms.J[near.bodies]).sum(axis=1)
        rates = (near.J[..., :6] @ terms.bodies[12:18].T[near.bodies][..., None]).sum(axis=1)[..., 0]
        rough = np.flatnonzero(self.table.friction[near.law])
        unit = np.full(m, self.contact_unit)
        units = np.concatenate([unit, self.other_unit, np.full(2 * rough.size, self.contact_unit), self.set_unit])

        def stacked(own, others):
            return np.concatenate([own[:, 0], others[:g], own[rough, 1:].reshape(-1, *own.shape[2:]), others[g:]])

        K = stacked(contacts, terms.K)
        return _StepRows(
            np.concatenate([near.gap, terms.gap]) * units[: m + g],
            np.concatenate([self.table.restitution[near.law], self.other_restitution]),
            K * units[:, None],
            stacked(rates, terms.rate) * units,
            stacked(near.bias, terms.bias) * units,
            units,
            rough,
            self.table.friction[near.law[rough]],
        )

    def _impacts(self, rows: _StepRows, begun: _FreeStep, h: float, rest: float, share: float) -> np.ndarray:
        m = rows.gap.size
        speeds = REST_STEPS * h * np.abs(rows.K[:m] @ begun.acceleration + rows.bias[:m]) + rest
        return is_impact(rows.gap, rows.rate[:m], speeds, h, share)

    def _solve(
        self, state: State, rows: _StepRows, begun: _FreeStep, near: NearContacts, h: float, rest: float, share: float
    ):
        """Forces (r,) in units of the rows, the accelerations (n_v,) that they add, and the error of the laws."""
        m, n = rows.gap.size, rows.rate.size
        if not n:
            return np.zeros(0), np.zeros(begun.acceleration.size), 0.0
        after = rows.rate + h * (rows.K @ begun.acceleration + (1.0 - share) * rows.bias)
        for e in self.coefficients:
            mine = slice(0, m) if len(self.coefficients) == 1 else np.flatnonzero(rows.restitution == e)
            after[mine] -= least_rate(rows.gap[mine], rows.rate[mine], float(e), h, rest, share)
        force, scale = self._start(near, rows), 1.0 + np.abs(rows.rate).max(initial=0.0)
        active = (after[:m] < 0.0) | (force[:m] > 0.0)
        responses = rows.K @ begun.H
        while True:
            which, laws = self._laws(rows, active)
            W = h * rows.K[which] @ responses[which].T
            found, error = ContactProblem(0.5 * (W + W.T), after[which], laws).solve(force[which])
            added = found @ responses[which]
            missed = ~active & ((after + h * (rows.K @ added))[:m] < -MISSED_CLOSING_RATE * scale)
            force = np.zeros(n)
            force[which] = found
            if not missed.any():
                break
            active = active | missed
        self._refuse_jam(state, rows, begun, near, force, after)
        return force, added, error

    def _laws(self, rows: _StepRows, active: np.ndarray) -> tuple[np.ndarray, ContactLaws]:
        """Active rows, and their laws."""
        m, count = active.size, int(active.sum())
        order = np.cumsum(active) - 1
        kept = np.flatnonzero(active[rows.rough])
        across = (m + 2 * kept[:, None] + np.arange(2)).ravel()
        s = self.limit.size
        which = np.concatenate([np.flatnonzero(active), across, np.arange(rows.rate.size - s, rows.rate.size)])
        places = count + np.arange(across.size).reshape(-1, 2)
        last = count + across.size + np.arange(s)
        laws = ContactLaws(np.arange(count), places, order[rows.rough[kept]], rows.friction[kept], last, self.limit)
        return which, laws

    def _refuse_jam(self, state: State, rows: _StepRows, begun: _FreeStep, near: NearContacts, force, after):
        """Raise a SimulationError if normal forces move nothing, because the loop constraints forbid it."""
        if not self.smooth.closes:
            return
        m = rows.gap.size
        pushed = np.flatnonzero(force[:m])
        K, inertia = rows.K[pushed], begun.terms.M.diagonal()
        alone = K**2 @ np.where(inertia > 0.0, 1.0 / np.where(inertia > 0.0, inertia, 1.0), 0.0)
        held = pushed[((K @ begun.H) * K).sum(axis=1) <= JAMMED_RESPONSE * alone]
        if held.size:
            names = [self._name(near, int(k)) for k in held]
            raise jammed_error(f"t = {state.t:.6g} s", names, float((-after / rows.unit)[held].max()))

    def _paradoxes(self, state: State, rows: _StepRows, begun: _FreeStep, near: NearContacts, force) -> list[Paradox]:
        """Painlevé's paradoxes of the closed contacts."""
        if not rows.rough.size:
            return []
        m, length, time = rows.gap.size, self.system.scale.length, self.system.scale.time
        slow = sliding_above(self.system, state.v) * time / length
        across = m + np.arange(2 * rows.rough.size).reshape(-1, 2)
        which = sliding(rows.rate[across], force[rows.rough] > 0.0, slow)
        if not which.size:
            return []
        normal, across = rows.rough[which], across[which]
        responses = rows.K[normal] @ begun.H
        smooth, sideways = responses @ rows.K[normal].T, (responses @ rows.K[across.ravel()].T).reshape(which.size, -1, 2)
        b = rows.K[normal] @ begun.acceleration + rows.bias[normal]
        names = [self._name(near, int(row)) for row in normal]
        return undetermined_sliding(names, rows.friction[which], rows.rate[across], smooth, sideways, b)

    def _name(self, near: NearContacts, row: int) -> str:
        """Name of the gap of a row."""
        m = near.gap.size
        return self.table.contacts[near.law[row]].name if row < m else self.others[row - m].name

    def _split(self, rows: _StepRows, near: NearContacts, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (m, 3) of contacts, and (g + s,) of other constraints."""
        m, g, end = near.gap.size, len(self.others), force.size - self.limit.size
        contacts = np.zeros((m, 3))
        contacts[:, 0] = force[:m]
        contacts[rows.rough, 1:] = force[m + g : end].reshape(-1, 2)
        return contacts, np.concatenate([force[m : m + g], force[end:]])

    def _start(self, near: NearContacts, rows: _StepRows) -> np.ndarray:
        """Forces (r,) of the last step in units of the rows; zero of new contacts."""
        keys, forces, others = self.known
        found, g = np.zeros((near.gap.size, 3)), len(self.others)
        if keys.size:
            places = np.minimum(np.searchsorted(keys, near.key), keys.size - 1)
            same = keys[places] == near.key
            found[same] = forces[places[same]]
        return np.concatenate([found[:, 0], others[:g], found[rows.rough, 1:].ravel(), others[g:]]) / rows.unit

    def _keep(self, near: NearContacts, force: np.ndarray, others: np.ndarray):
        order = np.argsort(near.key)
        self.known = near.key[order], force[order], others

    def forces_over(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces over a step from a state, as of :meth:`forces_of`."""
        return self.forces_of(self._python_step(state, h, self.system.scale.time * resting(self.system, state.v)))

    def forces_of(self, step: MechanismStep) -> tuple[np.ndarray, np.ndarray]:
        """Forces of a step as normal forces (g,) of all gaps, and friction (g, 3) on the first bodies, world axes [N]."""
        normal, friction = np.zeros(self.gap_count), np.zeros((self.gap_count, 3))
        near, force, others = step.contacts, step.force, step.others
        assert near is not None and force is not None and others is not None  # a step by Python
        own = np.setdiff1d(np.arange(self.gap_count), self.other_places)
        normal[self.other_places] = others[: len(self.others)]
        if near.gap.size:
            places = own[self.table.gap_places(near.key)]
            normal[places] = force[:, 0]
            across = (force[:, 1:, None] * near.axes[:, 1:]).sum(axis=1)
            friction[places] = across * self.table.sides(near.key)[:, None]
        return normal, friction

    def refuse_penetration(self, state: State):
        """Raise a StateError for penetration at the start, which a step would remove with the speed d/h."""
        begun = self._begin(state, 0.0, 0.0)
        near = self._near(state, begun, 0.0, 0.0, 0.0)
        depth = -np.concatenate([near.gap * self.contact_unit, begun.terms.gap * self.other_unit]) / self.system.scale.time
        worst = int(np.argmax(depth)) if depth.size else 0
        if depth.size and not depth[worst] <= START_OVERLAP:
            inside = -np.concatenate([near.gap, begun.terms.gap])[worst]
            raise StateError(
                f"t = {state.t:.6g} s: {inside:.3g} [m, rad] inside of {self._name(near, worst)!r}; "
                "move it out with scene.start."
            )


def _null_space(system: System) -> np.ndarray:
    """Rates (n_v, k) of independent coordinates: v = N ẏ for the couplings of a tree."""
    ratios = np.eye(system.n_v)
    dependent = set[int]()
    for coupling in system.scene.couplings.values():
        driven, driver = system.column(coupling.driven), system.column(coupling.driver)
        row = ratios[driven] - coupling.ratio * ratios[driver]
        if not np.abs(row).max():
            continue
        pivot = int(np.argmax(np.abs(row) * (np.arange(row.size) == driven) * 2.0 + np.abs(row)))
        ratios = ratios - np.outer(ratios[:, pivot], row) / row[pivot]
        dependent.add(pivot)
    return ratios[:, [k for k in range(system.n_v) if k not in dependent]]


def mechanism_stepper(system: System) -> MechanismStepper:
    """Stepper of a system, made once."""
    return cached(system, (MechanismStepper,), lambda: MechanismStepper(system))
