"""Places of joints, coordinates, rates and frames of a system by their names."""

from functools import cached_property

from gauss.errors import StateError, did_you_mean
from gauss.system.placed_elements import PlacedFrame, PlacedJoint


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
