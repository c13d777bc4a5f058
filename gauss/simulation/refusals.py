"""Invalid combinations of scene, integrator and stabilisation, each with a remedy."""

from gauss import integrators
from gauss.dynamics.plan import is_time_stepping
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.errors import SimulationError
from gauss.integrators import Library
from gauss.simulation.problem import Problem
from gauss.system import System

SHOWN = 5  # names of contacts in a message: a scene may have thousands


def refuse(problem: Problem):
    """Raise an error if the start or the method does not apply to the scene, or not with its stabilisation."""
    system, method, stabilisation = problem.system, problem.method, problem.stabilisation
    refuse_other_pose(system, problem.start.q)
    if stabilisation == "ggl" and not isinstance(method, integrators.RadauIIA):
        raise SimulationError(f"integrator {method.name!r} knows no stabilisation 'ggl'; use 'radau5'.")
    if problem.drift.partitioned and (isinstance(method, Library) or method.mechanical):
        raise SimulationError(f"integrator {method.name!r} knows no stabilisation by partitioning; use 'projection'.")
    nonsmooth, time_stepping = system.nonsmooth, is_time_stepping(problem)
    if stabilisation != "projection" and (nonsmooth or time_stepping):
        raise SimulationError(
            f"stabilisation {stabilisation!r}: motions with unilateral constraints, friction, limited forces or time "
            "stepping are projected; use 'projection'."
        )
    if time_stepping:
        refuse_links(system)
    elif nonsmooth:
        _refuse_friction(problem)


def refuse_links(system: System):
    """Raise a SimulationError if time stepping does not take the links of a system."""
    links = [name for name, element in system.scene.set_valued.items() if callable(getattr(element, "limit", callable))]
    if links or system.losses:
        raise SimulationError(
            "integrator 'time_stepping' takes no clutches, freewheels and losses, and no limit that is a function of "
            f"time; use 'dop853' for {', '.join(dict.fromkeys([*links, *system.losses]))}."
        )


def _refuse_friction(problem: Problem):
    system, method = problem.system, problem.method
    rough = [name for name, contact in system.scene.contacts.items() if getattr(contact, "friction", 0.0)]
    if rough:
        more = f" and {len(rough) - SHOWN} more" if len(rough) > SHOWN else ""
        raise SimulationError(
            f"integrator {method.name!r} takes no friction of contacts; use integrator='time_stepping' with a step= [s] for "
            f"{', '.join(rough[:SHOWN])}{more}."
        )
    if method.name not in [explicit.name for explicit in integrators.EXPLICIT]:  # dense output of others costs a step each
        raise SimulationError(
            f"integrator {method.name!r} does not locate the events of unilateral constraints, friction and limited "
            f"forces; use 'dop853' for {', '.join(system.scene.nonsmooth)}."
        )
