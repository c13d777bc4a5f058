"""Linkage → scene in the x-y plane: links become bodies, joints constraints, without groups and order."""

import cmath
from collections.abc import Callable

import numpy as np

from gauss.errors import LinkageError
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.cycles import cycle
from gauss.linkages.elements import LinkJoint
from gauss.linkages.loads import acting
from gauss.linkages.motion import LinkageKinematics
from gauss.linkages.placed import LinkMotion, Pose
from gauss.scene import Scene
from gauss.system import State, System


def to_scene(chain: Chain, angle: float | None = None, torque: float | Callable | None = None) -> Scene:
    """Scene of a linkage, assembled at a crank angle and moving at the crank's speed.

    Names of links and joints are kept, and every joint's reaction is the same. Joint coordinates are zero at the given
    crank angle.

    Parameters
    ----------
    chain : Chain
        The linkage.
    angle : float, optional
        Crank angle of the reference configuration [rad]; the start of the cycle when not given.
    torque : float or callable, optional
        Torque on the crank [N m], or a law of (t) or (t, motion). When not given, the motion of the crank is prescribed
        and the torque is a reaction (:func:`gauss.drive_forces`).

    Returns
    -------
    Scene
        The same mechanism for Gauss's principle.

    Raises
    ------
    LinkageError
        If the linkage does not close there.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> from gauss.linkages import to_scene
    >>> scene = to_scene(bar.chain, angle=0.5)
    >>> list(scene.joints)
    ['A', 'B', 'D', 'C']
    """
    angle = chain.driver.start if angle is None else float(angle)
    links = {name: _pose(moving) for name, moving in cycle(chain, [angle]).motion.links.items()}
    scene = Scene(chain.name, gravity=(chain.gravity.real, chain.gravity.imag, 0.0))
    for link in chain.links:
        pose = links[link.name]
        scene.body(
            link.name,
            link.mass,
            (0.0, 0.0, link.inertia),
            com=(*link.com, 0.0),
            position=_spatial(pose.p),
            rotation=(0.0, 0.0, cmath.phase(pose.e)),
        )
    for joint in _spanning_first(chain):
        child = links[joint.child]
        at = _spatial(child.point(joint.point(joint.child)))
        if joint.kind == "revolute":
            scene.revolute(joint.name, joint.parent, joint.child, at=at)
        else:
            axis = _spatial(joint.direction(joint.child) * child.e)
            scene.prismatic(joint.name, joint.parent, joint.child, at=at, axis=axis)
    for number, load in enumerate(chain.loads, start=1):
        _add_load(scene, chain, load, f"load {number} on {load.link}")
    if torque is None:
        speed, acceleration = chain.driver.speed, chain.driver.acceleration
        scene.drive(chain.pivot.name, angle=lambda t: speed * t + 0.5 * acceleration * t * t)
    else:
        scene.drive(chain.pivot.name, torque=torque)
    scene.start(chain.pivot.name, position=0.0, rate=chain.driver.speed)
    return scene


def _spanning_first(chain: Chain) -> list[LinkJoint]:
    """Joints in the order of the spanning tree: in each group outer joints first, inner joints close loops.

    A link without inertia about its outer pin is placed by its inner joint: the coordinate of the pin has no inertia.
    """
    joints = [chain.pivot]
    for group in chain.groups:
        outer = [leg.joint for leg in group.legs]
        light = [leg.joint for leg in group.legs if isinstance(group, Dyad) and not _inertia_about(leg)]
        first = [joint for joint in outer if joint not in light[:1]]
        joints += [*first, *group.inners, *light[:1]]
    return joints


def _inertia_about(leg) -> float:
    """Inertia that the outer joint of a leg moves: about the pin, or the mass on a slide."""
    arm = abs(complex(*leg.link.com) - leg.joint.point(leg.name))
    return leg.link.mass if leg.joint.kind == "prismatic" else leg.link.inertia + leg.link.mass * arm**2


def _pose(moving) -> Pose:
    return Pose(*(complex(np.ravel(z)[0]) for z in (moving.p, moving.e)))


def _spatial(z: complex) -> tuple[float, float, float]:
    return z.real, z.imag, 0.0


def _add_load(scene: Scene, chain: Chain, load, name: str):
    at = None if load.at is None else (*load.at, 0.0)
    if not load.varies:
        axes = "body" if load.axes == "link" else "world"
        scene.force(name, load.link, (*load.force, 0.0), (0.0, 0.0, load.moment), at=at, axes=axes)
        return

    def wrench(t, motion):
        return acting(load, _seen(chain, load.link, motion))

    scene.force(
        name,
        load.link,
        lambda t, motion: _spatial(wrench(t, motion).force),
        lambda t, motion: (0.0, 0.0, float(wrench(t, motion).moment)),
        at=at,
    )


def _seen(chain: Chain, link: str, motion) -> LinkageKinematics:
    """Motion of a scene in the form that loads of a linkage take."""
    moving = {name: _planar(motion, name) for name in {link, chain.crank.name}}
    crank = moving[chain.crank.name]
    return LinkageKinematics(chain, cmath.phase(crank.e), crank.omega, moving, (), ())


def _planar(motion, name: str) -> LinkMotion:
    x, R, v = motion.position(name), motion.rotation(name), motion.velocity(name)
    omega = motion.angular_velocity(name)[2]
    return LinkMotion(complex(x[0], x[1]), complex(R[0, 0], R[1, 0]), complex(v[0], v[1]), omega, 0j, 0.0)


def scene_state(system: System, found: Cycle, index: int, reference: float | None = None) -> State:
    """State of a linkage's scene at one crank angle of a cycle.

    Parameters
    ----------
    system : System
        Made of ``to_scene``.
    found : Cycle
        The cycle.
    index : int
        Which of its crank angles.
    reference : float, optional
        Crank angle at which the scene was made [rad]; the start of the cycle when not given.

    Returns
    -------
    State
        Consistent state of the scene.

    Raises
    ------
    LinkageError
        If the system is of something else.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> cycle = bar.cycle([0.0, 0.5, 1.0])
    >>> from gauss.linkages import scene_state
    >>> system = gauss.compile_scene(bar.to_scene())
    >>> state = scene_state(system, cycle, 1)
    >>> state.q.round(4)
    array([ 0.5   , -0.7358, -0.1339, -0.1019])
    """
    chain = found.chain
    joints = {joint.name: joint for joint in chain.joints}
    if {joint.name for joint in system.joints} != set(joints):
        raise LinkageError(f"the system has other joints than {chain.name}: expected {', '.join(joints)}.")
    start = cycle(chain, [chain.driver.start if reference is None else reference])
    q, v = np.zeros(system.n_q), np.zeros(system.n_v)
    for k, placed in enumerate(system.joints):
        joint = joints[placed.name]
        if joint.kind == "prismatic":
            slide = found.slide(joint.name)
            q[k] = _at(slide.position, index) - _at(start.slide(joint.name).position, 0)
            v[k] = _at(slide.speed, index)
        else:
            turn = _turn(found, joint, index) / _turn(start, joint, 0)
            q[k] = cmath.phase(turn)
            v[k] = _at(found.link(joint.child).omega, index) - _at(found.link(joint.parent).omega, index)
    return system.state(q, v)


def _turn(found: Cycle, joint, index: int) -> complex:
    return complex(_at(found.link(joint.child).e, index) / _at(found.link(joint.parent).e, index))


def _at(values, index: int):
    return values if np.ndim(values) == 0 else values[index]
