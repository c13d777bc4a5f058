"""Motion of a scene without degrees of freedom: everything stays where it is, whatever acts."""

import time

import numpy as np

from gauss.assembly import gaps, kinematics
from gauss.dynamics.step import DEEP
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Integrator
from gauss.kernels import Due
from gauss.simulation.grid import grid
from gauss.simulation.trajectory import Stats, Trajectory
from gauss.system import State, System


def still(system: System, method: Integrator, step: float | None, start: State, end: float, samples) -> Trajectory:
    """Trajectory of a system that has no coordinates, with the samples that a motion would have.

    Parameters
    ----------
    system : System
        One whose joints are all fixed.
    method : Integrator
        One of fixed step keeps every step, another the start and the end.
    step : float or None
        Length of a fixed step [s].
    start : State
        The only state that there is.
    end : float
        When to stop [s].
    samples : ndarray or None
        Times to return.

    Raises
    ------
    SimulationError
        If a one-sided constraint that moves by itself runs into what cannot give way.
    """
    began = time.perf_counter()
    if samples is None:
        pairs = grid(start.t, end, step, None) if isinstance(method, FixedStep) else np.array([[end, Due.KEPT]])
        samples = np.append(start.t, pairs[:, 0])
    _refuse_overlap(system, samples)
    nothing = np.zeros((len(samples), 0))
    stats = Stats(0, 0, 0, 0, time.perf_counter() - began, 0.0, "no degrees of freedom: nothing in it can move")
    return Trajectory(system, np.asarray(samples, dtype=float), nothing, nothing, np.zeros((len(samples), 3)), stats)


def _refuse_overlap(system: System, times):
    for t in times if system.contacts.placed else ():
        width = gaps(kinematics(system, system.state(t=float(t)))).width
        worst = int(np.argmin(width))
        if width[worst] < -DEEP:
            name = system.contacts.placed[worst].name
            raise SimulationError(
                f"t = {t:.6g} s: {-width[worst]:.3g} [m, rad] inside of {name!r}, and nothing here can move out of it."
            )
