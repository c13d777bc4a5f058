"""Linear-quadratic regulator of a linear model, and the modes that its inputs do not reach.

    u = −K x minimises ∫ xᵀ Q x + uᵀ R u dt,   K = R⁻¹ Bᵀ X,   Aᵀ X + X A − X B R⁻¹ Bᵀ X + Q = 0

Inputs reach the span of B, A B, A² B …; the model on its orthogonal complement holds the modes that they do not reach
(Kailath, Linear Systems, 1980, sec. 2.4 and 3.4).
"""

import numpy as np

from gauss.arguments import real_numbers
from gauss.errors import ArgumentError, SimulationError

ZERO = 1e-12  # length of a column of A x, relative to the largest entry of A, that is rounding
UNREACHED = 1e-9  # new directions of the reached space below this share are rounding


def unreached(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (k,) of the modes that inputs do not reach, and the combinations (n, k) of states that stay unreached."""
    size, reached, count = np.abs(A).max(initial=1e-300), _span(B, 0.0), -1
    while count < reached.shape[1] < len(A):
        count = reached.shape[1]
        reached = _span(np.hstack([reached, A @ reached / size]), ZERO)
    rest = np.linalg.svd(reached)[0][:, reached.shape[1] :]
    eigenvalues, vectors = np.linalg.eig(rest.T @ A @ rest)
    return eigenvalues, rest @ vectors


def _span(columns: np.ndarray, zero: float) -> np.ndarray:
    """Orthonormal basis of the span of columns; those no longer than ``zero`` are rounding."""
    lengths = np.linalg.norm(columns, axis=0)
    U, sizes, _ = np.linalg.svd(columns / np.where(lengths > zero, lengths, np.inf), full_matrices=False)
    return U[:, sizes > UNREACHED]


def gain(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Gain K (m, n) of the regulator; SimulationError if the Riccati equation has no stabilising solution."""
    from scipy.linalg import solve_continuous_are  # takes long to import

    try:
        X = solve_continuous_are(A, B, Q, R)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SimulationError(
            f"lqr: the Riccati equation has no stabilising solution ({error}); weigh what does not move the others in Q."
        ) from None
    return np.linalg.solve(R, B.T @ X)


def weights(given, usual: np.ndarray, what: str) -> np.ndarray:
    """Matrix of weights, of a matrix, of its diagonal, or the usual one of its diagonal.

    ArgumentError if it is no finite symmetric matrix of this size, or has a negative eigenvalue.
    """
    if given is None:
        return np.diag(usual)
    numbers = real_numbers(given)
    found = np.zeros(0) if numbers is None else numbers
    found = np.diag(found) if found.shape == usual.shape else found
    if found.shape != (usual.size, usual.size) or not np.isfinite(found).all() or not np.allclose(found, found.T):
        raise ArgumentError(
            f"lqr: {what}: expected a symmetric matrix {(usual.size,) * 2} or its diagonal, got {given!r:.80}."
        )
    if np.linalg.eigvalsh(found)[0] < -1e-12 * np.abs(found).max():
        raise ArgumentError(f"lqr: {what}: expected weights without negative eigenvalues, got {given!r:.80}.")
    return found
