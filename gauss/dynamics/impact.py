"""Impacts: Gauss's principle at the level of velocities.

An impact changes velocities by least compulsion, ½ (v⁺ − v⁻)ᵀ Φ (v⁺ − v⁻), under the rows of the joints and ḋ⁺ ≥ −e ḋ⁻ for
every gap that is closed (Moreau 1988; Newton's restitution e), u⁺ ≥ 0 for every freewheel that engages. All contacts that
touch act at once; what holds with a limited force bears no impulse, and gears lose nothing. Where a shock really
runs through touching bodies one after the other, they need a small gap: then they are hit one after the other.
"""

from dataclasses import replace

import numpy as np

from gauss.assembly import Applied, assemble_motion, gaps, grip_rows, kinematics
from gauss.assembly.gaps import RESTING
from gauss.backends import BACKENDS, solve
from gauss.backends.certificate import active_rows
from gauss.backends.motions import allowed
from gauss.backends.recursion import Factor
from gauss.compulsion import Compulsion
from gauss.errors import SimulationError
from gauss.system import State, System, sides

SLOWEST_REBOUND = 1e-6  # [m/s, rad/s]: a body that rebounds more slowly stays, so that ever smaller bounces come to an end
LEAVING = 1e-7  # of the accelerations at hand: a gap that opens with less is kept closed; QP solvers are good to 1e-9


def resting(state: State) -> float:
    """Rate below which a gap neither opens nor closes."""
    return resting_below(np.abs(state.v).max(initial=0.0))


def resting_below(speed):
    """Rate below which a gap neither opens nor closes, where rates go up to ``speed``."""
    return RESTING * (1.0 + speed)


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
        If no velocities keep all gaps from closing, or the backend's answer is not certified.
    """
    motion = kinematics(system, state)
    found, before = gaps(motion), motion.quasi_velocities()
    rebound = restitution * np.maximum(-found.rate, 0.0)
    rebound[rebound < SLOWEST_REBOUND] = 0.0
    rate, slopes, _ = grip_rows(motion)
    one_way = np.array([grip.one_way for grip in system.scene.grips.values()], dtype=bool)
    caught = slopes[one_way & (rate <= resting(state))]
    problem = replace(
        assemble_motion(motion, Applied(motion, ())).about_rest(),
        impressed=system.Phi * before,
        G=-np.concatenate([found.J[touching], caught]),
        h=-np.concatenate([(found.C + rebound)[touching], np.zeros(len(caught))]),
    )
    try:
        solution = certified(problem, backend, f"impact at t = {state.t:.6g} s")
    except SimulationError:
        names = [sides(system.scene)[i].name for i in touching]
        names += [name for name, takes in zip(system.scene.grips, one_way & (rate <= resting(state)), strict=True) if takes]
        _refuse_jammed(problem, np.concatenate([before, state.v]), names, state)
        raise
    # the digits that a QP solver leaves off
    a, rates, *_ = Factor(problem, active_rows(problem, solution.answer)).correction(problem, solution.answer)
    loss = 0.5 * float(system.Phi @ (before**2 - (solution.a - a) ** 2))
    return replace(state, v=solution.qdd - rates), loss


def _refuse_jammed(problem: Compulsion, velocities: np.ndarray, names: list[str], state: State):
    """Raise a SimulationError if no velocities that joints allow meet all rows: the largest s of G (x + N z) + s ≤ h."""
    from scipy.optimize import linprog  # takes long to import: only who fails waits for it

    ways = allowed(Factor(replace(problem, G=problem.G[:0], h=problem.h[:0])))
    slopes = problem.G @ np.concatenate([ways.a, ways.rates])
    left = problem.h - problem.G @ velocities
    rows, free = np.column_stack([slopes, np.ones(len(left))]), (None, None)
    best = linprog(np.append(np.zeros(slopes.shape[1]), -1.0), rows, left, bounds=[free] * slopes.shape[1] + [(None, 0.0)])
    if best.status == 0 and best.x[-1] < -resting(state):
        jammed = [repr(name) for name, force in zip(names, best.ineqlin.marginals, strict=True) if force]
        raise SimulationError(
            f"impact at t = {state.t:.6g} s: the mechanism jams at {', '.join(jammed)}, for its joints, relations and "
            f"prescribed motions let it do no other than go on closing with {-best.x[-1]:.3g} [m/s, rad/s]. End the motion "
            "before, or drive it by a torque, a force, or a speed= with a limit=."
        )


def certified(problem: Compulsion, backend: str, what: str):
    """Solution of a quadratic programme; a SimulationError if it is not certified."""
    solution = solve(problem, "auto" if backend in BACKENDS else backend)
    if not solution.status.certified:
        raise SimulationError(f"{what}, backend {solution.backend!r}: {solution.status}.")
    return solution
