"""Inverse dynamics, loops included: the drive forces that a given motion takes.

Along every motion T that the constraints allow, inertia, loads and drives balance (virtual power):
Tᵀ(Φ a − f) = T_qᵀ (P + S τ). Reactions do not enter; with more drives than freedoms the least weighted Σ w τ² is taken.
"""

from typing import NamedTuple

import numpy as np

from gauss.backends.motions import allowed
from gauss.backends.recursion import Factor, Tree
from gauss.dynamics.assemble import assemble
from gauss.dynamics.projection import fixed_columns
from gauss.errors import StateError
from gauss.shapes import Shaped
from gauss.system import State, System

MET = 1e-8  # how far, relative to the accelerations, a motion may miss the constraints
RANK = 1e-10  # of the drives' grip on the freedoms
UNDRIVEN = 1e-9  # share of the largest generalised force that may be left without a drive


class InverseDynamics(NamedTuple):
    """Drive forces of one instant.

    Attributes
    ----------
    forces : ndarray, shape (k,)
        Effort along each driven rate [N m, N].
    drives : tuple of str
        Names of these rates, as in ``System.coordinates``.
    is_unique : bool
        Whether no other drive forces give this motion; where others do, these have the least weighted sum of squares.
    """

    forces: Shaped[np.ndarray, " k"]
    drives: tuple[str, ...]
    is_unique: bool


def inverse_dynamics(system: System, state: State, acceleration, drives, weights=None) -> InverseDynamics:
    """Drive forces that give a state certain accelerations, besides the loads of the scene.

    Parameters
    ----------
    system : System
        The system, with loops or without.
    state : State
        Consistent state.
    acceleration : array_like, shape (n_v,)
        Accelerations of all joints [rad/s², m/s²]; they must meet the constraints.
    drives : sequence of str
        Joints, or single rates such as "U.angle1", that are driven.
    weights : array_like, shape (k,), optional
        Weight w > 0 of each driven rate: with more drives than freedoms Σ w τ² is least; 1 when not given.

    Returns
    -------
    InverseDynamics
        ``forces`` (k,), ``drives``, ``is_unique``.

    Raises
    ------
    StateError
        If the accelerations miss a constraint, or the drives cannot give this motion (the message says by how much), or a
        gap of a one-sided constraint is closed.
    """
    columns = fixed_columns(system, drives)
    w = np.ones(len(columns)) if weights is None else np.asarray(weights, dtype=float)
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
    grip = motions.rates[columns].T / np.sqrt(w)
    U, sizes, Vt = np.linalg.svd(grip, full_matrices=False)
    live = sizes > RANK * np.abs(motions.rates / np.sqrt(w.max())).max(initial=0.0)
    scaled = Vt[live].T @ ((U[:, live].T @ wanted) / sizes[live])
    missing = np.linalg.norm(grip @ scaled - wanted)
    scale = np.linalg.norm(motions.a.T @ compulsion.impressed) + np.linalg.norm(wanted)
    names = tuple(system.coordinates[k] for k in columns)
    if missing > UNDRIVEN * scale:
        raise StateError(
            f"drives {', '.join(names)} cannot give this motion: a share of {missing / scale:.2g} of the forces it takes is "
            f"left to freedoms that they do not move ({motions.rates.shape[1]} freedoms); drive more joints."
        )
    return InverseDynamics(scaled / np.sqrt(w), names, int(live.sum()) == len(columns))


def _body_accelerations(tree: Tree, D: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Quasi-accelerations (6n,) of the bodies when the joints of the tree accelerate as given."""
    a = np.zeros(6 * tree.structure.n_bodies)
    for k, edge in enumerate(tree.structure.tree):
        step, here = tree.steps[k], slice(6 * edge.outer, 6 * edge.outer + 6)
        a[here] = step.A_inverse @ D[tree.rows[k]] + step.E @ qdd[tree.columns[k]]
        if step.X is not None:
            a[here] += step.X @ a[6 * edge.inner : 6 * edge.inner + 6]
    return a


def _check_motion(compulsion, a, qdd):
    _, missed, _ = compulsion.residuals(a, qdd, np.zeros(compulsion.D.size))
    scale = max(np.abs(a).max(), np.abs(compulsion.D).max(initial=0.0), np.abs(qdd).max(initial=0.0))
    worst = max(compulsion.structure.constraints, key=lambda c: np.abs(missed[c.rows]).max())
    amount = np.abs(missed[worst.rows]).max()
    if amount > MET * scale:
        raise StateError(
            f"acceleration: it misses constraint {worst.name!r} by {amount:.3g} m/s² or rad/s²; accelerations of all joints "
            "of a loop must fit together, as those of system.accelerations or of a simulated motion do."
        )
