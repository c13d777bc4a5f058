"""Accelerations where links lose power: their forces act otherwise than their rows bind.

A link with the row R q̇ = 0 has the reaction W Q instead of Rᵀ Q: with Q on the driven joint goes −f Q on the driver (Rotor
chains, section 6). That is the minimum of the compulsion with the further load (W − Rᵀ) Q, Q being the multiplier found;
or, with the row left out, under the load W Q for which R q̈ = 0. Both are affine in Q.
"""

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.backends.recursion import Factor
from gauss.compulsion import Compulsion, Solution
from gauss.dynamics.consistent import project
from gauss.dynamics.engines.certified import Certified
from gauss.dynamics.engines.compiled import Compiled
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.laws import Laws
from gauss.dynamics.paying import paying
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.scene.losses import pushes
from gauss.system import State, System, Told

BALANCED = 1e-14  # of the largest force: a step so small changes nothing
BALANCED_BEFORE = 1e-12  # of the largest multiplier: what may be lacking of a force
SHRINKING = 0.1  # of the step before: steps of a problem that is affine shrink by much more
ROUNDING = 1e-8  # of the largest force: a step that remains because of rounding, of QP solvers above all
UNIT = 1.0  # N m, N: forces smaller than this, as those that turn about, are rounded as this one is
ROUNDS = 20  # of new slopes


class Skewed(NamedTuple):
    """Links of a system whose forces act otherwise than their rows bind.

    Attributes
    ----------
    names : tuple of str
        Names of the m links.
    rows : ndarray of int, shape (m,)
        Their rows.
    R, W : ndarray, shape (m, n_v)
        Slopes of the rows, and generalised forces for Q = 1.
    """

    names: tuple[str, ...]
    rows: np.ndarray
    R: np.ndarray
    W: np.ndarray


def skewed(system: System, whole: System, told: Told) -> Skewed:
    """Links of a phase through which power is lost, of those of the whole system, as told."""
    places = {constraint.name: constraint.rows.start for constraint in system.structure.constraints}
    links = {name: link for name, link in whole.scene.losses.items() if told.ways.get(name) and name in places}
    R, W = (np.zeros((len(links), system.n_v)) for _ in range(2))
    for k, (name, link) in enumerate(links.items()):
        for matrix, factors in ((R, link.acts_on), (W, pushes(link, told.ways[name]))):
            for joint, factor in factors.items():
                matrix[k, system.column(joint)] += factor
    return Skewed(tuple(links), np.array([places[name] for name in links], dtype=int), R, W)


def balance(lacking, guess: np.ndarray) -> np.ndarray:
    """Q (m,) for which ``lacking(Q)`` (m,), affine but for corners, is zero; it is called with that Q last.

    Raises
    ------
    SimulationError
        If there is none.
    """
    Q, left = guess, lacking(guess)
    if not left.any():
        return Q
    for _ in range(ROUNDS):
        slopes = np.array([lacking(Q + unit) - left for unit in np.eye(Q.size)]).T
        before = np.inf
        while True:
            step = np.linalg.lstsq(slopes, -left, rcond=None)[0]
            Q, size = Q + step, np.abs(step).max()
            left = lacking(Q)
            if size <= BALANCED * np.abs(Q).max() or not left.any():
                return Q
            if size >= SHRINKING * before:  # rounding, or a corner was passed
                break
            before = size
        if size <= ROUNDING * max(np.abs(Q).max(), UNIT):
            return Q
    raise SimulationError("no forces of the links that lose power were found that balance.")


