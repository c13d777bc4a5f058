"""Derivatives on the constraint manifold: by displacements along independent coordinates, rates, efforts, and parameters.

Of the accelerations ÿ(y, ẏ, τ) they are rows of :mod:`gauss.dynamics.linear_terms`. Efforts τ(y, ẏ, ÿ) undo them: with the
mass matrix M of the independent coordinates ∂τ = −M ∂ÿ under the efforts of these accelerations. Where a parameter is a
length, dependent coordinates and rates follow it (:mod:`gauss.dynamics.joint_places`).
"""

import numpy as np

from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.dynamics.joint_places import accelerations_by_place, following_place
from gauss.dynamics.linear_terms import LinearTerms
from gauss.dynamics.mechanism import inverse_dynamics
from gauss.dynamics.parameter_terms import OF_JOINTS, accelerations_by_parameter
from gauss.dynamics.state_terms import StateTerms
from gauss.dynamics.traced_system import applied_loads
from gauss.system import State


def efforts(terms: StateTerms, loads, acceleration) -> np.ndarray:
    """Efforts (k,) along the coordinates of the terms that accelerations (n_v,) of these take besides the loads."""
    own, on_bodies, _ = applied_loads(terms.system, loads, State(terms.t, terms.q, terms.v))
    allowed = terms.allowed_acceleration(acceleration)
    return terms.along(inverse_dynamics(terms.system, terms.q, terms.v, allowed, own, on_bodies, terms.t))


def independent_acceleration_derivatives(terms: ConstrainedTerms, loads, load) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the independent accelerations by displacements, rates and efforts, each (k, k).

    Parameters
    ----------
    terms : ConstrainedTerms
        The system in one state, with k independent coordinates.
    loads : sequence of BoundLoad
        Its loads, with traced laws.
    load : ndarray, shape (n_v,)
        Generalised forces added to the loads.
    """
    free = terms.independent
    found = LinearTerms(terms, loads, load).acceleration_changes[free]
    return found[:, : len(free)], found[:, len(free) :], terms.responses[free]


def independent_effort_derivatives(terms: ConstrainedTerms, loads, acceleration) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the efforts by displacements and by rates, each (k, k), at given independent accelerations.

    Parameters
    ----------
    terms, loads
        As of :func:`independent_acceleration_derivatives`.
    acceleration : ndarray, shape (n_v,)
        Accelerations; those of the independent coordinates are read.
    """
    load = _balancing(terms, loads, acceleration)
    by_displacement, by_rate, _ = independent_acceleration_derivatives(terms, loads, load)
    return -(terms.mass_matrix @ by_displacement), -(terms.mass_matrix @ by_rate)


def independent_accelerations_by_parameter(terms: ConstrainedTerms, loads, load, parameter: str) -> np.ndarray:
    """Derivative (k, p) of the independent accelerations by a parameter of p values, at fixed independent coordinates.

    Parameters
    ----------
    terms, loads, load
        As of :func:`independent_acceleration_derivatives`.
    parameter : str
        As of :meth:`gauss.System.parameter_derivatives`.
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
