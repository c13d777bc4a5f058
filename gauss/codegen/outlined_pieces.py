"""Outlining of long functions into pieces, compiled one by one: compile time grows faster than the length of a function.

Values that cross pieces are spilled to a frame in memory, in slots that are free again after the last use (linear scan;
Poletto and Sarkar, ACM TOPLAS 21, 1999).
"""

from collections import defaultdict
from contextlib import contextmanager
from heapq import heappop, heappush
from itertools import accumulate
from math import inf
from typing import NamedTuple

from llvmlite import ir

from gauss.codegen.expression import INDEX_OF, Expression
from gauss.codegen.graph import TURNS
from gauss.codegen.ir_blocks import BODY, POINTER, begin_function, input_reader, output_writer, strides
from gauss.codegen.ir_module import INTEGER, DeviceModule
from gauss.codegen.schedule import Schedule
from gauss.codegen.straight_line import Results, calling, passed_on, straight_line

LONGEST_UNCUT = 2_000  # operations above which a function is outlined into pieces
PIECE_LENGTH = (
    800  # operations of a piece: its frame stays in the nearest cache, and it is compiled twice as soon as longer ones
)
# the same two on a GPU, whose threads have 255 registers of 32 bits: in the RK4 step of a biped with loops, loads and stores
# of its frame and of spilled registers fall from 35 to 14 thousand, and the time of the assembler to a half
DEVICE_LENGTHS = 1_000, 400


def lengths(module: ir.Module) -> tuple[int, int]:
    """Operations above which a function is outlined into pieces, and of a piece."""
    return DEVICE_LENGTHS if isinstance(module, DeviceModule) else (LONGEST_UNCUT, PIECE_LENGTH)


def write_pieces(module: ir.Module, name: str, whole: Schedule, callees, width: int, strided: bool = False) -> ir.Function:
    """Code of a function for one vector width, in pieces, with the code of the functions that it calls for this width."""
    pieces = pieces_of(module, name, whole, callees, width, strided, lengths(module)[1])
    body, lanes = begin_function(module, name, width)
    frame = lanes.b.bitcast(lanes.b.alloca(lanes.kind, max(pieces.slots, 1)), POINTER)
    for code in pieces.codes:
        lanes.b.call(code, [*body.args, frame])
    lanes.b.ret_void()
    return body


class Pieces(NamedTuple):
    """Code of the pieces of a function, (in, in_stride, out, out_stride, frame) each, and the slots of their frame."""

    codes: list[ir.Function]
    slots: int


def pieces_of(module: ir.Module, name: str, whole: Schedule, callees, width: int, strided: bool, length: int) -> Pieces:
    """Pieces of about ``length`` operations, to be called in order; other arguments as of :func:`write_pieces`."""
    pieces = cut(whole, length)
    place, slots = _frame(whole, pieces)
    writer = _PieceWriter(module, whole, place, callees, width, strided)
    codes = [writer.code(f"{name}_{k}", piece) for k, piece in enumerate(pieces)]
    unchanged = writer.unchanged(f"{name}_{len(pieces)}")
    return Pieces(codes + unchanged, slots)


class _PieceWriter(NamedTuple):
    """Writer of the pieces of a function."""

    module: ir.Module
    whole: Schedule
    place: dict[int, int]
    callees: dict
    width: int
    strided: bool

    @contextmanager
    def piece(self, name: str):
        """Function of a piece; the context is its code: emitter, readers of inputs and outputs, writer of outputs, frame."""
        body, lanes = begin_function(self.module, name, self.width, ir.FunctionType(ir.VoidType(), [*BODY.args, POINTER]))
        body.attributes.add("noinline")
        source, in_stride, target, out_stride = strides(body, self.width, self.strided)
        written, write = input_reader(lanes, target, out_stride), output_writer(lanes, target, out_stride)
        yield lanes, input_reader(lanes, source, in_stride), written, write, body.args[-1]
        lanes.b.ret_void()

    def code(self, name: str, piece: Schedule) -> ir.Function:
        """Code of a piece."""
        place, inputs, outputs = self.place, {x.index: k for k, x in enumerate(self.whole.inputs)}, defaultdict(list)
        for k, x in enumerate(self.whole.outputs):
            if isinstance(x, Expression):
                outputs[x.index].append(k)
        at = lambda index: INTEGER(place[index] * self.width)  # noqa: E731
        called = {node.value for node in piece.nodes if node.op == "call"}
        with self.piece(name) as (lanes, read, written, write, frame):
            passed = [node for node in (*piece.nodes, *piece.inputs) if node.op == "call" and node.index in place]
            results = {node.index: Results(lanes, lanes.b.gep(frame, [at(node.index)]), node.value) for node in passed}

            def fetch(k):
                index = piece.inputs[k].index
                if index in results:
                    return results[index]
                if index in inputs:
                    return read(inputs[index])
                return lanes.load(frame, at(index)) if index in place else written(outputs[index][0])

            def keep(k, value):
                index = piece.outputs[k].index
                if index in place:
                    lanes.store(value, frame, at(index))
                for output in outputs[index]:
                    write(output, value)

            calls = calling(lanes, {callee: code for callee, code in self.callees.items() if callee in called})
            straight_line(lanes, piece, fetch, keep, calls, vectorise=False, results=results)
        return lanes.b.function

    def unchanged(self, name: str) -> list[ir.Function]:
        """Code that writes the outputs that are inputs or constants; none if there are none."""
        outputs = self.whole.outputs
        rest = [k for k, x in enumerate(outputs) if not isinstance(x, Expression) or x.op in ("symbol", "constant")]
        if not rest:
            return []
        given = [outputs[k] for k in rest]
        constants = list({x.index: x for x in given if isinstance(x, Expression) and x.is_constant}.values())
        with self.piece(name) as (lanes, read, _, write, _):
            scheduled = Schedule(constants, self.whole.inputs, given)
            straight_line(lanes, scheduled, read, lambda k, value: write(rest[k], value), vectorise=False)
        return [lanes.b.function]


