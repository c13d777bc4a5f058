"""Solution of a linkage at crank angles: kinematics forward along the groups, forces backward, all angles in one call.

Near singular positions, where accelerations and reactions lose three times the digits of the condition number, the same
equations run in twice the precision.
"""

import warnings
from dataclasses import replace

import numpy as np

from gauss.arguments import real_numbers
from gauss.errors import LinkageError, NearSingularWarning
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.crank_ranges import degrees, named_ranges, near
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.extended import DOUBLE_EPSILON, FIELDS, extended, loss
from gauss.linkages.motion import LinkageKinematics, conditions, move
from gauss.linkages.placed import LinkMotion
from gauss.linkages.plane import angle
from gauss.linkages.reactions import react

EXTENDED_CONDITION = 1e2  # condition number of a group from which twice the precision is used: doubles lose six digits
WARNED_CONDITION = 1e3  # condition number of a group: some 0.1° from a singular position
LARGEST_ERROR = 1e-6  # relative error above which a group counts as singular: fewer than six digits are left
SINGULAR_CONDITION = 2.0**52  # condition number of a matrix that is singular in doubles


def cycle(chain: Chain, angles, speed: float | None = None, acceleration: float | None = None) -> Cycle:
    """Motion and forces at given crank angles.

    Parameters
    ----------
    chain : Chain
        The linkage.
    angles : array_like, shape (k,)
        Crank angles [rad].
    speed, acceleration : float or array_like (k,), optional
        Speed [rad/s] and acceleration [rad/s²] of the crank; those of the linkage when not given.

    Returns
    -------
    Cycle
        Motion, driving torque and reactions at every angle.

    Raises
    ------
    LinkageError
        If a group does not close at any of the angles, the message names it and the angles that do close; or if it is so
        near a singular position that lengths and angles, as doubles, determine fewer than six digits.

    Warns
    -----
    NearSingularWarning
        If a group comes close to a singular position.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> from gauss.linkages import cycle
    >>> cycle(bar.chain, [0.0, 0.5], speed=5.0).torque.round(3)
    array([-51.888,   6.133])
    """
    driver = chain.driver
    angles = crank_numbers("angles", angles)
    speed = crank_numbers("speed", driver.speed if speed is None else speed) + 0.0 * angles
    given = driver.acceleration if acceleration is None else acceleration
    acceleration = crank_numbers("acceleration", given) + 0.0 * angles
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        motion = move(chain, angles, speed, acceleration, near(chain, angles))
        kappa = conditions(motion)
        delicate = np.flatnonzero(~(kappa < EXTENDED_CONDITION).all(axis=0))
        found = Cycle(motion, *react(motion), loss(kappa, DOUBLE_EPSILON))
        if delicate.size:
            found, kappa[:, delicate] = _extended(found, delicate, speed, acceleration)
    _check_assembled(found.motion)
    _check_regular(found, kappa)
    return found


def _extended(found: Cycle, at: np.ndarray, speed, acceleration) -> tuple[Cycle, np.ndarray]:
    """The cycle with results of twice the precision at some of its angles, and condition numbers (n, m) there."""
    motion = found.motion
    poses = {triad.ternary.name: _pose(motion.links[triad.ternary.name])[:, at] for triad in motion.chain.triads}
    exact = extended(motion.chain, found.crank_angle[at], speed[at], acceleration[at], poses)

    def placed(values, better):
        values = np.array(values + np.zeros(len(found)))
        values[at] = better
        return values

    links = {
        name: LinkMotion(*(placed(getattr(moving, field), getattr(exact.motion.links[name], field)) for field in FIELDS))
        for name, moving in motion.links.items()
    }
    pairs = zip(motion.slack, exact.motion.slack, strict=True)
    slack = tuple({words: placed(value, better[words]) for words, value in group.items()} for group, better in pairs)
    reactions = {name: placed(value, exact.reactions[name]) for name, value in found.reactions.items()}
    torque, error = placed(found.torque, exact.torque), placed(found.error, exact.error)
    return Cycle(replace(motion, links=links, slack=slack), reactions, torque, error), exact.condition


