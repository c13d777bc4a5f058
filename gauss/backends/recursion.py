"""The recursion along the spanning tree as a backend, see :mod:`gauss.backends.tree_factor`."""

from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.backends.kkt_factor import Correction, KKTFactor
from gauss.backends.solution import Answer


class Recursion:
    """The recursion, refined; equality rows only. The iterations count refinement steps."""

    name = "recursion"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        return Factor(compulsion).refined()[0]

    def solve_with(self, factor: KKTFactor) -> tuple[Answer, Correction]:
        """Answer by a given factorisation, and its last correction."""
        return factor.refined()
