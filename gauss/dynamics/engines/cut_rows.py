"""Accelerations with rows R q̇ = 0 whose forces are found apart: M q̈ + h = τ + W Q with R q̈ = 0, affine in Q.

A closed stop of a joint and sticking dry friction are such rows, with the ideal reaction W = Rᵀ: the phases of a motion that
differ by them alone, and by constant forces of sliding joints, share the machine code of the system without them. A link
with losses has a reaction W Q that is not Rᵀ Q: a force Q on the driven joint, −f Q on the driver (Rotor chains, section 6).
With the rows in the system, that is the minimum of the compulsion with the further load (W − Rᵀ) Q, where Q = −λ is the
multiplier.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.backends import Backend
from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.certified import CertifiedEngine, rates_of
from gauss.dynamics.engines.compiled import CompiledEngine
from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.engines.held_joints import HeldJoint
from gauss.dynamics.engines.tiering import tiered_kernels
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rules import Plan
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.scene.losses import joint_factors
from gauss.system import ContactMode, State, System

CONVERGED_STEP = 1e-14  # Newton step relative to the largest force
CONVERGED_RESIDUAL = 1e-12  # residual of a force relative to the largest multiplier
LEAST_CONTRACTION = 0.1  # of Newton steps: an affine problem converges much faster
ROUNDOFF_STEP = 1e-8  # Newton step relative to the largest force by round-off, above all of QP solvers
MOST_ROUNDS = 20  # of Newton's method
NOT_CONVERGED = "the forces of the links with losses, of closed stops and of sticking joints did not converge."


class CutRows(NamedTuple):
    """Rows of a phase whose forces are found apart: links with losses, held joints; and forces of sliding joints."""

    names: tuple[str, ...]  # names of the m links and held joints
    rows: np.ndarray  # (m,) their rows
    R: np.ndarray  # R, W (m, n_v): Jacobian of the rows, and generalised forces for Q = 1
    W: np.ndarray
    units: np.ndarray  # (m,) forces of the scene along the driven joints [N m, N]
    held: tuple[HeldJoint, ...]  # the held joints among them
    braking: np.ndarray  # (n_v,) generalised forces of sliding joints, which are not in the cut system either

    @property
    def ideal(self) -> bool:
        """Whether no link has losses: then the reactions are those of ideal constraints."""
        return np.array_equal(self.R, self.W)


def cut_rows(
    system: System, whole: System, held: Sequence[HeldJoint], mode: ContactMode, braking: np.ndarray | None = None
) -> CutRows:
    """Rows of a phase to be cut: links with losses, with the directions of power flow of its mode, and held joints."""
    places = {constraint.name: constraint.rows.start for constraint in system.structure.constraints}
    links = {name: link for name, link in whole.scene.losses.items() if mode.power_flow.get(name) and name in places}
    names, rows = (*links, *(joint.name for joint in held)), [{joint.v: joint.sign} for joint in held]
    R = _matrix(system, [_places(system, link.acts_on) for link in links.values()] + rows)
    W = _matrix(system, [_places(system, joint_factors(link, mode.power_flow[name])) for name, link in links.items()] + rows)
    columns = [*(system.column(link.driven) for link in links.values()), *(joint.v for joint in held)]
    units = system.scale.energy / system.scale.coordinates[columns]
    found = np.array([places[name] for name in names], dtype=int)
    return CutRows(names, found, R, W, units, tuple(held), np.zeros(system.n_v) if braking is None else braking)


def _places(system: System, factors: Mapping[str, float]) -> dict[int, float]:
    """Factors by place in v instead of joint."""
    return {system.column(joint): factor for joint, factor in factors.items()}


def _matrix(system: System, rows: Sequence[Mapping[int, float]]) -> np.ndarray:
    matrix = np.zeros((len(rows), system.n_v))
    for k, row in enumerate(rows):
        matrix[k, list(row)] = list(row.values())
    return matrix


def piecewise_affine_root(residual, guess: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Root Q (m,) of the piecewise affine ``residual(Q)`` (m,) by Newton's method; the last call is at the root.

    SimulationError if the iteration does not converge.

    ``residual``: forces (m,) → residual (m,). ``guess`` (m,): initial forces. ``units`` (m,): forces of the scene: smaller
    ones, as near a reversal, have round-off relative to these.
    """
    Q, left = guess, residual(guess)
    if not np.isfinite(left).all():
        raise SimulationError(NOT_CONVERGED)
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


def with_losses(compulsion: Compulsion, links: CutRows, answer) -> tuple[np.ndarray, Solution]:
    """Forces Q (m,) of rows in a compulsion with all rows and no inequalities, and the solution with losses.

    ``compulsion``: without the losses. ``answer``: compulsion → certified solution.
    """
    if links.ideal:
        found = answer(compulsion)
        return -found.multipliers[links.rows], found
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


