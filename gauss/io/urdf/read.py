"""URDF robots through Pinocchio's parser, with the loops and couplings of URDF+ and of a YAML file beside them.

Links that fixed joints weld together become one body, named after the link that its joint moves; the others stay as named
frames. Limits, damping, friction, collision geometry and transmissions are read where they are asked for
(gauss.io.urdf.extras). Not read: visual geometry, plugin tags.
"""

import warnings
from collections.abc import Collection

import numpy as np

from gauss import rotations
from gauss.errors import FileError, SceneError, UnphysicalInertiaWarning, did_you_mean, extra, listed
from gauss.io.guard import Source
from gauss.io.numbers import UNIT_VECTORS
from gauss.io.urdf.guard import guarded, place_of
from gauss.io.urdf.joint_file import joint_file
from gauss.io.urdf.numbers import for_parser, value, values
from gauss.io.urdf.plus import add_loops_and_couplings
from gauss.io.urdf.unknown import refuse_couplings, require_tree
from gauss.scene import GROUND, Scene
from gauss.scene.body import unphysical

with extra():
    import pinocchio as pin

ROOTS = ("fixed", "free")
INERTIAS = ("physical", "as given")
# Radius of gyration [m] of a point mass: exporters subtract m c² from moments about a joint, which leaves ± 2⁻⁵³ m c² of
# nothing, and nobody measures inertia to less than (10 nm)².
SPECK = 1e-8


def read_urdf(path, root: str = "fixed", mimic: bool = True, inertia: str = "physical") -> Scene:
    """Scene of a URDF file.

    FileError if it cannot be parsed, or holds something that gauss does not model; the message names it.

    Parameters
    ----------
    root : str
        "fixed": the base is part of the ground; "free": it floats on a free joint. A robot whose base weighs nothing and
        carries a joint of type ``floating`` floats already; to let it float twice is refused.
    mimic : bool
        Whether mimic joints follow the joints that they mimic (as couplings), or move by themselves.
    inertia : str
        "physical": inertia without mass, and moments that violate the triangle inequality, are refused; "as given": they
        are taken, with a warning.

    Warns
    -----
    UnphysicalInertiaWarning
        Of inertias that no body can have, and that were taken as given.
    """
    if inertia not in INERTIAS:
        raise FileError(f"{path}: inertia must be one of {', '.join(map(repr, INERTIAS))}, got {inertia!r}.")
    if root not in ROOTS:
        raise FileError(f"{path}: root must be one of {', '.join(ROOTS)}, got {root!r}.")
    source = guarded(path)
    if source.root.find("link") is None:
        raise FileError(f"{path}: there is no <link> in it. Is it what a .xacro includes? xacro writes the URDF of a robot.")
    if not source.root.get("name"):
        raise FileError(f"{path}: the parser takes no robot without a name; write <robot name=…>.")
    refuse_couplings(source)
    beside = joint_file(source.path)
    source = beside.replaced(source)
    require_tree(source)
    text = for_parser(source)
    try:
        model = pin.buildModelFromXML(text, *base_of(root))
    except Exception as error:  # the parser raises whatever its libraries do
        raise FileError(f"{path}: Pinocchio's URDF parser refuses it: {error}") from error
    if model.njoints == 1:
        raise FileError(f"{path}: no link moves against the base; load it with root='free'.")
    try:
        _require_axes(source)
        _require_one_float(model)
        scene = _scene(model, beside.balls, inertia == "as given")
        if mimic:
            _couple(scene, source)
    except SceneError as error:
        raise FileError(f"{place_of(source, str(error))}: {error}") from error
    add_loops_and_couplings(scene, source)
    beside.add_to(scene, source)
    _warn_of_inertia(scene, source)
    return scene


def base_of(root: str) -> tuple:
    """Joint of the base that Pinocchio's parser is given: none, or a free one."""
    return (pin.JointModelFreeFlyer(),) if root == "free" else ()


def body_names(model) -> dict[int, str]:
    """Name of the body that each joint of Pinocchio's model moves; joint 0 carries the ground."""
    first = {frame.parentJoint: frame.name for frame in reversed(_links(model))}  # of the links that a joint carries
    return {0: GROUND} | {i: _link_name(first.get(i, model.names[i])) for i in range(1, model.njoints)}


def _links(model) -> list:
    return [frame for frame in model.frames if frame.type == pin.FrameType.BODY]


def _scene(model, balls: Collection[str] = (), as_given: bool = False) -> Scene:
    """Scene of Pinocchio's model; ``balls`` are hinges of it that stand for ball joints."""
    scene = Scene(model.name or "robot")
    names = body_names(model)
    for index in range(1, model.njoints):
        placement, inertia = model.jointPlacements[index], model.inertias[index]
        pose = {
            "position": placement.translation,
            "rotation": _matrix(placement.rotation),
            "on": names[model.parents[index]],
        }
        tensor = _tensor(inertia)
        wrong = unphysical(inertia.mass, tuple(map(tuple, tensor.tolist())))
        if wrong is not None and not as_given and not wrong.impossible:
            raise SceneError(f"body {names[index]!r}: {wrong.words} inertia='as given' takes it as it stands.")
        scene.body(names[index], inertia.mass, tensor, inertia.lever, inertia_as_given=wrong is not None, **pose)
        kind, options = _kind(model.joints[index], model.names[index])
        if model.names[index] in balls:
            kind, options = "ball", {}
        scene.joint(model.names[index], kind, names[model.parents[index]], names[index], frame=names[index], **options)
    for frame in _links(model):
        name = _link_name(frame.name)
        if name not in scene.bodies and name not in scene.frames:
            pose = frame.placement
            scene.frame(name, names[frame.parentJoint], pose.translation, _matrix(pose.rotation))
    return scene


