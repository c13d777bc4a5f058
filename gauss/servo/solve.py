"""Solution of one instant: accelerations, reactions of contacts, efforts of servos."""

from gauss.errors import require
from gauss.servo.kernels import tree_rows
from gauss.servo.plan import RelationPlan
from gauss.servo.realisable import planned
from gauss.servo.saddle import Saddle, ServoSolution
from gauss.servo.servo import Servo
from gauss.system import State


def solve(servo: Servo, state: State, load=None, backend: str = "auto") -> ServoSolution:
    """Accelerations, reactions of contacts and efforts of servos at one instant.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State
        Consistent state, e.g. of :func:`gauss.servo.initial_state`.
    load : array_like, shape (n_v,), optional
        Generalised forces added to those of the scene [N m, N].
    backend : str
        "saddle": the coupled system is solved directly; a backend of :func:`gauss.solve`: the Gauss QP, in the ideal case
        only; "auto": the Gauss QP in the ideal case, else the coupled system.

    Returns
    -------
    ServoSolution
        Both kinds of reactions, and the method.

    Raises
    ------
    UnrealisableError
        If these forces cannot hold the relations.
    SimulationError
        If a cable would be in compression.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> now = servo.solve(held, servo.initial_state(held))
    >>> dict(zip(now.names, now.efforts.round(6).tolist()))
    {'motor': 0.0}
    """
    require(servo, (Servo,), "servo.solve")
    require(state, (State,), "servo.solve: state")
    return saddle(servo, state, planned(servo, state), load).solve(backend)


def saddle(servo: Servo, state: State, plan: RelationPlan, load=None) -> Saddle:
    """Saddle system whose rows are those of the plan."""
    if not plan.reduced:
        return Saddle(servo, state, load)
    rows, _ = tree_rows(servo, tuple(plan.scalars[i] for i in plan.active))(state)
    return Saddle(servo, state, load, rows)
