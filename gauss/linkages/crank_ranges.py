"""Crank angles at which a linkage can be assembled, and continuation of its assembly branch along them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from gauss.arguments import real_array
from gauss.errors import LinkageError
from gauss.linkages import triad as triads
from gauss.linkages.chain import Chain, end_of_turn
from gauss.linkages.motion import closure_slack, ternaries
from gauss.linkages.quadrature import SAMPLES

BISECTIONS = 45  # ends of ranges to 2π / 1440 / 2⁴⁵ ≈ 1e-16 rad
GRID_STEP = np.radians(1.0)  # between poses kept on the branch of a class III group
SHORTEST = 1e-10  # step at which the end of a branch is reached [rad]
FULL = (-np.pi, np.pi)  # range of a crank that turns fully
INSET = 0.005  # of a range, kept from its ends in a sweep: there a group is singular
POSE_DIFFERENCE = 1e-6  # rad, and relative to the size of the group: closer poses after a turn are the same assembly


class AssemblyBranch(NamedTuple):
    """Poses of the ternary links along the crank, by continuity from the start of the cycle.

    Attributes
    ----------
    angles : ndarray, shape (k,)
        Increasing crank angles [rad], a whole turn or as far as the branch leads.
    poses : dict
        Ternary link → poses x, y, angle (3, k).
    """

    angles: np.ndarray
    poses: dict[str, np.ndarray]

    def at(self, angles) -> dict[str, np.ndarray]:
        """Poses (3, k) near crank angles (k,), straight between those that are kept; nan beyond the ends."""
        low = self.angles[0]
        unwrapped = low + (angles - low) % (2 * np.pi)
        return {
            name: np.array([np.interp(unwrapped, self.angles, row, right=np.nan) for row in rows])
            for name, rows in self.poses.items()
        }


def closes(chain: Chain, angles) -> np.ndarray:
    """Whether all groups close at crank angles (k,) [rad]."""
    angles = np.atleast_1d(real_array(angles, "crank angles", "numbers [rad]"))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        slack = closure_slack(chain, angles, near(chain, angles))
        good = [np.broadcast_to(value >= 0, angles.shape) for group in slack for value in group.values()]
    return np.logical_and.reduce(good) if good else np.ones(angles.shape, bool)


def closing_ranges(chain: Chain) -> list[tuple[float, float]]:
    """Ranges (from, to) of crank angles within (−π, π] at which the linkage closes, to rounding.

    A range that passes π runs on beyond it; [(−π, π)] stands for a crank that turns fully. Empty: it closes nowhere.
    """
    angles = np.linspace(-np.pi, np.pi, SAMPLES, endpoint=False)
    good = closes(chain, angles)
    if good.all() or not good.any():
        return [FULL] if good.all() else []
    step = angles[1] - angles[0]
    starts = angles[good & ~np.roll(good, 1)]
    ends = angles[good & ~np.roll(good, -1)]
    starts, ends = _edge(chain, starts, -step), _edge(chain, ends, step)
    return [(a, ends[ends > a].min() if (ends > a).any() else ends.min() + 2 * np.pi) for a in starts]


def named_ranges(chain: Chain) -> str:
    """These ranges in words; empty if there are none."""
    return " and ".join(f"from {degrees(low)} to {degrees(high)}" for low, high in closing_ranges(chain))


def degrees(angle: float) -> str:
    """Angle in both units, for messages."""
    return f"{angle:.6g} rad ({np.degrees(angle):.4g}°)"


def required_ranges(chain: Chain) -> list[tuple[float, float]]:
    """Ranges of :func:`closing_ranges`; LinkageError if there are none."""
    ranges = closing_ranges(chain)
    if not ranges:
        raise LinkageError(f"{chain.name} closes at no crank angle: check the lengths.")
    return ranges


def sweep(chain: Chain, steps: int) -> np.ndarray:
    """Crank angles (steps + 1,) of a turn from the start of the cycle, in the sense of its motion, both ends included.

    Where the crank does not turn fully they run through a range that closes, short of its singular ends: the range of the
    start of the cycle, else the first.

    Raises
    ------
    LinkageError
        If the linkage closes nowhere.
    """
    ranges = required_ranges(chain)
    if ranges == [FULL]:
        return np.linspace(chain.driver.start, end_of_turn(chain), steps + 1)
    start, sense = chain.driver.start, -1 if chain.driver.speed < 0 else 1
    low, high = next((r for r in ranges if (start - r[0]) % (2 * np.pi) <= r[1] - r[0]), ranges[0])
    inset = INSET * (high - low)
    return np.linspace(low + inset, high - inset, steps + 1)[::sense]


def _edge(chain: Chain, inside: np.ndarray, step: float) -> np.ndarray:
    """Last closing angles between angles that close and angles a step further that do not."""
    inside, outside = inside.copy(), inside + step
    for _ in range(BISECTIONS):
        middle = (inside + outside) / 2
        good = closes(chain, middle)
        inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
    return inside


def near(chain: Chain, angles) -> dict[str, np.ndarray]:
    """Poses (3, k) of the ternary links near crank angles (k,), on the branch chosen by the user; nan where it ends."""
    if not chain.triads:
        return {}
    angles = real_array(angles, "crank angles", "numbers [rad]")
    if np.all(angles == chain.driver.start):
        return {name: pose + np.zeros(angles.shape) for name, pose in _first(chain).items()}
    return follow(chain).at(angles)


@lru_cache(maxsize=64)
def follow(chain: Chain) -> AssemblyBranch:
    """Follow the ternary links from the start of the cycle: through a turn of the crank, or both ways as far as they lead.

    LinkageError if they cannot be placed at the start of the cycle, or come back from a turn in another assembly.
    """
    start, first = chain.driver.start, _first(chain)
    forth = _walk(chain, first, start, 1.0)
    if forth[-1][0] < start + 2 * np.pi:
        forth = _walk(chain, first, start, -1.0)[:0:-1] + forth
    else:
        _check_same(chain, first, forth[-1][1])
    poses = {name: np.array([pose[name][:, 0] for _, pose in forth]).T for name in first}
    return AssemblyBranch(np.array([angle for angle, _ in forth]), poses)


def _check_same(chain: Chain, first, last):
    sizes = {triad.ternary.name: triads.size(triad) for triad in chain.triads}
    for name, pose in first.items():
        apart = np.abs(pose - last[name])[:, 0] / [sizes[name], sizes[name], 1.0]
        apart[2] = abs((apart[2] + np.pi) % (2 * np.pi) - np.pi)
        if apart.max() > POSE_DIFFERENCE:
            raise LinkageError(
                f"{chain.name}: after a turn of the crank link {name!r} comes back in another assembly; "
                "its motion is not periodic, and no cycle can be given."
            )


@lru_cache(maxsize=64)
def _first(chain: Chain) -> dict[str, np.ndarray]:
    """Poses (3, 1) of the ternary links at the start of the cycle, by Newton's method from the given ones."""
    guess = {triad.ternary.name: np.array(triad.pose, dtype=float)[:, None] for triad in chain.triads}
    first = _placed(chain, chain.driver.start, guess, tries=12)
    if first is None:
        raise LinkageError(
            f"{chain.name}: at crank angle {chain.driver.start:.6g} rad Newton's method does not place the ternary links "
            f"{', '.join(guess)} from the given poses; give poses nearer to an assembly, or a start angle that closes."
        )
    return first


