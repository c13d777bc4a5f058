"""Optimal motions of several phases: stops, ropes and contacts that close and open, with impacts between the phases."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gauss.analysis.optimal.phases import MeshSettings, MotionPhase, PhaseProblems
from gauss.analysis.optimal.refined_meshes import on_refined_meshes
from gauss.analysis.optimal.result import OptimalMotion
from gauss.arguments import named_arguments
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError
from gauss.scene import Scene
from gauss.system import State, System


@dataclass(frozen=True)
class HybridMotion(OptimalMotion):
    """Optimal motion of several phases; times of events stand in it twice, with the states before and after.

    Its errors are the largest of the phases, those of simulations being from the start of each; ``simulate`` moves the whole
    scene, whose events are located anew.

    Parameters
    ----------
    phases : tuple of OptimalMotion
        Motion of each phase.
    """

    phases: tuple[OptimalMotion, ...] = ()


@named_arguments
def optimal_hybrid_motion(
    scene: Scene | System,
    phases: Sequence[MotionPhase],
    *,
    start: State | Mapping | None = None,
    periodic: bool | Mapping = False,
    reset: Callable | None = None,
    meets: Callable | None = None,
    cost: str | Callable = "effort",
    limits: Mapping | None = None,
    intervals: int = 10,
    order: int = 6,
    tolerance: float = 1e-6,
    refinements: int = 6,
    iterations: int = 1000,
) -> HybridMotion:
    """Motion of least cost through given phases, in each of which other stops, ropes and contacts are closed.

    The collocation of :func:`gauss.optimal_motion` in all phases at once, with free times of the events. Open gaps are not
    negative; forces of closed ones push, and keep within the cones of friction. Between two phases
    Gauss's principle for velocities gives the rates after the impact of the gaps that close.

    Parameters
    ----------
    scene : Scene or System
        Scene with inputs, without dry friction of joints. Rough contacts that are closed stick.
    phases : sequence of MotionPhase
        The phases, one after the other.
    start : State or mapping of str to float or tuple of float, optional
        As for :func:`gauss.optimal_motion`.
    periodic : bool or mapping of str to float
        Whether the motion ends, after an impact where gaps of the first phase close, as it starts; a mapping says by how
        much coordinates increase.
    reset : callable, optional
        Function (q, v) → (q⁺, v⁺) of the state at the end, in place of that impact.
    meets : callable, optional
        Function (q, v) → number, or several, that is zero at the end.
    cost, limits, order, tolerance, refinements, iterations
        As for :func:`gauss.optimal_motion`.
    intervals : int
        Intervals of the first mesh of each phase.

    Returns
    -------
    HybridMotion
        States, inputs, cost, errors, and each phase by itself. It is a local optimum, near the guesses.

    Warns
    -----
    LimitWarning
        If a limit, a gap or a force is beyond it between the points of the last mesh, with the size of the excess.

    Raises
    ------
    MissingPackageError
        If CasADi is not installed.
    ArgumentError, StateError
        If a name or a value does not fit, or is beyond its limits.
    SimulationError
        If the scene has no inputs or is not smooth between its events; if no motion meets the conditions, with those that
        are missed; or if the iterations or refinements do not suffice.

    Examples
    --------
    >>> import gauss
    >>> ball = gauss.Scene("ball")
    >>> lift = ball.prismatic("lift", "ground", ball.body("ball", 1.0, (0.1, 0.1, 0.1)), axis=(0, 0, 1))
    >>> floor = ball.stop("lift", lowest=0.0, restitution=0.5, name="floor")
    >>> push = ball.input("push", "lift", limits=100.0)
    >>> fall, rise = gauss.MotionPhase((0.1, 2.0)), gauss.MotionPhase((0.1, 2.0), struck="floor", end={"lift rate": 0.0})
    >>> found = gauss.optimal_hybrid_motion(ball, [fall, rise], start={"lift": 1.0, "lift rate": 0.0})
    >>> round(float(found.q[-1, 0]), 6)  # without effort: e² of the height
    0.25
    """
    system = system_of(scene, "optimal_hybrid_motion")
    given = list(phases) if isinstance(phases, Sequence) else []
    if not given or not all(isinstance(one, MotionPhase) for one in given):
        raise ArgumentError(f"optimal motion: phases: expected a sequence of gauss.MotionPhase, got {phases!r:.80}.")
    settings = MeshSettings(intervals, order, tolerance, refinements, iterations)
    made = PhaseProblems(system, given, settings, start, periodic, reset, meets, cost, limits)
    return _joined(on_refined_meshes(made.problems, made.guesses, tolerance, refinements))


def _joined(phases: Sequence[OptimalMotion]) -> HybridMotion:
    """All phases as one motion."""
    from scipy.interpolate import PPoly

    first = phases[0]
    stacked = lambda name: np.concatenate([getattr(one, name) for one in phases])  # noqa: E731
    inner = [one.law.x[1:] for one in phases]
    law = PPoly(np.concatenate([one.law.c for one in phases], axis=1), np.concatenate([first.law.x[:1], *inner]))
    each = zip(*(one.meshes for one in phases), strict=True)
    return HybridMotion(
        first.system,
        stacked("t"),
        stacked("q"),
        stacked("v"),
        first.inputs,
        law,
        sum(one.cost for one in phases),
        first.kkt,
        first.residual,
        max(one.mesh_error for one in phases),
        max(one.simulation_error for one in phases),
        max(one.limit_error for one in phases),
        first.iterations,
        tuple((sum(count for count, _ in own), max(error for _, error in own)) for own in each),
        tuple(phases),
    )
