"""Every setting of a solver that is not its default: in the comparison, and where gauss itself calls it."""

import numpy as np
import qpsolvers

from gauss.backends.accuracy import DEFAULT_TOLERANCE, KEPT, own_settings
from gauss.bench import casadi_, coulomb, jaxopt_, mujoco_
from gauss.bench.clocks import TIMED_AROUND
from gauss.bench.contestants import contestants
from gauss.bench.levels import LIMIT, LOOSEST, OF_ANYBODY, POLICIES, WALL_LIMIT, promise, settings
from gauss.bench.markdown import table

COMPARED = ("backend", "called through", "matrices", "the library reports", "promised", "settings")
NOTES = {
    "ecos": "ECOS measures its residuals on the cone programme that it gets, the epigraph of the objective; it is held to "
    "those of the problem itself.",
    "highs": "HiGHS regularises every problem by default, which its claim of stationarity does not count.",
    "jaxopt_osqp": "jaxopt's OSQP and qpax compile in the first call for a problem, which is their cold call.",
}
WAYS = {  # of solvers that are not called through qpsolvers: through what, its matrices, what the library reports
    **dict.fromkeys(("qpoases", "qrqp"), ("CasADi", "sparse", "around its call")),
    **dict.fromkeys(("fatrop", "hpipm"), ("CasADi", "stages", "around its call")),
    jaxopt_.SOLVER: ("jaxopt", "dense", "nothing"),
    **dict.fromkeys(mujoco_.SOLVERS, ("MuJoCo", "dense", "nothing")),
    **dict.fromkeys(coulomb.SOLVERS, ("gauss", "dense", "nothing")),
}


def settings_lines(solvers: list[str], level: str) -> list[str]:
    """Both tables as Markdown."""
    known = [name for name in solvers if name in contestants()]
    return [
        *compared_lines(solvers, level),
        "## Settings with which gauss calls a solver for a user",
        "",
        f"No part of the comparison: what `gauss.solve(…, backend=name)` uses, tolerances of "
        f"{DEFAULT_TOLERANCE:g} among them. "
        "Those behind the semicolon belong to workspaces that are kept from call to call.",
        "",
        *table(["backend", "settings"], ([name, _own(name)] for name in known if name not in casadi_.SOLVERS)),
        "",
    ]


def compared_lines(solvers: list[str], level: str) -> list[str]:
    """How each solver is called, what it promises, and every setting that is not its default, as Markdown."""
    return [
        f"## Settings of the comparison, level {level}",
        "",
        "Tolerances are those that qpbenchmark sets, limits of iterations are common to all that take them. A call is over "
        f"after {LIMIT:g} s of CPU time, or {WALL_LIMIT:g} s of wall time of one that waits, and its process ends at twice "
        f"that, whatever limits a solver takes; its own limits, of wall time, are {WALL_LIMIT:g} s. All others are the "
        "defaults of the solver, tuned for none. At other levels the tolerances differ and nothing else. Promised: what a "
        "claim is held to, rows, stationarity and duality gap; relative: to the two-norms of data and answer, as the solver "
        f"measures it; none: it takes no tolerance, and is held to {LOOSEST:g} in rows and stationarity.",
        "",
        *(line for name, note in NOTES.items() if name in solvers for line in (note, "")),
        *table(COMPARED, (_compared(name, level) for name in solvers)),
        "",
    ]


def _compared(name: str, level: str) -> list[str]:
    return [name, *_way(name), _promised(name, level), _words(settings(name, level))]


def _way(name: str) -> tuple[str, str, str]:
    """Interface of a solver, its matrices, and the times that its library reports."""
    if name in WAYS:
        return WAYS[name]
    if ":" in name or name not in qpsolvers.available_solvers:
        return "itself", "sparse", "nothing"
    matrices = "sparse" if name in qpsolvers.sparse_solvers else "dense"
    reports = "set-up and solve together" if name == "clarabel" else "set-up, solve"
    return "qpsolvers", matrices, "nothing; around its call" if name in TIMED_AROUND else reports


def _promised(name: str, level: str) -> str:
    """Residuals that a solver promises."""
    if not POLICIES.get(name, OF_ANYBODY).has_tolerance:
        return "none"
    promised = promise(name, level)
    words = f"rows, stationarity{', gap' if np.isfinite(promised.gap) else ''}: {promised.primal:g}"
    return f"{words}, relative" if promised.relative else words


def _own(name: str) -> str:
    kept = f"; {_words(KEPT[name])}" if name in KEPT else ""
    return f"{_words(own_settings(name))}{kept}"


def _words(settings: dict) -> str:
    return ", ".join(f"{key} {value}" for key, value in settings.items()) or "–"
