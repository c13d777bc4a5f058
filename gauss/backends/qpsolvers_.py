"""Any QP solver that qpsolvers knows, by name, on the scaled form F2s."""

import warnings

import numpy as np
import qpsolvers
from scipy import sparse

from gauss.compulsion import Answer, Compulsion
from gauss.compulsion.forms import scaled
from gauss.compulsion.solution import failure
from gauss.errors import BackendError, known

# Accuracy as each solver names it; nothing for those that have no such setting. HiGHS regularises every QP unless told
# not to, which costs 4 digits.
TIGHT = {
    "clarabel": {"tol_feas": 1e-9, "tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9},
    "cvxopt": {"feastol": 1e-9, "abstol": 1e-9, "reltol": 1e-9},
    "daqp": {"primal_tol": 1e-9, "dual_tol": 1e-9},
    "ecos": {"feastol": 1e-9, "abstol": 1e-9, "reltol": 1e-9},
    "highs": {"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9, "qp_regularization_value": 0.0},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 20_000},
    "piqp": {"eps_abs": 1e-9, "eps_rel": 1e-9},
    "proxqp": {"eps_abs": 1e-9, "eps_rel": 0.0},
    "qpalm": {"eps_abs": 1e-9, "eps_rel": 1e-9},
    "scs": {"eps_abs": 1e-9, "eps_rel": 1e-9},
}


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
        self.name, self.solver = solver, solver
        self.settings = TIGHT.get(solver, {}) | settings

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        if not form.d.size and not form.k.size:
            return form.answer(form.x_free, np.zeros(0))  # nothing binds the bodies: nothing to ask for
        dense = self.solver in qpsolvers.dense_solvers and self.solver not in qpsolvers.sparse_solvers
        one = sparse.csc_matrix(sparse.eye_array(form.x_free.size))
        rows = sparse.csc_matrix(form.C)
        problem = qpsolvers.Problem(
            one.toarray() if dense else one,
            -form.x_free,
            *((form.K if dense else sparse.csc_matrix(form.K), form.k) if form.k.size else (None, None)),
            *((rows.toarray() if dense else rows, form.d) if form.d.size else (None, None)),
        )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the certificate judges; hints on matrix formats are not for users
                result = qpsolvers.solve_problem(problem, self.solver, **self.settings)
        except Exception as error:  # foreign solvers raise whatever they like
            return failure(compulsion, f"{self.solver}: {type(error).__name__}: {error}")
        if result.x is None:
            return failure(compulsion, f"{self.solver}: found no solution")
        y = np.zeros(form.d.size) if result.y is None else result.y
        z = np.zeros(form.k.size) if result.z is None else result.z
        message = f"{self.solver}: {'solved' if result.found else 'claims no solution'}"
        x, y, z = (np.asarray(part, dtype=float) for part in (result.x, y, z))  # some answer with arrays of their own kind
        return form.answer(x, y, z, found=bool(result.found), message=message)


def installed() -> list[str]:
    """Return the names of the QP solvers that are installed."""
    return sorted(qpsolvers.available_solvers)
