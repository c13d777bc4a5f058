"""Margins of a mode: quantities that are positive while the mode holds, each over its own scale.

Power flow of lossy links, slip of dry links, gap function of backlash sides, direction of groups with friction, torque
reserve of the locks, and the indicators, which only report events.
"""

import numpy as np

from gauss.rotors.mechanics import NetworkInstant, link_kinematics
from gauss.rotors.mode import indicate
from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import REST_SPEED

Margins = list[tuple[tuple[str, int], float]]  # (kind, number of the link, group or indicator), value


def margins(phase: NetworkPhase, t: float, theta, w, scale: float) -> tuple[list[tuple[str, int]], np.ndarray]:
    """Names (kind, number) and values of the margins of a phase.

    Parameters
    ----------
    t, theta, w
        Time [s], angles since the start [rad] and speeds [rad/s] of the roots.
    scale : float
        Scale of torques [N m].
    """
    reduced, mode = phase.reduced, phase.mode
    found, torques = phase.solve(t, theta, w)
    speed = reduced.K * w[reduced.group]
    angle = reduced.angle + reduced.K * theta[reduced.group]
    every = [*_flows(phase, found, speed, scale), *_slips(phase, speed), *_gaps(phase, t, angle, speed)]
    every += [(("group", g), w[g] * mode.direction[g] / reduced.largest) for g in reduced.frictional if mode.direction[g]]
    every += _reserves(phase, t, found, torques, scale)
    signs = indicate(reduced, speed) * mode.signs
    keys = [key for key, _ in every] + [("indicator", i) for i in range(len(signs))]
    return keys, np.array([*(value for _, value in every), *np.where(mode.signs == 0, np.inf, signs * REST_SPEED)])


def _flows(phase: NetworkPhase, found: NetworkInstant, speed: np.ndarray, scale: float) -> Margins:
    """Power flow of lossy links whose driver turns."""
    reduced, mode = phase.reduced, phase.mode
    turning = reduced.lossy[~phase.standing()[reduced.group[reduced.driver[reduced.lossy]]]]
    flow = found.torque[turning] * speed[reduced.driver[turning]] / (reduced.ratio[turning] * reduced.largest * scale)
    values = np.where(mode.forward[turning], flow, -flow)
    return [(("flow", int(b)), value) for b, value in zip(turning, values, strict=True)]


def _slips(phase: NetworkPhase, speed: np.ndarray) -> Margins:
    """Slip of dry links."""
    reduced, state = phase.reduced, phase.mode.state
    found = []
    for b in reduced.dry_links:
        if state[b]:
            lead = speed[reduced.driver[b]] / reduced.ratio[b] - speed[reduced.driven[b]]
            found.append((("link", b), lead * state[b] / reduced.largest))
    return found


def _gaps(phase: NetworkPhase, t: float, angle: np.ndarray, speed: np.ndarray) -> Margins:
    """Contact of backlash sides: pressure of the one in contact, else gap function."""
    reduced, found = phase.reduced, []
    for b in reduced.loose_springs:
        link, state = reduced.links[b], phase.mode.state[b]
        ends = link_kinematics(reduced, b, t, angle, speed)
        contact = [link.touch(ends.twist, ends.lead, side) for side in (-1.0, 1.0)]
        found.append((("side", b), contact[int(state > 0)] if state else -max(contact)))
    return found


def _reserves(phase: NetworkPhase, t: float, found: NetworkInstant, torques: np.ndarray, scale: float) -> Margins:
    """Torque reserve of the locks."""
    reserves = []
    for lock, torque in zip(phase.locks, torques, strict=True):
        if lock.kind == "group":
            starts = [phase.breakaway(lock.place, found, direction)[0] * direction for direction in (1.0, -1.0)]
            value = -max(starts) * phase.inertia[lock.place] / scale
        else:
            low, high = phase.limits(lock, t)
            value = min(high - torque, torque - low) / scale
        reserves.append(((lock.kind, lock.place), value))
    return reserves
