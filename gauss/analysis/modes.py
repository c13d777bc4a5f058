"""Eigenmodes of a scene in one call: frequencies, damping and shapes about a state of rest, or another state.

The motion of a mode is q(t) = q₀ ⊕ Re(a φ exp(i ω t)), without its growth or decay; with loops, samples are projected onto
the constraints.
"""

import numpy as np

from gauss.analysis.equilibrium import equilibrium
from gauss.analysis.linear_model import LinearModel, linearise
from gauss.analysis.linear_modes import LinearModes
from gauss.arguments import named_arguments
from gauss.dynamics.projection import project_positions
from gauss.errors import ArgumentError, require
from gauss.scene import Scene
from gauss.simulation import Trajectory
from gauss.system import State, System, retract

SAMPLES = 60  # of a period
PROJECTION_STEPS = 20
STILL_PERIOD = 1.0  # period shown of a mode that does not oscillate [s]


@named_arguments
def modes(system: System | Scene, state: State | None = None, *, t: float | None = None) -> LinearModes:
    """Frequencies, damping ratios and shapes of small motions, loops and rolling included.

    Parameters
    ----------
    system : System or Scene
        The system.
    state : State, optional
        State about which they are; the state of rest near the start when not given, as of :func:`gauss.equilibrium`.
    t : float, optional
        Time of the state of rest, where no state is given [s].

    Returns
    -------
    LinearModes
        Eigenmodes, the slowest first. :func:`gauss.equilibrium` says where the state of rest is, and whether it is stable;
        :func:`gauss.mode_motion` shows a mode of its ``model`` as a motion.

    Warns
    -----
    TimeDependenceWarning
        If laws depend on time, and neither a state nor a time is given.

    Raises
    ------
    ArgumentError
        If a time is given beside a state.
    SimulationError
        If there is no state of rest near the start, or no linear model.

    Examples
    --------
    >>> import gauss
    >>> system = gauss.compile_scene(gauss.load("double_pendulum"))
    >>> hanging = system.state([-1.5707963268, 0.0], [0.0, 0.0])
    >>> gauss.modes(system, hanging).frequencies.round(4).tolist()  # Hz
    [0.4266, 1.1441]
    """
    require(system, (System, Scene), "modes")
    if state is None:
        return equilibrium(system, t=t).model.modes()
    return linearise(system, state, t=t).modes()


@named_arguments
def mode_motion(model: LinearModel, mode: int = 0, *, amplitude: float = 0.1, periods: int = 2) -> Trajectory:
    """Motion of one mode about the state of its model.

    Parameters
    ----------
    model : LinearModel
        Linear model, as of :func:`gauss.linearise`.
    mode : int
        Number of the mode in ``model.modes()``.
    amplitude : float
        Largest displacement of the mode, in the unit of its coordinate in the scene: 1 rad, or the length of the scene.
    periods : int
        Number of periods; of a mode that does not oscillate, one second stands for a period.

    Returns
    -------
    Trajectory
        Coordinates without rates; ``gauss.show`` plays it.

    Raises
    ------
    ArgumentError
        If there is no such mode, or a number is not positive.

    Examples
    --------
    >>> import gauss
    >>> gauss.mode_motion(gauss.equilibrium(gauss.load("double_pendulum")).model, 1).q.shape
    (121, 2)
    """
    require(model, (LinearModel,), "mode_motion: model")
    modes = model.modes()
    if not isinstance(mode, int) or not 0 <= mode < len(modes.eigenvalues):
        raise ArgumentError(f"mode_motion: expected a mode from 0 to {len(modes.eigenvalues) - 1}, got {mode!r}.")
    if not amplitude > 0.0 or not isinstance(periods, int) or periods < 1:
        raise ArgumentError(f"mode_motion: expected an amplitude > 0 and periods ≥ 1, got {amplitude!r} and {periods!r}.")
    system, state, frequency = model.system, model.state, modes.frequencies[mode]
    phase = np.linspace(0.0, 2.0 * np.pi * periods, SAMPLES * periods + 1)
    q = np.array([_sample(system, state, amplitude * (modes.shapes[mode] * np.exp(1j * one)).real) for one in phase])
    period = 1.0 / frequency if frequency else STILL_PERIOD
    return Trajectory.from_coordinates(system, phase / (2.0 * np.pi) * period, q)


def _sample(system, state: State, displacement: np.ndarray) -> np.ndarray:
    """Coordinates at a displacement."""
    q = retract(system, state.q, displacement)
    if not system.has_closures:
        return q
    return project_positions(system, State(state.t, q, np.zeros(system.n_v)), PROJECTION_STEPS).q
