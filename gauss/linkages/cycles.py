"""A linkage at many crank angles at once: motion, reactions and driving torque."""

import warnings
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gauss.errors import LinkageError, NearSingularWarning, did_you_mean
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.closing import closing_ranges, near
from gauss.linkages.conditioning import conditions, loss
from gauss.linkages.elements import LinkJoint
from gauss.linkages.extended import FIELDS, extended
from gauss.linkages.motion import Motion, move
from gauss.linkages.placed import Moving
from gauss.linkages.plane import angle, dot, left
from gauss.linkages.reactions import react

NEAR_SINGULAR = 1e3  # condition number of a group from which on it is flagged: some 0.1° from a singular position
DELICATE = 1e2  # the same, from which on numbers are found in twice the precision: six digits are gone with doubles
ROUNDING = 2.0**-52  # of doubles; accelerations and reactions lose three times the digits of the condition number
WORST = 1e-6  # relative error above which a group counts as singular: fewer than six digits are left


class Reaction(NamedTuple):
    """What the parent of a joint exerts on its child.

    Attributes
    ----------
    force : ndarray, shape (k, 2)
        Force [N], at the pin or at the slider's reference point.
    moment : ndarray, shape (k,)
        Moment [N m]; zero at a pin.
    """

    force: np.ndarray
    moment: np.ndarray


class Slide(NamedTuple):
    """Slider on its guide: position s [m] from the base point, speed [m/s], acceleration [m/s²], each (k,)."""

    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray


