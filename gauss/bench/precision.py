"""Work against precision: what a digit costs in a motion, with each integrator, and with each backend.

The error of a motion is how far the centres of mass are from where a reference has them at the end, the largest of all [m].
"""

import textwrap
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from gauss.analysis import energy
from gauss.backends import available
from gauss.bench.contest import with_time
from gauss.bench.extrapolation import extrapolated
from gauss.bench.levels import AUTO
from gauss.bench.table import chosen
from gauss.dynamics import compile_scene
from gauss.dynamics.assemble import position_residual
from gauss.errors import BalanceWarning, GaussError, SimulationError, did_you_mean
from gauss.integrators import FixedStep
from gauss.scene import Scene
from gauss.simulation import INTEGRATORS, Trajectory, simulate
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING
from gauss.system import System

USUAL = ("dop853", "taylor", "dopri5", "rk4", "semi_implicit_euler", "verlet", "gauss6", "radau5", "generalised_alpha")
TOLERANCES = tuple(10.0**-k for k in range(3, 15))
DIVISIONS = tuple(2**k for k in range(5, 21, 2))  # of the duration, into fixed steps
LOST_DISTANCE = 10.0  # m: a motion that is off by more has nothing to do with the reference
TWO = ("dopri5", "dop853")  # a reference, and its check
FINEST = 1e-14
STEPS = 2**14  # of the finest run from which time stepping is extrapolated
SENTENCE = 120  # letters of a reason, at most
FEWEST, SLOW = 3, 10.0  # settings of a backend, and times of the limit that one of these may take
REPEATS = 3  # of a run that takes less than a tenth of the time allowed; the least time counts


@dataclass(frozen=True)
class Attempt:
    """One motion by one method with one setting."""

    engine: str  # engine, method: who computed it, and how: the integrator, and the backend where one was asked for
    method: str
    setting: float  # tolerance, or step [s]
    error: float = np.nan  # of the centres of mass at the end [m]
    # seconds, compile_seconds: wall time of a run, and of making its machine code before, which is not in it [s]
    seconds: float = np.nan
    compile_seconds: float = np.nan
    drift: float = np.nan  # change of energy that work does not explain [J]
    gap: float = np.nan  # largest constraint residual at the end [rad, m]
    reason: str = ""  # why there is no result; empty if there is one

    @property
    def failed(self) -> bool:
        """Whether there is no result, or none of use."""
        return bool(self.reason)


@dataclass(frozen=True)
class ReferencePositions:
    """Final positions of the centres of mass (n, 3), and bounds of their errors [m]."""

    positions: np.ndarray
    uncertainty: float
    source: str


def described(one: Attempt) -> str:
    """The setting of a motion by gauss, with what it is: a step [s], or a tolerance."""
    fixed = isinstance(INTEGRATORS[one.method.partition(" with ")[0]], FixedStep)
    return f"step {one.setting:.2g} s" if fixed else f"tolerance {one.setting:.2g}"


def settings(method: str, duration: float) -> tuple[float, ...]:
    """Tolerances, or fixed steps [s], from coarse to fine."""
    return tuple(duration / n for n in DIVISIONS) if isinstance(INTEGRATORS[method], FixedStep) else TOLERANCES


def centres(trajectory: Trajectory) -> np.ndarray:
    """Centres of mass (n, 3) at the end of a motion [m]."""
    return np.array(trajectory.motions[-1].x[: trajectory.system.structure.n_bodies])


def usual(system: System) -> tuple[str, ...]:
    """Integrators that are charted when none is chosen: those that take the contacts of a scene, and some that do not."""
    if _slides(system):
        return (TIME_STEPPING.name,)
    return (*USUAL, TIME_STEPPING.name) if system.scene.nonsmooth else USUAL


def reference(system: System, duration: float, steps: int | None = None) -> ReferencePositions:
    """Reference of a motion by the finest run of one method; another method estimates its error.

    Where contacts have friction, it is extrapolated from time stepping with up to so many ``steps``, ``STEPS`` when not
    given; see :mod:`gauss.bench.extrapolation`.

    SimulationError if the motion cannot be computed.
    """
    run: dict[str, Any] = {"times": [duration], "progress": False}
    if _slides(system):
        stepped = lambda h: centres(simulate(system, duration, integrator=TIME_STEPPING.name, step=h, **run))  # noqa: E731
        steps = steps or STEPS
        found = extrapolated(stepped, duration, steps)
        source = f"time stepping with up to {steps} steps, extrapolated to steps of no length"
        return ReferencePositions(
            found.values.reshape(-1, 3), found.uncertainty, f"{source}; uncertain by {found.uncertainty:.1e} m"
        )
    one, two = (centres(simulate(system, duration, integrator=name, rtol=FINEST, atol=FINEST, **run)) for name in TWO)
    off = float(np.abs(one - two).max(initial=0.0))
    return ReferencePositions(one, off, f"{TWO[0]} with a tolerance of {FINEST:g}; {TWO[1]} differs by {off:.1e} m")


