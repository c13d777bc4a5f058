"""Mass-weighted pseudo-inverse by singular values (Udwadia and Kalaba, Analytical Dynamics, 1996, eq. 3.2).

x = x_free + C⁺ (d − C x_free),   x = Φ^½ a
"""

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.backends.forms import scaled
from gauss.backends.solution import Answer

RANK = 1e-10  # singular value, relative to the largest, below which a direction of the rows is redundant


class Pinv:
    """Udwadia–Kalaba; least norm for redundant, least squares for inconsistent rows."""

    name = "pinv"

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        if not form.d.size:
            return form.answer(form.x_free, np.zeros(0))
        U, sigma, Vt = np.linalg.svd(form.C.toarray(), full_matrices=False)
        rank = int((sigma > RANK * sigma[0]).sum())
        U, sigma, Vt = U[:, :rank], sigma[:rank], Vt[:rank]
        shift = U.T @ form.d / sigma - Vt @ form.x_free
        return form.answer(form.x_free + Vt.T @ shift, -U @ (shift / sigma))
