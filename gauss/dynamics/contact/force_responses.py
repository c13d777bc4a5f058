"""Responses M⁻¹ f (with constraints) at one instant: free accelerations, and those that each further force adds."""

import numpy as np

from gauss.backends import Backend
from gauss.backends.closure import Factor
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.compiled import CompiledEngine, StateKernels
from gauss.dynamics.engines.engine import DistrustError
from gauss.dynamics.engines.tree_recursion import tree_recursion_kernels
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.loads import Applied
from gauss.dynamics.plan import RESPONSES
from gauss.dynamics.rules import Question
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.traced_system import Program
from gauss.integrators import Point, Rates
from gauss.system import State, System

WORK = np.zeros(3)
TEST_FORCE = 2.0**20  # units of the scene: large beside the free accelerations, so that differences keep their digits


class ForceResponses:
    """Accelerations of a system without unilateral constraints, compiled where possible.

    Parameters
    ----------
    backend : str
        Backend; "auto" for machine code where possible.
    laws : Laws, optional
        Loads of the system; as they are now when not given.

    Attributes
    ----------
    solver : Compiled or CertifiedEngine
        Engine.
    """

    def __init__(self, system: System, backend: str | Backend | type = "auto", laws: Laws | None = None):
        self.system = system
        self.solver: CompiledEngine | CertifiedEngine = CertifiedEngine(backend)
        laws = Laws(system) if laws is None else laws
        plan = RESPONSES.plan(Question(system, laws, backend))
        if plan.dynamics == "tree recursion":
            self.solver = CompiledEngine(system, tree_recursion_kernels(system), LoadForces(system, (), laws))
        elif plan.dynamics == "compiled":
            self.solver = CompiledEngine(system, Program(system, laws, Drift()).cached_kernels)

    @property
    def compiled(self) -> bool:
        """Whether machine code is in use."""
        return self.kernels is not None

    @property
    def kernels(self) -> StateKernels | None:
        """Machine code in use; None where there is none, or it failed a check."""
        engine = self.solver
        return engine.kernels if isinstance(engine, CompiledEngine) and engine.handed_over is None else None

    def free(self, state: State, last: bool = False) -> Rates:
        """Accelerations and powers without further forces."""
        rates = self.solver.rates(self.system, state)
        try:
            self.solver.check(Point(state, WORK, rates), last)
        except DistrustError:
            rates = self.solver.rates(self.system, state)
        return rates

    def of(self, state: State, forces: np.ndarray) -> np.ndarray:
        """Accelerations (k, n_v) that generalised forces (k, n_v) add, each by itself."""
        if not len(forces):
            return np.zeros((0, self.system.n_v))
        kernels = self.kernels
        if kernels is not None:
            where, size = np.concatenate([[state.t], state.q, state.v]), self._test_factors(state, forces)
            inputs = np.zeros((where.size + self.system.n_v, len(forces) + 1))
            inputs[: where.size] = where[:, None]
            inputs[where.size :, 1:] = size * forces.T
            found = kernels.forward(inputs)[: self.system.n_v]
            return ((found[:, 1:] - found[:, :1]) / size).T
        motion = kinematics(self.system, state)
        problem = assemble_motion(motion, Applied(motion))
        factor, still = Factor(problem), (np.zeros_like(problem.impressed), np.zeros_like(problem.D))
        return np.array([factor.solve(*still, force)[1] for force in forces])

    def _test_factors(self, state: State, forces: np.ndarray) -> np.ndarray:
        """Factors (k,) that make test forces (k, n_v) large."""
        scale = self.system.scale
        largest = np.abs(forces / scale.efforts).max(axis=1)
        return TEST_FORCE * (scale.time * scale.fastest(state.v)) ** 2 / np.where(largest > 0.0, largest, 1.0)
