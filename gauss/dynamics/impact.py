"""Impacts: Gauss's principle at the level of velocities.

An impact changes velocities by least compulsion, ½ (v⁺ − v⁻)ᵀ Φ (v⁺ − v⁻), under the rows of the joints and ḋ⁺ ≥ −e ḋ⁻ for
every gap that is closed (Moreau 1988; Newton's restitution e), u⁺ ≥ 0 for every freewheel that engages. All contacts that
touch act at once; what holds with a limited force bears no impulse, and gears lose nothing. Where a shock really
runs through touching bodies one after the other, they need a small gap: then they are hit one after the other.
"""

from dataclasses import replace

import numpy as np

from gauss.assembly import Applied, assemble_motion, gap_sizes, gaps, grip_rows, grip_sizes, kinematics
from gauss.assembly.gaps import RESTING
from gauss.backends import BACKENDS, solve
from gauss.backends.certificate import active_rows
from gauss.backends.recursion import Factor
from gauss.compulsion import Compulsion
from gauss.errors import SimulationError
from gauss.system import State, System

SLOWEST_REBOUND = 1e-6  # sizes of a gap in the time of the scene: what is slower stays, so that ever smaller bounces end
LEAVING = 1e-7  # of the accelerations at hand: a gap that opens with less is kept closed; QP solvers are good to 1e-9


def resting(system: System, v):
    """Share of its size in which a gap neither opens nor closes, where rates are v, numbers or expressions [1/s]."""
    return RESTING * system.scale.fastest(v)


def impact(system: System, state: State, touching: np.ndarray, restitution: np.ndarray, backend: str = "auto"):
    """State after an impact, and the kinetic energy lost [J].

    Parameters
    ----------
    system : System
        With the one-sided constraints.
    state : State
        Before the impact, on the other constraints.
    touching : ndarray of int
        Numbers of the gaps that touch.
    restitution : ndarray, shape (m,)
        Of every gap.
    backend : str
        How the quadratic programme is solved.

    Raises
    ------
    SimulationError
        If the backend's answer is not certified.
    """
    motion = kinematics(system, state)
    found, before = gaps(motion), motion.quasi_velocities()
    rebound = restitution * np.maximum(-found.rate, 0.0)
    rebound[rebound < SLOWEST_REBOUND / system.scale.time * gap_sizes(system)] = 0.0
    rate, slopes, _ = grip_rows(motion)
    one_way = np.array([grip.one_way for grip in system.scene.grips.values()], dtype=bool)
    caught = slopes[one_way & (rate <= resting(system, state.v) * grip_sizes(system))]
    problem = replace(
        assemble_motion(motion, Applied(motion, ())).about_rest(),
        impressed=system.Phi * before,
        G=-np.concatenate([found.J[touching], caught]),
        h=-np.concatenate([(found.C + rebound)[touching], np.zeros(len(caught))]),
    )
    solution = certified(problem, backend, f"impact at t = {state.t:.6g} s")
    # the digits that a QP solver leaves off
    a, rates, *_ = Factor(problem, active_rows(problem, solution.answer)).correction(problem, solution.answer)
    loss = 0.5 * float(system.Phi @ (before**2 - (solution.a - a) ** 2))
    return replace(state, v=solution.qdd - rates), loss


def certified(problem: Compulsion, backend: str, what: str):
    """Solution of a quadratic programme; a SimulationError if it is not certified."""
    solution = solve(problem, "auto" if backend in BACKENDS else backend)
    if not solution.status.certified:
        raise SimulationError(f"{what}, backend {solution.backend!r}: {solution.status}.")
    return solution
