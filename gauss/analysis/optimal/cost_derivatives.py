"""Gradients and Hessians of costs in machine code, of the traced graph: forward derivatives of reverse ones."""

from collections.abc import Callable

import numpy as np

from gauss.analysis.user_functions import numbers_of
from gauss.codegen import Graph, Kernel, forward, reverse, write


class CostDerivatives:
    """A function of vectors to a number, with its gradient and Hessian.

    ArgumentError if it cannot be traced, or returns something other than a number.

    Parameters
    ----------
    function : callable
        Takes one array for each size; written with arithmetic and :mod:`gauss.math`.
    sizes : tuple of int
        Sizes of its arguments; derivatives are by all but the first one.
    what : str
        Name for messages.
    """

    def __init__(self, function: Callable, sizes: tuple[int, ...], what: str):
        def values(*given):
            found = numbers_of(function, given, what, 1)
            by = np.concatenate(given[1:])
            graph: Graph = by[0].graph
            total = graph.lift(found[0])
            slope = reverse(total, by)
            rows = [forward(slope, by, unit) for unit in np.eye(by.size)]
            return np.concatenate([[total], slope, *rows])

        self.n = sum(sizes[1:])
        self.kernel = Kernel(write(values, *sizes, name="cost"))

    def __call__(self, given: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values (k,), gradients (k, n) and Hessians (k, n, n) of arguments in columns (n_in, k)."""
        found = self.kernel(given).T
        return found[:, 0], found[:, 1 : 1 + self.n], found[:, 1 + self.n :].reshape(-1, self.n, self.n)
