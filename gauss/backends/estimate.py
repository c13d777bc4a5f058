"""Relative errors of accelerations, body by body and joint by joint.

The acceleration of a body is one length [m/s²]: √(k² |ω̇|² + |a|²), with k its radii of gyration. Its error is compared with
its own size, that of its free acceleration, or 10⁻³ of the largest acceleration of all bodies.
"""

from functools import cached_property

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.dual_certificate import LEAST_SHARE
from gauss.backends.solution import Answer

SUSPICIOUS_ERROR = 1e-12  # relative error above which the size that it is compared with is found more closely
SHARE_AT_REST = 1e-6  # of the acceleration by one reaction alone: its errors at rest are compared with that


class AccelerationScale:
    """Sizes that errors of the accelerations of one answer are relative to; what takes long is found when first needed."""

    def __init__(self, compulsion: Compulsion, answer: Answer):
        self.compulsion, self.answer, self.lengths = compulsion, answer, compulsion.gyrations
        self.size = np.maximum(_length(answer.a, self.lengths), _length(compulsion.a_free, self.lengths))

    @cached_property
    def by_one_reaction(self) -> np.ndarray:
        """Largest acceleration (n,) [m/s²] that the reaction of one constraint, or one drive, would give each body alone."""
        compulsion, multipliers = self.compulsion, self.answer.multipliers
        effort, bodies, forces = np.abs(compulsion.P), list[int](), list[np.ndarray]()
        for constraint, _, B_blocks in compulsion.blocks:
            for columns, B in zip(constraint.columns, B_blocks, strict=True):
                effort[columns] = np.maximum(effort[columns], np.abs(B.T @ multipliers[constraint.rows]))
        for constraint, A_blocks, B_blocks in compulsion.blocks:
            own = [multipliers[constraint.rows]]
            own += [B @ effort[columns] for columns, B in zip(constraint.columns, B_blocks, strict=True)]
            for body, A in zip(constraint.bodies, A_blocks, strict=True):
                bodies += [body] * len(own)
                forces += [A.T @ force for force in own]
        Phi, alone = compulsion.Phi.reshape(-1, 6)[bodies], np.array(forces).reshape(-1, 6)
        found = np.divide(alone, Phi, out=np.zeros_like(alone), where=Phi > 0)
        largest = np.zeros(compulsion.structure.n_bodies)
        np.fmax.at(largest, bodies, _length(found, self.lengths[bodies]))
        return largest

    def errors(self, correction, suspicious: float = SUSPICIOUS_ERROR) -> np.ndarray:
        """Size of a correction relative to the answer, see :func:`acceleration_errors`."""
        da, dqdd = correction[:2]
        size, change, joints = self.size, _length(da, self.lengths), np.abs(self.answer.qdd)
        bodies = _relative(change, size)
        if (bodies > suspicious).any():
            size = np.maximum(size, SHARE_AT_REST * self.by_one_reaction)
            bodies = _milder(bodies, _relative(change, size), suspicious)
        turned = _relative(np.abs(dqdd), joints)
        if (turned > suspicious).any():
            moved = np.maximum(LEAST_SHARE * size, SHARE_AT_REST * self.by_one_reaction)
            scale = np.maximum(joints, _carried(self.compulsion, moved))
            turned = _milder(turned, _relative(np.abs(dqdd), scale), suspicious)
        return np.concatenate([bodies, turned])


def acceleration_errors(
    compulsion: Compulsion, answer: Answer, correction, suspicious: float = SUSPICIOUS_ERROR
) -> np.ndarray:
    """Size of a correction relative to the answer, (n + p,): each body, then each joint coordinate.

    A joint coordinate is compared with its own acceleration; where that is small, as when a drive keeps its speed, with the
    joint acceleration that would move its bodies as fast as they accelerate, or as fast as counts for a body at rest. This
    takes longer, and is found for suspicious errors only.
    """
    return AccelerationScale(compulsion, answer).errors(correction, suspicious)


def _milder(strict: np.ndarray, mild: np.ndarray, suspicious: float) -> np.ndarray:
    """The mild measure where the strict one is suspicious, bounded below by the suspicious error.

    It grows with the correction, and errors of parts bound the error of their sum.
    """
    return np.minimum(strict, np.maximum(mild, suspicious))


def _carried(compulsion: Compulsion, size: np.ndarray) -> np.ndarray:
    """Acceleration (p,) of each joint coordinate that moves the bodies of its joint as fast as they accelerate."""
    needed, (coordinates, bodies, reach) = np.zeros(compulsion.P.size), compulsion.reaches
    moved = np.divide(size[bodies], reach, out=np.zeros_like(reach), where=reach > 0)
    np.maximum.at(needed, coordinates, moved)
    return needed


def _length(a: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    parts = a.reshape(-1, 6)
    return np.sqrt((lengths**2 * (parts[:, :3] ** 2).sum(axis=1)) + (parts[:, 3:] ** 2).sum(axis=1))


def _relative(error: np.ndarray, size: np.ndarray) -> np.ndarray:
    scale = np.maximum(size, LEAST_SHARE * size.max(initial=0.0))
    return np.divide(error, scale, out=np.where(error > 0, np.inf, 0.0), where=scale > 0)
