"""Builder methods of a scene for drives, forces, springs, starts, and states of one's own.

A state ẋ = f(t, motion) is the rate of a body with a moment of inertia of 1 kg m² that acts on nothing: the compulsion gains
½ (ẋ − f)², the least of which is the law. So whatever moves mechanisms moves states.
"""

import warnings
from math import pi, radians

import numpy as np

from gauss.errors import SceneError, StartWarning, user_level
from gauss.scene import values
from gauss.scene.body import Body
from gauss.scene.builder import SceneBuilder, name_of
from gauss.scene.elastic import ElasticLink
from gauss.scene.joint import Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start, StateLaw
from gauss.scene.motions import Prescribed
from gauss.scene.names import GROUND
from gauss.scene.set_valued import LimitedDrive

ANGULAR_COORDINATES = {"revolute": (0,), "screw": (0,), "cylindrical": (0,), "universal": (0, 1), "planar": (2,)}
LARGEST_ANGLE = 4 * pi  # rad: more than two turns are mostly degrees


class LoadBuilder(SceneBuilder):
    """Builder methods for loads, prescribed motions, starts and states; each adds one element and returns it."""

    def drive(
        self,
        joint,
        *,
        torque=None,
        force=None,
        angle=None,
        displacement=None,
        speed=None,
        limit: float | None = None,
        breaks=(),
        name: str | None = None,
    ):
        """Drive a joint by an effort, or along a motion whatever effort that takes.

        Parameters
        ----------
        joint : str or Joint
            Joint; for a motion one of one freedom, or one rate of a joint such as "U.angle1".
        torque, force : float, sequence or callable
            Torque [N m] or force [N]: a constant, law(t) or law(t, motion).
        angle, displacement : float, callable or spline
            Angle [rad] or displacement [m] as a function of time; a number holds the joint there.
        speed : float, callable or spline
            Rate [rad/s, m/s] as a function of time.
        limit : float, optional
            Largest torque or force that the drive has [N m, N]: an effort is cut off there, and a speed is kept as long as
            it takes no more. A prescribed angle or displacement has none: once lost, it could not be caught up.
        breaks : sequence of float
            Times at which a torque or force switches [s], for a law that cannot be traced: no step crosses them.
        name : str, optional
            Name of the drive.

        Returns
        -------
        Drive, Prescribed or LimitedDrive
            What was added. The effort of a prescribed motion comes from :func:`gauss.drive_forces`.
        """
        given = {"torque": torque, "force": force, "angle": angle, "displacement": displacement, "speed": speed}
        given = {key: value for key, value in given.items() if value is not None}
        if len(given) != 1:
            raise SceneError(
                f"drive of joint {name_of(joint)!r}: give either torque= [N m] or force= [N], "
                f"or angle= [rad], displacement= [m] or speed= [rad/s, m/s]; got {', '.join(given) or 'none of them'}."
            )
        (key, law), joint = next(iter(given.items())), name_of(joint)
        name = name or self._fresh(f"drive of {joint}")
        if key in ("torque", "force"):
            return self.add(Drive(name, joint, law, limit, breaks))
        if len(breaks):
            raise SceneError(
                f"drive of joint {joint!r}: breaks= goes with torque= or force=; gauss finds where {key}= switches."
            )
        if limit is not None and key == "speed":
            return self.add(LimitedDrive(name, joint, limit, law))
        if limit is not None:
            raise SceneError(f"drive of joint {joint!r}: limit= goes with torque=, force= or speed=, not with {key}=.")
        return self.add(Prescribed(name, joint, speed=law) if key == "speed" else Prescribed(name, joint, position=law))

    def force(self, name: str, body, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), **options) -> Force:
        """Load a body by a force [N] and a moment [N m]; see :class:`gauss.Force`."""
        return self.add(Force(name, name_of(body), force, moment, **options))

    def spring(self, name: str, body, other, at=(0, 0, 0), other_at=(0, 0, 0), **options) -> Spring:
        """Stretch a spring and damper between points of two bodies; see :class:`gauss.Spring`."""
        return self.add(Spring(name, name_of(body), name_of(other), at, other_at, **options))

    def joint_spring(self, name: str, joint, **options) -> JointSpring:
        """Put a spring and damper on the coordinate of a joint; see :class:`gauss.JointSpring`."""
        return self.add(JointSpring(name, name_of(joint), **options))

    def elastic_link(self, name: str, driven, driver, ratio: float = 1.0, **options) -> ElasticLink:
        """Put a spring and damper, with or without backlash, between two joints; see :class:`gauss.scene.ElasticLink`."""
        return self.add(ElasticLink(name, name_of(driven), name_of(driver), ratio, **options))

    def start(self, joint, position=None, rate=0.0) -> Start:
        """Set the initial position and rate of a joint; a second call replaces the first.

        Rates of ball and free joints are in the axes of the joint frame on the child, see :meth:`ball`.
        """
        return self.add(Start(name_of(joint), position, rate))

    def state(self, name: str, rate, start: float = 0.0, breaks=()) -> StateLaw:
        """Add a state x of your own with the law ẋ = rate: a controller, a current, a muscle, a bristle.

        Laws read it as ``motion.rate(name)``, and its integral over time as ``motion.coordinate(name)``; a trajectory,
        outputs of the kind "rate" and linear models have it under its name. It is integrated with the motion, by every
        method and on every route. An input that acts on it, ``scene.input("u", {name: factor})``, adds factor · u to ẋ.

        Parameters
        ----------
        name : str
            Name of the state; no joint has it.
        rate : float or callable
            Its time derivative: a constant, law(t) or law(t, motion), as of a drive.
        start : float
            Value at the start.
        breaks : sequence of float
            Times at which the law switches [s], for one that cannot be traced.

        Returns
        -------
        StateLaw
            What was added, the law of a joint of this name: gauss integrates x as the rate of a body with a moment of
            inertia of 1 kg m² beside the mechanism, which acts on nothing. Energies leave it out.

        Examples
        --------
        >>> import gauss
        >>> scene = gauss.load("pendulum")
        >>> scene.state("filtered", lambda t, at: (at.rate("A") - at.rate("filtered")) / 0.1).joint
        'filtered'
        """
        law = StateLaw(f"rate of {values.text(name, 'name of a state')}", name, rate, None, breaks)
        self._require_new(name, "state", self.joints | self.couplings | self._constraints)
        self._require_new(law.name, "state", self.loads | self._constraints | self.inputs)
        body = self.add(Body(f"state {name}", 0.0, (1.0, 1.0, 1.0), inertia_as_given=True))
        self.add(Joint(name, "revolute", GROUND, body.name))
        self.add(Start(name, rate=values.number(start, f"state {name!r}: start", "1")))
        return self.add(law)

    @property
    def states(self) -> dict[str, StateLaw]:
        """States of one's own by name, see :meth:`state`."""
        return {load.joint: load for load in self.loads.values() if isinstance(load, StateLaw)}

    def _place_load(self, load):
        what = f"{values.kind(load)} {load.name!r}"
        self._require_new(load.name, "load", self.loads | self._constraints | self.inputs)
        if isinstance(load, Drive):
            count = self.require_joint(load.joint, what).pair.n_v
            if count == 0:
                raise SceneError(f"{what}: joint {load.joint!r} cannot move; choose another type, or drive another joint.")
            given = len(load.effort) if isinstance(load.effort, tuple) else 1
            if not callable(load.effort) and count != given:
                raise SceneError(f"{what}: joint {load.joint!r} has {count} freedoms; got {given} values of effort.")
        elif isinstance(load, JointSpring):
            self._require_freedoms(load.joint, 1, what)
        elif isinstance(load, ElasticLink):
            for joint in (load.driven, load.driver):
                self._require_coordinate(joint, load.what)
        else:
            for body in (load.body, getattr(load, "other", GROUND)):
                self._require_body(body, what)
        self.loads[load.name] = load

    def _place_start(self, start: Start):
        pair = self.require_joint(start.joint, "start").pair
        for key, count in (("position", pair.n_q), ("rate", pair.n_v)):
            value = getattr(start, key)
            given = len(value) if isinstance(value, tuple) else 1
            if value is not None and given != count and value != 0.0:
                raise SceneError(f"start of joint {start.joint!r}: {key} needs {count} numbers, got {value!r}.")
        warn_of_start(start, self.joints[start.joint])
        self.starts[start.joint] = start