def balanced(compulsion: Compulsion, links: Skewed, answer) -> tuple[np.ndarray, Solution]:
    """Forces Q (m,) of links in a compulsion with all rows and no inequalities, and the solution under their losses.

    Parameters
    ----------
    compulsion : Compulsion
        Without the losses.
    links : Skewed
        The links.
    answer : callable
        Takes a compulsion, returns its certified solution.
    """
    factor, extra = Factor(compulsion), links.W - links.R
    still, none = np.zeros_like(compulsion.impressed), np.zeros_like(compulsion.D)
    slopes = np.array([factor.solve(still, none, load)[2][links.rows] for load in extra]).T + np.eye(len(extra))
    Q = np.linalg.solve(slopes, -factor.solve(compulsion.impressed, compulsion.D, compulsion.P)[2][links.rows])
    for _ in range(ROUNDS):
        found = answer(replace(compulsion, P=compulsion.P + Q @ extra))
        left = -found.multipliers[links.rows] - Q
        if np.abs(left).max() <= BALANCED_BEFORE * max(np.abs(found.multipliers).max(), np.abs(Q).max()):
            return Q, found
        Q = Q + np.linalg.solve(slopes, left)
    raise SimulationError("no forces of the links that lose power were found that balance.")


class Lossy(Engine):
    """Accelerations of a phase in which links lose power: by numpy first, by machine code once there is enough to do.

    Parameters
    ----------
    system : System
        The phase, with all rows.
    cut : System
        The same without those of the links that lose power.
    links : Skewed
        These links.
    backend : str
        How accelerations are solved.
    may_compile : bool
        Whether machine code may be made.
    """

    def __init__(self, system: System, cut: System, links: Skewed, backend: str, may_compile: bool):
        self.system, self.cut, self.links, self.may_compile = system, cut, links, may_compile
        self.certified, self.compiled, self.counted = Certified(backend), None, 0
        self.Q = np.zeros(len(links.names))  # where to begin

    @property
    def evaluations(self) -> int:
        """Solutions so far."""
        return self.certified.evaluations + (self.compiled.evaluations if self.compiled else 0)

    @property
    def error(self) -> float:
        """Largest relative error of accelerations that was found."""
        return max(self.certified.error, self.compiled.error if self.compiled else 0.0)

    @property
    def rescued(self) -> int:
        """Solutions for which another method stepped in."""
        return self.certified.rescued

    @property
    def name(self) -> str:
        """What was used, in words."""
        return self.certified.name

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Accelerations, and the power of the loads; what the links lose is dissipated."""
        if self.compiled is None and self.may_compile:
            self._compile()
        found = self._solved(state)[0] if self.compiled is None else self._compiled(state)
        lost = self.Q @ (self.links.W @ state.v)
        return Rates(found.acceleration, found.power - np.array([0.0, 0.0, lost]))

    def _compile(self):
        """Go on by machine code if that pays."""
        spent, self.counted = self.certified.evaluations - self.counted, self.certified.evaluations
        kernels = paying(self.cut).kernels(self.laws, spent)
        if kernels is not None:
            self.compiled = Compiled(self.cut, kernels, ())

    @cached_property
    def laws(self) -> Laws:
        """Loads of the phase."""
        return Laws(self.cut)

    def _solved(self, state: State):
        """Rates, and the certified solution."""
        compulsion, (driven, loaded, dissipated) = self.certified.assembled(self.system, state, None, None)
        self.Q, solution = balanced(compulsion, self.links, lambda problem: self.certified.answer(problem, state.t))
        driven = driven - solution.multipliers @ solution.compulsion.C
        return Rates(solution.qdd, np.array([driven, loaded, dissipated])), solution

    def _compiled(self, state: State) -> Rates:
        found = None

        def lacking(Q):
            nonlocal found
            found = self.compiled.rates(self.cut, state, Q @ self.links.W)
            return self.links.R @ found.acceleration

        self.Q = balance(lacking, self.Q)
        return found

    def solution(self, state: State) -> tuple[Solution, np.ndarray]:
        """Certified solution with all rows, and the forces Q (m,) of the links."""
        return self._solved(state)[1], self.Q

    def project(self, system: System, state: State) -> State:
        """State after a step, brought back to the constraints."""
        return project(self.system, state)

    def check(self, point: Point, last: bool = False):
        """Check compiled accelerations as those without losses are."""
        if self.compiled is not None:
            self._compiled(point.state)
            self.compiled.check(point, last, self.Q @ self.links.W)
