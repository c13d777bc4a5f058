"""Operations of the graph as LLVM instructions, on one state or on a SIMD vector of states."""

from llvmlite import ir

from gauss.codegen.elementary import elementary
from gauss.codegen.expression import Expression
from gauss.codegen.ir_module import (
    BIT,
    DOUBLE,
    LANE,
    DeviceModule,
    broadcast,
    external,
    intrinsic,
    joined_numbers,
    lane_by_lane,
    lane_indices,
    vector_of,
    vector_width,
)
from gauss.codegen.lookup import LOOKUPS
from gauss.codegen.lookup_code import lookup_code
from gauss.codegen.schedule import FUSED
from gauss.codegen.sincos import SinCos
from gauss.codegen.text_builder import TextValue, written

ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
INTRINSICS = {"sqrt": "llvm.sqrt", "exp": "llvm.exp", "log": "llvm.log", "floor": "llvm.floor"}
PREDICATES = {"less": "<", "less_equal": "<="}
# full vectors whose sines and cosines one call computes: the operations of one depend on each other for a hundred cycles,
# and the scheduler of a processor does not reach the next call; two take a quarter less
SIDE_BY_SIDE = 2
# fast-math flags of loops written for one state only: LLVM may fuse multiply–adds; gauss.codegen.schedule decides elsewhere
FLAGS = ("contract",)


