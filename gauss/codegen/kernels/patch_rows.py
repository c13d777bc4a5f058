"""Row of a point of a patch of contact in machine code: the patch, found by a Python function, lies in an array of its own.

The number of the point and the address of that array come in the places of the signs of features
(:mod:`gauss.codegen.kernels.near_pairs`).
"""

from dataclasses import dataclass

from llvmlite import ir

from gauss.codegen import INTEGER, POINTER, Function, NativeFunction, Writer
from gauss.codegen.kernels.arrays import Array, routine
from gauss.codegen.kernels.near_pairs import MOVED, ROW, ROW_INPUTS

POINT = 7  # distance, place (3), normal (3) of a point
MASS_CENTRE = 28  # first place of the centre of mass in a column of a shape
NUMBER = 2 * MOVED + 1  # place of the number of the point in the input; the address of the array is next


@dataclass(frozen=True, eq=False)
class PatchRows(NativeFunction):
    """Row of one point, as of the rows of :class:`gauss.dynamics.contact.pair_kernels.PairKernels`."""

    row: Function  # (distance, place, normal, centres of mass of both bodies) → the row
    name = "patch_rows"

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        return ROW_INPUTS, ROW

    def operations(self) -> dict[str, int]:
        """Number of operations of each kind."""
        return self.row.operations()

    def write(self, writer: Writer, width: int) -> ir.Function:
        """Machine code, for one point at a time."""
        r, given, target = routine(self, writer.module, width)
        number, address = (r.b.fptosi(given[NUMBER + k].value, INTEGER) for k in range(2))
        point = Array(r.b, r.b.gep(r.b.inttoptr(address, POINTER), [r.b.mul(number, INTEGER(POINT))]))
        centres = [given[side + MASS_CENTRE + i] for side in (0, MOVED) for i in range(3)]
        for k, value in enumerate(r.inline(self.row, *(point[i] for i in range(POINT)), *centres)):
            target[k] = value
        return r.done()
