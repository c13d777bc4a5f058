"""Prepared linear models: names and independent coordinates are decided once, a call computes A, B, C, D in machine code.

The model is that of :mod:`gauss.analysis.linear_model`, in independent coordinates that are the same in every state.
"""

from collections.abc import Sequence

import numpy as np

from gauss.analysis.frozen_time import resting
from gauss.analysis.linear_model import LinearModel, linearise
from gauss.analysis.linear_model_each import LinearModelOfEach, output_names
from gauss.arguments import named_arguments
from gauss.codegen import Interface, forward, write
from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.dynamics.inputs import InputForces
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.linear_terms import LinearTerms
from gauss.dynamics.plan import LINEAR_MODELS
from gauss.dynamics.rules import Plan, Question
from gauss.dynamics.scene_compilation import system_of
from gauss.dynamics.sensor_values import measured
from gauss.dynamics.state_functions import TracedFunction, compiled, error_limits, error_measures
from gauss.dynamics.store import cached
from gauss.dynamics.term_table import traced_loads
from gauss.errors import SimulationError
from gauss.scene import Scene
from gauss.system import State, System


class PreparedLinearModel:
    """Function (q, v, load, t) → A, B, C, D; made by :func:`prepare_linear_model`.

    Parameters
    ----------
    model : LinearModel
        Linear model about one state.
    plan : Plan
        Whether one function computes a model ("state"), or a loop in Python that of each state, where loops are many.

    Attributes
    ----------
    states, inputs, outputs : tuple of str
        Names of x, u and y.
    system : System
        The system.
    """

    def __init__(self, model: LinearModel, plan: Plan):
        self.model, self.plan, self.system = model, plan, model.system
        self.states, self.inputs, self.outputs = model.states, model.inputs, model.outputs
        _refuse(model)
        self._function = _compiled(model) if plan.driver == "state" else LinearModelOfEach(model, _independent(model))
        self._no_load = np.zeros(self.system.n_v)

    def __reduce__(self):
        return PreparedLinearModel, (self.model, self.plan)

    def __call__(self, q, v, load=None, t=0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Matrices of δẋ = A δx + B δu, δy = C δx + D δu about a state, or about each of a batch of states.

        Parameters
        ----------
        q, v : array_like, shape (…, n_q), (…, n_v)
            Coordinates and rates that meet the constraints.
        load : array_like, shape (…, n_v), optional
            Generalised forces added to those of the scene [N m, N].
        t : float or array_like, shape (…,)
            Time [s].

        Returns
        -------
        tuple of ndarray
            A (…, n, n), B (…, n, m), C (…, p, n) and D (…, p, m).

        Raises
        ------
        StateError
            If the state does not fit, is off the constraints, or the independent coordinates do not determine the others
            there.
        """
        if load is None:
            load = self._no_load if np.ndim(q) == 1 else np.zeros(np.shape(v))
        return self._function(q, v, load, None, t)


@named_arguments
def prepare_linear_model(
    system: System | Scene,
    state: State | None = None,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    independent: Sequence[str] | None = None,
) -> PreparedLinearModel:
    """Prepare linear models of many states: a call takes microseconds, loops included, and milliseconds where they are many.

    Parameters
    ----------
    system : System or Scene
        The system.
    state : State, optional
        State whose well-conditioned coordinates are the independent ones in all states; the start at rest when not given.
    inputs, outputs, independent
        As for :func:`gauss.linearise`.

    Returns
    -------
    PreparedLinearModel
        Function (q, v, load, t) → A, B, C, D, with the names of states, inputs and outputs. At a kink of a law the
        derivatives are those of one side.

    Raises
    ------
    ArgumentError
        If inputs or outputs are no names.
    StateError
        If a name is none of the scene, or the independent coordinates do not determine the others.
    SimulationError
        If the system cannot be compiled; if elements stick and slip, by their names, or bodies roll, so that the states of
        the model are not the same everywhere.

    Examples
    --------
    >>> import gauss
    >>> model = gauss.prepare_linear_model(gauss.load("four_bar"))
    >>> start = model.system.initial_state()
    >>> A, B, C, D = model(start.q, start.v)
    >>> A.shape
    (2, 2)
    """
    system = system_of(system, "prepare_linear_model")
    plan = LINEAR_MODELS.plan(Question(system, Laws(system)))
    if state is None:
        start = system.initial_state()
        state = system.initial_state(start.q, resting(system, start).v, start.t)
    model = linearise(system, state, inputs=inputs, outputs=outputs, independent=independent)
    positions, rates, own = _places(model)
    if not set(positions) <= set(rates) and len(positions) + own == len(rates):  # equally good coordinates, chosen twice
        model = linearise(system, state, inputs=inputs, outputs=outputs, independent=_independent(model))
    return PreparedLinearModel(model, plan)


def _refuse(model: LinearModel):
    """Raise a SimulationError for systems whose states are not the same everywhere."""
    system = model.system
    if system.scene.nonsmooth:
        names = ", ".join(map(repr, system.scene.nonsmooth))
        raise SimulationError(
            f"scene {system.scene.name!r}: {names} stick and slip, or come and go: the linear model depends on their mode; "
            "call gauss.linearise in each state."
        )
    positions, rates, own = _places(model)
    if len(positions) + own != len(rates):
        raise SimulationError(
            f"scene {system.scene.name!r} rolls: displacements are more than rates; call gauss.linearise in each state."
        )


def _independent(model: LinearModel) -> list[str]:
    """Names of the independent rates of a model."""
    return [model.system.coordinates[place] for place in _places(model)[1]]


def _places(model: LinearModel) -> tuple[list[int], list[int], int]:
    """Places in v of displacements and of rates of a model, and how many states of one's own have no integral there."""
    names, own = list(model.system.coordinates), model.system.scene.states
    rates = [name.removesuffix(" rate") for name in model.states if name.endswith(" rate") or name in own]
    moved = [name.removeprefix("integral of ") for name in model.states if not (name.endswith(" rate") or name in own)]
    alone = [name for name in rates if name in own and name not in moved]
    return [names.index(name) for name in moved], [names.index(name) for name in rates], len(alone)


def _compiled(model: LinearModel):
    """Machine code (q, v, load, t) → A, B, C, D."""
    system, (positions, columns, _) = model.system, _places(model)
    states = [*(k for k, place in enumerate(columns) if place in positions), *range(len(columns), 2 * len(columns))]
    laws, forces, outputs = traced_loads(system), _forces(model), _outputs(model)
    n, m, p = len(states), len(model.inputs), len(model.outputs)
    shapes = (n, n), (n, m), (p, n), (p, m)
    sizes = {"q": system.n_q, "v": system.n_v, "load": system.n_v}
    interface, name = Interface(sizes, "t", error_limits(columns), shapes), "linear model"

    def values(*given):
        q, v, load, (t,) = given
        terms = ConstrainedTerms(system, q, v, t, columns)
        linear = LinearTerms(terms, laws.traced, load)
        by_forces = linear.by_forces(forces(t, q, v))
        A, B = linear.state_matrices(by_forces)
        C, D = (outputs(linear, changes) for changes in (linear.by_state, by_forces))
        return A[np.ix_(states, states)], B[states], C[:, states], D, error_measures(terms, given, of_loops=True)

    function = TracedFunction(lambda: write(values, *interface.sizes, 1, name="linear"), interface, name)
    key = PreparedLinearModel, model.states, model.inputs, model.outputs, laws.key
    return cached(system, key, lambda: compiled(system, function, columns, key))


def _forces(model: LinearModel):
    """Function (t, q, v) → generalised forces (n_v, m) of unit inputs."""
    system, known = model.system, list(model.system.scene.inputs)
    inputs, names = InputForces(system), list(system.coordinates)

    def forces(t, q, v):
        columns = []
        for name in model.inputs:
            if name not in known:
                columns.append(np.eye(system.n_v)[names.index(name)])
                continue
            unit = np.eye(len(known))[known.index(name)]
            columns.append(unit @ np.eye(system.n_v)[inputs.columns] if inputs.is_plain else slope(t, q, v, unit))
        return np.array(columns, dtype=object).reshape(len(columns), system.n_v).T

    def slope(t, q, v, unit):
        found = lambda t, q, v, u: forward(inputs.forces(u, State(t[0], q, v)), u, unit)  # noqa: E731
        return write(found, 1, q.size, v.size, unit.size, name="input").inlined(
            [t], q, v, inputs.inside(inputs.efforts(0.0 * unit))
        )

    return forces


def _outputs(model: LinearModel):
    """Function of linear terms and changes (3 n_v, c) of displacements, rates, accelerations → those (p, c) of outputs."""
    system, scene, names = model.system, model.system.scene, list(model.system.coordinates)
    labels = output_names(model)

    def rows(linear: LinearTerms, changes, label: str):
        if label in scene.outputs:
            sensor = lambda t, q, v, a: np.ravel(measured(scene.outputs[label], kinematics(system, State(t, q, v)), a))  # noqa: E731
            return linear.measured(sensor, changes)
        is_rate = label.endswith(" rate") or label in scene.states
        return changes[[names.index(label.removesuffix(" rate")) + system.n_v * is_rate]]

    def outputs(linear: LinearTerms, changes):
        return np.concatenate([np.zeros((0, changes.shape[1])), *(rows(linear, changes, label) for label in labels)])

    return outputs
