"""Emission of LLVM IR by operators: ``x[i] = x[i] + a * y[i]`` on values and arrays of machine code.

Matrices are stored by rows. Loops and conditions are blocks of ``with``.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import blake2b

from llvmlite import ir

from gauss.codegen import (
    DOUBLE,
    FLAGS,
    INTEGER,
    Function,
    Lanes,
    NativeFunction,
    endless_loop,
    intrinsic,
    schedule,
    straight_line,
)

INTEGERS = INTEGER.as_pointer()


class Value:
    """A double, an integer or a condition of the emitted code."""

    def __init__(self, b: ir.IRBuilder, value: ir.Value):
        self.b, self.value = b, value

    @property
    def is_integer(self) -> bool:
        """Whether it is an integer."""
        return self.value.type == INTEGER

    def _other(self, other) -> ir.Value:
        return other.value if isinstance(other, Value) else ir.Constant(self.value.type, other)

    def _arithmetic(self, name: str, one, other) -> "Value":
        found = (
            getattr(self.b, name)(one, other) if self.is_integer else getattr(self.b, f"f{name}")(one, other, flags=FLAGS)
        )
        return Value(self.b, found)

    def __add__(self, other):
        return self._arithmetic("add", self.value, self._other(other))

    def __sub__(self, other):
        return self._arithmetic("sub", self.value, self._other(other))

    def __mul__(self, other):
        return self._arithmetic("mul", self.value, self._other(other))

    def __truediv__(self, other):
        return self._arithmetic("div", self.value, self._other(other))

    def __floordiv__(self, other):
        """Quotient of integers, neither of them negative."""
        return Value(self.b, self.b.sdiv(self.value, self._other(other)))

    def __neg__(self):
        return self._arithmetic("sub", ir.Constant(self.value.type, 0), self.value)

    __radd__, __rmul__ = __add__, __mul__

    def __rtruediv__(self, other):
        return self._arithmetic("div", self._other(other), self.value)

    def _compared(self, sign: str, other) -> "Value":
        compare = self.b.icmp_signed if self.is_integer else self.b.fcmp_ordered
        return Value(self.b, compare(sign, self.value, self._other(other)))

    def __lt__(self, other):
        return self._compared("<", other)

    def __le__(self, other):
        return self._compared("<=", other)

    def __gt__(self, other):
        return self._compared(">", other)

    def __ge__(self, other):
        return self._compared(">=", other)

    def __and__(self, other):
        return Value(self.b, self.b.and_(self.value, other.value))

    def __or__(self, other):
        return Value(self.b, self.b.or_(self.value, other.value))

    def __invert__(self):
        return Value(self.b, self.b.not_(self.value))


class Array:
    """Array of doubles or integers in memory."""

    def __init__(self, b: ir.IRBuilder, pointer: ir.Value):
        self.b, self.pointer = b, pointer

    def _place(self, index) -> ir.Value:
        return self.b.gep(self.pointer, [index.value if isinstance(index, Value) else INTEGER(index)])

    def __getitem__(self, index) -> Value:
        return Value(self.b, self.b.load(self._place(index)))

    def __setitem__(self, index, value):
        kind = self.pointer.type.pointee
        self.b.store(value.value if isinstance(value, Value) else ir.Constant(kind, value), self._place(index))

    def after(self, index) -> "Array":
        """Array that begins at an index."""
        return Array(self.b, self._place(index))


class Strided(Array):
    """Input or output of a function: entry i lies at ``pointer[stride * i]``."""

    def __init__(self, b: ir.IRBuilder, pointer: ir.Value, stride: Value):
        super().__init__(b, pointer)
        self.stride = stride

    def _place(self, index) -> ir.Value:
        return self.b.gep(self.pointer, [(self.stride * index).value])


class Routine:
    """Emitter of one function, without code yet, whose arguments are integers and pointers."""

    def __init__(self, function: ir.Function):
        self.module, self.function = function.module, function
        self.b = ir.IRBuilder(function.append_basic_block("entry"))
        # arguments of each sort, in order
        self.integers = [Value(self.b, argument) for argument in self.function.args if argument.type == INTEGER]
        self.arrays = [Array(self.b, argument) for argument in self.function.args if argument.type != INTEGER]

    def number(self, value: float) -> Value:
        """Return a constant."""
        return Value(self.b, ir.Constant(DOUBLE, float(value)))

    def buffer(self, size: int, kind: ir.Type = DOUBLE) -> Array:
        """Array on the stack of the function."""
        with self.b.goto_entry_block():
            pointer = self.b.alloca(kind, max(size, 1))
        return Array(self.b, pointer)

    def variable(self, value, kind: ir.Type = DOUBLE) -> Array:
        """Array of one entry on the stack, set to a value: a local variable."""
        variable = self.buffer(1, kind)
        variable[0] = value
        return variable

    def choose(self, condition: Value, one, other) -> Value:
        """Select one of two doubles by a condition."""
        values = [x.value if isinstance(x, Value) else ir.Constant(DOUBLE, float(x)) for x in (one, other)]
        return Value(self.b, self.b.select(condition.value, *values))

    def as_integer(self, condition: Value) -> Value:
        """Convert a condition to 0 or 1."""
        return Value(self.b, self.b.zext(condition.value, INTEGER))

    def as_double(self, x: Value) -> Value:
        """Convert an integer to a double."""
        return Value(self.b, self.b.sitofp(x.value, DOUBLE))

    def floor(self, x: Value) -> Value:
        """Largest integer that is no larger than a double, which is none of the largest and no NaN."""
        rounded = self.b.call(intrinsic(self.module, "llvm.floor", DOUBLE, 1), [x.value])
        return Value(self.b, self.b.fptosi(rounded, INTEGER))

    def maximum(self, x: Value, y: Value) -> Value:
        """Larger of two doubles; the second if the first is NaN."""
        return self.choose(x > y, x, y)

    def absolute(self, x: Value) -> Value:
        """Absolute value."""
        return Value(self.b, self.b.call(intrinsic(self.module, "llvm.fabs", DOUBLE, 1), [x.value]))

    def square_root(self, x: Value) -> Value:
        """Square root."""
        return Value(self.b, self.b.call(intrinsic(self.module, "llvm.sqrt", DOUBLE, 1), [x.value]))

    def inline(self, function: Function, *given: Value) -> list[Value]:
        """Outputs of a traced function, inlined here."""
        found: dict[int, ir.Value] = {}
        lanes = Lanes(self.module, 1, self.b)
        straight_line(lanes, schedule(function), lambda k: given[k].value, found.__setitem__, vectorise=False)
        return [Value(self.b, lanes.number(found[k])) for k in range(len(function.outputs))]

    def sum(self, count, term) -> Value:
        """Sum of ``term(i)`` for i from 0 to count − 1."""
        total = self.variable(0.0)
        with self.each(count) as i:
            total[0] = total[0] + term(i)
        return total[0]

    @contextmanager
    def loop(self) -> Iterator[Callable[[Value], None]]:
        """Write a loop; the context gives a function that leaves it where a condition holds."""
        with endless_loop(self.b) as leave_if:
            yield lambda condition: leave_if(condition.value)

    @contextmanager
    def each(self, count, first=0):
        """Write a loop over i from ``first`` to ``count − 1``."""
        place = self.variable(first, INTEGER)
        with self.loop() as leave_if:
            i = place[0]
            leave_if(i >= count)
            yield i
            place[0] = i + 1

    def copy(self, target: Array, source: Array, count):
        """Copy the first numbers of an array to another."""
        with self.each(count) as i:
            target[i] = source[i]

    @contextmanager
    def when(self, condition: Value):
        """Write a block that is executed where a condition holds."""
        with self.b.if_then(condition.value):
            yield

    def call(self, function: ir.Function, *arguments):
        """Call another function."""
        given = [x.pointer if isinstance(x, Array) else x.value if isinstance(x, Value) else INTEGER(x) for x in arguments]
        self.b.call(function, given)

    def done(self) -> ir.Function:
        """End the function."""
        self.b.ret_void()
        return self.function


def routine(function: NativeFunction, module: ir.Module, width: int) -> tuple[Routine, Strided, Strided]:
    """Begin the code of a function for one state at a time, with its inputs and outputs.

    TypeError if code for several states at a time is asked for.
    """
    r = Routine(function.begin_scalar(module, width))
    (given, result), (in_stride, out_stride) = r.arrays, r.integers
    return r, Strided(r.b, given.pointer, in_stride), Strided(r.b, result.pointer, out_stride)


def name_with(name: str, *constants) -> str:
    """Name of a subroutine into which constants are compiled: another one for other values."""
    return f"{name}_{blake2b(repr(constants).encode(), digest_size=8).hexdigest()}"


def subroutine(module: ir.Module, name: str, kinds) -> Routine:
    """Begin a function of integers and pointers, internal to a module."""
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), list(kinds)), name)
    function.linkage = "internal"
    return Routine(function)
