"""Scenes of long runs, the conserved part of their momentum, and trends beside noise."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import gauss
from gauss.dynamics.kinematics import kinematics


class LongRun(NamedTuple):
    """A scene without loads, and the axes of space about which its angular momentum is conserved."""

    build: Callable[[], gauss.Scene]
    axes: tuple[int, ...] = ()


def asymmetric_top() -> gauss.Scene:
    """Body of three unlike moments of inertia on a ball joint, its centre of mass on none of its axes, let go in a spin."""
    scene = gauss.Scene("asymmetric top", gravity=(0, 0, -9.81))
    scene.body("top", mass=1.3, inertia=(0.02, 0.035, 0.025), com=(0.02, -0.03, 0.4))
    scene.ball("tip", "ground", "top")
    scene.start("tip", (np.cos(0.3), np.sin(0.3), 0.0, 0.0), rate=(1.0, -2.0, 12.0))
    return scene


VERTICAL, ALL = (2,), (0, 1, 2)
SCENES = {
    "double_pendulum": LongRun(lambda: gauss.load("double_pendulum")),
    "four_bar": LongRun(lambda: gauss.load("four_bar")),
    "heavy_top": LongRun(lambda: gauss.load("heavy_top"), VERTICAL),
    "asymmetric_top": LongRun(asymmetric_top, VERTICAL),
    "free_body": LongRun(lambda: gauss.load("free_body"), ALL),
    "spatial_double_pendulum": LongRun(lambda: gauss.load("spatial_double_pendulum"), VERTICAL),
}


def angular_momentum(motion: gauss.Trajectory) -> np.ndarray:
    """Angular momentum (len(motion), 3) [kg m²/s] of all bodies about the origin, in the axes of space."""
    system, found = motion.system, []
    inertia = system.Phi.reshape(-1, 6)
    for q, v in zip(motion.q, motion.v, strict=True):
        here = kinematics(system, system.state(q, v))
        spins = [here.R[i] @ (own[:3] * (here.R[i].T @ here.W[i])) for i, own in enumerate(inertia)]
        orbits = [own[3] * np.cross(here.x[i], here.u[i]) for i, own in enumerate(inertia)]
        found.append(np.sum(spins + orbits, axis=0))
    return np.array(found)


def momentum_error(motion: gauss.Trajectory, axes: tuple[int, ...]) -> float:
    """Largest change of the conserved momentum, relative to its size; no number if none is conserved."""
    if not axes:
        return np.nan
    momentum = angular_momentum(motion)[:, axes]
    return float(np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0]))


def energy_error(motion: gauss.Trajectory) -> np.ndarray:
    """Energy (len(motion),) less that of the start, relative to the scale of the energies."""
    found = gauss.energy(motion)
    off = (found.kinetic + found.potential) / found.scale
    return off - off[0]


def trend(t: np.ndarray, values: np.ndarray, blocks: int = 20) -> tuple[float, float]:
    """Change over the whole time by the least-squares line, and the standard error of that.

    The line goes through the means of blocks, which are all but independent where single samples are not.
    """
    means = np.array([[part.mean() for part in np.array_split(x, blocks)] for x in ((t - t[0]) / (t[-1] - t[0]), values)])
    slope, start = np.polyfit(means[0], means[1], 1)
    left = means[1] - start - slope * means[0]
    scatter = np.sqrt(left @ left / (blocks - 2))
    return float(slope), float(scatter / np.sqrt(np.sum((means[0] - means[0].mean()) ** 2)))
