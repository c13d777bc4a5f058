"""Switching of laws along one motion: switching times, switching functions of the state, jumps of prescribed velocities."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from gauss.codegen import Expression
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.known_searches import KnownSearch
from gauss.dynamics.laws.narrow_peaks import NarrowPeaks, ends_of
from gauss.dynamics.laws.prescribed_jumps import NO_JUMPS, Jumps, prescribed_jumps
from gauss.dynamics.laws.sampled_laws import law_of_time, sampled_times
from gauss.dynamics.laws.switching_functions import functions_of
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable, timetable
from gauss.dynamics.laws.traced_laws import Laws, needs_poses, symbols, traced_law
from gauss.dynamics.store import cached
from gauss.integrators import Point
from gauss.scene.values import ConstantLaw, as_function
from gauss.system import BoundLoad, Relations, State, System
from gauss.system.contact_mode import has_own_gaps

LIMITS = ("limit", "torque", "hold", "speed")  # fields of set-valued elements that may be laws


class Switching(NamedTuple):
    """Switching times, switching functions and velocity jumps that the steps of a motion resolve."""

    times: Timetable = NO_TIMES  # switching times of laws of time, and a mesh that resolves these laws
    # :attr:`SwitchingFunctions.machine_code`; None where no law has a switching function of the state
    watch: Callable[[np.ndarray], np.ndarray] | None = None
    called: tuple[str, ...] = ()  # loads with opaque callbacks of the state
    conditional: tuple[str, ...] = ()  # loads whose laws have switching functions of the state
    jumps: Jumps = NO_JUMPS  # possible jumps of prescribed velocities
    peaks: NarrowPeaks | None = None  # smooth peaks and oscillations of traced laws that fixed steps may not resolve

    def share(self, begin: Point, end: Point) -> tuple[float, float, float]:
        """Share of a step without undetected crossings; number and place of those detected in all of it.

        The place is that of :meth:`SwitchingFunctions.share`.
        """
        if self.watch is None:
            return 1.0, 0.0, 1.0
        share, crossings, place = self.watch(np.concatenate(ends_of(begin, end)))
        return float(share), float(crossings), float(place)

    def oscillates(self, begin: Point, end: Point) -> bool:
        """Whether a law oscillates along the coordinates faster than a fixed step resolves."""
        return self.peaks is not None and self.peaks.oscillates(begin, end)


NO_SWITCHING = Switching()


def switching(system: System, laws: Laws, start: State, end: float, breaks=()) -> Switching:
    """Switching times, switching functions and velocity jumps of a motion.

    ``end``: final time [s]. ``breaks``: further switching times [s].
    """
    begin, monotone = start.t, bool(system.scene.nonsmooth)  # release of contacts is checked at few times of a step
    times, jumps = timed_switching(system, laws, start, end, breaks, monotone)
    timed = (system.contacts, system.set_valued) if has_own_gaps(system.scene) else (system.set_valued,)
    times = times.join(*(prescribed_times(found, begin, end, monotone) for found in timed))
    motion = Kinematics(system, start)  # its poses are computed on first access: many laws need none
    times = times.join(*(_sampled(bound, laws, motion, begin, end) for bound in laws.called))
    times = times.join(*_limits(system, start, end))
    watch, called = functions_of(system, laws), tuple(bound.load.name for bound in laws.called if needs_poses(bound.load))
    peaks = watch.narrow if watch is not None and (watch.may_be_narrow or watch.phases) else None
    found = Switching(times, None, called, jumps=jumps, peaks=peaks)
    return found._replace(watch=watch.machine_code, conditional=watch.names) if watch else found


def timed_switching(
    system: System, laws: Laws, start: State, end: float, breaks=(), monotone: bool = False
) -> tuple[Timetable, Jumps]:
    """Switching times and mesh of traced loads and of prescribed motions up to a time [s]; jumps of prescribed velocities.

    SimulationError if a prescribed position jumps.
    """
    begin, prescribed = start.t, prescribed_times(system.relations, start.t, end, monotone)
    times = _given_times(system, breaks, begin, end).join(prescribed)
    if laws.motion is not None and laws.outputs:
        times = times.join(timetable(laws.outputs, laws.motion.state.t, begin, end, monotone))
    last = prescribed.last_end(begin, end)
    return times, prescribed_jumps(system, start, end, [*prescribed.stops(begin, end), (last, end)])


def _sampled(bound: BoundLoad, laws: Laws, motion: Kinematics, begin: float, end: float) -> Timetable:
    """Jumps of the opaque laws of a load."""
    what, given = f"the law of {bound.load.name!r}", getattr(bound.load, "breaks", ())
    takes_motion = needs_poses(bound.load)
    uses_time = laws.fails(bound.load.name) and not takes_motion and not given
    found = []
    for k, law in enumerate(bound.laws):
        if not isinstance(law, ConstantLaw):
            known = cached(motion.system, (KnownSearch, bound.load.name, k), partial(KnownSearch, takes_motion))
            found.append(sampled_times(law, motion, begin, end, what, uses_time, known))
    return NO_TIMES.join(*found)


def called_laws(system: System, laws: Laws, start: State) -> Timetable:
    """Opaque laws of time, of which fixed steps may be too long; no switching time is looked for."""
    motion = Kinematics(system, start)
    bound = [law for one in laws.called for law in one.laws if not isinstance(law, ConstantLaw)]
    found = (law_of_time(law, motion) for law in bound)
    return Timetable(NO_TIMES.switches, NO_TIMES.mesh, laws=tuple(law for law in found if law is not None))


def _given_times(system: System, breaks, begin: float, end: float) -> Timetable:
    """Switching times given by the user, for the motion or for a load."""
    given = [*breaks, *(t for bound in system.loads for t in getattr(bound.load, "breaks", ()) if begin < t <= end)]
    return Timetable(np.unique(np.asarray(given, dtype=float)), np.zeros(0)) if given else NO_TIMES


def prescribed_times(relations: Relations, begin: float, end: float, monotone: bool = False) -> Timetable:
    """Switching times and mesh of the laws of time in relations."""
    function = relations.function
    if function is None or not relations.asks_time:
        return NO_TIMES
    outputs = [x for x in function.outputs if isinstance(x, Expression)]
    return timetable(outputs, function.inputs[-1], begin, end, monotone)


def _limits(system: System, start: State, end: float) -> list[Timetable]:
    """Switching times of the limits of set-valued elements, which are no loads while they stick."""
    given = [getattr(element, name, None) for element in system.scene.set_valued.values() for name in LIMITS]
    found = []
    for law in [value for value in given if callable(value)]:
        motion = symbols(system)
        traced = traced_law(law, motion)
        if isinstance(traced, str):
            found.append(sampled_times(as_function(law), kinematics(system, start), start.t, end))
        else:
            asked = [entry for entry in traced.outputs if isinstance(entry, Expression)]
            found.append(timetable(asked, motion.state.t, start.t, end, monotone=True))
    return found


def endless(t: float, names: tuple[str, ...]) -> str:
    """Message when laws of these loads chatter: time no longer advances."""
    return (
        f"t = {t:.6g} s: the law of {', '.join(map(repr, names))} switches again and again here (a sliding mode), "
        "as friction written with the sign of a rate does where it sticks. Use scene.joint_friction, or a continuous law, "
        "such as gauss.math.tanh(rate / width)."
    )
