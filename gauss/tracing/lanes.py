"""Operations of the graph as LLVM instructions, on one state or on as many as a vector register has lanes."""

import math

from llvmlite import ir

from gauss.tracing import machine
from gauss.tracing.expression import Expression
from gauss.tracing.intrinsics import external, intrinsic
from gauss.tracing.sincos import SinCos

DOUBLE, INTEGER, BIT = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
INTRINSICS = {"sqrt": "llvm.sqrt", "exp": "llvm.exp", "log": "llvm.log", "min": "llvm.minnum", "max": "llvm.maxnum"}
COMPARISONS = {"less": "<", "less_equal": "<="}
# multiply–add may be fused, nothing else may be changed: results do not depend on the width of the batch but for rounding
FLAGS = ("contract",)


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

    def spread(self, value):
        """Put one number in every lane."""
        if self.width == 1:
            return value
        places = ir.Constant(ir.VectorType(ir.IntType(32), self.width), [0] * self.width)
        single = self.b.insert_element(ir.Constant(self.kind, ir.Undefined), value, ir.IntType(32)(0))
        return self.b.shuffle_vector(single, ir.Constant(self.kind, ir.Undefined), places)

    def load(self, pointer, offset):
        """Load the lanes from ``pointer[offset:]``."""
        place = self.b.gep(pointer, [offset])
        if self.width == 1:
            return self.b.load(place)
        loaded = self.b.load(self.b.bitcast(place, self.kind.as_pointer()))
        loaded.align = 8
        return loaded

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
            return getattr(b, ARITHMETIC[op])(*x, flags=FLAGS)
        if op == "neg":
            return b.fneg(x[0])
        if op in ("sin", "cos"):
            return self._turn(node, x[0])
        if op in COMPARISONS:
            return b.fcmp_ordered(COMPARISONS[op], *x)
        if op == "atan2":
            return self._each_lane("atan2", x)
        return b.call(intrinsic(self.module, INTRINSICS[op], self.kind, len(x)), x)

    def turn_together(self, angles: dict):
        """Sines and cosines of the angles {node: value} of one state, several at a time, each in a lane of its own."""
        nodes = list(angles) if self.width == 1 else []
        for start in range(0, len(nodes), machine.width()):
            part = nodes[start : start + machine.width()]
            if len(part) > 1:
                width = next(width for width in (2, 4, 8) if width >= len(part))
                x = ir.Constant(kind(width), [0.0] * width)
                for lane, node in enumerate(part):
                    x = self.b.insert_element(x, angles[node], ir.IntType(32)(lane))
                both = self.b.call(self._sincos(width), [x])
                results = [self.b.extract_value(both, k) for k in range(2)]
                for lane, node in enumerate(part):
                    self.turned[node.index] = [self.b.extract_element(result, ir.IntType(32)(lane)) for result in results]

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
