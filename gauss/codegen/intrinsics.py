"""LLVM intrinsics for doubles, vectors of doubles and memory; external functions."""

from llvmlite import ir

BYTES, WHOLE, NOT_VOLATILE = ir.IntType(8).as_pointer(), ir.IntType(64), ir.IntType(1)(0)


def intrinsic(module: ir.Module, name: str, kind: ir.Type, arguments: int) -> ir.Function:
    """Declare e.g. ``llvm.sqrt.v8f64``, all arguments and the result of one type."""
    suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f32" if isinstance(kind, ir.FloatType) else "f64"
    return external(module, f"{name}.{suffix}", kind, [kind] * arguments)


def external(module: ir.Module, name: str, result: ir.Type, arguments: list[ir.Type]) -> ir.Function:
    """Declare an external function, once per module."""
    known = module.globals.get(name)
    return known or ir.Function(module, ir.FunctionType(result, arguments), name=name)


def copy(b: ir.IRBuilder, target, source, size: int):
    """Copy ``size`` doubles between memory that does not overlap."""
    function = b.module.declare_intrinsic("llvm.memcpy", [BYTES, BYTES, WHOLE])
    b.call(function, [b.bitcast(target, BYTES), b.bitcast(source, BYTES), WHOLE(8 * size), NOT_VOLATILE])
