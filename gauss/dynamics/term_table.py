"""Functions of a state by name: their arguments, shapes of their results, and how each is traced.

On the constraints, derivatives of the accelerations ÿ(y, ẏ, τ) are rows of :mod:`gauss.dynamics.linear_terms`. Efforts
τ(y, ẏ, ÿ) undo them: with the mass matrix M of the independent coordinates ∂τ = −M ∂ÿ under the efforts of these
accelerations. Where a parameter is a length, dependent coordinates and rates follow it (:mod:`gauss.dynamics.joint_places`).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss.dynamics.acceleration_derivatives import acceleration_derivatives, inverse_dynamics_derivatives
from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.dynamics.inertial_regressor import inertial_regressor
from gauss.dynamics.joint_places import accelerations_by_place, following_place
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.linear_terms import LinearTerms
from gauss.dynamics.mechanism import inverse_dynamics
from gauss.dynamics.parameter_terms import OF_JOINTS, accelerations_by_parameter, inverse_dynamics_by_parameter
from gauss.dynamics.state_terms import StateTerms
from gauss.dynamics.traced_system import applied_loads
from gauss.errors import SimulationError
from gauss.system import State, System


def efforts(terms: StateTerms, loads, acceleration) -> np.ndarray:
    """Efforts (k,) along the coordinates of the terms that accelerations (n_v,) of these take besides the loads."""
    own, on_bodies, _ = applied_loads(terms.system, loads, State(terms.t, terms.q, terms.v))
    allowed = terms.allowed_acceleration(acceleration)
    return terms.along(inverse_dynamics(terms.system, terms.q, terms.v, allowed, own, on_bodies, terms.t))


def independent_acceleration_derivatives(terms: ConstrainedTerms, loads, load) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the independent accelerations by displacements, rates and efforts, each (k, k).

    ``terms``: the system in one state, with k independent coordinates. ``loads``: its loads, with traced laws. ``load``
    (n_v,): generalised forces added to the loads.
    """
    free = terms.independent
    found = LinearTerms(terms, loads, load).acceleration_changes[free]
    return found[:, : len(free)], found[:, len(free) :], terms.responses[free]


