"""Terms of the equations of motion as compiled functions: inverse dynamics M q̈ + h, loop constraints c, J, γ."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.codegen import Function, Interface, PythonWrapper, entry_code, fastcall, write
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import inverse_dynamics as traced_inverse_dynamics
from gauss.dynamics.mechanism import loop_constraints
from gauss.dynamics.store import cached, cached_on_disk
from gauss.dynamics.traced_system import FINITE, applied_loads, off_unit
from gauss.errors import SimulationError, StateError
from gauss.system import State, System

INVERSE = """Generalised forces (n_v,) that accelerations take besides the loads of the scene, in machine code.

Parameters
----------
q, v, acceleration : ndarray, shape (n_q,), (n_v,), (n_v,)
    Coordinates (quaternions of unit length), rates, accelerations of all joints.
out : ndarray, shape (n_v,), optional
    Array for the result.
t : float
    Time [s].

Raises
------
StateError
    If an argument does not fit.
"""
ROWS = "Residual, Jacobian row by row, and bias of the loop constraints, one after the other."


class LoopConstraintKernel:
    """Loop constraints of one system: called with (q, v, t=0.0), returns c (r,), J (r, n_v), γ (r,).

    Parameters
    ----------
    system : System
        The system.
    """

    def __init__(self, system: System):
        self.n_v = system.n_v

        def rows(q, v, t):
            c, J, gamma = loop_constraints(system, q, v, t[0])
            return c, J.ravel(), gamma, _input_errors(system, q, v, t)

        make = lambda: write(rows, system.n_q, system.n_v, 1)  # noqa: E731
        self.compiled = _compiled(system, "closing_rows", (LoopConstraintKernel,), make, ("q", "v"), ROWS)

    def __call__(self, q, v, t: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual [rad, m], Jacobian and bias."""
        found = self.compiled(q, v, None, t)
        r = len(found) // (self.n_v + 2)
        return found[:r], found[r : r + r * self.n_v].reshape(r, self.n_v), found[len(found) - r :]


def inverse_dynamics(system: System) -> Callable:
    """Compiled function (q, v, acceleration, out=None, t=0.0) → generalised forces (n_v,).

    Raises
    ------
    SimulationError
        If the law of a load cannot be compiled.
    """
    laws = Laws(system)
    if laws.reasons:
        words = "; ".join(f"the law of {name!r} cannot be traced ({why})" for name, why in laws.reasons.items())
        raise SimulationError(f"inverse dynamics of scene {system.scene.name!r} cannot be compiled: {words}.")

    def forces(q, v, acceleration, t):
        own, on_bodies, _ = applied_loads(system, laws.traced, State(t[0], q, v))
        return traced_inverse_dynamics(system, q, v, acceleration, own, on_bodies, t[0]), _input_errors(
            system, q, v, t, acceleration
        )

    def make():
        trace, names = lambda: write(forces, system.n_q, system.n_v, system.n_v, 1), ("q", "v", "acceleration")
        return _compiled(system, "inverse_dynamics", (inverse_dynamics, laws.key), trace, names, INVERSE)

    return cached(system, (inverse_dynamics, laws.key), make)


def _input_errors(system: System, q, v, t, *others) -> list:
    """Error of the quaternions, and a sum of all inputs that is finite only if each is."""
    return [off_unit(system, q), sum(np.abs(part).sum() for part in (q, v, t, *others))]


def _compiled(system: System, name: str, key: tuple, trace: Callable[[], Function], names, doc: str) -> Callable:
    sizes = {given: system.n_q if given == "q" else system.n_v for given in names}

    def normalised(given):
        q, v, *others, t = interface.split(given)
        state = system.state(q, v, t)
        if not all(np.isfinite(part).all() for part in (*others, t)) or np.array_equal(state.q, q):
            raise StateError(f"{name}: expected finite numbers, got {others or v} at t = {t}.")
        return run(state.q, state.v, *others, None, t)

    interface = Interface(sizes, "t", limits=(RESIDUAL_TOLERANCE, FINITE))
    entry = cached_on_disk(system, (entry_code, *key), lambda: entry_code(trace(), interface))
    fallback = PythonWrapper(
        normalised, replace(interface, limits=()), entry.outputs - len(interface.limits), None, name, doc
    )
    run = fastcall(entry, interface, fallback, name, doc)
    return run
