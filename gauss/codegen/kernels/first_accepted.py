"""First accepted result: f(x, c) is evaluated for the candidates c in order until one is accepted."""

from dataclasses import dataclass, field

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, Writer
from gauss.codegen.kernels.arrays import Routine


@dataclass(frozen=True, eq=False)
class FirstAccepted:
    """Outputs of a function without its last, for the first candidate with last output 0, or for the last candidate.

    Parameters
    ----------
    function : Function
        (inputs, candidate) → (results, 0 where the candidate is accepted).
    candidates : tuple of float
        Candidates, in order.
    """

    function: Function
    candidates: tuple[float, ...]
    inputs: range = field(init=False)
    outputs: range = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "inputs", range(len(self.function.inputs) - 1))
        object.__setattr__(self, "outputs", range(len(self.function.outputs) - 1))

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        if width != 1:
            raise TypeError("candidates are compiled for one motion at a time.")
        body, n = writer.body(self.function, 1), len(self.inputs)
        r = Routine(writer.module, writer.module.get_unique_name("otherwise"), [POINTER, INTEGER, POINTER, INTEGER])
        r.function.linkage = "internal"
        source, in_stride, target, out_stride = r.arguments
        given, found, rejected = r.room(n + 1), r.room(len(self.outputs) + 1), r.cell(1.0)
        with r.each(n) as k:
            given[k] = source[k * in_stride]
        for candidate in self.candidates:
            with r.when(rejected[0] > 0.0):
                given[n] = candidate
                r.call(body, given, 1, found, 1)
                rejected[0] = found[len(self.outputs)]
        with r.each(len(self.outputs)) as k:
            target[k * out_stride] = found[k]
        return r.done()
