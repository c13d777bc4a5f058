"""Advice on a motion whose energy balance has an error: method, step or tolerance, opaque laws."""

from collections.abc import Collection

import numpy as np

from gauss.dynamics.inputs import HeldLaw
from gauss.dynamics.laws.traced_laws import Laws
from gauss.integrators import METHODS, FixedStep
from gauss.system import System

TIGHT = 1e-10  # rtol below which a tighter one does not help


def advice(system: System, settings: dict, events=(), stepped: bool = False) -> str:
    """Likely cause and remedy, in words, by the settings that are known; ``stepped``: of time stepping."""
    laws, said = Laws(system), [_method(settings, stepped)]
    impacts = sum(event.kind == "impact" for event in events)
    if impacts:
        said.append(f"the losses at {impacts} impacts are booked and not the cause")
    opaque = [name for name in laws.reasons if not _is_held(system, name)]
    if opaque:
        said.append(
            f"{_laws(opaque)} untraceable, so switching times are not known: give them as breaks=[…] [s], or "
            "the longest step as step= [s]"
        )
    return "; ".join(said)


def _is_held(system: System, name: str) -> bool:
    """Whether a load stands for an input that is held between samples, at which steps end."""
    return isinstance(getattr(system.scene.loads.get(name), "effort", None), HeldLaw)


def _method(settings: dict, stepped: bool) -> str:
    step, method = settings.get("step"), METHODS.get(settings.get("integrator", ""))
    of = "" if step is None else f" than {step:g} s"
    if stepped:
        return (
            "time stepping is of order 1 at impacts and stick–slip transitions, so this error is proportional to the "
            f"step: give a smaller step{of}"
        )
    if isinstance(method, FixedStep):
        return f"{method.name!r} is of order {method.order}: give a smaller step{of}, or a method of higher order"
    if step is not None and method is None:
        return f"give a smaller step{of}"
    if "rtol" in settings and np.max(settings["rtol"]) <= TIGHT:
        return "the tolerance is tight, so a force may jump, or be shorter than a step: limit the step with step= [s]"
    return "give tighter rtol and atol" if settings else "give a smaller step or tolerance, or another integrator"


def _laws(names: Collection[str]) -> str:
    words = ", ".join(map(repr, names))
    return f"the law of {words} is" if len(names) == 1 else f"the laws of {words} are"
