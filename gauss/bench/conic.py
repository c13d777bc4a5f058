"""Solvers of programmes with second-order cones: Clarabel, CVXOPT and SCS, and ECOS by the epigraph of its objective.

ECOS takes a linear objective: t + cᵀ x → min with (1 + t, √2 L x, 1 − t) in a cone, LᵀL = H. The multipliers of the other
rows are those of the programme itself.
"""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from scipy import linalg, sparse

from gauss.backends.programme import Outcome
from gauss.bench.clocks import Times
from gauss.bench.ready import Ready
from gauss.bench.structured import StructuredProgramme

RANK_RELATIVE = 1e-14  # relative to the largest eigenvalue of H: smaller ones are zero


def installed() -> list[str]:
    """Names of the solvers that are installed."""
    return [name for name in SOLVERS if find_spec(name)]


def ready(solver: str, programme: StructuredProgramme, settings: dict) -> Ready:
    """A solver with its problem; the call makes it anew, set-up included."""
    return SOLVERS[solver](programme, settings)


def _stacked(p: StructuredProgramme) -> tuple[sparse.csc_matrix, np.ndarray]:
    """All rows in one matrix: equalities, inequalities, cones."""
    return sparse.vstack([p.C, p.K], format="csc"), np.concatenate([p.d, p.k])


def _clarabel(p: StructuredProgramme, settings: dict) -> Ready:
    import clarabel

    cones = [clarabel.ZeroConeT(p.d.size)] if p.d.size else []
    cones += [clarabel.NonnegativeConeT(p.orthant)] if p.orthant else []
    cones += [clarabel.SecondOrderConeT(size) for size in p.structure.cones]
    chosen = clarabel.DefaultSettings()
    chosen.verbose = False
    for name, value in settings.items():
        setattr(chosen, name, value)
    H, (rows, right) = sparse.csc_matrix(sparse.triu(p.H)), _stacked(p)

    def call():
        return clarabel.DefaultSolver(H, p.c, rows, right, cones, chosen).solve()

    def read(found) -> Outcome:
        status, z = str(found.status), np.array(found.z)
        return _outcome(p, np.array(found.x), z, status == "Solved", f"clarabel: {status}", found.iterations)

    return Ready(call, read, lambda found: Times(np.nan, np.nan, found.solve_time))


def _scs(p: StructuredProgramme, settings: dict) -> Ready:
    import scs

    rows, right = _stacked(p)
    data = {"P": sparse.csc_matrix(sparse.triu(p.H)), "A": rows, "b": right, "c": p.c}
    cones = {"z": p.d.size, "l": p.orthant, "q": list(p.structure.cones)}

    def call():
        return scs.SCS(data, cones, verbose=False, **settings).solve()

    def read(found) -> Outcome:
        info = found["info"]
        return _outcome(p, found["x"], found["y"], info["status"] == "solved", f"scs: {info['status']}", info["iter"])

    def library(found) -> Times:
        setup, solve = (1e-3 * found["info"][name] for name in ("setup_time", "solve_time"))
        return Times(setup, solve, setup + solve)

    return Ready(call, read, library)


def _ecos(p: StructuredProgramme, settings: dict) -> Ready:
    import ecos

    n, (values, vectors) = p.c.size, linalg.eigh(p.H.toarray())
    positive = values > RANK_RELATIVE * values.max(initial=0.0)
    L = np.sqrt(values[positive])[:, None] * vectors.T[positive]
    objective = np.block([[np.zeros(n), -1.0], [-np.sqrt(2.0) * L, np.zeros((len(L), 1))], [np.zeros(n), 1.0]])
    K = sparse.hstack([p.K, sparse.csc_matrix((p.k.size, 1))])
    G = sparse.csc_matrix(sparse.vstack([K, sparse.csc_matrix(objective)]))
    h = np.concatenate([p.k, [1.0], np.zeros(len(L)), [1.0]])
    dims = {"l": p.orthant, "q": [*p.structure.cones, len(L) + 2]}
    A = sparse.csc_matrix(sparse.hstack([p.C, sparse.csc_matrix((p.d.size, 1))])) if p.d.size else None
    given = np.append(p.c, 1.0), G, h, dims, A, p.d if p.d.size else None

    def call():
        return ecos.solve(*given, verbose=False, **settings)

    def read(found) -> Outcome:
        info, y = found["info"], np.zeros(0) if found["y"] is None else found["y"]
        multipliers = np.concatenate([y, found["z"][: p.k.size]])
        return _outcome(p, found["x"][:n], multipliers, info["exitFlag"] == 0, f"ecos: {info['infostring']}", info["iter"])

    def library(found) -> Times:
        setup, solve = (found["info"]["timing"][name] for name in ("tsetup", "tsolve"))
        return Times(setup, solve, setup + solve)

    return Ready(call, read, library)


def _cvxopt(p: StructuredProgramme, settings: dict) -> Ready:
    import cvxopt
    from cvxopt.solvers import coneqp

    def matrix(M):
        M = M.tocoo()
        return cvxopt.spmatrix(M.data, M.row.tolist(), M.col.tolist(), size=M.shape)

    dims = {"l": p.orthant, "q": list(p.structure.cones), "s": []}
    rows = (matrix(p.C), cvxopt.matrix(p.d)) if p.d.size else ()
    given = matrix(p.H), cvxopt.matrix(p.c), matrix(p.K), cvxopt.matrix(p.k), dims, *rows
    options = {"show_progress": False, **settings}

    def call():
        return coneqp(*given, options=options)

    def read(found) -> Outcome:
        x, y, z = (np.array(found[name]).ravel() for name in "xyz")
        claims = found["status"] == "optimal"
        return _outcome(p, x, np.concatenate([y, z]), claims, f"cvxopt: {found['status']}", found["iterations"])

    return Ready(call, read)


def _outcome(p: StructuredProgramme, x, multipliers, found: bool, message: str, iterations: int) -> Outcome:
    m = p.d.size
    return Outcome(np.asarray(x), multipliers[:m], multipliers[m:], found, message, int(iterations))


SOLVERS: dict[str, Callable[[StructuredProgramme, dict], Ready]] = {
    "clarabel": _clarabel,
    "cvxopt": _cvxopt,
    "ecos": _ecos,
    "scs": _scs,
}