def _walk(chain: Chain, first, start: float, sense: float) -> list[tuple[float, dict]]:
    """Crank angles and poses from the start through a turn or to the end of the branch, where steps become short."""
    path, step, gone = [(start, first)], GRID_STEP, 0.0
    while gone < 2 * np.pi and step > SHORTEST:
        reach = min(gone + step, 2 * np.pi)
        found = _placed(chain, start + sense * reach, _extrapolated(path, start + sense * reach))
        if found is None:
            step /= 2
            continue
        gone = reach
        path.append((start + sense * gone, found))
    return path


def _extrapolated(path, angle: float) -> dict:
    """Poses extrapolated linearly from the last two."""
    (last, poses), (before, earlier) = path[-1], path[-2] if len(path) > 1 else (path[-1][0] - 1.0, path[-1][1])
    share = (angle - last) / (last - before)
    return {name: pose + share * (pose - earlier[name]) for name, pose in poses.items()}


def _placed(chain: Chain, angle: float, guess, tries: int = 1):
    """Poses of the ternary links at one crank angle from nearby ones; None if Newton's method does not converge."""
    at = np.array([angle])
    with np.errstate(all="ignore"):
        for _ in range(tries):
            guess, slack = ternaries(chain, at, guess)
            if all(np.all(value >= 0) for group in slack for value in group.values()):
                return guess
    return None
