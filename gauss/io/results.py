"""Motions on disk: a compressed numpy archive that any numpy can read."""

from pathlib import Path

import numpy as np

from gauss.simulation import Trajectory


def write_npz(trajectory: Trajectory, path: Path) -> Path:
    """Write times, coordinates, rates, work, the names of the rates, and the positions of all bodies.

    Arrays: ``t`` (k,) [s], ``q`` (k, n_q), ``v`` (k, n_v), ``work`` (k, 3) [J] of drives, of forces, lost in dampers,
    ``coordinates`` (n_v,) names, ``bodies`` (n,) names, ``positions`` (k, n, 3) [m] of the body frames.
    """
    system = trajectory.system
    positions = [[motion.position(name) for name in system.structure.bodies] for motion in trajectory.motions]
    np.savez_compressed(
        path,
        scene=np.array(system.scene.name),
        t=trajectory.t,
        q=trajectory.q,
        v=trajectory.v,
        work=trajectory.work,
        coordinates=np.array(system.coordinates),
        bodies=np.array(system.structure.bodies),
        positions=np.array(positions),
    )
    return path
