"""Load sharing of redundant joints: least elastic energy ½ Σ c λ² among all multipliers λ − L x of the same motion.

L is a basis of the null space of Kᵀ (redundancies), c are the compliances of the joints.
"""

import numpy as np

from gauss.arguments import real_numbers
from gauss.backends.closure import Factor
from gauss.backends.motions import allowed
from gauss.backends.solution import Solution
from gauss.dynamics.kinematics import Kinematics
from gauss.errors import SceneError, did_you_mean

UNDETERMINED = 1e-9  # entry of the remaining null space above which a multiplier is not unique


def shared(solution: Solution, motion: Kinematics, compliance: dict) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers (r,) of least elastic energy, and which of them (r,) are not unique.

    SceneError if a joint does not exist, or its compliances are not six numbers ≥ 0.

    Parameters
    ----------
    solution : Solution
        Solution of the sample.
    motion : Kinematics
        Kinematics of the sample.
    compliance : dict
        By joint: six compliances along the axes of the joint on its parent, z along the axis of the pair,
        of rotation [rad/(N m)] and translation [m/N]; joints that are not named are rigid.
    """
    from scipy.linalg import null_space  # a slow import

    L = allowed(Factor(solution.compulsion)).redundancies
    if not L.shape[1]:
        return solution.multipliers, np.zeros(len(solution.multipliers), dtype=bool)
    L = L / np.linalg.norm(L, axis=0)
    W = np.concatenate([_weighted(motion, name, values, len(L)) for name, values in compliance.items()])
    W = W / np.abs(W).max()
    x = np.linalg.lstsq(W @ L, W @ solution.multipliers, rcond=None)[0]
    undetermined = L @ null_space(W @ L)
    sizes = np.linalg.norm(undetermined, axis=1)
    return solution.multipliers - L @ x, sizes > UNDETERMINED


def _weighted(motion: Kinematics, name: str, values, r: int) -> np.ndarray:
    """Matrix (6, r) from λ to √c times the reaction along the axes of a joint."""
    system = motion.system
    if name not in system.scene.joints:
        raise SceneError(f"compliance: no joint {name!r}. {did_you_mean(name, system.scene.joints)}")
    c = real_numbers(values)
    if c is None or c.shape != (6,) or not np.isfinite(c).all() or (c < 0).any():
        raise SceneError(f"compliance of joint {name!r}: expected six numbers ≥ 0 [rad/(N m), m/N], got {values!r}.")
    joint = system.joint(name)
    R = motion.R[joint.parent] @ joint.R_parent
    rows = next(constraint.rows for constraint in system.structure.constraints if constraint.name == name)
    rows_of_root = np.zeros((6, r))
    rows_of_root[:3, rows.start : rows.start + 3] = np.sqrt(c[:3, None]) * R.T
    rows_of_root[3:, rows.start + 3 : rows.stop] = np.sqrt(c[3:, None]) * R.T
    return rows_of_root
