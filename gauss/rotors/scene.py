"""Network → scene: shafts become bodies on revolute joints, links couple their joint coordinates."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from gauss import math
from gauss.errors import SceneError, did_you_mean
from gauss.rotors.contract import reduce
from gauss.rotors.elements import Shaft, Torque
from gauss.rotors.laws import Constant, Dry
from gauss.rotors.network import Network
from gauss.rotors.reduced import ReducedNetwork
from gauss.rotors.scene_links import elements_of
from gauss.scene import Scene, values

AXIS = (0.0, 0.0, 1.0)


def to_scene(
    network: Network,
    scene: Scene | None = None,
    on: Mapping[str, str] | None = None,
    at: Mapping[str, tuple] | None = None,
    axis=AXIS,
    mass: float = 1.0,
    housing: str = "ground",
) -> Scene:
    """Add a network to a scene.

    Every shaft becomes a body of its name on a revolute joint of its name, every link an element between two joint
    coordinates: gears become couplings, with losses or constant slip lossy gears, springs elastic links with their backlash,
    friction drives, clutches and freewheels set-valued elements; dry loads become joint friction. All of them react on the
    body that carries the bearings. A shaft that is a joint of the scene gives that joint its inertia and its torques.

    Parameters
    ----------
    network : Network
        The network.
    scene : Scene, optional
        Scene that it is added to; a new one without gravity when not given.
    on : mapping of str to str, optional
        Shafts that are revolute joints of the scene, {name of the shaft: name of the joint}; they turn as the joints start.
    at : mapping of str to (3,), optional
        Where the other shafts lie, in the world [m]; at the origin when not given.
    axis : array_like, shape (3,)
        Axis of all shafts but those of ``on``, in the world.
    mass : float
        Of each rotor [kg], centred on its axis.
    housing : str
        Body that carries the bearings.

    Returns
    -------
    Scene
        The scene that was given, or the new one.

    Raises
    ------
    SceneError
        If a shaft or joint does not exist, or they do not fit.
    """
    scene = Scene(network.name, gravity=(0.0, 0.0, 0.0)) if scene is None else scene
    on, at = _places(network, scene, on or {}, at or {})
    reduced = reduce(_with_joint_speeds(network, scene, on))
    joints = {name: on.get(name, name) for name in network.shafts}
    turned = _turned(reduced, scene, on)
    for j, shaft in enumerate(network.shafts.values()):
        speed = reduced.K[j] * reduced.speed[reduced.group[j]]
        if shaft.name in on:
            _weld(scene, shaft, mass, scene.joints[on[shaft.name]])
            if on[shaft.name] not in scene.starts and speed:
                scene.start(on[shaft.name], rate=speed)
            continue
        place = at.get(shaft.name, (0.0, 0.0, 0.0))
        scene.body(shaft.name, mass, _disc(shaft.inertia, axis), position=place)
        scene.revolute(shaft.name, housing, shaft.name, at=place, axis=axis)
        scene.start(shaft.name, position=reduced.K[j] * turned[reduced.group[j]], rate=speed)
    for b in range(len(reduced.links)):
        for element in elements_of(reduced, b, joints):
            scene.add(element)
    for torque in network.torques.values():
        _add_torque(scene, torque, joints[torque.shaft], network.shafts[torque.shaft].angle)
    return scene


def _add_torque(scene: Scene, torque: Torque, joint: str, angle: float) -> None:
    """Add a torque to the joint of its shaft, whose angle is counted from the given one [rad]."""
    if isinstance(torque.law, Dry):
        scene.joint_friction(joint, _dry_limit(torque, torque.law.value), name=torque.name)
    else:
        scene.drive(joint, torque=_applied(torque, joint, angle), name=torque.name, breaks=torque.breaks)


def _places(network: Network, scene: Scene, on, at) -> tuple[dict, dict]:
    """Checked places of the shafts."""
    on = {network.require_shaft(shaft): joint for shaft, joint in on.items()}
    for shaft, joint in on.items():
        if joint not in scene.joints:
            raise SceneError(f"shaft {shaft!r}: the scene has no joint {joint!r}. {did_you_mean(str(joint), scene.joints)}")
        if scene.joints[joint].kind != "revolute":
            raise SceneError(f"shaft {shaft!r}: joint {joint!r} is {scene.joints[joint].kind}; a shaft is a revolute joint.")
    if len(set(on.values())) < len(on):
        raise SceneError(f"on: two shafts cannot be one joint, got {on}; join them by a gear of ratio 1.")
    at = {network.require_shaft(shaft): values.vector(place, f"shaft {shaft!r}: at", "m") for shaft, place in at.items()}
    for shaft in set(at) & set(on):
        raise SceneError(f"shaft {shaft!r}: lies where its joint {on[shaft]!r} is; leave it out of at.")
    return on, at


def _with_joint_speeds(network: Network, scene: Scene, on) -> Network:
    """The network with the initial speeds of the joints of the scene."""
    found = Network(network.name)
    for shaft in network.shafts.values():
        start = scene.starts.get(on.get(shaft.name))
        rate = None if start is None else float(np.ravel(start.rate)[0])
        if rate is not None and shaft.speed not in (None, rate):
            raise SceneError(
                f"shaft {shaft.name!r}: starts at {shaft.speed:g} rad/s, but joint {on[shaft.name]!r} at {rate:g} rad/s: "
                "leave the speed of the shaft out."
            )
        found.add(shaft if rate is None else replace(shaft, speed=rate))
    for element in (*network.links.values(), *network.torques.values()):
        found.add(element)
    return found


def _turned(reduced: ReducedNetwork, scene: Scene, on) -> np.ndarray:
    """Angles (n_g,) of the roots [rad] where the joints of the scene start."""
    theta = np.zeros(reduced.n_groups)
    for j, name in enumerate(reduced.names):
        start = scene.starts.get(on.get(name))
        if start is not None and start.position is not None:
            theta[reduced.group[j]] = float(np.ravel(start.position)[0]) / reduced.K[j]
    return theta


def _disc(inertia: float, axis) -> np.ndarray:
    """Inertia of a thin disc about an axis, J along it and J/2 across [kg m²]."""
    n = np.array(values.vector(axis, "axis", "1"))
    if not n.any():
        raise SceneError("axis: expected a direction, got (0, 0, 0).")
    n = n / np.linalg.norm(n)
    return 0.5 * inertia * (np.eye(3) + np.outer(n, n))


def _weld(scene: Scene, shaft: Shaft, mass: float, joint):
    """Weld a rotor to the body that a joint of the scene turns, about the axis of the joint."""
    base = "ground" if joint.frame == "world" else joint.frame
    scene.body(shaft.name, mass, _disc(shaft.inertia, joint.axis), position=joint.at, on=base)
    scene.fixed(f"{shaft.name} on {joint.name}", joint.child, shaft.name, at=joint.at, frame=joint.frame)


def _dry_limit(torque: Torque, limit: float) -> float | Callable:
    """Limit of dry friction [N m], a function of time where it acts for a limited time."""
    return _gated(torque, lambda t: limit) if torque.timed else limit


def _gated(torque: Torque, law: Callable) -> Callable:
    """Law (t, …) that is zero before the start of a torque and from its end on."""

    def gated(t, *where):
        value = law(t, *where)
        value = value if torque.until is None else math.where(t < torque.until, value, 0.0)
        return value if torque.begin is None else math.where(t >= torque.begin, value, 0.0)

    return gated


def _applied(torque: Torque, joint: str, angle: float):
    """Law of an applied torque, as a scene calls it."""
    if isinstance(torque.law, Constant) and not torque.timed:
        return torque.law.value
    law = _gated(torque, lambda t, motion: torque.law(t, angle + motion.coordinate(joint), motion.rate(joint)))
    return lambda t, motion: law(t, motion)
