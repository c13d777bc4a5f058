"""Contact problem of one step of time stepping, in the form in which solvers of such problems exchange it."""

import numpy as np

from gauss.arguments import named_arguments
from gauss.dynamics.contact.friction_problem import FrictionProblem
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.errors import StateError, require
from gauss.simulation.tolerances import check_tolerances
from gauss.system import State, System


@named_arguments
def friction_problem(system: System, state: State | None = None, *, step: float) -> FrictionProblem:
    """Contact problem of one step of time stepping: Delassus operator, rates without impulses, coefficients of friction.

    Near contacts that may close within the step are in it, with stops and ropes as contacts without friction. The step
    expects the forces of an equal step before it, as in a motion.

    Parameters
    ----------
    system : System
        System with contacts of shapes.
    state : State, optional
        The state; the initial state of the scene when not given.
    step : float
        Length of the step [s].

    Returns
    -------
    FrictionProblem
        The problem, to be solved by several solvers (:meth:`FrictionProblem.solve`) or written by
        :func:`gauss.io.save_fclib`.

    Raises
    ------
    SimulationError
        If the step is no positive number.
    StateError
        If no contact is near, or set-valued elements are beside them: the form has no place for these.
    """
    require(system, (System,), "friction_problem")
    check_tolerances(step=step)
    if system.scene.set_valued:
        names = ", ".join(map(repr, system.scene.set_valued))
        raise StateError(f"the contact problem has contacts only, and the scene has joint friction as well: {names}.")
    state = system.initial_state() if state is None else system.projected(state)
    stepper = MechanismStepper(system)
    stepper.python_step(state, step)
    opened = stepper.open_step(state, step)
    rows, near, m = opened.rows, opened.near, opened.rows.gap.size
    if not m:
        raise StateError(f"t = {state.t:.6g} s: no gap is near enough to close within {step:g} s; give a state in contact.")
    places = np.concatenate([3 * np.arange(m), (3 * rows.rough[:, None] + [1, 2]).ravel()])
    W, q, mu = np.zeros((3 * m, 3 * m)), np.zeros(3 * m), np.zeros(m)
    K = rows.K / rows.unit[:, None]
    operator = K @ opened.begun.H @ K.T
    W[np.ix_(places, places)] = 0.5 * (operator + operator.T)
    q[places] = opened.after / rows.unit
    mu[rows.rough] = rows.friction
    return FrictionProblem(W, q, mu, tuple(stepper.rows.name(near, k) for k in range(m)))
