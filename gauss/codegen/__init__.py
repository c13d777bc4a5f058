"""Code generation: expression graph → derivatives → schedule → LLVM IR → machine code of this CPU, cached on disk.

Python source that computes with floats is called once with symbols (:func:`write`) and becomes a :class:`Function`, a
graph of
scalar operations. A :class:`Kernel` is its machine code; :mod:`gauss.codegen.kernels` holds loops that call such functions.
"""

from gauss.codegen.branches import branches
from gauss.codegen.content_key import IdentityKey, content_key
from gauss.codegen.derivatives import forward, jacobian, reverse
from gauss.codegen.emit import Writer, straight_line
from gauss.codegen.expression import Expression, Graph, Scalar, as_number, count, entered, graph_of, reachable
from gauss.codegen.fastcall import fastcall
from gauss.codegen.function import Function, write
from gauss.codegen.gc_pause import gc_pause
from gauss.codegen.intrinsics import copy, external, intrinsic
from gauss.codegen.ir_blocks import BODY, POINTER, constant_array, counted_loop, endless_loop
from gauss.codegen.kernel import Kernel, trace
from gauss.codegen.lanes import DOUBLE, FLAGS, INTEGER, Lanes
from gauss.codegen.ldlt import LDLT, least_degree
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.outlining import fresh_symbols, outlined
from gauss.codegen.python_wrapper import Interface, PythonWrapper
from gauss.codegen.recurrences import HIGHEST_ORDER, LEAD, LINE, ROW, without_series
from gauss.codegen.schedule import schedule
from gauss.codegen.staging import staged
from gauss.codegen.substitute import substitute
from gauss.codegen.taylor_series import Series

__all__ = [
    "BODY",
    "DOUBLE",
    "Expression",
    "FLAGS",
    "Function",
    "Graph",
    "HIGHEST_ORDER",
    "INTEGER",
    "IdentityKey",
    "Interface",
    "Kernel",
    "LDLT",
    "LEAD",
    "LINE",
    "Lanes",
    "NativeFunction",
    "POINTER",
    "PythonWrapper",
    "ROW",
    "Scalar",
    "Series",
    "Writer",
    "as_number",
    "branches",
    "constant_array",
    "content_key",
    "copy",
    "count",
    "counted_loop",
    "endless_loop",
    "entered",
    "external",
    "fastcall",
    "forward",
    "fresh_symbols",
    "gc_pause",
    "graph_of",
    "intrinsic",
    "jacobian",
    "least_degree",
    "outlined",
    "reachable",
    "reverse",
    "schedule",
    "staged",
    "straight_line",
    "substitute",
    "trace",
    "without_series",
    "write",
]
