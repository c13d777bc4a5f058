"""Recursion along a large tree: one function per kind of link, called link by link.

Straight-line code grows with the scene and exceeds the instruction cache; a recursion does not. Quantities of a link lie
in its record; the parameters of links of one kind lie in a table.
"""

from dataclasses import dataclass

import numpy as np
from llvmlite import ir

from gauss.codegen import (
    INTEGER,
    POINTER,
    Function,
    Lanes,
    NativeFunction,
    Writer,
    constant_array,
    counted_loop,
    external,
    schedule,
    straight_line,
)
from gauss.codegen.text_builder import TextBuilder

VOID, BYTES = ir.VoidType(), ir.IntType(8).as_pointer()


@dataclass(frozen=True)
class LinkStep:
    """Step of a recursion at a link.

    Operands are pairs (space, index): "own" and "inner" are the records of the link and of its inner neighbour, "parameter"
    its parameters; "result" and the names of the input vectors (:class:`TreeRecursion`) are these vectors, from the
    entries of the link on.

    Parameters
    ----------
    function : Function
        Function of the step.
    reads, writes : list of (str, int)
        Operand of each input and output.
    adds : frozenset of int
        Outputs that are added to the present value.
    """

    function: Function
    reads: list
    writes: list
    adds: frozenset = frozenset()


