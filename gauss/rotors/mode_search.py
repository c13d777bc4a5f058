"""Find the mode of an instant: what sticks, what slips, which way the power flows, so that all of it agrees."""

from dataclasses import replace

import numpy as np

from gauss.errors import SceneError, SimulationError
from gauss.rotors.links import OneWayClutch
from gauss.rotors.mechanics import Equations, link_ends
from gauss.rotors.mode import Mode, indicate
from gauss.rotors.pattern import group_pattern
from gauss.rotors.phase import WAYS, Phase
from gauss.rotors.reduced import active

ROUNDS = 60
SWEEPS = 500  # of the relaxation that finds out what sticks
ROUNDING = 1e-12
HELD = 1e3  # roundings of a torque that count as none


def settle(
    equations: Equations, t: float, theta, w, *, previous: Phase | None = None, fired=(), probe=None, slack: float = 1e-9
) -> Phase:
    """Phase that fits an instant.

    Parameters
    ----------
    equations : Equations
        Equations of the network.
    t, theta, w
        Time [s], angles since the start [rad] and speeds [rad/s] of the roots.
    previous : Phase, optional
        The phase before, when there is one.
    fired : sequence of (kind, index)
        Margins that ended it.
    probe : (t, theta, w), optional
        A point just beyond, where the sign of what is zero at the event is plain; forces are judged there.
    slack : float
        Speeds below this, over the largest of the network, count as zero.

    Raises
    ------
    SimulationError
        If no consistent mode is found.
    """
    reduced = equations.reduced
    speed, small = reduced.K * w[reduced.group], slack * reduced.largest
    mode, candidates = _kinematic(equations, t, theta, speed, small, previous, set(fired))
    resting = [g for g in reduced.rubbing if abs(w[g]) <= small]
    seen, probe = [], (t, theta, w) if probe is None else probe
    for _ in range(ROUNDS):
        phase = _stick(equations, mode, candidates, probe) if candidates else Phase(equations, mode)
        mode = _flow(phase, resting, probe, speed, small)
        if mode.same(phase.mode):
            return _standing(Phase(equations, mode))
        seen.append(mode)
    changing = [reduced.links[b].name for b in np.flatnonzero(seen[-1].forward != seen[-2].forward)]
    raise SimulationError(
        f"at t = {t:.9g} s no consistent state of sticking and power flow was found in {ROUNDS} rounds"
        + (f"; undecided: {', '.join(changing)}." if changing else ".")
        + " Loads held by clutches and by lossy gears at once may have none: soften one of them by a spring."
    )


def _standing(phase: Phase) -> Phase:
    """Forget which way groups turned that friction now holds."""
    signs, held = phase.mode.signs.copy(), phase.standing()
    signs[: len(held)][held] = 0.0
    return Phase(phase.equations, replace(phase.mode, signs=signs))


def _kinematic(equations, t, theta, speed, small, previous, fired) -> tuple[Mode, list]:
    """Mode as far as positions and speeds decide it, and the links that may hold."""
    reduced = equations.reduced
    gate = active(reduced.terms, t)
    dry_limit = np.array([sum(x.law.value for x in torques if x.active(t)) for torques in reduced.dry.values()])
    state, candidates = np.zeros(len(reduced.links)), []
    angle = reduced.angle + reduced.K * theta[reduced.group]
    for b, link in enumerate(reduced.links):
        ends = link_ends(reduced, b, t, angle, speed)
        if link.dry:
            if abs(ends.lead) <= small:
                candidates.append(b)
            elif isinstance(link, OneWayClutch) and ends.lead > 0:
                raise SceneError(
                    f"{link.what}: at t = {t:.6g} s the driver is {ends.lead:.3g} rad/s faster than the driven shaft; it "
                    "would have to engage by an impact. Give both the same speed, or the driven shaft the larger one."
                )
            else:
                state[b] = np.sign(ends.lead)
        elif link.backlash:
            before = None if previous is None else previous.mode.state[b]
            if before is None or (before == 0 and ("flank", b) in fired):
                state[b] = _touching(link, ends, before is not None)
            elif ("flank", b) not in fired:
                state[b] = before
    direction = np.where(np.sign(speed[list(reduced.roots)]) < 0, -1.0, 1.0)
    forward = np.ones(len(reduced.links), dtype=bool) if previous is None else previous.mode.forward
    signs = _signs(indicate(reduced, speed), previous, fired, small / reduced.v_0)
    return Mode(forward, state, direction, gate, dry_limit, signs), candidates


