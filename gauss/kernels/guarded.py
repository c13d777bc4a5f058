"""Two ways to compute the same: a cheap one that knows when it is not to be trusted, and a careful one for then."""

from dataclasses import dataclass, field

from llvmlite import ir

from gauss.tracing import DOUBLE, INTEGER, POINTER, Function, Writer, copy


@dataclass(frozen=True, eq=False)
class Guarded:
    """Outputs of ``cheap`` without its last, which says how far they can be trusted; below ``limit``, those of ``careful``.

    Parameters
    ----------
    cheap, careful : Function
        Functions of the same inputs.
    limit : float
        Least last output with which the cheap one is trusted.
    """

    cheap: Function
    careful: Function
    limit: float
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "inputs", range(len(self.careful.inputs)))
        object.__setattr__(self, "outputs", range(len(self.careful.outputs)))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one state."""
        cheap, careful, size, one = writer.body(self.cheap), writer.body(self.careful), len(self.outputs), INTEGER(1)
        kind = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
        function = ir.Function(writer.module, kind, name=writer.module.get_unique_name("guarded"))
        function.linkage = "internal"
        given, _, target, _ = function.args
        b = ir.IRBuilder(function.append_basic_block("entry"))
        found = b.alloca(DOUBLE, size + 1)
        b.call(cheap, [given, one, found, one])
        trusted = b.fcmp_ordered(">=", b.load(b.gep(found, [INTEGER(size)])), DOUBLE(self.limit))
        with b.if_else(trusted) as (then, otherwise):
            with then:
                copy(b, target, found, size)
            with otherwise:
                b.call(careful, [given, one, target, one])
        b.ret_void()
        return function
