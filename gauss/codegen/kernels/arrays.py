"""Emission of LLVM IR by operators: ``x[i] = x[i] + a * y[i]`` on values and arrays of machine code.

Matrices are stored by rows. Loops and conditions are blocks of ``with``.
"""

from contextlib import contextmanager

from llvmlite import ir

from gauss.codegen import DOUBLE, FLAGS, INTEGER, POINTER, Function, Lanes, intrinsic, schedule, straight_line

BIT = ir.IntType(1)


class Value:
    """A double, an integer or a condition of the emitted code.

    Parameters
    ----------
    b : llvmlite.ir.IRBuilder
        Insertion point.
    value : llvmlite.ir.Value
        Its LLVM value.
    """

    def __init__(self, b: ir.IRBuilder, value: ir.Value):
        self.b, self.value = b, value

    @property
    def is_whole(self) -> bool:
        """Whether it is an integer."""
        return self.value.type == INTEGER

    def _other(self, other) -> ir.Value:
        return other.value if isinstance(other, Value) else ir.Constant(self.value.type, other)

    def _arithmetic(self, name: str, one, other) -> "Value":
        found = getattr(self.b, name)(one, other) if self.is_whole else getattr(self.b, f"f{name}")(one, other, flags=FLAGS)
        return Value(self.b, found)

    def __add__(self, other):
        return self._arithmetic("add", self.value, self._other(other))

    def __sub__(self, other):
        return self._arithmetic("sub", self.value, self._other(other))

    def __mul__(self, other):
        return self._arithmetic("mul", self.value, self._other(other))

    def __truediv__(self, other):
        return self._arithmetic("div", self.value, self._other(other))

    def __neg__(self):
        return self._arithmetic("sub", ir.Constant(self.value.type, 0), self.value)

    __radd__, __rmul__ = __add__, __mul__

    def __rtruediv__(self, other):
        return self._arithmetic("div", self._other(other), self.value)

    def _compared(self, sign: str, other) -> "Value":
        compare = self.b.icmp_signed if self.is_whole else self.b.fcmp_ordered
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
    """Array of doubles or integers in memory.

    Parameters
    ----------
    b : llvmlite.ir.IRBuilder
        Insertion point.
    pointer : llvmlite.ir.Value
        Its address.
    """

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


class Routine:
    """Emitter of one function.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Module of the function.
    name : str
        Its name.
    kinds : sequence of llvmlite.ir.Type
        Types of its arguments.
    """

    def __init__(self, module: ir.Module, name: str, kinds):
        self.module = module
        self.function = ir.Function(module, ir.FunctionType(ir.VoidType(), list(kinds)), name=name)
        self.b = ir.IRBuilder(self.function.append_basic_block("entry"))
        pointers = (POINTER, INTEGER.as_pointer())
        self.arguments = [
            (Array if argument.type in pointers else Value)(self.b, argument) for argument in self.function.args
        ]

    def number(self, value: float) -> Value:
        """Return a constant."""
        return Value(self.b, ir.Constant(DOUBLE, float(value)))

    def room(self, size: int, kind: ir.Type = DOUBLE) -> Array:
        """Array on the stack of the function."""
        with self.b.goto_entry_block():
            pointer = self.b.alloca(kind, max(size, 1))
        return Array(self.b, pointer)

    def cell(self, value, kind: ir.Type = DOUBLE) -> Array:
        """Array of one entry on the stack, set to a value: a local variable."""
        cell = self.room(1, kind)
        cell[0] = value
        return cell

    def choose(self, condition: Value, one, other) -> Value:
        """Select one of two doubles by a condition."""
        values = [x.value if isinstance(x, Value) else ir.Constant(DOUBLE, float(x)) for x in (one, other)]
        return Value(self.b, self.b.select(condition.value, *values))

    def whole(self, condition: Value) -> Value:
        """Convert a condition to 0 or 1."""
        return Value(self.b, self.b.zext(condition.value, INTEGER))

    def larger(self, x: Value, y: Value) -> Value:
        """Larger of two doubles; the second if the first is NaN."""
        return self.choose(x > y, x, y)

    def size(self, x: Value) -> Value:
        """Absolute value."""
        return Value(self.b, self.b.call(intrinsic(self.module, "llvm.fabs", DOUBLE, 1), [x.value]))

    def root(self, x: Value) -> Value:
        """Square root."""
        return Value(self.b, self.b.call(intrinsic(self.module, "llvm.sqrt", DOUBLE, 1), [x.value]))

    def written(self, function: Function, *given: Value) -> list[Value]:
        """Outputs of a traced function, inlined here."""
        found: dict[int, ir.Value] = {}
        lanes = Lanes(self.module, 1, self.b)
        straight_line(lanes, schedule(function), lambda k: given[k].value, found.__setitem__, vectorise=False)
        return [Value(self.b, lanes.number(found[k])) for k in range(len(function.outputs))]

    def sum(self, count, term) -> Value:
        """Sum of ``term(i)`` for i from 0 to count − 1."""
        total = self.cell(0.0)
        with self.each(count) as i:
            total[0] = total[0] + term(i)
        return total[0]

    @contextmanager
    def loop(self):
        """Write an endless loop; the context gives a function that leaves it where a condition holds."""
        head, after = (self.function.append_basic_block(name) for name in ("loop", "after"))
        self.b.branch(head)
        self.b.position_at_end(head)

        def leave_if(condition: Value):
            on = self.function.append_basic_block("on")
            self.b.cbranch(condition.value, after, on)
            self.b.position_at_end(on)

        yield leave_if
        self.b.branch(head)
        self.b.position_at_end(after)

    @contextmanager
    def each(self, count, first=0):
        """Write a loop over i from ``first`` to ``count − 1``."""
        place = self.cell(first, INTEGER)
        with self.loop() as leave_if:
            i = place[0]
            leave_if(i >= count)
            yield i
            place[0] = i + 1

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