def _touching(link, ends, landed: bool) -> float:
    """Flank that touches, 0 if none; just landed on one, the nearer."""
    sides = {side: link.touch(ends.twist, ends.lead, side) for side in (-1.0, 1.0)}
    best = max(sides, key=sides.get)
    return best if landed or sides[best] > 0 else 0.0


def _signs(values, previous, fired, small: float) -> np.ndarray:
    """Signs of the indicators; one that fired turns over, one at zero keeps its sign."""
    found = np.where(np.abs(values) <= small, 0.0, np.sign(values))
    if previous is None:
        return found
    before = previous.mode.signs
    turned = np.array([("indicator", i) in fired for i in range(len(values))], dtype=bool)
    return np.where(turned, -before, np.where(found == 0, before, found))


def _stick(equations, mode: Mode, candidates, probe) -> Phase:
    """Phase in which each candidate holds if the torque that it takes is within its bounds, else slips.

    The torques minimise the compulsion under inequality rows: u̇ = b + S λ, low ≤ λ ≤ high, u̇ of the sign of the
    violated bound; found by relaxation.
    """
    state = mode.state.copy()
    state[candidates] = 0.0
    trial = Phase(equations, replace(mode, state=state))
    locks = trial.locks
    free = equations(*probe, trial.conditions).acceleration
    R, H = (np.array([getattr(lock, key) for lock in locks]) for key in ("row", "column"))
    S, b = R @ H.T, R @ free
    low, high = np.array([trial.limits(lock, probe[0]) for lock in locks]).T
    torque = np.clip(np.zeros(len(locks)), low, high)
    for _ in range(SWEEPS):
        before = torque.copy()
        for k in range(len(locks)):
            torque[k] = np.clip(torque[k] - (b[k] + S[k] @ torque) / S[k, k], low[k], high[k])
        if np.abs(torque - before).max() <= ROUNDING * np.abs(torque).max():
            break
    rate = b + S @ torque
    for lock, value, least, most, moving in zip(locks, torque, low, high, rate, strict=True):
        if lock.kind == "group" or (least < value < most):
            continue
        if least < most and abs(moving) <= ROUNDING * (np.abs(b).max() or 1.0):
            continue  # exactly at its bound: it still holds
        slips = 1.0 if (value <= least if least < most else moving > 0) else -1.0  # sign of u̇
        state[lock.index] = -slips  # the lead of the driver is −u
    return Phase(equations, replace(mode, state=state))


def _flow(phase: Phase, resting, probe, speed, small) -> Mode:
    """Mode with the directions of power that follow from a phase, and the ways that groups at rest set out."""
    reduced, mode = phase.reduced, phase.mode
    found = phase.instant(*probe)
    direction = mode.direction.copy()
    tiny = ROUNDING * max(np.abs(found.applied).max(), np.abs(found.torque).max(initial=0.0))
    J = phase.reduced.factors(phase.f)[1]
    for g in resting:
        tied = any(lock.row[g] for lock in phase.locks if lock.kind == "link")
        if tied and direction[g] and abs(found.acceleration[g]) * J[g] <= HELD * tiny:
            continue  # a link holds it to something at rest; to hold it twice would leave the torques open
        ahead, back = (phase.setting_out(g, found, way)[0] * reduced.inertia[reduced.roots[g]] for way in WAYS)
        direction[g] = 1.0 if ahead > tiny else -1.0 if back < -tiny else 0.0
    way = np.where(direction == 0, 1.0, direction)[reduced.group] * np.sign(reduced.K)
    turning = np.where(np.abs(speed) <= small, way, np.sign(speed))
    forward = mode.forward.copy()
    drives = [b for of_group in reduced.lossy_drives for b in of_group if abs(found.torque[b]) > tiny]
    forward[drives] = found.torque[drives] / reduced.ratio[drives] * turning[reduced.driver[drives]] >= 0
    for g in {int(reduced.group[branch.child]) for branch in reduced.inward if reduced.links[branch.link].lossy}:
        if direction[g]:
            forward = group_pattern(reduced, g, found.applied, turning, forward)[1]
    return replace(mode, forward=forward, direction=direction)