def independent_effort_derivatives(terms: ConstrainedTerms, loads, acceleration) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the efforts by displacements and by rates, each (k, k), at given independent accelerations.

    ``terms``, ``loads``: as of :func:`independent_acceleration_derivatives`. ``acceleration`` (n_v,): accelerations; those
    of the independent coordinates are read.
    """
    load = _balancing(terms, loads, acceleration)
    by_displacement, by_rate, _ = independent_acceleration_derivatives(terms, loads, load)
    return -(terms.mass_matrix @ by_displacement), -(terms.mass_matrix @ by_rate)


def independent_accelerations_by_parameter(terms: ConstrainedTerms, loads, load, parameter: str) -> np.ndarray:
    """Derivative (k, p) of the independent accelerations by a parameter of p values, at fixed independent coordinates.

    ``terms``, ``loads``, ``load``: as of :func:`independent_acceleration_derivatives`. ``parameter``: as of
    :meth:`gauss.System.parameter_derivatives`.
    """
    system, state = terms.system, State(terms.t, terms.q, terms.v)
    if system.has_closures and parameter.partition(":")[0] in OF_JOINTS:
        following = following_place(terms, parameter)
        return accelerations_by_place(system, loads, state, load, parameter, following)[terms.independent]
    return accelerations_by_parameter(system, loads, terms.t, terms.q, terms.v, load, parameter)[terms.independent]


def independent_efforts_by_parameter(terms: ConstrainedTerms, loads, acceleration, parameter: str) -> np.ndarray:
    """Derivative (k, p) of the efforts by a parameter of p values, at given independent accelerations."""
    load = _balancing(terms, loads, acceleration)
    return -(terms.mass_matrix @ independent_accelerations_by_parameter(terms, loads, load, parameter))


def _balancing(terms: ConstrainedTerms, loads, acceleration) -> np.ndarray:
    """Efforts (n_v,) on the independent coordinates, under which they have given accelerations."""
    load = np.zeros(terms.system.n_v, dtype=object)
    load[terms.independent] = efforts(terms, loads, acceleration)
    return load


class Term(NamedTuple):
    """A function of a state."""

    arguments: str  # its arguments, of q, v, a (acceleration), l (load)
    # shapes of its results: digits, v: independent rates, or all; V: all rates; r: rows of the loop constraints; p: values
    # of the parameter; i: standard inertial parameters of all bodies
    shapes: tuple[str, ...]
    trace: Callable  # (terms, request, acceleration or load) → its results
    # of_frame, has_reference, has_loads, of_parameter, of_loops: whether it is a function of a frame; in axes to be chosen;
    # whether it depends on the loads of the scene; whether it is the derivative by a parameter; whether it is of the tree
    # with its loops eliminated
    of_frame: bool = False
    has_reference: bool = False
    has_loads: bool = False
    of_parameter: bool = False
    of_loops: bool = False


def traced_loads(system: System) -> Laws:
    """Laws of the loads as they are now; SimulationError if one of them cannot be compiled."""
    laws = Laws(system)
    if laws.reasons:
        words = "; ".join(f"the law of {name!r} cannot be traced ({why})" for name, why in laws.reasons.items())
        raise SimulationError(f"inverse dynamics of scene {system.scene.name!r} cannot be compiled: {words}.")
    return laws


def _inverse_dynamics(terms: StateTerms, _, acceleration):
    return efforts(terms, traced_loads(terms.system).traced, acceleration)


def _slopes(function: Callable, of_independent: Callable) -> Callable:
    """Derivatives of a function of the loaded system, of all coordinates or of independent ones."""

    def trace(terms, _, given):
        loads = traced_loads(terms.system).traced
        if isinstance(terms, ConstrainedTerms):
            return of_independent(terms, loads, given)
        return function(terms.system, loads, terms.t, terms.q, terms.v, given)

    return trace


def _by_parameter(function: Callable, of_independent: Callable) -> Callable:
    """Derivatives of a function of the loaded system by a parameter, of all coordinates or of independent ones."""

    def trace(terms, one, given):
        loads = traced_loads(terms.system).traced
        if isinstance(terms, ConstrainedTerms):
            return of_independent(terms, loads, given, one.frame)
        return function(terms.system, loads, terms.t, terms.q, terms.v, given, one.frame)

    return trace


BY_PARAMETER = {"has_loads": True, "of_parameter": True}
TERMS = {
    "mass_matrix": Term("q", ("vv",), lambda terms, *_: terms.mass_matrix),
    "bias_forces": Term("qv", ("v",), lambda terms, *_: terms.bias_forces),
    "gravity_forces": Term("q", ("v",), lambda terms, *_: terms.gravity_forces),
    "coriolis_matrix": Term("qv", ("vv",), lambda terms, *_: terms.coriolis_matrix),
    "forward_kinematics": Term("q", ("33", "3"), lambda terms, one, _: terms.frame_pose(one.frame), of_frame=True),
    "jacobian": Term("q", ("6v",), lambda terms, one, _: terms.jacobian(*one[1:]), of_frame=True, has_reference=True),
    "jacobian_rate": Term(
        "qv", ("6v",), lambda terms, one, _: terms.jacobian_rate(*one[1:]), of_frame=True, has_reference=True
    ),
    "center_of_mass": Term("q", ("3",), lambda terms, *_: terms.center_of_mass),
    "momentum": Term("qv", ("6",), lambda terms, *_: terms.momentum),
    "momentum_matrix": Term("q", ("6v",), lambda terms, *_: terms.momentum_matrix),
    "kinetic_energy": Term("qv", ("",), lambda terms, *_: terms.kinetic_energy),
    "potential_energy": Term("q", ("",), lambda terms, *_: terms.potential_energy),
    "inertial_regressor": Term("qva", ("vi",), lambda terms, _, given: inertial_regressor(terms, given)),
    "null_space": Term("q", ("Vv",), lambda terms, *_: terms.null_space),
    "inverse_dynamics": Term("qva", ("v",), _inverse_dynamics, has_loads=True),
    "inverse_dynamics_derivatives": Term(
        "qva", ("vv", "vv"), _slopes(inverse_dynamics_derivatives, independent_effort_derivatives), has_loads=True
    ),
    "acceleration_derivatives": Term(
        "qvl",
        ("vv", "vv", "vv"),
        _slopes(acceleration_derivatives, independent_acceleration_derivatives),
        has_loads=True,
        of_loops=True,
    ),
    "inverse_dynamics_by": Term(
        "qva", ("vp",), _by_parameter(inverse_dynamics_by_parameter, independent_efforts_by_parameter), **BY_PARAMETER
    ),
    "accelerations_by": Term(
        "qvl",
        ("vp",),
        _by_parameter(accelerations_by_parameter, independent_accelerations_by_parameter),
        **BY_PARAMETER,
        of_loops=True,
    ),
    "loop_constraints": Term("qv", ("r", "rv", "r"), lambda terms, *_: terms.loop_constraints),
}
