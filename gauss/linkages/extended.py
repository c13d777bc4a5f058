"""Linkages near singular positions: solution in twice the precision, and its sensitivity to the rounding of the data.

There, accelerations and reactions are second derivatives of a root, and lose three times the digits of the condition number.
In twice the precision the result is exact for the given data. These are rounded themselves: a number of few digits means its
decimals, which a double is not, any other is uncertain by half a unit in its last place. The stated error is the change that
follows from both.
"""

from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple, cast

import numpy as np

from gauss.linkages.chain import Chain, Dyad, Leg, Triad
from gauss.linkages.doubled import Doubled
from gauss.linkages.elements import LinkJoint
from gauss.linkages.loads import acting, centre
from gauss.linkages.motion import LinkageKinematics, conditions, move
from gauss.linkages.placed import LinkMotion
from gauss.linkages.plane import Cartesian, rounded, unit
from gauss.linkages.reactions import inertial, react

HALF_UNIT = 2.0**-53  # of a number in double precision, relative
DECIMAL_DIGITS = 15  # that every double keeps: a number of no more means its decimals
DOUBLED_EPSILON = 2.0**-104  # of numbers in twice the precision, relative
DOUBLE_EPSILON = 2.0**-52  # of results in double precision
FIELDS = ("p", "e", "v", "omega", "a", "alpha")


class Extended(NamedTuple):
    """Results in twice the precision at crank angles (m,), rounded to doubles."""

    motion: LinkageKinematics  # where the links are and how they move; without the groups at their inner joints
    condition: np.ndarray  # (n, m): condition number of each group
    reactions: dict[str, np.ndarray]  # joint → reaction (m,), see :class:`gauss.linkages.Cycle`
    torque: np.ndarray  # (m,): torque of the motor [N m]
    # (m,): by how much torque, reactions or accelerations change when the data change by their rounding, relative to the
    # largest contribution of each; not a number where the linkage may not close
    error: np.ndarray


@dataclass(frozen=True)
class GivenJoint:
    """Joint whose points and guide directions are numbers in twice the precision; else that joint.

    Parameters
    ----------
    points, directions : dict
        Link → point [m] and direction of the guide in its frame.
    """

    joint: LinkJoint
    points: dict
    directions: dict

    def __getattr__(self, name):
        return getattr(self.joint, name)

    def point(self, link: str) -> Cartesian:
        """Pin, base point or reference point in the frame of one of its links."""
        return self.points[link]

    def direction(self, link: str) -> Cartesian:
        """Direction of the guide in the frame of one of its links."""
        return self.directions[link]


def loss(kappa: np.ndarray, rounding: float) -> np.ndarray:
    """Bound (k,) of the relative error that rounding leaves in second derivatives of groups with condition numbers (n, k).

    A position is a root, and each derivative of it loses the digits of the condition number once more; what is lost in one
    group is magnified by the others.
    """
    return rounding * (1.0 + (kappa**2).sum(axis=0) * kappa.prod(axis=0))


def extended(chain: Chain, angles, speed, acceleration, poses) -> Extended:
    """Motion and forces at crank angles (m,) in twice the precision, and their error.

    Parameters
    ----------
    chain : Chain
        The linkage.
    angles, speed, acceleration : ndarray, shape (m,)
        Of the crank [rad, rad/s, rad/s²].
    poses : dict
        For each ternary link its pose x, y, angle (3, m), close to where it is.
    """
    data = _Data(chain, angles)
    given = data.chain()
    count = data.count
    speeds, accelerations = (np.repeat(part, count) for part in (speed, acceleration))
    around = {name: np.repeat(pose, count, axis=1) for name, pose in poses.items()}
    motion = move(given, data.angle(), speeds, accelerations, around)
    reactions, torque = react(motion)
    motion, kappa = _rounded(motion), conditions(motion)[:, ::count]
    torque, reactions = rounded(torque), {name: rounded(value) for name, value in reactions.items()}
    links = {name: _first(moving, count) for name, moving in motion.links.items()}
    slack = tuple({words: value[::count] for words, value in group.items()} for group in motion.slack)
    base = LinkageKinematics(chain, angles, speed, links, (), slack)
    terms = _terms(base, move(chain, angles, 1.0 + 0.0 * angles, 0.0 * angles, poses))
    apart = [*_changes(motion, base, count), *_force_changes(chain, reactions, torque, count, terms)]
    firsts = {name: value[::count] for name, value in reactions.items()}
    return Extended(
        base, kappa, firsts, torque[::count], np.maximum.reduce(apart) + loss(kappa, DOUBLED_EPSILON) + DOUBLE_EPSILON
    )


