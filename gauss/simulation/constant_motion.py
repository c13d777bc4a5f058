"""Constant motion of a scene without degrees of freedom."""

import time

import numpy as np

from gauss.codegen.kernels import Due
from gauss.dynamics.contact.overlaps import START_OVERLAP
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics
from gauss.errors import SimulationError
from gauss.integrators import FixedStep
from gauss.simulation.grid import grid
from gauss.simulation.motion_records import Stats
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.system import System


def constant(problem: Problem) -> Trajectory:
    """Constant trajectory of a system with n_v = 0, at the samples of a motion.

    A fixed-step method samples every step, another one the start and the end. SimulationError if the gap of a rheonomic
    unilateral constraint becomes negative.
    """
    system, start, end, samples = problem.system, problem.start, problem.end, problem.samples
    began = time.perf_counter()
    if samples is None:
        step = problem.step if isinstance(problem.method, FixedStep) else None
        pairs = grid(start.t, end, step, None) if step is not None else np.array([[end, Due.SAMPLE]])
        samples = np.append(start.t, pairs[:, 0])
    _refuse_overlap(system, samples)
    empty = np.zeros((len(samples), 0))
    stats = Stats(0, 0, 0, 0, time.perf_counter() - began, 0.0, "no degrees of freedom: nothing in it can move")
    return Trajectory(system, np.asarray(samples, dtype=float), empty, empty, np.zeros((len(samples), 3)), stats)


def _refuse_overlap(system: System, times):
    for t in times if system.contacts.placed else ():
        width = gaps(kinematics(system, system.state(t=float(t)))).width
        worst = int(np.argmin(width))
        if width[worst] < -START_OVERLAP:
            name = system.contacts.placed[worst].name
            raise SimulationError(
                f"t = {t:.6g} s: {-width[worst]:.3g} [m, rad] inside of {name!r}, in a scene without degrees of freedom."
            )