def _warn_of_inertia(scene: Scene, source: Source):
    taken = [body.name for body in scene.bodies.values() if body.inertia_as_given]
    if taken:
        words = "taken as given, though no body has them (the triangle inequality, or inertia without mass)"
        warnings.warn(
            f"{source.path}: inertias of {listed(map(repr, taken))} are {words}.", UnphysicalInertiaWarning, stacklevel=5
        )


def _require_axes(source: Source):
    """Refuse planes that Pinocchio's parser turns: it moves planar joints along x and y, whatever their axis."""
    for joint in source.root.findall("joint"):
        if joint.get("type") != "planar":
            continue
        axis = joint.find("axis")
        x, y, z = (1.0, 0.0, 0.0) if axis is None else values(source, axis, "xyz")
        if x or y or z <= 0.0:
            remedy = 'write <axis xyz="0 0 1"/>, and turn the <origin> so that z is the normal of the plane'
            raise SceneError(f"joint {joint.get('name')!r}: a planar joint is read with its axis along z only; {remedy}.")


def _require_one_float(model):
    """Refuse a free base without inertia on which the whole robot floats: six freedoms twice."""
    base = [index for index in range(1, model.njoints) if model.parents[index] == 0 and _floats(model, index)]
    for index in base:
        on = [k for k in range(1, model.njoints) if model.parents[k] == index]
        if on and all(_floats(model, k) for k in on) and not model.inertias[index].mass:
            raise SceneError(f"joint {model.names[on[0]]!r} lets the robot float already; load it with root='fixed'.")


def _floats(model, index: int) -> bool:
    return model.joints[index].shortname() == "JointModelFreeFlyer"


def _link_name(name: str) -> str:
    """Name of a link; a link named like the world gets another name."""
    return f"{GROUND} link" if name == GROUND else name


def _tensor(inertia) -> np.ndarray:
    """Inertia about the centre of mass; exact zero where nothing but rounding is left of it."""
    dirt = np.abs(inertia.inertia).max() <= SPECK**2 * inertia.mass
    return np.zeros((3, 3)) if dirt else inertia.inertia


def _matrix(R) -> np.ndarray:
    return rotations.clean(np.array(R))


def _kind(joint, name: str) -> tuple[str, dict]:
    """Kind and axis of a joint of Pinocchio."""
    short = joint.shortname().removeprefix("JointModel")
    for prefix, kind in (("RUB", "revolute"), ("R", "revolute"), ("P", "prismatic")):
        if short.removeprefix(prefix) in UNIT_VECTORS:
            return kind, {"axis": UNIT_VECTORS[short.removeprefix(prefix)]}
    if short in ("RevoluteUnaligned", "RevoluteUnboundedUnaligned", "PrismaticUnaligned"):
        return short.partition("Un")[0].lower(), {"axis": _axis(joint)}
    kinds = {"FreeFlyer": "free", "Spherical": "ball", "Planar": "planar"}
    if short not in kinds:
        raise SceneError(f"joint {name!r}: a joint of type {short} is not modelled. {did_you_mean(short, kinds)}")
    return kinds[short], {}


def _axis(joint) -> np.ndarray:
    """Axis of a joint of one freedom, of its motion subspace: not every joint of Pinocchio tells its axis itself."""
    data = joint.createData()
    joint.calc(data, np.eye(1, joint.idx_q + joint.nq, joint.idx_q)[0])
    return data.S[:3] + data.S[3:]  # a slide moves along it, a hinge turns about it


def _couple(scene: Scene, source: Source):
    """Mimic tags as couplings; joints that mimic one that does not move, or each other in a circle, are refused."""
    leads: dict[str, str] = {}
    for joint in source.root.findall("joint"):
        tag = joint.find("mimic")
        if tag is None or joint.get("name") not in scene.joints:
            continue
        driven, driver = joint.get("name", ""), tag.get("joint", "")
        if driver not in scene.joints:
            exists = any(other.get("name") == driver for other in source.root.findall("joint"))
            lack = "which does not move" if exists else "a joint that does not exist"
            remedy = f"mimic=False lets it move by itself. {did_you_mean(driver, scene.joints)}"
            raise SceneError(f"joint {driven!r} mimics {driver!r}, {lack}; {remedy}")
        leads[driven] = driver
        if driven in _followed(leads, driver):
            raise SceneError(f"joint {driven!r} mimics {driver!r}, which mimics it; mimic=False frees both.")
        ratio, offset = (value(source, tag, key, default) for key, default in (("multiplier", 1.0), ("offset", 0.0)))
        scene.couple(f"{driven} mimics {driver}", driven, driver, ratio, offset)


def _followed(leads: dict[str, str], joint: str) -> list[str]:
    """Joint, and those that it mimics, one after the other."""
    found = [joint]
    while found[-1] in leads and leads[found[-1]] not in found:
        found.append(leads[found[-1]])
    return found
