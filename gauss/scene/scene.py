"""The scene: elements of a mechanism by name, collected by builder methods; every reference is checked as it is added."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from gauss.arguments import named_arguments, named_methods
from gauss.errors import SceneError
from gauss.scene import builder, contact_builder, inputs, load_builder, values
from gauss.scene.body import Body, Frame
from gauss.scene.builder import ConstraintBuilder, Element, name_of
from gauss.scene.collision import Collider
from gauss.scene.contact_builder import ContactBuilder
from gauss.scene.elastic import ElasticLink
from gauss.scene.inputs import Input, InputBuilder, Output
from gauss.scene.joint import Coupling, Joint
from gauss.scene.load_builder import LoadBuilder
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start
from gauss.scene.names import GROUND, SceneNames
from gauss.scene.relation import Relation
from gauss.scene.set_valued import SetValued
from gauss.scene.unilateral import Unilateral
from gauss.versions import FormerAttribute

if TYPE_CHECKING:
    from gauss.scene.clutches import JointLink
    from gauss.scene.losses import LossyGear

LOADS = (Drive, ElasticLink, Force, JointSpring, Spring)


@dataclass(frozen=True)
class Scene(ConstraintBuilder, ContactBuilder, LoadBuilder, InputBuilder):
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

        Translations are displacements from the drawn pose, not places in the world: a box that is drawn at z = 0.5 m and has
        fallen to z = 0.1 m has the coordinate −0.4 m. ``trajectory.body(name).position`` and
        ``gauss.Kinematics(system, state).position(name)`` are places in the world.

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


_MODULES = builder, contact_builder, load_builder, inputs
_HERE = (*(value for module in _MODULES for value in vars(module).values()), *list(globals().values()))
_KINDS = {kind for kind in _HERE if isinstance(kind, type) and kind.__module__.startswith("gauss.scene.")}
for _kind in _KINDS:
    named_arguments(_kind)
for _builder in (Scene, SceneNames, ConstraintBuilder, ContactBuilder, LoadBuilder, InputBuilder):
    named_methods(_builder)