class _Data:
    """Lengths and angles in columns of each crank angle: as given, those of few digits at their decimals, others in turn."""

    def __init__(self, chain: Chain, angles):
        self.given, self.angles, self.columns = chain, angles, ["given", "decimals", "crank"]
        for joint in chain.joints:
            self.columns += [name for name, value in _numbers(joint).items() if not _is_typed(value)]

    @property
    def count(self) -> int:
        """Number of columns of each crank angle."""
        return len(self.columns)

    def angle(self) -> Doubled:
        """Crank angles (m · count,)."""
        off = [self._off("crank" if not _is_typed(angle) else "decimals", angle) for angle in self.angles]
        return Doubled(np.repeat(self.angles, self.count), np.concatenate(off))

    def chain(self) -> Chain:
        """The linkage with these data."""
        # given joints have the interface of the joints that they replace
        joints = {joint.name: cast(LinkJoint, self._joint(joint)) for joint in self.given.joints}
        of = lambda joint: joints[joint.name]  # noqa: E731
        groups: list[Dyad | Triad] = []
        for group in self.given.groups:
            legs = tuple(Leg(leg.link, of(leg.joint)) for leg in group.legs)
            if isinstance(group, Dyad):
                groups.append(replace(group, i=legs[0], j=legs[1], inner=of(group.inner)))
            else:
                groups.append(replace(group, legs=legs, inners=tuple(map(of, group.inners))))
        return replace(self.given, pivot=of(self.given.pivot), groups=tuple(groups))

    def _joint(self, joint: LinkJoint) -> GivenJoint:
        number = {name: self._number(name, value) for name, value in _numbers(joint).items()}
        of = lambda link, *keys: (number[joint.name, link, key] for key in keys)  # noqa: E731
        links = joint.parent, joint.child
        return GivenJoint(
            joint,
            {link: Cartesian(*of(link, "x", "y")) for link in links},
            {link: unit(*of(link, "angle")) for link in links},
        )

    def _number(self, name, value: float) -> Doubled:
        lo = np.tile(self._off("decimals" if _is_typed(value) else name, value), self.angles.size)
        return Doubled(value + 0.0 * lo, lo)

    def _off(self, column, value: float) -> np.ndarray:
        """Change of a number in each of the columns (count,)."""
        size = float(Fraction(repr(float(value))) - Fraction(float(value))) if _is_typed(value) else HALF_UNIT * value
        return size * np.array([float(other == column) for other in self.columns])


def _numbers(joint: LinkJoint) -> dict:
    """Lengths and angles of a joint."""
    found: dict[tuple[str, str, str], float] = {}
    for link, angle in ((joint.parent, joint.angle), (joint.child, joint.child_angle)):
        point = joint.point(link)
        found |= {
            (joint.name, link, "x"): point.real,
            (joint.name, link, "y"): point.imag,
            (joint.name, link, "angle"): angle,
        }
    return found


def _is_typed(value: float) -> bool:
    return len(Decimal(repr(float(value))).normalize().as_tuple().digits) <= DECIMAL_DIGITS


def _rounded(motion: LinkageKinematics) -> LinkageKinematics:
    links = {
        name: LinkMotion(*(rounded(getattr(moving, field)) for field in FIELDS)) for name, moving in motion.links.items()
    }
    slack = tuple({words: rounded(value) for words, value in group.items()} for group in motion.slack)
    return replace(motion, crank_angle=rounded(motion.crank_angle), links=links, slack=slack)


def _first(moving: LinkMotion, count: int) -> LinkMotion:
    """A link in the first of the columns of each crank angle."""
    values = (getattr(moving, field) for field in FIELDS)
    return LinkMotion(*(value if np.ndim(value) == 0 else value[::count] for value in values))


def _changes(motion: LinkageKinematics, base: LinkageKinematics, count: int) -> list[np.ndarray]:
    """Changes (m,) of linear and angular accelerations, relative to the largest and what they are composed of."""
    linear, angular, places, turns = [], [], [], []
    for link in base.chain.links:
        moving, first, G = motion.links[link.name], base.links[link.name], centre(base, link)
        linear.append(moving.acceleration(centre(motion, link)) + 0.0 * motion.crank_angle)
        angular.append(moving.alpha + 0.0 * motion.crank_angle)
        places.append(abs(first.velocity(G) * first.omega))
        turns.append(first.omega**2)
    return [_relative(linear, count, places), _relative(angular, count, turns)]


def _force_changes(chain: Chain, reactions, torque, count: int, terms) -> list[np.ndarray]:
    """Changes (m,) of forces of the joints, moments of slides, and torque, relative to the largest."""
    slides = [joint.name for joint in chain.joints if joint.kind == "prismatic"]
    forces = [value.real if name in slides else value for name, value in reactions.items()]
    found = [_relative(forces, count), _relative([torque], count, terms)]
    return [*found, _relative([reactions[name].imag for name in slides], count, terms)] if slides else found


def _terms(motion: LinkageKinematics, slow: LinkageKinematics) -> list[np.ndarray]:
    """Terms of the torque: power of the inertia and the loads of every link on the motion with unit crank speed [N m]."""
    needs = [(inertial(motion, link), link.name) for link in motion.chain.links]
    needs += [(acting(load, motion), load.link) for load in motion.chain.loads]
    return [
        abs(wrench.force) * abs(slow.links[link].velocity(wrench.x)) + abs(wrench.moment * slow.links[link].omega)
        for wrench, link in needs
    ]


def _relative(values, count: int, terms=()) -> np.ndarray:
    """Sum over the columns of the largest change of any value, relative to the largest value or term of the first column."""
    values = np.array(values).reshape(len(values), -1, count)
    apart = np.abs(values - values[:, :, :1]).max(axis=0).sum(axis=-1)
    sizes = [*np.abs(values[:, :, 0]), *(term + 0.0 * apart for term in terms)]
    scale = np.maximum.reduce(sizes)
    return np.where(apart == 0.0, 0.0, apart / np.where(scale > 0.0, scale, np.finfo(float).tiny))
