"""Step of Moreau–Jean time stepping for mechanisms with many contacts: kernels of the mechanism, kernels of pairs of shapes.

    v₁ = v₀ + h (q̈_free + H Kᵀ f),   H = M⁻¹ (1 − Gᵀ (G M⁻¹ Gᵀ)⁺ G M⁻¹)

The equations of the step are those of :mod:`gauss.dynamics.contact.moreau_step`, the laws those of
:mod:`gauss.dynamics.contact.contact_step`. The scene's own machine code holds no contact
(:mod:`gauss.dynamics.contact.mechanism_kernels`); rows K exist for near contacts alone. G are the rows of loops.
"""

from functools import cached_property, partial

import numpy as np

from gauss.codegen.kernels import NearPairs
from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.contact.compiled_mechanism_step import KnownForces, MechanismMemory, compiled_mechanism_step
from gauss.dynamics.contact.compiled_step_memory import LoopOfSteps
from gauss.dynamics.contact.contact_changes import ModeRecord
from gauss.dynamics.contact.contact_step import ContactProblem
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.contact.free_body_step import ATTEMPTS, REACH_MARGIN
from gauss.dynamics.contact.gap_laws import REST_STEPS, gap_to_close, is_impact, least_rate
from gauss.dynamics.contact.impact import resting
from gauss.dynamics.contact.implicit_damping import ImplicitDamping
from gauss.dynamics.contact.mechanism_compliance import Compliance
from gauss.dynamics.contact.mechanism_kernels import mechanism_kernels
from gauss.dynamics.contact.mechanism_rows import MechanismRows, StepRows
from gauss.dynamics.contact.moreau_step import MIDPOINT, MISSED_CLOSING_RATE
from gauss.dynamics.contact.near_detection import NearContacts, NearDetection, confirmed, near_pairs
from gauss.dynamics.contact.overlaps import START_OVERLAP, UNSEEN_OVERLAP, penetration_error
from gauss.dynamics.contact.paradox import Paradox, sliding_above
from gauss.dynamics.contact.shape_table import ShapeTable, carriers_of
from gauss.dynamics.contact.step_doubts import JAMMED_RESPONSE, paradoxes_of_step, refuse_jam
from gauss.dynamics.contact.step_parts import FreeStep, MechanismStep, OpenStep
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, acceleration_scale, centrifugal_scale
from gauss.dynamics.inputs import InputForces
from gauss.dynamics.inverse_dynamics_residual import inverse_dynamics_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SimulationError
from gauss.system import State, System


