"""Starts of many motions: checked, and made consistent as far as that is rounding."""

import numpy as np

from gauss.dynamics.consistent_states import violations
from gauss.errors import StateError
from gauss.system import UNIT_QUATERNION, State, System

CONSISTENT = 1e-9  # residual, relative to the sizes of the rows and to the rates, below which a start meets the constraints


def columns(system: System, q0, v0) -> np.ndarray:
    """Starts (n_q + n_v, batch), their quaternions made unit as :meth:`gauss.System.state` does."""
    parts = []
    for name, given, size in (("q0", q0, system.n_q), ("v0", v0, system.n_v)):
        array = np.asarray(given, dtype=float)
        if array.ndim != 2 or array.shape[1] != size or not len(array) or not np.isfinite(array).all():
            raise StateError(f"{name}: expected finite numbers of shape (batch, {size}), got shape {array.shape}.")
        parts.append(array.T)
    if parts[0].shape[1] != parts[1].shape[1]:
        raise StateError(f"q0 and v0: expected as many starts of each, got {parts[0].shape[1]} and {parts[1].shape[1]}.")
    starts = np.concatenate(parts)
    for name, place in system.quaternions.items():
        lengths = np.linalg.norm(starts[place], axis=0)
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        if abs(lengths[worst] - 1.0) > UNIT_QUATERNION:
            where = f"q0: the quaternion (w, x, y, z) of joint {name!r} in start number {worst}"
            raise StateError(f"{where} has length {lengths[worst]:.6g}, not 1.")
        starts[place] /= lengths
    return starts


def check_gaps(system: System, starts: np.ndarray, gap: np.ndarray):
    """Refuse starts that do not meet the constraints."""
    worst = int(np.argmax(gap))
    if not gap[worst] <= CONSISTENT:
        off = violations(system, State(0.0, *np.split(starts[:, worst], [system.n_q])))
        words = "; ".join(f"{name!r} {amount}" for name, amount in list(off.items())[:4])
        where = f"q0 and v0: start number {worst} is off its constraints by {gap[worst]:.3g}: {words}"
        raise StateError(f"{where}. Take starts from system.initial_state(q, v).")
