"""Scenes of SDFormat files, with loops: any joint may close one.

The wheels of Pinocchio are built without SDFormat's library, which no package index has for Python, so the model is read
here. What moves it and has no counterpart is refused by name, file and line; what does not is named in a warning.
"""

import warnings
from math import inf, pi
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

from gauss.errors import FileError, NotImportedWarning, SceneError, did_you_mean
from gauss.io.guard import Source, read_xml
from gauss.io.numbers import add_stop, bounds, number
from gauss.io.sdf.poses import MODEL, Poses, numbers, pose, text
from gauss.scene import GROUND, Scene
from gauss.system.frames import IDENTITY, Pose, compose, invert

WORLD = "world"  # SDFormat's name of the ground
GRAVITY = (0.0, 0.0, -9.8)  # of a world that says nothing [m/s²]
UNBOUNDED = ("lower", "upper", "effort", "velocity")  # limits, where files hold the largest double for none
INFINITE = ("inf", "infinity")
SEVERAL = ("link", "joint", "frame")  # what is read and may stand in its parent more than once
KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "ball", "fixed": "fixed"}
KINDS |= {"universal": "universal", "revolute2": "universal", "screw": "screw"}
SCALAR = ("revolute", "prismatic", "screw")
ROOTS, LIMITS = ("fixed", "free"), ("start", "stops")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
# Children that are read, and those that do not move anything; of the latter some are worth a warning.
READ = {
    "model": {"pose", "link", "joint", "frame", "static"},
    "link": {"pose", "inertial", "gravity", "kinematic"},
    "inertial": {"pose", "mass", "inertia"},
    "joint": {"pose", "parent", "child", "axis", "axis2", "screw_thread_pitch"},
    "axis": {"xyz", "limit", "dynamics", "use_parent_model_frame", "mimic"},
    "limit": {"lower", "upper", "effort", "velocity", "stiffness", "dissipation"},
    "dynamics": {"damping", "friction", "spring_reference", "spring_stiffness"},
    "mimic": {"multiplier", "offset", "reference"},
}
READ["axis2"] = READ["axis"]
STILL = {"visual", "sensor", "light", "self_collide", "enable_wind", "must_be_base_link", "allow_auto_disable", "density"}
STILL |= {"audio_sink", "audio_source", "projector", "particle_emitter", "material", "gripper", "initial_position"}
WARNED = {"collision": "collisions", "plugin": "plugins", "physics": "settings of a solver"}
WARNED |= {"ball": "damping and friction of ball joints, which have no axis"}


def read_sdf(path, root: str | None = None, limits: str = "start") -> Scene:
    """Scene of an SDFormat file of one model.

    Links are bodies, frames are named frames. A model that no joint binds to the world is free, as SDFormat has it.

    Parameters
    ----------
    path : str or Path
        The file.
    root : str, optional
        "fixed": the first link is welded to the ground; "free": it floats. As the file says when not given.
    limits : str
        "start": limits of joints are kept where a start is assembled; "stops": joints run against them, too.

    Raises
    ------
    FileError
        If it is no SDFormat, or holds what moves the model and is not modelled; the message tells the line.

    Warns
    -----
    NotImportedWarning
        Of collisions, plugins and settings of solvers, which are not read.
    """
    if root not in (None, *ROOTS):
        raise FileError(f"{path}: root must be one of {', '.join(ROOTS)}, got {root!r}.")
    if limits not in LIMITS:
        raise FileError(f"{path}: limits: expected {' or '.join(map(repr, LIMITS))}. {did_you_mean(str(limits), LIMITS)}")
    source = read_xml(path, ("sdf",), limits=UNBOUNDED)
    reader = _SdfReader(source, *_model(source))
    try:
        scene = reader.scene(root)
        if limits == "stops":
            for joint in [joint for joint in scene.joints.values() if joint.limits]:
                add_stop(scene, joint.name)
    except SceneError as error:
        raise FileError(f"{path}: {error}") from error
    left = [what for tag, what in WARNED.items() if tag in reader.left]
    if left:
        warnings.warn(f"{path}: not read: {', '.join(left)}.", NotImportedWarning, stacklevel=3)
    return scene


def _model(source: Source) -> tuple[Element, tuple]:
    """The only model of a file, and gravity."""
    for tag in ("include", "actor", "population", "state"):
        for element in source.root.iter(tag):
            raise FileError(f"{source.place(element)}: <{tag}> is not read; put the model itself into the file.")
    worlds, models = source.root.findall("world"), list(source.root.iter("model"))
    if len(models) != 1:
        place = source.place(models[1] if len(models) > 1 else None)
        raise FileError(f"{place}: a file of one model is read, this has {len(models)}, nested ones counted.")
    if any(source.root.iterfind("world/joint")):
        raise FileError(f"{source.place(source.root.find('world/joint'))}: joints belong into the model; move it there.")
    gravity = Scene().gravity
    if worlds:
        given = worlds[0].find("gravity")
        gravity = GRAVITY if given is None else tuple(numbers(source, given, 3))
    return models[0], gravity


