"""Derivatives by the place of a joint in the frame of its parent or child, over symbols.

A place that changes opens the loops that it lies in. At fixed coordinates and rates the accelerations are those of opened
loops. On the constraints coordinates and rates follow: with the position residual c(q, p), K δξ = −∂c/∂p, and with the
velocity residual g(q, v, p), K δv = −∂g/∂p − (∂g/∂q) δξ, where displacements and changes of the independent rates are zero.
"""

from collections.abc import Callable, Sequence

import numpy as np

from gauss.codegen import Scalar, forward, write
from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.dynamics.constraint_leak import refused_where_leaking
from gauss.dynamics.given_link_frames import GivenLinkFrames, with_moved_joint
from gauss.dynamics.inverse_dynamics_residual import inverse_dynamics_residual
from gauss.dynamics.kinematics import WORLD_AXES, kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism, loop_residual
from gauss.dynamics.parameters import changed
from gauss.dynamics.traced_system import applied_loads
from gauss.system import BoundLoad, State, System, coordinate_rates, whole


def inverse_dynamics_by_place(
    system: System, loads: Sequence[BoundLoad], state: State, rates, parameter: str
) -> list[np.ndarray]:
    """Change of inverse dynamics, with loops cut, by a place such as "child_at:elbow": three arrays (n_v,)."""

    def parts(t: Scalar, q, v, place, rates):
        motion = kinematics(_moved(system, parameter, place)[0], State(t, q, v))
        return -inverse_dynamics_residual(motion, Applied(motion, loads), rates)

    return _along_axes(parts, state, np.zeros((3, system.n_q + system.n_v)), rates)


def accelerations_by_place(
    system: System, loads: Sequence[BoundLoad], state: State, load, parameter: str, following=None
) -> np.ndarray:
    """Change (n_v, 3) of the accelerations by the place of a joint of a system with loops.

    With the residuals r of the equations of motion and g of the constraints, which leave them as the joint moves, at fixed
    accelerations and multipliers, of the loops of the whole system: its reductions hold for present places. What redundant
    rows contradict is left out.

    ``system``, ``loads``, ``state``, ``load``, ``parameter``: as of
    :func:`gauss.dynamics.parameter_terms.accelerations_by_parameter`. ``following`` (3, n_q + n_v): changes of coordinates
    and rates by :func:`following_place`; both are fixed when not given.
    """
    t, q, v = state.t, state.q, state.v
    own, forces, _ = applied_loads(system, loads, state)
    mechanism = Mechanism(system, q, v, t, (whole(system),))
    rates, multipliers = mechanism.motion(own + load, forces)
    found = place_changes(system, loads, state, load, parameter, rates, multipliers, following)
    changes = np.array([mechanism.response(motion, violation)[0] + after for motion, violation, after in found]).T
    return refused_where_leaking(system, Mechanism(system, q, v, t), changes)


def place_changes(
    system: System, loads: Sequence[BoundLoad], state: State, load, parameter: str, rates, multipliers, following=None
) -> list[list[np.ndarray]]:
    """Changes by the place of a joint, at fixed accelerations (n_v,) and multipliers (m,) of the loops of the whole system.

    For each axis that of the residual of the equations of motion (n_v,), of the loop constraints (m,), and of dependent
    accelerations (n_v,). Other arguments are those of :func:`accelerations_by_place`.
    """
    n, m = system.n_v, multipliers.size

    def parts(t: Scalar, q, v, place, load, rates, multipliers):
        other, one = _moved(system, parameter, place)
        own, forces, _ = applied_loads(other, loads, State(t, q, v))
        moved = Mechanism(other, q, v, t, (one,))
        motion, violation = moved.residual(rates, multipliers, own + load, forces)
        return np.concatenate([motion, violation, moved.dependent_accelerations(rates)])

    moving = np.zeros((3, state.q.size + n)) if following is None else following
    columns = _along_axes(parts, state, moving, load, rates, multipliers)
    return [np.split(column, [n, n + m]) for column in columns]


def following_place(terms: ConstrainedTerms, parameter: str) -> np.ndarray:
    """Changes (3, n_q + n_v) of coordinates and rates that keep loops closed, the independent ones held, by a place."""
    system, state, one = terms.system, State(terms.t, terms.q, terms.v), whole(terms.system)
    mechanism = Mechanism(system, terms.q, terms.v, terms.t, (one,))
    still, free, N = np.zeros(system.n_v), terms.independent, terms.null_space
    held = lambda change: change - N @ change[free]  # noqa: E731

    def opened(t: Scalar, q, v, place):
        other, moved = _moved(system, parameter, place)
        phi, (slack,) = loop_residual(other, q, t, (moved,))
        return np.concatenate([phi, *slack])

    def opening(t: Scalar, q, v, place):
        other, moved = _moved(system, parameter, place)
        found = Mechanism(other, q, v, t, (moved,))
        return np.concatenate([found.velocity_residual(), found.dependent_rates() - v])

    m = mechanism.scale.size
    ends = np.cumsum([m, *(one.joints[index].pair.n_v for index in one.loop_joints)])[:-1]
    displacements = []
    for column in _along_axes(opened, state, np.zeros((3, system.n_q + system.n_v))):
        phi, *slack = np.split(column, ends)
        displacements.append(held(mechanism.position_correction(phi, [slack])))
    moved = [coordinate_rates(system, terms.q, displacement) for displacement in displacements]
    rates = []
    for column in _along_axes(opening, state, np.array([np.concatenate([own, still]) for own in moved])):
        residual, after = np.split(column, [m])
        rates.append(held(mechanism.response(still, -residual)[0] + after))
    return np.array([np.concatenate(pair) for pair in zip(moved, rates, strict=True)])


def _moved(system: System, parameter: str, place) -> tuple[System, GivenLinkFrames]:
    """System with a joint displaced in the frame of its parent or child, and its one subsystem."""
    kind, _, name = parameter.partition(":")
    index, joint = next((i, joint) for i, joint in enumerate(system.joints) if joint.name == name)
    field, body = ("p_parent", joint.parent) if kind == "parent_at" else ("p_child", joint.child)
    shift = (system.frames[system.structure.bodies[body]].R if body >= 0 else WORLD_AXES) @ place
    joints = (*system.joints[:index], changed(joint, {field: getattr(joint, field) + shift}), *system.joints[index + 1 :])
    return changed(system, {"joints": joints}), with_moved_joint(whole(system), index, body, shift)


def _along_axes(parts: Callable, state: State, moving: np.ndarray, *more: np.ndarray) -> list[np.ndarray]:
    """Derivatives of parts(t, q, v, place, …) along each axis of a place, with coordinates and rates moving with it.

    ``parts``: function over symbols; of ``more`` besides. ``moving`` (3, n_q + n_v): changes of coordinates and rates for
    each axis. ``more``: further arguments, which are fixed.
    """
    t, q, v = state.t, state.q, state.v

    def changes(t, q, v, place, moving, *more):
        outputs, given = parts(t[0], q, v, place, *more), [*q, *v, *place]
        pairs = zip(WORLD_AXES, moving.reshape(3, -1), strict=True)
        return tuple(forward(outputs, given, np.concatenate([own, axis])) for axis, own in pairs)

    sizes = 1, q.size, v.size, 3, moving.size, *(one.size for one in more)
    written = write(changes, *sizes, name="by_place")
    return np.split(written.inlined([t], q, v, np.zeros(3), moving.ravel(), *more), 3)
