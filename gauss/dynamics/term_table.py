"""Functions of a state by name: their arguments, shapes of their results, and how each is traced."""

from collections.abc import Callable
from typing import NamedTuple

from gauss.dynamics.acceleration_derivatives import acceleration_derivatives, inverse_dynamics_derivatives
from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.dynamics.independent_derivatives import (
    efforts,
    independent_acceleration_derivatives,
    independent_accelerations_by_parameter,
    independent_effort_derivatives,
    independent_efforts_by_parameter,
)
from gauss.dynamics.inertial_regressor import inertial_regressor
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameter_terms import accelerations_by_parameter, inverse_dynamics_by_parameter
from gauss.dynamics.state_terms import StateTerms
from gauss.errors import SimulationError
from gauss.system import System


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
