"""The spanning tree that MuJoCo gets, and every pair of it as a chain of MuJoCo's joints.

MuJoCo closes loops by points and by welds only, so of a loop a joint is cut that these can stand for: revolute, ball or
fixed. Where the tree passes a joint from its child to its parent, the chain is reversed and its axes are negated, so that
coordinates keep their sign.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss import rotations
from gauss.dynamics.kinematics import Kinematics
from gauss.linked_groups import LinkedGroups
from gauss.scene import GROUND, Drive, Joint, JointSpring, LinearCoupling, Prescribed, Scene
from gauss.system import System
from gauss.system.frames import Pose, compose, invert

CLOSABLE = frozenset({"revolute", "ball", "fixed", "free"})
# Steps of a chain: type of the joint, axis of the joint frame, and its rate; a coupling relates the two joints of a screw.
STEPS = {
    "fixed": (),
    "revolute": (("hinge", 2, 0),),
    "prismatic": (("slide", 2, 0),),
    "screw": (("hinge", 2, 0), ("slide", 2, None)),
    "cylindrical": (("hinge", 2, 0), ("slide", 2, 1)),
    "universal": (("hinge", 2, 0), ("hinge", 0, 1)),
    "planar": (("slide", 0, 0), ("slide", 1, 1), ("hinge", 2, 2)),
    "ball": (("ball", None, None),),
    "free": (("slide", 0, 0), ("slide", 1, 1), ("slide", 2, 2), ("ball", None, None)),
}


@dataclass(frozen=True)
class ElementaryJoint:
    """One joint of MuJoCo."""

    # name, kind: its name, and hinge, slide, ball or free
    name: str
    kind: str
    axis: np.ndarray | None  # axis (3,) in the frame of the body that it moves
    pos: np.ndarray  # joint point (3,) there [m]
    # position, rate: its entries of qpos and of qvel, functions of a motion of the system
    position: Callable
    rate: Callable
    # gear: its generalised forces for unit efforts along the rates of the joint of the scene, one column for each; None when
    # they depend on the state
    gear: np.ndarray | None


@dataclass(frozen=True)
class Limb:
    """Body of the tree: what it hangs on, by which joint, and the steps of that."""

    body: str
    on: str
    joint: Joint
    steps: tuple[ElementaryJoint, ...]


def spanning_tree(scene: Scene) -> tuple[list[tuple[Joint, str, str]], list[Joint]]:
    """Tree (joint, outer body, inner body), inner bodies first, and the joints that are cut.

    Of the joints of a loop one is cut that MuJoCo can close and that carries no load, the last of these in the scene.
    """
    busy = _busy(scene)
    joints = sorted(
        scene.joints.values(),
        key=lambda joint: (joint.child_frame is not None, joint.kind in CLOSABLE and joint.name not in busy),
    )
    kept = _spanning(scene, joints)
    return _from_the_ground(scene, kept), [joint for joint in scene.joints.values() if joint.name not in kept]


def _busy(scene: Scene) -> set[str]:
    """Joints that carry a load or a constraint."""
    busy = {load.joint for load in scene.loads.values() if isinstance(load, Drive | JointSpring)}
    busy |= {joint for coupling in scene.couplings.values() for joint in (coupling.driven, coupling.driver)}
    busy |= {
        joint for relation in scene.relations.values() if isinstance(relation, LinearCoupling) for joint in relation.coupled
    }
    busy |= {relation.joint for relation in scene.relations.values() if isinstance(relation, Prescribed)}
    return busy


def _spanning(scene: Scene, joints: list[Joint]) -> set[str]:
    """Names of joints of a spanning tree, of which the first are preferred (Kruskal)."""
    number = {name: k for k, name in enumerate([GROUND, *scene.bodies])}
    groups = LinkedGroups(len(number))
    return {joint.name for joint in joints if groups.join(number[joint.parent], number[joint.child])}


def _from_the_ground(scene: Scene, kept: set[str]) -> list[tuple[Joint, str, str]]:
    """Joints of a tree (joint, outer body, inner body), breadth first."""
    outward: dict[str, list[tuple[Joint, str]]] = {name: [] for name in (GROUND, *scene.bodies)}
    for joint in scene.joints.values():
        if joint.name in kept:
            outward[joint.parent].append((joint, joint.child))
            outward[joint.child].append((joint, joint.parent))
    tree, reached, waiting = [], {GROUND}, [GROUND]
    while waiting:
        inner = waiting.pop(0)
        for joint, outer in outward[inner]:
            if outer not in reached:
                reached.add(outer)
                waiting.append(outer)
                tree.append((joint, outer, inner))
    return tree


def limb(system: System, joint: Joint, outer: str, inner: str) -> Limb:
    """Body of the tree with its chain of joints."""
    if joint.kind == "free" and inner == GROUND:
        return Limb(outer, inner, joint, (_floating(system, joint, outer),))
    placed, inward = system.joint(joint.name), outer == joint.parent
    R, pos = joint_frame(system, joint, outer)
    steps = []
    for kind, axis, rate in STEPS[joint.kind]:
        if kind == "ball":
            name = joint.name if joint.kind == "ball" else f"{joint.name}.rotation"
            steps.append(ElementaryJoint(name, kind, None, pos, *_turning(placed, R, inward)))
            continue
        suffix = placed.pair.rates[rate] if rate is not None else "slide"
        name = f"{joint.name}.{suffix}" if suffix else joint.name
        direction = -R[:, axis] if inward else R[:, axis]
        steps.append(ElementaryJoint(name, kind, direction, pos, *_along(placed, rate, joint.pitch)))
    return Limb(outer, inner, joint, tuple(reversed(steps) if inward else steps))


def joint_frame(system: System, joint: Joint, body: str) -> Pose:
    """Joint frame in the frame of one of its bodies."""
    placed = system.joint(joint.name)
    in_central = (placed.R_parent, placed.p_parent) if body == joint.parent else (placed.R_child, placed.p_child)
    frame = system.frames[body]
    return compose(invert((frame.R, frame.p)), in_central)


def mujoco_state(system: System, limbs: list[Limb], motion: Kinematics) -> tuple[np.ndarray, np.ndarray]:
    """Vectors qpos and qvel of MuJoCo for a state of the system."""
    steps = [step for one in depth_first(limbs) for step in one.steps]
    joined = lambda found: np.concatenate([np.zeros(0), *map(np.atleast_1d, found)])  # noqa: E731
    return joined(step.position(motion) for step in steps), joined(step.rate(motion) for step in steps)


def depth_first(limbs: list[Limb]) -> list[Limb]:
    """Limbs in the order in which MuJoCo numbers the bodies of a file."""
    outward: dict[str, list[Limb]] = {}
    for one in limbs:
        outward.setdefault(one.on, []).append(one)
    order, waiting = [], outward.get(GROUND, [])[::-1]
    while waiting:
        order.append(waiting.pop())
        waiting += outward.get(order[-1].body, [])[::-1]
    return order


def _along(placed, rate: int | None, pitch: float):
    """Coordinate, rate and gear of a hinge or slide; the slide of a screw advances by its pitch and is not driven."""
    at, factor = (rate, 1.0) if rate is not None else (0, pitch)
    return (
        lambda motion: factor * motion.state.q[placed.q.start + at],
        lambda motion: factor * motion.state.v[placed.v.start + at],
        np.zeros((1, placed.pair.n_v)) if rate is None else np.eye(placed.pair.n_v)[[rate]],
    )


def _turning(placed, R: np.ndarray, inward: bool):
    """Quaternion, angular velocity in the axes of the outer body, and gear, of a rotation given in the joint frame."""
    k, C = placed.pair.quaternion, rotations.to_quaternion(R)
    flip = np.array([1.0, -1.0, -1.0, -1.0])

    def position(motion):
        Q = motion.state.q[placed.q][k:]
        return rotations.multiply(rotations.multiply(C, Q * flip if inward else Q), C * flip)

    def rate(motion):
        Q, omega = motion.state.q[placed.q][k:], motion.state.v[placed.v][k:]
        return R @ (-rotations.from_quaternion(Q) @ omega if inward else omega)

    return position, rate, None if inward else np.concatenate([np.zeros((3, k)), R], axis=1)


def _floating(system: System, joint: Joint, body: str) -> ElementaryJoint:
    """Free joint of MuJoCo: pose of the body frame in the world, its velocity there, angular velocity in body axes."""

    def position(motion):
        return np.concatenate([motion.position(body), rotations.to_quaternion(motion.rotation(body))])

    def rate(motion):
        turning = motion.W[motion.system.frame(body).body]
        return np.concatenate([motion.velocity(body), motion.rotation(body).T @ turning])

    (R_ground, _), (R_body, offset) = (joint_frame(system, joint, end) for end in (joint.parent, joint.child))
    none, gear = np.zeros((3, 3)), None
    if body == joint.child and not offset.any():  # elsewhere an effort along a rate is a force beside the body frame
        gear = np.block([[R_ground, none], [none, R_body]])
    return ElementaryJoint(joint.name, "free", None, np.zeros(3), position, rate, gear)
