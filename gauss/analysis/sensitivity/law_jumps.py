"""Laws that jump at a value of the state: across one, derivatives of a motion lack the change of the time of the jump."""

import warnings

import numpy as np

from gauss.codegen import Expression, reachable
from gauss.dynamics.laws.constraint_functions import watched_functions
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.switching_functions import JUMPS
from gauss.dynamics.laws.switching_times import of_time
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SwitchingWarning, user_level
from gauss.system import System


def warn_of_jumps(system: System, t: np.ndarray, x: np.ndarray):
    """Warn where a condition of a traced law, other than one of time, changes along a motion.

    Parameters
    ----------
    system : System
        The system.
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
    timed = {node.index for node in of_time(functions.outputs, state.t)}
    nodes = [node for node in reachable(functions.outputs) if node.op in JUMPS and node.index not in timed]
    symbols = [state.t, *state.q, *state.v]
    given = {symbol.index: Interval.point(values) for symbol, values in zip(symbols, [t, *x.T], strict=True)}
    with np.errstate(all="ignore"):
        found = [np.broadcast_to(value.low, t.shape) for value in enclose(nodes, given)]
    asking = {
        node.index: [name for name, function in functions.functions if node in reachable(function.outputs)] for node in nodes
    }
    changes = [
        (float(t[k + 1]), asking[node.index])
        for node, values in zip(nodes, found, strict=True)
        for k in np.flatnonzero(np.diff(values))
    ]
    return sorted(changes, key=lambda change: change[0])
