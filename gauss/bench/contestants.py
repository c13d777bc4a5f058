"""Calls of QP solvers of the comparison: the problem is made ready first, then only the call is timed."""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import qpsolvers

from gauss.backends import qpsolvers_
from gauss.backends.programme import Outcome, Programme
from gauss.backends.programmed import Programmed, checked_outcome
from gauss.bench import casadi_, clocks, conic, coulomb, jaxopt_, mujoco_
from gauss.bench.instances import FILE, Instance
from gauss.bench.levels import settings
from gauss.bench.ready import Ready
from gauss.bench.structured import CONES, COULOMB, ROWS, STAGES, StructuredProgramme
from gauss.errors import BackendError

# To which qpsolvers hands a first x; it ignores that for all others.
WARM = ("cvxopt", "osqp", "proxqp", "pyqpmad", "qpalm", "scs", "sip")
DENSE = 3e7  # entries of dense matrices, 0.24 GB
ONE_SIDED = ("qtqp",)  # solvers that take no problems of equality rows alone


def contestants(kind: str = ROWS) -> list[str]:
    """Names of the solvers that can be compared here on programmes with a structure of one kind; of rows alone at first."""
    if kind == COULOMB:
        return coulomb.installed()
    if kind == CONES:
        return [*conic.installed(), *mujoco_.installed()]
    through_casadi = [*casadi_.SOLVERS, *(casadi_.STAGEWISE if kind == STAGES else ())]
    return [*qpsolvers_.installed(), *(through_casadi if find_spec("casadi") else ())]


def everyone() -> list[str]:
    """Names of all solvers that can be compared here on some programme."""
    return list(dict.fromkeys(name for kind in (ROWS, CONES, COULOMB, STAGES) for name in contestants(kind)))


def ready(solver: str, programme: Programme, level: str) -> Ready:
    """Make the problem ready for a solver: by its name, or "module:Class" of one's own.

    Raises
    ------
    BackendError
        If one's own solver cannot be imported.
    """
    if ":" in solver:
        return _own(solver, programme)
    chosen = settings(solver, level)
    if isinstance(programme, StructuredProgramme) and (kind := programme.structure.kind) in (CONES, COULOMB):
        if solver in mujoco_.SOLVERS:
            return mujoco_.ready(solver, programme, chosen)
        return {CONES: conic.ready, COULOMB: coulomb.ready}[kind](solver, programme, chosen)
    if solver in (*casadi_.SOLVERS, *casadi_.STAGEWISE):
        return casadi_.ready(solver, programme, chosen)
    problem = qpsolvers_.converted(programme, solver)
    if solver == jaxopt_.SOLVER:
        return jaxopt_.ready(problem, chosen)
    return Ready(
        lambda: qpsolvers.solve_problem(problem, solver, **chosen),
        lambda found: _read(found, solver, problem, chosen),
        clocks.library(solver, problem, chosen),
        qpsolvers_.surroundings(solver),
    )


def started(solver: str, programme: Programme, level: str, start: np.ndarray) -> Ready | None:
    """As :func:`ready`, but the call starts at a point (n,); None if the solver takes none."""
    if solver not in WARM:
        return None
    problem, chosen = qpsolvers_.converted(programme, solver), settings(solver, level)
    cold = ready(solver, programme, level)
    return replace(cold, call=lambda: qpsolvers.solve_problem(problem, solver, initvals=start, **chosen))


def suits(solver: str, instance: Instance) -> bool:
    """Whether a solver takes programmes with such a structure; one's own get all."""
    if solver in mujoco_.SOLVERS:
        return instance.structure.kind == CONES and mujoco_.takes(instance.programme(FILE))
    return ":" in solver or solver in contestants(instance.structure.kind)


def refusal(solver: str, programme: Programme) -> str:
    """Why a solver is not asked, in words; "" if it is: dense matrices must not fill the memory."""
    n, rows = programme.c.size, programme.d.size + programme.k.size
    dense = solver in qpsolvers_.installed() and solver not in qpsolvers.sparse_solvers
    if not rows:
        return "no rows: nothing to ask for"
    if solver in ONE_SIDED and not programme.k.size:
        return "takes no problems without inequality rows"
    return f"takes dense matrices, which would have more than {DENSE:g} entries" if dense and n * (n + rows) > DENSE else ""


def backend(solver: str, level: str) -> Programmed:
    """Backend that calls a solver of qpsolvers with the settings of the comparison."""
    return Programmed(qpsolvers_.QPSolvers(solver, **settings(solver, level)))


def imported(solver: str) -> Callable[[], Callable[[Programme], Outcome]]:
    """Solver of one's own by "module:Class"; called without arguments it makes a callable Programme → Outcome.

    BackendError if there is no such module or name in it.
    """
    module, _, name = solver.partition(":")
    try:
        return getattr(import_module(module), name)
    except Exception as error:  # any error of a foreign module
        raise BackendError(
            f"solver {solver!r}: {type(error).__name__}: {error}. Expected module:Class, importable from here, whose "
            "objects are called with a gauss.backends.programme.Programme and return an Outcome."
        ) from None


def source_of(solver: str) -> bytes:
    """Source of the module of a solver of one's own; nothing where it has none."""
    spec = find_spec(solver.partition(":")[0])
    file = None if spec is None else spec.origin
    return Path(file).read_bytes() if file is not None and Path(file).is_file() else b""


def _own(solver: str, programme: Programme) -> Ready:
    make = imported(solver)
    return Ready(lambda: make()(programme), lambda found: checked_outcome(found, programme))


def _read(found: qpsolvers.Solution, solver: str, problem: qpsolvers.Problem, chosen: dict) -> Outcome:
    outcome = qpsolvers_.outcome(found, solver)
    words, iterations = clocks.status_and_iterations(found)
    if solver == "daqp" and not outcome.found:  # qpsolvers keeps its exit flag to itself
        words = clocks.DAQP.get(clocks.asked_daqp(problem, chosen)[2], "")
    message = f"{solver}: {words}" if words else outcome.message
    return Outcome(outcome.x, outcome.y, outcome.z, outcome.found, message, iterations)
