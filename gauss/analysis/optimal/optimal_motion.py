"""Optimal motions by direct collocation: minimum time, minimum effort, swing-up, periodic motions; loops included."""

from collections.abc import Callable, Mapping

from gauss.analysis.optimal.phases import MeshSettings, MotionPhase, PhaseProblems
from gauss.analysis.optimal.refined_meshes import on_refined_meshes
from gauss.analysis.optimal.result import OptimalMotion
from gauss.arguments import named_arguments
from gauss.dynamics.scene_compilation import system_of
from gauss.scene import Scene
from gauss.system import State, System


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
    until each of its intervals agrees with steps of gauss, and keeps the limits between its points, too. Loops are kept
    closed at the mesh points by multipliers.

    Parameters
    ----------
    scene : Scene or System
        Scene with inputs (:meth:`gauss.Scene.input`), without dry friction. Stops, ropes and contacts stay open; for
        motions in which they close see :func:`gauss.optimal_hybrid_motion`.
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
        Largest error of an interval, in units of the coordinates and rates; twice of it may be beyond a limit.
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
    LimitWarning
        If a limit is exceeded between the points of the last mesh, with the size of the excess.
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
    system = system_of(scene, "optimal_motion")
    settings = MeshSettings(intervals, order, tolerance, refinements, iterations)
    phase = MotionPhase(duration, end=end, guess=guess)
    made = PhaseProblems(system, [phase], settings, start, periodic, reset, meets, cost, limits)
    return on_refined_meshes(made.problems, made.guesses, tolerance, refinements)[0]
