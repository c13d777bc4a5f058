"""Initial states without overlaps of shapes."""

from gauss.arguments import named_arguments
from gauss.dynamics.conditions import refuse_motionless
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.overlap_resolution import resolved
from gauss.errors import require
from gauss.system import State, System


@named_arguments
def resolve_overlaps(system: System, state: State | None = None) -> State:
    """Nearest state, in the metric of the masses, in which no shapes overlap and no stop is passed.

    Parameters
    ----------
    system : System
        System with contacts of shapes.
    state : State, optional
        The state; the initial state of the scene when not given.

    Returns
    -------
    State
        State with the same rates, to be given to :func:`gauss.simulate` as ``state=``.

    Raises
    ------
    StateError
        If none is found: joints, or other shapes, keep some shapes in each other.
    SimulationError
        If nothing can move, or shapes are so deep in each other that no gap leads out.
    """
    require(system, (System,), "resolve_overlaps")
    refuse_motionless(system, "resolve_overlaps")
    stepper = new_contact_stepper(system, True)
    return resolved(stepper, system.initial_state() if state is None else system.projected(state))
