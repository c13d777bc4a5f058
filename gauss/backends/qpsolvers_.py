"""Any QP solver that qpsolvers knows, by name; each call starts anew."""

import warnings
from contextlib import contextmanager, nullcontext

import numpy as np

from gauss.backends.programme import Outcome, Programme
from gauss.errors import BackendError, did_you_mean, extra

with extra():
    import qpsolvers

# Solvers that qpsolvers lets factorise H in its place, unless that is stored by rows: the next call would have the factor.
FACTORISING = ("pyqpmad",)
ON_JAX = ("jaxopt_osqp", "qpax")


class QPSolvers:
    """Adaptor to one solver of qpsolvers.

    Parameters
    ----------
    solver : str
        Its name there.
    **settings
        Passed on to it.

    Raises
    ------
    BackendError
        If the solver is not installed.
    """

    def __init__(self, solver: str, **settings):
        if solver not in qpsolvers.available_solvers:
            raise BackendError(
                f"QP solver {solver!r} is not installed. {did_you_mean(solver, qpsolvers.available_solvers)} "
                f"To add it: pip install 'qpsolvers[{solver}]'."
            )
        self.name, self.settings = solver, settings

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        problem = converted(programme, self.name)
        with surroundings(self.name):
            return outcome(qpsolvers.solve_problem(problem, self.name, **self.settings), self.name)


def converted(programme: Programme, solver: str) -> qpsolvers.Problem:
    """Problem of qpsolvers, with dense matrices for a solver that takes no sparse ones; zeros are not stored."""
    dense = solver not in qpsolvers.sparse_solvers
    programme = programme if dense else programme.without_zeros()
    H, C, K = (m.toarray() if dense else m for m in (programme.H, programme.C, programme.K))
    if solver in FACTORISING:
        H = np.ascontiguousarray(H)
    return qpsolvers.Problem(
        H,
        programme.c,
        *((K, programme.k) if programme.k.size else (None, None)),
        *((C, programme.d) if programme.d.size else (None, None)),
    )


@contextmanager
def surroundings(solver: str):
    """Warnings silenced, and doubles for solvers on JAX; afterwards all is as the user had it."""
    with warnings.catch_warnings(), _doubles() if solver in ON_JAX else nullcontext():
        warnings.simplefilter("ignore")
        yield


def _doubles():
    """Context in which JAX computes in double precision, in this thread only."""
    import jax

    return jax.enable_x64(True) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64()


def outcome(solution: qpsolvers.Solution, solver: str) -> Outcome:
    """Status and values of a solution of qpsolvers."""
    if solution.x is None:
        return Outcome(None, None, None, False, f"{solver}: found no solution")
    message = f"{solver}: {'solved' if solution.found else 'claims no solution'}"
    parts = (solution.x, solution.y, solution.z)  # jaxopt's multipliers of rows that are not there have no axis
    x, y, z = (None if part is None or np.ndim(part) != 1 else np.asarray(part, dtype=float) for part in parts)
    return Outcome(x, y, z, bool(solution.found), message)


def installed() -> list[str]:
    """Return the names of the QP solvers that are installed."""
    return sorted(qpsolvers.available_solvers)
