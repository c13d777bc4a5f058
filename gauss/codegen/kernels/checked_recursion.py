"""Sweeps that check each other: forward dynamics, and what inverse dynamics finds lacking, as functions of their own."""

from dataclasses import dataclass, field

import numpy as np
from llvmlite import ir

from gauss.codegen import DOUBLE, INTEGER, Function, Graph, Writer, begin_function, intrinsic, strip_mined_loop
from gauss.codegen.kernels.tree_recursion import TreeRecursion


class _TreeFunction:
    """What both functions are given, and how they are called."""

    def __post_init__(self):
        """Name inputs and outputs, so that it can be called like a traced function."""
        graph, (given, found) = Graph(), self._sizes()
        object.__setattr__(self, "inputs", list(graph.symbols("given", given)))
        object.__setattr__(self, "outputs", list(graph.symbols("result", found)))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state at a time."""
        if width != 1:
            raise TypeError(f"{self.name} is compiled for one state at a time.")
        body, lanes = begin_function(writer.module, f"{self.name}_{len(writer.module.functions)}", 1)
        self._write(_BodyWriter(writer, body, lanes.b))
        lanes.b.ret_void()
        return body


@dataclass(frozen=True, eq=False)
class Correction(_TreeFunction):
    """Change of accelerations that makes up for what inverse dynamics finds lacking, (q, v, q̈, forces) → (change, share).

    The share is the largest change over the largest acceleration; no number if any change is none.

    Parameters
    ----------
    forward, inverse : TreeRecursion
        Dynamics of a tree.
    ground : ndarray, shape (6,)
        Acceleration of the ground.
    floor : float
        Size of accelerations below which changes are compared with it.
    """

    forward: TreeRecursion
    inverse: TreeRecursion
    ground: np.ndarray
    floor: float
    name: str = "correction"
    inputs: list = field(init=False)
    outputs: list = field(init=False)

    def _sizes(self) -> tuple[int, int]:
        return sum(self.forward.sizes.values()) - self.ground.size + self.forward.result, self.forward.result + 1

    def operations(self) -> dict[str, int]:
        """Operations of both sweeps."""
        return _sum(self.forward.operations(), self.inverse.operations())

    def _write(self, code: "_BodyWriter"):
        n_v, b = self.forward.result, code.b
        v = self.forward.sizes["q"]  # where the rates begin
        asked = code.room(v + 2 * n_v + self.ground.size)
        code.each(v + 2 * n_v, lambda i: code.put(code.given(i), asked, i))
        code.constants(self.ground, asked, v + 2 * n_v)
        force, change, found = code.room(n_v), code.room(n_v), v + n_v
        code.call(self.inverse, asked, force)

        def lacks(i):
            lacking = b.fsub(code.given(b.add(i, INTEGER(found + n_v))), code.take(force, i))
            code.put(lacking, asked, b.add(i, INTEGER(found)))
            code.put(DOUBLE(0.0), asked, b.add(i, INTEGER(v)))

        code.each(n_v, lacks)
        code.constants(np.zeros(self.ground.size), asked, v + 2 * n_v)
        code.call(self.forward, asked, change)
        total, worst, size = code.cell(0.0), code.cell(0.0), code.cell(self.floor)

        def judge(i):
            own = code.size(code.take(change, i))
            b.store(b.fadd(b.load(total), own), total)
            code.raise_to(worst, own)
            code.raise_to(size, code.size(code.given(b.add(i, INTEGER(found)))))
            code.result(code.take(change, i), i)

        code.each(n_v, judge)
        nothing = b.fsub(b.load(total), b.load(total))  # unless it is no number
        code.result(b.fadd(b.fdiv(b.load(worst), b.load(size)), nothing), INTEGER(n_v))


@dataclass(frozen=True, eq=False)
class CorrectedRecursion(_TreeFunction):
    """Forward dynamics after one correction, (q, v, forces, t) → (q̈, share of the correction, gap, size of what is given).

    Parameters
    ----------
    correction : Correction
        The correction, and the dynamics.
    loads : Function
        (q, v, t) → (forces to be added, gap).
    """

    correction: Correction
    loads: Function
    name: str = "corrected"
    inputs: list = field(init=False)
    outputs: list = field(init=False)

    def _sizes(self) -> tuple[int, int]:
        return len(self.correction.inputs) - self.correction.forward.result + 1, self.correction.forward.result + 3

    def operations(self) -> dict[str, int]:
        """Operations of all that is called."""
        parts = self.correction, self.correction.forward, self.loads
        return _sum(*(part.operations() for part in parts))

    def _write(self, code: "_BodyWriter"):
        forward, ground, b = self.correction.forward, self.correction.ground, code.b
        n_v, effort = forward.result, len(self.inputs) - 1 - forward.result
        asked, state = code.room(effort + n_v + ground.size), code.room(effort + 1)
        code.each(effort, lambda i: code.put(code.given(i), state, i))
        code.put(code.given(INTEGER(effort + n_v)), state, INTEGER(effort))
        code.each(effort + n_v, lambda i: code.put(code.given(i), asked, i))
        loads, found, change, whole = (code.room(size) for size in (n_v + 1, n_v, n_v + 1, effort + 2 * n_v))
        code.call(self.loads, state, loads)

        def load(i):
            place = b.add(i, INTEGER(effort))
            code.put(b.fadd(code.take(asked, place), code.take(loads, i)), asked, place)

        code.each(n_v, load)
        code.constants(ground, asked, effort + n_v)
        code.call(forward, asked, found)
        code.each(effort, lambda i: code.put(code.take(asked, i), whole, i))

        def join(i):
            code.put(code.take(found, i), whole, b.add(i, INTEGER(effort)))
            code.put(code.take(asked, b.add(i, INTEGER(effort))), whole, b.add(i, INTEGER(effort + n_v)))

        code.each(n_v, join)
        code.call(self.correction, whole, change)
        code.each(n_v, lambda i: code.result(b.fadd(code.take(found, i), code.take(change, i)), i))
        total = code.cell(0.0)
        code.each(len(self.inputs), lambda i: b.store(b.fadd(b.load(total), code.size(code.given(i))), total))
        for k, value in enumerate((code.take(change, INTEGER(n_v)), code.take(loads, INTEGER(n_v)), b.load(total))):
            code.result(value, INTEGER(n_v + k))


class _BodyWriter:
    """Body of a function while it is written: its inputs and outputs, rooms for numbers, loops."""

    def __init__(self, writer: Writer, body: ir.Function, b: ir.IRBuilder):
        self.writer, self.b = writer, b
        self.source, self.in_stride, self.target, self.out_stride = body.args

    def given(self, i):
        """Input."""
        return self.take(self.source, self.b.mul(self.in_stride, i))

    def result(self, value, i):
        """Keep an output."""
        self.put(value, self.target, self.b.mul(self.out_stride, i))

    def take(self, room, i):
        """Number of a room."""
        return self.b.load(self.b.gep(room, [i]))

    def put(self, value, room, i):
        """Keep a number in a room."""
        self.b.store(value, self.b.gep(room, [i]))

    def constants(self, values, room, start: int):
        """Keep numbers that are known in a room."""
        for k, value in enumerate(values):
            self.put(DOUBLE(float(value)), room, INTEGER(start + k))

    def room(self, size: int):
        """Room for so many numbers."""
        with self.b.goto_entry_block():
            return self.b.alloca(DOUBLE, size)

    def cell(self, value: float):
        """Room for a number that changes."""
        room = self.room(1)
        self.b.store(DOUBLE(value), room)
        return room

    def raise_to(self, cell, value):
        """Keep the larger of a number and what is kept."""
        kept = self.b.load(cell)
        self.b.store(self.b.select(self.b.fcmp_ordered(">", value, kept), value, kept), cell)

    def size(self, value):
        """Absolute value."""
        return self.b.call(intrinsic(self.b.module, "llvm.fabs", DOUBLE, 1), [value])

    def each(self, count: int, do):
        """Write a loop over the whole numbers below a count."""
        strip_mined_loop(self.b, INTEGER(0), INTEGER(count), 1, do)

    def call(self, function, given, found):
        """Call a function on rooms."""
        self.b.call(self.writer.body(function), [given, INTEGER(1), found, INTEGER(1)])


def _sum(*parts: dict[str, int]) -> dict[str, int]:
    return {op: sum(part.get(op, 0) for part in parts) for op in dict.fromkeys(op for part in parts for op in part)}
