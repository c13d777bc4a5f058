"""Mechanisms on which methods differ, built in code; the gentle ones are shipped models."""

import numpy as np

from gauss.scene import Scene


def chain(masses, length: float = 1.0, gravity: float = 9.81) -> Scene:
    """Spatial chain of rods of given masses and one length, axes z, x, y in turn; all frames are exact.

    Other units than metres and kilograms come with the length, the masses and the gravity.
    """
    scene, previous = Scene("chain", gravity=(0, 0, -gravity)), "ground"
    for i, mass in enumerate(masses):
        moments = tuple(mass * length**2 * np.array([0.02, 1 / 12, 1 / 12]))
        place = {"on": previous, "position": (length if i else 0.0, 0, 0)}
        scene.body(f"link{i}", mass, moments, com=(length / 2, 0, 0), **place)
        scene.revolute(f"joint{i}", previous, f"link{i}", axis=np.roll((0, 0, 1), i), frame=f"link{i}")
        previous = f"link{i}"
    return scene
