"""The scene: elements of a mechanism by name, collected by builder methods; every reference is checked as it is added."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from gauss.arguments import named_arguments, named_methods
from gauss.errors import SceneError, did_you_mean
from gauss.scene import builder, contact_builder, inputs, values
from gauss.scene.body import Body, Frame
from gauss.scene.builder import ConstraintBuilder, Element, name_of
from gauss.scene.collision import Collider
from gauss.scene.contact_builder import ContactBuilder
from gauss.scene.degrees import warn_of_start
from gauss.scene.elastic import ElasticLink
from gauss.scene.inputs import SENSORS, Input, InputBuilder, Output
from gauss.scene.joint import Coupling, Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start, StateLaw
from gauss.scene.motions import Prescribed
from gauss.scene.relation import Relation
from gauss.scene.set_valued import LimitedDrive, SetValued
from gauss.scene.unilateral import Unilateral
from gauss.versions import FormerAttribute

if TYPE_CHECKING:
    from gauss.scene.clutches import JointLink
    from gauss.scene.losses import LossyGear

GROUND = "ground"
LOADS = (Drive, ElasticLink, Force, JointSpring, Spring)


@dataclass(frozen=True)
class Scene(ConstraintBuilder, ContactBuilder, InputBuilder):
    """Mechanism and its surroundings.

    Parameters
    ----------
    name : str
        Name of the scene.
    gravity : array_like, shape (3,)
        Acceleration of gravity in world axes [m/s²].
    source : str
        File that it was read from, as :func:`gauss.load` was given it, where that file gives meshes, too; empty if none.

    Attributes
    ----------
    bodies, frames, joints, couplings, relations, shapes, contacts, set_valued, loads, starts, inputs, outputs : dict
        Elements by name; the methods fill them.

    Examples
    --------
    >>> import gauss
    >>> scene = gauss.Scene("pendulum", gravity=(0, -9.81, 0))
    >>> bob = scene.body("bob", mass=1.0, inertia=(0, 0, 0.01), com=(0.5, 0, 0))
    >>> scene.revolute("A", "ground", bob, at=(0, 0, 0), axis=(0, 0, 1)).kind
    'revolute'
    """

    name: str = "scene"
    gravity: tuple = (0.0, 0.0, -9.81)
    bodies: dict[str, Body] = field(default_factory=dict)
    frames: dict[str, Frame] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    couplings: dict[str, Coupling] = field(default_factory=dict)
    relations: dict[str, Relation] = field(default_factory=dict)
    shapes: dict[str, Collider] = field(default_factory=dict)
    contacts: dict[str, Unilateral] = field(default_factory=dict)
    set_valued: dict[str, SetValued] = field(default_factory=dict)
    loads: dict[str, Drive | ElasticLink | Force | JointSpring | Spring] = field(default_factory=dict)
    starts: dict[str, Start] = field(default_factory=dict)
    inputs: dict[str, Input] = field(default_factory=dict)
    outputs: dict[str, Output] = field(default_factory=dict)
    source: str = field(default="", compare=False, repr=False)

    def __post_init__(self):
        """Check the name and gravity."""
        values.text(self.name, "name of the scene")
        values.keep(self, gravity=values.vector(self.gravity, "gravity", "m/s²"))

    # Every element enters through `add`, so that a scene is consistent in its names at any time.

    def add(self, element: Element) -> Element:
        """Add a Body, Frame, Joint, Coupling, Relation, Collider, load, Start, Input or Output and return it.

        Raises
        ------
        SceneError
            If its name is taken, or a name that it refers to does not exist.
        """
        checks: dict[type, Callable] = {Body: self._place_body, Frame: self._place_frame, Joint: self._place_joint}
        checks |= {Coupling: self._place_coupling, Start: self._place_start}
        checks |= {Input: self._place_input, Output: self._place_output}
        if isinstance(element, Relation):
            self._place_relation(element)
        elif isinstance(element, Collider):
            self._place_shape(element)
        elif isinstance(element, LOADS):
            self._place_load(element)
        elif type(element) in checks:
            checks[type(element)](element)
        else:
            raise SceneError(
                "expected a Body, Frame, Joint, Coupling, Relation, Collider, load, Start, Input or Output, "
                f"got {element!r}."
            )
        return element

    def body(self, name: str, mass: float, inertia=(0.0, 0.0, 0.0), com=(0.0, 0.0, 0.0), **options) -> Body:
        """Add a rigid body; see :class:`gauss.Body` for the arguments."""
        return self.add(Body(name, mass, inertia, com, **options))

    def frame(self, name: str, body, position=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)) -> Frame:
        """Name a frame fixed to a body; see :class:`gauss.Frame`."""
        return self.add(Frame(name, name_of(body), position, rotation))

    def joint(self, name: str, kind: str, parent, child, **options) -> Joint:
        """Add a joint of any kind; see :class:`gauss.Joint` for the arguments."""
        return self.add(Joint(name, kind, name_of(parent), name_of(child), **options))

    def revolute(self, name: str, parent, child, at=(0, 0, 0), axis=(0, 0, 1), **options) -> Joint:
        """Add a hinge about an axis."""
        return self.joint(name, "revolute", parent, child, at=at, axis=axis, **options)

    def prismatic(self, name: str, parent, child, at=(0, 0, 0), axis=(1, 0, 0), **options) -> Joint:
        """Add a slider along an axis."""
        return self.joint(name, "prismatic", parent, child, at=at, axis=axis, **options)

    def fixed(self, name: str, parent, child, at=(0, 0, 0), **options) -> Joint:
        """Weld two bodies together."""
        return self.joint(name, "fixed", parent, child, at=at, **options)

    def free(self, name: str, parent, child, at=(0, 0, 0), **options) -> Joint:
        """Let a body move freely: coordinates are translations along the joint axes on the parent and a quaternion.

        The last three rates are ω in the axes of the joint frame on the child, as of :meth:`ball`.
        """
        return self.joint(name, "free", parent, child, at=at, **options)

    def cylindrical(self, name: str, parent, child, at=(0, 0, 0), axis=(0, 0, 1), **options) -> Joint:
        """Add a joint that turns about and slides along an axis."""
        return self.joint(name, "cylindrical", parent, child, at=at, axis=axis, **options)

    def universal(self, name: str, parent, child, at=(0, 0, 0), axis=(0, 0, 1), **options) -> Joint:
        """Add a Cardan joint: ``axis`` fixed in the parent, ``second_axis`` in the child."""
        return self.joint(name, "universal", parent, child, at=at, axis=axis, **options)

    def ball(self, name: str, parent, child, at=(0, 0, 0), **options) -> Joint:
        """Add a spherical joint: a quaternion is its coordinate, ω in the axes of the joint frame on the child its rates.

        At the reference configuration these are the axes of the world, or what ``rotation`` of the joint makes of them: not
        those of the body's own frame.
        """
        return self.joint(name, "ball", parent, child, at=at, **options)

    def planar(self, name: str, parent, child, at=(0, 0, 0), axis=(0, 0, 1), **options) -> Joint:
        """Add a joint that slides in the plane normal to ``axis`` and turns about it."""
        return self.joint(name, "planar", parent, child, at=at, axis=axis, **options)

    def screw(self, name: str, parent, child, pitch: float, at=(0, 0, 0), axis=(0, 0, 1), **options) -> Joint:
        """Add a screw of the given pitch [m/rad]."""
        return self.joint(name, "screw", parent, child, pitch=pitch, at=at, axis=axis, **options)

    def couple(self, name: str, driven, driver, ratio: float, offset: float = 0.0) -> Coupling:
        """Couple two joint coordinates: q_driven = ratio · q_driver + offset."""
        return self.add(Coupling(name, name_of(driven), name_of(driver), ratio, offset))

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
        body = self.body(f"state {name}", 0.0, (1.0, 1.0, 1.0), inertia_as_given=True)
        self.revolute(name, GROUND, body)
        self.start(name, rate=values.number(start, f"state {name!r}: start", "1"))
        return self.add(law)

    @property
    def states(self) -> dict[str, StateLaw]:
        """States of one's own by name, see :meth:`state`."""
        return {load.joint: load for load in self.loads.values() if isinstance(load, StateLaw)}

    def start(self, joint, position=None, rate=0.0) -> Start:
        """Say where a joint starts and how fast; saying it again replaces it.

        Rates of ball and free joints are in the axes of the joint frame on the child, see :meth:`ball`.
        """
        return self.add(Start(name_of(joint), position, rate))

    # References that each kind of element makes to the scene.

    def _place_body(self, body: Body):
        if body.name == GROUND:
            raise SceneError("'ground' is the world itself; choose another name for the body.")
        self._require_new(body.name, "body", self.bodies | self.frames)
        self._require_body(body.on, f"body {body.name!r}: on")
        self.bodies[body.name] = body

    def _place_frame(self, frame: Frame):
        self._require_new(frame.name, "frame", self.bodies | self.frames | {GROUND: None})
        self._require_body(frame.body, f"frame {frame.name!r}: body")
        self.frames[frame.name] = frame

    def _place_joint(self, joint: Joint):
        what = f"joint {joint.name!r}"
        self._require_new(joint.name, "joint", self.joints | self.couplings | self._constraints)
        self._require_body(joint.parent, f"{what}: parent")
        self._require_body(joint.child, f"{what}: child")
        if joint.child_frame is not None:
            self._require_carried(joint.frame, joint.parent, f"{what}: frame")
            self._require_carried(joint.child_frame, joint.child, f"{what}: child_frame")
        elif joint.frame != "world":
            self._require_body(joint.frame, f"{what}: frame")
        self.joints[joint.name] = joint

    def _place_coupling(self, coupling: Coupling):
        self._require_new(coupling.name, "coupling", self.joints | self.couplings | self._constraints)
        for joint in (coupling.driven, coupling.driver):
            self._require_freedoms(joint, 1, f"coupling {coupling.name!r}")
        self.couplings[coupling.name] = coupling

    def _place_relation(self, relation: Relation):
        self._require_new(relation.name, "constraint", self.joints | self.couplings | self._constraints | self.loads)
        for field_name in relation.frames:
            self._require_place(getattr(relation, field_name), f"{relation.what}: {field_name}")
        for field_name in relation.joints:
            named = getattr(relation, field_name)
            for name in (named,) if isinstance(named, str) else named:
                self._require_coordinate(name, f"{relation.what}: {field_name}")
        for field_name in relation.shapes:
            self._require_shape(getattr(relation, field_name), f"{relation.what}: {field_name}")
        if isinstance(relation, Unilateral):
            relation.sides(self)  # refuses shapes that have no contact
            self.contacts[relation.name] = relation
        elif isinstance(relation, SetValued):
            self.set_valued[relation.name] = relation
        else:
            self.relations[relation.name] = relation

    def _place_shape(self, shape: Collider):
        self._require_new(shape.name, "shape", self.shapes)
        self._require_place(shape.body, f"{shape.what}: body")
        self.shapes[shape.name] = shape

    @property
    def losses(self) -> "dict[str, LossyGear | JointLink]":
        """Non-ideal links that lose power: gears, then set-valued elements."""
        links = {name: link for name, link in (self.relations | self.set_valued).items() if link.loses}
        return cast("dict[str, LossyGear | JointLink]", links)  # no other kinds are non-ideal

    @property
    def backlashes(self) -> dict[str, ElasticLink]:
        """Elastic links with backlash."""
        return {name: load for name, load in self.loads.items() if isinstance(load, ElasticLink) and load.backlash}

    @property
    def nonsmooth(self) -> dict[str, object]:
        """Unilateral and set-valued elements, losses and backlash: with these a motion has events between smooth phases."""
        return {**self.contacts, **self.set_valued, **self.losses, **self.backlashes}

    grips = FormerAttribute("set_valued")
    plays = FormerAttribute("backlashes")
    changing = FormerAttribute("nonsmooth")

    @property
    def _constraints(self) -> dict[str, Relation]:
        return self.relations | self.contacts | self.set_valued

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
        else:
            self._require_place(output.of, what)
        self.outputs[output.name] = output

    def require_joint(self, name: str, what: str) -> Joint:
        """Return the joint of this name, or raise a SceneError that tells which joints exist."""
        if name not in self.joints:
            raise SceneError(f"{what}: no joint {name!r}. {did_you_mean(name, self.joints)}")
        return self.joints[name]

    def _require_freedoms(self, joint: str, count: int, what: str):
        freedoms = self.require_joint(joint, what).pair.n_v
        if freedoms != count:
            raise SceneError(f"{what}: joint {joint!r} has {freedoms} freedoms; a joint of {count} is needed.")

    def _require_coordinate(self, name: str, what: str):
        """Refuse a name of neither a joint of one freedom nor one rate of a joint."""
        owner, _, rate = name.rpartition(".")
        if name not in self.joints and owner in self.joints and rate in self.joints[owner].pair.rates:
            return
        freedoms = self.require_joint(name, what).pair.n_v
        if freedoms == 0:
            raise SceneError(f"{what}: joint {name!r} cannot move; choose another type, or another joint.")
        if freedoms != 1:
            rates = ", ".join(f"{name}.{rate}" for rate in self.joints[name].pair.rates) or "none"
            raise SceneError(f"{what}: joint {name!r} has {freedoms} freedoms; name one of them: {rates}.")

    def _require_place(self, name: str, what: str):
        if name != GROUND and name not in self.bodies and name not in self.frames:
            raise SceneError(
                f"{what}: no body or frame {name!r}. {did_you_mean(name, [*self.bodies, *self.frames, GROUND])}"
            )

    def _require_shape(self, name: str, what: str):
        if name not in self.shapes:
            raise SceneError(f"{what}: no shape {name!r}. {did_you_mean(name, self.shapes)}")

    def _require_carried(self, name: str, body: str, what: str):
        """Refuse a frame that another body carries."""
        self._require_place(name, what)
        carrier = self.frames[name].body if name in self.frames else name
        if carrier != body:
            raise SceneError(f"{what}: {name!r} is on {carrier!r}, not on {body!r}.")

    def _require_body(self, name: str, what: str):
        if name != GROUND and name not in self.bodies:
            raise SceneError(f"{what}: no body {name!r}. {did_you_mean(name, [*self.bodies, GROUND])}")

    def _require_new(self, name: str, kind: str, taken):
        if name in taken:
            raise SceneError(f"{kind} {name!r}: the name is taken; choose another.")

    def _taken(self) -> set[str]:
        return {*self.joints, *self.couplings, *self._constraints, *self.loads}

    def _fresh(self, name: str) -> str:
        taken = [*self.loads, *self._constraints]
        count = sum(1 for load in taken if load == name or load.startswith(f"{name} "))
        return name if not count else f"{name} {count + 1}"


_MODULES = builder, contact_builder, inputs
_HERE = (*(value for module in _MODULES for value in vars(module).values()), *list(globals().values()))
_KINDS = {kind for kind in _HERE if isinstance(kind, type) and kind.__module__.startswith("gauss.scene.")}
for _kind in _KINDS:
    named_arguments(_kind)
for _builder in (Scene, ConstraintBuilder, ContactBuilder, InputBuilder):
    named_methods(_builder)
