"""Accelerations by compiled iterative refinement with an error bound, where plain compiled code fails its checks."""

import numpy as np

from gauss.backends.certificate import TOLERANCE
from gauss.codegen import Kernel, write
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.tiering import COMPILE_THRESHOLD, CompileThreshold
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.traced_refinement import refined_rates
from gauss.dynamics.traced_system import Program
from gauss.integrators import Rates
from gauss.system import State, System


class RefinedEngine(CertifiedEngine):
    """Certified accelerations; above the compile threshold by compiled iterative refinement with an error bound.

    ``system``: a smooth system (see :func:`gauss.dynamics.conditions.obstacles`). ``laws``: its loads, all of which are
    traced.
    """

    def __init__(self, system: System, laws: Laws):
        super().__init__()
        self.laws, self.threshold, self.found = laws, CompileThreshold(COMPILE_THRESHOLD), 0

    @property
    def name(self) -> str:
        """Method, in words."""
        mostly = f"{self.found} times compiled iterative refinement with an error bound, else " if self.found else ""
        return mostly + super().name

    def rates(self, system: System, state: State, load=None, loads=None) -> Rates:
        """As :meth:`gauss.dynamics.engines.certified.CertifiedEngine.rates`; the compiled code evaluates all loads."""
        if self.threshold.passed() and loads is None:
            make = lambda: Kernel(self._written(system), batch=False)  # noqa: E731
            kernel = cached_on_disk(system, (RefinedEngine, self.laws.key), make)
            given = np.concatenate([[state.t], state.q, state.v, np.zeros(system.n_v) if load is None else load])
            acceleration, power, (error,) = np.split(kernel(given), np.cumsum([system.n_v, 3]))
            if error <= TOLERANCE:
                self.evaluations, self.found = self.evaluations + 1, self.found + 1
                self.largest_error = max(self.largest_error, float(error))
                return Rates(acceleration, power)
        return super().rates(system, state, load, loads)

    def _written(self, system: System):
        program = Program(system, self.laws)
        sizes = 1, system.n_q, system.n_v, system.n_v
        return write(lambda *given: refined_rates(program, *given), *sizes, name="refined")
