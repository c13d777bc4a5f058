"""Accelerations with non-ideal constraints, the losses of transmissions: M q̈ + h + Rᵀ λ = τ + (W − Rᵀ) Q, Q = −λ.

A link with the row R q̇ = 0 has the reaction W Q instead of the ideal Rᵀ Q: a force Q on the driven joint, −f Q on the driver
(Rotor chains, section 6). That is the minimum of the compulsion with the further load (W − Rᵀ) Q, where Q is the multiplier;
or, without the row, the motion under the load W Q for which R q̈ = 0. Both are affine in Q.
"""

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.backends import Backend
from gauss.backends.compulsion import Compulsion
from gauss.backends.recursion import Factor
from gauss.backends.solution import Solution
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.compiled import CompiledEngine
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.tiering import tiered
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.scene.losses import joint_factors
from gauss.system import ContactMode, State, System

CONVERGED_STEP = 1e-14  # Newton step relative to the largest force
CONVERGED_RESIDUAL = 1e-12  # residual of a force relative to the largest multiplier
LEAST_CONTRACTION = 0.1  # of Newton steps: an affine problem converges much faster
ROUNDOFF_STEP = 1e-8  # Newton step relative to the largest force by round-off, above all of QP solvers
MOST_ROUNDS = 20  # of Newton's method
NOT_CONVERGED = "the forces of the links with losses did not converge."


class NonIdealRows(NamedTuple):
    """Non-ideal constraints of a system: links with losses.

    Attributes
    ----------
    names : tuple of str
        Names of the m links.
    rows : ndarray of int, shape (m,)
        Their rows.
    R, W : ndarray, shape (m, n_v)
        Jacobian of the rows, and generalised forces for Q = 1.
    units : ndarray, shape (m,)
        Forces of the scene along the driven joints [N m, N].
    """

    names: tuple[str, ...]
    rows: np.ndarray
    R: np.ndarray
    W: np.ndarray
    units: np.ndarray


def non_ideal_rows(system: System, whole: System, mode: ContactMode) -> NonIdealRows:
    """Links with losses of a phase, with the directions of power flow of its mode."""
    places = {constraint.name: constraint.rows.start for constraint in system.structure.constraints}
    links = {name: link for name, link in whole.scene.losses.items() if mode.power_flow.get(name) and name in places}
    R, W = (np.zeros((len(links), system.n_v)) for _ in range(2))
    for k, (name, link) in enumerate(links.items()):
        for matrix, factors in ((R, link.acts_on), (W, joint_factors(link, mode.power_flow[name]))):
            for joint, factor in factors.items():
                matrix[k, system.column(joint)] += factor
    units = np.array([system.scale.energy / system.scale.coordinates[system.column(link.driven)] for link in links.values()])
    return NonIdealRows(tuple(links), np.array([places[name] for name in links], dtype=int), R, W, units)


