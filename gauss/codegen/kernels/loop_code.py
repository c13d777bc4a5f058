"""Emission of integrator loops: named numbers in memory, `while`, calls of traced functions on buffers.

A buffer holds one number per SIMD lane in each entry.
"""

from llvmlite import ir

from gauss.codegen import (
    DOUBLE,
    INTEGER,
    LINE,
    Buffers,
    Function,
    Lanes,
    NativeFunction,
    Writer,
    copy,
    counted_loop,
    endless_loop,
)
from gauss.codegen.kernels.energy_record import ENERGY_RECORD, ENERGY_SAMPLE, update
from gauss.codegen.kernels.loop_control import Control, Numbers
from gauss.codegen.text_builder import TextBuilder


class LoopCode:
    """Emitter of one loop function for so many motions at a time.

    Its arguments are arrays of doubles, named by ``pointers``, and the budget; ``control`` is a record of one type.
    """

    def __init__(self, writer: Writer, name: str, pointers, control: type[Numbers] = Control, width: int = 1):
        self.writer, self.names, self.width = writer, control.names(), width
        signature = ir.FunctionType(ir.VoidType(), [DOUBLE.as_pointer()] * len(pointers) + [INTEGER])
        self.function = ir.Function(writer.module, signature, name=name)
        self.pointer = dict(zip(pointers, self.function.args, strict=False))
        self.budget = self.function.args[-1]
        self.kind = DOUBLE
        self.b = TextBuilder(self.function.append_basic_block("entry"))
        self.lanes, self.buffers = Lanes(writer.module, width, self.b), Buffers(self.b)

    def number(self, value: float) -> ir.Constant:
        """Return a constant."""
        return ir.Constant(DOUBLE, float(value))

    def buffer(self, size: int, aligned: bool = False):
        """Buffer, allocated in the entry block."""
        room = self.buffers.room(self.lanes.kind, size, LINE if aligned else None)
        with self.b.goto_entry_block():
            return self.b.bitcast(room, DOUBLE.as_pointer())

    def counter(self, start):
        """Integer variable on the stack."""
        with self.b.goto_entry_block():
            room = self.b.alloca(INTEGER)
        self.b.store(start, room)
        return room

    def at(self, pointer, offset: int):
        """Pointer to an entry of a buffer."""
        return self.b.gep(pointer, [INTEGER(offset * self.width)])

    def get(self, name: str):
        """Load a number of the control."""
        return self.b.load(self._named(name))

    def set(self, name: str, value):
        """Store a number of the control."""
        value = self.number(value) if isinstance(value, int | float) else value
        self.b.store(value, self._named(name))

    def _named(self, name: str):
        return self.b.gep(self.pointer["control"], [INTEGER(self.names.index(name))])

    def add(self, name: str, amount=1.0):
        """Increase a counter."""
        amount = self.number(amount) if isinstance(amount, int | float) else amount
        self.set(name, self.b.fadd(self.get(name), amount))

    def is_multiple(self, counter: str, of: str):
        """Whether a counter is a multiple of another number."""
        return self.b.icmp_signed("==", self.b.srem(self.index(counter), self.index(of)), INTEGER(0))

    def index(self, name: str):
        """Load a counter as an integer."""
        return self.b.fptosi(self.get(name), INTEGER)

    def copy(self, target, source, size: int):
        """Copy numbers; the two do not overlap."""
        copy(self.b, target, source, size * self.width)

    def take(self, source, k: int):
        """Load an entry of a buffer."""
        return self.lanes.load(source, INTEGER(k * self.width))

    def put(self, value, target, k: int):
        """Store an entry of a buffer."""
        self.lanes.store(value, target, INTEGER(k * self.width))

    def join(self, *parts):
        """Buffer of numbers and arrays (pointer, size), concatenated."""
        sizes = [part[1] if type(part) is tuple else 1 for part in parts]
        room, place = self.buffer(sum(sizes)), 0
        for part, size in zip(parts, sizes, strict=True):
            if type(part) is tuple:
                self.copy(self.at(room, place), *part)
            else:
                self.put(self.number(part) if isinstance(part, int | float) else part, room, place)
            place += size
        return room

    def row(self, size: int):
        """Pointer to the next sample in ``out``."""
        return self.b.gep(self.pointer["out"], [self.b.mul(self.index("rows"), INTEGER(size))])

    def check(self, function: Function | NativeFunction, point, error):
        """Check the accelerations of a point; record the largest error, the constraint residual and the energies."""
        self.call(function, point, error)
        found, worst = self.b.load(error), self.get("worst")
        self.set("worst", self.b.select(self.b.fcmp_ordered(">", found, worst), found, worst))
        self.set("constraint_residual", self.b.load(self.at(error, 1)))
        following = self.energies_after([self.get(name) for name in ENERGY_RECORD], point, error)
        for name, value in zip(ENERGY_RECORD, following, strict=True):
            self.set(name, value)

    def energies_after(self, record, point, checked):
        """Energy record after the energy sample of a check."""
        found = self.buffer(len(ENERGY_RECORD))
        given = self.join(*record, self.take(point, 0), (self.at(checked, 2), ENERGY_SAMPLE))
        self.call(update(), given, found)
        return [self.take(found, k) for k in range(len(ENERGY_RECORD))]

    def call(self, function: Function | NativeFunction, given, found):
        """Call a traced function on buffers."""
        apart = INTEGER(self.width)
        self.b.call(self.writer.body(function, self.width), [given, apart, found, apart])

    def loop(self):
        """Write a loop; the context gives a function that leaves it where a condition holds."""
        return endless_loop(self.b)

    def each(self, count: int):
        """Write a loop over the whole numbers below a count."""
        return counted_loop(self.b, INTEGER(0), INTEGER(count))

    def finish(self):
        """End the function."""
        self.buffers.free()
        self.b.ret_void()
