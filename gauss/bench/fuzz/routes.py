"""A random scene moved by independent routes: agreement within the claimed error, and warnings.

The first route is machine code, by a method of the scene's own, with an estimate of the global error. The second is
certified at every evaluation; where they differ by more than is claimed it is repeated by a tighter tolerance. Where they
still differ, a third one, by another method and another backend, tells which is wrong, or that the motion hinges on digits
that nobody has. A second route that takes long is cut off, and compared as far as it came.
"""

import signal
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import gauss
from gauss.bench.fuzz.scenes import MovedScene, moved_scene
from gauss.dynamics.engines.tiering import compiled_at_once
from gauss.errors import BalanceWarning, GaussError, SwitchingWarning
from gauss.simulation.verify import differences

RTOL, TIGHT = 1e-7, 1e-8  # of the first routes, and of those that judge them where they differ
CLAIM = 20.0  # times the claims that two motions may be apart by
FLOOR = 100.0  # times the tolerance that they may be apart by in any case: a global error is some local ones
AS_USERS_GET_IT = 4  # one of so many scenes runs its first evaluations by numpy; phases of the others are compiled at once
ROUTE_TIME = 10.0  # [s] of processor time for a route
CUT_TIME = 2.0  # [s] of processor time after which the second route is compared as far as it came
SAYING = (BalanceWarning, SwitchingWarning)  # warnings that a motion is not to be trusted
MOVED = ("moved", "cut")
BAD = ("silent", "raised", "timed out", "crashed", "stray")


class TimeUpError(KeyboardInterrupt):
    """A route took more processor time than it may; what catches interruptions keeps the motion that there is."""


@dataclass
class Route:
    """Outcome of one route: "moved", "cut", "refused", "raised" or "timed out"; the reason, its samples and warnings."""

    outcome: str
    why: str = ""
    q: np.ndarray | None = None
    v: np.ndarray | None = None
    claim: tuple[float, float] = (0.0, 0.0)
    warned: tuple = ()


def examine_motion(seed: int, number: int, without: tuple = ()) -> dict:
    """Row of a random scene: what it is, the verdict, how far apart two routes were, what was claimed, and why.

    Verdicts: "agree"; "told": apart, but a warning or the estimated error reports it; "refused" by all with a GaussError,
    "refused once" by one; "sensitive": all three routes differ; and the bad ones, "silent": apart, and nothing says so;
    "raised": another exception; "timed out"; "stray": a warning that is none of gauss's.
    """
    begin = time.process_time()
    try:
        given = moved_scene(seed, number, without)
    except GaussError as error:
        empty = {"base": "", "elements": "", "integrator": ""}
        return _row(seed, number, empty, "refused", begin, why=f"{type(error).__name__}: {error}")
    words = {"base": given.base, "elements": "+".join(sorted(given.elements)), "integrator": given.integrator}
    routes = _routes(given, number)
    verdict, off, why = _verdict(given, routes)
    reached = (moved_until(given, route) for route in routes if route.outcome in MOVED)
    more = {"claim": max(routes[0].claim), "compared": min(reached, default=0.0) if np.isfinite(off) else np.nan}
    warned = "+".join(sorted({kind for route in routes for kind in route.warned}))
    return _row(seed, number, words, verdict, begin, off=off, warned=warned, why=why, **more)


def _routes(given: MovedScene, number: int) -> list[Route]:
    """Compiled motion, the certified one beside it, and of some scenes a rollout."""
    with nullcontext() if number % AS_USERS_GET_IT == 0 else compiled_at_once():
        routes = [_route(given, given.integrator, "auto", RTOL, verify=True)]
    if routes[0].outcome in ("timed out", "raised"):  # the verdict is clear then
        return routes
    second = _second(given, RTOL, CUT_TIME)
    routes.append(_second(given, RTOL, ROUTE_TIME) if second.outcome == "timed out" else second)  # not one sample
    if given.integrator == "dop853" and number % 3 == 0 and not given.scene.nonsmooth:
        routes.append(_caught(lambda: _rolled_out(given)))
    return routes


def moved_until(given: MovedScene, route: Route) -> float:
    """Time of the last sample of a route, relative to the duration."""
    assert route.q is not None
    return float(given.times[len(route.q) - 1]) / given.duration


def _row(seed, number, words, verdict, begin, off=np.nan, claim=np.nan, compared=np.nan, warned="", why="") -> dict:
    numbers = {"off": float(off), "claim": float(claim), "compared": float(compared)}
    row = {"seed": seed, "number": number} | words | {"verdict": verdict} | numbers
    return row | {"warned": warned, "seconds": time.process_time() - begin, "why": why}


def _second(given: MovedScene, rtol: float, seconds: float) -> Route:
    """The certified route; with friction of contacts, which nothing else takes, by the same steps in time."""
    integrator = given.integrator if _has_friction(given) else "dop853"
    return _cut(_route(given, integrator, "recursion", rtol, seconds=seconds))


def _cut(route: Route) -> Route:
    """Route that is compared as far as it came, if it came to a sample."""
    return replace(route, outcome="cut") if route.outcome == "timed out" and route.q is not None else route


def _has_friction(given: MovedScene) -> bool:
    return any(getattr(contact, "friction", 0.0) for contact in given.scene.contacts.values())


def _verdict(given: MovedScene, routes: list[Route]) -> tuple[str, float, str]:
    failed = _failed(routes)
    if failed is not None:
        return failed[0], np.nan, failed[1]
    moved, far = _compared(given, [route for route in routes if route.outcome in MOVED])
    if far <= 1.0:
        return "agree", far, ""
    said = {kind for route in moved for kind in route.warned} & {kind.__name__ for kind in SAYING}
    if said or not np.isfinite(moved[0].claim).all():
        return "told", far, "+".join(sorted(said)) or "infinite claim"
    return _third_route(given, moved, far)


