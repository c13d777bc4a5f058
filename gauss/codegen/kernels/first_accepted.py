"""First accepted result: f(x, c) is evaluated for the candidates c in order until one is accepted."""

from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import Function, NativeFunction, Writer
from gauss.codegen.kernels.arrays import routine


@dataclass(frozen=True, eq=False)
class FirstAccepted(NativeFunction):
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
    name = "first_accepted"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return len(self.function.inputs) - 1, len(self.function.outputs) - 1

    def operations(self) -> dict[str, int]:
        """Operations of one evaluation."""
        return self.function.operations()

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one motion at a time."""
        body, (n, n_out) = writer.body(self.function, 1), self.arity
        r, source, target = routine(self, writer.module, width)
        given, found, rejected = r.buffer(n + 1), r.buffer(n_out + 1), r.variable(1.0)
        with r.each(n) as k:
            given[k] = source[k]
        for candidate in self.candidates:
            with r.when(rejected[0] > 0.0):
                given[n] = candidate
                r.call(body, given, 1, found, 1)
                rejected[0] = found[n_out]
        with r.each(n_out) as k:
            target[k] = found[k]
        return r.done()
