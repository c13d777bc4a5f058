"""First answers of programmes, from an interior-point method: start points of references."""

from typing import NamedTuple

import numpy as np
from scipy import sparse

from gauss.bench.suite.instance import SuiteInstance
from gauss.errors import BackendError

GUESS_TOLERANCE = 1e-11  # relative, of residuals and gap: tight enough to separate active rows from inactive ones
NEARLY = ("Solved", "AlmostSolved", "InsufficientProgress", "MaxIterations", "NumericalError")  # confirmed afterwards anyway


class Guess(NamedTuple):
    """Answer (n,), multipliers (m,) of the equality rows, of the plain rows, and of the rows of the cones."""

    x: np.ndarray
    y: np.ndarray
    plain: np.ndarray
    cones: np.ndarray


def guessed(instance: SuiteInstance, sliding: np.ndarray | None = None) -> Guess:
    """Answer to about ten digits.

    BackendError if the interior-point method says that there is no answer.

    Parameters
    ----------
    instance : SuiteInstance
        The programme.
    sliding : ndarray, shape (n,), optional
        What is added to q.
    """
    import clarabel

    rows, right = instance.plain_rows()
    of_cones = sparse.csr_array(instance.G)[instance.orthant :]
    M = sparse.vstack([sparse.csr_array(instance.A), rows, of_cones], format="csc")
    kinds = [clarabel.ZeroConeT(instance.b.size), clarabel.NonnegativeConeT(right.size)]
    kinds = [kind for kind, size in zip(kinds, (instance.b.size, right.size), strict=True) if size]
    kinds += [clarabel.SecondOrderConeT(size) for size in instance.cones]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.presolve_enable, settings.max_iter = False, False, 200
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        setattr(settings, name, GUESS_TOLERANCE)
    q = instance.q if sliding is None else instance.q + sliding
    size = float(2.0 ** np.round(np.log2(np.abs(q).max(initial=0.0) or 1.0)))  # multipliers near one
    d = np.concatenate([instance.b, right, instance.h[instance.orthant :]])
    P = sparse.csc_matrix(sparse.triu(instance.P)) / size
    found = clarabel.DefaultSolver(P, q / size, sparse.csc_matrix(M), d, kinds, settings).solve()
    if str(found.status) not in NEARLY:
        raise BackendError(f"{instance.name}: no guess of the answer, the interior-point method says {found.status}.")
    x, multipliers = np.array(found.x), size * np.array(found.z)
    first, last = instance.b.size, instance.b.size + right.size
    return Guess(x, multipliers[:first], multipliers[first:last], multipliers[last:])
