"""Impacts: minimum of ½ (v⁺ − v⁻)ᵀ Φ (v⁺ − v⁻) subject to the joints and ḋ⁺ ≥ −e ḋ⁻ of every closed gap.

Gauss's principle at velocity level (Moreau 1988, with Newton's restitution e); u⁺ ≥ 0 for every freewheel that engages. All
closed contacts act at once; set-valued elements with a limited force bear no impulse, and gears are lossless. For a shock
that runs through touching bodies one after the other, model small gaps between them.

A relation K v = C bears the impulse p = −λ. Where it is driven it does the work ½ p · (C⁻ + C⁺), C before and after, for
T⁺ − T⁻ = ½ p · K (v⁻ + v⁺); what else the kinetic energy changes by is lost.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.backends import BACKENDS, solve
from gauss.backends.active_set import active_rows
from gauss.backends.backend import Backend
from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.backends.motions import allowed
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.constraint_scales import gap_scales, set_valued_scales
from gauss.dynamics.gap_functions import RESTING, gaps, set_valued_rows, stacked_rows
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SimulationError
from gauss.system import State, System, sides

SLOWEST_REBOUND = 1e-6  # scale of a gap over the time of the scene: slower rebounds are suppressed, and bouncing ends
LEAVING = 1e-7  # of the largest acceleration: a gap that opens with less stays closed; QP solvers are accurate to 1e-9


def resting(system: System, v):
    """Rate, over its scale, below which a gap neither opens nor closes, for rates v, numbers or expressions [1/s]."""
    return RESTING * system.scale.fastest(v)


class Impact(NamedTuple):
    """Result of an impact."""

    state: State  # state after it
    work: float  # work of prescribed motions [J]
    loss: float  # kinetic energy lost, the work of prescribed motions included [J]
    impulses: dict[str, tuple[float, ...]]  # impulse −λ of every relation, one for each of its residuals [N s, N m s]
    active: np.ndarray  # closed gaps that bear an impulse


def impact(
    system: System,
    state: State,
    touching: np.ndarray,
    restitution: np.ndarray,
    backend: str | Backend | type = "auto",
    since: float | None = None,
    driven: Sequence[str] = (),
) -> Impact:
    """Impact in a state.

    SimulationError if no velocities keep all gaps from closing, or the backend's answer is not certified.

    Parameters
    ----------
    system : System
        With unilateral constraints.
    state : State
        State before the impact, on the bilateral constraints.
    restitution : ndarray, shape (m,)
        Coefficient of every gap.
    backend : str
        Backend of the quadratic programme.
    since : float, optional
        Time just before the impact [s], where prescribed speeds differ from those at the time of the state.
    driven : sequence of str
        Relations with these speeds.
    """
    motion = kinematics(system, state)
    found, before = gaps(motion), motion.quasi_velocities()
    rebound = restitution * np.maximum(-found.rate, 0.0)
    rebound[rebound < SLOWEST_REBOUND / system.scale.time * gap_scales(system)] = 0.0
    rate, slopes, _ = set_valued_rows(motion)
    one_way = np.array([element.one_way for element in system.scene.set_valued.values()], dtype=bool)
    catches = one_way & (rate <= resting(system, state.v) * set_valued_scales(system))
    caught = slopes[catches]
    problem = replace(
        assemble_motion(motion, Applied(motion, ())).about_rest(),
        impressed=system.Phi * before,
        G=-np.concatenate([found.J[touching], caught]),
        h=-np.concatenate([(found.C + rebound)[touching], np.zeros(len(caught))]),
    )
    of = f" of {', '.join(map(repr, driven))}" if driven else ""
    try:
        solution = certified(problem, backend, f"impact{of} at t = {state.t:.6g} s")
    except SimulationError:
        names = [sides(system.scene)[i].name for i in touching]
        names += [name for name, takes in zip(system.scene.set_valued, catches, strict=True) if takes]
        if not driven:
            _refuse_jammed(system, problem, np.concatenate([before, state.v]), names, state)
        raise
    active = active_rows(problem, solution.answer)  # one refinement on the active set: QP solvers stop earlier
    a, rates, multipliers, _ = Factor(problem, active).correction(problem, solution.answer)
    gain = 0.5 * float(system.Phi @ ((solution.a - a) ** 2 - before**2))
    impulses, work = _impulses(motion, multipliers - solution.multipliers, since)
    bearing = touching[active[active < len(touching)]]
    return Impact(replace(state, v=solution.qdd - rates), work, work - gain, impulses, bearing)


def _impulses(motion: Kinematics, impulse: np.ndarray, since: float | None) -> tuple[dict[str, tuple[float, ...]], float]:
    """Impulses of all relations by name, and the work ½ p · (C⁻ + C⁺) of prescribed motions [J]."""
    placed, t = motion.system.relations.placed, motion.state.t
    if not placed:
        return {}, 0.0
    ends = np.cumsum([relation.size for relation in placed])
    impulse = impulse[impulse.size - ends[-1] :]
    speeds = _speeds(motion, t) + _speeds(motion, t if since is None else since)
    pairs = zip(placed, np.split(impulse, ends[:-1]), strict=True)
    return {relation.name: tuple(part.tolist()) for relation, part in pairs}, 0.5 * float(impulse @ speeds)


def at_time(motion: Kinematics, t: float) -> Kinematics:
    """The same poses and velocities at another time [s]."""
    other = copy(motion)
    other.state = replace(motion.state, t=t)
    return other


def _speeds(motion: Kinematics, t: float) -> np.ndarray:
    """Right-hand sides C of K v = C of all relations at a time [m/s, rad/s]."""
    return stacked_rows(at_time(motion, t), motion.system.relations)[1]


def _refuse_jammed(system: System, problem: Compulsion, velocities: np.ndarray, names: list[str], state: State):
    """Raise a SimulationError if no allowed velocities meet all rows: the largest s with G (x + N z) + s ≤ h is negative."""
    from scipy.optimize import linprog  # a slow import, needed for the message only

    motions = allowed(Factor(replace(problem, G=problem.G[:0], h=problem.h[:0])))
    slopes = problem.G @ np.concatenate([motions.a, motions.rates])
    left = problem.h - problem.G @ velocities
    rows, free = np.column_stack([slopes, np.ones(len(left))]), (None, None)
    best = linprog(np.append(np.zeros(slopes.shape[1]), -1.0), rows, left, bounds=[free] * slopes.shape[1] + [(None, 0.0)])
    if best.status == 0 and best.x[-1] < -resting(system, state.v) * gap_scales(system).min(initial=system.scale.length):
        jammed = [name for name, force in zip(names, best.ineqlin.marginals, strict=True) if force]
        raise jammed_error(f"impact at t = {state.t:.6g} s", jammed, -best.x[-1])


def jammed_error(where: str, names: list[str], speed: float) -> SimulationError:
    """Error of a mechanism that closes gaps with a speed [m/s, rad/s] in spite of any impulse."""
    return SimulationError(
        f"{where}: the mechanism jams at {', '.join(map(repr, names))}, for its joints, relations and "
        f"prescribed motions let it do no other than go on closing with {speed:.3g} [m/s, rad/s]. End the motion "
        "before, or drive it by a torque, a force, or a speed= with a limit=."
    )


def certified(problem: Compulsion, backend: str | Backend | type, what: str):
    """Solution of a quadratic programme; a SimulationError if it is not certified."""
    solution = solve(problem, "auto" if getattr(backend, "name", backend) in BACKENDS else backend)
    if not solution.status.certified:
        raise SimulationError(f"{what}, backend {solution.backend!r}: {solution.status}.")
    return solution
