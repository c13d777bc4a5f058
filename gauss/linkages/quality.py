"""Grashof's rule, transmission angles and dead centres of a linkage."""

from typing import NamedTuple

import numpy as np

from gauss.errors import LinkageError
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.crank_ranges import FULL, near, required_ranges
from gauss.linkages.cycle_result import transmission_angles
from gauss.linkages.cycles import cycle
from gauss.linkages.motion import move
from gauss.linkages.quadrature import SAMPLES, zeros
from gauss.scene import GROUND

POOR_TRANSMISSION = np.radians(30.0)  # designers keep transmission angles above this
REFINEMENTS = 6  # searches, each 20 times finer
END = 1e-9  # from the ends of a closing range, where a group is singular [rad]
CHANGE_POINT = 1e-12  # margin, relative to the sum of the lengths, that is taken for zero


class Grashof(NamedTuple):
    """Grashof's rule for a four-bar or a slider-crank.

    Attributes
    ----------
    kind : str
        crank-rocker, double-crank, double-rocker, change point or triple-rocker; for a slider-crank: rotating crank,
        change point or swinging crank.
    margin : float
        p + q − s − l of the four lengths in order; r2 − r1 − |offset| of a slider-crank [m].
    shortest : str
        Shortest link, "ground" for the frame.
    """

    kind: str
    margin: float
    shortest: str


def grashof(chain: Chain) -> Grashof | None:
    """Class of the four-bar or slider-crank that the crank makes with the first group; None for anything else."""
    group = chain.groups[0] if chain.groups else None
    if not isinstance(group, Dyad) or group.kind not in ("RRR", "RRP"):
        return None
    legs = {leg.carrier: leg for leg in group.legs}
    if set(legs) != {GROUND, chain.crank.name}:
        return None
    on_crank, on_ground = legs[chain.crank.name], legs[GROUND]
    if on_crank.joint.kind != "revolute":
        return None
    pivot, crank = chain.pivot, chain.crank.name
    r1 = abs(on_crank.joint.point(crank) - pivot.point(crank))
    r2 = _length(on_crank, group.inner)
    if group.kind == "RRP":
        return _slider_crank(chain, on_crank, on_ground, group.inner, r1, r2)
    lengths = {
        crank: r1,
        on_crank.name: r2,
        on_ground.name: _length(on_ground, group.inner),
        GROUND: abs(on_ground.joint.point(GROUND) - pivot.point(GROUND)),
    }
    s, p, q, l = sorted(lengths.values())  # noqa: E741
    margin, shortest = p + q - s - l, min(lengths, key=lambda name: lengths[name])
    kinds = {GROUND: "double-crank", on_crank.name: "double-rocker"}
    kind = kinds.get(shortest, "crank-rocker") if margin > 0 else "triple-rocker"
    return Grashof("change point" if abs(margin) <= CHANGE_POINT * (s + p + q + l) else kind, margin, shortest)


def _slider_crank(chain: Chain, rod, slider, inner, r1: float, r2: float) -> Grashof:
    joint = slider.joint
    u = joint.direction(GROUND)
    pin = (inner.point(slider.name) - joint.point(slider.name)) * (u / joint.direction(slider.name))
    offset = ((joint.point(GROUND) + pin - chain.pivot.point(GROUND)) / u).imag
    margin = r2 - r1 - abs(offset)
    kind = "rotating crank" if margin > 0 else "swinging crank"
    kind = "change point" if abs(margin) <= CHANGE_POINT * (r1 + r2) else kind
    return Grashof(kind, margin, chain.crank.name if r1 <= r2 else rod.name)


def _length(leg, inner) -> float:
    return abs(inner.point(leg.name) - leg.joint.point(leg.name))


def dead_centres(chain: Chain, output: str) -> np.ndarray:
    """Crank angles of a turn at which a link does not turn, or a slider does not slide, increasing [rad].

    Parameters
    ----------
    chain : Chain
        The linkage.
    output : str
        Name of a link, or of a slide.

    Raises
    ------
    LinkageError
        If there is neither, or the linkage closes nowhere.
    """
    joints = {joint.name: joint for joint in chain.joints if joint.kind == "prismatic"}
    links = [link.name for link in chain.links]
    if not isinstance(output, str) or (output not in joints and output not in links):
        raise LinkageError(f"no link or slide {output!r}; links: {', '.join(links)}; slides: {', '.join(joints) or 'none'}.")

    def speed(angles):
        found = cycle(chain, angles, speed=1.0)
        return found.slide(output).speed if output in joints else found.link(output).omega + np.zeros(len(found))

    ranges = required_ranges(chain)
    if ranges == [FULL]:
        start = chain.driver.start
        return np.unique(zeros(speed, start, start + 2 * np.pi))
    inner = [(a + 1e-6 * (b - a), b - 1e-6 * (b - a)) for a, b in ranges]
    return np.concatenate([np.zeros(0), *(zeros(speed, a, b) for a, b in inner)])


def least_transmission(chain: Chain) -> dict[str, tuple[float, float]]:
    """Least transmission angle of each dyad over a turn, or over the angles that close, and the crank angle where [rad]."""
    ranges = required_ranges(chain)
    inset = 0.0 if ranges == [FULL] else END
    rows = np.array([np.linspace(a + inset, b - inset, SAMPLES) for a, b in ranges])
    found = {}
    for name, mu in transmission(chain, rows.ravel()).items():
        row, column = np.unravel_index(np.argmin(mu), rows.shape)
        best, (start, end) = rows[row, column], rows[row, [0, -1]]
        spacing = (end - start) / SAMPLES
        low, high = max(best - spacing, start), min(best + spacing, end)
        for _ in range(REFINEMENTS):
            closer = np.linspace(low, high, 41)
            mu = transmission(chain, closer)[name]
            best = closer[np.argmin(mu)]
            low, high = max(low, best - (high - low) / 40), min(high, best + (high - low) / 40)
        found[name] = float(mu.min()), float(best if best > -np.pi else np.pi)
    return found


def transmission(chain: Chain, angles) -> dict[str, np.ndarray]:
    """Transmission angles (k,) of the dyads at crank angles [rad]; where a group is singular it is zero, and no error."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        motion = move(chain, angles, 1.0 + 0.0 * angles, 0.0 * angles, near(chain, angles))
    return transmission_angles(motion)
