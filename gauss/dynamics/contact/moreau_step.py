"""Step of Moreau–Jean time stepping: ḋ⁺ = ḋ + h (J q̈ + (1 − s) J̇ q̇) with q̈ = q̈_free + M⁻¹ Jᵀ f, mean values over h.

Coordinates move with the rates before the step over a share s of it; forces are evaluated there, rate-dependent ones at
rates that the free accelerations and the contact forces of the last step have changed by then; the rest of the way takes the
rates after the step (midpoint rule: Jean, Comput. Methods Appl. Mech. Eng. 177, 1999, for s = ½). With an impact s = 0.
Impulses of an impact are no forces of the step after it, which expects none. A gap that would close within the step closes
at its end (:mod:`gauss.dynamics.contact.gap_laws`); one with an impact opens with e times its speed (Moreau 1988; Stewart,
Trinkle 1996). Friction and set-valued elements act on the rates after the step. The forces f solve the problem of
:mod:`gauss.dynamics.contact.contact_step`.
"""

from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from gauss import math
from gauss.backends import Backend
from gauss.codegen import Expression, Scalar, write
from gauss.codegen.kernels import ContactForces
from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.constraint_scales import contact_scales, gap_scales
from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem, contact_solver, laws_of
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.contact.gap_laws import REST_STEPS, gap_to_close, is_impact, least_rate
from gauss.dynamics.contact.impact import jammed_error, resting
from gauss.dynamics.contact.implicit_damping import DampedResponses, DampedStep, ImplicitDamping
from gauss.dynamics.contact.overlaps import START_OVERLAP, UnseenOverlaps, penetration_error
from gauss.dynamics.contact.paradox import (
    MOST_CONTACTS,
    NEGATIVE,
    Paradox,
    sliding,
    sliding_above,
    undetermined_sliding,
    with_sliding_friction,
)
from gauss.dynamics.contact.step_modes import StepModes
from gauss.dynamics.contact_terms import ContactTerms, ContactTermsKernel
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.traced_laws import Laws, present_laws
from gauss.dynamics.mechanism import Mechanism, loop_constraint_scales
from gauss.dynamics.store import cached
from gauss.errors import SimulationError, StateError
from gauss.integrators import Rates
from gauss.scene import JointDryFriction
from gauss.system import State, System, retract, sides
from gauss.system.contact_mode import slips

MIDPOINT = 0.5  # share of a step in which coordinates move with the rates before it
INCONSISTENT_RESPONSE = 1e-6  # relative: responses that violate the constraints by more are round-off
MISSED_CLOSING_RATE = 1e-12  # units of the scene times 1 + the fastest rate: faster closing of an inactive gap activates it


class MoreauStep(NamedTuple):
    """Result of one step."""

    acceleration: np.ndarray  # (n_v,) mean accelerations
    power: np.ndarray  # (3,) mean power of drives, of forces on bodies, and of dissipation [W]
    force: np.ndarray  # (n,) mean forces with impulses: normal, tangential, of set-valued elements [N, N m]
    error: float | None  # error of the contact laws in units of the scene; None for the convex relaxation
    paradoxes: list[Paradox]  # contacts with undetermined forces
    share: float  # share of the step in which coordinates move with the rates before it
    modes: np.ndarray  # modes after it, see :meth:`gauss.dynamics.contact.step_modes.StepModes.after`


