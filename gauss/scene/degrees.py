"""Warnings of starts that were perhaps meant in degrees, or lie beyond the limits of their joint."""

import warnings
from math import pi, radians

import numpy as np

from gauss.errors import StartWarning, user_level
from gauss.scene.joint import Joint
from gauss.scene.loads import Start

ANGULAR_COORDINATES = {"revolute": (0,), "screw": (0,), "cylindrical": (0,), "universal": (0, 1), "planar": (2,)}
LARGEST_ANGLE = 4 * pi  # rad: more than two turns are mostly degrees


def warn_of_start(start: Start, joint: Joint):
    """Warn of a start beyond the limits of its joint, which is moved to them, and of an angle of more than two turns.

    Warns
    -----
    StartWarning
        With what the number would be in degrees.
    """
    if start.position is None:
        return
    position = np.ravel(start.position)
    what, angles = f"start of joint {joint.name!r}", ANGULAR_COORDINATES.get(joint.kind, ())
    if joint.limits is not None and not joint.limits[0] <= position[0] <= joint.limits[1]:
        low, high = joint.limits
        unit = "rad" if angles else "m"
        hint = f" {_in_radians(position[0])}" if angles and low <= radians(position[0]) <= high else ""
        said = f"{what}: {position[0]:g} {unit} is beyond its limits, {low:g} to {high:g} {unit}, where it starts instead."
        warnings.warn(said + hint, StartWarning, stacklevel=user_level())
        return
    for k in angles:
        if position.size > k and abs(position[k]) > LARGEST_ANGLE:
            said = f"{what}: {position[k]:g} rad are {position[k] / (2 * pi):.3g} turns. {_in_radians(position[k])}"
            warnings.warn(said, StartWarning, stacklevel=user_level())


def _in_radians(degrees: float) -> str:
    return f"If degrees were meant: np.deg2rad({degrees:g}) = {radians(degrees):.6g}."
