"""Laws that jump at a value of the state: across one, derivatives of a motion lack the change of the time of the jump."""

import warnings

import numpy as np

from gauss.codegen import Expression, reachable
from gauss.dynamics.laws.constraint_functions import watched_functions
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.switching_times import jumps, of_time
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SwitchingWarning, user_level
from gauss.system import System


def warn_of_jumps(system: System, t: np.ndarray, x: np.ndarray):
    """Warn where a condition of a traced law, other than one of time, changes along a motion.

    Parameters
    ----------
    t, x : ndarray, shape (k,), (k, n_q + n_v)
        Times [s] and states of the motion.
    """
    crossed = {name: time for time, names in reversed(_crossings(system, t, x)) for name in names}
    if crossed:
        listed = ", ".join(f"{name!r} (t = {time:.6g} s)" for name, time in crossed.items())
        warnings.warn(
            f"scene {system.scene.name!r}: conditions of laws change along the motion: {listed}. Derivatives are right if "
            "the laws are continuous there; across a jump they lack the change of the time at which it happens.",
            SwitchingWarning,
            stacklevel=user_level(),
        )


def _crossings(system: System, t: np.ndarray, x: np.ndarray) -> list[tuple[float, list[str]]]:
    """Times [s] before which a condition changes, and the loads and constraints that ask for it."""
    functions = watched_functions(system, Laws(system))
    if functions.motion is None or not functions.outputs:
        return []
    state = functions.motion.state
    assert isinstance(state.t, Expression)
    nodes = _conditions(functions.outputs, state.t)
    symbols = [state.t, *state.q, *state.v]
    given = {symbol.index: Interval.point(values) for symbol, values in zip(symbols, [t, *x.T], strict=True)}
    with np.errstate(all="ignore"):
        found = [np.broadcast_to(value.low, t.shape) for value in enclose(nodes, given)]
    asking = [[name for name, law in functions.functions if node in reachable(law.outputs)] for node in nodes]
    changes = [
        (float(t[k + 1]), names)
        for names, values in zip(asking, found, strict=True)
        for k in np.flatnonzero(np.diff(values))
    ]
    return sorted(changes, key=lambda change: change[0])


def _conditions(outputs: list[Expression], clock: Expression) -> list[Expression]:
    """Conditions at which laws may jump, other than those of time."""
    timed = {node.index for node in of_time(outputs, clock)}
    return [node for node in reachable(outputs) if jumps(node) and node.index not in timed]
