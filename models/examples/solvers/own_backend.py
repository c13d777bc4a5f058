"""
A backend of one's own
======================

Any object that takes a compulsion and returns an answer; it moves mechanisms, and is certified like all others.
"""

import numpy as np

import gauss
from gauss import view
from gauss.backends import Answer


class LeastSquares:
    """The KKT system by least squares: takes redundant rows."""

    name = "least squares"

    def __call__(self, compulsion):
        """Answer to one compulsion."""
        rows, n = np.hstack([compulsion.A, compulsion.B]), compulsion.Phi.size
        inertia = np.diag(np.append(compulsion.Phi, np.zeros(compulsion.P.size)))
        K = np.block([[inertia, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
        right = np.concatenate([compulsion.impressed, compulsion.P, compulsion.D])
        x = np.linalg.lstsq(K, right, rcond=None)[0]
        return Answer(x[:n], x[n : -len(rows)], x[-len(rows) :], np.zeros(0))


motion = gauss.simulate(gauss.load("four_bar"), 0.2, backend=LeastSquares(), rtol=1e-6, atol=1e-6)
print(motion.stats.method, "worst error", motion.stats.worst_error)
figure = view.plot_stroboscope(motion, flashes=6)