class Point(NamedTuple):
    """Point of a link in world axes: position [m], velocity [m/s], acceleration [m/s²], each (k, 2)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class Cycle:
    """Motion and forces of a linkage at crank angles (k,).

    Parameters
    ----------
    motion : Motion
        Where the links are and how they move.
    reactions : dict
        Joint → R_x + i R_y [N] of a pin, R_n + i R_m [N, N m] of a slide, on its child; (k,) complex.
    torque : ndarray, shape (k,)
        Torque M1 of the motor on the crank [N m], counter-clockwise.
    error : ndarray, shape (k,)
        Estimated relative error of torque, accelerations and reactions. Near singular positions, where it is measured, it is
        what the rounding of lengths and angles to doubles leaves open; elsewhere it is bounded by the condition numbers.
    """

    motion: Motion
    reactions: dict[str, np.ndarray]
    torque: np.ndarray
    error: np.ndarray

    @property
    def chain(self) -> Chain:
        """The linkage in the order of its groups."""
        return self.motion.chain

    @property
    def crank_angle(self) -> np.ndarray:
        """Crank angles (k,) [rad], as given."""
        return self.motion.crank_angle

    def __len__(self):
        return len(self.crank_angle)

    def __repr__(self):
        return f"Cycle({self.chain.name!r}, {len(self)} crank angles)"

    def link(self, name: str) -> Moving:
        """Link frame in the plane: origin p, axis e, their rates v, omega, a, alpha; complex and real arrays (k,).

        Raises
        ------
        LinkageError
            If there is no such link.
        """
        if name not in self.motion.links:
            raise LinkageError(f"no link {name!r}. {did_you_mean(name, self.motion.links)}")
        return self.motion.links[name]

    def angle(self, link: str) -> np.ndarray:
        """Angle (k,) of a link in (−π, π] [rad]."""
        return angle(self.link(link).e) + np.zeros(len(self))

    def point(self, link: str, at=(0.0, 0.0)) -> Point:
        """Curve of a point given in the frame of a link, e.g. of a coupler point."""
        moving = self.link(link)
        x = moving.point(complex(*at))
        return Point(*(self._columns(z) for z in (x, moving.velocity(x), moving.acceleration(x))))

    def slide(self, joint: str) -> Slide:
        """Motion of a slider along its guide.

        Raises
        ------
        LinkageError
            If the joint is not a slide.
        """
        found = self._joint(joint)
        if found.kind != "prismatic":
            raise LinkageError(f"joint {joint!r} is a pin; only a slide has a position along a guide.")
        parent, child = (self.motion.links[name] for name in (found.parent, found.child))
        Q, u = child.point(found.point(found.child)), found.direction(found.child) * child.e
        position = dot(u, Q - parent.point(found.point(found.parent)))
        speed = dot(u, child.velocity(Q) - parent.velocity(Q))
        return Slide(position, speed, dot(u, child.acceleration(Q) - parent.acceleration(Q)))

    def reaction(self, joint: str, axes: str = "world") -> Reaction:
        """Reaction of a joint.

        Parameters
        ----------
        joint : str
            Name of the joint.
        axes : str
            "world", or the name of the link in whose frame the force is given.
        """
        found, value = self._joint(joint), self.reactions[joint]
        moment = np.zeros(len(self))
        force = value
        if found.kind == "prismatic":
            child = self.motion.links[found.child]
            force, moment = value.real * left(found.direction(found.child) * child.e), moment + value.imag
        if axes != "world":
            force = force * np.conj(self.link(axes).e)
        return Reaction(self._columns(force), moment)

    def transmission(self) -> dict[str, np.ndarray]:
        """Angle (k,) in [0, π/2] by which each dyad keeps away from its singular positions [rad].

        RRR: the transmission angle between the links; RRP: π/2 less the pressure angle; zero where the group is singular.
        """
        return transmission_angles(self.motion)

    def condition(self) -> dict[str, np.ndarray]:
        """Condition number (k,) of the matrix of each group, lengths made free of units."""
        return {group.name: kappa for group, kappa in zip(self.chain.groups, conditions(self.motion), strict=True)}

    def _joint(self, name: str) -> LinkJoint:
        joints = {joint.name: joint for joint in self.chain.joints}
        if name not in joints:
            raise LinkageError(f"no joint {name!r}. {did_you_mean(name, joints)}")
        return joints[name]

    def _columns(self, z) -> np.ndarray:
        z = z + np.zeros(len(self), dtype=complex)
        return np.stack([z.real, z.imag], axis=1)


def transmission_angles(motion: Motion) -> dict[str, np.ndarray]:
    """Transmission angles (k,) of all dyads of a motion [rad]."""
    return {
        group.name: angle(meeting.quality) + 0.0 * motion.crank_angle
        for group, meeting in zip(motion.chain.groups, motion.meetings, strict=True)
        if isinstance(group, Dyad)
    }


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
    """
    driver = chain.driver
    angles = _numbers("angles", angles)
    speed = _numbers("speed", driver.speed if speed is None else speed) + 0.0 * angles
    acceleration = _numbers("acceleration", driver.acceleration if acceleration is None else acceleration) + 0.0 * angles
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        motion = move(chain, angles, speed, acceleration, near(chain, angles))
        kappa = conditions(motion)
        delicate = np.flatnonzero(~(kappa < DELICATE).all(axis=0))
        found = Cycle(motion, *react(motion), loss(kappa, ROUNDING))
        if delicate.size:
            found, kappa[:, delicate] = _extended(found, delicate, speed, acceleration)
    _check_closed(found.motion)
    _check_regular(found, kappa)
    return found


def _extended(found: Cycle, at: np.ndarray, speed, acceleration) -> tuple[Cycle, np.ndarray]:
    """The cycle with what twice the precision finds at some of its angles, and condition numbers (n, m) there."""
    motion = found.motion
    poses = {triad.ternary.name: _pose(motion.links[triad.ternary.name])[:, at] for triad in motion.chain.triads}
    exact = extended(motion.chain, found.crank_angle[at], speed[at], acceleration[at], poses)

    def placed(values, better):
        values = np.array(values + np.zeros(len(found)))
        values[at] = better
        return values

    links = {
        name: Moving(*(placed(getattr(moving, field), getattr(exact.motion.links[name], field)) for field in FIELDS))
        for name, moving in motion.links.items()
    }
    pairs = zip(motion.slack, exact.motion.slack, strict=True)
    slack = tuple({words: placed(value, better[words]) for words, value in group.items()} for group, better in pairs)
    reactions = {name: placed(value, exact.reactions[name]) for name, value in found.reactions.items()}
    torque, error = placed(found.torque, exact.torque), placed(found.error, exact.error)
    return Cycle(replace(motion, links=links, slack=slack), reactions, torque, error), exact.condition


