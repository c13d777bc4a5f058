"""Functions of a state in which the elimination of loop constraints leaves few digits, by the null space of these.

They are evaluated on numbers, for one state at a time, in a hundred times the time of machine code.
"""

from collections.abc import Sequence

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.joint_places import place_changes
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.null_space_dynamics import NullSpaceDynamics
from gauss.dynamics.parameter_terms import OF_JOINTS
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.term_table import TERMS, traced_loads
from gauss.system import State, System


def null_space_terms(system: System, requests: Sequence, state: State, given: dict) -> list[np.ndarray]:
    """Results of requests for functions of accelerations, and of others beside them, one after the other.

    SimulationError if too few digits are left.

    Parameters
    ----------
    state : State
        State that meets the constraints.
    given : dict
        Rates, accelerations and generalised forces (n_v,), by their names.
    """
    laws, load, found = traced_loads(system), given["load"], list[np.ndarray]()
    dynamics = NullSpaceDynamics(system, laws, state, load)
    for one in requests:
        if one.name == "acceleration_derivatives":
            found += np.split(dynamics.changes(np.eye(3 * system.n_v)), 3, axis=1)
        elif one.name == "accelerations_by":
            found.append(_by_parameter(dynamics, laws, one.frame, state, load))
        else:
            arguments = {"q": state.q, "v": state.v, "a": given.get("acceleration"), "l": load}
            function = system.function(":".join(filter(None, one[:2])), **_axes(one))
            results = function(*(arguments[letter] for letter in TERMS[one.name].arguments), None, state.t)
            found += results if isinstance(results, tuple) else [results]
    return found


def _by_parameter(dynamics: NullSpaceDynamics, laws: Laws, parameter: str, state: State, load) -> np.ndarray:
    """Derivative (n_v, k) of the accelerations by a parameter."""
    system, given = dynamics.system, [state.q, state.v, load, dynamics.rates, dynamics.multipliers]
    if parameter.partition(":")[0] not in OF_JOINTS:
        function = system.function(f"inverse_dynamics_by:{parameter}")
        columns = function(state.q, state.v, dynamics.rates, None, state.t)
        return dynamics.response(-columns, np.zeros((dynamics.multipliers.size, columns.shape[1])))

    def by_place(t, q, v, load, rates, multipliers):
        parts = place_changes(system, laws.traced, State(t[0], q, v), load, parameter, rates, multipliers)
        return np.array([np.concatenate(part) for part in parts]).T

    make = lambda: Kernel(write(by_place, 1, *(part.size for part in given), name="by_place"), batch=False)  # noqa: E731
    kernel = cached_on_disk(system, (_by_parameter, parameter, laws.key), make)
    changes = kernel(np.concatenate([[state.t], *given])).reshape(-1, 3)
    force, off, following = np.split(changes, np.cumsum([system.n_v, dynamics.multipliers.size]))
    return dynamics.response(force, off) + following


def _axes(one) -> dict[str, str]:
    return {"reference": one.reference} if one.reference else {}
