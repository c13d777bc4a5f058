"""Projection onto the constraints in the mass metric: δ = −Φ⁻¹Jᵀ(JΦ⁻¹Jᵀ)⁻¹ φ, v ← v − Φ⁻¹Jᵀ(JΦ⁻¹Jᵀ)⁻¹ (J v − C).

Damped Gauss–Newton steps in position, halved until the residual decreases. Fixed coordinates, and those at a limit that the
step would cross, keep their values by rows of their own.
"""

from dataclasses import replace

import numpy as np

from gauss.backends.factorisation import factored
from gauss.backends.kkt_factor import KKTFactor
from gauss.backends.solution import Answer
from gauss.dynamics.assemble import assemble_motion, position_residual
from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.scene import Stop
from gauss.system import State, System, retract

RESIDUAL_ROUNDOFF = 1e-13  # position residual relative to the scales of the rows: its round-off
LEAST_MOMENT = 1e-6  # of inertia in the metric, relative to the largest of the body
REFINEMENTS = 2  # iterative refinements of rates
RATE_STEPS = 10  # one is enough where constraints are linear in velocities
LEAST_DAMPING = 1e-4  # share of a Newton step below which the iteration has stalled


def project_positions(system: System, state: State, steps: int, held=()) -> State:
    """State after damped Gauss–Newton steps on the position residual; coordinates of the entries ``held`` of v are fixed."""
    lowest, highest = limits(system)
    phi, share = position_residual_of(system, state), 1.0
    for _ in range(steps):
        size = relative(system, phi)
        if size <= RESIDUAL_ROUNDOFF or share < LEAST_DAMPING:
            break
        step = newton_step(system, state, phi, held, lowest, highest)
        share = 1.0
        while share >= LEAST_DAMPING:
            trial = clipped(system, replace(state, q=retract(system, state.q, share * step)), lowest, highest)
            trial_phi = position_residual_of(system, trial)
            if relative(system, trial_phi) < size:
                state, phi = trial, trial_phi
                break
            share /= 2
    return state


def project_rates(system: System, state: State, held=(), steps: int = RATE_STEPS) -> State:
    """State with the nearest rates in the mass metric that meet A v + B q̇ = C; the entries ``held`` are fixed."""
    for _ in range(steps):
        motion = kinematics(system, state)
        compulsion = assemble_motion(motion, Applied(motion, ()))
        momentum = metric(system) * motion.quasi_velocities()
        factor = held_factor(system, compulsion, held)
        v = _least_change(factor, momentum, state.v[list(held)])
        scale = system.scale
        converged = np.abs((v - state.v) / scale.coordinates).max(initial=0.0) <= RESIDUAL_ROUNDOFF * scale.fastest(v)
        state = replace(state, v=v)
        if converged or not system.relations.placed:  # joints and couplings are linear in velocities
            break
    return state


def _least_change(factor: KKTFactor, momentum, held) -> np.ndarray:
    """Rates (n_v,) that meet the rows with least change of momentum, refined: a light link in a loop costs digits."""
    problem = replace(factor.compulsion.about_rest(), impressed=momentum, h=held)
    a, v, multipliers, mu = factor.solve(momentum, problem.D, problem.P, held)
    for _ in range(REFINEMENTS):
        change = factor.correction(problem, Answer(a, v, multipliers, mu))
        a, v, multipliers, mu = (old - new for old, new in zip((a, v, multipliers, mu), change, strict=True))
    return v


def fixed_columns(system: System, names) -> list[int]:
    """Entries of v that belong to joints, or to single rates of joints."""
    columns = []
    for name in names:
        joint, rate = system.coordinate(name)
        places = range(joint.v.start, joint.v.stop)
        columns += list(places) if rate is None else [places[rate]]
    return columns


def limits(system: System) -> tuple[np.ndarray, np.ndarray]:
    """Limits (n_v,) of the coordinate of each rate; infinite without limit."""
    lowest, highest = np.full(system.n_v, -np.inf), np.full(system.n_v, np.inf)
    for joint in system.joints:
        given = system.scene.joints[joint.name].limits
        if given is not None:
            lowest[joint.v], highest[joint.v] = given
    return lowest, highest