def _compared(given: MovedScene, moved: list[Route]) -> tuple[list[Route], float]:
    """Routes and how far they are apart; where that is far, with the second one more exact."""
    far = max(_far(given, moved[0], other) for other in moved[1:])
    again = _second(given, TIGHT, ROUTE_TIME) if far > 1.0 and not _has_friction(given) else None
    if again is None or again.outcome not in MOVED:
        return moved, far
    moved = [moved[0], again, *moved[2:]]
    return moved, max(_far(given, moved[0], other) for other in moved[1:])


def _failed(routes: list[Route]) -> tuple[str, str] | None:
    """Verdict and reason where a route did not end well, or both did not move."""
    for outcome in ("timed out", "raised"):
        for name, route in zip(("first", "second", "rollout"), routes, strict=False):
            if route.outcome == outcome:
                return outcome, f"{name}: {route.why}"
    stray = [kind for route in routes for kind in route.warned if kind.startswith("!")]
    if stray:
        return "stray", stray[0]
    refused = [route.why for route in routes[:2] if route.outcome == "refused"]
    if refused:
        return ("refused" if len(refused) == 2 else "refused once"), refused[0]
    return None


def _third_route(given: MovedScene, moved: list[Route], far: float) -> tuple[str, float, str]:
    """Verdict by a third route, and a claim of the second."""
    if _has_friction(given):
        return "silent", far, "time stepping by two backends"
    third = _cut(_route(given, "dopri5", "kkt", TIGHT, verify=True))
    if third.outcome not in MOVED:
        return "silent", far, f"third route {third.outcome}: {third.why}"
    apart_of = [_far(given, third, route, alone=True) for route in moved]
    if min(apart_of) <= 1.0 and (apart_of[1] <= 1.0 or np.isfinite(third.claim).all()):
        return "silent", far, f"the third route is with the {('first', 'second', 'rollout')[int(np.argmin(apart_of))]}"
    return "sensitive", far, f"third route apart by {min(apart_of):.3g}, claims {max(third.claim):.3g}"


def _far(given: MovedScene, one: Route, other: Route, alone: bool = False) -> float:
    """How far two motions are apart, over what they may be."""
    assert one.q is not None and one.v is not None and other.q is not None and other.v is not None  # both moved
    shares, n = [], min(len(one.q), len(other.q))
    pairs = ((differences(given.system, one.q[:n], other.q[:n]), one.q[:n]), (one.v[:n] - other.v[:n], one.v[:n]))
    for (off, values), claim in zip(pairs, np.add(one.claim, other.claim), strict=True):
        floor = FLOOR * RTOL * max(min(1.0, given.size), np.abs(values).max(initial=0.0))
        shares.append(np.abs(off).max(initial=0.0) / (floor + (0.0 if alone else CLAIM * claim)))
    return float(np.nan_to_num(max(shares), nan=np.inf))


def _route(
    given: MovedScene, integrator: str, backend: str, rtol: float, verify: bool = False, seconds: float | None = None
) -> Route:
    atol = rtol * min(1.0, given.size)
    options: dict[str, Any] = {
        "rtol": rtol,
        "atol": atol,
        "backend": backend,
        "verify": verify,
        "progress": False,
        "times": given.times,
    }
    step = given.step if integrator == given.integrator else None
    move = lambda: gauss.simulate(given.system, given.duration, integrator=integrator, step=step, **options)  # noqa: E731
    return _caught(move, seconds)


def _rolled_out(given: MovedScene):
    system = given.system
    start = system.initial_state()
    starts = np.tile(start.q, (2, 1)), np.tile(start.v, (2, 1))
    return gauss.rollout(
        system, *starts, integrator="dop853", times=given.times, rtol=TIGHT, atol=TIGHT * min(1.0, given.size)
    )


def _caught(move: Callable, seconds: float | None = None) -> Route:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        route = _timed(move, ROUTE_TIME if seconds is None else seconds)
    kinds = {_kind(warning) for warning in caught}
    route.warned = tuple(sorted(kinds))
    return route


def _kind(warning) -> str:
    """Name of a warning of gauss's; that of another with a mark, its origin and its message."""
    ours = warning.category.__module__.startswith("gauss")
    return (
        warning.category.__name__
        if ours
        else f"!{warning.category.__name__} {Path(warning.filename).name}:{warning.lineno} {warning.message}"
    )


def _timed(move: Callable, seconds: float) -> Route:
    """Outcome of a route within a processor time [s]."""
    before = signal.signal(signal.SIGPROF, _time_up)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        found = move()
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    except TimeUpError as error:
        there = getattr(error, "trajectory", None)
        if there is None or not len(there):
            return Route("timed out", f"before the first sample, {_where(error)}")
        return Route("timed out", f"at t = {there.t[-1]:.6g} s, {_where(error)}", q=there.q, v=there.v)
    except GaussError as error:
        return Route("refused", f"{type(error).__name__}: {error}")
    except Exception as error:  # what this is about
        return Route("raised", f"{type(error).__name__}: {error} ({_where(error)})")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    q, v = (values[0] if np.ndim(values) == 3 else values for values in (found.q, found.v))
    claim = getattr(getattr(found, "stats", None), "global_error", None)
    return Route("moved", q=q, v=v, claim=claim or (0.0, 0.0))


def _time_up(*_):
    raise TimeUpError


def _where(error: BaseException) -> str:
    """Last places of gauss in the trace of an exception."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "gauss" in Path(frame.filename).parts]
    return " < ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in frames[:-4:-1])