def warn_of_start(start: Start, joint: Joint):
    """Warn of a start beyond the limits of its joint, which is moved to them, and of an angle of more than two turns.

    Warns
    -----
    StartWarning
        With what the number would be in degrees.
    """
    if start.position is None:
        return
    position = np.ravel(start.position)
    what, angles = f"start of joint {joint.name!r}", ANGULAR_COORDINATES.get(joint.kind, ())
    if joint.limits is not None and not joint.limits[0] <= position[0] <= joint.limits[1]:
        low, high = joint.limits
        unit = "rad" if angles else "m"
        hint = f" {_in_radians(position[0])}" if angles and low <= radians(position[0]) <= high else ""
        said = f"{what}: {position[0]:g} {unit} is beyond its limits, {low:g} to {high:g} {unit}, where it starts instead."
        warnings.warn(said + hint, StartWarning, stacklevel=user_level())
        return
    for k in angles:
        if position.size > k and abs(position[k]) > LARGEST_ANGLE:
            said = f"{what}: {position[k]:g} rad are {position[k] / (2 * pi):.3g} turns. {_in_radians(position[k])}"
            warnings.warn(said, StartWarning, stacklevel=user_level())


def _in_radians(degrees: float) -> str:
    return f"If degrees were meant: np.deg2rad({degrees:g}) = {radians(degrees):.6g}."
