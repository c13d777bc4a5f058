"""The examination of random problems as Markdown."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gauss.bench.fuzz.examine import together
from gauss.bench.fuzz.problems import KINDS
from gauss.bench.fuzz.run import FUZZ
from gauss.bench.levels import AUTO, OURS
from gauss.bench.markdown import head, table
from gauss.bench.measure import WRONG

HOW = f"""Every answer is certified as users get it, and compared with a reference whose residuals have 50 digits, body
by body and joint by joint. *Certified*: the certificate confirms the answer to 1e-6. *Flagged*: it does not, and says so.
*Refused*: no finite answer. *Claims, wrong*: the backend says that it has solved the problem, and is off by more than
{WRONG:g}; the certificate is what catches that. *Silent*: certified, yet off by more than 1e-6. *Understated*: the error is
above what the certificate says. *Error / certificate*: the largest found. Medians are those of certified answers. Where an
answer hinges on which rows count as redundant, the certificate holds for the choice that gauss's recursion makes. *No
reference*: rows contradict each other, or are so close to dependent that refinement does not converge; nothing is compared.
Blocks of problems are solved in processes of their own, so that a crash is counted and costs nothing else. QP solvers are
asked for 1e-9, on form F2s."""


def publish(folder: Path, path: Path) -> list[Path]:
    """Write ``fuzz.md`` beside the table; return what was written."""
    return [FUZZ.write_page(folder, path, markdown)]


def markdown(rows: list[dict], header: Iterable[str]) -> str:
    """The whole report."""
    names = list(dict.fromkeys(row["backend"] for row in rows))
    names.sort(key=lambda name: (name not in OURS, name != AUTO))
    seeds = ", ".join(f"{seed:g}" for seed in sorted({row["seed"] for row in rows}))
    lines = [*head("Random problems", [*header, f"seeds: {seeds}"]), HOW, "", "## Verdict", ""]
    lines += _verdict("gauss's methods", [row for row in rows if row["backend"] in OURS])
    lines += _verdict("QP solvers", [row for row in rows if row["backend"] not in OURS])
    lines += ["", "## Backends", "", *_table("backend", names, rows)]
    lines += ["", "## Kinds of problems, gauss's `auto`", ""]
    lines += _table("kind", KINDS, [row for row in rows if row["backend"] == AUTO])
    lines += ["", *(f"* **{kind}**: {_note(function)}" for kind, function in KINDS.items())]
    return "\n".join(lines) + "\n"


def _verdict(what: str, rows: list[dict]) -> list[str]:
    if not rows:
        return []
    whole = together(rows)
    return [
        f"* {what}: {whole['problems']:.0f} answers asked for; certified and wrong {whole['silent']:.0f}; "
        f"worse than the certificate says {whole['understated']:.0f}; crashes {whole['crashed']:.0f}."
    ]


COLUMNS = {  # titles and templates of the counts and figures of together()
    "problems": "{problems:.0f}",
    "certified": "{certified:.0f}",
    "flagged": "{flagged:.0f}",
    "refused": "{refused:.0f}",
    "claims, wrong": "{liar:.0f}",
    "silent": "{silent:.0f}",
    "understated": "{understated:.0f}",
    "crashed": "{crashed:.0f}",
    "timed out": "{timed_out:.0f}",
    "no reference": "{unknown:.0f}",
}
TYPICAL_COLUMNS = ("error / certificate", "median error", "median certificate", "median time")


def _table(what: str, names: Iterable[str], rows: list[dict]) -> list[str]:
    groups = ((name, [row for row in rows if row[what] == name]) for name in names)
    return table([what, *COLUMNS, *TYPICAL_COLUMNS], (_line(name, together(found)) for name, found in groups if found))


def _line(name: str, row: dict) -> list[str]:
    counts = [cell.format(**row) for cell in COLUMNS.values()]
    figures = [_figure(row["ratio"], ".3f"), _figure(row["error"], ".0e"), _figure(row["certificate"], ".0e")]
    return [name, *counts, *figures, _figure(1e3 * row["seconds"], ".2g") + " ms"]


def _figure(value: float, form: str) -> str:
    return "–" if np.isnan(value) else f"{value:{form}}"


def _note(function) -> str:
    return function.__doc__.strip()
