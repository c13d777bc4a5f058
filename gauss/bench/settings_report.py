"""Every setting of a solver that is not its default: in the comparison, and where gauss itself calls it."""

import qpsolvers

from gauss.backends.accuracy import DEFAULT_TOLERANCE, KEPT, own_settings
from gauss.bench import casadi_
from gauss.bench.clocks import AROUND
from gauss.bench.contestants import contestants
from gauss.bench.levels import LIMIT, WALL_LIMIT, settings
from gauss.bench.markdown import table

COMPARED = ("backend", "called through", "matrices", "the library reports", "settings")
REPORTS = {"clarabel": "set-up and solve together", "qpoases": "none", "qrqp": "none"}


def settings_lines(solvers: list[str], level: str) -> list[str]:
    """Both tables as Markdown."""
    known = [name for name in solvers if name in contestants()]
    return [
        f"## Settings of the comparison, level {level}",
        "",
        f"Tolerances are those that qpbenchmark sets, limits of iterations are common to all that take them. {LIMIT:g} s of "
        f"CPU time ends a call, whatever limits a solver takes; its own limits, of wall time, are {WALL_LIMIT:g} s. "
        "All others are the defaults of the solver, tuned for none. At other levels the tolerances differ and nothing "
        "else.",
        "",
        *table(COMPARED, (_compared(name, level) for name in known)),
        "",
        "## Settings with which gauss calls a solver for a user",
        "",
        f"No part of the comparison: what `gauss.solve(…, backend=name)` uses, tolerances of "
        f"{DEFAULT_TOLERANCE:g} among them. "
        "Those behind the semicolon belong to workspaces that are kept from call to call.",
        "",
        *table(["backend", "settings"], ([name, _own(name)] for name in known if name not in casadi_.SOLVERS)),
        "",
    ]


def _compared(name: str, level: str) -> list[str]:
    through = "CasADi" if name in casadi_.SOLVERS else "qpsolvers"
    matrices = "sparse" if name in qpsolvers.sparse_solvers or name in casadi_.SOLVERS else "dense"
    reports = REPORTS.get(name, "none; around its call" if name in AROUND else "set-up, solve")
    return [name, through, matrices, reports, _words(settings(name, level))]


def _own(name: str) -> str:
    kept = f"; {_words(KEPT[name])}" if name in KEPT else ""
    return f"{_words(own_settings(name))}{kept}"


def _words(settings: dict) -> str:
    return ", ".join(f"{key} {value}" for key, value in settings.items()) or "–"
