"""Doubts about the forces of a step: jams, in which forces move nothing, and Painlevé's paradox of sliding contacts."""

import numpy as np

from gauss.dynamics.contact.impact import jammed_error
from gauss.dynamics.contact.mechanism_rows import StepRows
from gauss.dynamics.contact.paradox import Paradox, sliding, undetermined_sliding

JAMMED_RESPONSE = 1e-12  # response along a contact, relative to that of single coordinates: loops forbid its motion


def refuse_jam(t: float, rows: StepRows, H: np.ndarray, inertia: np.ndarray, force, after, name):
    """Raise a SimulationError if normal forces move nothing, because the loop constraints forbid it.

    Parameters
    ----------
    t : float
        Time [s].
    H, inertia : ndarray, shape (n_v, n_v), (n_v,)
        Compliance, and the diagonal of the mass matrix.
    force, after : ndarray, shape (n,)
        Forces, and rates after the step without them.
    name : callable
        Row → name of its gap.
    """
    m = rows.gap.size
    pushed = np.flatnonzero(force[:m])
    K = rows.K[pushed]
    alone = K**2 @ np.where(inertia > 0.0, 1.0 / np.where(inertia > 0.0, inertia, 1.0), 0.0)
    held = pushed[((K @ H) * K).sum(axis=1) <= JAMMED_RESPONSE * alone]
    if held.size:
        raise jammed_error(f"t = {t:.6g} s", [name(int(k)) for k in held], float((-after / rows.unit)[held].max()))


def paradoxes_of_step(rows: StepRows, H: np.ndarray, acceleration: np.ndarray, force, slow: float, name) -> list[Paradox]:
    """Painlevé's paradoxes of the closed contacts.

    Parameters
    ----------
    H, acceleration : ndarray, shape (n_v, n_v), (n_v,)
        Compliance, and accelerations without contact forces.
    force : ndarray, shape (n,)
        Forces.
    slow : float
        Tangential speed below which a contact may stick, in units of the scene.
    name : callable
        Row → name of its gap.
    """
    if not rows.rough.size:
        return []
    m = rows.gap.size
    across = m + np.arange(2 * rows.rough.size).reshape(-1, 2)
    which = sliding(rows.rate[across], force[rows.rough] > 0.0, slow)
    if not which.size:
        return []
    normal, across = rows.rough[which], across[which]
    responses = rows.K[normal] @ H
    smooth, sideways = responses @ rows.K[normal].T, (responses @ rows.K[across.ravel()].T).reshape(which.size, -1, 2)
    b = rows.K[normal] @ acceleration + rows.bias[normal]
    names = [name(int(row)) for row in normal]
    return undetermined_sliding(names, rows.friction[which], rows.rate[across], smooth, sideways, b)