@dataclass(frozen=True, eq=False)
class TreeRecursion(NativeFunction):
    """Recursion of several passes along a tree, as a function.

    Parameters
    ----------
    name : str
        Name in the code.
    sizes : dict
        Lengths of the input vectors, concatenated in this order; each has an entry in ``starts``, except "base".
    result : int
        Length of the result.
    passes : list of (dict, bool)
        Step of each kind of link, and whether the pass runs inward.
    kinds, inner : ndarray of int, shape (n,)
        Kind of each link, and its inner neighbour, −1 for the ground; inner links come first.
    starts : dict
        First entry of each link in each vector, {name: (n,)}; "result" among them.
    link_parameters : list of ndarray
        Parameters of each link.
    record : int
        Length of a record.
    ground : list of (int, str, int)
        Content of the record of the ground: (slot, vector, index); all other slots are zero.
    """

    name: str
    sizes: dict
    result: int
    passes: list
    kinds: np.ndarray
    inner: np.ndarray
    starts: dict
    link_parameters: list
    record: int
    ground: list

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return sum(self.sizes.values()), self.result

    def operations(self) -> dict[str, int]:
        """Number of operations of each kind, all links together."""
        total: dict[str, int] = {}
        for kind, links in zip(*np.unique(self.kinds, return_counts=True), strict=True):
            for steps, _ in self.passes:
                for op, number in steps[kind].function.operations().items():
                    total[op] = total.get(op, 0) + int(links) * number
        return total

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code of the recursion for one vector width."""
        return _TreeRecursionWriter(self, writer, width).write()


class _TreeRecursionWriter:
    def __init__(self, recursion: TreeRecursion, writer: Writer, width: int):
        self.recursion, self.writer, self.module, self.width = recursion, writer, writer.module, width
        lengths = np.array([len(part) for part in recursion.link_parameters])
        self.tables = {
            "kind": self._table("kind", recursion.kinds),
            "inner": self._table("inner", recursion.inner + 1),
            "parameter": self._table("at", np.concatenate([[0], np.cumsum(lengths)[:-1]])),
            "values": self._table("values", np.concatenate([*recursion.link_parameters, [0.0]])),
        } | {name: self._table(f"start_{name}", start) for name, start in recursion.starts.items()}

    def _table(self, name: str, values: np.ndarray) -> ir.GlobalVariable:
        """Constant array of the recursion, once for all widths."""
        return constant_array(self.module, f"{self.recursion.name}_{name}", values)

    def write(self) -> ir.Function:
        recursion, width = self.recursion, self.width
        body = recursion.begin(self.module)
        source, in_stride, target, out_stride = body.args
        b = TextBuilder(body.append_basic_block("entry"))
        n, bytes_ = len(recursion.kinds), INTEGER((len(recursion.kinds) + 1) * recursion.record * width * 8)
        room = b.call(external(self.module, "malloc", BYTES, [INTEGER]), [bytes_])
        records = b.bitcast(room, POINTER)
        lanes = Lanes(self.module, width, b)
        filled = {slot: self._vector(name) + index for slot, name, index in recursion.ground}
        for slot in range(recursion.record):
            value = lanes.load(source, b.mul(in_stride, INTEGER(filled[slot]))) if slot in filled else lanes.constant(0.0)
            lanes.store(value, records, INTEGER(slot * width))
        for number, (steps, inward) in enumerate(recursion.passes):
            codes = {kind: self._step(f"{recursion.name}_{number}_{kind}_{width}", step) for kind, step in steps.items()}
            self._along(b, n, inward, codes, [source, in_stride, target, out_stride, records])
        b.call(external(self.module, "free", VOID, [BYTES]), [room])
        b.ret_void()
        return body

    def _vector(self, name: str) -> int:
        """First entry of a vector in the input."""
        names = list(self.recursion.sizes)
        return sum(self.recursion.sizes[earlier] for earlier in names[: names.index(name)])

    def _along(self, b: ir.IRBuilder, n: int, inward: bool, codes, arguments):
        """Emit the loop over all links, with a call of the code of each kind."""
        with counted_loop(b, INTEGER(0), INTEGER(n)) as count:
            i = b.sub(INTEGER(n - 1), count) if inward else count
            joined = b.function.append_basic_block("next")
            first, *others = codes.items()
            switch = b.switch(self._entry(b, "kind", i), b.function.append_basic_block("kind"))
            targets = {first[0]: switch.default} | {kind: b.function.append_basic_block("kind") for kind, _ in others}
            for kind, block in targets.items():
                if kind != first[0]:
                    switch.add_case(INTEGER(int(kind)), block)
                b.position_at_end(block)
                b.call(codes[kind], [i, *arguments])
                b.branch(joined)
            b.position_at_end(joined)

    def _entry(self, b: ir.IRBuilder, table: str, i):
        return b.load(b.gep(self.tables[table], [INTEGER(0), i]))

    def _step(self, name: str, step: LinkStep) -> ir.Function:
        """Code of one kind of link: (link, source, in_stride, target, out_stride, records)."""
        kinds = [INTEGER, POINTER, INTEGER, POINTER, INTEGER, POINTER]
        code = ir.Function(self.module, ir.FunctionType(VOID, kinds), name)
        code.linkage = "internal"
        code.attributes.add("noinline")
        b = TextBuilder(code.append_basic_block("entry"))
        lanes = Lanes(self.module, self.width, b)
        i, source, in_stride, target, out_stride, records = code.args
        size = INTEGER(self.recursion.record * self.width)
        own = b.gep(records, [b.mul(b.add(i, INTEGER(1)), size)])
        inner = b.gep(records, [b.mul(self._entry(b, "inner", i), size)])
        at = {}

        def start(vector: str):
            if vector not in at:
                at[vector] = self._entry(b, vector, i)
            return at[vector]

        def load(space: str, index: int):
            if space in ("own", "inner"):
                return lanes.load(own if space == "own" else inner, INTEGER(index * self.width))
            if space == "parameter":
                place = b.add(start("parameter"), INTEGER(index))
                return lanes.broadcast(b.load(b.gep(self.tables["values"], [INTEGER(0), place])))
            place = b.add(start(space), INTEGER(self._vector(space) + index))
            return lanes.load(source, b.mul(in_stride, place))

        used = set(step.function.nodes)
        given = [
            load(*place) if symbol in used else None for symbol, place in zip(step.function.inputs, step.reads, strict=True)
        ]
        found: dict[int, ir.Value] = {}
        straight_line(lanes, schedule(step.function), given.__getitem__, found.__setitem__)
        for k, (space, index) in enumerate(step.writes):
            value = found[k]
            if space == "result":
                lanes.store(value, target, b.mul(out_stride, b.add(start("result"), INTEGER(index))))
                continue
            if k in step.adds:
                value = b.fadd(value, load(space, index))
            lanes.store(value, own if space == "own" else inner, INTEGER(index * self.width))
        b.ret_void()
        return code
