"""One step of time stepping: mean accelerations and forces over a time h, from everything that touches, rubs and holds.

A step moves coordinates with the rates before it over a share s of its time, looks at all forces there, and goes on with the
rates after it (Moreau's midpoint rule, Jean, Comput. Methods Appl. Mech. Eng. 177, 1999, for s = ½). Forces that depend on
rates are those of rates that the free accelerations have changed by then. Gaps that are hit take s = 0: all of the way with
the rates after the impact. Rates at the end are ḋ⁺ = ḋ + h (J q̈ + (1 − s) J̇ q̇) with
q̈ = q̈_free + M⁻¹ Jᵀ f. A gap that would close within the step closes with its end, ḋ⁺ ≥ −d/((1 − s) h); one that is hit opens
with e times its speed (Moreau 1988; Stewart, Trinkle 1996). Friction acts on the sliding after the step, and grips on the
rates after it. The forces f follow from :mod:`gauss.dynamics.contact.contact_step`.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Expression, Scalar, write
from gauss.codegen.kernels import Contacts
from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.constraint_scales import contact_scales, gap_scales
from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem, settle
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.contact.impact import jammed_error, resting
from gauss.dynamics.contact.paradox import MOST, NEGATIVE, Paradox, rubbed, sliding, sliding_above, undetermined
from gauss.dynamics.contact_terms import ContactTerms, ContactTermsKernel
from gauss.dynamics.mechanism import Mechanism, loop_constraint_scales
from gauss.errors import SimulationError, StateError
from gauss.integrators import Rates
from gauss.scene import Box, Contact, Scene
from gauss.system import State, System, guards, retract, sides
from gauss.system.build import slips

START_OVERLAP = 1e-6  # of the size of a gap: a start that is farther inside than this does not just touch
LOST = 0.05  # of the shortest edge of a box: shapes this deep in each other, with no gap that says so, are lost
MIDDLE = 0.5  # of a step: share in which coordinates move with the rates before it
FORBIDDEN = 1e-6  # relative: answers to forces that violate the constraints by more are rounding: nothing can move so
REST = 2.0  # steps: a gap that closes no faster than its acceleration makes it in so many is not hit, but rests
MISSED_CLOSING_RATE = (
    1e-12  # relative to the scale, times 1 + the fastest: a gap that closes faster than it may has been left out wrongly
)


class MoreauStep(NamedTuple):
    """What happens over one step.

    Attributes
    ----------
    acceleration : ndarray, shape (n_v,)
        Mean accelerations.
    power : ndarray, shape (3,)
        Mean power of drives, of forces on bodies, and what is lost [W].
    force : ndarray, shape (n,)
        Mean forces, impulses of impacts included: of all gaps, across those with friction, of grips [N, N m].
    error : float or None
        With which the laws are met, relative to the scale of the scene; None: it is the convex step.
    paradoxes : list of Paradox
        Gaps whose forces are not determined by rigid bodies.
    share : float
        Of the step, in which coordinates move with the rates before it.
    """

    acceleration: np.ndarray
    power: np.ndarray
    force: np.ndarray
    error: float | None
    paradoxes: list[Paradox]
    share: float


class MoreauStepper:
    """Steps of one system.

    Parameters
    ----------
    system : System
        With one-sided constraints, friction or grips.
    backend : str
        How free accelerations are solved.
    """

    def __init__(self, system: System, backend: str = "auto"):
        scene = system.scene
        self.system, self.smooth = system, smooth_system(system)
        self.backend, self.kernel = backend, ContactTermsKernel(system)
        self.unit, self.deep = system.scale.time / contact_scales(system), START_OVERLAP * system.scale.time
        gaps, rough, grips = sides(scene), slips(scene), list(scene.grips.values())
        self.names = [side.name for side in gaps]
        self.sliding = [slip.name for slip in rough for _ in range(2)]
        self.owners = [side.whole.name for side in gaps]
        self.guarded = {guard.name: LOST * shortest_edge(scene, guard.whole) for guard in guards(scene)}
        self.restitution = np.array([side.whole.restitution for side in gaps])
        m, k = len(gaps), len(rough)
        self.laws = ContactLaws(
            normal=np.arange(m),
            across=np.arange(m, m + 2 * k).reshape(k, 2),
            under=np.array([self.names.index(slip.name) for slip in rough], dtype=int),
            friction=np.array([slip.whole.friction for slip in rough]),
            grip=np.arange(m + 2 * k, m + 2 * k + len(grips)),
            limit=np.array([grip.limit for grip in grips]) / self.unit[m + 2 * k :],
        )
        self.patterns: dict[bytes, tuple[np.ndarray, ContactLaws]] = {}
        self.lossy = np.concatenate([np.ones(m + 2 * k, dtype=bool), [grip.lossy for grip in grips]]).astype(bool)

    @cached_property
    def responses(self) -> ForceResponses:
        """Accelerations of the system without what touches, rubs and holds."""
        return ForceResponses(self.smooth, self.backend)

    def step(self, state: State, h: float, start: np.ndarray | None = None, last: bool = False) -> MoreauStep:
        """Step of the length h; forces are looked for from ``start``, those of the step before.

        Raises
        ------
        SimulationError
            If shapes are in each other and no gap leads out, or no forces are found.
        """
        rest = self.rest(state.v)
        for share in self.shares:
            at = advance_positions(self.system, state, h, share)
            touch, free = self.relative(self.kernel(at)), self._free(at, h, share, last)
            if not any(self.hits(touch, free.acceleration, h, rest, share)):
                break
        self._refuse_overlap(touch, state)
        if not np.isfinite(touch.J).all():
            row = int(np.flatnonzero(~np.isfinite(touch.J).all(axis=1))[0])
            name = [*self.names, *self.sliding, *self.system.scene.grips][row]
            raise SimulationError(f"t = {state.t:.6g} s: {name!r} has no slope; its shapes meet where they have no normal.")
        force, m = np.zeros(touch.rate.size) if start is None else start / self.unit, touch.width.size
        after = self.without_forces(touch, free.acceleration, h, rest, share)
        scale = 1.0 + np.abs(touch.rate).max(initial=0.0)
        active, responses = np.zeros(0, dtype=int), np.zeros((0, free.acceleration.size))
        pressed = (after[:m] < 0.0) | (force[:m] > 0.0)
        while True:
            rows, laws = self._rows(pressed)
            responses = self._responses(at, touch.J, rows, active, responses)
            active, W = rows, h * touch.J[rows] @ responses.T
            found, error = ContactProblem(0.5 * (W + W.T), after[rows], laws).solve(force[rows])
            acceleration = found @ responses
            missed = ~pressed & ((after + h * touch.J @ acceleration)[:m] < -MISSED_CLOSING_RATE * scale)
            if not missed.any():
                break
            force = np.zeros_like(force)
            force[rows] = found
            pressed = pressed | missed
        force = np.zeros_like(force)
        force[rows] = found
        self._refuse_jam(state, at, rows[found != 0.0], responses[found != 0.0], after)
        rates = self.over(touch, free, state.v, h, force, acceleration)
        return MoreauStep(*rates, force * self.unit, error, self._paradoxes(state, touch, free, force, rows, W / h), share)

    def relative(self, touch: ContactTerms) -> ContactTerms:
        """What touches with widths, rates and slopes over the sizes of their rows, times the time of the scene.

        Rates are then relative to the scale of the scene; forces that do the same work are divided by these units.
        """
        unit = self.unit
        return ContactTerms(
            touch.width * unit[: touch.width.size],
            touch.apart,
            touch.rate * unit,
            touch.J * unit[:, None],
            touch.bias * unit,
        )

    def rest(self, v):
        """Rate below which a gap neither opens nor closes, where rates are v, numbers or expressions; relative."""
        return self.system.scale.time * resting(self.system, v)

    def slow(self, v):
        """Speed of sliding below which a gap may as well stick, where rates are v, numbers or expressions; relative."""
        return sliding_above(self.system, v) * self.system.scale.time / self.system.scale.length

    def _free(self, at: State, h: float, share: float, last: bool) -> Rates:
        """Accelerations without forces, for rates that these accelerations have changed by then."""
        if share:
            at = advance_rates(at, self.responses.free(at).acceleration, h, share)
        return self.responses.free(at, last)

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares that are tried.

        Loops are closed at the ends of steps only, so all forces are looked at there. What rebounds gains a little by every
        rebound, for it is hit within a step; it comes to rest because it loses more by steps with the new rates alone.
        """
        return (0.0,) if self.smooth.closes or self.restitution.any() else (MIDDLE, 0.0)

    def hits(self, touch: ContactTerms, acceleration, h, rest, share) -> list:
        """Whether each gap is hit within what is left of a step; numbers or expressions.

        Parameters
        ----------
        touch, acceleration, h, rest, share
            As of :meth:`without_forces`.
        """
        speeds = REST * h * np.abs(touch.J @ acceleration + touch.bias) + rest
        gaps = zip(touch.width, touch.rate, speeds, strict=False)
        return [_both(width + (1.0 - share) * h * rate <= 0.0, rate < -speed) for width, rate, speed in gaps]

    def without_forces(self, touch: ContactTerms, acceleration, h, rest, share) -> np.ndarray:
        """Rates (n,) after a step without forces, over the least that gaps may have; numbers or expressions.

        That is back by its restitution if a gap is hit, else shut with the end of the step.

        Parameters
        ----------
        touch : ContactTerms
            What touches where forces are looked at.
        acceleration : ndarray, shape (n_v,)
            Without forces.
        h : float
            Length of the step [s].
        rest : float
            Rate below which a gap neither opens nor closes, relative as all rates of a :class:`ContactTerms`.
        share : float
            Of the step that is over there.
        """
        gaps = zip(touch.width, touch.rate, self.restitution, strict=False)
        least = [_least_rate(width, rate, e, h, rest, share) for width, rate, e in gaps]
        least += [0.0] * (touch.rate.size - len(least))
        return touch.rate + h * (touch.J @ acceleration + (1.0 - share) * touch.bias) - np.array(least)

    def compliance(self, mechanism: Mechanism) -> np.ndarray:
        """Accelerations (n_v, n_v) by unit generalised forces, traced; each row is the answer to one."""
        still = np.zeros(mechanism.scale.size)
        return np.array([mechanism.response(unit, still)[0] for unit in np.eye(self.system.n_v)])

    def forces(self, after, h, J, H, start, slides, slack, slow) -> tuple[np.ndarray, Scalar, Scalar]:
        """Forces (n,), error of the laws, doubt: :class:`gauss.codegen.kernels.Contacts`."""
        given = [*after, h, *np.ravel(J), *np.ravel(H), *start, *slides, slack, slow]
        graph = next(entry.graph for entry in given if isinstance(entry, Expression))
        *force, error, doubtful = graph.call(self._contacts, given)
        return np.array(force), error, doubtful

    @cached_property
    def _contacts(self) -> Contacts:
        laws = self.laws
        return Contacts(
            *(laws.normal.size, self.system.n_v, laws.under, laws.friction, laws.limit, settle()),
            write(lambda x: [rubbed(*x)], 6, name="rubbed"),
            *(NEGATIVE, MOST),
        )

    def forbids(self, at: State, response) -> Scalar:
        """Above 0 if rates (n_v,) that answer to forces violate the loop constraints: they are rounding; traced or not."""
        if not self.smooth.closes:
            return 0.0
        forbidden = np.abs(Mechanism(self.smooth, at.q, response, at.t).velocity()) / loop_constraint_scales(self.smooth)
        size = np.abs(response) / self.system.scale.coordinates
        return math.where(sum(forbidden, 0.0) > FORBIDDEN * sum(size, 0.0), 1.0, 0.0)

    def over(self, touch: ContactTerms, free: Rates, v, h, force, acceleration) -> Rates:
        """Mean accelerations and powers over a step under forces (n,) and the accelerations that these add."""
        total = free.acceleration + acceleration
        work = force * (touch.J @ (v + 0.5 * h * total))
        return Rates(total, free.power + np.array([work[~self.lossy].sum(), 0.0, -work[self.lossy].sum()]))

    def owner(self, gap: str) -> str:
        """Name of the contact, stop or rope that a gap belongs to."""
        return self.owners[self.names.index(gap)]

    def refuse_penetration(self, state: State):
        """Raise a StateError if a gap is negative, which a step would undo with the speed d/h."""
        width = self.kernel(state).width / gap_scales(self.system)
        if not np.isfinite(width).all():
            name = self.names[int(np.flatnonzero(~np.isfinite(width))[0])]
            raise StateError(f"t = {state.t:.6g} s: the gap of {name!r} has no finite value.")
        worst = int(np.argmin(width)) if width.size else 0
        if width.size and width[worst] < -START_OVERLAP:
            inside = -width[worst] * gap_scales(self.system)[worst]
            raise StateError(
                f"t = {state.t:.6g} s: {inside:.3g} [m, rad] inside of {self.names[worst]!r}; move it out with scene.start."
            )

    def _rows(self, pressed: np.ndarray) -> tuple[np.ndarray, ContactLaws]:
        """Gaps that are pressed, the friction that goes with them, and all grips, in order; and their laws."""
        key = pressed.tobytes()
        if key not in self.patterns:
            laws = self.laws
            rows = np.concatenate([np.flatnonzero(pressed), laws.across[pressed[laws.under]].ravel(), laws.grip])
            self.patterns[key] = rows, laws_of(laws, rows)
        return self.patterns[key]

    def _responses(self, state: State, J, rows, known, responses) -> np.ndarray:
        """Accelerations (k, n_v) by unit forces in some rows, of which some are known."""
        if not known.size:
            return self.responses.of(state, J[rows])
        found = np.empty((rows.size, J.shape[1]))
        old = np.isin(rows, known)
        found[old] = responses[np.searchsorted(known, rows[old])]
        found[~old] = self.responses.of(state, J[rows[~old]])
        return found

    def _refuse_jam(self, state: State, at: State, rows, responses, after):
        """Raise a SimulationError if forces of gaps that close change nothing, for the constraints allow nothing else."""
        gaps = self.laws.normal.size
        held = [k for k, response in zip(rows, responses, strict=True) if k < gaps and self.forbids(at, response)]
        if held:
            speed = float((-after / self.unit)[held].max())
            raise jammed_error(f"t = {state.t:.6g} s", [self.names[k] for k in held], speed)

    def _refuse_overlap(self, touch: ContactTerms, state: State):
        for (name, deepest), apart in zip(self.guarded.items(), touch.apart, strict=True):
            if apart > -deepest:
                continue
            least = touch.width[[k for k, owner in enumerate(self.owners) if owner == name]].min()
            if least > -self.deep:
                raise SimulationError(
                    f"t = {state.t:.6g} s: shapes are {-apart:.3g} m in each other, and no gap of {name!r} leads out; "
                    "move them apart with scene.start, or shorten the step."
                )

    def _paradoxes(self, state: State, touch: ContactTerms, free, force, rows, A) -> list[Paradox]:
        """Painlevé's paradoxes of the gaps that are pressed; A are accelerations of the rows by their forces."""
        laws = self.laws
        if not laws.under.size:
            return []
        rates = touch.rate[laws.across]
        which = sliding(rates, force[laws.under] > 0.0, self.slow(state.v))
        if not which.size:
            return []
        normal = np.searchsorted(rows, laws.under[which])
        across = np.searchsorted(rows, laws.across[which])
        against = -rates[which] / np.hypot(*rates[which].T)[:, None]
        smooth, sideways = A[np.ix_(normal, normal)], A[normal][:, across]
        K = rubbed(smooth, sideways[:, :, 0], sideways[:, :, 1], laws.friction[which], *against.T)
        b = (touch.J @ free.acceleration + touch.bias)[laws.under[which]]
        return undetermined([self.names[i] for i in laws.under[which]], K, smooth, b)


