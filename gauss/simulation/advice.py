"""What to do about a motion whose energy balance is off: the method, its step or tolerance, laws that cannot be traced."""

from collections.abc import Collection

import numpy as np

from gauss.dynamics.laws import Laws
from gauss.integrators import METHODS, FixedStep
from gauss.system import System

TIGHT = 1e-10  # tolerance beyond which a tighter one is no advice


def advice(system: System, settings: dict, events=(), stepped: bool = False) -> str:
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
    """
    laws, said = Laws(system), [_method(settings, stepped)]
    impacts = sum(event.kind == "impact" for event in events)
    if impacts:
        said.append(f"the losses at {impacts} impacts are booked, they are not what is off")
    if laws.called:
        said.append(f"{_laws(laws.reasons)} called from Python, so where it switches is not known: {_breaks()}")
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
