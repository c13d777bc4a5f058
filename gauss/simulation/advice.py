"""What to do about a motion whose energy balance is off: the method, its step or tolerance, and forces that jump."""

from collections.abc import Callable, Collection

import numpy as np

from gauss.dynamics.laws import FIELDS, Laws
from gauss.integrators import METHODS, FixedStep
from gauss.scene.values import arguments, evaluate
from gauss.system import System, obstacles

PRESCRIBED = ("position", "speed", "path")  # where relations and limited drives keep laws of time
GRID, HALVINGS = 2048, 60  # a jump is looked for between so many times, and then closed in on
JUMP = 1e-3  # of all that a law changes by: what is left of a change between neighbouring times is a jump
TIGHT = 1e-10  # tolerance beyond which a tighter one is no advice


def advice(system: System, settings: dict, events=(), stepped: bool = False, span=None) -> str:
    """Sentence on what may be wrong, and what to do.

    Parameters
    ----------
    system : System
        What moved.
    settings : dict
        How: integrator, step, rtol and atol, as far as that is known.
    events : sequence of Event
        Of the motion.
    stepped : bool
        Whether it was made by time stepping.
    span : tuple of float, optional
        First and last time [s]; between them laws of time are asked where they jump.
    """
    laws, said = Laws(system), [_method(settings, stepped)]
    impacts = sum(event.kind == "impact" for event in events)
    if impacts:
        said.append(f"the losses at {impacts} impacts are booked, they are not what is off")
    if laws.called:
        said.append(f"{_laws(laws.reasons)} called from Python, so where it switches is not known: {_breaks()}")
    if laws.switching:
        said.append(f"{_laws(laws.switching)} written with branches, where a force may jump: {_breaks()}")
    said += _prescribed(system, span) if span else []
    return "; ".join(said)


def _method(settings: dict, stepped: bool) -> str:
    step, method = settings.get("step"), METHODS.get(settings.get("integrator"))
    of = "" if step is None else f" than {step:g} s"
    if stepped:
        return (
            "time stepping is of order 1 where something is hit or begins to slide or stick, so this shrinks in proportion "
            f"to the step: give a smaller step{of}"
        )
    if isinstance(method, FixedStep):
        return f"{method.name!r} is of order {method.order}: give a smaller step{of}, or a method of higher order"
    if step is not None and method is None:
        return f"give a smaller step{of}"
    if "rtol" in settings and np.max(settings["rtol"]) <= TIGHT:
        return "the tolerance is tight, so a force may jump, or act more briefly than a step: limit that with step= [s]"
    return "give tighter rtol and atol" if settings else "give a smaller step or tolerance, or another integrator"


def _breaks() -> str:
    return "give breaks=[…] [s] where that is, or step= [s], the longest step"


def _laws(names: Collection[str]) -> str:
    words = ", ".join(map(repr, names))
    return f"the law of {words} is" if len(names) == 1 else f"the laws of {words} are"


def _prescribed(system: System, span: tuple[float, float]) -> list[str]:
    """Laws of time that jump: where, and what that means."""
    said = []
    scene = system.scene
    for name, thing in [*scene.relations.items(), *scene.grips.items()]:
        laws = [law for law in (getattr(thing, field, None) for field in PRESCRIBED) if callable(law)]
        times = [t for t in (jump(lambda t, law=law: evaluate(law, t), *span) for law in laws) if t is not None]
        if times:
            said.append(f"{name!r} prescribes a jump at t = {times[0]:.6g} s, which takes an infinite force: smooth it")
    for bound in [] if obstacles(system) else system.loads:
        laws = [law for law in (getattr(bound.load, field, None) for field in FIELDS) if callable(law)]
        times = [jump(law, *span) for law in laws if arguments(law) == 1]
        said += [f"the law of {bound.load.name!r} jumps at t = {t:.6g} s" for t in times[:1] if t is not None]
    return said


def jump(law: Callable, begin: float, end: float) -> float | None:
    """Time at which a law of time jumps most between two others; None where it is continuous.

    Parameters
    ----------
    law : callable
        Time [s] → number or numbers.
    begin, end : float
        Between which times it is asked [s].
    """
    times = np.linspace(begin, end, GRID)
    values = np.array([np.ravel(np.asarray(law(float(t)), dtype=float)) for t in times])
    steps = np.abs(np.diff(values, axis=0)).max(axis=1)
    place = int(np.argmax(steps))
    one, two, whole = times[place], times[place + 1], np.ptp(values, axis=0).max()
    low, high = values[place], values[place + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (one + two)
        if not one < middle < two:
            break
        value = np.ravel(np.asarray(law(float(middle)), dtype=float))
        if np.abs(value - low).max() < np.abs(high - value).max():
            one, low = middle, value
        else:
            two, high = middle, value
    return two if np.abs(high - low).max() > JUMP * whole > 0.0 else None
