"""Loops and couplings of a robot as elements of its scene: joints between two frames, and sums of joint coordinates.

A loop joint lets a frame on one link and a frame on another meet as its kind says. A coupling of links A and B with the
nearest common ancestor N is r Σ q (joints from N to A) = Σ q (joints from N to B), see :func:`add_coupling`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gauss.errors import SceneError, did_you_mean
from gauss.io.guard import Source
from gauss.scene import GROUND, Scene
from gauss.scene.values import rotation_matrix
from gauss.system.frames import IDENTITY, Pose, compose, on_body


@dataclass(frozen=True)
class FrameOnLink:
    """Frame on a link."""

    link: str  # the link, also one that fixed joints weld to another
    pose: Pose = IDENTITY  # rotation (3, 3) and position (3,) [m] in the frame of the link


@dataclass(frozen=True)
class LoopClosure:
    """Joint that closes a loop."""

    name: str  # name, kind: its name, and the kind of :class:`gauss.Joint`
    kind: str
    predecessor: FrameOnLink  # predecessor, successor: frames that coincide where the coordinates of the joint are zero
    successor: FrameOnLink
    axis: tuple[float, ...] | None = None  # axis of the joint in both frames

    def add_to(self, scene: Scene):
        """Add the joint, and the frames that it needs.

        SceneError if there is no such link, or both frames are on one body.
        """
        what = f"loop {self.name!r}"
        ends = [_carrier(scene, end, f"{what}: {side}") for side, end in self._ends]
        if ends[0][0] == ends[1][0]:
            raise SceneError(f"{what}: both frames are on {ends[0][0]!r}; a loop joint binds two bodies.")
        sides = [end.link for _, end in self._ends]
        twin = next((joint.name for joint in scene.joints.values() if _same_loop(scene, joint, self.kind, ends)), None)
        if twin is not None:
            raise SceneError(f"{what}: {sides[0]!r} and {sides[1]!r} are closed there by {twin!r} already; keep one.")
        names = [_frame_name(scene, f"{self.name} {side}", end, carried) for (side, end), carried in self._paired(ends)]
        axis = {} if self.axis is None else {"axis": self.axis}
        scene.joint(self.name, self.kind, ends[0][0], ends[1][0], frame=names[0], child_frame=names[1], **axis)

    def with_ends(self, link_of: Callable[[str], str]) -> "LoopClosure":
        """The same loop between other links, by their names."""
        one, other = (replace(end, link=link_of(end.link)) for end in (self.predecessor, self.successor))
        return replace(self, predecessor=one, successor=other)

    @property
    def _ends(self) -> tuple[tuple[str, FrameOnLink], ...]:
        return ("predecessor", self.predecessor), ("successor", self.successor)

    def _paired(self, ends):
        return zip(self._ends, ends, strict=True)


def add_coupling(scene: Scene, source: Source, name: str, predecessor: str, successor: str, ratio: float):
    """Add the coupling r Σ q (to the predecessor) = Σ q (to the successor), from the nearest common ancestor.

    SceneError if there is no such link, or a chain holds no joint of one freedom.

    Parameters
    ----------
    scene : Scene
        Scene of the tree of the file.
    source : Source
        The file, whose joints give the chains.
    ratio : float
        r: the successor turns so many times as fast as the predecessor.
    """
    what = f"coupling {name!r}"
    if not ratio:
        raise SceneError(f"{what}: the ratio must not be 0; make the joint fixed.")
    chains = [_checked_chain(source, link, f"{what}: {side}") for side, link in _sides_of(predecessor, successor)]
    shared = {joint for joint, _ in chains[0]} & {joint for joint, _ in chains[1]}
    moving = [[joint for joint, _ in chain if joint not in shared and joint in scene.joints] for chain in chains]
    for (side, link), joints in zip(_sides_of(predecessor, successor), moving, strict=True):
        if not joints:
            raise SceneError(
                f"{what}: no joint moves the {side} {link!r} against the other; a coupling needs one on each side."
            )
    if len(moving[0]) == len(moving[1]) == 1:
        scene.couple(name, moving[1][0], moving[0][0], ratio)
    else:
        scene.linear_coupling(name, dict.fromkeys(moving[0], ratio) | dict.fromkeys(moving[1], -1.0))


def _sides_of(predecessor: str, successor: str):
    return ("predecessor", predecessor), ("successor", successor)


def _checked_chain(source: Source, link: str, what: str) -> list[tuple[str, str]]:
    """Joints with their parents from a link to the root; a SceneError if there is no such link."""
    links = [element.get("name", "") for element in source.root.findall("link")]
    if link not in links:
        raise SceneError(f"{what}: no link {link!r}. {did_you_mean(link, links)}")
    return chain_to_root(source, link)


def chain_to_root(source: Source, link: str) -> list[tuple[str, str]]:
    """Joints with their parents from a link to the root."""
    inward = {}
    for joint in source.root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            inward[child.get("link")] = (joint.get("name", ""), parent.get("link", ""))
    chain: list[tuple[str, str]] = []
    while link in inward and len(chain) <= len(inward):
        chain.append(inward[link])
        link = chain[-1][1]
    return chain


def _carrier(scene: Scene, end: FrameOnLink, what: str) -> tuple[str, Pose]:
    """Body that carries a frame, and the pose of the frame on it."""
    link = f"{GROUND} link" if end.link == GROUND else end.link
    if link not in scene.bodies and link not in scene.frames:
        raise SceneError(f"{what}: no link or frame {end.link!r}. {did_you_mean(end.link, [*scene.bodies, *scene.frames])}")
    body = scene.frames[link].body if link in scene.frames else link
    return body, compose(on_body(scene, link), end.pose)


def _frame_name(scene: Scene, name: str, end: FrameOnLink, carried: tuple[str, Pose]) -> str:
    """Name of a frame at a pose on a body: of one that is there, or of a new one."""
    link = f"{GROUND} link" if end.link == GROUND else end.link
    if end.pose is IDENTITY or (np.array_equal(end.pose[0], np.eye(3)) and not end.pose[1].any()):
        return link
    body, (R, p) = carried
    for number in range(1, len(scene.frames) + 2):
        tried = name if number == 1 else f"{name} {number}"
        there = scene.frames.get(tried)
        if there is None:
            return scene.frame(tried, body, p, R).name
        if there.body == body and np.array_equal(rotation_matrix(there.rotation), R) and np.array_equal(there.position, p):
            return tried
    raise AssertionError("one name of so many is free")


def _same_loop(scene: Scene, joint, kind: str, ends) -> bool:
    """Whether a joint of this kind closes a loop between the same two frames."""
    if joint.child_frame is None or joint.kind != kind or {joint.parent, joint.child} != {body for body, _ in ends}:
        return False
    there = [on_body(scene, name) for name in (joint.frame, joint.child_frame)]
    here = [pose for _, pose in (ends if joint.parent == ends[0][0] else ends[::-1])]
    pairs = zip(there, here, strict=True)
    return all(np.array_equal(R, S) and np.array_equal(p, x) for (R, p), (S, x) in pairs)


def pose_of(xyz, rpy) -> Pose:
    """Pose of an ``<origin>``."""
    return rotation_matrix(rpy), np.array(xyz)
