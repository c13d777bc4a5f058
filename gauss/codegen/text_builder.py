"""LLVM IR written as text: instructions of straight-line code are strings from the beginning.

An object of llvmlite for each instruction, printed at the end, takes 40 to 80 µs; a line of text 2 to 4 µs. The text is the
same but for the names of values.
"""

from itertools import count
from typing import NamedTuple

from llvmlite import ir

from gauss.codegen.ir_module import BIT, DOUBLE, INTEGER

ORDERED = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "==": "oeq", "!=": "one"}
SIGNED = {"<": "slt", "<=": "sle", ">": "sgt", ">=": "sge", "==": "eq", "!=": "ne"}
UNORDERED = {"<": "ult", "<=": "ule", ">": "ugt", ">=": "uge", "==": "ueq", "!=": "une"}
NEW = tuple.__new__  # of a named tuple, without the overhead of its own


class TextValue(NamedTuple):
    """Result of an instruction: what llvmlite asks of an operand, and its name without and with its type in the text."""

    type: ir.Type
    reference: str
    typed: str

    def get_reference(self) -> str:
        """Name of the value in the text."""
        return self.reference


class TextBuilder(ir.IRBuilder):
    """Builder that writes the frequent instructions as text, and leaves the others to llvmlite.

    Values of the only block of a function are numbers instead of names, which LLVM reads in two thirds of the time; they
    must stand in order, so that there is no other builder.
    """

    def __init__(self, block: ir.Block, is_only_block: bool = False):
        super().__init__(block)
        self._mark = "%" if is_only_block else "%t"
        self._numbers = block.function.__dict__.setdefault("numbers_of_values", count())  # one sequence for all builders
        self._called: dict[str, str] = {}  # beginning of the calls of each function
        self._arguments = {id(x): f"{x.type} {x.get_reference()}" for x in block.function.args}  # of the function

    def _value(self, kind: ir.Type, text: str) -> TextValue:
        return self.written(kind, "double " if kind is DOUBLE else f"{kind} ", text)

    def written(self, kind: ir.Type, kind_text: str, text: str) -> TextValue:
        """Result of an instruction that is written already, for callers that know its type as text."""
        name = f"{self._mark}{next(self._numbers)}"
        self._block.instructions.insert(self._anchor, f"{name} = {text}")
        self._anchor += 1
        return NEW(TextValue, (kind, name, kind_text + name))

    def _line(self, text: str):
        self._block.instructions.insert(self._anchor, text)
        self._anchor += 1

    def _binary(self, operation: str, x, y, flags) -> TextValue:
        return self._value(x.type, f"{_flagged(operation, flags)} {_typed(x)}, {y.get_reference()}")

    def fadd(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Sum."""
        return self._binary("fadd", lhs, rhs, flags)

    def fsub(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Difference."""
        return self._binary("fsub", lhs, rhs, flags)

    def fmul(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Product."""
        return self._binary("fmul", lhs, rhs, flags)

    def fdiv(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Quotient."""
        return self._binary("fdiv", lhs, rhs, flags)

    def fneg(self, arg, name="", flags=()) -> TextValue:
        """Negative."""
        return self._value(arg.type, f"{_flagged('fneg', flags)} {_typed(arg)}")

    def mul(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Product of integers."""
        return self._binary("mul", lhs, rhs, flags)

    def add(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Sum of integers."""
        return self._binary("add", lhs, rhs, flags)

    def sub(self, lhs, rhs, name="", flags=()) -> TextValue:
        """Difference of integers."""
        return self._binary("sub", lhs, rhs, flags)

    def icmp_signed(self, cmpop, lhs, rhs, name="") -> TextValue:
        """Comparison of signed integers."""
        return self._compared("icmp", SIGNED[cmpop], lhs, rhs, ())

    def extract_element(self, vector, idx, name="") -> TextValue:
        """Element of a vector."""
        return self._value(vector.type.element, f"extractelement {_typed(vector)}, {_typed(idx)}")

    def insert_element(self, vector, value, idx, name="") -> TextValue:
        """Vector with another element."""
        return self._value(vector.type, f"insertelement {_typed(vector)}, {_typed(value)}, {_typed(idx)}")

    def fcmp_ordered(self, cmpop, lhs, rhs, name="", flags=()) -> TextValue:
        """Comparison that is false where an operand is not a number."""
        return self._compared("fcmp", ORDERED[cmpop], lhs, rhs, flags)

    def fcmp_unordered(self, cmpop, lhs, rhs, name="", flags=()) -> TextValue:
        """Comparison that is true where an operand is not a number."""
        return self._compared("fcmp", UNORDERED[cmpop], lhs, rhs, flags)

    def _compared(self, compare: str, operation: str, x, y, flags) -> TextValue:
        kind = ir.VectorType(BIT, x.type.count) if isinstance(x.type, ir.VectorType) else BIT
        return self._value(kind, f"{_flagged(compare, flags)} {operation} {_typed(x)}, {y.get_reference()}")

    def select(self, cond, lhs, rhs, name="", flags=()) -> TextValue:
        """One of two values."""
        return self._value(lhs.type, f"{_flagged('select', flags)} {_typed(cond)}, {_typed(lhs)}, {_typed(rhs)}")

    def uitofp(self, value, typ, name="") -> TextValue:
        """Number of an unsigned integer."""
        return self._value(typ, f"uitofp {_typed(value)} to {typ}")

    def bitcast(self, value, typ, name=""):
        """The same bits as a value of another type."""
        return value if value.type == typ else self._value(typ, f"bitcast {_typed(value)} to {typ}")

    def load(self, ptr, name="", align=None, typ=None) -> TextValue:
        """Value in memory."""
        kind = typ or ptr.type.pointee
        if kind is DOUBLE and align is None:  # most of them
            return self.written(kind, "double ", f"load double, {_typed(ptr)}")
        return self._value(kind, f"load {kind}, {_typed(ptr)}{_aligned(align)}")

    def store(self, value, ptr, align=None):
        """Write a value to memory."""
        self._line(f"store {_typed(value)}, {_typed(ptr)}{_aligned(align)}")

    def gep(self, ptr, indices, inbounds=False, name="", source_etype=None):
        """Address of an element of an array of numbers."""
        if source_etype is not None or inbounds or len(indices) != 1:
            return super().gep(ptr, indices, inbounds, name, source_etype)
        typed = self._arguments.get(id(ptr)) or _typed(ptr)
        begin = typed[: typed.rindex(" ") + 1]  # its type
        return self.written(ptr.type, begin, f"getelementptr {ptr.type.pointee}, {typed}, {_index(indices[0])}")

    def call(self, fn, args, name="", **how):
        """Call a function."""
        if how or not isinstance(fn, ir.Function):
            return super().call(fn, args, name, **how)
        if fn.name not in self._called:
            self._called[fn.name] = f"call {fn.ftype.return_type} {fn.get_reference()}"
        found = fn.ftype.return_type
        text = f"{self._called[fn.name]}({', '.join(map(_typed, args))})"
        return self._line(text) if isinstance(found, ir.VoidType) else self._value(found, text)


def written(constant: ir.Constant) -> TextValue:
    """A constant in the text, formatted once for all its uses."""
    return TextValue(constant.type, reference := constant.get_reference(), f"{constant.type} {reference}")


def _flagged(operation: str, flags) -> str:
    return " ".join((operation, *flags)) if flags else operation


def _typed(value) -> str:
    return value.typed if type(value) is TextValue else f"{value.type} {value.get_reference()}"


def _index(value) -> str:
    return f"i64 {value.constant}" if type(value) is ir.Constant and value.type is INTEGER else _typed(value)


def _aligned(align: int | None) -> str:
    return "" if align is None else f", align {align}"
