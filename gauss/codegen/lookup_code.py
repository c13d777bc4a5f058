"""Operations of tables in LLVM IR: a column is a constant array of the module, written as bytes, with NaN behind its end.

The row of a number among equally spaced breaks is found by a division and one comparison on each side, else by bisection.
"""

import numpy as np
from llvmlite import ir

from gauss.codegen.ir_module import DOUBLE, broadcast, in_every_lane, intrinsic, lane_by_lane, vector_of
from gauss.codegen.lookup import Column

PLACE, BYTE = ir.IntType(32), ir.IntType(8)


def lookup_code(module: ir.Module, op: str, column: Column, width: int) -> ir.Function:
    """Function of a vector of numbers that is one operation of a column, written once for each module and width."""
    name = f"{op}_of_{column.name}_{width}"
    known = module.globals.get(name)
    return known or _Lookup(module, name, op, column, width).function


class _Lookup:
    """Emitter of one function."""

    def __init__(self, module: ir.Module, name: str, op: str, column: Column, width: int):
        self.module, self.width = module, width
        self.kind, self.places = (vector_of(one, width) for one in (DOUBLE, PLACE))
        self.function = ir.Function(module, ir.FunctionType(self.kind, [self.kind]), name)
        self.function.linkage = "internal"
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        (x,) = self.function.args
        self.b.ret(getattr(self, f"_{op}")(column, x))

    def _all(self, kind: ir.Type, value) -> ir.Constant:
        """The same number in every lane."""
        return in_every_lane(kind, self.width, value)

    def _entry(self, column: Column, row):
        return self._read(self._array(column), self.b.fptosi(row, self.places))

    def _row(self, column: Column, x):
        array = self._array(Column([-float("inf"), *column.numbers, float("inf")]))
        spacing, count = column.spacing, column.numbers.size
        if spacing is None:
            found = self._bisected(array, x, count)
        else:
            found = self._divided(array, x, count, float(column.numbers[0]), spacing)
        found = self.b.select(self.b.fcmp_unordered("!=", x, x), self._all(PLACE, count + 1), found)  # NaN: behind the last
        return self.b.sitofp(found, self.kind)

    def _divided(self, array, x, count: int, first: float, spacing: float):
        """Row among ``count`` equally spaced breaks: a guess, and the one before or behind it."""
        b, one = self.b, self._all(PLACE, 1)
        guess = b.fadd(b.fdiv(b.fsub(x, self._all(DOUBLE, first)), self._all(DOUBLE, spacing)), self._all(DOUBLE, 1.0))
        for name, end in (("llvm.maxnum", 0.0), ("llvm.minnum", float(count))):
            guess = b.call(intrinsic(self.module, name, self.kind, 2), [guess, self._all(DOUBLE, end)])
        k = b.fptosi(guess, self.places)
        after = b.add(k, one)
        is_before = b.fcmp_ordered("<", self._read(array, k), x)
        is_after = b.fcmp_ordered("<", self._read(array, after), x)
        k = b.select(is_after, after, b.select(is_before, k, b.sub(k, one)))
        return b.select(b.icmp_signed("<", k, self._all(PLACE, 0)), self._all(PLACE, 0), k)

    def _bisected(self, array, x, count: int):
        """Row among ``count`` breaks by bisection, without branches but for the loop."""
        b = self.b
        begin, loop, end = b.block, b.append_basic_block("loop"), b.append_basic_block("end")
        b.branch(loop)
        b.position_at_end(loop)
        row, left = b.phi(self.places), b.phi(PLACE)  # breaks known to lie below, and those not compared yet
        row.add_incoming(self._all(PLACE, 0), begin)
        left.add_incoming(PLACE(count), begin)
        half = b.lshr(b.add(left, PLACE(1)), PLACE(1))
        further = b.add(row, broadcast(b, half, self.width))
        new = b.select(b.fcmp_ordered("<", self._read(array, further), x), further, row)
        rest = b.lshr(left, PLACE(1))
        row.add_incoming(new, loop)
        left.add_incoming(rest, loop)
        b.cbranch(b.icmp_signed(">", rest, PLACE(0)), loop, end)
        b.position_at_end(end)
        return new

    def _read(self, array, places):
        """Numbers of an array at the places of all lanes."""
        b = self.b
        return lane_by_lane(b, self.width, lambda place: b.load(b.gep(array, [place])), places)

    def _array(self, column: Column):
        """Pointer to a constant array; bytes are written and read faster than numbers."""
        known, content = self.module.globals.get(column.name), np.append(column.numbers, np.nan).tobytes()
        if known is None:
            known = ir.GlobalVariable(self.module, ir.ArrayType(BYTE, len(content)), column.name)
            known.initializer = ir.FormattedConstant(known.value_type, f'c"\\{content.hex(chr(92))}"')
            known.global_constant, known.linkage, known.align = True, "internal", 8
        return self.b.bitcast(known, DOUBLE.as_pointer())
