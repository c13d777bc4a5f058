"""Cameras that look at the whole motion from a named direction."""

import numpy as np

from gauss.view.viewer.framing import VIEW, Framing

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
