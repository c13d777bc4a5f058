"""Initial states of a batch: their shapes, unit quaternions and consistency are checked."""

import numpy as np

from gauss.arguments import real_numbers
from gauss.dynamics.consistent_states import violations
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.errors import StateError
from gauss.simulation.held_inputs import numbers_in_words
from gauss.system import UNIT_QUATERNION, State, System

CONSISTENT = 1e-9  # largest residual, relative to the sizes of the constraints and to the rates, of a consistent state


def columns(system: System, q0, v0) -> np.ndarray:
    """Initial states (n_q + n_v, batch) with quaternions normalised as by :meth:`gauss.System.state`.

    StateError if shapes are wrong, a number is not finite, or a quaternion is not of unit length.
    """
    parts = []
    for name, given, size in (("q0", q0, system.n_q), ("v0", v0, system.n_v)):
        array = real_numbers(given)
        if array is None or array.ndim != 2 or array.shape[1] != size or not len(array) or not np.isfinite(array).all():
            raise StateError(f"{name}: expected finite numbers of shape (batch, {size}), got {numbers_in_words(array)}.")
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


def refuse_inconsistent(system: System, starts: np.ndarray, residual: np.ndarray):
    """Raise a StateError if an initial state violates the constraints, given the residuals (batch,)."""
    worst = int(np.argmax(residual))
    refuse_other_pose(system, starts[: system.n_q])
    if not residual[worst] <= CONSISTENT:
        state = State(0.0, *np.split(starts[:, worst], [system.n_q]))
        off = violations(system, state)
        words = "; ".join(f"{name!r} {amount}" for name, amount in list(off.items())[:4])
        where = f"q0 and v0: start number {worst} has a constraint residual of {residual[worst]:.3g}: {words}"
        raise StateError(f"{where}. Take starts from system.initial_state(q, v).")