def piecewise_affine_root(residual, guess: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Root Q (m,) of the piecewise affine ``residual(Q)`` (m,) by Newton's method; the last call is at the root.

    Parameters
    ----------
    residual : callable
        Forces (m,) → residual (m,).
    guess : ndarray, shape (m,)
        Initial forces.
    units : ndarray, shape (m,)
        Forces of the scene: smaller ones, as near a reversal, have round-off relative to these.

    Raises
    ------
    SimulationError
        If the iteration does not converge.
    """
    Q, left = guess, residual(guess)
    if not left.any():
        return Q
    for _ in range(MOST_ROUNDS):
        jacobian = np.array([residual(Q + unit) - left for unit in np.diag(units)]).T / units
        before = np.inf
        while True:
            step = np.linalg.lstsq(jacobian, -left, rcond=None)[0]
            Q, size = Q + step, np.abs(step / units).max()
            left = residual(Q)
            if size <= CONVERGED_STEP * np.abs(Q / units).max() or not left.any():
                return Q
            if size >= LEAST_CONTRACTION * before:  # rounding, or a kink was crossed
                break
            before = size
        if size <= ROUNDOFF_STEP * max(np.abs(Q / units).max(), 1.0):
            return Q
    raise SimulationError(NOT_CONVERGED)


def with_losses(compulsion: Compulsion, links: NonIdealRows, answer) -> tuple[np.ndarray, Solution]:
    """Forces Q (m,) of links in a compulsion with all rows and no inequalities, and the solution with losses.

    Parameters
    ----------
    compulsion : Compulsion
        Without the losses.
    links : NonIdealRows
        The links.
    answer : callable
        Compulsion → certified solution.
    """
    factor, extra = Factor(compulsion), links.W - links.R
    still, none = np.zeros_like(compulsion.impressed), np.zeros_like(compulsion.D)
    jacobian = np.array([factor.solve(still, none, load)[2][links.rows] for load in extra]).T + np.eye(len(extra))
    Q = np.linalg.solve(jacobian, -factor.solve(compulsion.impressed, compulsion.D, compulsion.P)[2][links.rows])
    for _ in range(MOST_ROUNDS):
        found = answer(replace(compulsion, P=compulsion.P + Q @ extra))
        left = -found.multipliers[links.rows] - Q
        if np.abs(left).max() <= CONVERGED_RESIDUAL * max(np.abs(found.multipliers).max(), np.abs(Q).max()):
            return Q, found
        Q = Q + np.linalg.solve(jacobian, left)
    raise SimulationError(NOT_CONVERGED)


class LossyEngine(Engine):
    """Accelerations of a phase with losses: by numpy first, compiled above the threshold of evaluations.

    Parameters
    ----------
    system : System
        The phase, with all rows.
    cut : System
        The same without the rows of the links with losses.
    links : NonIdealRows
        These links.
    backend : str, Backend or class
        How accelerations are solved.
    may_compile : bool
        Whether the phase may be compiled.
    """

    def __init__(self, system: System, cut: System, links: NonIdealRows, backend: str | Backend | type, may_compile: bool):
        self.system, self.cut, self.links, self.may_compile = system, cut, links, may_compile
        self.certified, self.counted = CertifiedEngine(backend), 0
        self.compiled: CompiledEngine | None = None
        self.Q = np.zeros(len(links.names))  # initial guess

    @property
    def evaluations(self) -> int:
        """Solutions so far."""
        return self.certified.evaluations + (self.compiled.evaluations if self.compiled else 0)

    @property
    def error(self) -> float:
        """Largest relative error of accelerations found by a check."""
        return max(self.certified.error, self.compiled.error if self.compiled else 0.0)

    @property
    def rescued(self) -> int:
        """Solutions that another backend found."""
        return self.certified.rescued

    @property
    def name(self) -> str:
        """Method, in words."""
        return self.certified.name

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Accelerations, and the power of the loads; losses of the links count as dissipation."""
        if self.compiled is None and self.may_compile:
            self._compile()
        found = self._solved(state)[0] if self.compiled is None else self._compiled(self.compiled, state)
        lost = self.Q @ (self.links.W @ state.v)
        return Rates(found.acceleration, found.power - np.array([0.0, 0.0, lost]))

    def _compile(self):
        """Compile the phase once the evaluations reach the threshold."""
        spent, self.counted = self.certified.evaluations - self.counted, self.certified.evaluations
        kernels = tiered(self.cut).kernels(self.laws, spent)
        if kernels is not None:
            self.compiled = CompiledEngine(self.cut, kernels)

    @cached_property
    def laws(self) -> Laws:
        """Loads of the phase."""
        return Laws(self.cut)

    def _solved(self, state: State):
        """Rates, and the certified solution."""
        compulsion, (driven, loaded, dissipated) = self.certified.assembled(self.system, state, None, None)
        self.Q, solution = with_losses(compulsion, self.links, lambda problem: self.certified.answer(problem, state.t))
        driven = driven - solution.multipliers @ solution.compulsion.C
        return Rates(solution.qdd, np.array([driven, loaded, dissipated])), solution

    def _compiled(self, engine: CompiledEngine, state: State) -> Rates:
        found: Rates

        def residual(Q):
            nonlocal found
            found = engine.rates(self.cut, state, Q @ self.links.W)
            return self.links.R @ found.acceleration

        self.Q = piecewise_affine_root(residual, self.Q, self.links.units)
        return found

    def solution(self, state: State) -> tuple[Solution, np.ndarray]:
        """Certified solution with all rows, and the forces Q (m,) of the links."""
        return self._solved(state)[1], self.Q

    def project(self, system: System, state: State) -> State:
        """State after a step, projected onto the constraints."""
        return project(self.system, state)

    def check(self, point: Point, last: bool = False):
        """Check compiled accelerations with the forces of the links as loads."""
        if self.compiled is not None:
            self._compiled(self.compiled, point.state)
            self.compiled.check(point, last, self.Q @ self.links.W)
