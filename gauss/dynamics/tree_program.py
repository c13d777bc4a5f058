"""Functions of a large tree for compiled loops: forward dynamics and check by recursions over kernels of links."""

from functools import cached_property

from gauss.codegen.kernels import Correction, RowCode
from gauss.dynamics.error_scale import acceleration_scale
from gauss.dynamics.kernel_program import KernelProgram, ground_acceleration
from gauss.dynamics.tree_recursion import forward_tree_recursion, inverse_tree_recursion
from gauss.system import System


def tree_correction(system: System) -> Correction:
    """Correction of accelerations by inverse dynamics, and with it the recursions of forward and inverse dynamics."""
    floor = acceleration_scale(system) * float(system.scale.coordinates.min())
    return Correction(forward_tree_recursion(system), inverse_tree_recursion(system), ground_acceleration(system), floor)


class TreeProgram(KernelProgram):
    """Functions of a large tree; states are not projected, for a tree has no loop constraints."""

    @cached_property
    def _correction(self) -> Correction:
        return tree_correction(self.system)

    def _emit_rates(self, code: RowCode):
        n_q, n_v = self.system.n_q, self.system.n_v
        inputs, loads = code.room(n_q + 2 * n_v + 6), code.room(n_v + 3)
        self.put_load_forces(code, code.given, loads)
        code.copy(inputs, code.at(code.given, 1), n_q + n_v)
        code.copy(code.at(inputs, n_q + n_v), loads, n_v)
        self.put_ground(code, code.at(inputs, n_q + 2 * n_v))
        code.call(self._correction.forward, inputs, code.found)
        code.copy(code.at(code.found, n_v), code.at(loads, n_v), 3)

    def _emit_check(self, code: RowCode):
        n_q, n_v, x, n_in = self.system.n_q, self.system.n_v, code.given, self._correction.arity[0]
        inputs, loads, found = code.room(n_in), code.room(n_v + 3), code.room(n_v + 1)
        self.put_load_forces(code, x, loads)
        code.copy(inputs, code.at(x, 1), n_q + n_v)
        code.copy(code.at(inputs, n_q + n_v), code.at(x, self.layout.row), n_v)
        code.copy(code.at(inputs, n_q + 2 * n_v), loads, n_v)
        code.call(self._correction, inputs, found)
        code.put(code.found, 0, code.number(found, n_v))
        code.put(code.found, 1, code.motions.constant(0.0))
        self.put_energies(code, code.at(code.found, 2))
