"""Eigenmodes of a scene in one call: frequencies, damping and shapes about a state of rest, or another state."""

from gauss.analysis.equilibrium import equilibrium
from gauss.analysis.linear_model import linearise
from gauss.analysis.linear_modes import LinearModes
from gauss.arguments import named_arguments
from gauss.errors import require
from gauss.scene import Scene
from gauss.system import State, System


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
