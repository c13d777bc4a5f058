"""Elements of a scene with their indices and constant frames in a system."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss.errors import StateError
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

    body: int
    R: np.ndarray
    p: np.ndarray


@dataclass(frozen=True)
class BoundLoad:
    """Load with its laws as functions of (t, motion)."""

    load: SceneLoad
    laws: tuple[Callable, ...] = ()

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
