"""Modules of LLVM IR, for this CPU or for a GPU: functions declared in them, vectors of numbers.

On a GPU every thread moves one state and has no vector registers: its code is that for one state at a time, without SIMD
lanes inside a state.
"""

from collections.abc import Callable

from llvmlite import ir

from gauss.codegen.processor import width

BIT, INTEGER, DOUBLE = ir.IntType(1), ir.IntType(64), ir.DoubleType()
BYTES = ir.IntType(8).as_pointer()
LANE = ir.IntType(32)  # index of a lane


class DeviceModule(ir.Module):
    """Module whose functions run on one thread of a GPU each, or lane by lane on this CPU."""


class SingleDeviceModule(DeviceModule):
    """The same in single precision: traced functions compute in it, memory and transcendental functions are double."""


def vector_width(module: ir.Module) -> int:
    """Doubles in one vector register of the processor that a module is for."""
    return 1 if isinstance(module, DeviceModule) else width()


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
    function = b.module.declare_intrinsic("llvm.memcpy", [BYTES, BYTES, INTEGER])
    b.call(function, [b.bitcast(target, BYTES), b.bitcast(source, BYTES), INTEGER(8 * size), BIT(0)])


def vector_of(kind: ir.Type, lanes: int) -> ir.Type:
    """Type of so many numbers of a kind."""
    return kind if lanes == 1 else ir.VectorType(kind, lanes)


def in_every_lane(kind: ir.Type, lanes: int, value) -> ir.Constant:
    """Constant of a kind, the same in every lane."""
    return ir.Constant(vector_of(kind, lanes), value if lanes == 1 else [value] * lanes)


def broadcast(b: ir.IRBuilder, value, lanes: int):
    """A number in every lane."""
    if lanes == 1:
        return value
    undefined = ir.Constant(ir.VectorType(value.type, lanes), ir.Undefined)
    return b.shuffle_vector(b.insert_element(undefined, value, LANE(0)), undefined, lane_indices([0] * lanes))


def lane_indices(places) -> ir.Constant:
    """Constant of the lanes that a shuffle takes."""
    return ir.Constant(ir.VectorType(LANE, len(places)), list(places))


def joined_numbers(b: ir.IRBuilder, values):
    """Vector of some doubles, the number itself of one."""
    if len(values) == 1:
        return values[0]
    found = ir.Constant(ir.VectorType(DOUBLE, len(values)), ir.Undefined)
    for lane, value in enumerate(values):
        found = b.insert_element(found, value, LANE(lane))
    return found


def lane_by_lane(b: ir.IRBuilder, lanes: int, function: Callable, *x):
    """Doubles that a function of numbers emits for the numbers in each lane."""
    if lanes == 1:
        return function(*x)
    found = ir.Constant(ir.VectorType(DOUBLE, lanes), ir.Undefined)
    for lane in range(lanes):
        found = b.insert_element(found, function(*(b.extract_element(one, LANE(lane)) for one in x)), LANE(lane))
    return found
