"""The atlas as Markdown and as a heat map."""

from collections import Counter
from pathlib import Path

import numpy as np

from gauss.bench.atlas import CASES
from gauss.bench.atlas.case import DEGRADED, HONEST, PASSED, SILENT, SLOW, VERDICTS
from gauss.bench.atlas.methods import DEFAULT, METHODS, Method
from gauss.bench.atlas.run import STABILITY
from gauss.bench.levels import AUTO
from gauss.bench.markdown import head, table, when_and_where
from gauss.bench.table import header_of, read_table

MARKS = {PASSED: "✓", DEGRADED: "~", HONEST: "✗", SILENT: "**silent**", SLOW: "slow"}

HOW = """A cell is a method in a case: passed, degraded (~), failed and said so (✗), timed out (slow), or failed silently,
with numbers that are wrong and no word about it. The figure behind it is the criterion of the case. Every backend is
judged twice, methods of gauss and QP solvers alike: certified at every evaluation (slow path), as users get it, and
believed as it claims. QP solvers are called as gauss calls them for a user, at a tolerance of 1e-9."""


def publish(folder: Path, path: Path) -> list[Path]:
    """Write ``stability.md`` and the heat map beside the table; return what was written."""
    rows, header = read_table(path), header_of(path)
    return [STABILITY.write_page(folder, path, markdown), _map(folder / "stability.png", rows, header)]


def markdown(rows, header) -> str:
    """The whole report."""
    cells = {(row["case"], row["method"]): row for row in rows}
    cases, methods = (list(dict.fromkeys(row[key] for row in rows)) for key in ("case", "method"))
    lines = [*head("Where methods fail", header), HOW, "", "![The atlas](stability.png)", ""]
    lines += _summary(rows) + ["## Cases", ""]
    lines += [f"* **{name}**: {CASES[name].criterion}{_limits(name)}." for name in cases]
    body = ([case, *(_cell(cells.get((case, method))) for method in methods)] for case in cases)
    lines += ["", "## Cells", "", *table(["case", *methods], body), "", "## What was said", ""]
    lines += [f"* {row['case']}; {row['method']}: {row['words']}" for row in rows if row["words"]]
    return "\n".join(lines) + "\n"


def _summary(rows) -> list[str]:
    """Counts of verdicts; backends side by side with the same form, integrator and stabilisation."""
    plain = Method()
    usual = plain.form, plain.integrator, plain.stabilisation
    kinds: dict[str, list] = {"auto with its defaults": [row for row in rows if row["method"] == DEFAULT.name]}
    for row in rows:
        m = METHODS[row["method"]]
        if m.backend != AUTO and (m.form, m.integrator, m.stabilisation) == usual:
            name = f"{'methods of gauss' if m.ours else 'QP solvers'}, {'certified' if m.certified else 'believed'}"
            kinds.setdefault(name, []).append(row)
    lines = []
    for name, group in kinds.items():
        counts = Counter(row["verdict"] for row in group)
        said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
        lines.append(f"* {name}: {said} of {len(group)} cells.")
    return [*lines, ""]


def _limits(name: str) -> str:
    case = CASES[name]
    return f"; passes to {case.passes:g}, fails from {case.fails:g}" if case.solvable else "; a method passes by saying so"


def _cell(row) -> str:
    if row is None:
        return ""
    figure = "" if np.isnan(row["figure"]) or np.isinf(row["figure"]) else f" {row['figure']:.0e}"
    return MARKS[row["verdict"]] + figure


def _map(path: Path, rows, header) -> Path:
    from gauss.view.backends import plot_atlas  # the library of figures is optional and takes long to import

    cases, methods = (list(dict.fromkeys(row[key] for row in rows)) for key in ("case", "method"))
    cells = {(row["case"], row["method"]): row for row in rows}
    verdicts = [[cells[c, m]["verdict"] if (c, m) in cells else "" for c in cases] for m in methods]
    figures = np.array([[cells[c, m]["figure"] if (c, m) in cells else np.nan for c in cases] for m in methods])
    plot_atlas(methods, cases, verdicts, figures, VERDICTS, path, when_and_where(header))
    return path
