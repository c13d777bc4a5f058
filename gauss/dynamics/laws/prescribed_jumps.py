"""Jumps of prescribed motions: a position jump is an error, a velocity jump is an impact of the drive.

At a switching time the rows K v = C of relations become K⁺ v = C⁺. An impact takes the rates from the former to the latter:
Gauss's principle at velocity level, see :mod:`gauss.dynamics.contact.impact`. A kink of a prescribed position is a jump of
its velocity. The change of a smooth law between the times just before and just after is no jump, nor is rounding.
"""

from dataclasses import dataclass, fields

import numpy as np

from gauss.dynamics.constraint_scales import gap_scales
from gauss.dynamics.contact.impact import Impact, at_time, impact
from gauss.dynamics.gap_functions import TOUCHING, gaps, stacked_rows
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.switching_times import APART
from gauss.dynamics.projection import relative_velocity_residual, scalar_coordinates, velocity_residual_of
from gauss.errors import SimulationError
from gauss.scene import Constraint
from gauss.scene.values import evaluate
from gauss.system import State, System, retract, sides

RELATIVE = 1e-10  # of the largest coordinate, or velocity, in a row: a smaller change may be rounding in the law
SMOOTH = 4.0  # ratio to the change over an equal time beside the switching time: a smaller one may be the slope of the law
LOOKS = 33  # times at which magnitudes of laws are sampled, besides switching times
CONTRADICTION = 1e-6  # velocity residual after a jump, relative to the scales of the rows: a larger one is no rounding


@dataclass(frozen=True)
class Jumps:
    """Possible jumps of the prescribed velocities of a system."""

    system: System | None
    times: np.ndarray  # (k,) switching times of its relations with a possible jump [s]
    sizes: np.ndarray  # (2, r) range of the position, and largest velocity, that each row prescribes

    def __bool__(self):
        return bool(self.times.size)

    def within(self, before: float, after: float) -> bool:
        """Whether velocities may jump between two times [s]."""
        return bool(((self.times >= before) & (self.times <= after)).any())

    def names(self, state: State, after: float) -> tuple[str, ...]:
        """Relations whose velocity jumps between the time of a state and one just after it [s].

        SimulationError if a prescribed position jumps.
        """
        if self.system is None or not self.within(state.t, after):
            return ()
        motion = kinematics(self.system, state)
        found = _Sides(motion, state.t, after, self.sizes)
        _refuse(motion, found)
        return _names(self.system, found.speeds)

    def crossed(self, state: State, after: float) -> tuple[Impact, tuple[str, ...]] | None:
        """Impact, and the names of the relations whose velocity jumps; None if none does.

        SimulationError if a prescribed position jumps, the velocity constraints are inconsistent, or a contact with friction
        bears an impulse.
        """
        names, system = self.names(state, after), self.system
        if system is None or not names:
            return None
        return driven_impact(system, State(after, state.q, state.v), names, state.t), names

    def at_start(self, begin: float, end: float) -> float | None:
        """Time just after the start of a motion [s], if velocities may jump there."""
        after = begin + APART * max(abs(begin), abs(end))
        return after if self.within(begin, after) else None


def driven_impact(system: System, state: State, names: tuple[str, ...], since: float | None = None) -> Impact:
    """Impact of relations whose prescribed velocities jump.

    SimulationError if the velocity constraints are inconsistent, or a contact with friction bears an impulse.

    ``system``: the system after the jump. ``state``: state before it. ``since``: time just before the impact [s], where
    prescribed speeds differ from those at the time of the state.
    """
    parts = sides(system.scene)
    touching = np.flatnonzero(gaps(kinematics(system, state)).width <= TOUCHING * gap_scales(system))
    restitution = np.array([side.whole.restitution for side in parts])
    found = impact(system, state, touching, restitution, since=since, driven=names)
    _refuse_contradiction(system, found.state, names)
    rough = {slip.name for slip in system.slips.placed}
    words = ", ".join(map(repr, names))
    frictional = [parts[gap].whole.name for gap in found.active if parts[gap].name in rough]
    if frictional:
        raise SimulationError(
            f"t = {state.t:.6g} s: the prescribed speed of {words} jumps, and contact {frictional[0]!r}, "
            "which has friction, would bear an impulse. Prescribe a continuous speed, or give the drive a limit=."
        )
    return found


def _refuse_contradiction(system: System, state: State, names: tuple[str, ...]) -> None:
    """Raise a SimulationError where velocities after a jump cannot meet all constraints."""
    residual = velocity_residual_of(system, kinematics(system, state))
    if relative_velocity_residual(system, residual, state.v) > CONTRADICTION:
        words = ", ".join(map(repr, names))
        raise SimulationError(
            f"t = {state.t:.6g} s: the prescribed speed of {words} jumps, and no velocities meet it together with the other "
            "constraints: one motion is prescribed twice. Take one of the drives away."
        )


NO_JUMPS = Jumps(None, np.zeros(0), np.zeros((2, 0)))


