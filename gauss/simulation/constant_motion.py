"""Constant motion of a scene without degrees of freedom."""

import time

import numpy as np

from gauss.codegen.kernels import Due
from gauss.dynamics.contact.moreau_step import START_OVERLAP
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Integrator
from gauss.simulation.grid import grid
from gauss.simulation.trajectory import Stats, Trajectory
from gauss.system import State, System


def still(system: System, method: Integrator, step: float | None, start: State, end: float, samples) -> Trajectory:
    """Constant trajectory of a system without coordinates, at the samples of a motion.

    Parameters
    ----------
    system : System
        System with n_v = 0.
    method : Integrator
        A fixed-step method samples every step, another the start and the end.
    step : float or None
        Fixed step [s].
    start : State
        Initial state.
    end : float
        Final time [s].
    samples : ndarray or None
        Times to return [s].

    Raises
    ------
    SimulationError
        If the gap of a rheonomic one-sided constraint becomes negative.
    """
    began = time.perf_counter()
    if samples is None:
        pairs = grid(start.t, end, step, None) if isinstance(method, FixedStep) else np.array([[end, Due.SAMPLE]])
        samples = np.append(start.t, pairs[:, 0])
    _refuse_overlap(system, samples)
    nothing = np.zeros((len(samples), 0))
    stats = Stats(0, 0, 0, 0, time.perf_counter() - began, 0.0, "no degrees of freedom: nothing in it can move")
    return Trajectory(system, np.asarray(samples, dtype=float), nothing, nothing, np.zeros((len(samples), 3)), stats)


def _refuse_overlap(system: System, times):
    for t in times if system.contacts.placed else ():
        width = gaps(kinematics(system, system.state(t=float(t)))).width
        worst = int(np.argmin(width))
        if width[worst] < -START_OVERLAP:
            name = system.contacts.placed[worst].name
            raise SimulationError(
                f"t = {t:.6g} s: {-width[worst]:.3g} [m, rad] inside of {name!r}, in a scene without degrees of freedom."
            )
