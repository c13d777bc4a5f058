"""Cameras: positions from which a motion fills the picture, and height of the floor."""

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
SIDE_SHARE = 0.2  # of the reach of the motion: half the width of the controls
SHOWN_HEIGHT = 0.6  # of half an upright picture: height of what is seen, above controls that cover its lower part

CAMERAS = {  # from what is seen to the eye: right, away, up
    "oblique": VIEW,
    "front": np.array([0.0, -1.0, 0.0]),
    "side": np.array([1.0, 0.0, 0.0]),
    "top": np.array([0.0, -1e-3, 1.0]),  # straight from above no direction in the picture would be up
}


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


def eye(view: Framing, camera: str) -> np.ndarray:
    """Position (3,) of a camera of :data:`CAMERAS` [m], as far from the middle as the first one."""
    direction = CAMERAS[camera] @ np.stack([view.right, view.away, view.up])
    return view.middle + np.linalg.norm(view.eye - view.middle) * direction / np.linalg.norm(direction)


def placed_camera(view: Framing, camera: str, aspect: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) of a camera, and the point (3,) that it looks at [m], in a picture of some width over its height.

    In an upright picture, as of a telephone, it stands so far away that the width holds the motion, which is seen above the
    controls; else these stand on its right.
    """
    place, aim = eye(view, camera), view.middle
    if aspect >= 1.0:
        return shifted(view, place, aim)
    ahead = (aim - place) / aspect
    distance = np.linalg.norm(ahead)
    up = view.up - (view.up @ ahead) / distance**2 * ahead
    lower = SHOWN_HEIGHT * np.tan(FIELD / 2) * distance / np.linalg.norm(up) * up
    level = CAMERAS[camera][2] == 0.0  # lower, it would stand under the floor: it looks down instead
    return aim - ahead - (0.0 if level else lower), aim - lower


def shifted(view: Framing, place: np.ndarray, aim: np.ndarray, share: float = SIDE_SHARE) -> tuple[np.ndarray, np.ndarray]:
    """Camera and what it looks at, moved to the right by a share of the size of what is seen."""
    right = np.cross(aim - place, view.up)
    shift = share * view.reach * right / np.linalg.norm(right)
    return place + shift, aim + shift
