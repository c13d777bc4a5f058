"""Inputs (controls) and outputs (sensors) of a scene: what a controller sets, and what it measures.

An input is a generalised force along one joint rate, held between the samples of a control law (zero-order hold; Åström and
Wittenmark, Computer-Controlled Systems, 3rd ed., 2.3).
"""

from dataclasses import dataclass
from math import inf

from gauss.errors import SceneError, did_you_mean
from gauss.scene import values
from gauss.scene.builder import SceneBuilder, name_of
from gauss.scene.loads import Drive

# What an output measures → the kind of element that it is measured of, and the number of its values; 0: that of the element.
SENSORS = {
    "coordinate": ("joint", 0),
    "rate": ("joint", 0),
    "position": ("frame", 3),
    "rotation": ("frame", 9),
    "velocity": ("frame", 3),
    "angular_velocity": ("frame", 3),
    "acceleration": ("frame", 3),
    "accelerometer": ("frame", 3),
    "gyroscope": ("frame", 3),
    "joint_force": ("joint", 3),
    "joint_moment": ("joint", 3),
    "contact_force": ("contact", 0),
}


@dataclass(frozen=True)
class Input:
    """Torque or force of a joint that a control law sets; zero without one.

    Parameters
    ----------
    name, joint : str
        Name of the input; joint of one freedom, or one rate of a joint such as "U.angle1".
    limits : float or tuple of float, optional
        Least and largest effort [N m, N]; one number stands for both signs. Efforts beyond are cut off there.
    """

    name: str
    joint: str
    limits: float | tuple[float, float] | None = None

    def __post_init__(self):
        """Check every value."""
        what = f"input {values.text(self.name, 'name of an input')!r}"
        values.text(self.joint, f"{what}: joint")
        if self.limits is None:
            return
        if isinstance(self.limits, int | float):
            values.keep(self, limits=values.number(self.limits, f"{what}: limits", "N m or N", positive=True))
            return
        low, high = values.vector(self.limits, f"{what}: limits", "N m or N", 2)
        if not low < high:
            raise SceneError(f"{what}: limits: expected the least effort before the largest, got {(low, high)}.")
        values.keep(self, limits=(low, high))

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest effort [N m, N]."""
        if self.limits is None:
            return -inf, inf
        return self.limits if isinstance(self.limits, tuple) else (-self.limits, self.limits)


@dataclass(frozen=True)
class Output:
    """Measured quantity.

    Parameters
    ----------
    name : str
        Name of the output.
    kind : str
        "coordinate" [rad, m] or "rate" [rad/s, m/s] of a joint; of a point of a body or frame, in world axes, "position"
        (3,) [m], "rotation" (3, 3) row by row, "velocity" (3,) [m/s], "angular_velocity" (3,) [rad/s] or "acceleration" (3,)
        [m/s²]; in its own axes, "accelerometer" (3,), acceleration less gravity [m/s²], or "gyroscope" (3,) [rad/s]. Of the
        parent on the child of a joint, in world axes, "joint_force" (3,) [N] and "joint_moment" (3,) about the joint point
        [N m]. "contact_force" [N, N m], one value for each gap of a contact, stop or rope.
    of : str
        Joint; body or frame; contact, stop or rope.
    at : array_like, shape (3,)
        Point in the body or frame [m].
    """

    name: str
    kind: str
    of: str
    at: tuple = (0.0, 0.0, 0.0)

    def __post_init__(self):
        """Check every value."""
        what = f"output {values.text(self.name, 'name of an output')!r}"
        if self.kind not in SENSORS:
            raise SceneError(f"{what}: no kind {self.kind!r}. {did_you_mean(str(self.kind), SENSORS)}")
        values.text(self.of, f"{what}: of")
        values.keep(self, at=values.vector(self.at, f"{what}: at", "m"))

    def size(self, scene) -> int:
        """Number of its values in a scene."""
        measured, fixed = SENSORS[self.kind]
        if fixed:
            return fixed
        if measured == "contact":
            return len(scene.contacts[self.of].sides(scene))
        pair = scene.joints[self.of].pair
        return pair.n_q if self.kind == "coordinate" else pair.n_v


class InputBuilder(SceneBuilder):
    """Builder methods for inputs and outputs; each adds one element and returns it."""

    loads: dict

    def input(self, name: str, joint, limits=None) -> Input:
        """Let a control law set the torque or force of a joint.

        Parameters
        ----------
        name : str
            Name of the input.
        joint : str, Joint or Drive
            Joint of one freedom, one rate of a joint such as "U.angle1", or a drive: its joint, with its limit where
            ``limits`` is not given. The effort of the drive itself is added.
        limits : float or tuple of float, optional
            Least and largest effort [N m, N]; one number stands for both signs. Efforts beyond are cut off there.

        Returns
        -------
        Input
            What was added. :func:`gauss.simulate` takes the law as ``control=``.
        """
        drive = joint if isinstance(joint, Drive) else self.loads.get(joint) if isinstance(joint, str) else None
        if isinstance(drive, Drive):
            joint, limits = drive.joint, drive.limit if limits is None else limits
        return self.add(Input(name, name_of(joint), limits))

    def output(self, name: str, kind: str, of, at=(0.0, 0.0, 0.0)) -> Output:
        """Measure a joint, body, frame or contact; see :class:`gauss.scene.Output` for the kinds."""
        return self.add(Output(name, kind, name_of(of), at))
