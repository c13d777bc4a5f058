"""Any QP solver that qpsolvers knows, by name; each call starts anew."""

import warnings

import numpy as np
import qpsolvers

from gauss.backends.accuracy import accuracy
from gauss.backends.programme import Outcome, Programme
from gauss.errors import BackendError, known

ALWAYS = {"osqp": {"max_iter": 20_000}}


class QPSolvers:
    """Adaptor to one solver of qpsolvers.

    Parameters
    ----------
    solver : str
        Its name there.
    **settings
        Passed on to it; by default a tolerance of 1e-9.

    Raises
    ------
    BackendError
        If the solver is not installed.
    """

    def __init__(self, solver: str, **settings):
        if solver not in qpsolvers.available_solvers:
            raise BackendError(
                f"QP solver {solver!r} is not installed. {known(solver, qpsolvers.available_solvers)} "
                f"To add it: pip install 'qpsolvers[{solver}]'."
            )
        self.name = solver
        self.settings = accuracy(solver) | ALWAYS.get(solver, {}) | settings

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        solver = self.name
        dense = solver in qpsolvers.dense_solvers and solver not in qpsolvers.sparse_solvers
        programme = programme if dense else programme.without_zeros()
        H, C, K = (m.toarray() if dense else m for m in (programme.H, programme.C, programme.K))
        problem = qpsolvers.Problem(
            H,
            programme.c,
            *((K, programme.k) if programme.k.size else (None, None)),
            *((C, programme.d) if programme.d.size else (None, None)),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the certificate judges; hints on matrix formats are not for users
            result = qpsolvers.solve_problem(problem, solver, **self.settings)
        if result.x is None:
            return Outcome(None, None, None, False, f"{solver}: found no solution")
        message = f"{solver}: {'solved' if result.found else 'claims no solution'}"
        x, y, z = (None if part is None else np.asarray(part, dtype=float) for part in (result.x, result.y, result.z))
        return Outcome(x, y, z, bool(result.found), message)


def installed() -> list[str]:
    """Return the names of the QP solvers that are installed."""
    return sorted(qpsolvers.available_solvers)