def limits_and_stops(system: System) -> tuple[np.ndarray, np.ndarray]:
    """Limits (n_v,) of the coordinate of each rate, by joints and stops; infinite without."""
    lowest, highest = limits(system)
    for stop in system.scene.contacts.values():
        if isinstance(stop, Stop):
            place = system.column(stop.joint)
            lowest[place] = max(lowest[place], -np.inf if stop.lowest is None else stop.lowest)
            highest[place] = min(highest[place], np.inf if stop.highest is None else stop.highest)
    return lowest, highest


def newton_step(system: System, state: State, phi, held, lowest, highest) -> np.ndarray:
    """Gauss–Newton step on the position residual that crosses no active limit."""
    motion = kinematics(system, state)
    compulsion = assemble_motion(motion, Applied(motion, ()))
    plain, held = scalar_coordinates(system, state), list(held)
    while True:
        _, step, _, _ = held_factor(system, compulsion, held).solve(np.zeros(system.Phi.size), -phi, np.zeros(system.n_v))
        outward = ((plain <= lowest) & (step < 0)) | ((plain >= highest) & (step > 0))
        crossing = [k for k in np.flatnonzero(outward) if k not in held]
        if not crossing:
            return step
        held += crossing


def scalar_coordinates(system: System, state: State) -> np.ndarray:
    """Coordinate of each rate (n_v,); 0 for components of angular velocities, which have none."""
    plain = np.zeros(system.n_v)
    for joint in system.joints:
        plain[joint.v][: joint.n_plain] = state.q[joint.q][: joint.n_plain]
    return plain


def clipped(system: System, state: State, lowest, highest) -> State:
    """State with every coordinate clipped to its limits (n_v,)."""
    if not (np.isfinite(lowest).any() or np.isfinite(highest).any()):
        return state
    q = state.q.copy()
    for joint in system.joints:
        if joint.pair.quaternion is None:
            q[joint.q] = np.clip(q[joint.q], lowest[joint.v], highest[joint.v])
    return replace(state, q=q)


def within_limits(system: System, state: State) -> State:
    """State with every coordinate clipped to the limits of its joint."""
    return clipped(system, state, *limits(system))


def position_residual_of(system: System, state: State) -> np.ndarray:
    """Position residual φ (r,) of all constraints."""
    return position_residual(kinematics(system, state))


def relative(system: System, residual) -> float:
    """Largest position residual (r,) relative to the scales of the rows."""
    return float(np.abs(residual / constraint_scales(system)).max(initial=0.0))


def relative_velocity_residual(system: System, residual, v) -> float:
    """Largest velocity residual (r,) relative to the scales of the rows and the fastest of the rates (n_v,)."""
    return relative(system, residual) / system.scale.fastest(v)


def velocity_residual_of(system: System, motion) -> np.ndarray:
    """A v + B q̇ − C (r,)."""
    compulsion = assemble_motion(motion, Applied(motion, ())).about_rest()
    return compulsion.residuals(motion.quasi_velocities(), motion.state.v, np.zeros(compulsion.D.size))[1]


def held_factor(system: System, compulsion, held) -> KKTFactor:
    """Factorisation in which held rates are prescribed by rows of their own."""
    held = list(held)
    G = np.zeros((len(held), system.Phi.size + system.n_v))
    G[np.arange(len(held)), system.Phi.size + np.array(held, dtype=int)] = 1.0
    problem = replace(compulsion, Phi=metric(system), G=G, h=np.zeros(len(held)), constraint_residual=0.0)
    return factored(problem, np.arange(len(held)))


def metric(system: System) -> np.ndarray:
    """Φ (6n,) of the projection, with a least moment of inertia: a rod has some about its axis.

    Between two ball joints its spin depends on nothing else, and a tiny moment costs as many digits.
    """
    parts = system.Phi.reshape(-1, 6)
    least = LEAST_MOMENT * parts[:, :3].max(axis=1, keepdims=True)
    return np.concatenate([np.maximum(parts[:, :3], least), parts[:, 3:]], axis=1).ravel()
