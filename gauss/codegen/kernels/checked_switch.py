"""A fast function with an error indicator, and a slower accurate function where the indicator rejects its result."""

from dataclasses import dataclass, field

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Lanes, Writer, copy


@dataclass(frozen=True, eq=False)
class CheckedSwitch:
    """Outputs of ``fast`` without its last, an accuracy indicator; below ``least_accuracy`` those of ``refined``.

    Parameters
    ----------
    fast, refined : Function
        Functions of the same inputs.
    limit : float
        Least value of the indicator with which the fast result is accepted.
    """

    fast: Function
    refined: Function
    least_accuracy: float
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "inputs", range(len(self.refined.inputs)))
        object.__setattr__(self, "outputs", range(len(self.refined.outputs)))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code; the choice is made lane by lane, and ``refined`` runs if any lane needs it."""
        fast, refined, size = writer.body(self.fast, width), writer.body(self.refined, width), len(self.outputs)
        kind = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, POINTER, INTEGER])
        function = ir.Function(writer.module, kind, name=writer.module.get_unique_name("guarded"))
        function.linkage = "internal"
        given, _, target, _ = function.args
        b, apart = ir.IRBuilder(function.append_basic_block("entry")), INTEGER(width)
        lanes, place = Lanes(writer.module, width, b), lambda k: INTEGER(k * width)
        found, safe = (b.bitcast(b.alloca(lanes.kind, size + 1), POINTER) for _ in range(2))
        b.call(fast, [given, apart, found, apart])
        accuracy = lanes.load(found, place(size))
        accepted = b.fcmp_ordered(">=", accuracy, lanes.constant(self.least_accuracy))
        with b.if_else(lanes.all_lanes(accepted)) as (then, otherwise):
            with then:
                copy(b, target, found, size * width)
            with otherwise:
                b.call(refined, [given, apart, safe, apart])
                for k in range(size):
                    chosen = b.select(accepted, lanes.load(found, place(k)), lanes.load(safe, place(k)))
                    lanes.store(chosen, target, place(k))
        b.ret_void()
        return function