class MechanismStepper:
    """Steps of one system.

    Parameters
    ----------
    system : System
        A system with contacts of shapes.
    held : bool
        Whether the inputs of the scene are held in each step; otherwise they are zero.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.

    Attributes
    ----------
    inputs : ndarray, shape (n_u,)
        Values of the inputs in the next step.
    asleep : ndarray of bool, shape (k + 1,)
        Which bodies that carry shapes sleep: the contacts of a step must not push them.
    """

    def __init__(self, system: System, held: bool = False, removal: float = 0.0):
        self.system, self.smooth, self.table = system, smooth_system(system), ShapeTable(system)
        self.removal = removal
        carriers = carriers_of(system)
        self.carriers, self.held = carriers, held
        self.kernels = mechanism_kernels(system, self.smooth, carriers, held)
        self.inputs = np.zeros(len(system.scene.inputs) if held else 0)
        self.n = len(carriers)
        self.asleep = np.zeros(self.n + 1, dtype=bool)
        places = {body: k for k, body in enumerate(carriers)}
        self.table.body = np.array([places.get(int(body), self.n) for body in self.table.body], dtype=np.int64)
        self.reach = np.zeros(self.n + 1)
        np.maximum.at(self.reach, self.table.body, self.table.length)
        self.rows, self.compliance = MechanismRows(system, self.table), Compliance(self.smooth)
        is_compiled = self.compliance.free_columns is not None
        code = NearPairs(compiled_mechanism_step().code) if is_compiled else near_pairs()
        self.detection = NearDetection(self.table, self.n + 1, system.scale.length, code)
        self.shares = (0.0,) if self.smooth.closes or self.rows.restitution.any() else (MIDPOINT, 0.0)
        self.damping = ImplicitDamping(self.smooth)
        self.acceleration_error = 0.0
        self.constants = {
            "margin": REACH_MARGIN,
            "missed": MISSED_CLOSING_RATE,
            "removal": removal,
            "jammed": JAMMED_RESPONSE,
            "most_bent": system.scale.time,  # gaps of the length of the scene, in the unit of rows
            "contact_unit": self.rows.contact_unit,
        }
        self.record = ModeRecord(len(self.rows.elements))
        self.memory = MechanismMemory(self) if is_compiled else None
        self.forget()

    @property
    def elements(self) -> list[str]:
        """Names of contacts, other gaps and set-valued elements, as the record of their modes counts them."""
        return self.rows.elements

    @property
    def first_set_valued(self) -> int:
        """First set-valued element."""
        return len(self.rows.elements) - self.rows.limit.size

    @cached_property
    def _loops(self) -> ForceResponses | None:
        """Engine that projects onto the loop constraints; None where couplings alone hold by themselves."""
        return None if self.compliance.free_columns is not None else ForceResponses(self.smooth)

    def projected(self, state: State) -> State:
        """State on the loop constraints."""
        return state if self._loops is None else self._loops.solver.project(self.smooth, state)

    def check(self, state: State):
        """Check the accelerations without contacts by inverse dynamics of the bodies of the scene.

        SimulationError if they do not agree.
        """
        begun, system = self._begin(state, 0.0, 0.0), self.smooth
        motion, own = kinematics(system, state), 1.0 / system.scale.coordinates
        residual = inverse_dynamics_residual(motion, Applied(motion), begun.acceleration)
        if self.inputs.size:
            residual = residual + InputForces(system).forces(self.inputs, state)
        left = begun.H @ residual
        size = np.abs(begun.acceleration * own).max() + acceleration_scale(system) + centrifugal_scale(system, state.v)
        error = float(np.abs(left * own).max() / size)
        self.acceleration_error = max(self.acceleration_error, error)
        if not error <= ACCELERATION_TOLERANCE:
            raise SimulationError(
                f"t = {state.t:.6g} s: accelerations do not agree with inverse dynamics, by {error:.1e} relative; "
                "bodies of very different inertia, or a singular configuration."
            )

    def forget(self):
        """Forget the forces and inputs of the last step: a new motion begins."""
        self.inputs[:] = 0.0
        self.connect()

    def connect(self):
        """Forget the forces of the last step, and take all addresses anew."""
        self.detection.connect()
        self.forget_forces()
        self.record.forget()
        if self.memory is not None:
            self.memory.connect()

    def forget_forces(self):
        """Forget the forces of the last step alone."""
        count = len(self.rows.others) + self.rows.limit.size
        self.known = KnownForces(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(count), 0.0)

    @property
    def known(self) -> KnownForces:
        """Forces of the last step."""
        return self._known if self.memory is None else self.memory.known

    @known.setter
    def known(self, found: KnownForces):
        if self.memory is None:
            self._known = found
        else:
            self.detection.expect(found.key.size)  # a new stepper that continues a motion has met no contacts yet
            self.memory = self.memory.fitting()
            self.memory.known = found

    def rest(self, v: np.ndarray) -> float:
        """Rate below which a gap neither opens nor closes, in units of the scene."""
        return self.system.scale.time * resting(self.system, v)

    def slow(self, v: np.ndarray) -> float:
        """Tangential speed below which a contact may stick, in units of the scene."""
        return sliding_above(self.system, v) * self.system.scale.time / self.system.scale.length

    def steps_from(self, begin: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> LoopOfSteps:
        """Steps to some times by machine code, as far as it finishes them.

        Parameters
        ----------
        begin : ndarray, shape (4 + n_q + n_v,)
            (t, q, v, work) where they begin.
        ends : ndarray, shape (k,)
            Ends of the steps [s].
        rows : ndarray, shape (k, 4 + n_q + n_v)
            Destination of (t, q, v, work) at these ends.
        """
        if self.memory is None:
            return LoopOfSteps(0, 0.0, [], False)
        self.memory = self.memory.fitting()
        return self.memory.advance(begin, ends, rows)

    def examined(self, state: State, h: float) -> list[Paradox]:
        """Painlevé's paradoxes of a step by machine code."""
        known = self.known
        found = self.python_step(state, h).paradoxes
        self.known = known
        return found

    def python_step(self, state: State, h: float) -> MechanismStep:
        """Step of length h in Python; the forces of the last step are the initial guess.

        SimulationError if shapes overlap unseen by their gap functions, or no forces are found.
        """
        rest = self.rest(state.v)
        share, begun, near, rows, speed = self._open(state, h, rest)
        for _ in range(ATTEMPTS):
            force, added, error = self._solve(state, rows, begun, near, h, rest, share)
            acceleration = begun.acceleration + added
            reached = self._speed(begun, state.v + h * acceleration)
            if reached <= REACH_MARGIN * speed:
                break
            speed = reached
            near = self._near(state, begun, speed, h, share)
            rows = self.rows.of(begun.terms, near)
        else:
            raise SimulationError(f"t = {state.t:.6g} s: contacts make bodies faster and faster; shorten the step.")
        v = state.v + h * acceleration
        q = self.kernels.move(np.concatenate([begun.q, ((1.0 - share) * h) * v]))
        middle = state.v + 0.5 * h * acceleration
        work = force * (rows.K @ middle)
        lossy = np.ones(work.size, dtype=bool)
        lossy[work.size - self.rows.lossy.size :] = self.rows.lossy
        driven = work[~lossy].sum() + self._prescribed_power(rows, begun, acceleration, middle, force)
        power = begun.power + np.array([driven, 0.0, -work[lossy].sum()])
        if begun.implicit is not None:
            power = power + self.damping.power_over(state.v, begun.implicit, acceleration, h)
        contacts, others = self.rows.split(rows, near, force * rows.unit)
        order = np.argsort(near.key)
        self.known = KnownForces(near.key[order], contacts[order], others, share)
        name = partial(self.rows.name, near)
        paradoxes = paradoxes_of_step(rows, begun.H, begun.acceleration, force, self.slow(state.v), name)
        hits = self._impacts(rows, begun, h, rest, share)
        after = rows.rate + h * (rows.K @ acceleration + (1.0 - share) * rows.bias)
        modes = self.rows.modes(rows, near, force, after, h * work, hits, self.slow(state.v))
        return MechanismStep(q, v, near, contacts, others, power, error, paradoxes, modes)

    def _open(self, state: State, h: float, rest: float) -> tuple[float, FreeStep, NearContacts, StepRows, float]:
        """Share of the step before its forces, bodies, near contacts and rows there, and the speed that these are for."""
        for share in self.shares:
            begun = self._begin(state, h, share)
            speed = max(self._speed(begun, state.v), self._speed(begun, state.v + h * begun.acceleration))
            near = self._near(state, begun, speed, h, share)
            rows = self.rows.of(begun.terms, near)
            begun = self._at_later_rates(begun, state, rows, near, h, share)
            if share == self.shares[-1] or not self._impacts(rows, begun, h, rest, share).any():
                break
        return share, begun, near, rows, speed

    def open_step(self, state: State, h: float) -> OpenStep:
        """Step of length h up to its contact problem, which expects the forces of the last step."""
        rest = self.rest(state.v)
        share, begun, near, rows, _ = self._open(state, h, rest)
        force = self.rows.start(near, rows, self.known)
        return OpenStep(begun, near, rows, self._without_forces(rows, begun, h, rest, share, force))

    def _prescribed_power(self, rows: StepRows, begun: FreeStep, a: np.ndarray, v: np.ndarray, force: np.ndarray) -> float:
        """Power of constraints that prescribe velocities [W]: (M a − τ − Kᵀ f) · v, as all others have none."""
        if not self.smooth.relations.have_power:
            return 0.0
        return float((begun.terms.M @ a - begun.terms.tau - rows.K.T @ force) @ v)

    def _begin(self, state: State, h: float, share: float) -> FreeStep:
        kernels, t = self.kernels, state.t + share * h
        q = kernels.move(np.concatenate([state.q, (share * h) * state.v])) if share else state.q
        terms = kernels.terms(t, q, state.v, self.inputs)
        H, offset = self.compliance.of(terms)
        power, implicit = terms.power, None
        if self.damping.is_stiff(H, h):
            implicit, power = self.damping.added(terms, h), power - self.damping.power_at(state.v)
            terms = terms._replace(M=terms.M + np.diag(implicit))
            H, offset = self.compliance.of(terms)
        acceleration = H @ terms.tau + offset
        if not np.isfinite(acceleration).all():
            raise SimulationError(f"t = {t:.6g} s: accelerations are not finite; a law or a very fast motion makes them so.")
        return FreeStep(q, terms, H, offset, acceleration, power, implicit)

    def _at_later_rates(
        self, begun: FreeStep, state: State, rows: StepRows, near: NearContacts, h: float, share: float
    ) -> FreeStep:
        """Accelerations and power at the rates after the share, where the forces of the last step are expected."""
        if not share:
            return begun
        acceleration, t = begun.acceleration, state.t + share * h
        if self.known.share:
            acceleration = acceleration + begun.H @ (rows.K.T @ self.rows.start(near, rows, self.known))
        v = state.v + (share * h) * acceleration
        found = self.kernels.forces(np.concatenate([[t], begun.q, v, self.inputs]))
        forces, power = found[:-3], found[-3:]
        if begun.implicit is not None:
            forces, power = forces + self.damping.d * (v - state.v), power - self.damping.power_at(v)
        return begun._replace(acceleration=begun.H @ forces + begun.offset, power=power)

    def _speed(self, begun: FreeStep, v: np.ndarray) -> float:
        """Largest speed of a point of a shape [m/s]."""
        if not self.n:
            return 0.0
        twists = begun.terms.J[: self.n] @ v
        turning, moving = (np.sqrt((part * part).sum(axis=1)) for part in (twists[:, :3], twists[:, 3:]))
        return float((moving + turning * self.reach[: self.n]).max())

    def _near(self, state: State, begun: FreeStep, speed: float, h: float, share: float) -> NearContacts:
        """Contacts that may close within the rest of the step."""
        reach = 2.0 * REACH_MARGIN * (1.0 - share) * h * speed
        near, overlaps = self.detection.find(begun.terms.bodies, reach, UNSEEN_OVERLAP)
        return confirmed(near, overlaps, self.table, state.t)

    def _impacts(self, rows: StepRows, begun: FreeStep, h: float, rest: float, share: float) -> np.ndarray:
        m = rows.gap.size
        speeds = REST_STEPS * h * np.abs(rows.K[:m] @ begun.acceleration + rows.bias[:m]) + rest
        return is_impact(rows.gap, rows.rate[:m], speeds, h, share)

    def _without_forces(self, rows: StepRows, begun: FreeStep, h: float, rest: float, share: float, force) -> np.ndarray:
        """Rates (n,) after a step without forces, less the least that gaps may have; with the forces of the last step."""
        after = rows.rate + h * (rows.K @ begun.acceleration + (1.0 - share) * rows.bias)
        coefficients, curved = self.rows.coefficients, rows.bias[: rows.gap.size]
        gap = rows.gap if self.removal else gap_to_close(rows.gap, curved, h * (1.0 - share), self.constants["most_bent"])
        for e in coefficients:
            mine = slice(0, rows.gap.size) if len(coefficients) == 1 else np.flatnonzero(rows.restitution == e)
            given = float(e), h, rest, share, max(h, self.removal), force[: rows.gap.size][mine] * (self.removal > 0.0)
            after[mine] -= least_rate(gap[mine], rows.rate[mine], *given)
        return after

    def _solve(self, state: State, rows: StepRows, begun: FreeStep, near: NearContacts, h: float, rest: float, share: float):
        """Forces (n,) in units of the rows, the accelerations (n_v,) that they add, and the error of the laws."""
        m, n = rows.gap.size, rows.rate.size
        if not n:
            return np.zeros(0), np.zeros(begun.acceleration.size), 0.0
        force, scale = self.rows.start(near, rows, self.known), 1.0 + np.abs(rows.rate).max(initial=0.0)
        after = self._without_forces(rows, begun, h, rest, share, force)
        active = (after[:m] < 0.0) | (force[:m] > 0.0)
        responses = rows.K @ begun.H
        while True:
            which, laws = self.rows.laws(rows, active)
            W = h * rows.K[which] @ responses[which].T
            found, error = ContactProblem(0.5 * (W + W.T), after[which], laws).solve(force[which])
            added = found @ responses[which]
            missed = ~active & ((after + h * (rows.K @ added))[:m] < -MISSED_CLOSING_RATE * scale)
            force = np.zeros(n)
            force[which] = found
            if not missed.any():
                break
            active = active | missed
        if self.smooth.closes:
            name = partial(self.rows.name, near)
            refuse_jam(state.t, rows, begun.H, begun.terms.M.diagonal(), force, after, name)
        return force, added, error

    def step_over(self, state: State, h: float) -> MechanismStep:
        """Step of length h in Python that expects its own forces."""
        self.known = self.known._replace(share=0.0)
        found = self.python_step(state, h)
        return self.python_step(state, h) if self.known.share else found

    def forces_over(self, state: State, h: float) -> tuple[np.ndarray, np.ndarray]:
        """Forces over a step from a state that expects its own forces, as of :meth:`forces_of`."""
        return self.forces_of(self.step_over(state, h))

    def forces_of(self, step: MechanismStep) -> tuple[np.ndarray, np.ndarray]:
        """Forces of a step as normal forces (g,) of all gaps, and friction (g, 3) on the first bodies, world axes [N]."""
        near, force, others = step.contacts, step.force, step.others
        assert near is not None and force is not None and others is not None  # a step by Python
        return self.rows.of_gaps(near, force, others)

    @property
    def gap_count(self) -> int:
        """Number of gap functions of the scene."""
        return self.rows.gap_count

    def gap_forces(self) -> np.ndarray:
        """Normal forces (g,) of all gaps in the last step [N]."""
        return self.rows.normal_forces(*self.known[:3])

    def gaps_at(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
        """Gaps that are closed or negative (m,), in their units; their Jacobian, the compliance, and their names."""
        begun = self._begin(state, 0.0, 0.0)
        near = self.detection.find(begun.terms.bodies, 0.0)[0]
        rows = self.rows.of(begun.terms, near)
        m, time = rows.gap.size, self.system.scale.time
        return rows.gap / time, rows.K[:m] / time, begun.H, [self.rows.name(near, k) for k in range(m)]

    def refuse_penetration(self, state: State, accepted: float = START_OVERLAP):
        """Raise a StateError for penetration at the start, deeper than accepted, relative to the scale of a gap."""
        begun = self._begin(state, 0.0, 0.0)
        near = self._near(state, begun, 0.0, 0.0, 0.0)
        depth = (
            -np.concatenate([near.gap * self.rows.contact_unit, begun.terms.gap * self.rows.other_unit])
            / self.system.scale.time
        )
        worst = int(np.argmax(depth)) if depth.size else 0
        if depth.size and not depth[worst] <= accepted:
            inside = -np.concatenate([near.gap, begun.terms.gap])[worst]
            raise penetration_error(state.t, inside, self.rows.name(near, worst))
