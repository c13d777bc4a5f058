"""Singular values of the whole KKT matrix as a backend, see :mod:`gauss.backends.full_factor`."""

from gauss.backends.compulsion import Compulsion
from gauss.backends.full_factor import FullFactor
from gauss.backends.solution import Answer


class SVD:
    """Full KKT matrix by singular values, refined; equality rows only. The iterations count refinement steps."""

    name = "svd"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        return FullFactor(compulsion).refined()[0]
