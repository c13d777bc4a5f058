"""Impacts: Gauss's principle at the level of velocities.

An impact changes velocities by least compulsion, ½ (v⁺ − v⁻)ᵀ Φ (v⁺ − v⁻), under the rows of the joints and ḋ⁺ ≥ −e ḋ⁻ for
every gap that is closed (Moreau 1988; Newton's restitution e), u⁺ ≥ 0 for every freewheel that engages. All contacts that
touch act at once; what holds with a limited force bears no impulse, and gears lose nothing. Where a shock really
runs through touching bodies one after the other, they need a small gap: then they are hit one after the other.

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
from gauss.backends.compulsion import Compulsion
from gauss.backends.motions import allowed
from gauss.backends.recursion import Factor
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.constraint_scales import gap_sizes, set_valued_scales
from gauss.dynamics.gap_functions import RESTING, gaps, set_valued_rows, stacked_rows
from gauss.dynamics.kinematics import Motion, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SimulationError
from gauss.system import State, System, sides

SLOWEST_REBOUND = 1e-6  # sizes of a gap in the time of the scene: what is slower stays, so that ever smaller bounces end
LEAVING = 1e-7  # of the accelerations at hand: a gap that opens with less is kept closed; QP solvers are good to 1e-9


def resting(system: System, v):
    """Share of its size in which a gap neither opens nor closes, where rates are v, numbers or expressions [1/s]."""
    return RESTING * system.scale.fastest(v)


class Impact(NamedTuple):
    """What an impact does.

    Attributes
    ----------
    state : State
        After it.
    work : float
        Of prescribed motions [J].
    loss : float
        Kinetic energy lost, the work of prescribed motions included [J].
    impulses : dict of str to tuple of float
        Impulse −λ of every relation, one for each of its residuals [N s, N m s].
    pressed : ndarray of int
        Those of the gaps that touch which bear an impulse.
    """

    state: State
    work: float
    loss: float
    impulses: dict[str, tuple[float, ...]]
    pressed: np.ndarray


def impact(
    system: System,
    state: State,
    touching: np.ndarray,
    restitution: np.ndarray,
    backend: str = "auto",
    since: float | None = None,
    driven: Sequence[str] = (),
) -> Impact:
    """Impact in a state.

    Parameters
    ----------
    system : System
        With the one-sided constraints.
    state : State
        Where it is, with the rates before the impact, on the other constraints.
    touching : ndarray of int
        Numbers of the gaps that touch.
    restitution : ndarray, shape (m,)
        Of every gap.
    backend : str
        How the quadratic programme is solved.
    since : float, optional
        Time just before the impact [s], where speeds are prescribed otherwise than at the time of the state.
    driven : sequence of str
        Relations that prescribe these speeds.

    Raises
    ------
    SimulationError
        If no velocities keep all gaps from closing, or the backend's answer is not certified.
    """
    motion = kinematics(system, state)
    found, before = gaps(motion), motion.quasi_velocities()
    rebound = restitution * np.maximum(-found.rate, 0.0)
    rebound[rebound < SLOWEST_REBOUND / system.scale.time * gap_sizes(system)] = 0.0
    rate, slopes, _ = set_valued_rows(motion)
    one_way = np.array([grip.one_way for grip in system.scene.grips.values()], dtype=bool)
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
        names += [name for name, takes in zip(system.scene.grips, catches, strict=True) if takes]
        if not driven:
            _refuse_jammed(system, problem, np.concatenate([before, state.v]), names, state)
        raise
    active = active_rows(problem, solution.answer)  # the digits that a QP solver leaves off follow from these
    a, rates, multipliers, _ = Factor(problem, active).correction(problem, solution.answer)
    gain = 0.5 * float(system.Phi @ ((solution.a - a) ** 2 - before**2))
    impulse, work = multipliers - solution.multipliers, 0.0
    placed = system.relations.placed
    if placed:
        ends = np.cumsum([relation.size for relation in placed])
        impulse = impulse[impulse.size - ends[-1] :]
        speeds = _speeds(motion, state.t) + _speeds(motion, state.t if since is None else since)
        work = 0.5 * float(impulse @ speeds)
    parts = np.split(impulse, ends[:-1]) if placed else []
    impulses = {relation.name: tuple(part.tolist()) for relation, part in zip(placed, parts, strict=True)}
    pressed = touching[active[active < len(touching)]]
    return Impact(replace(state, v=solution.qdd - rates), work, work - gain, impulses, pressed)


def at_time(motion: Motion, t: float) -> Motion:
    """The same poses and velocities at another time [s]."""
    other = copy(motion)
    other.state = replace(motion.state, t=t)
    return other


def _speeds(motion: Motion, t: float) -> np.ndarray:
    """Right-hand sides C of K v = C of all relations at a time [m/s, rad/s]."""
    return stacked_rows(at_time(motion, t), motion.system.relations)[1]


def _refuse_jammed(system: System, problem: Compulsion, velocities: np.ndarray, names: list[str], state: State):
    """Raise a SimulationError if no velocities that joints allow meet all rows: the largest s of G (x + N z) + s ≤ h."""
    from scipy.optimize import linprog  # takes long to import: only who fails waits for it

    ways = allowed(Factor(replace(problem, G=problem.G[:0], h=problem.h[:0])))
    slopes = problem.G @ np.concatenate([ways.a, ways.rates])
    left = problem.h - problem.G @ velocities
    rows, free = np.column_stack([slopes, np.ones(len(left))]), (None, None)
    best = linprog(np.append(np.zeros(slopes.shape[1]), -1.0), rows, left, bounds=[free] * slopes.shape[1] + [(None, 0.0)])
    if best.status == 0 and best.x[-1] < -resting(system, state.v) * gap_sizes(system).min(initial=system.scale.length):
        jammed = [name for name, force in zip(names, best.ineqlin.marginals, strict=True) if force]
        raise jammed_error(f"impact at t = {state.t:.6g} s", jammed, -best.x[-1])


def jammed_error(where: str, names: list[str], speed: float) -> SimulationError:
    """Error of a mechanism that closes gaps with a speed [m/s, rad/s] which no impulse at them changes."""
    return SimulationError(
        f"{where}: the mechanism jams at {', '.join(map(repr, names))}, for its joints, relations and "
        f"prescribed motions let it do no other than go on closing with {speed:.3g} [m/s, rad/s]. End the motion "
        "before, or drive it by a torque, a force, or a speed= with a limit=."
    )


def certified(problem: Compulsion, backend: str, what: str):
    """Solution of a quadratic programme; a SimulationError if it is not certified."""
    solution = solve(problem, "auto" if getattr(backend, "name", backend) in BACKENDS else backend)
    if not solution.status.certified:
        raise SimulationError(f"{what}, backend {solution.backend!r}: {solution.status}.")
    return solution
