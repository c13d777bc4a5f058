"""Optimal motions by direct collocation: minimum time, minimum effort, swing-up, periodic motions; loops included."""

from collections.abc import Callable, Mapping

import numpy as np

from gauss.analysis.optimal.conditions import (
    EndCondition,
    MotionEnd,
    end_of,
    increments,
    motion_limits,
    refuse_beyond,
    value_range,
)
from gauss.analysis.optimal.equations import OptimalEquations
from gauss.analysis.optimal.guess import first_guess
from gauss.analysis.optimal.infeasible import refuse
from gauss.analysis.optimal.law_mesh import law_mesh, warn_of_passed
from gauss.analysis.optimal.mesh_error import MeshError, refined
from gauss.analysis.optimal.result import OptimalMotion
from gauss.analysis.optimal.transcription import MotionProblem, Solved, Transcription
from gauss.arguments import named_arguments
from gauss.dynamics import compile_scene
from gauss.errors import ArgumentError, SimulationError, did_you_mean, extra, require
from gauss.scene import Scene
from gauss.simulation.tolerances import check_tolerances
from gauss.system import State, System

COSTS: dict[str, Callable | None] = {"effort": lambda t, q, v, u: u @ u, "time": None}
ORDERS = (2, 4, 6, 8, 10)
SWINGS = 4.0  # times of the scene, guess of a duration without upper limit