def advance_positions(system: System, state: State, h, share) -> State:
    """State after a share of a step with the rates before it; numbers or expressions."""
    return State(state.t + share * h, retract(system, state.q, (share * h) * state.v), state.v)


def advance_rates(state: State, acceleration, h, share) -> State:
    """Same place with the rates after a share of a step under some accelerations; numbers or expressions."""
    return State(state.t, state.q, state.v + (share * h) * acceleration)


def _both(one, other):
    return math.where(one, math.where(other, 1.0, 0.0), 0.0)


def _least_rate(width, rate, restitution: float, h, rest, share):
    """Least rate of a gap over a step; what is inside comes out no faster than over a whole step, lest it swings."""
    shut = math.where(width > 0.0, -width / ((1.0 - share) * h), -width / h)
    if not restitution:
        return shut
    hit = _both(width + h * rate <= 0.0, rate < -rest)
    return math.where(hit > share, -restitution * rate, shut)


def shortest_edge(scene: Scene, contact: Contact) -> float:
    """Shortest edge [m] of the boxes of a contact."""
    shapes = (scene.shapes[name] for name in (contact.shape, contact.other))
    return min(min(shape.size) for shape in shapes if isinstance(shape, Box))


def laws_of(laws: ContactLaws, rows: np.ndarray) -> ContactLaws:
    """Laws of some rows, which are in order."""
    kept = np.isin(laws.under, rows)
    place = lambda which: np.searchsorted(rows, which)  # noqa: E731
    return ContactLaws(
        normal=place(laws.normal[np.isin(laws.normal, rows)]),
        across=place(laws.across[kept]),
        under=place(laws.under[kept]),
        friction=laws.friction[kept],
        grip=place(laws.grip),
        limit=laws.limit,
    )


def moreau_stepper(system: System, backend: str = "auto") -> MoreauStepper:
    """Stepper of a system, made once."""
    key = backend if isinstance(backend, str) else id(backend)  # which the stepper keeps alive
    return system.dynamics.on_demand((MoreauStepper, key), lambda: MoreauStepper(system, backend))
