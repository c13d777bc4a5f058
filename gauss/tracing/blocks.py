"""What all machine code here is made of: bodies over structures of arrays, and loops."""

from llvmlite import ir

from gauss.tracing.lanes import DOUBLE, INTEGER

POINTER = DOUBLE.as_pointer()
BODY = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])


def strip(b: ir.IRBuilder, start, count, width: int, body):
    """Write ``for (i = start; i + width <= count; i += width) body(i)``; return where it stopped."""
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
