"""Equations in, machine code out: expression graph, derivatives, LLVM emission, cache."""

from gauss.tracing.derivatives import forward, jacobian, reverse
from gauss.tracing.direct import Signature, direct
from gauss.tracing.emit import POINTER, Writer, straight_line
from gauss.tracing.expression import Expression, Graph, Scalar, as_number, count
from gauss.tracing.function import Function, write
from gauss.tracing.kernel import Kernel, trace
from gauss.tracing.lanes import DOUBLE, INTEGER, Lanes
from gauss.tracing.ldlt import LDLT
from gauss.tracing.substitute import substitute

__all__ = [
    "DOUBLE",
    "INTEGER",
    "LDLT",
    "Lanes",
    "POINTER",
    "Signature",
    "Writer",
    "Expression",
    "Function",
    "Graph",
    "Kernel",
    "Scalar",
    "as_number",
    "count",
    "direct",
    "forward",
    "jacobian",
    "reverse",
    "straight_line",
    "substitute",
    "trace",
    "write",
]
