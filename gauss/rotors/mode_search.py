"""Mode search: sticking or slipping, backlash sides and directions of power flow that are consistent at one instant.

Positions and speeds determine a part of the mode; sticking follows from a linear complementarity problem (projected
Gauss–Seidel), directions of power from the sign of the torques; the two alternate until the mode repeats (fixed point).
"""

from dataclasses import replace

import numpy as np

from gauss.errors import SceneError, SimulationError
from gauss.rotors.friction_links import OneWayClutch
from gauss.rotors.links import LinkKinematics, ShaftLink, TorsionSpring
from gauss.rotors.mechanics import NetworkEquations, NetworkInstant, link_kinematics
from gauss.rotors.mode import Mode, indicate
from gauss.rotors.pattern import group_pattern
from gauss.rotors.phase import DIRECTIONS, NetworkPhase
from gauss.rotors.reduced import active

MOST_MODES = 60  # alternations
MOST_RELAXATIONS = 500  # Gauss–Seidel sweeps over the locks
TORQUE_ROUNDING = 1e-12  # relative to the largest torque or slip acceleration
ZERO_ROUNDINGS = 1e3  # roundings below which a torque counts as zero

TimePoint = tuple[float, np.ndarray, np.ndarray]  # time, angles and speeds of the roots


def find_phase(
    equations: NetworkEquations,
    t: float,
    theta,
    w,
    *,
    previous: NetworkPhase | None = None,
    fired=(),
    probe=None,
    slack: float = 1e-9,
) -> NetworkPhase:
    """Phase that fits an instant.

    SimulationError if no consistent mode is found.

    Parameters
    ----------
    t, theta, w
        Time [s], angles since the start [rad] and speeds [rad/s] of the roots.
    previous : NetworkPhase, optional
        The phase before, when there is one.
    fired : sequence of (kind, index)
        Margins that became negative.
    probe : (t, theta, w), optional
        TimePoint beyond the event, where the signs of what is zero at the event are clear: torques are evaluated there.
    slack : float
        Speeds below this, over the largest of the network, count as zero.
    """
    reduced = equations.reduced
    speed, small = reduced.K * w[reduced.group], slack * reduced.largest
    mode, candidates = _kinematic(equations, t, theta, speed, small, previous, set(fired))
    resting = [g for g in reduced.frictional if abs(w[g]) <= small]
    seen: list[Mode] = []
    probe = (t, theta, w) if probe is None else probe
    for _ in range(MOST_MODES):
        phase = _sticking(equations, mode, candidates, probe) if candidates else NetworkPhase(equations, mode)
        mode = _flow(phase, resting, probe, speed, small)
        if mode.same(phase.mode):
            return _standing(NetworkPhase(equations, mode))
        seen.append(mode)
    changing = [reduced.links[b].name for b in np.flatnonzero(seen[-1].forward != seen[-2].forward)]
    raise SimulationError(
        f"at t = {t:.9g} s no consistent mode of sticking and power flow was found in {MOST_MODES} rounds"
        + (f"; undecided: {', '.join(changing)}." if changing else ".")
        + " Loads on sticking clutches and lossy gears at once may have none: make one of them elastic by a spring."
    )


def _standing(phase: NetworkPhase) -> NetworkPhase:
    """Phase whose groups at rest have no sense of rotation."""
    signs, held = phase.mode.signs.copy(), phase.standing()
    signs[: len(held)][held] = 0.0
    return NetworkPhase(phase.equations, replace(phase.mode, signs=signs))


def _kinematic(equations: NetworkEquations, t: float, theta, speed, small: float, previous, fired) -> tuple[Mode, list[int]]:
    """Part of the mode that positions and speeds determine, and the links that may stick."""
    reduced = equations.reduced
    gate = active(reduced.terms, t)
    dry_limit = np.array([sum(x.law.value for x in torques if x.active(t)) for torques in reduced.dry.values()])
    state, candidates = np.zeros(len(reduced.links)), []
    angle = reduced.angle + reduced.K * theta[reduced.group]
    for b, link in enumerate(reduced.links):
        ends = link_kinematics(reduced, b, t, angle, speed)
        if link.dry and abs(ends.lead) <= small:
            candidates.append(b)
        elif link.dry:
            state[b] = _slipping(link, ends)
        elif isinstance(link, TorsionSpring) and link.backlash:
            state[b] = _side(link, ends, None if previous is None else previous.mode.state[b], ("side", b) in fired)
    direction = np.where(np.sign(speed[list(reduced.roots)]) < 0, -1.0, 1.0)
    forward = np.ones(len(reduced.links), dtype=bool) if previous is None else previous.mode.forward
    signs = _signs(indicate(reduced, speed), previous, fired, small / reduced.v_0)
    return Mode(forward, state, direction, gate, dry_limit, signs), candidates


def _slipping(link: ShaftLink, ends: LinkKinematics) -> float:
    """Sign of the slip of a link; SceneError if a one-way clutch would have to engage by an impact."""
    if isinstance(link, OneWayClutch) and ends.lead > 0:
        raise SceneError(
            f"{link.what}: at t = {ends.t:.6g} s the driver is {ends.lead:.3g} rad/s faster than the driven shaft; it "
            "would have to engage by an impact. Give both the same speed, or the driven shaft the larger one."
        )
    return float(np.sign(ends.lead))  # type: ignore[arg-type]  # a number at numbers


