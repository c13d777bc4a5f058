"""The shape of a mechanism that has none: the points where joints bind its bodies, and the lines between them."""

from itertools import pairwise

import numpy as np

from gauss.scene import GROUND
from gauss.simulation import Trajectory
from gauss.system import System

SAME_POINT_RELATIVE = 1e-9  # of the size of a mechanism: points closer than this are one


def skeleton(system: System) -> dict[str, np.ndarray]:
    """Joint points (k, 3) [m] of every body in its frame, in the order in which lines connect them; ground last.

    A body of one joint also has its centre of mass; one of more than two is a closed outline, in a plane as far as it goes.
    """
    names = [*system.structure.bodies, GROUND]
    found: dict[str, list] = {name: [] for name in names}
    for joint in system.joints:
        found[names[joint.parent]].append(joint.p_parent)
        found[names[joint.child]].append(joint.p_child)
    centre = np.zeros(3)
    size = max((float(np.linalg.norm(p)) for points in found.values() for p in points), default=1.0) or 1.0
    shapes = {}
    for name, points in found.items():
        points = _distinct(points, SAME_POINT_RELATIVE * size)
        if name != GROUND and len(points) == 1:
            points = _distinct([*points, centre], SAME_POINT_RELATIVE * size)
        shapes[name] = _outlined(np.array(points).reshape(-1, 3))
        if name != GROUND:
            frame = system.frames[name]
            shapes[name] = (shapes[name] - frame.p) @ frame.R
    return shapes


def lines(points: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of points that lines connect: an open line of two, a closed one of more."""
    return [*pairwise(range(len(points))), *([(len(points) - 1, 0)] if len(points) > 2 else [])]


def placed(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Skeleton of every body (samples, k, 3) in the world [m]; that of the ground stands still."""
    shapes = skeleton(trajectory.system)
    ground = shapes.pop(GROUND)
    return moved(trajectory, shapes) | {GROUND: np.broadcast_to(ground, (len(trajectory), *ground.shape))}


def moved(trajectory: Trajectory, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Points (k, 3) in the frames of bodies, at every sample (samples, k, 3) in the world [m]."""
    positions, rotations = trajectory.poses()
    places = {name: i for i, name in enumerate(trajectory.system.structure.bodies) if name in points}
    return {
        name: positions[:, None, i] + np.einsum("tij,kj->tki", rotations[:, i], points[name]) for name, i in places.items()
    }


def _distinct(points: list, near: float) -> list:
    kept: list = []
    for point in points:
        if all(np.linalg.norm(point - other) > near for other in kept):
            kept.append(np.asarray(point, dtype=float))
    return kept


def _outlined(points: np.ndarray) -> np.ndarray:
    """Points in the order of their angle about their middle, seen along the direction in which they extend least."""
    if len(points) < 3:
        return points
    arms = points - points.mean(axis=0)
    across = np.linalg.svd(arms, full_matrices=False)[2][:2]
    x, y = across @ arms.T
    return points[np.argsort(np.arctan2(y, x), kind="stable")]
