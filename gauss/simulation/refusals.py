"""Combinations of scene, integrator and stabilisation that make no sense, each with what does."""

from gauss.errors import SimulationError
from gauss.integrators import EXPLICIT, Library, RadauIIA
from gauss.simulation.problem import Problem
from gauss.simulation.timesteps.stepping import TIME_STEPPING


def refuse(problem: Problem):
    """Raise a SimulationError if the method cannot do what the scene and the arguments ask for."""
    system, method, stabilisation = problem.system, problem.method, problem.stabilisation
    if stabilisation == "ggl" and not isinstance(method, RadauIIA):
        raise SimulationError(f"integrator {method.name!r} knows no stabilisation 'ggl'; use 'radau5'.")
    mechanical = method.implicit if isinstance(method, Library) else method.mechanical
    if problem.drift.partitioned and (mechanical or isinstance(method, Library)):
        raise SimulationError(f"integrator {method.name!r} knows no stabilisation by partitioning; use 'projection'.")
    changing = system.scene.changing
    if stabilisation != "projection" and (changing or method is TIME_STEPPING):
        raise SimulationError(
            f"stabilisation {stabilisation!r}: motions with one-sided constraints, grips or time stepping are projected; "
            "use 'projection'."
        )
    if method is TIME_STEPPING:
        _refuse_links(problem)
    elif changing:
        _refuse_rough(problem)


def _refuse_links(problem: Problem):
    system = problem.system
    links = [name for name, grip in system.scene.grips.items() if callable(getattr(grip, "limit", callable))]
    if links or system.losses:
        raise SimulationError(
            "integrator 'time_stepping' takes no clutches, freewheels and losses, and no friction that comes and goes; "
            f"use 'dop853' for {', '.join(dict.fromkeys([*links, *system.losses]))}."
        )


def _refuse_rough(problem: Problem):
    system, method = problem.system, problem.method
    if system.slips.placed:
        rough = [name for name, contact in system.scene.contacts.items() if getattr(contact, "friction", 0.0)]
        raise SimulationError(
            f"integrator {method.name!r} takes no friction of contacts; use integrator='time_stepping' with a step= [s] for "
            f"{', '.join(rough)}."
        )
    if method.name not in [explicit.name for explicit in EXPLICIT]:  # dense output of others costs a step at every look
        raise SimulationError(
            f"integrator {method.name!r} does not find the events of one-sided constraints and grips; use 'dop853' for "
            f"{', '.join(system.scene.changing)}."
        )
