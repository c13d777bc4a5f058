"""Motions of some members of a sweep: those of one kind by one ensemble, the others by :func:`gauss.simulate`."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from textwrap import shorten

import numpy as np

from gauss.dynamics import compile_scene
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import numbers
from gauss.errors import GaussError, SimulationError
from gauss.scene import Scene
from gauss.scene.named_numbers import is_start, scene_of
from gauss.simulation import Stats, Trajectory, simulate
from gauss.simulation.batch.ensemble import Ensemble
from gauss.simulation.energy_balance import imbalances
from gauss.simulation.sweeps.parameters import Members
from gauss.system import State, System

MISSING, DONE, FAILED = 0, 1, 2  # status of a member
LONGEST_REASON = 200  # characters
MOST_ENSEMBLES = 16  # that are cached
CHANGED_LAW = (  # the value of one member would act on all
    "a law of a load looks up something that has changed since its scene was made; give it to the law, e.g. lambda t, k=k: …"
)


@dataclass(frozen=True)
class SweepTask:
    """Simulation of every member of a sweep."""

    scene: Scene | Callable[..., Scene]  # scene, or a function that makes scenes of parameter values by name
    members: Members  # parameter values
    times: np.ndarray  # (k,) samples [s]
    settings: dict  # integrator, step, rtol and atol
    measure: dict[str, Callable[[Trajectory], float]] = field(default_factory=dict)  # functions of the motion of a member
    threads: int = 1  # that share the motions
    device: str | None = None  # name of devices; this CPU by default


@dataclass
class MemberResults:
    """Motions of some members; NaN where a member failed."""

    q: np.ndarray  # (batch, k, n_q) coordinates
    v: np.ndarray  # (batch, k, n_v) rates
    status: np.ndarray  # (batch,) DONE or FAILED
    reason: np.ndarray  # (batch,) reason of a failure
    energy_error: np.ndarray  # (batch,) residual of the energy balance, relative to the largest energy of the member
    measured: dict[str, np.ndarray]  # numbers (batch,) by name


@dataclass(frozen=True)
class _Member:
    """Compiled member with its initial state, numbers and kind."""

    system: System
    start: State
    numbers: np.ndarray
    kind: tuple


def run(task: SweepTask, begin: int, end: int, shape: tuple[int, int]) -> MemberResults:
    """Motions of members begin … end − 1, of systems with n_q, n_v = shape; failures have a reason."""
    count, k = end - begin, len(task.times)
    found = MemberResults(
        np.full((count, k, shape[0]), np.nan),
        np.full((count, k, shape[1]), np.nan),
        np.full(count, FAILED, dtype=np.int8),
        np.full(count, "", dtype=f"<U{LONGEST_REASON}"),
        np.full(count, np.nan),
        {name: np.full(count, np.nan) for name in task.measure},
    )
    kinds: dict[tuple, list[tuple[int, _Member]]] = {}
    built: dict[tuple, _Member] = {}
    for place, values in enumerate(task.members.of(begin, end)):
        made = _attempt(found, place, lambda values=values: _member(task.scene, values, shape, built))
        if made is not None:
            kinds.setdefault(made.kind, []).append((place, made))
    for some in kinds.values():
        _move(task, some, found)
    return found


def _member(scene, values: dict[str, float], shape, built: dict[tuple, _Member]) -> _Member:
    """Member; its system is that of a member whose scene differs in the initial state only, if there is one."""
    own = scene_of(scene, values)
    fixed = tuple(value for name, value in values.items() if isinstance(scene, Scene) and not is_start(scene, name))
    if isinstance(scene, Scene) and fixed in built:
        system = replace(built[fixed].system, scene=own)
        return replace(built[fixed], system=system, start=system.initial_state())
    system = compile_scene(own)
    if (system.n_q, system.n_v) != shape:
        sizes = f"{system.n_q} coordinates and {system.n_v} rates, the first member {shape[0]} and {shape[1]}"
        raise SimulationError(f"members of a sweep need the same coordinates; this one has {sizes}.")
    found, kind = numbers(system)
    built[fixed] = _Member(system, system.initial_state(), found, (*kind, Laws(system).key))
    return built[fixed]


def _attempt(found: MemberResults, place: int, make: Callable):
    """Result of ``make`` for a member; None where it fails, with the reason in ``found``."""
    try:
        return make()
    except Exception as error:  # functions of the user may fail in any way; the others go on
        kind = "" if isinstance(error, GaussError) else f"{type(error).__name__}: "
        found.reason[place] = shorten(f"{kind}{error}", LONGEST_REASON, placeholder=" …")
        found.status[place] = FAILED
        return None


def _move(task: SweepTask, some: list[tuple[int, _Member]], found: MemberResults):
    """Motions of members of one kind."""
    places, made = zip(*some, strict=True)
    if Laws(made[0].system).key != made[0].kind[-1]:
        found.reason[list(places)] = CHANGED_LAW
        return
    samples, singly, share = _by_ensemble(task, made)
    for row, (place, member) in enumerate(some):
        again = samples is None or singly[row]
        made = _attempt(found, place, lambda: _simulated(task, member)) if again else (samples[row], share[row])  # noqa: B023
        if made is None:
            continue
        motion, found.energy_error[place] = made
        found.q[place], found.v[place] = np.split(motion, [member.system.n_q], axis=1)
        found.status[place] = DONE
        for name in task.measure:
            found.measured[name][place] = _measured(task, name, member, motion, found, place)


def _by_ensemble(task: SweepTask, made: tuple[_Member, ...]):
    """Samples (batch, k, n_q + n_v) of members of one kind, which of them failed a check, and imbalances.

    None where there can be no ensemble.
    """
    values = np.array([member.numbers for member in made])
    starts = np.array([np.concatenate([member.start.q, member.start.v]) for member in made]).T
    ensemble = _ensemble(task, made[0], values)
    return (None, None, None) if ensemble is None else ensemble.move(starts, values, task.times, task.threads)


_ENSEMBLES: dict[tuple, Ensemble] = {}  # cached in the process: later pieces are of the same kinds


def _ensemble(task: SweepTask, first: _Member, values: np.ndarray) -> Ensemble | None:
    """Ensemble of members of a kind; None if it cannot be compiled."""
    key = first.kind, repr(task.settings), task.device
    ensemble = _ENSEMBLES.get(key)
    if ensemble is None or not ensemble.covers(values):
        known = values if ensemble is None else np.concatenate([ensemble.known, values])
        try:
            ensemble = Ensemble(first.system, known, **task.settings, device=task.device)
        except SimulationError:
            return None
        while len(_ENSEMBLES) >= MOST_ENSEMBLES:
            del _ENSEMBLES[next(iter(_ENSEMBLES))]
        _ENSEMBLES[key] = ensemble
    return ensemble


def _simulated(task: SweepTask, member: _Member) -> tuple[np.ndarray, float]:
    """Samples (k, n_q + n_v) of a member by :func:`gauss.simulate`, and its relative imbalance."""
    duration = float(task.times[-1])
    with imbalances() as found:
        motion = simulate(member.system, duration, state=member.start, times=task.times, progress=False, **task.settings)
    return np.concatenate([motion.q, motion.v], axis=1), found[-1].share


def _measured(task: SweepTask, name: str, member: _Member, motion: np.ndarray, found: MemberResults, place: int) -> float:
    stats = Stats(0, 0, 0, 0, 0.0, 0.0, "member of a sweep")
    q, v = np.split(motion, [member.system.n_q], axis=1)
    trajectory = Trajectory(member.system, task.times, q, v, np.full((len(q), 3), np.nan), stats)
    number = _attempt(found, place, lambda: float(task.measure[name](trajectory)))
    return np.nan if number is None else number
