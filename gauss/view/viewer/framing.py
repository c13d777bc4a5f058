"""Position of the camera for which a motion fills the picture, and height of the floor."""

from typing import NamedTuple

import numpy as np

from gauss.scene import GROUND, HalfSpace, HeightField, Scene
from gauss.scene.values import unit
from gauss.simulation import Trajectory
from gauss.view.skeleton import moved, placed
from gauss.view.viewer.forms import corners, size

VIEW = np.array([0.42, -0.8, 0.38])  # from what is seen to the eye: right, away, up
FIELD = 0.6  # angle that the eye sees from bottom to top [rad]: narrow, so that parallels nearly look so
FILLED = 0.86  # of the picture
LEVEL = 0.9999  # cosine of the tilt up to which a half-space is the floor
BELOW = 0.05  # floor under the lowest point that is reached, of the size of the mechanism


class Framing(NamedTuple):
    """View of a motion."""

    middle: np.ndarray  # middle, eye (3,): what is looked at, and from where [m]
    eye: np.ndarray
    right: np.ndarray  # right, away, up (3,): axes of the room: up is against gravity
    away: np.ndarray
    up: np.ndarray
    floor: np.ndarray  # (3,) point of the floor under the middle [m]
    reach: float  # diagonal of all that is seen [m]


def framing(trajectory: Trajectory) -> Framing:
    """View in which the skeleton and the shapes of contact of bodies stay in the picture all the time."""
    gravity = np.array(trajectory.system.scene.gravity)
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    right, away = _beside(up)
    length = size(trajectory.system)
    outlines = [placed(trajectory), moved(trajectory, corners(trajectory.system))]
    seen = np.concatenate([points.reshape(-1, 3) for outline in outlines for points in outline.values()])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, reach = (low + high) / 2, max(float(np.linalg.norm(high - low)), length)
    direction = VIEW @ np.stack([right, away, up])
    eye = middle + reach / 2 / np.sin(FIELD / 2) / FILLED * direction / np.linalg.norm(direction)
    lowest = _ground(trajectory.system.scene, up, middle, BELOW * length)
    lowest = ((seen - middle) @ up).min() - BELOW * length if lowest is None else lowest
    return Framing(middle, eye, right, away, up, middle + lowest * up, reach)


def joined(view: Framing, other: Framing, displacement: np.ndarray) -> Framing:
    """View of two motions, of which the second is displaced to the right [m]."""
    middle, reach = (view.middle + other.middle + displacement) / 2, view.reach + other.reach
    eye = middle + (view.eye - view.middle) * reach / view.reach
    return view._replace(middle=middle, eye=eye, reach=reach)


def _ground(scene: Scene, up: np.ndarray, middle: np.ndarray, below: float) -> float | None:
    """Height over the middle of a level half-space, or of a place below the terrain of the ground [m]; None without both."""
    own = [shape for shape in scene.shapes.values() if shape.body == GROUND]
    for shape in own:
        if isinstance(shape, HalfSpace) and unit(shape.normal) @ up > LEVEL:
            return float((np.array(shape.at) - middle) @ up)
    fields = [float(((shape.surface[0] - middle) @ up).min()) for shape in own if isinstance(shape, HeightField)]
    return min(fields) - below if fields else None


def _beside(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two directions across "up": right and away, such that right × away = up; along world axes as far as it goes."""
    world = np.eye(3)[np.argmin(abs(up))]
    right = world - (world @ up) * up
    right /= np.linalg.norm(right)
    return right, np.cross(up, right)
