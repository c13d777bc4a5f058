"""Function bodies over structures of arrays, and counted loops, in LLVM IR."""

from llvmlite import ir

from gauss.codegen.lanes import DOUBLE, INTEGER, Lanes
from gauss.codegen.text_builder import TextBuilder

POINTER = DOUBLE.as_pointer()
BODY = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
PAGE = 4096  # bytes


def begin_function(module: ir.Module, name: str, width: int, kind: ir.FunctionType = BODY) -> tuple[ir.Function, Lanes]:
    """Begin a function of :data:`BODY` for one vector width; its arrays do not overlap."""
    body = ir.Function(module, kind, name=name)
    body.linkage = "internal"
    for argument in body.args:
        if argument.type == POINTER:
            argument.add_attribute("noalias")
    b = TextBuilder(body.append_basic_block("entry"))
    if width > 1:
        _at_a_page(b)
    return body, Lanes(module, width, b)


def _at_a_page(b: ir.IRBuilder):
    """Align the stack frame of a function to a page.

    At other alignments its vectors are read and written up to a third slower.
    """
    room = b.alloca(ir.IntType(8))
    room.align = PAGE
    keep = ir.InlineAsm(ir.FunctionType(ir.VoidType(), [room.type]), "", "r", side_effect=True)  # against removal
    b.call(keep, [room])


def input_reader(lanes: Lanes, source, stride):
    """Function of k that loads input k of a body."""
    return lambda k: lanes.load(source, lanes.b.mul(stride, INTEGER(k)))


def output_writer(lanes: Lanes, target, stride):
    """Function of k and a value that stores output k of a body."""
    return lambda k, value: lanes.store(value, target, lanes.b.mul(stride, INTEGER(k)))


def strip_mined_loop(b: ir.IRBuilder, start, count, width: int, body):
    """Write ``for (i = start; i + width <= count; i += width) body(i)``; return the final i."""
    before = b.block
    head, inside, after = (b.function.append_basic_block(f"{name}_{width}") for name in ("head", "inside", "after"))
    b.branch(head)
    b.position_at_end(head)
    i = b.phi(INTEGER)
    i.add_incoming(start, before)
    step = ir.Constant(INTEGER, width)
    b.cbranch(b.icmp_signed("<=", b.add(i, step), count), inside, after)
    b.position_at_end(inside)
    body(i)
    i.add_incoming(b.add(i, step), b.block)
    b.branch(head)
    b.position_at_end(after)
    return i
