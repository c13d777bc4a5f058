"""What stands against a target of inverse kinematics where it is not met: limits, and targets that come before it.

The pull g of a target, the gradient of its squared error, is balanced by limits and by other targets where no step lowers
the error (Nocedal and Wright, Numerical Optimization, 2006, ch. 12.3).
"""

import numpy as np
from scipy.optimize import nnls

from gauss.analysis.target import TargetRows
from gauss.analysis.target_levels import NEAR_SINGULAR
from gauss.analysis.target_problem import TargetProblem
from gauss.system import State

AT_LIMIT = 1e-7  # distance from a limit in units, below which it is active
LEAST_SHARE, LEAST_PART = 1e-6, 1e-3  # of the pull of a target, above which a limit, or a target, stands against it


def obstacles(problem: TargetProblem, state: State, rows: list[TargetRows], N: np.ndarray, k: int) -> tuple[str, ...]:
    """Limits and targets against the pull g of a target: g = Σ λ n + rest with λ ≥ 0 and the outward normals n of limits.

    Parameters
    ----------
    rows : list of TargetRows
        Rows of all targets there.
    N : ndarray, shape (n_v, m)
        Displacements that the constraints allow.
    k : int
        Number of the target.
    """
    gradients = [(one.jacobian @ N).T @ (one.weights / one.units**2 * one.error) for one in rows]
    pull, size = gradients[k], np.linalg.norm(gradients[k])
    whole = float(np.sqrt(sum(np.sum(gradient**2) for gradient in gradients)))
    if size <= LEAST_SHARE * max(whole, LEAST_SHARE):
        return ()
    rest, found = _less_limits(problem, state, N, pull)
    if np.linalg.norm(rest) <= LEAST_PART * size:
        return tuple(found)
    for other, own, gradient in zip(problem.targets, rows, gradients, strict=True):
        if other.level < problem.targets[k].level:  # it is met: its own pull is round-off
            against = np.linalg.norm(_within_rows(own.jacobian @ N / own.units[:, None], rest)) > LEAST_PART * size
        else:
            same = other.level == problem.targets[k].level
            against = same and gradient @ rest < -LEAST_SHARE * size * np.linalg.norm(gradient)
        if against:
            found.append(other.label)
    return tuple(found)


def _less_limits(problem: TargetProblem, state: State, N: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Rest (m,) of a pull that active limits do not balance, and the names of those that do."""
    active = problem.at_limits(state, AT_LIMIT)
    if not active:
        return pull, []
    normals = np.array([side * N[column] / problem.system.scale.coordinates[column] for column, side in active]).T
    forces, _ = nnls(normals, pull)
    least = LEAST_SHARE * np.linalg.norm(pull)
    names = [problem.limit_name(*limit) for limit, force in zip(active, forces, strict=True) if force > least]
    return pull - normals @ forces, names


def _within_rows(rows: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Projection of a vector (k,) on the row space of a matrix (m, k)."""
    _, sizes, Vt = np.linalg.svd(rows, full_matrices=False)
    basis = Vt[sizes > NEAR_SINGULAR * sizes.max(initial=0.0)]
    return basis.T @ (basis @ vector)
