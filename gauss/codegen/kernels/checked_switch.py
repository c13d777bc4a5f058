"""Two ways to compute the same: a cheap one that knows when it is not to be trusted, and a careful one for then."""

from dataclasses import dataclass, field

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Lanes, Writer, copy


@dataclass(frozen=True, eq=False)
class CheckedSwitch:
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
        """Machine code; of many motions side by side, each takes what it needs."""
        cheap, careful, size = writer.body(self.cheap, width), writer.body(self.careful, width), len(self.outputs)
        kind = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
        function = ir.Function(writer.module, kind, name=writer.module.get_unique_name("guarded"))
        function.linkage = "internal"
        given, _, target, _ = function.args
        b, apart = ir.IRBuilder(function.append_basic_block("entry")), INTEGER(width)
        lanes, place = Lanes(writer.module, width, b), lambda k: INTEGER(k * width)
        found, safe = (b.bitcast(b.alloca(lanes.kind, size + 1), POINTER) for _ in range(2))
        b.call(cheap, [given, apart, found, apart])
        weakest = lanes.load(found, place(size))
        trusted = b.fcmp_ordered(">=", weakest, lanes.constant(self.limit))
        with b.if_else(lanes.every(trusted)) as (then, otherwise):
            with then:
                copy(b, target, found, size * width)
            with otherwise:
                b.call(careful, [given, apart, safe, apart])
                for k in range(size):
                    chosen = b.select(trusted, lanes.load(found, place(k)), lanes.load(safe, place(k)))
                    lanes.store(chosen, target, place(k))
        b.ret_void()
        return function
