"""Functions of a large system with loops for compiled loops: forward dynamics, projection and check by a call graph."""

from functools import cached_property

from gauss.codegen.kernels import RowCode, RowFunction
from gauss.dynamics.call_graph_code import CallGraphCode
from gauss.dynamics.engines.call_graph import call_graph_code
from gauss.dynamics.kernel_program import KernelProgram


class CallGraphProgram(KernelProgram):
    """Functions of a large system with loops; singular configurations are not looked for, the check finds their errors."""

    may_lose_rank = False
    has_redundant_rows = False  # the proximal iteration takes redundant rows as they are

    @cached_property
    def projected_rates(self) -> RowFunction:
        """Function (t, q, v) → (q, v) on the constraints, q̈ and power there, 1, position residual."""
        n_q, n_v = self.system.n_q, self.system.n_v
        return RowFunction("projected_rates", 1 + n_q + n_v, n_q + 2 * n_v + 5, self._emit_projected_rates)

    @cached_property
    def _code(self) -> CallGraphCode:
        return call_graph_code(self.system, self.drift.gains)

    def _emit_rates(self, code: RowCode):
        state, n_v = 1 + self.system.n_q + self.system.n_v, self.system.n_v
        inputs, loads = code.room(state + n_v), code.room(n_v + 3)
        self.put_load_forces(code, code.given, loads)
        code.copy(inputs, code.given, state)
        code.copy(code.at(inputs, state), loads, n_v)
        code.call(self._code.forward, inputs, code.found)
        code.copy(code.at(code.found, n_v), code.at(loads, n_v), 3)

    def _emit_projected_rates(self, code: RowCode):
        n_q, n_v = self.system.n_q, self.system.n_v
        projected, state = code.room(n_q + n_v + 1), code.room(1 + n_q + n_v)
        code.call(self._code.project, code.given, projected)
        code.copy(state, code.given, 1)
        code.copy(code.at(state, 1), projected, n_q + n_v)
        code.copy(code.found, projected, n_q + n_v)
        code.call(self.rates, state, code.at(code.found, n_q + n_v))
        code.put(code.found, n_q + 2 * n_v + 3, code.motions.constant(1.0))
        code.put(code.found, n_q + 2 * n_v + 4, code.number(projected, n_q + n_v))

    def _emit_check(self, code: RowCode):
        row, n_v = self.layout.row, self.system.n_v
        inputs, loads = code.room(row + 2 * n_v + 3), code.room(n_v + 3)
        self.put_load_forces(code, code.given, loads)
        code.copy(inputs, code.given, row + n_v + 3)
        code.copy(code.at(inputs, row + n_v + 3), loads, n_v)
        code.call(self._code.check, inputs, code.found)
        code.put(code.found, 1, code.motions.constant(0.0))
        self.put_energies(code, code.at(code.found, 2))
