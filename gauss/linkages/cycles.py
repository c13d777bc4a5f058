"""A linkage at many crank angles at once: motion, reactions and driving torque."""

import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import LinkageError, NearSingularWarning, known
from gauss.linkages import triad as triads
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.closing import closing_ranges, near
from gauss.linkages.elements import LinkJoint
from gauss.linkages.motion import Motion, move
from gauss.linkages.placed import Moving
from gauss.linkages.plane import angle, dot, left
from gauss.linkages.reactions import react

NEAR_SINGULAR = 1e3  # condition number of a group from which on it is flagged: some 0.1° from a singular position
SINGULAR = 1e13  # condition number at which no digit is left


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
    """

    motion: Motion
    reactions: dict[str, np.ndarray]
    torque: np.ndarray

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
            raise LinkageError(f"no link {name!r}. {known(name, self.motion.links)}")
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
        return {
            group.name: np.broadcast_to(_condition(group, meeting), (len(self),))
            for group, meeting in zip(self.chain.groups, self.motion.meetings, strict=True)
        }

    def _joint(self, name: str) -> LinkJoint:
        joints = {joint.name: joint for joint in self.chain.joints}
        if name not in joints:
            raise LinkageError(f"no joint {name!r}. {known(name, joints)}")
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
        If a group does not close, or is singular, at any of the angles; the message names it and the angles that do close.

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
        _check_closed(motion)
        _check_regular(motion)
        reactions, torque = react(motion)
    return Cycle(motion, reactions, torque)


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


def _check_regular(motion: Motion):
    for group, meeting in zip(motion.chain.groups, motion.meetings, strict=True):
        kappa = np.broadcast_to(_condition(group, meeting), motion.crank_angle.shape)
        worst = int(np.argmax(np.nan_to_num(kappa, nan=np.inf)))
        at = f"{motion.chain.name}: the {group.name}"
        if not kappa[worst] < SINGULAR:
            raise LinkageError(
                f"{at} is singular at crank angle {degrees(motion.crank_angle[worst])} (condition number "
                f"{kappa[worst]:.1e}): its links are in a dead position and no finite forces hold it. Leave this angle out."
            )
        if kappa[worst] > NEAR_SINGULAR:
            warnings.warn(
                f"{at} is nearly singular at crank angle {degrees(motion.crank_angle[worst])}: condition number "
                f"{kappa[worst]:.1e}; accelerations and reactions lose as many digits there.",
                NearSingularWarning,
                stacklevel=4,
            )


def _condition(group, meeting):
    if isinstance(group, Dyad):  # of two unit rows at this angle: cot(angle / 2)
        size = abs(meeting.quality)
        return (size + meeting.quality.real) / meeting.quality.imag
    matrix = triads.matrix(meeting)
    return np.where(np.isfinite(matrix).all((1, 2)), np.linalg.cond(np.nan_to_num(matrix)), np.inf)
