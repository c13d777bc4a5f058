"""A fast function with an error indicator, and a slower accurate function where the indicator rejects its result."""

from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Lanes, NativeFunction, Writer, copy
from gauss.codegen.text_builder import TextBuilder


@dataclass(frozen=True, eq=False)
class CheckedSwitch(NativeFunction):
    """Outputs of ``fast`` without its last, an accuracy indicator; below ``least_accuracy`` those of ``refined``.

    Parameters
    ----------
    fast, refined : Function
        Functions of the same inputs.
    least_accuracy : float
        Least value of the indicator with which the fast result is accepted.
    """

    fast: Function | NativeFunction
    refined: Function | NativeFunction
    least_accuracy: float
    name = "checked_switch"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return len(self.refined.inputs), len(self.refined.outputs)

    def operations(self) -> dict[str, int]:
        """Operations of the fast function."""
        return self.fast.operations()

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code; the choice is made lane by lane, and ``refined`` runs if any lane needs it."""
        fast, refined, size = writer.body(self.fast, width), writer.body(self.refined, width), len(self.outputs)
        function = self.begin(writer.module)
        given, _, target, _ = function.args
        b, apart = TextBuilder(function.append_basic_block("entry")), INTEGER(width)
        lanes, place = Lanes(writer.module, width, b), lambda k: INTEGER(k * width)
        found, safe = (b.bitcast(b.alloca(lanes.kind, size + 1), POINTER) for _ in range(2))
        b.call(fast, [given, apart, found, apart])
        accuracy = lanes.load(found, place(size))
        accepted = b.fcmp_ordered(">=", accuracy, lanes.constant(self.least_accuracy))
        with b.if_else(lanes.all_lanes(accepted)) as (all_accepted, some_rejected):
            with all_accepted:
                copy(b, target, found, size * width)
            with some_rejected:
                b.call(refined, [given, apart, safe, apart])
                for k in range(size):
                    chosen = b.select(accepted, lanes.load(found, place(k)), lanes.load(safe, place(k)))
                    lanes.store(chosen, target, place(k))
        b.ret_void()
        return function
