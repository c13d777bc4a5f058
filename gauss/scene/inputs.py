"""Inputs (controls) and outputs (sensors) of a scene: what a controller sets, and what it measures.

An input is a value u that is held between the samples of a control law (zero-order hold; Åström and Wittenmark,
Computer-Controlled Systems, 3rd ed., 2.3); its effort is u itself, or a law of it, along joint rates and on bodies:

    Q = e(u, t, q, v) · (Σ factor · rate + Σ Jᵀ (F, M))
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real

from gauss.errors import SceneError, did_you_mean, listed
from gauss.scene import values
from gauss.scene.builder import SceneBuilder, name_of
from gauss.scene.loads import Drive, Force

# What an output measures → the kind of element that it is measured of, and the number of its values; 0: that of the element.
SENSORS = {
    "coordinate": ("joint", 0),
    "rate": ("joint", 0),
    "position": ("frame", 3),
    "rotation": ("frame", 9),
    "velocity": ("frame", 3),
    "angular_velocity": ("frame", 3),
    "x_axis": ("frame", 3),
    "y_axis": ("frame", 3),
    "z_axis": ("frame", 3),
    "acceleration": ("frame", 3),
    "angular_acceleration": ("frame", 3),
    "proper_acceleration": ("frame", 3),
    "accelerometer": ("frame", 3),
    "gyroscope": ("frame", 3),
    "velocimeter": ("frame", 3),
    "center_of_mass": ("body", 3),
    "center_of_mass_velocity": ("body", 3),
    "angular_momentum": ("body", 3),
    "joint_force": ("joint", 3),
    "joint_moment": ("joint", 3),
    "contact_force": ("contact", 0),
}
AXES = ("x_axis", "y_axis", "z_axis")
SEEN = ("position", "rotation", *AXES, "velocity", "angular_velocity")  # from another frame, if asked for


@dataclass(frozen=True)
class Input:
    """Torque or force of a joint that a control law sets; zero without one.

    Parameters
    ----------
    name : str
        Name of the input.
    joint : str or mapping of str to float
        Joint of one freedom, or one rate of a joint such as "U.angle1"; of several ones, or with a gear, the torque or force
        along each for an effort of 1. Empty if the input acts by ``forces`` alone.
    limits : float or tuple of float, optional
        Least and largest value [N m, N where ``effort`` is not given]; one number stands for both signs. Values beyond are
        cut off there.
    effort : callable, optional
        Law (u, t, motion) of the effort for a value u, which can be traced; u itself when not given.
    forces : sequence of Force
        Forces and moments on bodies for an effort of 1; their names do not matter.
    """

    name: str
    joint: str | tuple[tuple[str, float], ...]
    limits: float | tuple[float, float] | None = None
    effort: Callable | None = None
    forces: tuple[Force, ...] = ()

    def __post_init__(self):
        what = f"input {values.text(self.name, 'name of an input')!r}"
        self._check_what_it_acts_on(what)
        if self.limits is None:
            return
        if isinstance(self.limits, Real):
            values.keep(self, limits=values.number(self.limits, f"{what}: limits", "N m or N", positive=True))
            return
        low, high = values.vector(self.limits, f"{what}: limits", "N m or N", 2)
        if not low < high:
            raise SceneError(f"{what}: limits: expected the least effort before the largest, got {(low, high)}.")
        values.keep(self, limits=(low, high))

    def _check_what_it_acts_on(self, what: str):
        self._keep_joints(what)
        if not isinstance(self.forces, tuple | list) or not all(isinstance(force, Force) for force in self.forces):
            raise SceneError(f"{what}: forces: expected Force elements, got {self.forces!r}.")
        values.keep(self, forces=tuple(self.forces))
        if not self.joint and not self.forces:
            raise SceneError(f"{what}: name a joint that it acts on, or give forces.")
        if self.effort is not None and (not callable(self.effort) or values.arguments(self.effort) != 3):
            raise SceneError(f"{what}: effort: expected a function of (u, t, motion), got {self.effort!r}.")

    def _keep_joints(self, what: str):
        """Keep the joints as pairs of a name and a factor; a single name as it is."""
        if isinstance(self.joint, str):
            values.text(self.joint, f"{what}: joint")
            return
        pairs = self.joint.items() if isinstance(self.joint, Mapping) else self.joint
        try:
            found = [(values.text(joint, f"{what}: joint"), factor) for joint, factor in pairs]
        except (TypeError, ValueError):
            raise SceneError(f"{what}: joint: expected a name, or {{name: factor}}, got {self.joint!r}.") from None
        values.keep(self, joint=tuple((joint, values.number(factor, f"{what}: joint", "1")) for joint, factor in found))

    @property
    def acts_on(self) -> dict[str, float]:
        """Joints, or single rates, with the torque or force along each for an effort of 1."""
        return {self.joint: 1.0} if isinstance(self.joint, str) else dict(self.joint)

    @property
    def is_plain(self) -> bool:
        """Whether its value is the torque or force of one joint."""
        return isinstance(self.joint, str) and self.effort is None and not self.forces

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest value [N m, N where no law makes an effort of it]."""
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
        (3,) [m], "rotation" (3, 3) row by row, its columns "x_axis", "y_axis", "z_axis" (3,), "velocity" (3,) [m/s],
        "angular_velocity" (3,) [rad/s], "acceleration" (3,) [m/s²], "proper_acceleration" (3,), acceleration less
        gravity [m/s²], or "angular_acceleration" (3,) [rad/s²]; in its own axes, "accelerometer" (3,), acceleration less
        gravity [m/s²], "gyroscope" (3,) [rad/s] or "velocimeter" (3,) [m/s]. Of a body and all that hangs on it in the
        spanning tree, or of "ground", in world axes, "center_of_mass" (3,) [m], "center_of_mass_velocity" (3,) [m/s] and
        "angular_momentum" (3,) about it [kg m²/s]. Of the parent on the child of a joint, in world axes, "joint_force"
        (3,) [N] and "joint_moment" (3,) about the joint point [N m]. "contact_force" [N, N m], one value for each gap of
        a contact, stop or rope.
    of : str
        Joint; body or frame; contact, stop or rope.
    at : array_like, shape (3,)
        Point in the body or frame [m].
    relative_to : str, optional
        Body or frame that poses and velocities are seen from, in whose axes they are then; the ground when not given.
    """

    name: str
    kind: str
    of: str
    at: tuple = (0.0, 0.0, 0.0)
    relative_to: str = ""

    def __post_init__(self):
        what = f"output {values.text(self.name, 'name of an output')!r}"
        if not isinstance(self.kind, str) or self.kind not in SENSORS:
            raise SceneError(f"{what}: no kind {self.kind!r}. {did_you_mean(str(self.kind), SENSORS)}")
        values.text(self.of, f"{what}: of")
        if self.relative_to != "":
            values.text(self.relative_to, f"{what}: relative_to")
            if self.kind not in SEEN:
                raise SceneError(f"{what}: relative_to: {self.kind!r} is not seen from a frame, only {listed(SEEN)} are.")
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

    def input(self, name: str, joint, limits=None, effort=None, forces=()) -> Input:
        """Let a control law set the torque or force of a joint.

        Parameters
        ----------
        name : str
            Name of the input.
        joint : str, Joint, Drive or mapping
            Joint of one freedom, one rate of a joint such as "U.angle1", or a drive: its joint, with its limit where
            ``limits`` is not given. The effort of the drive itself is added. Several joints, or a gear, as
            {joint: factor}.
        limits : float or tuple of float, optional
            Least and largest value [N m, N]; one number stands for both signs. Values beyond are cut off there.
        effort : callable, optional
            Law (u, t, motion) of the effort for a value u, as of a servo: ``lambda u, t, at: k * (u - at.coordinate("A"))``.
        forces : sequence of Force
            Forces and moments on bodies for an effort of 1, as of a propeller.

        Returns
        -------
        Input
            What was added. :func:`gauss.simulate` takes the law as ``control=``.
        """
        drive = joint if isinstance(joint, Drive) else self.loads.get(joint) if isinstance(joint, str) else None
        if isinstance(drive, Drive):
            joint, limits = drive.joint, drive.limit if limits is None else limits
        return self.add(Input(name, name_of(joint), limits, effort, forces))

    def output(self, name: str, kind: str, of, at=(0.0, 0.0, 0.0), relative_to="") -> Output:
        """Measure a joint, body, frame or contact; see :class:`gauss.scene.Output` for the kinds."""
        return self.add(Output(name, kind, name_of(of), at, name_of(relative_to)))

    def _place_input(self, given: Input):
        self._require_new(given.name, "input", self.inputs | self.loads | self._constraints)
        for joint in given.acts_on:
            self._require_coordinate(joint, f"input {given.name!r}")
        for force in given.forces:
            self._require_body(force.body, f"input {given.name!r}: force {force.name!r}")
        self.inputs[given.name] = given

    def _place_output(self, output: Output):
        what = f"output {output.name!r}"
        self._require_new(output.name, "output", self.outputs)
        measured = SENSORS[output.kind][0]
        if measured == "joint":
            self.require_joint(output.of, what)
        elif measured == "contact":
            if output.of not in self.contacts:
                raise SceneError(f"{what}: no contact {output.of!r}. {did_you_mean(output.of, self.contacts)}")
        elif measured == "body":
            self._require_body(output.of, what)
        else:
            self._require_place(output.of, what)
            if output.relative_to:
                self._require_place(output.relative_to, f"{what}: relative_to")
        self.outputs[output.name] = output
