"""Equations in, machine code out: expression graph, derivatives, LLVM emission, cache."""

from gauss.tracing.blocks import POINTER, begin, strip
from gauss.tracing.branches import branches
from gauss.tracing.content import Same, content
from gauss.tracing.derivatives import forward, jacobian, reverse
from gauss.tracing.emit import Writer, straight_line
from gauss.tracing.enclosed import enclosed, fresh
from gauss.tracing.expression import Expression, Graph, Scalar, as_number, count, reachable
from gauss.tracing.fastcall import fastcall
from gauss.tracing.function import Function, write
from gauss.tracing.growing import growing
from gauss.tracing.intrinsics import copy, intrinsic
from gauss.tracing.kernel import Kernel, trace
from gauss.tracing.lanes import DOUBLE, FLAGS, INTEGER, Lanes
from gauss.tracing.ldlt import LDLT, least_degree
from gauss.tracing.plain import Interface, Plain
from gauss.tracing.recurrences import HIGHEST, LEAD, LINE, ROW, without_series
from gauss.tracing.schedule import schedule
from gauss.tracing.series import Series
from gauss.tracing.substitute import substitute

__all__ = [
    "DOUBLE",
    "FLAGS",
    "INTEGER",
    "LDLT",
    "LEAD",
    "LINE",
    "Lanes",
    "POINTER",
    "Writer",
    "Expression",
    "Function",
    "Graph",
    "HIGHEST",
    "Interface",
    "Kernel",
    "Plain",
    "ROW",
    "Same",
    "Scalar",
    "Series",
    "as_number",
    "begin",
    "branches",
    "copy",
    "content",
    "count",
    "fastcall",
    "enclosed",
    "forward",
    "fresh",
    "growing",
    "intrinsic",
    "jacobian",
    "reachable",
    "least_degree",
    "reverse",
    "schedule",
    "straight_line",
    "strip",
    "substitute",
    "trace",
    "without_series",
    "write",
]
