"""Operations of the graph as LLVM instructions, on one state or on as many as a vector register has lanes."""

import math

from llvmlite import ir

from gauss.codegen import machine
from gauss.codegen.expression import Expression
from gauss.codegen.intrinsics import external, intrinsic
from gauss.codegen.multiply_add import FUSED
from gauss.codegen.sincos import SinCos

DOUBLE, INTEGER, BIT = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
INTRINSICS = {"sqrt": "llvm.sqrt", "exp": "llvm.exp", "log": "llvm.log", "floor": "llvm.floor"}
INTRINSICS |= {"min": "llvm.minnum", "max": "llvm.maxnum"}
COMPARISONS = {"less": "<", "less_equal": "<="}
FLAGS = (
    "contract",
)  # of code for one state only, in which multiply–add may be fused; see gauss.codegen.multiply_add for the rest


class Lanes:
    """Writer of operations for one vector width.

    Parameters
    ----------
    module : llvmlite.ir.Module
        Where helpers are declared.
    width : int
        Number of states at a time.
    builder : llvmlite.ir.IRBuilder
        Where instructions go.
    """

    def __init__(self, module: ir.Module, width: int, builder: ir.IRBuilder):
        self.module, self.width, self.b = module, width, builder
        self.kind = kind(width)
        self.turned = {}

    def constant(self, value: float) -> ir.Constant:
        """Return the same number in every lane."""
        return ir.Constant(self.kind, value if self.width == 1 else [value] * self.width)

    def constants(self, values) -> ir.Constant:
        """Return a number for each lane, the last for all that are left."""
        return ir.Constant(self.kind, [float(value) for value in [*values, *values[-1:] * (self.width - len(values))]])

    def spread(self, value):
        """Put one number in every lane."""
        if self.width == 1:
            return value
        places = ir.Constant(ir.VectorType(ir.IntType(32), self.width), [0] * self.width)
        single = self.b.insert_element(ir.Constant(self.kind, ir.Undefined), value, ir.IntType(32)(0))
        return self.b.shuffle_vector(single, ir.Constant(self.kind, ir.Undefined), places)

    def some(self, mask):
        """Whether a condition holds in any lane."""
        return mask if self.width == 1 else self.b.icmp_unsigned("!=", self._bits(mask), ir.IntType(self.width)(0))

    def every(self, mask):
        """Whether a condition holds in all lanes."""
        return mask if self.width == 1 else self.b.icmp_unsigned("==", self._bits(mask), ir.IntType(self.width)(-1))

    def _bits(self, mask):
        return self.b.bitcast(mask, ir.IntType(self.width))

    def load(self, pointer, offset):
        """Load the lanes from ``pointer[offset:]``."""
        place = self.b.gep(pointer, [offset])
        if self.width == 1:
            return self.b.load(place)
        return self.b.load(self.b.bitcast(place, self.kind.as_pointer()), align=8)

    def store(self, value, pointer, offset):
        """Store the lanes to ``pointer[offset:]``."""
        place = self.b.gep(pointer, [offset])
        if self.width > 1:
            place = self.b.bitcast(place, self.kind.as_pointer())
        self.b.store(self.number(value), place, align=8)

    def number(self, value):
        """Return a comparison as 0 or 1, a number as it is."""
        return self.b.uitofp(value, self.kind) if _is_truth(value) else value

    def operation(self, node: Expression, values):
        """Result of a node whose operands are known."""
        b, op = self.b, node.op
        if op == "constant":
            return self.constant(node.value if math.isfinite(node.value) else float(node.value))
        x = [values[operand.index] for operand in node.operands]
        if op == "select":
            condition = x[0] if _is_truth(x[0]) else b.fcmp_unordered("!=", x[0], self.constant(0.0))
            return b.select(condition, self.number(x[1]), self.number(x[2]))
        x = [self.number(value) for value in x]
        if op in ARITHMETIC:
            return getattr(b, ARITHMETIC[op])(*x)
        if op in FUSED:
            return self.fused(op, *x)
        if op == "neg":
            return b.fneg(x[0])
        if op in ("sin", "cos"):
            return self._turn(node, x[0])
        if op in COMPARISONS:
            return b.fcmp_ordered(COMPARISONS[op], *x)
        if op == "atan2":
            return self._each_lane("atan2", x)
        return b.call(intrinsic(self.module, INTRINSICS[op], self.kind, len(x)), x)

    def fused(self, kind: str, x, y, z):
        """± x y ± z, rounded once where the processor can."""
        product, total = FUSED[kind]
        x, z = x if product > 0 else self.b.fneg(x), z if total > 0 else self.b.fneg(z)
        return self.b.call(intrinsic(self.module, "llvm.fmuladd", self.kind, 3), [x, y, z])

    def joined(self, values):
        """Lanes of several values, one after the other in one vector; the last is repeated up to a power of two."""
        count = 1 << (len(values) - 1).bit_length()
        values, width = [*values, *values[-1:] * (count - len(values))], self.width
        if width == 1:
            vector = ir.Constant(kind(count), ir.Undefined)
            for lane, value in enumerate(values):
                vector = self.b.insert_element(vector, value, ir.IntType(32)(lane))
            return vector
        while len(values) > 1:
            width *= 2
            pairs = zip(values[::2], values[1::2], strict=True)
            values = [self.b.shuffle_vector(x, y, _lanes(range(width))) for x, y in pairs]
        return values[0]

    def cut(self, vector, place: int):
        """Value that was put at a place of a longer vector by :meth:`joined`."""
        if self.width == 1:
            return self.b.extract_element(vector, ir.IntType(32)(place))
        lanes = range(place * self.width, (place + 1) * self.width)
        return self.b.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), _lanes(lanes))

    def turn_together(self, angles: dict):
        """Sines and cosines of angles {node: value}, as many at a time as a vector register has room for."""
        at_once = machine.width() // self.width
        nodes = list(angles) if at_once > 1 else []
        for start in range(0, len(nodes), at_once):
            part = nodes[start : start + at_once]
            if len(part) > 1:
                x = self.joined([angles[node] for node in part])
                both = self.b.call(self._sincos(x.type.count), [x])
                sines, cosines = self.b.extract_value(both, 0), self.b.extract_value(both, 1)
                for place, node in enumerate(part):
                    self.turned[node.index] = self.cut(sines, place), self.cut(cosines, place)

    def _sincos(self, width: int) -> ir.Function:
        known = self.module.globals.get(f"sincos_{width}")
        return known or SinCos(self.module, kind(width), width).function

    def _turn(self, node: Expression, x):
        """Sine or cosine; both come from one call."""
        key = node.operands[0].index
        if key not in self.turned:
            both = self.b.call(self._sincos(self.width), [x])
            self.turned[key] = self.b.extract_value(both, 0), self.b.extract_value(both, 1)
        return self.turned[key][0 if node.op == "sin" else 1]

    def _each_lane(self, name: str, x):
        function = external(self.module, name, DOUBLE, len(x))
        if self.width == 1:
            return self.b.call(function, x)
        total = ir.Constant(self.kind, ir.Undefined)
        for lane in range(self.width):
            place = ir.Constant(ir.IntType(32), lane)
            value = self.b.call(function, [self.b.extract_element(part, place) for part in x])
            total = self.b.insert_element(total, value, place)
        return total


def kind(width: int) -> ir.Type:
    """Type of a double in each of so many lanes."""
    return DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)


def _is_truth(value) -> bool:
    return value.type == BIT or (isinstance(value.type, ir.VectorType) and value.type.element == BIT)


def _lanes(places) -> ir.Constant:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(places)), list(places))
