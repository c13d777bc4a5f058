"""Inverse dynamics of systems with and without loops: drive forces τ of given accelerations.

For every virtual motion T that the constraints allow, inertia, loads and drives balance (virtual power):
Tᵀ(Φ a − f) = T_qᵀ (P + S τ). Reactions do no virtual power; with more drives than degrees of freedom Σ w τ² is least.
"""

from typing import NamedTuple

import numpy as np

from gauss.arguments import real_array
from gauss.backends.closure import Factor
from gauss.backends.motions import allowed
from gauss.backends.tree_factor import TreeFactor
from gauss.dynamics.assemble import assemble
from gauss.dynamics.projection import fixed_columns
from gauss.errors import StateError
from gauss.shapes import Shaped
from gauss.system import State, System

LARGEST_RESIDUAL = 1e-8  # of the constraints at acceleration level, relative to the accelerations
SINGULAR_VALUE_CUTOFF = 1e-10  # of the transmission from drives to degrees of freedom, relative to its largest entry
UNDRIVEN_SHARE = 1e-9  # of the generalised forces that may remain without a drive


class InverseDynamics(NamedTuple):
    """Drive forces of given accelerations in one state.

    Attributes
    ----------
    forces : ndarray, shape (k,)
        Effort along each driven rate [N m, N].
    drives : tuple of str
        Names of these rates, as in ``System.coordinates``.
    is_unique : bool
        Whether the drive forces are unique; else they have the least weighted sum of squares.
    """

    forces: Shaped[np.ndarray, " k"]
    drives: tuple[str, ...]
    is_unique: bool


def inverse_dynamics(system: System, state: State, acceleration, drives, weights=None) -> InverseDynamics:
    """Drive forces, beside the loads of the scene, of given accelerations in a state.

    Parameters
    ----------
    system : System
        The system, with or without loops.
    state : State
        Consistent state.
    acceleration : array_like, shape (n_v,)
        Accelerations of all joints [rad/s², m/s²]; they must satisfy the constraints.
    drives : sequence of str
        Joints, or single rates such as "U.angle1", that are driven.
    weights : array_like, shape (k,), optional
        Weight w > 0 of each driven rate: with more drives than degrees of freedom Σ w τ² is least; 1 by default.

    Returns
    -------
    InverseDynamics
        ``forces`` (k,), ``drives``, ``is_unique``.

    Raises
    ------
    StateError
        If the accelerations violate a constraint, or no drive forces give this motion, with the residual, or a gap of a
        unilateral constraint is closed.
    """
    columns = fixed_columns(system, drives)
    w = np.ones(len(columns)) if weights is None else real_array(weights, "weights")
    if not columns or w.shape != (len(columns),) or not (np.isfinite(w).all() and (w > 0).all()):
        raise StateError(
            f"drives and weights: expected names of joints and {len(columns)} weights > 0, got {drives!r}, {weights!r}."
        )
    qdd = system.state(v=acceleration).v
    compulsion = assemble(system, state)
    if compulsion.h.size:
        raise StateError(
            "gaps are closed in this state, and their forces are unknown, too; give a state with all of them open."
        )
    factor = Factor(compulsion)
    a = _body_accelerations(factor.tree, compulsion.D, qdd)
    _check_motion(compulsion, a, qdd)
    motions = allowed(factor)
    wanted = motions.a.T @ (compulsion.Phi * a - compulsion.impressed) - motions.rates.T @ compulsion.P
    transmission = motions.rates[columns].T / np.sqrt(w)
    U, sizes, Vt = np.linalg.svd(transmission, full_matrices=False)
    kept = sizes > SINGULAR_VALUE_CUTOFF * np.abs(motions.rates / np.sqrt(w.max())).max(initial=0.0)
    scaled = Vt[kept].T @ ((U[:, kept].T @ wanted) / sizes[kept])
    missing = np.linalg.norm(transmission @ scaled - wanted)
    scale = np.linalg.norm(motions.a.T @ compulsion.impressed) + np.linalg.norm(wanted)
    names = tuple(system.coordinates[k] for k in columns)
    if missing > UNDRIVEN_SHARE * scale:
        raise StateError(
            f"drives {', '.join(names)} cannot give this motion: a share of {missing / scale:.2g} of the forces acts on "
            f"degrees of freedom that they do not drive (of {motions.rates.shape[1]}); drive more joints."
        )
    return InverseDynamics(scaled / np.sqrt(w), names, int(kept.sum()) == len(columns))


def _body_accelerations(tree: TreeFactor, D: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Quasi-accelerations (6n,) of the bodies from the accelerations of the joints of the tree."""
    a = np.zeros(6 * tree.structure.n_bodies)
    for k, edge in enumerate(tree.structure.tree):
        step, here = tree.steps[k], slice(6 * edge.outer, 6 * edge.outer + 6)
        a[here] = step.A_inverse @ D[tree.rows[k]] + step.E @ qdd[tree.columns[k]]
        if step.X is not None:
            a[here] += step.X @ a[6 * edge.inner : 6 * edge.inner + 6]
    return a


def _check_motion(compulsion, a, qdd):
    _, residual, _ = compulsion.residuals(a, qdd, np.zeros(compulsion.D.size))
    scale = max(np.abs(a).max(), np.abs(compulsion.D).max(initial=0.0), np.abs(qdd).max(initial=0.0))
    worst = max(compulsion.structure.constraints, key=lambda c: np.abs(residual[c.rows]).max())
    amount = np.abs(residual[worst.rows]).max()
    if amount > LARGEST_RESIDUAL * scale:
        raise StateError(
            f"acceleration: constraint {worst.name!r} has a residual of {amount:.3g} m/s² or rad/s²; those of joints "
            "of a loop must fit together, as those of system.accelerations or of a simulated motion do."
        )
