"""Functions that LLVM knows: for doubles, for vectors of doubles, for stretches of memory."""

from llvmlite import ir


def intrinsic(module: ir.Module, name: str, kind: ir.Type, arguments: int) -> ir.Function:
    """Declaration of e.g. ``llvm.sqrt.v8f64`` with as many arguments of this kind."""
    suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
    return external(module, f"{name}.{suffix}", kind, arguments)


def external(module: ir.Module, name: str, kind: ir.Type, arguments: int) -> ir.Function:
    """Declaration of a function from outside, once per module."""
    known = module.globals.get(name)
    return known or ir.Function(module, ir.FunctionType(kind, [kind] * arguments), name=name)


def copy(b: ir.IRBuilder, target, source, size: int):
    """Copy so many doubles; the two do not overlap."""
    byte, whole = ir.IntType(8).as_pointer(), ir.IntType(64)
    function = b.module.declare_intrinsic("llvm.memcpy", [byte, byte, whole])
    b.call(function, [b.bitcast(target, byte), b.bitcast(source, byte), whole(8 * size), ir.IntType(1)(0)])
