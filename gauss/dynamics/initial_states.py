"""Initial states without Newton steps: the start of the scene is kept by its content, a consistent state as it is given."""

import warnings
from contextlib import suppress

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.assemble import state_residual
from gauss.dynamics.consistent_states import changed_starts, consistent, consistent_if_met
from gauss.dynamics.engines.tiering import TieredFunction
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.projection import RESIDUAL_ROUNDOFF, within_limits
from gauss.dynamics.store import cached, cached_on_disk
from gauss.errors import GaussError
from gauss.system import State, System

RESIDUAL_THRESHOLD = 30  # residuals by numpy that take as long as compiling the residual


def scene_start(system: System) -> State:
    """Consistent start of the scene at time 0, assembled once; a new process reads it unless there is something to warn of.

    AssemblyError if the constraints cannot be met from there.
    """
    if not system.has_closures:
        return _found(system)[0]
    found: list[State] = []

    def make() -> tuple[State, bool, tuple[str, ...]]:
        start, is_met = _found(system)
        found.append(start)
        given = within_limits(system, system.start())
        is_met = is_met and not changed_starts(system, given, start, system.scene.starts)
        return start, is_met, system.rigid_joints

    state, is_met, rigid_joints = cached_on_disk(system, (scene_start,), make)
    vars(system).setdefault("rigid_joints", rigid_joints)  # its own property, which would reduce the system to find them
    if not (found or is_met):
        return _found(system)[0]
    return State(state.t, state.q.copy(), state.v.copy())  # the caller may write to it


def met_start(system: System) -> State | None:
    """Consistent start of the scene, if there is nothing to warn of; else None."""
    with warnings.catch_warnings(), suppress(GaussError, Warning):
        warnings.simplefilter("error")
        return scene_start(system)
    return None


def _found(system: System) -> tuple[State, bool]:
    """Start of the scene, assembled, and whether it is known to meet its constraints."""
    return consistent_if_met(system, system.start(), tuple(system.scene.starts))


def projected(system: System, state: State) -> State:
    """State projected onto the constraints; one that meets them to round-off stays as it is.

    AssemblyError if the constraints cannot be met from there.
    """
    state = within_limits(system, state)
    if not system.has_closures:
        return state
    return state if constraint_residual(system, state) <= RESIDUAL_ROUNDOFF else consistent(system, state)


def constraint_residual(system: System, state: State) -> float:
    """Constraint residual of a state, in position and velocity, relative to the sizes of the constraints."""
    return float(cached(system, (_residual,), lambda: _residual(system))(state))


def _residual(system: System) -> TieredFunction:
    """Constraint residual of a state, in position and velocity, relative: that of the compulsion."""

    def residual(state: State):
        return state_residual(kinematics(system, state))

    def compiled():
        flat = lambda t, q, v: [residual(State(t[0], q, v))]  # noqa: E731
        make = lambda: Kernel(write(flat, 1, system.n_q, system.n_v, name="residual"), batch=False)  # noqa: E731
        kernel = cached_on_disk(system, (projected,), make)
        return lambda state: kernel(np.concatenate([[state.t], state.q, state.v]))[0]

    return TieredFunction(residual, compiled, RESIDUAL_THRESHOLD)
