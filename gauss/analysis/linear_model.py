"""Linear model of a system about a state: δẋ = A δx + B δu, δy = C δx + D δu in independent coordinates and rates.

With the tangents of :mod:`gauss.analysis.tangents` and the derivatives of the accelerations of
:mod:`gauss.analysis.derivatives`, no constraint is approximated: a loop with any redundant rows has as many states as it has
freedoms, twice. Modes are eigenvectors of A (Schiehlen and Eberhard, Applied Dynamics, 2014, ch. 7).
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import qr

from gauss.analysis.derivatives import AccelerationChanges, changes_along
from gauss.analysis.frozen_time import state_at
from gauss.analysis.linear_modes import LinearModes
from gauss.analysis.regulator import gain, unreached, weights
from gauss.analysis.tangents import Tangents
from gauss.arguments import named_arguments
from gauss.codegen import Kernel, forward, write
from gauss.dynamics.consistent_states import refuse_off_constraints
from gauss.dynamics.inputs import InputForces
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.outputs import FORCES
from gauss.dynamics.projection import fixed_columns
from gauss.dynamics.scene_compilation import system_of
from gauss.dynamics.sensor_values import measured
from gauss.errors import ArgumentError, MissingPackageError, SimulationError, StateError, did_you_mean
from gauss.scene import Scene
from gauss.system import State, System, coordinate_rates
from gauss.system.coordinate_names import displacement_names, rate_names

STEADY = 1e-8  # share of the accelerations that forces could cause, below which a state is an equilibrium
MARGINAL = 1e-7  # share of the fastest rate below which real parts count as zero: round-off of double eigenvalues is √ε


@dataclass(frozen=True)
class LinearModel:
    """Linear model of a system about a state.

    Parameters
    ----------
    A, B, C, D : ndarray, shape (n, n), (n, m), (p, n), (p, m)
        δẋ = A δx + B δu, δy = C δx + D δu.
    states, inputs, outputs : tuple of str
        Names of x, u and y; rates of a coordinate have the name of the coordinate with " rate".
    system : System
        The system.
    state : State
        The state about which it is.
    displacements : ndarray, shape (n_v, k)
        Displacements of all coordinates for those of the independent ones, the first k states.
    is_equilibrium : bool
        Whether the system rests or moves uniformly in this state: rates and accelerations do not change the coordinates and
        rates that the model depends on.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    system: System = field(repr=False)  # as long as a scene
    state: State
    displacements: np.ndarray
    is_equilibrium: bool

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Eigenvalues of A [1/s]."""
        return np.linalg.eigvals(self.A)

    @property
    def stability(self) -> str:
        """Whether it is "stable", "marginal" or "unstable", by the largest real part of the eigenvalues."""
        largest = self.eigenvalues.real.max(initial=-np.inf)
        return "marginal" if abs(largest) <= self._zero else "stable" if largest < 0.0 else "unstable"

    @property
    def _zero(self) -> float:
        """Real parts [1/s] that are round-off: of the eigenvalues, and of the time of the scene, as at neutral rest."""
        own = 1.0 / self.system.scale.time if self.displacements.shape[1] else 0.0
        return MARGINAL * max(np.abs(self.eigenvalues).max(initial=0.0), own)

    def modes(self) -> LinearModes:
        """Eigenmodes."""
        return self._modes(*np.linalg.eig(self.A))

    def _modes(self, found: np.ndarray, vectors: np.ndarray) -> LinearModes:
        """Modes of eigenvalues (m,) and of vectors (n, m) of the states."""
        order = [k for k in np.argsort(np.abs(found), kind="stable") if found[k].imag >= 0.0]
        shapes = (self.displacements @ vectors[: self.displacements.shape[1]]).T[order]
        shares = shapes / self.system.scale.coordinates
        peaks = shares[np.arange(len(shares)), np.abs(shares).argmax(axis=1)] if shares.size else np.ones(len(shares))
        scaled = shapes / np.where(peaks == 0.0, 1.0, peaks)[:, None]
        return LinearModes(found[order], scaled, tuple(self.system.coordinates))

    def uncontrollable(self) -> LinearModes:
        """Eigenmodes that no input reaches.

        Returns
        -------
        LinearModes
            Those modes; none where every mode is reached.
        """
        units = self._units[:, None]
        eigenvalues, vectors = unreached(self.A * units.T / units, self.B / units)
        return self._modes(eigenvalues, units * vectors)

    def lqr(self, Q=None, R=None) -> np.ndarray:
        """Gain K of the linear-quadratic regulator u = −K x, which minimises ∫ xᵀ Q x + uᵀ R u dt.

        Parameters
        ----------
        Q : array_like, shape (n, n) or (n,), optional
            Weights of the states, or their diagonal; when not given one over the squares of the units of the scene.
        R : array_like, shape (m, m) or (m,), optional
            Weights of the inputs; ones when not given.

        Returns
        -------
        ndarray, shape (m, n)
            The gain.

        Raises
        ------
        ArgumentError
            If weights do not fit.
        SimulationError
            If the model has no inputs, or no input reaches a mode that is not stable, by the coordinates that it moves.

        Examples
        --------
        >>> import gauss
        >>> cart = gauss.load("cart_pole")
        >>> push = cart.input("push", "rail")
        >>> model = gauss.linearise(cart)
        >>> K = model.lqr(Q=[1, 10, 1, 1])
        >>> bool((abs(K) > 0).all())
        True
        """
        if not self.inputs:
            raise SimulationError("lqr: expected a model with inputs; name some in linearise, or by scene.input.")
        left = self.uncontrollable()
        moving = left.eigenvalues.real >= -self._zero
        if moving.any():
            named = str(LinearModes(left.eigenvalues[moving], left.shapes[moving], left.coordinates))
            raise SimulationError(
                f"lqr: {', '.join(map(repr, self.inputs))} do not reach these modes, which are not stable:\n{named}"
            )
        return gain(self.A, self.B, weights(Q, self._units**-2.0, "Q"), weights(R, np.ones(len(self.inputs)), "R"))

    @property
    def _units(self) -> np.ndarray:
        """Units (n,) of the states."""
        scale, names = self.system.scale, list(self.system.coordinates)
        of = {name: unit for name, unit in zip(names, scale.coordinates, strict=True)}
        of |= {f"{name} rate": unit for name, unit in zip(names, scale.rates, strict=True)}
        return np.array([of.get(name, 1.0) for name in self.states])

    def state_space(self):
        """The model as a ``control.StateSpace`` of python-control, with the names.

        Raises
        ------
        MissingPackageError
            If python-control is not installed.
        SimulationError
            If the model has no input or no output, which python-control does not take.
        """
        if not self.inputs or not self.outputs:
            raise SimulationError("state_space: expected a model with inputs and outputs; name some in linearise.")
        try:
            import control
        except ImportError:
            raise MissingPackageError(
                "state_space needs python-control, which is not installed: pip install control"
            ) from None
        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(self.A, self.B, self.C, self.D, **names)


@named_arguments
def linearise(
    system: System | Scene, state: State | None = None, *, inputs=None, outputs=None, independent=None, load=None, t=None
) -> LinearModel:
    """Linear model about a state that meets the constraints, exact for loops and for rolling.

    Laws of time have their values at the time of the state. Joint friction and limited drives that stick in it bind rates.

    Parameters
    ----------
    system : System or Scene
        The system.
    state : State, optional
        State about which it is; the start of the scene at rest when not given.
    inputs : sequence of str, optional
        Inputs of the scene, or coordinates along which generalised forces act [N m, N]; all inputs of the scene when not
        given.
    outputs : sequence of str, optional
        Outputs of the scene, or coordinates, or their rates as in "pin rate", or states of one's own; when not given,
        all outputs of the scene, or all independent coordinates where it has none.
    independent : sequence of str, optional
        Joints or rates to describe the system with, one for each freedom; well-conditioned ones when not given.
    load : array_like, shape (n_v,), optional
        Generalised forces added to those of the scene [N m, N].
    t : float, optional
        Time of the start, where no state is given [s].

    Returns
    -------
    LinearModel
        Matrices and names.

    Warns
    -----
    TimeDependenceWarning
        If laws depend on time, and neither a state nor a time is given.

    Raises
    ------
    ArgumentError
        If inputs or outputs are no names, or a time is given beside a state.
    StateError
        If a name is none of the scene, the state is off the constraints, or the independent coordinates do not determine the
        others.
    SimulationError
        If the system cannot be compiled, or its accelerations have no derivatives in this state.

    Examples
    --------
    >>> import gauss
    >>> model = gauss.linearise(gauss.load("pendulum"))
    >>> model.states
    ('A', 'A rate')
    """
    system = system_of(system, "linearise")
    state = state_at(system, state, t, "linearise")
    refuse_off_constraints(system, state, "linearise")
    changes = AccelerationChanges(system, state, load)
    tangents = Tangents(changes.system, state)
    N, rate = tangents.position, tangents.rate
    if independent is not None:
        chosen = fixed_columns(system, _names(independent, "independent"))
        N, turning = _described_by(N, chosen, independent), _best_rows(rate / system.scale.rates[:, None], chosen)
        rate = _described_by(rate, turning, independent)
        tangents.__dict__.update(position=N, rate=rate, independent_coordinates=chosen, independent_rates=turning)
    k, D, free = N.shape[1], tangents.change, tangents.independent_rates
    places = tangents.independent_coordinates
    moving = D + tangents.turning @ N
    forces, input_names = _input_columns(system, state, inputs)
    by_q, by_v, response = changes_along(changes, tangents, forces)
    A = np.block([[moving[places], rate[places]], [by_q[free], by_v[free]]])
    B = np.concatenate([np.zeros((k, forces.shape[1])), response[free]])
    rows, direct, output_names = _output_rows(system, state, outputs, places, load)
    along_q = np.concatenate([N, np.zeros((system.n_v, rate.shape[1]))], axis=1)
    along = np.concatenate([along_q, np.concatenate([D, rate], axis=1), np.concatenate([by_q, by_v], axis=1)])
    states = (*(displacement_names(system)[p] for p in places), *(rate_names(system)[p] for p in free))
    own, unit = system.accelerations(state, load), system.scale.rates / system.scale.time
    C, places, A, B, N, states = _without_integrals(system, rows @ along, places, A, B, N, states)
    is_equilibrium = bool(
        (np.abs(own) <= STEADY * unit).all() and (np.abs(state.v[places]) <= STEADY * system.scale.rates[places]).all()
    )
    return LinearModel(A, B, C, direct @ response, states, input_names, output_names, system, state, N, is_equilibrium)


def _without_integrals(system: System, C, places, A, B, N, states):
    """The model without the integrals over time of states of one's own on which nothing depends."""
    own = system.scene.states
    used = A.any(axis=0) | C.any(axis=0)
    integrals = np.array(
        [system.coordinates[place] in own for place in places] + [False] * (len(A) - len(places)), dtype=bool
    )
    kept = used | ~integrals
    moved = kept[: len(places)]
    named = tuple(np.array([*states, None], dtype=object)[:-1][kept])
    left = [place for place, is_kept in zip(places, moved, strict=True) if is_kept]
    return C[:, kept], left, A[np.ix_(kept, kept)], B[kept], N[:, moved], named


