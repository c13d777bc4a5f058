"""Graph → straight-line LLVM IR: the same walk writes code for one state and for a SIMD vector of states.

A kernel is ``void name(i64 count, double* in, i64 in_stride, double* out, i64 out_stride)`` over structures of arrays:
input j of state i is ``in[j * in_stride + i]``.
"""

import math

from llvmlite import ir

from gauss.tracing.expression import Expression, reachable
from gauss.tracing.intrinsics import external, intrinsic
from gauss.tracing.sincos import SinCos

DOUBLE, INTEGER = ir.DoubleType(), ir.IntType(64)
ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
INTRINSICS = {"sqrt": "llvm.sqrt", "exp": "llvm.exp", "log": "llvm.log", "min": "llvm.minnum", "max": "llvm.maxnum"}
# multiply–add may be fused, nothing else may be changed: results do not depend on the width of the batch but for rounding
FLAGS = ("contract",)


class Writer:
    """Writer of one module that holds a kernel.

    Parameters
    ----------
    inputs : sequence of Expression
        Symbols, in the order of the kernel's input.
    outputs : sequence of Expression or float
        What is computed, in the order of its output.
    """

    def __init__(self, inputs, outputs):
        self.inputs, self.outputs = list(inputs), list(outputs)
        self.nodes = reachable(self.outputs)
        strangers = [n.value for n in self.nodes if n.op == "symbol" and n not in set(self.inputs)]
        if strangers:
            raise TypeError(f"the outputs depend on {', '.join(strangers[:5])}, which is no input of the kernel.")
        self.module = ir.Module(name="gauss")

    def write(self, widths) -> str:
        """IR of the kernel ``run``: vectors of the widest width as long as they fit, then single states."""
        bodies = {width: self._body(width) for width in sorted({1, *widths}, reverse=True)}
        signature = ir.FunctionType(ir.VoidType(), [INTEGER, DOUBLE.as_pointer(), INTEGER, DOUBLE.as_pointer(), INTEGER])
        run = ir.Function(self.module, signature, name="run")
        count, source, in_stride, target, out_stride = run.args
        b = ir.IRBuilder(run.append_basic_block("entry"))
        start = ir.Constant(INTEGER, 0)
        for width, body in bodies.items():
            start = _loop(
                b,
                run,
                start,
                count,
                width,
                lambda b, i, body=body: b.call(body, [b.gep(source, [i]), in_stride, b.gep(target, [i]), out_stride]),
            )
        b.ret_void()
        return str(self.module)

    def _body(self, width: int) -> ir.Function:
        kind = DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)
        signature = ir.FunctionType(ir.VoidType(), [DOUBLE.as_pointer(), INTEGER, DOUBLE.as_pointer(), INTEGER])
        function = ir.Function(self.module, signature, name=f"body_{width}")
        function.linkage = "internal"
        function.args[0].add_attribute("noalias")
        function.args[2].add_attribute("noalias")
        b = ir.IRBuilder(function.append_basic_block("entry"))
        lanes = _Lanes(self.module, kind, width, b)
        source, in_stride, target, out_stride = function.args
        values = {}
        for place, symbol in enumerate(self.inputs):
            values[symbol.index] = lanes.load(source, b.mul(in_stride, ir.Constant(INTEGER, place)))
        for node in self.nodes:
            if node.op != "symbol":
                values[node.index] = lanes.operation(node, values)
        for place, output in enumerate(self.outputs):
            value = values[output.index] if isinstance(output, Expression) else lanes.constant(float(output))
            lanes.store(value, target, b.mul(out_stride, ir.Constant(INTEGER, place)))
        b.ret_void()
        return function


class _Lanes:
    """Operations on one state, or on as many as a vector has lanes."""

    def __init__(self, module: ir.Module, kind: ir.Type, width: int, builder: ir.IRBuilder):
        self.module, self.kind, self.width, self.b = module, kind, width, builder
        self.sincos, self.turned = None, {}

    def constant(self, value: float) -> ir.Constant:
        return ir.Constant(self.kind, value if self.width == 1 else [value] * self.width)

    def load(self, pointer, offset):
        place = self.b.gep(pointer, [offset])
        if self.width == 1:
            return self.b.load(place)
        loaded = self.b.load(self.b.bitcast(place, self.kind.as_pointer()))
        loaded.align = 8
        return loaded

    def store(self, value, pointer, offset):
        place = self.b.gep(pointer, [offset])
        if self.width > 1:
            place = self.b.bitcast(place, self.kind.as_pointer())
        self.b.store(value, place, align=8)

    def operation(self, node: Expression, values):
        b, op = self.b, node.op
        if op == "constant":
            return self.constant(node.value if math.isfinite(node.value) else float(node.value))
        x = [values[operand.index] for operand in node.operands]
        if op in ARITHMETIC:
            return getattr(b, ARITHMETIC[op])(*x, flags=FLAGS)
        if op == "neg":
            return b.fneg(x[0])
        if op in ("sin", "cos"):
            return self._turn(node, x[0])
        if op == "less":
            return b.fcmp_ordered("<", *x)
        if op == "select":
            return b.select(*x)
        if op == "atan2":
            return self._each_lane("atan2", x)
        return b.call(intrinsic(self.module, INTRINSICS[op], self.kind, len(x)), x)

    def _turn(self, node: Expression, x):
        """Sine or cosine; both come from one call."""
        key = node.operands[0].index
        if key not in self.turned:
            if self.sincos is None:
                self.sincos = SinCos(self.module, self.kind, self.width).function
            both = self.b.call(self.sincos, [x])
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


def _loop(b: ir.IRBuilder, function: ir.Function, start, count, width: int, body):
    """Write ``for (i = start; i + width <= count; i += width) body(i)``; return where it stopped."""
    before = b.block
    head, inside, after = (function.append_basic_block(f"{name}_{width}") for name in ("head", "inside", "after"))
    b.branch(head)
    b.position_at_end(head)
    i = b.phi(INTEGER)
    i.add_incoming(start, before)
    step = ir.Constant(INTEGER, width)
    b.cbranch(b.icmp_signed("<=", b.add(i, step), count), inside, after)
    b.position_at_end(inside)
    body(b, i)
    i.add_incoming(b.add(i, step), inside)
    b.branch(head)
    b.position_at_end(after)
    return i
