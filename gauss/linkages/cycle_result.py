"""Motion, reactions and driving torque of a linkage at many crank angles, and derived curves."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import LinkageError, did_you_mean
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.elements import LinkJoint
from gauss.linkages.motion import LinkageKinematics, conditions
from gauss.linkages.placed import LinkMotion
from gauss.linkages.plane import angle, dot, left


class JointReaction(NamedTuple):
    """Reaction of a joint on its child link.

    Attributes
    ----------
    force : ndarray, shape (k, 2)
        Force [N], at the pin or at the slider's reference point.
    moment : ndarray, shape (k,)
        Moment [N m]; zero at a pin.
    """

    force: np.ndarray
    moment: np.ndarray


class SlideMotion(NamedTuple):
    """Slider on its guide: position s [m] from the base point, speed [m/s], acceleration [m/s²], each (k,)."""

    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray


class PointMotion(NamedTuple):
    """Point of a link in world axes: position [m], velocity [m/s], acceleration [m/s²], each (k, 2)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class Cycle:
    """Motion and forces of a linkage at crank angles (k,).

    Parameters
    ----------
    motion : LinkageKinematics
        Motion of the links.
    reactions : dict
        Joint → R_x + i R_y [N] of a pin, R_n + i R_m [N, N m] of a slide, on its child; (k,) complex.
    torque : ndarray, shape (k,)
        Torque M1 of the motor on the crank [N m], counter-clockwise.
    error : ndarray, shape (k,)
        Estimated relative error of torque, accelerations and reactions. Near singular positions it is
        measured, the effect of rounding lengths and angles to doubles; elsewhere the condition numbers bound it.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> cycle.torque.round(3)
    array([-85.354,   9.519,  63.267])
    >>> cycle.reaction("B").force.round(2)[0]
    array([-295.56, -219.26])
    >>> cycle.point("coupler", (0.5, 0.2)).position.round(4)[0]
    array([0.6203, 0.4914])
    """

    motion: LinkageKinematics
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

    def link(self, name: str) -> LinkMotion:
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

    def point(self, link: str, at=(0.0, 0.0)) -> PointMotion:
        """Curve of a point given in the frame of a link, e.g. of a coupler point."""
        moving = self.link(link)
        x = moving.point(complex(*at))
        return PointMotion(*(self._columns(z) for z in (x, moving.velocity(x), moving.acceleration(x))))

    def slide(self, joint: str) -> SlideMotion:
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
        return SlideMotion(position, speed, dot(u, child.acceleration(Q) - parent.acceleration(Q)))

    def reaction(self, joint: str, axes: str = "world") -> JointReaction:
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
        return JointReaction(self._columns(force), moment)

    def transmission(self) -> dict[str, np.ndarray]:
        """Angle (k,) in [0, π/2] of each dyad from its singular positions [rad].

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


def transmission_angles(motion: LinkageKinematics) -> dict[str, np.ndarray]:
    """Transmission angles (k,) of all dyads of a motion [rad]."""
    return {
        group.name: angle(freedoms.quality) + 0.0 * motion.crank_angle
        for group, freedoms in zip(motion.chain.groups, motion.freedoms, strict=True)
        if isinstance(group, Dyad)
    }
