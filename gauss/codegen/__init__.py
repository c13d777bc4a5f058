"""Equations in, machine code out: expression graph, derivatives, LLVM emission, cache."""

from gauss.codegen.branches import branches
from gauss.codegen.content_key import Same, content
from gauss.codegen.derivatives import forward, jacobian, reverse
from gauss.codegen.emit import Writer, straight_line
from gauss.codegen.expression import Expression, Graph, Scalar, as_number, count, reachable
from gauss.codegen.fastcall import fastcall
from gauss.codegen.function import Function, write
from gauss.codegen.gc_pause import growing
from gauss.codegen.intrinsics import copy, intrinsic
from gauss.codegen.ir_blocks import POINTER, begin, strip
from gauss.codegen.kernel import Kernel, trace
from gauss.codegen.lanes import DOUBLE, FLAGS, INTEGER, Lanes
from gauss.codegen.ldlt import LDLT, least_degree
from gauss.codegen.outlining import enclosed, fresh
from gauss.codegen.python_wrapper import Interface, PythonWrapper
from gauss.codegen.recurrences import HIGHEST, LEAD, LINE, ROW, without_series
from gauss.codegen.schedule import schedule
from gauss.codegen.substitute import substitute
from gauss.codegen.taylor_series import Series

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
    "PythonWrapper",
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