def _pose(moving: LinkMotion) -> np.ndarray:
    """Pose x, y, angle (3, k) of a link."""
    return np.stack([moving.p.real, moving.p.imag, angle(moving.e)])


def crank_numbers(what: str, given) -> np.ndarray:
    """Finite numbers (k,) of the crank; LinkageError if they are none."""
    numbers = real_numbers(given)
    if numbers is None:
        raise LinkageError(f"{what}: expected numbers, got {given!r}.")
    array = np.atleast_1d(numbers)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise LinkageError(f"{what}: expected one or more finite numbers in a row, got {given!r:.80}.")
    return array


def _check_assembled(motion: LinkageKinematics) -> None:
    """Check that all groups can be assembled at all crank angles.

    LinkageError if one cannot; the message names it and the angles at which the linkage closes.
    """
    for group, slack in zip(motion.chain.groups, motion.slack, strict=True):
        for words, value in slack.items():
            bad = ~(np.broadcast_to(value, motion.crank_angle.shape) >= 0)
            if bad.any():
                raise LinkageError(_open(motion, group, words, value, bad))


def _open(motion: LinkageKinematics, group, words: str, value, bad) -> str:
    worst = np.flatnonzero(bad)[np.argmax(np.nan_to_num(-value[bad], nan=np.inf))]
    amount = "" if isinstance(value[worst], float) and np.isnan(value[worst]) else f" by {-value[worst]:.6g} m"
    amount = amount if isinstance(group, Dyad) else ""
    ranges = named_ranges(motion.chain)
    closing = f"It closes for crank angles {ranges}." if ranges else "It closes at no crank angle: check the lengths."
    return (
        f"{motion.chain.name}: the {group.name} does not close at crank angle {degrees(motion.crank_angle[worst])}: "
        f"it is {words}{amount}. {closing}"
    )


def _check_regular(found: Cycle, kappa: np.ndarray) -> None:
    """Refuse crank angles at which too few digits are left, and warn of nearly singular ones.

    LinkageError if fewer than six digits are left.
    """
    if not kappa.size:
        return
    groups, nowhere = found.chain.groups, np.where(np.isfinite(found.error), found.error, np.inf)
    worst = int(np.argmax(nowhere))
    if not nowhere[worst] <= LARGEST_ERROR:
        where = _where(found, kappa, groups, worst, "too near a singular position")
        raise LinkageError(
            f"{where}: lengths and angles, rounded to doubles, determine {_digits(nowhere[worst])} of torque, reactions or "
            "accelerations. Leave this angle out."
        )
    highest = kappa.max(axis=0)
    if highest.max() > WARNED_CONDITION:
        worst = int(np.argmax(np.where(highest > WARNED_CONDITION, found.error, -1.0)))
        where = _where(found, kappa, groups, worst, "nearly singular")
        warnings.warn(
            f"{where}: lengths and angles, rounded to doubles, determine {_digits(found.error[worst])} of torque, "
            "reactions and accelerations there.",
            NearSingularWarning,
            stacklevel=3,
        )


def _where(found: Cycle, kappa: np.ndarray, groups, k: int, what: str) -> str:
    which = int(np.argmax(np.nan_to_num(kappa[:, k], nan=np.inf, posinf=np.inf)))
    what = what if np.isfinite(kappa[which, k]) and kappa[which, k] < SINGULAR_CONDITION else "singular"
    return (
        f"{found.chain.name}: the {groups[which].name} is {what} at crank angle {degrees(found.crank_angle[k])} "
        f"(condition number {kappa[which, k]:.1e})"
    )


def _digits(error: float) -> str:
    digits = int(-np.log10(max(error, np.finfo(float).tiny))) if error < 1.0 else 0
    return {0: "no digit", 1: "one digit"}.get(digits, f"{digits} digits")
