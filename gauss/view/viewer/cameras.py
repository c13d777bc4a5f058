"""Cameras that look at the whole motion from a named direction."""

import numpy as np

from gauss.view.viewer.framing import FIELD, VIEW, Framing

SIDE_SHARE = 0.2  # of the reach of the motion: half the width of the controls
SHOWN_HEIGHT = 0.6  # of half an upright picture: height of what is seen, above controls that cover its lower part

CAMERAS = {  # from what is seen to the eye: right, away, up
    "oblique": VIEW,
    "front": np.array([0.0, -1.0, 0.0]),
    "side": np.array([1.0, 0.0, 0.0]),
    "top": np.array([0.0, -1e-3, 1.0]),  # straight from above no direction in the picture would be up
}


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