def _described_by(N: np.ndarray, chosen: list[int], independent) -> np.ndarray:
    """The same tangent in other independent coordinates."""
    square = N[chosen]
    if len(chosen) != N.shape[1] or np.linalg.cond(square) > 1e8:
        raise StateError(f"independent: expected {N.shape[1]} coordinates that determine the others, got {independent!r}.")
    found = np.linalg.solve(square.T, N.T).T
    found[chosen] = np.eye(len(chosen))
    return found


def _best_rows(rate: np.ndarray, chosen: list[int]) -> list[int]:
    """Of the independent coordinates those of independent rates (n_v, l), in shares of the units.

    They are fewer where rolling or sticking binds rates alone.
    """
    if rate.shape[1] >= len(chosen):
        return chosen
    *_, order = qr(rate[chosen].T, mode="r", pivoting=True)
    return sorted(chosen[k] for k in order[: rate.shape[1]])


def _input_columns(system: System, state: State, inputs) -> tuple[np.ndarray, tuple[str, ...]]:
    """Generalised forces (n_v, m) for each input of 1, and their names."""
    known = tuple(system.scene.inputs)
    names = known if inputs is None else _names(inputs, "inputs")
    columns = []
    for name in names:
        if name in known:
            columns.append(_input_slope(system, state, known.index(name)))
        else:
            columns.append(np.eye(system.n_v)[_column(system, name, "inputs", known)])
    return np.array(columns).reshape(len(names), system.n_v).T, names


