"""Functions with LLVM IR written by hand, called like traced functions.

Loops, iterations and calls of LAPACK have no straight-line graph; here they are functions of a vector like any other, so
that traced code, kernels and integrator loops call them.
"""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from llvmlite import ir

from gauss.codegen.expression import Expression, graph_of
from gauss.codegen.graph import Graph
from gauss.codegen.ir_blocks import BODY

if TYPE_CHECKING:
    from gauss.codegen.emit import Writer


class NativeFunction:
    """Base of functions (inputs) → (outputs) that emit their own code; subclasses compare by identity.

    Attributes
    ----------
    name : str
        Name in the code.
    """

    name: str
    parameters: tuple[str, ...] = ()  # as of :class:`gauss.codegen.Function`

    @property
    def arity(self) -> tuple[int, int]:
        """Numbers of inputs and of outputs."""
        raise NotImplementedError

    @cached_property
    def inputs(self) -> list[Expression]:
        """Symbols of the inputs."""
        return list(Graph().symbols("given", self.arity[0]))

    @cached_property
    def outputs(self) -> list[Expression]:
        """Symbols of the outputs."""
        return list(Graph().symbols("result", self.arity[1]))

    def __call__(self, *arguments) -> np.ndarray:
        """Outputs (n_out,) for arguments that contain at least one expression; they are joined to one vector."""
        given = np.concatenate([np.ravel(np.asarray(argument, dtype=object)) for argument in arguments])
        return graph_of(given).call(self, given)

    def operations(self) -> dict[str, int]:
        """Approximate number of operations of each kind; none by default, beside those of the functions that it calls."""
        return {}

    def write(self, writer: "Writer", width: int) -> ir.Function:
        """Emit ``void name(double* in, i64 in_stride, double* out, i64 out_stride)`` for one vector width.

        Raises
        ------
        TypeError
            If it has no code for several states at a time.
        """
        raise NotImplementedError

    def begin(self, module: ir.Module) -> ir.Function:
        """Begin the code under a name of its own."""
        function = ir.Function(module, BODY, module.get_unique_name(f"{self.name}_body"))
        function.linkage = "internal"
        return function

    def begin_scalar(self, module: ir.Module, width: int) -> ir.Function:
        """Begin code for one state at a time.

        Raises
        ------
        TypeError
            If code for several states at a time is asked for.
        """
        if width != 1:
            raise TypeError(f"{self.name!r} is compiled for one state at a time.")
        return self.begin(module)