def _pose(moving: Moving) -> np.ndarray:
    """Pose x, y, angle (3, k) of a link."""
    return np.stack([moving.p.real, moving.p.imag, angle(moving.e)])


def _numbers(what: str, given) -> np.ndarray:
    try:
        array = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError) as error:
        raise LinkageError(f"{what}: expected numbers, got {given!r}.") from error
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise LinkageError(f"{what}: expected one or more finite numbers in a row, got shape {array.shape}.")
    return array


def _check_closed(motion: Motion):
    for group, slack in zip(motion.chain.groups, motion.slack, strict=True):
        for words, value in slack.items():
            bad = ~(np.broadcast_to(value, motion.crank_angle.shape) >= 0)
            if bad.any():
                raise LinkageError(_open(motion, group, words, value, bad))


def _open(motion: Motion, group, words: str, value, bad) -> str:
    worst = np.flatnonzero(bad)[np.argmax(np.nan_to_num(-value[bad], nan=np.inf))]
    amount = "" if isinstance(value[worst], float) and np.isnan(value[worst]) else f" by {-value[worst]:.6g} m"
    amount = amount if isinstance(group, Dyad) else ""
    ranges = closing_ranges(motion.chain)
    where = " and ".join(f"from {degrees(a)} to {degrees(b)}" for a, b in ranges)
    closing = f"It closes for crank angles {where}." if ranges else "It closes at no crank angle: check the lengths."
    return (
        f"{motion.chain.name}: the {group.name} does not close at crank angle {degrees(motion.crank_angle[worst])}: "
        f"it is {words}{amount}. {closing}"
    )


def degrees(angle: float) -> str:
    """Angle in both units, for messages."""
    return f"{angle:.6g} rad ({np.degrees(angle):.4g}°)"


def _check_regular(found: Cycle, kappa: np.ndarray):
    """Refuse angles where too few digits are left, and warn of those that are close to it."""
    if not kappa.size:
        return
    groups, nowhere = found.chain.groups, np.where(np.isfinite(found.error), found.error, np.inf)
    worst = int(np.argmax(nowhere))
    if not nowhere[worst] <= WORST:
        where = _delicate(found, kappa, groups, worst, "too near a singular position")
        raise LinkageError(
            f"{where}: lengths and angles, rounded to doubles, determine {_digits(nowhere[worst])} of torque, reactions or "
            "accelerations. Leave this angle out."
        )
    highest = kappa.max(axis=0)
    if highest.max() > NEAR_SINGULAR:
        worst = int(np.argmax(np.where(highest > NEAR_SINGULAR, found.error, -1.0)))
        where = _delicate(found, kappa, groups, worst, "nearly singular")
        warnings.warn(
            f"{where}: lengths and angles, rounded to doubles, determine {_digits(found.error[worst])} of torque, "
            "reactions and accelerations there.",
            NearSingularWarning,
            stacklevel=3,
        )


def _delicate(found: Cycle, kappa: np.ndarray, groups, k: int, what: str) -> str:
    which = int(np.argmax(np.nan_to_num(kappa[:, k], nan=np.inf, posinf=np.inf)))
    what = what if np.isfinite(kappa[which, k]) and kappa[which, k] < 1.0 / ROUNDING else "singular"
    return (
        f"{found.chain.name}: the {groups[which].name} is {what} at crank angle {degrees(found.crank_angle[k])} "
        f"(condition number {kappa[which, k]:.1e})"
    )


def _digits(error: float) -> str:
    digits = int(-np.log10(max(error, np.finfo(float).tiny))) if error < 1.0 else 0
    return {0: "no digit", 1: "one digit"}.get(digits, f"{digits} digits")