def _input_slope(system: System, state: State, place: int) -> np.ndarray:
    """∂Q/∂u of an input at u = 0, or the limit next to it, from within."""
    inputs = InputForces(system)
    unit = np.eye(len(inputs.low))[place]
    if inputs.is_plain:
        return unit @ np.eye(system.n_v)[inputs.columns]
    slopes = lambda t, q, v, u: forward(inputs.forces(u, State(t[0], q, v)), u, unit)  # noqa: E731
    slope = write(slopes, 1, system.n_q, system.n_v, unit.size, name="input")
    return Kernel(slope, batch=False)(
        np.concatenate([[state.t], state.q, state.v, inputs.inside(inputs.efforts(0.0 * unit))])
    )


def _output_rows(system: System, state: State, outputs, places, load):
    """∂y/∂(ξ, v, q̈) (p, 3 n_v), its part of q̈, and the names."""
    known, n = system.scene.outputs, system.n_v
    names = _default_outputs(system, places) if outputs is None else _names(outputs, "outputs")
    own = system.accelerations(state, load)
    rows, labels = [], list[str]()
    for name in names:
        if name in known:
            found = _slopes_of(system, state, own, known[name])
            labels += [name] if len(found) == 1 else [f"{name}[{i}]" for i in range(len(found))]
            rows.append(found)
            continue
        coordinate, is_rate = (name.removesuffix(" rate"), name.endswith(" rate") or name in system.scene.states)
        column = _column(system, coordinate, "outputs", (*known, *(f"{one} rate" for one in system.coordinates)))
        rows.append(np.eye(3 * n)[[column + n * is_rate]])
        labels.append(name)
    whole = np.concatenate(rows) if rows else np.zeros((0, 3 * n))
    return whole, whole[:, 2 * n :], tuple(labels)


