"""Constant frames: poses of every joint in the principal central frames of its two bodies."""

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.scene import GROUND, Joint, Scene
from gauss.scene.values import rotation_matrix

SAME_POINT = 1e-9  # distance of two given positions of one point, relative to its coordinates: numbers with typed digits

Pose = tuple[np.ndarray, np.ndarray]
IDENTITY: Pose = (np.eye(3), np.zeros(3))


def compose(first: Pose, second: Pose) -> Pose:
    """Pose of ``second``, given relative to ``first``, in the frame that ``first`` is given in."""
    return rotations.clean(first[0] @ second[0]), first[1] + first[0] @ second[1]


def invert(pose: Pose) -> Pose:
    """Pose of the frame that ``pose`` is given in, seen from ``pose``."""
    return pose[0].T, -pose[0].T @ pose[1]


def relative(scene: Scene, seen_from: str, body: str) -> Pose:
    """Reference pose of a body frame seen from another, by their common base, which loses fewest digits."""
    from_path, body_path = _paths(scene, seen_from, body)
    return compose(invert(_climb(scene, from_path)), _climb(scene, body_path))


def _paths(scene: Scene, *bodies: str) -> list[list[str]]:
    """Bodies between each of two bodies and their common base, which both ways look for step by step."""
    ways = [{body: None} for body in bodies]
    ends = list(bodies)
    while True:
        for end, other in zip(ends, ways[::-1], strict=True):
            if end in other:
                return [path[: path.index(end)] for path in map(list, ways)]
        ends = [end if end == GROUND else scene.bodies[end].on for end in ends]
        for way, end in zip(ways, ends, strict=True):
            way[end] = None


def _climb(scene: Scene, path: list[str]) -> Pose:
    pose = IDENTITY
    for name in path:
        body = scene.bodies[name]
        pose = compose((rotation_matrix(body.rotation), np.array(body.position)), pose)
    return pose


def central(scene: Scene, body: str) -> Pose:
    """Principal central frame in the body frame."""
    if body == GROUND:
        return IDENTITY
    return scene.bodies[body].principal()[1], np.array(scene.bodies[body].com)


def joint_frames(scene: Scene, joint: Joint) -> tuple[Pose, Pose]:
    """Joint frame in the principal central frames of its parent and its child.

    SceneError if the joint point is given on both bodies and the two do not meet at the reference configuration.
    """
    given = (joint.axes(), np.array(joint.at))
    parent, child = invert(central(scene, joint.parent)), invert(central(scene, joint.child))
    if joint.child_frame is not None:
        on_parent, on_child = (compose(on_body(scene, name), given) for name in (joint.frame, joint.child_frame))
        return compose(parent, on_parent), compose(child, on_child)
    origin = GROUND if joint.frame == "world" else joint.frame
    on_parent = compose(relative(scene, joint.parent, origin), given)
    on_child = compose(relative(scene, joint.child, origin), given)
    if joint.child_at is not None:
        gap = np.linalg.norm(on_child[1] - joint.child_at)
        if gap > SAME_POINT * sum(np.linalg.norm(point) for point in (on_child[1], joint.child_at, joint.at)):
            raise SceneError(
                f"joint {joint.name!r}: its points on {joint.parent!r} and {joint.child!r} are {gap:.6g} m apart at the "
                f"reference configuration; expected child_at = {on_child[1].tolist()}, or move one of the bodies."
            )
    return compose(parent, on_parent), compose(child, on_child)


def on_body(scene: Scene, name: str) -> Pose:
    """Pose of a named frame in the frame of the body that carries it; the identity for a body itself."""
    frame = scene.frames.get(name)
    return IDENTITY if frame is None else (rotation_matrix(frame.rotation), np.array(frame.position))
