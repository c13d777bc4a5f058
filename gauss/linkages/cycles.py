"""Solution of a linkage at crank angles: kinematics forward along the groups, forces backward, all angles in one call.

Near singular positions, where accelerations and reactions lose three times the digits of the condition number, the same
equations run in twice the precision.
"""

from dataclasses import replace

import numpy as np

from gauss.arguments import real_numbers
from gauss.errors import LinkageError
from gauss.linkages.assembly_checks import check_assembled, check_regular
from gauss.linkages.chain import Chain
from gauss.linkages.conditioning import conditions, loss
from gauss.linkages.crank_ranges import near
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.extended import DOUBLE_EPSILON, FIELDS, extended
from gauss.linkages.motion import move
from gauss.linkages.placed import LinkMotion
from gauss.linkages.plane import angle
from gauss.linkages.reactions import react

EXTENDED_CONDITION = 1e2  # condition number of a group from which twice the precision is used: doubles lose six digits


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
    angles = _numbers("angles", angles)
    speed = _numbers("speed", driver.speed if speed is None else speed) + 0.0 * angles
    acceleration = _numbers("acceleration", driver.acceleration if acceleration is None else acceleration) + 0.0 * angles
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        motion = move(chain, angles, speed, acceleration, near(chain, angles))
        kappa = conditions(motion)
        delicate = np.flatnonzero(~(kappa < EXTENDED_CONDITION).all(axis=0))
        found = Cycle(motion, *react(motion), loss(kappa, DOUBLE_EPSILON))
        if delicate.size:
            found, kappa[:, delicate] = _extended(found, delicate, speed, acceleration)
    check_assembled(found.motion)
    check_regular(found, kappa)
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


def _numbers(what: str, given) -> np.ndarray:
    numbers = real_numbers(given)
    if numbers is None:
        raise LinkageError(f"{what}: expected numbers, got {given!r}.")
    array = np.atleast_1d(numbers)
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise LinkageError(f"{what}: expected one or more finite numbers in a row, got shape {array.shape}.")
    return array
