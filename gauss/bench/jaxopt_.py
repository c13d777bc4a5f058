"""jaxopt's OSQP in double precision, compiled in its first call: qpsolvers makes and compiles it anew in every call."""

import numpy as np
import qpsolvers

from gauss.backends import qpsolvers_
from gauss.backends.programme import Outcome
from gauss.bench.ready import Ready

SOLVER = "jaxopt_osqp"


def ready(problem: qpsolvers.Problem, settings: dict) -> Ready:
    """The solver with a problem of dense matrices; the first call compiles for the size of the problem."""
    import jax
    import jaxopt

    run = jax.jit(jaxopt.OSQP(**settings).run)

    def call():
        rows = {"params_eq": (problem.A, problem.b), "params_ineq": (problem.G, problem.h)}
        given = {name: None if part[0] is None else part for name, part in rows.items()}
        return jax.block_until_ready(run(params_obj=(problem.P, problem.q), **given))

    def read(found) -> Outcome:
        params, state = found
        x, y, z = (None if part is None else np.array(part) for part in (params.primal, params.dual_eq, params.dual_ineq))
        solved = int(state.status) == jaxopt.BoxOSQP.SOLVED
        words = WORDS.get(int(state.status), f"status {int(state.status)}")
        return Outcome(x, y, z, solved, f"{SOLVER}: {words}", int(state.iter_num))

    return Ready(call, read, around=qpsolvers_.surroundings(SOLVER))


WORDS = {0: "iteration limit", 1: "solved", 2: "dual infeasible", 3: "primal infeasible"}  # jaxopt.BoxOSQP's numbers