class CutRowEngine(Engine):
    """Accelerations of a phase with cut rows: compiled, or by numpy up to a threshold of evaluations.

    ``system``: the phase, with all rows. ``cut``: the same without the cut rows. ``backend``: how accelerations are solved.
    """

    def __init__(self, system: System, cut: System, links: CutRows, backend: str | Backend | type, plan: Plan):
        self.system, self.cut, self.links = system, cut, links
        self.plan: Plan | None = plan
        self.certified = CertifiedEngine(backend)
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
        self._compile()
        if self.compiled is None:
            found, forces = self._solved(state)[0], self.Q @ self.links.W
        else:
            found, forces = self._compiled(self.compiled, state), self._forces(self.Q)
        return Rates(found.acceleration, found.power - np.array([0.0, 0.0, forces @ state.v]))

    def _forces(self, Q: np.ndarray) -> np.ndarray:
        """Generalised forces (n_v,) that are not in the cut system."""
        return Q @ self.links.W + self.links.braking

    def _compile(self):
        """Compile the system without the rows once the evaluations reach the threshold."""
        if self.compiled is not None or self.plan is None:
            return
        kernels = tiered_kernels(self.cut, self.plan, self.laws, self.certified.evaluations)
        if kernels is not None:
            self.compiled = CompiledEngine(self.cut, kernels)

    @cached_property
    def laws(self) -> Laws:
        """Loads of the phase."""
        return Laws(self.cut)

    def _solved(self, state: State):
        """Rates, and the certified solution."""
        compulsion, power = self.certified.assembled(self.system, state, None, None)
        self.Q, solution = with_losses(compulsion, self.links, lambda problem: self.certified.answer(problem, state.t))
        return rates_of(solution, power), solution

    def _compiled(self, engine: CompiledEngine, state: State) -> Rates:
        found: Rates
        if not self.links.names:
            return engine.rates(self.cut, state, self.links.braking)
        if self.links.ideal:
            return self._affine(engine, state)

        def residual(Q):
            nonlocal found
            found = engine.rates(self.cut, state, self._forces(Q))
            return self.links.R @ found.acceleration

        self.Q = piecewise_affine_root(residual, self.Q, self.links.units)
        return found

    def _affine(self, engine: CompiledEngine, state: State) -> Rates:
        """Rates with ideal rows: forces and accelerations are affine, and are corrected once for rounding."""
        R, W, units = self.links.R, self.links.W, self.links.units
        before, *changed = engine.accelerations(
            state, self._forces(self.Q) + np.vstack([np.zeros_like(W[:1]), W * units[:, None]])
        )
        responses = (np.array(changed) - before).T / units
        if not np.isfinite(responses).all():
            raise SimulationError(NOT_CONVERGED)
        inverse = np.linalg.pinv(R @ responses)
        self.Q = self.Q - inverse @ (R @ before)
        found = engine.rates(self.cut, state, self._forces(self.Q))
        correction = -inverse @ (R @ found.acceleration)
        self.Q = self.Q + correction
        acceleration = found.acceleration + responses @ correction
        acceleration[[joint.v for joint in self.links.held]] = 0.0  # without rounding, held joints stay where they are
        return found._replace(acceleration=acceleration)

    def solution(self, state: State) -> tuple[Solution, np.ndarray]:
        """Certified solution with all rows, and the forces Q (m,) of the links."""
        return self._solved(state)[1], self.Q

    def project(self, system: System, state: State) -> State:
        """State after a step, projected onto the constraints."""
        if self.compiled is None or self.cut.closes or len(self.links.held) < len(self.links.names):
            return project(self.system, state)
        q, v = state.q.copy(), state.v.copy()
        for joint in self.links.held:
            v[joint.v] = 0.0
            if joint.stop is not None:
                q[joint.stop[0]] = joint.stop[1]
        same = np.array_equal(q, state.q) and np.array_equal(v, state.v)
        return state if same else replace(state, q=q, v=v)

    def check(self, point: Point, last: bool = False):
        """Check compiled accelerations with the forces of the rows as loads.

        DistrustError if the residual is too large; from then on all rows are solved by the certified engine.
        """
        if self.compiled is None:
            return
        self._compiled(self.compiled, point.state)
        try:
            self.compiled.check(point, last, self._forces(self.Q))
        except DistrustError:
            self.hand_over(point.state.t)
            raise

    def hand_over(self, t: float) -> bool:
        """Switch to the certified engine with all rows; False if that is in use already."""
        used, self.compiled, self.plan = self.compiled is not None, None, None
        return used
