"""Accelerations of one state and their changes by the null space N of the loop constraints: X = N (Nᵀ M N)⁻¹ Nᵀ.

Elimination by K M⁻¹ Kᵀ loses digits where bodies of one loop differ in mass by many orders: M⁻¹ is large along the lightest,
which the loop does not let move by itself. N is geometry, and Nᵀ M N the inertia of what moves: neither loses them. From the
residuals r, s of the equations of motion and of the constraints, with a particular solution K p = s,

    δq̈ = p + X (r − M p).

Functions of a state by it take numbers, one state at a time, in a hundred times the time of machine code.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.joint_places import place_changes
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.null_space import RowSpace
from gauss.dynamics.parameter_terms import OF_JOINTS
from gauss.dynamics.projection import position_residual_of, relative
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.term_table import TERMS, traced_loads
from gauss.errors import SimulationError
from gauss.system import State, System, whole

FEW_DIGITS = 1e-5  # relative error of Nᵀ M N, by its terms and condition, above which derivatives are refused
CORRECTIONS = 2  # of the accelerations, from zero: the second removes the round-off of the first


class NullSpaceKernels(NamedTuple):
    """Machine code of the unreduced system."""

    velocity: Kernel  # (t, q, rates) → K v, and all rates, those of loop joints as they follow from the tree
    residual: Kernel  # (t, q, v, load, q̈, λ) → r, s, and all accelerations
    # (t, q, v, load, q̈, λ, changes of q and v) → change of r, s, and of accelerations that follow from the tree
    change: Kernel


class NullSpaceDynamics:
    """Accelerations of a system with loops in one state of numbers, and their changes.

    SimulationError if too few digits are left.

    ``state``: state that meets the constraints. ``load`` (n_v,): generalised forces added to the loads.

    Attributes: ``rates`` (n_v,): accelerations.
    """

    def __init__(self, system: System, laws: Laws, state: State, load):
        self.system, self.given = system, np.concatenate([[state.t], state.q, state.v, load])
        self.kernels = cached_on_disk(system, (_kernels, laws.key), lambda: _kernels(system, laws.traced))
        n, unreduced = system.n_v, whole(system)
        tree = np.concatenate([np.r_[unreduced.joints[edge.constraint].v] for edge in unreduced.tree])
        place = np.tile(np.concatenate([[state.t], state.q])[:, None], n)
        K, L = np.split(self.kernels.velocity(np.concatenate([place, np.eye(n)])), [-n])
        self.M, self.L = system.mass_matrix(state.q, None, state.t), L
        residual = relative(system, position_residual_of(system, state))
        rows = RowSpace(K[:, tree], system.scale.coordinates[tree], residual)
        self.particular, self.N = np.zeros(K.T.shape), np.zeros((n, rows.null_space.shape[1]))
        self.particular[tree], self.N[tree] = rows.pseudo_inverse, rows.null_space
        self.inertia = self._inertia(rows.condition)
        self.rates, self.multipliers = self._motion(K.shape[0])

    def _inertia(self, condition: float) -> np.ndarray:
        """Inverse (k, k) of Nᵀ M N, scaled by its diagonal."""
        N, M = self.N, self.M
        G = N.T @ M @ N
        with np.errstate(all="ignore"):
            scale = 1.0 / np.sqrt(np.diag(G))
            scaled, terms = (part * np.outer(scale, scale) for part in (G, np.abs(N).T @ np.abs(M) @ np.abs(N)))
        known = bool(np.isfinite(scaled).all())
        off = np.finfo(float).eps * condition * terms.max(initial=0.0) * np.linalg.cond(scaled) if known and G.size else 0.0
        if not known or not off <= FEW_DIGITS:
            raise SimulationError(
                f"scene {self.system.scene.name!r}: the derivatives of its accelerations have too few digits in this state: "
                "masses of one loop differ by too many orders, or the pose is near-singular; expected inertia along every "
                "motion that its loops allow: give its lightest bodies more mass, or none where others move with them."
            )
        return np.linalg.inv(scaled) * np.outer(scale, scale) if G.size else G

    def _motion(self, m: int) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (n_v,), and multipliers (m,), the least in the units."""
        n, none = self.system.n_v, np.zeros(m)
        rates, force = np.zeros(n), np.zeros(n)
        for _ in range(CORRECTIONS):
            force, off, _ = self._residual(rates, none)
            rates = self._residual(rates + self._response(force, off), none)[2]
        force = self._residual(rates, none)[0]
        return rates, self.particular.T @ force

    def _residual(self, rates, multipliers) -> list[np.ndarray]:
        found = self.kernels.residual(np.concatenate([self.given, rates, multipliers]))
        return np.split(found, np.cumsum([self.system.n_v, multipliers.size]))

    def _response(self, force, off) -> np.ndarray:
        """Rates of the tree that remove residuals (n_v, …) of the equations of motion, and (m, …) of the constraints."""
        p = self.particular @ off
        return p + self.N @ (self.inertia @ (self.N.T @ (force - self.M @ p)))

    def changes(self, directions: np.ndarray) -> np.ndarray:
        """Changes (n_v, k) of the accelerations along directions (3 n_v, k) of displacements, rates, generalised forces."""
        n, m = self.system.n_v, self.multipliers.size
        fixed = np.concatenate([self.given, self.rates, self.multipliers])
        moving = np.concatenate([np.tile(fixed[:, None], directions.shape[1]), directions[: 2 * n]])
        force, off, following = np.split(self.kernels.change(moving), np.cumsum([n, m]))
        return self.response(force + self.L.T @ directions[2 * n :], off) + following

    def response(self, force: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Changes (n_v, k) of the accelerations that remove residuals.

        ``force`` (n_v, k): of the equations of motion, along the joints of the tree. ``off`` (m, k): of the loop
        constraints.
        """
        return self.L @ self._response(force, off)


def _kernels(system: System, loads) -> NullSpaceKernels:
    n_q, n, sizes = system.n_q, system.n_v, (1, system.n_q, system.n_v, system.n_v)
    unreduced = (whole(system),)
    m = unreduced[0].n_loop_constraints

    def velocity(t, q, rates):
        mechanism = Mechanism(system, q, rates, t[0], unreduced)
        return mechanism.along_rows(rates), mechanism.dependent_rates()

    def loaded(t, q, v, load):
        return LoadedMechanism(system, loads, t[0], q, v, load, unreduced)

    def residual(t, q, v, load, rates, multipliers):
        return loaded(t, q, v, load).residual(rates, multipliers)

    def change(t, q, v, load, rates, multipliers, along_q, along_v):
        return loaded(t, q, v, load).changes(rates, multipliers, [(along_q, along_v)])[0]

    return NullSpaceKernels(
        Kernel(write(velocity, 1, n_q, n, name="velocity")),
        Kernel(write(residual, *sizes, n, m, name="residual"), batch=False),
        Kernel(write(change, *sizes, n, m, n, n, name="change")),
    )


def null_space_terms(system: System, requests: Sequence, state: State, given: dict) -> list[np.ndarray]:
    """Results of requests for functions of accelerations, and of others beside them, one after the other.

    SimulationError if too few digits are left.

    ``state``: state that meets the constraints. ``given``: rates, accelerations and generalised forces (n_v,), by their
    names.
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
