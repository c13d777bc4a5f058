"""Mass-weighted pseudo-inverse by singular values (Udwadia and Kalaba, Analytical Dynamics, 1996, eq. 3.2).

x = x_free + C⁺ (d − C x_free),   x = Φ^½ a
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import scaled
from gauss.backends.rank import ROWS_RANK, numerical_rank
from gauss.backends.solution import Answer


class Pinv:
    """Udwadia–Kalaba; least norm for redundant, least squares for inconsistent rows."""

    name = "pinv"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        if not form.d.size:
            return form.answer(form.x_free, np.zeros(0))
        U, sigma, Vt = np.linalg.svd(form.C.toarray(), full_matrices=False)
        rank = numerical_rank(sigma, ROWS_RANK)
        U, sigma, Vt = U[:, :rank], sigma[:rank], Vt[:rank]
        shift = U.T @ form.d / sigma - Vt @ form.x_free
        return form.answer(form.x_free + Vt.T @ shift, -U @ (shift / sigma))
