"""Parametrised system: systems of one kind with parameters for their different numbers, and common machine code."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Graph
from gauss.dynamics.parameters import with_numbers
from gauss.system import System


@dataclass(frozen=True)
class ParametrisedSystem:
    """Systems of one kind."""

    pattern: System  # one of them
    system: System  # system with parameters, expressions of a shared graph, for the numbers that differ
    varied: np.ndarray  # places of the parameters among the numbers of a system

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(f"p[{k}]" for k in range(len(self.varied)))


def parametrised(pattern: System, members: np.ndarray) -> ParametrisedSystem:
    """Parametrised system of systems of one kind.

    Parameters
    ----------
    pattern : System
        One of them.
    members : ndarray, shape (batch, n)
        Numbers of each, see :func:`gauss.dynamics.parameters.numbers`.
    """
    varied = np.flatnonzero((members != members[0]).any(axis=0))
    values, graph = members[0].astype(object), Graph(shared=True)
    values[varied] = [graph.symbol(f"p[{k}]") for k in range(len(varied))]
    return ParametrisedSystem(pattern, with_numbers(pattern, values, pattern.mechanics), varied)
