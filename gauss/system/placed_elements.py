"""Elements of a scene with their indices and constant frames in a system, and what it finds by their names."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss.errors import StateError, did_you_mean
from gauss.scene import Drive, ElasticLink, Force, Input, JointSpring, Pair, Slipping, Spring

SceneLoad = Drive | ElasticLink | Force | Input | JointSpring | Slipping | Spring
LAW_FIELDS = ("effort", "force", "moment")  # fields of loads that hold laws


@dataclass(frozen=True)
class PlacedJoint:
    """Joint with its constant frames and its slices of q and v.

    Parameters
    ----------
    name : str
        Name of the joint.
    pair : Pair
        Its kinematics.
    parent, child : int
        Bodies; −1 is the ground.
    R_parent, p_parent : ndarray
        Joint frame in the principal central frame of the parent: rotation (3, 3), origin (3,) [m].
    R_child, p_child : ndarray
        The same in the child.
    q, v : slice
        Its coordinates and rates.
    """

    name: str
    pair: Pair
    parent: int
    child: int
    R_parent: np.ndarray
    p_parent: np.ndarray
    R_child: np.ndarray
    p_child: np.ndarray
    q: slice
    v: slice

    @property
    def n_plain(self) -> int:
        """Number of its first coordinates, whose derivatives are rates: those before a quaternion."""
        return self.pair.n_v if self.pair.quaternion is None else self.pair.quaternion

    def plain(self, rate: int) -> int:
        """Index, among its coordinates, of that whose derivative is this rate.

        Raises
        ------
        StateError
            If the rate is a component of an angular velocity, which is no derivative of a coordinate.
        """
        if self.pair.quaternion is not None and rate >= self.pair.quaternion:
            raise StateError(
                f"joint {self.name!r}: {self.pair.rates[rate]} is a component of its angular velocity and no coordinate; "
                "use its rate, or the rotation of the body."
            )
        return rate


@dataclass(frozen=True)
class PlacedFrame:
    """Frame on a body, in its principal central frame: body frames and named frames."""

    body: int  # its body; −1 is the ground
    R: np.ndarray  # (3, 3) from its axes to the principal axes
    p: np.ndarray  # (3,) its origin [m]


@dataclass(frozen=True)
class BoundLoad:
    """Load with its laws."""

    load: SceneLoad  # load of the scene
    laws: tuple[Callable, ...] = ()  # functions of (t, motion)

    @property
    def functions(self) -> list[Callable]:
        """Laws that are functions of the user."""
        return [law for law in (getattr(self.load, field, None) for field in LAW_FIELDS) if callable(law)]

    @property
    def on_coordinates(self) -> bool:
        """Whether it acts along joint coordinates, and needs no poses of bodies."""
        if isinstance(self.load, Input):
            return not self.load.forces
        return isinstance(self.load, Drive | ElasticLink | JointSpring | Slipping)


class NamedPlaces:
    """What a system finds by names.

    Attributes
    ----------
    joints : tuple of PlacedJoint
        Joints in the order of the scene.
    frames : dict
        Body frames and named frames by name.
    """

    joints: tuple[PlacedJoint, ...]
    frames: dict[str, PlacedFrame]

    @cached_property
    def _joints_by_name(self) -> dict[str, PlacedJoint]:
        return {joint.name: joint for joint in reversed(self.joints)}

    @cached_property
    def _coordinates_by_name(self) -> dict[str, tuple[PlacedJoint, int | None]]:
        joints = self._joints_by_name.items()
        single = {f"{name}.{rate}": (joint, k) for name, joint in joints for k, rate in enumerate(joint.pair.rates)}
        return single | {name: (joint, None) for name, joint in joints}

    def joint(self, name: str) -> PlacedJoint:
        """Return the joint of this name.

        Raises
        ------
        StateError
            If there is none.
        """
        found = self._joints_by_name.get(name) if isinstance(name, str) else None
        if found is None:
            raise StateError(f"no joint {name!r}. {did_you_mean(name, [joint.name for joint in self.joints])}")
        return found

    def coordinate(self, name: str) -> tuple[PlacedJoint, int | None]:
        """Return the joint of this name, or the joint and the number of its rate that a name such as "U.angle1" means.

        Raises
        ------
        StateError
            If there is neither.
        """
        found = self._coordinates_by_name.get(name) if isinstance(name, str) else None
        return (self.joint(name), None) if found is None else found

    def column(self, name: str) -> int:
        """Return the place in v of a joint of one freedom, or of one rate of a joint."""
        placed, k = self.coordinate(name)
        return placed.v.start + (k or 0)

    def entry(self, name: str) -> int:
        """Return the place in q of a joint of one freedom, or of the coordinate whose derivative is one rate of a joint.

        Raises
        ------
        StateError
            If there is none, or the rate is a component of an angular velocity, which is no derivative of a coordinate.
        """
        placed, k = self.coordinate(name)
        return placed.q.start + placed.plain(k or 0)

    def frame(self, name: str) -> PlacedFrame:
        """Return the body frame or named frame of this name.

        Raises
        ------
        StateError
            If there is none.
        """
        if not isinstance(name, str) or name not in self.frames:
            raise StateError(f"no body or frame {name!r}. {did_you_mean(name, self.frames)}")
        return self.frames[name]