def cut(scheduled: Schedule, length: int) -> list[Schedule]:
    """Pieces of about ``length`` operations, in order.

    The inputs of a piece are inputs of the function and values of earlier pieces, its outputs are values of later pieces and
    outputs of the function. A call and its results stay in one piece, and so do the sine and the cosine of one input.
    """
    runs = _runs(_together([node for node in scheduled.nodes if node.op not in ("constant", "symbol")]), length)
    piece_of = {node.index: k for k, run in enumerate(runs) for node in run}
    wanted = {x.index for x in scheduled.outputs if isinstance(x, Expression)}
    last = {x.index: k for k, run in enumerate(runs) for node in run for x in node.operands}
    return [_piece(run, k, piece_of, last, wanted) for k, run in enumerate(runs)]


def _frame(whole: Schedule, pieces: list[Schedule]) -> tuple[dict[int, int], int]:
    """Frame slots of values and of calls whose results are passed on as a whole, by their index; number of slots."""
    place, size = places(pieces, {x.index for x in whole.outputs if isinstance(x, Expression)})
    for call, count in passed_on(whole.nodes).items():
        place[call.index], size = size, size + count
    return place, size


def places(pieces: list[Schedule], outputs=frozenset()) -> tuple[dict[int, int], int]:
    """Frame slot of every node that another piece uses, by its index, and the number of slots; outputs need none."""
    last = {x.index: k for k, piece in enumerate(pieces) for x in piece.inputs}
    found: dict[int, int] = {}
    free: list[int] = []
    ends: dict[int, list[int]] = defaultdict(list)
    size = 0
    for k, piece in enumerate(pieces):
        for node in piece.outputs:
            if node.index in last and node.index not in outputs:
                found[node.index] = heappop(free) if free else size
                size = max(size, found[node.index] + 1)
                ends[last[node.index]].append(found[node.index])
        for place in ends.pop(k, ()):
            heappush(free, place)
    return found, size


def _together(nodes) -> list[Expression]:
    """The same order, but sines and cosines of inputs come first, and the results of a call follow it."""
    turns, rest, parts = [], [], defaultdict(list)
    for node in nodes:
        op = node.op
        if op == "item":
            parts[node.operands[0].index].append(node)
        elif op in TURNS and node.operands[0].op == "symbol":
            turns.append(node)
        else:
            rest.append(node)
    turns.sort(key=lambda node: node.operands[0].index)
    if parts:
        rest = [part for node in rest for part in (node, *parts.get(node.index, ()))]
    return turns + rest


def _runs(nodes, length: int) -> list[list[Expression]]:
    """Runs of about ``length`` nodes, cut where the fewest values are live."""
    crossing, runs, start = _crossing(nodes), [], 0
    while len(nodes) - start > 3 * length // 2:
        end = start + (length + 1) // 2
        window = crossing[end : end + length]
        end += window.index(min(window))
        while end < len(nodes) and crossing[end] == inf:
            end += 1
        runs.append(nodes[start:end])
        start = end
    return [*runs, nodes[start:]] if nodes[start:] else runs


def _crossing(nodes) -> list[float]:
    """Number of live values before each node; infinite where the node must not be separated from the one before."""
    last = [0] * (1 + max(map(INDEX_OF, nodes), default=0))  # number of the last user of each node: operands precede it
    for k, node in enumerate(nodes):
        for x in node.operands:
            last[x.index] = k
    change = [0] * (len(nodes) + 1)
    for k, node in enumerate(nodes):
        end = last[node.index]
        if end > k:
            change[k + 1] += 1
            change[end + 1] -= 1
    found: list[float] = list(accumulate(change[:-1]))
    for k, node in enumerate(nodes):
        if node.op == "item" or (node.op in TURNS and k and _same_angle(nodes[k - 1], node)):
            found[k] = inf
    return found


def _same_angle(one: Expression, other: Expression) -> bool:
    return one.op in TURNS and one.operands == other.operands


def _piece(run, k: int, piece_of, last, wanted) -> Schedule:
    used = {x.index: x for node in run for x in node.operands}
    constants = [x for x in used.values() if x.is_constant]
    given = [x for i, x in used.items() if not x.is_constant and piece_of.get(i) != k]
    kept = [node for node in run if node.op != "call" and (last.get(node.index, k) > k or node.index in wanted)]
    return Schedule([*constants, *run], given, kept)
