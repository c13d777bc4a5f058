"""Modules for a GPU: every thread moves one state, and has no vector registers.

Code for such a module is that for one state at a time, without SIMD lanes inside a state.
"""

from llvmlite import ir

from gauss.codegen.processor import width


class DeviceModule(ir.Module):
    """Module whose functions run on one thread of a GPU each, or lane by lane on this CPU."""


class SingleDeviceModule(DeviceModule):
    """The same in single precision: traced functions compute in it, memory and transcendental functions are double."""


def vector_width(module: ir.Module) -> int:
    """Doubles in one vector register of the processor that a module is for."""
    return 1 if isinstance(module, DeviceModule) else width()
