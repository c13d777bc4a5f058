"""Scenes of SDFormat files: worlds of several models, nested and included ones, with loops: any joint may close one.

The wheels of Pinocchio are built without SDFormat's library, which no package index has for Python, so the file is read
here. What moves a model and has no counterpart is refused by name, file and line; what does not is named in a warning.
"""

import warnings
from pathlib import Path
from xml.etree.ElementTree import Element

from gauss.errors import FileError, NotImportedWarning, SceneError
from gauss.io.guard import Source, checked_root, read_xml
from gauss.io.numbers import LIMITS, add_stop, check_option
from gauss.io.sdf.collisions import shape_of
from gauss.io.sdf.elements import WARNED, check, check_link, numbers, pose, text
from gauss.io.sdf.includes import UNBOUNDED, Includes
from gauss.io.sdf.inertia import of_link
from gauss.io.sdf.joints import JointReader
from gauss.io.sdf.scopes import Scope
from gauss.scene import GROUND, Scene
from gauss.system.frames import compose, invert

GRAVITY = (0.0, 0.0, -9.8)  # [m/s²] of a world without one
ROOTS, MISSING = ("fixed", "free"), ("refused", "left out")
NOT_READ = {"population": "put its models into the file", "state": "put its poses into the models"}


def read_sdf(
    path,
    root: str | None = None,
    limits: str = "start",
    root_folder=None,
    missing: str = "refused",
    collisions: bool = False,
) -> Scene:
    """Scene of an SDFormat file: of a model, or of all models of a world.

    Links are bodies, frames are named frames; in a world of several models, and of nested models, they and joints are
    called "model::name". A model that no joint binds to the world is free, as SDFormat has it. Static models are a part of
    the ground, their links named frames of it.

    FileError if it is no SDFormat, or holds what moves the model and is not modelled; the message tells the line.

    Parameters
    ----------
    root : str, optional
        "fixed": the first link is welded to the ground; "free": it floats. As the file says when not given.
    limits : str
        "start": limits of joints are kept where a start is assembled; "stops": joints run against them, too.
    root_folder : str or Path, optional
        Folder below which included models are looked for, beside that of the file.
    missing : str
        "refused": every included model must be found; "left out": those that are not, as of models on a server, are named
        in a warning.
    collisions : bool
        Whether collisions become shapes, called "link.collision": boxes, spheres, capsules, cylinders, cones, ellipsoids,
        planes and hulls of meshes; contacts are added with ``scene.contacts_all`` or ``scene.contact``.

    Warns
    -----
    NotImportedWarning
        Of plugins, actors and settings of solvers, which are not read, and of collisions without counterpart or that are not
        asked for.
    """
    if root not in (None, *ROOTS):
        raise FileError(f"{path}: root must be one of {', '.join(ROOTS)}, got {root!r}.")
    check_option(path, "limits", limits, LIMITS)
    check_option(path, "missing", missing, MISSING)
    folder = checked_root(path, root_folder)
    source = read_xml(path, ("sdf",), limits=UNBOUNDED, loose_comments=True)
    includes = Includes(source, folder, missing == "left out")
    includes.expand(source.root, source.path)
    reader = _SdfReader(source, collisions)
    try:
        scene = reader.scene(root, limits == "stops")
    except SceneError as error:
        raise FileError(f"{path}: {error}") from error
    gone = ", ".join(dict.fromkeys(includes.missing))
    left = [f"included models that are not there: {gone}"] if gone else []
    left += [what for tag, what in WARNED.items() if tag in reader.left - ({"collision"} if collisions else set())]
    left += [f"collisions without counterpart: {', '.join(reader.unlike)}"] if reader.unlike else []
    if left:
        warnings.warn(f"{path}: not read: {', '.join(left)}.", NotImportedWarning, stacklevel=3)
    return scene


def _world(source: Source) -> Element:
    """World of a file; the outermost element of one that holds models alone."""
    for tag, remedy in NOT_READ.items():
        for element in source.root.iter(tag):
            raise FileError(f"{source.place(element)}: <{tag}> is not read; {remedy}.")
    worlds = source.root.findall("world")
    if len(worlds) > 1:
        raise FileError(f"{source.place(worlds[1])}: a file of one world is read, this has {len(worlds)}.")
    return worlds[0] if worlds else source.root


def _gravity(source: Source, world: Element) -> tuple[float, ...]:
    """Gravity of a world; until version 1.5 of the format it stands in <physics>."""
    if world.tag != "world":
        return Scene().gravity
    found = [given for given in (world.find("gravity"), world.find("physics/gravity")) if given is not None]
    return tuple(numbers(source, found[0], 3)) if found else GRAVITY