def _slides(system: System) -> bool:
    """Whether contacts have friction, which time stepping alone takes."""
    return bool(system.slips.placed)


def attempts(
    scene: Scene | System,
    duration: float,
    against: ReferencePositions | None = None,
    methods: Sequence[str] | None = None,
    time_limit: float = 2.0,
    backends: Sequence[str] | None = None,
) -> Iterator[Attempt]:
    """Motions by all methods with settings from coarse to fine, until a run takes longer than ``time_limit`` [s].

    Backends get three settings at least, so that there is a curve, unless a run takes ten times as long.

    SimulationError if there is no such integrator.
    BackendError if there is no such backend.

    Parameters
    ----------
    scene : Scene or System
        What moves.
    duration : float
        How long [s].
    against : ReferencePositions, optional
        The reference; :func:`reference` when not given.
    methods : sequence of str, optional
        Integrators; the :func:`usual` ones when not given, with backends the first of them.
    time_limit : float
        Longest run [s].
    backends : sequence of str, optional
        How accelerations are solved, each by itself; "auto" when not given.
    """
    _require_charted(methods or ())
    backends = chosen(backends, (AUTO, *available()), "backend") if backends else ()
    system = scene if isinstance(scene, System) else compile_scene(scene)
    against = reference(system, duration) if against is None else against
    methods = methods or usual(system)[: 1 if backends else None]
    for method, backend in product(methods, backends or (None,)):
        for count, setting in enumerate(settings(method, duration), start=1):
            found = attempt(system, duration, method, setting, against, time_limit, backend)
            yield found
            if found.seconds > time_limit * _of_limit(backend, count):
                break


def _of_limit(backend: str | None, count: int) -> float:
    """Times of the limit that the run of a setting may take: more for the first ones of a backend."""
    return 1.0 if backend is None or count >= FEWEST else SLOW


def _require_charted(methods: Iterable[str]):
    for method in methods:
        if method not in INTEGRATORS:
            raise SimulationError(f"no integrator {method!r} to chart. {did_you_mean(method, INTEGRATORS)}")


def attempt(
    system: System,
    duration: float,
    method: str,
    setting: float,
    against: ReferencePositions,
    time_limit: float,
    backend: str | None = None,
) -> Attempt:
    """One motion; its second run is timed, the first makes the machine code. A backend that is given is named."""
    fixed = isinstance(INTEGRATORS[method], FixedStep)
    tolerances = {"step": setting} if fixed else {"rtol": setting, "atol": setting}
    run: dict[str, Any] = {"integrator": method, "backend": backend or AUTO, "times": [0.0, duration], "progress": False}
    run |= tolerances
    name = method if backend is None else f"{method} with {backend}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BalanceWarning)  # coarse settings are asked for; the drift is reported
            trajectory, first, best = _timed(system, duration, run, time_limit)
    except SimulationError as error:
        return Attempt("gauss", name, setting, reason=_short(str(error).removeprefix(f"integrator {method!r} ")))
    except (GaussError, ArithmeticError, ValueError) as error:
        return Attempt("gauss", name, setting, reason=_short(f"{type(error).__name__}: {error}"))
    off = float(np.abs(centres(trajectory) - against.positions).max(initial=0.0))
    drift, gap = abs(float(energy(trajectory).balance[-1])), _gap(system, trajectory)
    reason = "" if off <= LOST_DISTANCE else "lost"
    return Attempt("gauss", name, setting, off, best, max(first - best, 0.0), drift, gap, reason)


def _timed(system: System, duration: float, run: dict[str, Any], time_limit: float) -> tuple[Trajectory, float, float]:
    """A motion, the time of its first run, and the least of the runs after it [s]."""
    move = partial(simulate, system, duration, **run)
    (trajectory, first), best = with_time(move, time.perf_counter), np.inf
    for _ in range(REPEATS):
        trajectory, seconds = with_time(move, time.perf_counter)
        best = min(best, seconds)
        if best > time_limit / 10:
            break
    return trajectory, first, best


def _gap(system: System, trajectory: Trajectory) -> float:
    return float(np.abs(position_residual(trajectory.motions[-1])).max(initial=0.0)) if system.has_closures else 0.0


def front(found: Iterable[Attempt]) -> list[Attempt]:
    """Attempts that no other beats in both time and error, the quickest first."""
    best, kept = np.inf, []
    for one in sorted((one for one in found if not one.failed), key=lambda one: (one.seconds, one.error)):
        if one.error < best:
            best = one.error
            kept.append(one)
    return kept


def _short(text: str) -> str:
    """First sentence of a message."""
    return textwrap.shorten(text.split("; ")[0].split(". ")[0], SENTENCE, placeholder=" …")