class MoreauStepper:
    """Steps of one system.

    Parameters
    ----------
    system : System
        With unilateral constraints, friction or set-valued elements.
    backend : str, Backend or class
        Backend of the free accelerations.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.
    laws : Laws
        Loads of the system without unilateral and set-valued elements.
    """

    def __init__(self, system: System, backend: str | Backend | type, removal: float, laws: Laws):
        scene = system.scene
        self.system, self.smooth, self.removal, self.loads = system, laws.system, removal, laws
        self.backend, self.kernel = backend, ContactTermsKernel(system)
        self.unit = system.scale.time / contact_scales(system)
        gaps, rough = sides(scene), slips(scene)
        set_valued = cast(list[JointDryFriction], [*scene.set_valued.values()])  # others are refused
        self.names = [side.name for side in gaps]
        self.sliding = [slip.name for slip in rough for _ in range(2)]
        self.owners = [side.whole.name for side in gaps]
        self.overlaps = UnseenOverlaps(system, self.owners)
        self.restitution = np.array([side.whole.restitution for side in gaps])
        m, k = len(gaps), len(rough)
        self.laws = ContactLaws(
            normal=np.arange(m),
            across=np.arange(m, m + 2 * k).reshape(k, 2),
            under=np.array([self.names.index(slip.name) for slip in rough], dtype=int),
            friction=np.array([slip.whole.friction for slip in rough]),
            set_valued=np.arange(m + 2 * k, m + 2 * k + len(set_valued)),
            limit=np.array([element.limit for element in set_valued]) / self.unit[m + 2 * k :],
        )
        self.patterns: dict[bytes, tuple[np.ndarray, ContactLaws]] = {}
        self.lossy = np.concatenate([np.ones(m + 2 * k, dtype=bool), [element.lossy for element in set_valued]]).astype(bool)

    @cached_property
    def modes(self) -> StepModes:
        """Modes of the elements of the scene."""
        return StepModes(self)

    @cached_property
    def responses(self) -> ForceResponses:
        """Responses of the system without unilateral and set-valued elements."""
        return ForceResponses(self.smooth, self.backend, self.loads)

    @cached_property
    def damping(self) -> ImplicitDamping:
        """Damping of joints, which is implicit where it is stiff."""
        return ImplicitDamping(self.smooth)

    def step(
        self, state: State, h: float, start: np.ndarray | None = None, last: bool = False, before: float = 0.0
    ) -> MoreauStep:
        """Step of length h; ``start`` (n,) are the forces of the last step, ``before`` its share s.

        Without them it is made twice, so that it expects its own forces.

        SimulationError if shapes overlap unseen by their gap functions, or no forces are found.
        """
        if start is not None:
            return self._step(state, h, start, last, before)
        found = self._step(state, h, np.zeros(self.unit.size), last, 0.0)
        return self._step(state, h, found.force, last, found.share) if found.share else found

    def _step(self, state: State, h: float, start: np.ndarray, last: bool, before: float) -> MoreauStep:
        rest, force = self.rest(state.v), start / self.unit
        for share in self.shares:
            at = advance_positions(self.system, state, h, share)
            touch = self.relative(self.kernel(at))
            pushed = force != 0.0 if before and share else np.zeros(force.size, dtype=bool)
            damped = DampedResponses(self.damping, self.responses, at, h)
            free = self._free(at, h, share, touch.J[pushed].T @ force[pushed], last, damped)
            if not any(self.hits(touch, free.acceleration, h, rest, share)):
                break
        self.overlaps.refuse(touch, state.t)
        if not np.isfinite(touch.J).all():
            row = int(np.flatnonzero(~np.isfinite(touch.J).all(axis=1))[0])
            name = [*self.names, *self.sliding, *self.system.scene.set_valued][row]
            raise SimulationError(f"t = {state.t:.6g} s: {name!r} has no slope; its shapes meet where they have no normal.")
        m = touch.width.size
        after = self.without_forces(touch, free.acceleration, h, rest, share, force)
        scale = 1.0 + np.abs(touch.rate).max(initial=0.0)
        active, responses = np.zeros(0, dtype=int), np.zeros((0, free.acceleration.size))
        active_gaps = (after[:m] < 0.0) | (force[:m] > 0.0)
        while True:
            rows, laws = self._rows(active_gaps)
            responses = self._responses(damped, touch.J, rows, active, responses)
            active, W = rows, h * touch.J[rows] @ responses.T
            found, error = ContactProblem(0.5 * (W + W.T), after[rows], laws).solve(force[rows])
            acceleration = found @ responses
            missed = ~active_gaps & ((after + h * touch.J @ acceleration)[:m] < -MISSED_CLOSING_RATE * scale)
            if not missed.any():
                break
            force = np.zeros_like(force)
            force[rows] = found
            active_gaps = active_gaps | missed
        force = np.zeros_like(force)
        force[rows] = found
        self._refuse_jam(state, at, rows[found != 0.0], responses[found != 0.0], after)
        rates = self.over(at, touch, free, state.v, h, force, acceleration, damped.step)
        modes = self.modes.after(touch, free.acceleration, acceleration, force, state.v, h, rest, share).astype(float)
        paradoxes = self._paradoxes(state, touch, free, force, rows, W / h)
        return MoreauStep(*rates, force * self.unit, error, paradoxes, share, modes)

    def relative(self, touch: ContactTerms) -> ContactTerms:
        """Contact terms in units of the scene; forces that do the same work are divided by these units."""
        unit = self.unit
        return ContactTerms(
            touch.width * unit[: touch.width.size],
            touch.apart,
            touch.rate * unit,
            touch.J * unit[:, None],
            touch.bias * unit,
        )

    def rest(self, v):
        """Rate below which a gap neither opens nor closes, for rates v, numbers or expressions; in units of the scene."""
        return self.system.scale.time * resting(self.system, v)

    def slow(self, v):
        """Tangential speed below which a contact may stick, for rates v, numbers or expressions; in units of the scene."""
        return sliding_above(self.system, v) * self.system.scale.time / self.system.scale.length

    def _free(self, at: State, h: float, share: float, expected, last: bool, damped: DampedResponses) -> Rates:
        """Accelerations without contact forces, at the rates after the share, with the generalised forces expected."""
        step, v = damped.step, at.v
        if share:
            acceleration = self.responses.free(at).acceleration
            acceleration = acceleration if step is None else step.acceleration(acceleration)
            if expected.any():
                acceleration = acceleration + damped.of(expected[None])[0]
            at = advance_rates(at, acceleration, h, share)
        found = self.responses.free(at, last)
        return found if step is None else step.later(found, v, at.v)

    @property
    def shares(self) -> tuple[float, ...]:
        """Candidates of the share s, in order.

        Loops are closed at the ends of steps only, hence s = 0 with loops. An impact within a step of s = ½ gains a little
        energy; with restitution s = 0 dissipates more, so that bodies come to rest.
        """
        return (0.0,) if self.smooth.closes or self.restitution.any() else (MIDPOINT, 0.0)

    def hits(self, touch: ContactTerms, acceleration, h, rest, share) -> list:
        """Whether each gap has an impact in the rest of a step; numbers or expressions.

        Parameters
        ----------
        touch, acceleration, h, rest, share
            As of :meth:`without_forces`.
        """
        speeds = REST_STEPS * h * np.abs(touch.J @ acceleration + touch.bias) + rest
        gaps = zip(touch.width, touch.rate, speeds, strict=False)
        return [is_impact(width, rate, speed, h, share) for width, rate, speed in gaps]

    def without_forces(self, touch: ContactTerms, acceleration, h, rest, share, start) -> np.ndarray:
        """Rates (n,) after a step without contact forces, less the least that gaps may have; numbers or expressions.

        The least rate is that of restitution after an impact, else that which closes the gap at the end of the step.

        Parameters
        ----------
        touch : ContactTerms
            Contact terms where forces are evaluated.
        acceleration : ndarray, shape (n_v,)
            Without contact forces.
        h : float
            Length of the step [s].
        rest : float
            Rate below which a gap neither opens nor closes, in units of the scene.
        share : float
            Share of the step before.
        start : ndarray, shape (n,)
            Forces of the last step, or expressions.
        """
        given = h * (1.0 - share), self.system.scale.time  # gaps of the length of the scene, in the unit of rows
        curved = [] if self.removal else [gap_to_close(*gap, *given) for gap in zip(touch.width, touch.bias, strict=False)]
        closed = start if self.removal else np.zeros(len(start))
        gaps = zip(curved or touch.width, touch.rate, self.restitution, closed, strict=False)
        removal = math.maximum(h, self.removal) if self.removal else h
        least = [least_rate(width, rate, e, h, rest, share, removal, force) for width, rate, e, force in gaps]
        least += [0.0] * (touch.rate.size - len(least))
        return touch.rate + h * (touch.J @ acceleration + (1.0 - share) * touch.bias) - np.array(least)

    def compliance(self, mechanism: Mechanism) -> np.ndarray:
        """Accelerations (n_v, n_v) by unit generalised forces, traced; one row for each."""
        still = np.zeros(mechanism.scale.size)
        return np.array([mechanism.response(unit, still)[0] for unit in np.eye(self.system.n_v)])

    def forces(self, after, h, J, H, start, slides, slack, slow) -> tuple[np.ndarray, Scalar, Scalar]:
        """Forces (n,), error of the laws, indeterminacy: :class:`gauss.codegen.kernels.ContactForces`."""
        given = [*after, h, *np.ravel(J), *np.ravel(H), *start, *slides, slack, slow]
        graph = next(entry.graph for entry in given if isinstance(entry, Expression))
        *force, error, doubtful = graph.call(self._contacts, given)
        return np.array(force), error, doubtful

    @cached_property
    def _contacts(self) -> ContactForces:
        laws = self.laws
        return ContactForces(
            *(laws.normal.size, self.system.n_v, laws.under, laws.friction, laws.limit, contact_solver()),
            write(lambda x: [with_sliding_friction(*x)], 6, name="rubbed"),
            *(NEGATIVE, MOST_CONTACTS),
        )

    def forbids(self, at: State, response) -> Scalar:
        """Above 0 if a response (n_v,) to forces violates the loop constraints, and is round-off; traced or not."""
        if not self.smooth.closes:
            return 0.0
        forbidden = np.abs(Mechanism(self.smooth, at.q, response, at.t).velocity()) / loop_constraint_scales(self.smooth)
        size = np.abs(response) / self.system.scale.coordinates
        return math.where(sum(forbidden, 0.0) > INCONSISTENT_RESPONSE * sum(size, 0.0), 1.0, 0.0)

    def over(
        self, at: State, touch: ContactTerms, free: Rates, v, h, force, acceleration, damped: DampedStep | None = None
    ) -> Rates:
        """Mean accelerations and powers over a step under forces (n,) and their accelerations.

        ``at`` is the place of the forces, with any rates.
        """
        total = free.acceleration + acceleration
        middle = v + 0.5 * h * total
        work = force * (touch.J @ middle)
        driven = work[~self.lossy].sum() + self._reacting_power(at, acceleration, middle, work)
        power = free.power + np.array([driven, 0.0, -work[self.lossy].sum()])
        return Rates(total, power if damped is None else power + damped.power_over(v, total, h))

    def _reacting_power(self, at: State, a, v, work) -> Scalar:
        """Power (M a − Kᵀ f) · v of constraints that prescribe velocities, by the forces f: all others have none."""
        if not self.smooth.relations.have_power:
            return 0.0
        changed, moved = (Kinematics(self.smooth, State(at.t, at.q, rates)).quasi_velocities() for rates in (a, v))
        return changed @ (self.smooth.Phi * moved) - sum(work)

    def owner(self, gap: str) -> str:
        """Name of the contact, stop or rope of a gap."""
        return self.owners[self.names.index(gap)]

    def refuse_penetration(self, state: State, accepted: float = START_OVERLAP):
        """Raise a StateError for penetration at the start, deeper than accepted, relative to the scale of a gap."""
        width = self.kernel(state).width / gap_scales(self.system)
        if not np.isfinite(width).all():
            name = self.names[int(np.flatnonzero(~np.isfinite(width))[0])]
            raise StateError(f"t = {state.t:.6g} s: the gap of {name!r} has no finite value.")
        worst = int(np.argmin(width)) if width.size else 0
        if width.size and width[worst] < -accepted:
            inside = -width[worst] * gap_scales(self.system)[worst]
            raise penetration_error(state.t, inside, self.names[worst], remedy="")

    def _rows(self, active_gaps: np.ndarray) -> tuple[np.ndarray, ContactLaws]:
        """Rows of the active gaps, of their friction, and of all set-valued elements, in order; and their laws."""
        key = active_gaps.tobytes()
        if key not in self.patterns:
            laws = self.laws
            rows = np.concatenate(
                [np.flatnonzero(active_gaps), laws.across[active_gaps[laws.under]].ravel(), laws.set_valued]
            )
            self.patterns[key] = rows, laws_of(laws, rows)
        return self.patterns[key]

    def _responses(self, damped: DampedResponses, J, rows, known, responses) -> np.ndarray:
        """Accelerations (k, n_v) by unit forces in some rows; those of the rows ``known`` are given."""
        if not known.size:
            return damped.of(J[rows])
        found = np.empty((rows.size, J.shape[1]))
        old = np.isin(rows, known)
        found[old] = responses[np.searchsorted(known, rows[old])]
        found[~old] = damped.of(J[rows[~old]])
        return found

    def _refuse_jam(self, state: State, at: State, rows, responses, after):
        """Raise a SimulationError if normal forces move nothing, because the bilateral constraints forbid it."""
        gaps = self.laws.normal.size
        held = [k for k, response in zip(rows, responses, strict=True) if k < gaps and self.forbids(at, response)]
        if held:
            speed = float((-after / self.unit)[held].max())
            raise jammed_error(f"t = {state.t:.6g} s", [self.names[k] for k in held], speed)

    def _paradoxes(self, state: State, touch: ContactTerms, free, force, rows, A) -> list[Paradox]:
        """Painlevé's paradoxes of the active gaps; A are accelerations of the rows by their forces."""
        laws = self.laws
        if not laws.under.size:
            return []
        rates = touch.rate[laws.across]
        which = sliding(rates, force[laws.under] > 0.0, self.slow(state.v))
        if not which.size:
            return []
        normal = np.searchsorted(rows, laws.under[which])
        across = np.searchsorted(rows, laws.across[which])
        smooth, sideways = A[np.ix_(normal, normal)], A[normal][:, across]
        b = (touch.J @ free.acceleration + touch.bias)[laws.under[which]]
        names = [self.names[i] for i in laws.under[which]]
        return undetermined_sliding(names, laws.friction[which], rates[which], smooth, sideways, b)


def advance_positions(system: System, state: State, h, share) -> State:
    """State after a share of a step with the rates before it; numbers or expressions."""
    return State(state.t + share * h, retract(system, state.q, (share * h) * state.v), state.v)


def advance_rates(state: State, acceleration, h, share) -> State:
    """Same place with the rates after a share of a step under some accelerations; numbers or expressions."""
    return State(state.t, state.q, state.v + (share * h) * acceleration)


def moreau_stepper(
    system: System, backend: str | Backend | type = "auto", removal: float = 0.0, laws: Laws | None = None
) -> MoreauStepper:
    """Stepper of a system, cached for its laws as they are now.

    Parameters
    ----------
    laws : Laws, optional
        Loads of the system without unilateral and set-valued elements, where they are known.
    """
    laws = present_laws(smooth_system(system)) if laws is None else laws
    key = backend if isinstance(backend, str) else id(backend)  # kept alive by the stepper
    return cached(system, (MoreauStepper, key, removal, laws.key), lambda: MoreauStepper(system, backend, removal, laws))
