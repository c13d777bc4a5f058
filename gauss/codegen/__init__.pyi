from gauss.codegen.batch_code import BatchCode, batch_code
from gauss.codegen.branches import branches
from gauss.codegen.content_digest import IS_CONTENT, content_digest
from gauss.codegen.content_key import IdentityKey, content_key
from gauss.codegen.derivatives import forward, jacobian, reverse
from gauss.codegen.disk_cache import from_disk, is_noted, note
from gauss.codegen.emit import Writer, straight_line
from gauss.codegen.expression import Entry, Expression, Scalar, as_number, graph_of, reachable
from gauss.codegen.fastcall import EntryCode, entry_code, fastcall, made_from
from gauss.codegen.function import Function, count, fresh_symbols, outlined, write
from gauss.codegen.gc_pause import gc_pause
from gauss.codegen.graph import Graph
from gauss.codegen.ir_blocks import BODY, POINTER, Buffers, constant_array, counted_loop, endless_loop
from gauss.codegen.ir_module import DOUBLE, INTEGER, DeviceModule, copy, external, intrinsic, vector_width
from gauss.codegen.kernel import CallingKernel, Kernel, trace
from gauss.codegen.lanes import FLAGS, Lanes
from gauss.codegen.ldlt import LDLT, least_degree
from gauss.codegen.lookup import LOOKUPS, Column, looked_up
from gauss.codegen.native_function import NativeFunction
from gauss.codegen.optimiser import one_tier
from gauss.codegen.python_callback import PythonCallback, Receiver, callbacks_are_available
from gauss.codegen.python_wrapper import Interface, PythonWrapper
from gauss.codegen.recurrences import HIGHEST_ORDER, LEAD, LINE, ROW, without_series
from gauss.codegen.schedule import schedule
from gauss.codegen.staging import entered, staged
from gauss.codegen.substitute import numbers_of, substitute
from gauss.codegen.taylor_series import Series

__all__ = [
    "CallingKernel",
    "Column",
    "LOOKUPS",
    "looked_up",
    "DeviceModule",
    "vector_width",
    "BODY",
    "BatchCode",
    "DOUBLE",
    "EntryCode",
    "Entry",
    "Expression",
    "FLAGS",
    "Function",
    "Graph",
    "HIGHEST_ORDER",
    "INTEGER",
    "IS_CONTENT",
    "IdentityKey",
    "Interface",
    "Kernel",
    "LDLT",
    "LEAD",
    "LINE",
    "Buffers",
    "Lanes",
    "NativeFunction",
    "POINTER",
    "PythonCallback",
    "PythonWrapper",
    "Receiver",
    "ROW",
    "Scalar",
    "Series",
    "Writer",
    "as_number",
    "batch_code",
    "branches",
    "callbacks_are_available",
    "constant_array",
    "content_digest",
    "content_key",
    "copy",
    "count",
    "counted_loop",
    "endless_loop",
    "entry_code",
    "entered",
    "external",
    "fastcall",
    "made_from",
    "forward",
    "fresh_symbols",
    "from_disk",
    "is_noted",
    "note",
    "gc_pause",
    "graph_of",
    "intrinsic",
    "jacobian",
    "least_degree",
    "one_tier",
    "outlined",
    "reachable",
    "reverse",
    "schedule",
    "staged",
    "straight_line",
    "numbers_of",
    "substitute",
    "trace",
    "without_series",
    "write",
]
