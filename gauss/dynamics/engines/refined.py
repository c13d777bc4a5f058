"""Accelerations by compiled iterative refinement with an error bound, where plain compiled code fails its checks."""

import numpy as np

from gauss.backends.certificate import TOLERANCE
from gauss.codegen import Kernel, write
from gauss.dynamics.engines.certified import PATIENCE, CertifiedEngine
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from gauss.integrators import Rates
from gauss.system import State, System


class RefinedEngine(CertifiedEngine):
    """Certified accelerations; above the compile threshold by compiled iterative refinement with an error bound.

    Parameters
    ----------
    system : System
        A smooth system (see :func:`gauss.dynamics.conditions.obstacles`).
    laws : Laws
        Its loads, all of which are traced.
    """

    def __init__(self, system: System, laws: Laws):
        super().__init__()
        self.laws, self.asked, self.found = laws, 0, 0

    @property
    def name(self) -> str:
        """Method, in words."""
        mostly = f"{self.found} times careful machine code that knows its error, else " if self.found else ""
        return mostly + super().name

    def rates(self, system: System, state: State, load=None, loads=None) -> Rates:
        """As :meth:`gauss.dynamics.engines.certified.CertifiedEngine.rates`; the compiled code evaluates all loads."""
        self.asked += 1
        if self.asked > PATIENCE and loads is None:
            make = lambda: Kernel(self._written(system), batch=False)  # noqa: E731
            kernel, effort = system.dynamics.on_demand((RefinedEngine, self.laws.key), make), load
            given = np.concatenate([[state.t], state.q, state.v, np.zeros(system.n_v) if effort is None else effort])
            acceleration, power, (error,) = np.split(kernel(given), np.cumsum([system.n_v, 3]))
            if error <= TOLERANCE:
                self.evaluations, self.found = self.evaluations + 1, self.found + 1
                self.largest_error = max(self.largest_error, float(error))
                return Rates(acceleration, power)
        return super().rates(system, state, load, loads)

    def _written(self, system: System):
        return write(Program(system, self.laws).refined_rates, 1, system.n_q, system.n_v, system.n_v, name="careful")
