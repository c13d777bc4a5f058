"""Forward dynamics of a large tree with one step of iterative refinement: q̈ ← q̈ + M⁻¹ (τ − ID(q, v, q̈)).

Inverse dynamics ID is an independent recursion; its residual is both the check of the accelerations and their correction.
"""

from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import Function, NativeFunction, Writer
from gauss.codegen.kernels.arrays import Array, Routine, Strided, routine
from gauss.codegen.kernels.tree_recursion import TreeRecursion


@dataclass(frozen=True, eq=False)
class Correction(NativeFunction):
    """Correction of accelerations by the inverse-dynamics residual, (q, v, q̈, forces) → (change, relative change).

    The relative change is the largest change over the largest acceleration; NaN if any change is NaN.

    Parameters
    ----------
    forward, inverse : TreeRecursion
        Dynamics of a tree.
    ground : ndarray, shape (6,)
        Acceleration of the ground.
    floor : float
        Lower bound of the largest acceleration, to which changes are compared.
    """

    forward: TreeRecursion
    inverse: TreeRecursion
    ground: np.ndarray
    floor: float
    name = "correction"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return sum(self.forward.sizes.values()) - self.ground.size + self.forward.result, self.forward.result + 1

    def operations(self) -> dict[str, int]:
        """Operations of both recursions."""
        return _sum(self.forward.operations(), self.inverse.operations())

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state at a time."""
        r, given, result = _begin(self, writer, width)
        n_v, v = self.forward.result, self.forward.sizes["q"]  # v: where the rates begin
        state = r.buffer(v + 2 * n_v + self.ground.size)
        r.copy(state, given, v + 2 * n_v)
        _fill(state.after(v + 2 * n_v), self.ground)
        force, change, found = r.buffer(n_v), r.buffer(n_v), v + n_v
        r.call(writer.body(self.inverse), state, 1, force, 1)
        with r.each(n_v) as i:
            state[i + found] = given[i + (found + n_v)] - force[i]
            state[i + v] = 0.0
        _fill(state.after(v + 2 * n_v), np.zeros(self.ground.size))
        r.call(writer.body(self.forward), state, 1, change, 1)
        total, worst, size = r.variable(0.0), r.variable(0.0), r.variable(self.floor)
        with r.each(n_v) as i:
            own = r.absolute(change[i])
            total[0] = total[0] + own
            worst[0] = r.maximum(own, worst[0])
            size[0] = r.maximum(r.absolute(given[i + found]), size[0])
            result[i] = change[i]
        result[n_v] = worst[0] / size[0] + (total[0] - total[0])  # total − total: 0, or NaN
        return r.done()


@dataclass(frozen=True, eq=False)
class CorrectedRecursion(NativeFunction):
    """Forward dynamics after one correction.

    (q, v, forces, t) → (q̈, relative change, constraint residual of the loads, sum of the sizes of the inputs).

    Parameters
    ----------
    correction : Correction
        The correction, and the dynamics.
    loads : Function
        (q, v, t) → (forces to be added, residual).
    """

    correction: Correction
    loads: Function
    name = "corrected"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        n_v = self.correction.forward.result
        return self.correction.arity[0] - n_v + 1, n_v + 3

    def operations(self) -> dict[str, int]:
        """Operations of all called functions."""
        parts = self.correction, self.correction.forward, self.loads
        return _sum(*(part.operations() for part in parts))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state at a time."""
        r, given, result = _begin(self, writer, width)
        forward, ground = self.correction.forward, self.correction.ground
        n_v, n_in = forward.result, self.arity[0]
        effort = n_in - 1 - n_v  # where the forces begin
        inputs, state = r.buffer(effort + n_v + ground.size), r.buffer(effort + 1)
        r.copy(state, given, effort)
        state[effort] = given[effort + n_v]
        r.copy(inputs, given, effort + n_v)
        loads, found, change, whole = (r.buffer(size) for size in (n_v + 1, n_v, n_v + 1, effort + 2 * n_v))
        r.call(writer.body(self.loads), state, 1, loads, 1)
        with r.each(n_v) as i:
            inputs[i + effort] = inputs[i + effort] + loads[i]
        _fill(inputs.after(effort + n_v), ground)
        r.call(writer.body(forward), inputs, 1, found, 1)
        r.copy(whole, inputs, effort)
        with r.each(n_v) as i:
            whole[i + effort] = found[i]
            whole[i + (effort + n_v)] = inputs[i + effort]
        r.call(writer.body(self.correction), whole, 1, change, 1)
        with r.each(n_v) as i:
            result[i] = found[i] + change[i]
        total = r.variable(0.0)
        with r.each(n_in) as i:
            total[0] = total[0] + r.absolute(given[i])
        for k, value in enumerate((change[n_v], loads[n_v], total[0]), start=n_v):
            result[k] = value
        return r.done()


def _begin(function: NativeFunction, writer: Writer, width: int) -> tuple[Routine, Strided, Strided]:
    r, given, result = routine(function, writer.module, width)
    for array in (given, result):
        array.pointer.add_attribute("noalias")
    return r, given, result


def _fill(target: Array, values: np.ndarray):
    for k, value in enumerate(values):
        target[k] = float(value)


def _sum(*parts: dict[str, int]) -> dict[str, int]:
    return {op: sum(part.get(op, 0) for part in parts) for op in dict.fromkeys(op for part in parts for op in part)}