class _SdfReader:
    """One file while it becomes a scene."""

    def __init__(self, source: Source, collisions: bool = False):
        self.source, self.left, self.collisions, self.unlike = source, set[str](), collisions, list[str]()
        world = _world(source)
        self.world = Scope(source, world)
        if not self.world.models:
            raise FileError(f"{source.place(world)}: there is no model in it.")
        name = next(iter(self.world.models)) if len(self.world.models) == 1 else self.world.name
        self.result = Scene(name or Path(source.path).stem, gravity=_gravity(source, world))
        if world.tag == "world":
            check(source, world, self.left)
        for element in [] if world.tag == "world" else world.findall("model"):
            check(source, element, self.left)

    def scene(self, root: str | None, stops: bool) -> Scene:
        """Scene of the file."""
        scopes = list(self.world.all())
        carriers = [scope.canonical for scope in scopes[1:] if not scope.is_static]
        if not carriers:
            which = "the model is static" if len(scopes) == 2 else "all models are static"
            raise FileError(f"{self.source.place(scopes[1].root)}: {which}; nothing moves.")
        for tag, read in (("link", self._link), ("frame", self._frame), ("joint", self._joint), ("joint", self._mimic)):
            for scope in scopes:
                for element in scope.root.findall(tag):
                    read(scope, element)
        self._bind(root)
        for joint in [joint.name for joint in self.result.joints.values() if joint.limits and stops]:
            add_stop(self.result, joint)
        return self.result

    def _body(self, scope: Scope, path: str | None) -> str:
        """Name of the body of a link; static ones are the ground. One that is called like the ground gets another name."""
        if path is None:
            return GROUND
        owner, link = scope.owner(path)
        name = f"{owner.prefix}{link}"
        return GROUND if owner.is_static else f"{GROUND} link" if name == GROUND else name

    def _link(self, scope: Scope, element: Element):
        check_link(self.source, element)
        name = element.get("name", "")
        R, p = compose(scope.pose, scope.of(name))
        if scope.is_static:
            self.result.frame(f"{scope.prefix}{name}", GROUND, p, R)
            self._shapes(scope, element, f"{scope.prefix}{name}")
            return
        found = of_link(self.source, element, lambda collision: self._in_link(scope, name, collision))
        body = self._body(scope, name)
        self.result.body(body, found.mass, found.inertia, found.com, inertia_axes=found.R_com, position=p, rotation=R)
        if text(element, "gravity") not in ("true", "1", ""):
            weight = tuple(-found.mass * float(g) for g in self.result.gravity)
            self.result.force(f"no gravity on {body}", body, weight)
        self._shapes(scope, element, body)

    def _shapes(self, scope: Scope, link: Element, carrier: str):
        """Shapes of a link, where collisions are asked for."""
        for collision in link.findall("collision") if self.collisions else []:
            name = f"{scope.prefix}{link.get('name', '')}.{collision.get('name', '')}"
            made = shape_of(self.source, collision, name, carrier, self._in_link(scope, link.get("name", ""), collision))
            if made is None:
                self.unlike.append(name)
            else:
                self.result.add(made)

    def _in_link(self, scope: Scope, link: str, element: Element):
        """Pose of a part of a link in it."""
        placed = element.find("pose")
        found = pose(self.source, placed)
        named = "" if placed is None else placed.get("relative_to") or placed.get("frame") or ""
        if not named or named == link:
            return found
        return compose(invert(scope.of(link)), compose(scope.of(named, element), found))

    def _frame(self, scope: Scope, element: Element):
        name = element.get("name", "")
        carrier = scope.link(name, element)
        called = f"{scope.prefix}{name}"
        body = self._body(scope, carrier)
        if carrier is None or body == GROUND:
            R, p = compose(scope.pose, scope.of(name))
        else:
            R, p = compose(invert(scope.of(carrier)), scope.of(name))
        self.result.frame(called, body, p, R)

    def _joint(self, scope: Scope, element: Element):
        parent, child = (self._end(scope, element, end) for end in ("parent", "child"))
        if scope.is_static or parent == child == GROUND:
            return
        JointReader(self.source, scope, self.result, self.left).add(element, parent, child)

    def _mimic(self, scope: Scope, element: Element):
        if f"{scope.prefix}{element.get('name', '')}" in self.result.joints:
            JointReader(self.source, scope, self.result, self.left).mimic(element)

    def _end(self, scope: Scope, element: Element, end: str) -> str:
        """Body of an end of a joint."""
        named = text(element, end)
        if not named:
            raise FileError(f"{self.source.place(element)}: joint {element.get('name')!r}: <{end}> is missing.")
        return self._body(scope, scope.link(named, element))

    def _bind(self, root: str | None):
        """Weld the first link to the ground, or let float what no joint binds to it."""
        scene, first = self.result, next(iter(self.result.bodies))
        if root is not None:
            moving = [name for name, model in self.world.models.items() if not model.is_static]
            if len(moving) > 1:
                raise FileError(f"{self.source.path}: root: for a file of one model that moves; this has {len(moving)}.")
            getattr(scene, root)(f"{first} is {root}", GROUND, first, at=scene.bodies[first].position)
        bound = {GROUND}
        outward: dict[str, list[str]] = {GROUND: [], **{body: [] for body in scene.bodies}}
        for joint in scene.joints.values():
            outward[joint.parent].append(joint.child)
            outward[joint.child].append(joint.parent)
        _spread(outward, bound, GROUND)
        for body in scene.bodies:
            if body not in bound:
                scene.free(f"{body} is free", GROUND, body, at=scene.bodies[body].position)
                _spread(outward, bound, body)


def _spread(outward: dict[str, list[str]], bound: set[str], body: str):
    """Add a body, and all that joints bind to it, to a set."""
    waiting = [body]
    while waiting:
        one = waiting.pop()
        bound.add(one)
        waiting += [other for other in outward[one] if other not in bound]