class _SdfReader:
    """One model while it becomes a scene."""

    def __init__(self, source: Source, model: Element, gravity: tuple):
        self.source, self.model, self.poses = source, model, Poses(source, model)
        self.left: set[str] = set()
        self.result = Scene(model.get("name") or Path(source.path).stem, gravity=gravity)
        self.placed: Pose = IDENTITY

    def scene(self, root: str | None) -> Scene:
        self._check(self.model)
        if text(self.model, "static") in ("true", "1"):
            raise FileError(f"{self.source.place(self.model)}: the model is static; nothing moves.")
        if not any(element.tag == "link" for element in self.model):
            raise FileError(f"{self.source.place(self.model)}: the model has no links.")
        self.placed = pose(self.source, self.model.find("pose"))
        marked = self.model.get("placement_frame")
        if marked:
            self.placed = compose(self.placed, invert(self.poses.of(marked, self.model)))
        for element in self.model.findall("link"):
            self._link(element)
        for element in self.model.findall("frame"):
            name = element.get("name", "")
            carrier = self.poses.link(name, element)
            R, p = compose(invert(self.poses.of(carrier)), self.poses.of(name))
            self.result.frame(name, self._body(carrier), p, R)
        for element in self.model.findall("joint"):
            self._joint(element)
        for element in self.model.findall("joint"):
            self._mimic(element)
        self._bind(root)
        return self.result

    def _refuse(self, element: Element | None, why: str) -> NoReturn:
        raise FileError(f"{self.source.place(element)}: {why}")

    def _check(self, element: Element):
        """Refuse children that are neither read nor known not to move anything, and what is said twice."""
        for child in element:
            if child.tag in READ[element.tag] and child.tag not in SEVERAL and child is not element.find(child.tag):
                self._refuse(child, f"<{child.tag}> stands twice in {element.tag} {element.get('name', '')!r}; keep one.")
            if child.tag in WARNED:
                self.left.add(child.tag)
            elif child.tag not in READ[element.tag] | STILL and ":" not in child.tag:
                what = f"<{child.tag}> of {element.tag} {element.get('name', '')!r}"
                self._refuse(child, f"{what} is not modelled; remove it.")
            elif child.tag in READ:
                self._check(child)

    def _value(self, element: Element | None, tag: str, default: float = 0.0) -> float:
        found = None if element is None else element.find(tag)
        return default if found is None else numbers(self.source, found, 1)[0]

    @staticmethod
    def _body(link: str) -> str:
        """Name of a link's body; one that is called like the world itself gets another."""
        return f"{GROUND} link" if link == GROUND else link

    def _link(self, element: Element):
        for tag, still in (("gravity", ("true", "1", "")), ("kinematic", ("false", "0", ""))):
            if text(element, tag) not in still:
                self._refuse(element.find(tag), f"<{tag}> of link {element.get('name')!r} is not modelled; remove it.")
        inertial = element.find("inertial")
        if inertial is not None and inertial.get("auto") in ("true", "1"):
            self._refuse(inertial, "inertia from collisions is not computed; give mass and inertia.")
        R_com, com = pose(self.source, None if inertial is None else inertial.find("pose"))
        moments = None if inertial is None else inertial.find("inertia")
        inertia = [self._value(moments, tag, float(tag in MOMENTS[:3])) for tag in MOMENTS]  # of 1 where nothing is said
        name = element.get("name", "")
        R, p = compose(self.placed, self.poses.of(name))
        mass = self._value(inertial, "mass", 1.0)
        self.result.body(self._body(name), mass, tuple(inertia), com, inertia_axes=R_com, position=p, rotation=R)

    def _joint(self, element: Element):
        name, kind = element.get("name", ""), element.get("type", "")
        if kind not in KINDS:
            self._refuse(element, f"joint {name!r}: a joint of type {kind!r} is not modelled.")
        parent, child = (self._end(element, end) for end in ("parent", "child"))
        options = self._axes(element, name, kind)
        axis = element.find("axis")
        limits = self._limits(element, axis) if KINDS[kind] in SCALAR and kind != "continuous" else None
        self.result.joint(name, KINDS[kind], parent, child, **options, **({"limits": limits} if limits else {}))
        for given in (axis, element.find("axis2")):
            if given is not None:
                self._dynamics(given.find("dynamics"), name, kind)

    def _axes(self, element: Element, name: str, kind: str) -> dict:
        """Point, axes and pitch of a joint."""
        R, at = compose(self.placed, self.poses.of(name, element))
        options: dict = {"at": tuple(at)}
        if kind == "fixed" or kind == "ball":
            options |= {"rotation": R}
        else:
            options |= {"axis": self._axis(element, "axis")}
        if KINDS[kind] == "universal":
            options |= {"second_axis": self._axis(element, "axis2")}
        if kind == "screw":
            pitch = element.find("screw_thread_pitch")
            if pitch is None:
                self._refuse(element, f"joint {name!r}: give <screw_thread_pitch>, the advance for each turn [m].")
            options |= {"pitch": numbers(self.source, pitch, 1)[0] / (2 * pi)}
        return options

    def _dynamics(self, dynamics: Element | None, name: str, kind: str):
        """Damping, friction and spring along an axis."""
        resisting = {tag: self._value(dynamics, tag) for tag in ("damping", "friction", "spring_stiffness")}
        if not any(resisting.values()):
            return
        if kind == "ball":
            self.left.add(kind)
        elif KINDS[kind] not in SCALAR:
            what = ", ".join(tag for tag, value in resisting.items() if value)
            self._refuse(dynamics, f"joint {name!r}: {what} of a {kind} joint is not modelled; remove it.")
        else:
            self._resist(name, dynamics, **resisting)

    def _end(self, element: Element, end: str) -> str:
        named = text(element, end)
        if not named:
            self._refuse(element, f"joint {element.get('name')!r}: <{end}> is missing.")
        return GROUND if named == WORLD else self._body(self.poses.link(named, element))

    def _axis(self, element: Element, tag: str) -> tuple:
        """Axis of a joint in the world."""
        axis, name = element.find(tag), element.get("name", "")
        if axis is None:
            self._refuse(element, f"joint {name!r}: <{tag}> is missing.")
        xyz = axis.find("xyz")
        direction = [0.0, 0.0, 1.0] if xyz is None else numbers(self.source, xyz, 3)
        named = name if xyz is None else xyz.get("expressed_in") or name
        if text(axis, "use_parent_model_frame") in ("true", "1"):
            named = MODEL
        return tuple(compose(self.placed, self.poses.of(named, axis))[0] @ direction)

    def _limits(self, element: Element, axis: Element | None) -> tuple[float, float] | None:
        given = None if axis is None else axis.find("limit")
        low, high = self._limit(given, "lower", -inf), self._limit(given, "upper", inf)
        if low >= high:
            self._refuse(given, f"joint {element.get('name')!r}: its limits leave no motion; make it a fixed joint.")
        return bounds(low, high)

    def _limit(self, limit: Element | None, tag: str, default: float) -> float:
        found = "" if limit is None else text(limit, tag).lower()
        if found.lstrip("+-") in INFINITE or abs(number(found) or 0.0) == inf:
            return -inf if found[0] == "-" else inf
        return self._value(limit, tag, default)

    def _resist(self, joint: str, dynamics: Element | None, damping: float, friction: float, spring_stiffness: float):
        if damping or spring_stiffness:
            rest = self._value(dynamics, "spring_reference")
            self.result.joint_spring(f"spring of {joint}", joint, stiffness=spring_stiffness, damping=damping, rest=rest)
        if friction:
            self.result.joint_friction(joint, friction)

    def _mimic(self, element: Element):
        for mimic in element.iterfind("axis/mimic"):
            name, driver = element.get("name"), mimic.get("joint", "")
            self.poses.element(driver, mimic)
            if mimic.get("axis", "axis") != "axis":
                self._refuse(mimic, f"joint {name!r}: only the first axis of a joint is mimicked.")
            ratio = self._value(mimic, "multiplier", 1.0)
            offset = self._value(mimic, "offset") - ratio * self._value(mimic, "reference")
            self.result.couple(f"{name} mimics {driver}", name, driver, ratio, offset)

    def _bind(self, root: str | None):
        """Weld the first link to the ground, or let float what no joint binds to it."""
        scene, first = self.result, next(iter(self.result.bodies))
        if root is not None:
            getattr(scene, root)(f"{first} is {root}", GROUND, first, at=scene.bodies[first].position)
        bound = {GROUND}
        for body in scene.bodies:
            _spread(scene, bound)
            if body not in bound:
                scene.free(f"{body} is free", GROUND, body, at=scene.bodies[body].position)
                bound.add(body)


def _spread(scene: Scene, bound: set[str]):
    """Add all that joints bind to what is in a set."""
    before = 0
    while len(bound) > before:
        before = len(bound)
        for joint in scene.joints.values():
            if joint.parent in bound or joint.child in bound:
                bound |= {joint.parent, joint.child}
