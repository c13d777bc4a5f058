"""Initial states without Newton steps: the start of the scene is kept by its content, a consistent state as it is given."""

import warnings

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.assemble import state_residual
from gauss.dynamics.consistent_states import changed_starts, consistent, violations
from gauss.dynamics.engines.tiering import TieredFunction
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.projection import RESIDUAL_ROUNDOFF, within_limits
from gauss.dynamics.store import cached, cached_on_disk
from gauss.errors import GaussError, StartWarning, listed, user_level
from gauss.system import State, System

RESIDUAL_THRESHOLD = 30  # residuals by numpy that take as long as compiling the residual


def scene_start(system: System) -> State:
    """Consistent start of the scene at time 0, assembled once; a new process reads it unless there is something to warn of.

    AssemblyError if the constraints cannot be met from there.
    """
    find = lambda: consistent(system, system.start(), tuple(system.scene.starts))  # noqa: E731
    if not system.has_closures:
        return find()
    found: list[State] = []

    def make() -> tuple[State, bool, tuple[str, ...]]:
        start = met_start(system)
        found.append(find() if start is None else start)
        return found[0], start is not None, system.rigid_joints

    state, is_met, rigid_joints = cached_on_disk(system, (scene_start, given_starts(system)), make)
    vars(system).setdefault("rigid_joints", rigid_joints)  # its own property, which would reduce the system to find them
    if not (found or is_met):
        return find()
    return State(state.t, state.q.copy(), state.v.copy())  # the caller may write to it


def met_start(system: System) -> State | None:
    """Consistent start of a scene with loops, assembled once; None if it would be refused or warned of."""

    def make() -> State | None:
        given, names = system.start(), tuple(system.scene.starts)
        try:
            start = consistent(system, given, names, least_violation=True)
        except GaussError:
            return None
        is_met = not (violations(system, start) or changed_starts(system, within_limits(system, given), start, names))
        return start if is_met else None

    return cached(system, (met_start, given_starts(system)), make)


def given_starts(system: System) -> tuple:
    """Starts of a scene as a cache key: systems whose scenes differ in nothing else share their cache."""
    return tuple(system.scene.starts.values())


def projected(system: System, state: State) -> State:
    """State projected onto the constraints; one that meets them to round-off stays as it is.

    AssemblyError if the constraints cannot be met from there. StartWarning if it is beyond the limits of a joint, where it
    is moved to them.
    """
    given, state = state, within_limits(system, state)
    if state is not given and not np.array_equal(state.q, given.q):
        _warn_of_limits(system, given, state)
    if not system.has_closures:
        return state
    return state if constraint_residual(system, state) <= RESIDUAL_ROUNDOFF else consistent(system, state)


def _warn_of_limits(system: System, given: State, moved: State):
    limited = [joint.name for joint in system.joints if system.scene.joints[joint.name].limits is not None]
    changed = changed_starts(system, given, moved, limited)
    if changed:
        words = f"the state is beyond limits of joints, and was moved to them: {listed(changed.values())}."
        warnings.warn(words, StartWarning, stacklevel=user_level())


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