def _default_outputs(system: System, places) -> tuple[str, ...]:
    """Outputs of the scene, or independent coordinates where it has none."""
    coordinates = (system.coordinates[place] for place in places)
    return tuple(system.scene.outputs) or tuple(name for name in coordinates if name not in system.scene.states)


def _slopes_of(system: System, state: State, own: np.ndarray, output) -> np.ndarray:
    """∂y/∂(ξ, v, q̈) (p, 3 n_v) of an output of the scene."""
    if output.kind in FORCES:
        raise SimulationError(f"output {output.name!r}: forces are no outputs of a linear model; measure motions.")
    n = system.n_v

    def slopes(t, q, v, acceleration, along_q, along_v, along_a):
        found = np.ravel(measured(output, kinematics(system, State(t[0], q, v)), acceleration))
        direction = np.concatenate([coordinate_rates(system, q, along_q), along_v, along_a])
        return forward(found, np.concatenate([q, v, acceleration]), direction)

    kernel = Kernel(write(slopes, 1, system.n_q, n, n, n, n, n, name="output"), batch=False)
    given = np.concatenate([[state.t], state.q, state.v, own])
    return kernel(np.concatenate([np.tile(given[:, None], 3 * n), np.eye(3 * n)]))


def _names(given: Any, what: str) -> tuple[str, ...]:
    """One name, or several."""
    names = (given,) if isinstance(given, str) or not isinstance(given, Iterable) else tuple(given)
    if not all(isinstance(name, str) for name in names):
        raise ArgumentError(f"{what}: expected names, got {given!r}.")
    return names


def _column(system: System, name: str, what: str, others) -> int:
    """Place of a coordinate in v."""
    if name not in system.coordinates:
        raise StateError(f"{what}: nothing is called {name!r}. {did_you_mean(name, [*others, *system.coordinates])}")
    return list(system.coordinates).index(name)
