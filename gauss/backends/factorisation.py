"""Choice of the factorisation of the KKT system: by the spanning tree, sparse, or by singular values."""

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from gauss.backends.closure import Factor, outside
from gauss.backends.compulsion import Compulsion
from gauss.backends.full_factor import FullFactor
from gauss.backends.kkt_factor import KKTFactor
from gauss.backends.sparse_factor import SparseFactor
from gauss.errors import BackendError

SPARSE_FROM_ROWS = 150  # rows outside the tree from which on a sparse factorisation is faster than a dense one of these rows


def factors(compulsion: Compulsion) -> tuple[Callable[..., KKTFactor], ...]:
    """Factorisations by the tree in the order in which they are tried; the last one finds redundant rows best."""
    n_outside = outside(compulsion.structure)[0].size
    return (SparseFactor, Factor) if n_outside > SPARSE_FROM_ROWS else (Factor,)


def factored(compulsion: Compulsion, active: Sequence | np.ndarray = ()) -> KKTFactor:
    """Factorisation of a compulsion: by the tree, or of the whole matrix where a joint of the tree moves no inertia.

    BackendError if some acceleration is undetermined.
    """
    for factor in factors(compulsion):
        with suppress(BackendError):
            return factor(compulsion, active)
    return FullFactor(compulsion, active)
