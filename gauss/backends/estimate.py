"""Relative errors of accelerations, body by body and joint by joint.

The acceleration of a body is one length [m/s²]: √(k² |ω̇|² + |a|²), with k its radii of gyration. Its error is compared with
its own size, that of its free acceleration, or 10⁻³ of the largest acceleration of all bodies.
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.dual_certificate import LEAST_SHARE
from gauss.backends.solution import Answer

SUSPICIOUS_ERROR = 1e-12  # relative error above which the size that it is compared with is found more closely
SHARE_AT_REST = 1e-6  # of the acceleration by one reaction alone: its errors at rest are compared with that


def acceleration_errors(
    compulsion: Compulsion, answer: Answer, correction, suspicious: float = SUSPICIOUS_ERROR
) -> np.ndarray:
    """Size of a correction relative to the answer, (n + p,): each body, then each joint coordinate.

    A joint coordinate is compared with its own acceleration; where that is small, as when a drive keeps its speed, with the
    joint acceleration that would move its bodies as fast as they accelerate, or as fast as counts for a body at rest. This
    takes longer, and is found for suspicious errors only.
    """
    da, dqdd = correction[:2]
    lengths = gyration(compulsion.Phi)
    size = np.maximum(_length(answer.a, lengths), _length(compulsion.a_free, lengths))
    bodies = _relative(_length(da, lengths), size)
    if (bodies > suspicious).any():
        size = np.maximum(size, SHARE_AT_REST * accelerations_by_one_reaction(compulsion, answer))
        bodies = _milder(bodies, _relative(_length(da, lengths), size), suspicious)
    joints = _relative(np.abs(dqdd), np.abs(answer.qdd))
    if (joints > suspicious).any():
        moved = np.maximum(LEAST_SHARE * size, SHARE_AT_REST * accelerations_by_one_reaction(compulsion, answer))
        scale = np.maximum(np.abs(answer.qdd), _carried(compulsion, moved, lengths))
        joints = _milder(joints, _relative(np.abs(dqdd), scale), suspicious)
    return np.concatenate([bodies, joints])


def _milder(strict: np.ndarray, mild: np.ndarray, suspicious: float) -> np.ndarray:
    """The mild measure where the strict one is suspicious, bounded below by the suspicious error.

    It grows with the correction, and errors of parts bound the error of their sum.
    """
    return np.minimum(strict, np.maximum(mild, suspicious))


def accelerations_by_one_reaction(compulsion: Compulsion, answer: Answer) -> np.ndarray:
    """Largest acceleration (n,) [m/s²] that the reaction of one constraint, or one drive, would give each body by itself."""
    blocks, lengths = list(compulsion.blocks), gyration(compulsion.Phi)
    effort = np.abs(compulsion.P)
    for constraint, _, B_blocks in blocks:
        for columns, B in zip(constraint.columns, B_blocks, strict=True):
            effort[columns] = np.maximum(effort[columns], np.abs(B.T @ answer.multipliers[constraint.rows]))
    largest = np.zeros(compulsion.structure.n_bodies)
    for constraint, A_blocks, B_blocks in blocks:
        forces = [answer.multipliers[constraint.rows]]
        forces += [B @ effort[columns] for columns, B in zip(constraint.columns, B_blocks, strict=True)]
        for body, A in zip(constraint.bodies, A_blocks, strict=True):
            Phi = compulsion.Phi[6 * body : 6 * body + 6]
            alone = [np.divide(A.T @ force, Phi, out=np.zeros(6), where=Phi > 0) for force in forces]
            largest[body] = max(largest[body], *(_length(a, lengths[body : body + 1])[0] for a in alone))
    return largest


def _carried(compulsion: Compulsion, size: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Acceleration (p,) of each joint coordinate that moves the bodies of its joint as fast as they accelerate."""
    needed = np.zeros(compulsion.P.size)
    for constraint, A_blocks, B_blocks in compulsion.blocks:
        if not constraint.bodies or constraint.rows.stop - constraint.rows.start != 6:
            continue
        for columns, B in zip(constraint.columns, B_blocks, strict=True):
            turn, slide = np.linalg.norm(B[:3], axis=0), np.linalg.norm(B[3:], axis=0)
            for body, A in zip(constraint.bodies, A_blocks, strict=True):
                lever = np.linalg.norm(A[3:, :3], 2)  # of the joint point about the centre of mass
                reach = np.hypot(lengths[body], lever) * turn + slide
                moved = np.divide(size[body], reach, out=np.zeros_like(reach), where=reach > 0)
                needed[columns] = np.maximum(needed[columns], moved)
    return needed


def gyration(Phi: np.ndarray) -> np.ndarray:
    """Radius of gyration of each body [m]; 1 m for a body without mass."""
    parts = Phi.reshape(-1, 6)
    mass = parts[:, 3]
    mean = parts[:, :3].sum(axis=1) / 2
    return np.sqrt(np.divide(mean, mass, out=np.ones_like(mass), where=mass > 0))


def _length(a: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    parts = a.reshape(-1, 6)
    return np.sqrt((lengths**2 * (parts[:, :3] ** 2).sum(axis=1)) + (parts[:, 3:] ** 2).sum(axis=1))


def _relative(error: np.ndarray, size: np.ndarray) -> np.ndarray:
    scale = np.maximum(size, LEAST_SHARE * size.max(initial=0.0))
    return np.divide(error, scale, out=np.where(error > 0, np.inf, 0.0), where=scale > 0)