def _side(link: TorsionSpring, ends: LinkKinematics, before: float | None, fired: bool) -> float:
    """Backlash side in contact, 0 for none; at a contact event the nearer one."""
    if before is not None and not fired:
        return before
    if before:  # it separates
        return 0.0
    sides = {side: link.touch(ends.twist, ends.lead, side) for side in (-1.0, 1.0)}
    best = max(sides, key=lambda side: sides[side])
    return best if before is not None or sides[best] > 0 else 0.0


def _signs(values, previous, fired, small: float) -> np.ndarray:
    """Signs of the indicators; one that fired turns over, one at zero keeps its sign."""
    found = np.where(np.abs(values) <= small, 0.0, np.sign(values))
    if previous is None:
        return found
    before = previous.mode.signs
    turned = np.array([("indicator", i) in fired for i in range(len(values))], dtype=bool)
    return np.where(turned, -before, np.where(found == 0, before, found))


def _sticking(equations: NetworkEquations, mode: Mode, candidates: list[int], probe: TimePoint) -> NetworkPhase:
    """Phase in which each candidate sticks if its torque stays within its bounds, else slips.

    The torques minimise the compulsion under inequalities: u̇ = b + S λ, low ≤ λ ≤ high, u̇ of the sign of the violated
    bound, by projected Gauss–Seidel.
    """
    state = mode.state.copy()
    state[candidates] = 0.0
    trial = NetworkPhase(equations, replace(mode, state=state))
    locks = trial.locks
    t, theta, w = probe
    free = equations(t, theta, w, trial.conditions).acceleration
    R, H = (np.array([getattr(lock, key) for lock in locks]) for key in ("row", "column"))
    S, b = R @ H.T, R @ free
    low, high = np.array([trial.limits(lock, t) for lock in locks]).T
    torque = _bounded_torques(S, b, low, high)
    rate = b + S @ torque
    for lock, value, least, most, slip_rate in zip(locks, torque, low, high, rate, strict=True):
        if lock.kind == "group" or (least < value < most):
            continue
        if least < most and abs(slip_rate) <= TORQUE_ROUNDING * (np.abs(b).max() or 1.0):
            continue  # exactly at its bound it sticks
        slips = 1.0 if (value <= least if least < most else slip_rate > 0) else -1.0  # sign of u̇
        state[lock.place] = -slips  # the lead of the driver is −u
    return NetworkPhase(equations, replace(mode, state=state))


def _bounded_torques(S: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Torques λ (locks,) of the bounded complementarity problem, by projected Gauss–Seidel."""
    torque = np.clip(np.zeros(len(b)), low, high)
    for _ in range(MOST_RELAXATIONS):
        before = torque.copy()
        for k in range(len(b)):
            torque[k] = np.clip(torque[k] - (b[k] + S[k] @ torque) / S[k, k], low[k], high[k])
        if np.abs(torque - before).max() <= TORQUE_ROUNDING * np.abs(torque).max():
            break
    return torque


def _flow(phase: NetworkPhase, resting: list[int], probe: TimePoint, speed: np.ndarray, small: float) -> Mode:
    """Mode with the directions of power flow that follow from a phase, and the breakaway of groups at rest."""
    reduced, mode = phase.reduced, phase.mode
    found = phase.instant(*probe)
    tiny = TORQUE_ROUNDING * max(np.abs(found.applied).max(), np.abs(found.torque).max(initial=0.0))
    direction = mode.direction.copy()
    for g in resting:
        direction[g] = _breakaway(phase, g, found, direction[g], tiny)
    sense = np.where(direction == 0, 1.0, direction)[reduced.group] * np.sign(reduced.K)
    turning = np.where(np.abs(speed) <= small, sense, np.sign(speed))
    forward = mode.forward.copy()
    drives = [b for of_group in reduced.lossy_drives for b in of_group if abs(found.torque[b]) > tiny]
    forward[drives] = found.torque[drives] / reduced.ratio[drives] * turning[reduced.driver[drives]] >= 0
    for g in {int(reduced.group[branch.child]) for branch in reduced.inward if reduced.links[branch.link].lossy}:
        if direction[g]:
            forward = group_pattern(reduced, g, found.applied, turning, forward)[1]
    return replace(mode, forward=forward, direction=direction)


def _breakaway(phase: NetworkPhase, g: int, found: NetworkInstant, direction: float, tiny: float) -> float:
    """Direction in which a group at rest breaks away, 0 if it sticks."""
    tied = any(lock.row[g] for lock in phase.locks if lock.kind == "link")
    if tied and direction and abs(found.acceleration[g]) * phase.inertia[g] <= ZERO_ROUNDINGS * tiny:
        return direction  # a link holds it to something at rest; a second lock would leave the torques undetermined
    inertia = phase.reduced.inertia[phase.reduced.roots[g]]
    ahead, back = (phase.breakaway(g, found, sign)[0] * inertia for sign in DIRECTIONS)
    return 1.0 if ahead > tiny else -1.0 if back < -tiny else 0.0