def prescribed_jumps(system: System, start: State, end: float, stops) -> Jumps:
    """Possible jumps of prescribed velocities at given switching times.

    SimulationError if a prescribed position jumps at one of them.

    ``end``: final time [s]. ``stops``: times just before and just after each switching time of its relations [s].
    """
    if not system.relations.asks_time:
        return NO_JUMPS
    here = kinematics(system, start)
    somewhere = kinematics(system, generic_state(system, start))  # a generic state: rows may vanish at the start
    begun = start.t + APART * max(abs(start.t), abs(end))
    switching = [(start.t, begun), *((before, after) for before, after in stops if before < after)]
    sizes = _prescribed(here, [*np.linspace(start.t, end, LOOKS), *np.ravel(switching)])
    times = []
    for before, after in switching:
        found = _Sides(here, before, after, sizes)
        _refuse(here, found)
        if found.speeds.any() or _may_jump(somewhere, before, after):
            times.append(0.5 * (before + after))
    return Jumps(system, np.array(times), sizes) if times else NO_JUMPS


def _may_jump(motion: Kinematics, before: float, after: float) -> bool:
    """Whether a row jumps at a state; assumed where it has no finite value, and then decided during the motion."""
    try:
        found = _Sides(motion, before, after, np.zeros((2, 1)))
    except SimulationError:
        return True
    return bool(found.positions.any() or found.speeds.any())


class _Sides:
    """One-sided limits in time of the residuals of all relations at one state.

    ``sizes`` (2, r): magnitudes of the position and velocity that each row prescribes, to which a jump is compared.

    Attributes: ``gaps`` (r,): jump of the position residuals. ``positions``, ``speeds`` (r,): rows whose position residual
    jumps, and whose velocity residual does.
    """

    def __init__(self, motion: Kinematics, before: float, after: float, sizes: np.ndarray):
        apart, one, two = after - before, _residuals(motion, before), _residuals(motion, after)
        least, jump = RELATIVE * np.maximum(sizes, np.maximum(one[2:], two[2:])), np.abs(two - one)[:2]
        if (jump > least).any():
            smooth = np.abs(one - _residuals(motion, before - apart)) + np.abs(_residuals(motion, after + apart) - two)
            least = np.maximum(least, SMOOTH * smooth[:2])
        self.before, self.after, self.gaps, (self.positions, self.speeds) = before, after, (two - one)[0], jump > least


def _residuals(motion: Kinematics, t: float) -> np.ndarray:
    """Position and velocity residuals at a time, and the magnitudes of their terms, (4, r)."""
    system = motion.system
    J, C, _, gap = stacked_rows(at_time(motion, t), system.relations)
    velocities = np.concatenate([motion.quasi_velocities(), motion.state.v])
    bodies = [[1.0, 1.0, 1.0, *motion.x[body]] for body in range(system.structure.n_bodies)]
    places = np.concatenate([*bodies, scalar_coordinates(system, motion.state)])
    return np.array([gap, J @ velocities - C, np.abs(J) @ np.abs(places), np.abs(J) @ np.abs(velocities) + np.abs(C)])


def _prescribed(motion: Kinematics, times) -> np.ndarray:
    """Range of the position, and largest velocity, that each row prescribes at some times, (2, r)."""
    found = np.array([stacked_rows(at_time(motion, t), motion.system.relations)[1::2] for t in times])
    return np.array([np.ptp(found[:, 1], axis=0), np.abs(found[:, 0]).max(axis=0)])


def generic_state(system: System, start: State) -> State:
    """Generic state, at which no row vanishes."""
    rng = np.random.default_rng(0)
    away, rates = rng.uniform(0.1, 0.2, system.n_v), rng.uniform(0.5, 1.0, system.n_v)
    return State(start.t, retract(system, start.q, away * system.scale.coordinates), start.v + rates * system.scale.rates)


def _names(system: System, rows: np.ndarray) -> tuple[str, ...]:
    """Relations that some rows belong to."""
    ends = np.cumsum([placed.size for placed in system.relations.placed])
    parts = np.split(rows, ends[:-1])
    return tuple(placed.name for placed, part in zip(system.relations.placed, parts, strict=True) if part.any())


def _refuse(motion: Kinematics, found: _Sides):
    """Raise a SimulationError if a prescribed position jumps."""
    if not found.positions.any():
        return
    system, before, after = motion.system, found.before, found.after
    name = _names(system, found.positions)[0]
    size = _jump_of_law(system.scene.relations[name], before, after) or float(np.abs(found.gaps[found.positions]).max())
    raise SimulationError(
        f"constraint {name!r}: what it prescribes jumps by {size:.6g} [m, rad] at t = {before:.9g} s, which "
        "no finite impulse does. Give a law without jumps, for instance a ramp, or the profile 'move'."
    )


def _jump_of_law(relation, before: float, after: float) -> float:
    """Largest jump of the laws of time of a relation, 0 for a scleronomic one."""
    if isinstance(relation, Constraint):
        return 0.0
    laws = [getattr(relation, field.name) for field in fields(relation)]
    sides = [[np.asarray(evaluate(law, t), dtype=float) for t in (before, after)] for law in laws if callable(law)]
    return max((float(np.abs(two - one).max()) for one, two in sides), default=0.0)