@named_arguments
def optimal_motion(
    scene: Scene | System,
    duration,
    *,
    start: State | Mapping | None = None,
    end: State | Mapping | None = None,
    periodic: bool | Mapping = False,
    reset: Callable | None = None,
    meets: Callable | None = None,
    cost: str | Callable = "effort",
    limits: Mapping | None = None,
    guess=None,
    intervals: int = 20,
    order: int = 6,
    tolerance: float = 1e-6,
    refinements: int = 6,
    iterations: int = 1000,
) -> OptimalMotion:
    """Motion of least cost from one state to another, or of a period, within limits, and the inputs that cause it.

    Direct collocation at Gauss–Legendre points, solved by IPOPT with the exact derivatives of CasADi; the mesh is refined
    until each of its intervals agrees with steps of gauss. Loops are kept closed at the mesh points by multipliers.

    Parameters
    ----------
    scene : Scene or System
        Scene with inputs (:meth:`gauss.Scene.input`), without contacts and friction.
    duration : float or tuple of float
        Duration, or the least and the largest one [s].
    start : State or mapping of str to float or tuple of float, optional
        State at the start, that of the scene when not given; or conditions by name: "pin" for a coordinate [rad, m],
        "pin rate" for its rate, a value or (least, largest). What is not named is free.
    end : State or mapping, optional
        The same at the end; free when not given.
    periodic : bool or mapping of str to float
        Whether the motion ends as it starts; a mapping says by how much coordinates increase, as of a crank 2 π.
    reset : callable, optional
        Function (q, v) → (q⁺, v⁺) of the state at the end, of arithmetic and :mod:`gauss.math`: an impact, or legs that
        change their parts. A periodic motion starts as it ends after it.
    meets : callable, optional
        Function (q, v) → number, or several, that is zero at the end: the height of a foot above the ground.
    cost : str or callable
        "effort", ∫ Σ u² dt; "time"; or a function (t, q, v, u) → cost per time, of arithmetic and :mod:`gauss.math`.
    limits : mapping of str to float or tuple of float, optional
        Limits of coordinates, rates and inputs by name along the whole motion, beside those of the joints and inputs of the
        scene; one number stands for both signs.
    guess : OptimalMotion or Trajectory, optional
        Motion near the optimum; straight lines from start to end when not given.
    intervals : int
        Intervals of the first mesh.
    order : int
        Order of the collocation: 2, 4, 6, 8 or 10.
    tolerance : float
        Largest error of an interval, in units of the coordinates and rates.
    refinements : int
        Most refinements of the mesh.
    iterations : int
        Most iterations of IPOPT on a mesh.

    Returns
    -------
    OptimalMotion
        States, inputs, cost, and errors. It is a local optimum, near the guess.

    Warns
    -----
    SwitchingWarning
        If a law of time has a feature that passes between the points of the mesh.

    Raises
    ------
    MissingPackageError
        If CasADi is not installed.
    ArgumentError, StateError
        If a name or a value does not fit, or is beyond its limits.
    SimulationError
        If the scene has no inputs or is not smooth; if a prescribed motion jumps; if no motion meets the conditions, with
        those that are missed; or if the iterations or refinements do not suffice.

    Examples
    --------
    >>> import gauss
    >>> cart = gauss.Scene("cart")
    >>> rail = cart.prismatic("rail", "ground", cart.body("cart", 1.0, (0.1, 0.1, 0.1)), axis=(1, 0, 0))
    >>> push = cart.input("push", "rail", limits=1.0)
    >>> rest = {"rail": 0.0, "rail rate": 0.0}
    >>> motion = gauss.optimal_motion(cart, (0.1, 10.0), start=rest, end=rest | {"rail": 1.0}, cost="time")
    >>> round(motion.duration, 6)  # 1 N on 1 kg: forwards for a second, then backwards
    2.0
    """
    require(scene, (Scene, System), "optimal_motion")
    system = compile_scene(scene) if isinstance(scene, Scene) else scene
    _check_settings(intervals, order, tolerance, refinements, iterations)
    equations = OptimalEquations(system)
    span, law = _span(duration, cost), _cost(equations, cost)
    near = system.initial_state()
    first = end_of(system, near if start is None else start, "start", near)
    shift = increments(system, periodic, first.guess)
    last = _last(system, end, first, shift)
    after, meeting, meets = _impact(equations, reset, meets, bool(shift))
    bounds = motion_limits(system, equations, {} if limits is None else limits)
    refuse_beyond({"start": first, "end": last}, *bounds[:2])
    ends = first.conditions, last.conditions, shift
    impact = after, meets, meeting
    problem = MotionProblem(equations, law, first.guess.t, span, *ends, bounds, order // 2, iterations, *impact)
    mesh = law_mesh(system, first.guess, span, intervals)
    turning = {entry for place in system.quaternions.values() for entry in range(place.start, place.stop)}
    fixed = [one.place for one in (*last.conditions, *shift) if one.is_fixed]
    led = [place for place in fixed if place < system.n_q and place not in turning]
    begin = first_guess(equations, guess, (first.guess, last.guess), led, mesh, _middle(span, system), problem.stages)
    return _on_refined_meshes(system, problem, begin, tolerance, refinements)


def _impact(equations: OptimalEquations, reset, meets, is_periodic: bool):
    """Reset at the end as a function of CasADi, names of what is met there, and its function."""
    if reset is not None and not is_periodic:
        raise ArgumentError("optimal motion: reset: expected periodic= as well: the state after it is that of the start.")
    for what, given in (("reset", reset), ("meets", meets)):
        if given is not None and not callable(given):
            raise ArgumentError(f"optimal motion: {what}: expected a function of (q, v), got {given!r:.60}.")
    after = None if reset is None else equations.at_end(reset, "reset", equations.units, equations.n_x)
    met = None if meets is None else equations.at_end(meets, "meets")
    count = 0 if met is None else met.size1_out(0)
    return after, tuple(EndCondition(f"meets[{k}]", equations.n_x + k, 0.0, 0.0) for k in range(count)), met


def _on_refined_meshes(system: System, problem: MotionProblem, guess, tolerance: float, refinements: int) -> OptimalMotion:
    """Optimum on the first mesh that is fine enough."""
    equations, meshes, iterations = problem.equations, list[tuple[int, float]](), 0
    rows, error = equations.independent_rows(problem.start_time, guess.x[:, 0]), MeshError(equations)
    for _ in range(refinements + 1):
        solved = Transcription(problem, guess.mesh, rows).solve(guess)
        if not solved.is_optimal:
            refuse(problem, guess.mesh, rows, guess, solved)
        iterations += solved.iterations
        t, x, u = _samples(problem, solved)
        errors = error.of_intervals(t, x, u)
        meshes.append((len(u), float(errors.max())))
        if errors.max() <= tolerance:
            warn_of_passed(system, State(float(t[0]), *np.split(x[0], [system.n_q])), t)
            simulated = np.abs((error.simulated(t, x[0], u) - x) / equations.units).max()
            q, v = np.split(x, [system.n_q], axis=1)
            accuracy = solved.kkt, solved.residual, float(errors.max()), float(simulated), iterations, tuple(meshes)
            return OptimalMotion(system, t, q, v, equations.names, _law(t, u), solved.cost, *accuracy)
        mesh = refined(solved.values.mesh, errors, tolerance, 2 * problem.stages)
        guess = solved.values.on(mesh, problem.stages)
    raise SimulationError(
        f"optimal motion: the mesh error is {meshes[-1][1]:.1e} with {meshes[-1][0]} intervals after {refinements} "
        "refinements; allow more refinements= or a larger tolerance=."
    )


def _samples(problem: MotionProblem, solved: Solved) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n + 1,), states (n + 1, n_q + n_v), and inputs (n, 2, n_u) at the ends of the intervals."""
    equations, values = problem.equations, solved.values
    low, high = problem.bounds[2:]
    u = np.clip(values.u * equations.input_units[:, None], low[:, None], high[:, None])  # IPOPT relaxes bounds by 1e-8
    return problem.start_time + values.duration * values.mesh, values.x.T * equations.units, np.moveaxis(u, 2, 0)


def _law(t: np.ndarray, u: np.ndarray):
    """Inputs as a piecewise polynomial of time."""
    from scipy.interpolate import PPoly

    return PPoly(np.array([(u[:, 1] - u[:, 0]) / np.diff(t)[:, None], u[:, 0]]), t)


def _last(system: System, end, first: MotionEnd, shift: tuple[EndCondition, ...]) -> MotionEnd:
    """Conditions at the end, near the start, or a period after it."""
    x = np.concatenate([first.guess.q, first.guess.v])
    after = {one.name: x[one.place] + one.low for one in shift if one.low}
    near = end_of(system, after, "periodic", first.guess).guess if after else first.guess
    return end_of(system, end, "end", near)


def _cost(equations: OptimalEquations, cost):
    """Cost per time as a function of CasADi; None for the time itself."""
    with extra("export"):
        import casadi  # noqa: F401
    if not callable(cost) and cost not in COSTS:
        raise ArgumentError(f"optimal motion: no cost {cost!r}, and no function. {did_you_mean(str(cost), COSTS)}")
    law = cost if callable(cost) else COSTS[cost]
    return None if law is None else equations.running_cost(law)


def _span(duration, cost) -> tuple[float, float]:
    """Least and largest duration."""
    low, high = value_range("duration", duration, "duration")
    if not low > 0.0 or np.isinf(low):
        raise ArgumentError(
            f"optimal motion: duration: expected a positive time [s], or (least, largest), got {duration!r}."
        )
    if cost == "time" and low == high:
        raise ArgumentError("optimal motion: cost 'time' needs a free duration=(least, largest) [s].")
    return low, high


def _middle(span: tuple[float, float], system: System) -> float:
    """First guess of the duration [s]."""
    low, high = span
    return float(np.sqrt(low * high)) if np.isfinite(high) else max(2.0 * low, SWINGS * system.scale.time)


def _check_settings(intervals, order, tolerance, refinements, iterations):
    """Refuse settings that are no numbers of their kind."""
    for name, value, least in (("intervals", intervals, 1), ("refinements", refinements, 0), ("iterations", iterations, 1)):
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
            raise ArgumentError(f"optimal motion: {name}: expected a whole number from {least} on, got {value!r}.")
    if order not in ORDERS:
        raise ArgumentError(f"optimal motion: order: expected one of {', '.join(map(str, ORDERS))}, got {order!r}.")
    check_tolerances(tolerance=tolerance)
