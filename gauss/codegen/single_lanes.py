"""Operations in single precision on one state: numbers are rounded where they are loaded, extended where they are stored.

Sine, cosine, exponential, logarithm and arc tangent are computed in double precision and rounded: they are few, and the
reduction of an angle needs more digits than a single has.
"""

from llvmlite import ir

from gauss.codegen.expression import Expression
from gauss.codegen.ir_module import DOUBLE
from gauss.codegen.lanes import Lanes

SINGLE = ir.FloatType()
LARGEST_SINGLE = 3.4028234663852886e38  # larger constants are infinite


class SingleLanes(Lanes):
    """Emitter of operations in single precision; memory is double."""

    def __init__(self, module: ir.Module, builder: ir.IRBuilder):
        super().__init__(module, 1, builder)
        self.kind, self._kind_text, self._constants = SINGLE, f"{SINGLE} ", {}

    def constant(self, value: float) -> ir.Constant:
        """Constant, rounded."""
        return ir.Constant(SINGLE, value if abs(value) <= LARGEST_SINGLE or value != value else float("inf") * value)

    def load(self, pointer, offset):
        """Load a number, rounded."""
        return self.b.fptrunc(super().load(pointer, offset), SINGLE)

    def store(self, value, pointer, offset):
        """Store a number, extended."""
        super().store(self.b.fpext(self.number(value), DOUBLE), pointer, offset)

    def _arithmetic(self, op: str, x: list):
        if op not in ("exp", "log", "atan2"):
            return super()._arithmetic(op, x)
        return self.b.fptrunc(super()._arithmetic(op, [self.b.fpext(value, DOUBLE) for value in x]), SINGLE)

    def _looked_up(self, node: Expression, x):
        return self.b.fptrunc(super()._looked_up(node, self.b.fpext(x, DOUBLE)), SINGLE)

    def _sincos(self, node: Expression, x):
        key = node.operands[0].index
        if key not in self.sincos_values:
            both = self.b.call(self._sincos_code(1), [self.b.fpext(x, DOUBLE)])
            one, other = (self.b.fptrunc(self.b.extract_value(both, k), SINGLE) for k in range(2))
            self.sincos_values[key] = one, other
        return self.sincos_values[key][0 if node.op == "sin" else 1]
