"""Standard parameters that some body can have, nearest to measured base parameters: pseudo-inertia matrices P ⪰ 0.

With h the first moments and I the inertia about the origin, P = [½ tr(I) 1 − I, h; hᵀ, m] is the second moment of the mass
density in homogeneous coordinates: P ⪰ 0 if and only if a distribution of mass has these parameters (Wensing, Kim, Slotine,
Linear matrix inequalities for physically consistent inertial parameter identification, IEEE RA-L 3(1), 2018). The
least-squares problem with these cones is solved by Clarabel.
"""

import numpy as np
from scipy import linalg, sparse

from gauss.dynamics.inertial_regressor import STANDARD
from gauss.errors import SimulationError, extra

PRIOR_SHARE = 0.01  # of the smallest singular value of the rows: the guess weighs less than what is measured
LEAST_WEIGHT = 1e-12  # of the guess, relative to the largest row
SOLVER_TOLERANCE = 1e-10  # relative
LARGEST_NEGATIVE = 1e-12  # eigenvalue of P that is round-off, relative to its trace
N_STANDARD = len(STANDARD)
ENTRIES = tuple((i, k) for k in range(4) for i in range(k + 1))  # of the upper triangle by columns, as Clarabel's cones


def pseudo_inertia(parameters) -> np.ndarray:
    """P (4, 4) of ten standard parameters."""
    m, x, y, z, xx, yy, zz, xy, xz, yz = parameters
    half = (xx + yy + zz) / 2.0
    return np.array([[half - xx, -xy, -xz, x], [-xy, half - yy, -yz, y], [-xz, -yz, half - zz, z], [x, y, z, m]])


def of_pseudo_inertia(P) -> np.ndarray:
    """Standard parameters (10,) of P (4, 4)."""
    moments = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    return np.array([P[3, 3], *P[:3, 3], *np.diag(moments), moments[0, 1], moments[0, 2], moments[1, 2]])


def is_consistent(parameters: np.ndarray, n_bodies: int) -> bool:
    """Whether bodies can have standard parameters (p,), and friction after them is not negative."""
    for own in parameters[: N_STANDARD * n_bodies].reshape(-1, N_STANDARD):
        P = pseudo_inertia(own)
        if np.linalg.eigvalsh(P)[0] < -LARGEST_NEGATIVE * max(np.trace(P), 0.0):
            return False
    return bool((parameters[N_STANDARD * n_bodies :] >= 0.0).all())


def nearest_consistent(rows: np.ndarray, right: np.ndarray, prior: np.ndarray, n_bodies: int) -> np.ndarray:
    """Parameters that bodies can have of least ‖rows π − right‖², among these nearest to a guess.

    Where bodies meet the rows, the distance of the other directions from the guess is least; else that of rows, with a small
    weight of that distance.

    SimulationError if the solver ends without a solution.

    Parameters
    ----------
    rows, right : ndarray, shape (r, p), (r,)
        Independent rows, in units of their noise; parameters in the units of the scene.
    prior : ndarray, shape (p,)
        The guess.
    n_bodies : int
        Number of bodies; friction follows their parameters.

    Returns
    -------
    ndarray, shape (p,)
        Parameters whose pseudo-inertias are positive semidefinite.
    """
    U, sizes, V = np.linalg.svd(rows)
    r, size = len(right), sizes[0]
    measured, free = V[:r], V[r:]
    found, _ = _solved(free, free @ prior, np.ones(len(free)), measured, U.T @ right / sizes, n_bodies)
    if found is None:
        weight = max(LEAST_WEIGHT, (PRIOR_SHARE * sizes[-1] / size) ** 2)
        weights = np.concatenate([np.ones(r), np.full(len(free), weight)])
        both, target = np.concatenate([rows / size, free]), np.concatenate([right / size, free @ prior])
        found, status = _solved(both, target, weights, np.zeros((0, len(prior))), np.zeros(0), n_bodies)
    if found is None:
        raise SimulationError(f"identify: consistent inertias: Clarabel ends with {status}.")
    return _rounded(found, n_bodies)


def _solved(rows, right, weights, equal, values, n_bodies: int) -> tuple[np.ndarray | None, str]:
    """Parameters of least Σ w (rows π − right)² with equal π = values, P ⪰ 0, friction ≥ 0; the status of the solver."""
    with extra():
        import clarabel

    (r, p), n_equal = rows.shape, len(equal)
    n_friction = p - N_STANDARD * n_bodies
    cone = linalg.block_diag(*[_triangle()] * n_bodies, np.eye(n_friction))
    A = np.concatenate([np.block([[rows, -np.eye(r)]]), np.pad(equal, ((0, 0), (0, r))), np.pad(-cone, ((0, 0), (0, r)))])
    b = np.concatenate([right, values, np.zeros(len(cone))])
    P = sparse.diags(np.concatenate([np.zeros(p), weights])).tocsc()
    cones = [clarabel.ZeroConeT(r + n_equal), *[clarabel.PSDTriangleConeT(4)] * n_bodies]
    cones += [clarabel.NonnegativeConeT(n_friction)] if n_friction else []
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = SOLVER_TOLERANCE
    result = clarabel.DefaultSolver(P, np.zeros(p + r), sparse.csc_matrix(A), b, cones, settings).solve()
    is_solved = result.status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
    return (np.array(result.x)[:p] if is_solved else None), str(result.status)


def _triangle() -> np.ndarray:
    """Matrix (10, 10) from the parameters of a body to the entries of P, those off the diagonal by √2."""
    units = [pseudo_inertia(unit) for unit in np.eye(N_STANDARD)]
    return np.array([[P[i, k] * (1.0 if i == k else np.sqrt(2.0)) for P in units] for i, k in ENTRIES])


def _rounded(parameters: np.ndarray, n_bodies: int) -> np.ndarray:
    """Parameters without negative eigenvalues of P and negative friction, which the tolerance of the solver leaves."""
    found, end = np.maximum(parameters, 0.0), N_STANDARD * n_bodies
    for k in range(0, end, N_STANDARD):
        sizes, axes = np.linalg.eigh(pseudo_inertia(parameters[k : k + N_STANDARD]))
        found[k : k + N_STANDARD] = of_pseudo_inertia(axes * np.maximum(sizes, 0.0) @ axes.T)
    return found