class Lanes:
    """Emitter of operations for one vector width: so many states at a time."""

    def __init__(self, module: ir.Module, width: int, builder: ir.IRBuilder):
        self.module, self.width, self.b = module, width, builder
        self.kind = kind(width)
        self._kind_text = f"{self.kind} "
        self._multiply_add: str | None = None  # the call as text, before its operands
        self._constants: dict[float, TextValue] = module.__dict__.setdefault(f"constants of {width}", {})
        self._intrinsics: dict[str, ir.Function] = {}
        self._opposites: dict[int, tuple[ir.Value, ir.Value]] = {}  # −x and x, by the identity of −x
        self.sincos_values: dict[int, tuple[ir.Value, ir.Value]] = {}

    def constant(self, value: float) -> ir.Constant:
        """Constant, the same in every lane."""
        return ir.Constant(self.kind, value if self.width == 1 else [value] * self.width)

    def constants(self, values) -> ir.Constant:
        """Constant with one number per lane, the last one repeated."""
        return ir.Constant(self.kind, [float(value) for value in [*values, *values[-1:] * (self.width - len(values))]])

    def broadcast(self, value):
        """Broadcast one number to every lane."""
        return broadcast(self.b, value, self.width)

    def any_lane(self, mask):
        """Whether a condition holds in any lane."""
        return mask if self.width == 1 else self.b.icmp_unsigned("!=", self._bits(mask), ir.IntType(self.width)(0))

    def all_lanes(self, mask):
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
        """Convert a condition to 0 or 1; a number stays."""
        return self.b.uitofp(value, self.kind) if _is_condition(value) else value

    def operation(self, node: Expression, values):
        """Result of a node from the values of its operands."""
        op, kind = node.op, self.kind
        if op in ARITHMETIC:  # the most frequent ones are written without detours
            one, other = node.operands
            one, other = values[one.index], values[other.index]
            if type(one) is TextValue is type(other) and one.type is kind is other.type:
                text = self._kind_text
                return self.b.written(kind, text, f"{ARITHMETIC[op]} {text}{one.reference}, {other.reference}")
        elif op == "constant":
            return self._written_constant(float(node.value))
        x = [values[operand.index] for operand in node.operands]
        if op in FUSED and all([type(value) is TextValue and value.type is kind for value in x]):
            return self._written_fused(op, *x)
        return self._general(node, x)

    def _general(self, node: Expression, x: list):
        """Result of any operation on operands of any kind."""
        b, op = self.b, node.op
        if op == "select":
            condition = x[0] if _is_condition(x[0]) else b.fcmp_unordered("!=", x[0], self.constant(0.0))
            return b.select(condition, self.number(x[1]), self.number(x[2]))
        x = [value if value.type is self.kind else self.number(value) for value in x]
        if op in ("sin", "cos"):
            return self._sincos(node, x[0])
        return self._looked_up(node, x[0]) if op in LOOKUPS else self._arithmetic(op, x)

    def _looked_up(self, node: Expression, x):
        """Operation of a table, in double precision."""
        return self.b.call(lookup_code(self.module, node.op, node.value, self.width), [x])

    def _written_fused(self, op: str, x: TextValue, y: TextValue, z: TextValue) -> TextValue:
        """As :meth:`fused`, of numbers that are text."""
        write, kind, text = self.b.written, self.kind, self._kind_text
        product, total = FUSED[op]
        if product < 0:
            x = write(kind, text, f"fneg {x.typed}")
        if total < 0:
            z = write(kind, text, f"fneg {z.typed}")
        if self._multiply_add is None:
            self._multiply_add = f"call {text}{self._intrinsic('llvm.fmuladd', 3).get_reference()}("
        return write(kind, text, f"{self._multiply_add}{x.typed}, {y.typed}, {z.typed})")

    def _written_constant(self, value: float) -> TextValue:
        if value not in self._constants:
            self._constants[value] = written(self.constant(value))
        return self._constants[value]

    def _arithmetic(self, op: str, x: list):
        """Result of an operation on numbers."""
        b = self.b
        if op in ARITHMETIC:
            return getattr(b, ARITHMETIC[op])(*x)
        if op in FUSED:
            return self.fused(op, *x)
        if op == "neg":
            found = b.fneg(x[0])
            self._opposites[id(found)] = found, x[0]
            return found
        if op == "max" and self._is_opposite(*x):
            return b.call(self._intrinsic("llvm.fabs", 1), x[:1])
        if op in ("min", "max"):
            return self._extreme(op, *x)
        if op in PREDICATES:
            return b.fcmp_ordered(PREDICATES[op], *x)
        if op in ("exp", "log", "atan2") and isinstance(self.module, DeviceModule):
            return b.call(elementary(self.module, op), x)
        if op == "atan2":
            code = external(self.module, op, DOUBLE, [DOUBLE] * 2)
            return lane_by_lane(b, self.width, lambda *numbers: b.call(code, numbers), *x)
        return b.call(self._intrinsic(INTRINSICS[op], len(x)), x)

    def _extreme(self, op: str, x, y):
        """Smaller or larger of two numbers, NaN if one is; of equal ones, as 0 and −0, a constant, else the first."""
        b = self.b
        if _is_literal(x) or _is_literal(y):
            constant, number = (x, y) if _is_literal(x) else (y, x)
            is_constant = b.fcmp_ordered("<=", *((constant, number) if op == "min" else (number, constant)))
            return b.select(is_constant, constant, number)
        found = b.select(b.fcmp_ordered("<", *((y, x) if op == "min" else (x, y))), y, x)  # NaN if x is: one instruction
        return b.select(b.fcmp_unordered("!=", y, y), y, found)

    def _is_opposite(self, x, y) -> bool:
        """Whether one number is −1 times the other: the larger one is then |x|, one instruction instead of four."""
        return any(self._opposites.get(id(one), (one, None))[1] is other for one, other in ((x, y), (y, x)))

    def fused(self, kind: str, x, y, z):
        """± x y ± z, rounded once where the processor has the instruction."""
        product, total = FUSED[kind]
        x, z = x if product > 0 else self.b.fneg(x), z if total > 0 else self.b.fneg(z)
        return self.b.call(self._intrinsic("llvm.fmuladd", 3), [x, y, z])

    def _intrinsic(self, name: str, arguments: int) -> ir.Function:
        if name not in self._intrinsics:
            self._intrinsics[name] = intrinsic(self.module, name, self.kind, arguments)
        return self._intrinsics[name]

    def joined(self, values):
        """Concatenate the lanes of several values to one vector; the last is repeated up to a power of two."""
        count = 1 << (len(values) - 1).bit_length()
        values, width = [*values, *values[-1:] * (count - len(values))], self.width
        if width == 1:
            return joined_numbers(self.b, values)
        while len(values) > 1:
            width *= 2
            pairs = zip(values[::2], values[1::2], strict=True)
            values = [self.b.shuffle_vector(x, y, lane_indices(range(width))) for x, y in pairs]
        return values[0]

    def lane_group(self, vector, place: int):
        """Extract value ``place`` from a vector made by :meth:`joined`."""
        if self.width == 1:
            return self.b.extract_element(vector, LANE(place))
        lanes = range(place * self.width, (place + 1) * self.width)
        return self.b.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), lane_indices(lanes))

    def sincos_together(self, angles: dict):
        """Compute sines and cosines of angles {node: value}, one or two vector registers of angles at a time."""
        registers = vector_width(self.module) // self.width
        at_once = SIDE_BY_SIDE if registers == 1 < self.width else registers
        nodes = list(angles) if at_once > 1 else []
        for start in range(0, len(nodes), at_once):
            part = nodes[start : start + at_once]
            if len(part) > 1:
                x = self.joined([angles[node] for node in part])
                both = self.b.call(self._sincos_code(x.type.count), [x])
                sines, cosines = self.b.extract_value(both, 0), self.b.extract_value(both, 1)
                for place, node in enumerate(part):
                    self.sincos_values[node.index] = self.lane_group(sines, place), self.lane_group(cosines, place)

    def _sincos_code(self, width: int) -> ir.Function:
        known = self.module.globals.get(f"sincos_{width}")
        return known or SinCos(self.module, kind(width), width).function

    def _sincos(self, node: Expression, x):
        """Sine or cosine of a node; one call computes both."""
        key = node.operands[0].index
        if key not in self.sincos_values:
            both = self.b.call(self._sincos_code(self.width), [x])
            self.sincos_values[key] = self.b.extract_value(both, 0), self.b.extract_value(both, 1)
        return self.sincos_values[key][0 if node.op == "sin" else 1]


def kind(width: int) -> ir.Type:
    """Type of ``width`` doubles."""
    return vector_of(DOUBLE, width)


def _is_literal(value) -> bool:
    """Whether a value is written as its number; none of them is NaN (:mod:`gauss.codegen.simplification`)."""
    return isinstance(value, ir.Constant) or type(value) is TextValue and value.reference[0] not in "%@"


def _is_condition(value) -> bool:
    return value.type == BIT or (isinstance(value.type, ir.VectorType) and value.type.element == BIT)
