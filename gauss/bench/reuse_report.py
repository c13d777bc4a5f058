"""Markdown of what kept workspaces and warm starts are worth along a motion."""

import numpy as np

from gauss.bench import compiled, reuse
from gauss.bench.text import in_time, number


def reuse_lines(rows, others) -> list[str]:
    """Section of the report; ``others`` are the rows of the comparison, for the machine code of gauss beside them."""
    modes = reuse.MODES["osqp"]
    lines = [
        "## Along a motion",
        "",
        f"{reuse.STEPS} instants, {1e3 * reuse.STEP:g} ms apart, F2s; all ways of calling take turns at every instant, with "
        "the settings of the comparison; kept workspaces of Clarabel do not presolve. Median times of calls from Python: "
        "one-shot calls get a problem in the form that the solver takes, the others the programme, whose conversion is "
        "included; in brackets how many times as fast as one-shot calls; largest error.",
        "",
        "| problem | backend | level | " + " | ".join(modes) + " | set-up, update, solve by the library | largest error |",
        "|---" * (5 + len(modes)) + "|",
    ]
    for problem, backend, level in dict.fromkeys((r["problem"], r["backend"], r["level"]) for r in rows):
        mine = {r["mode"]: r for r in rows if (r["problem"], r["backend"], r["level"]) == (problem, backend, level)}
        once = mine[reuse.ONE_SHOT]["seconds"]
        cells = [
            f"{in_time(mine[mode]['seconds'])} ({once / mine[mode]['seconds']:.1f})" if mode in mine else ""
            for mode in modes
        ]
        kept = mine[reuse.WARM if reuse.WARM in mine else reuse.KEPT_MODE]
        library = ", ".join(in_time(kept[name]) for name in ("setup", "update", "solve"))
        worst = max(row["error"] for row in mine.values())
        lines.append(f"| {problem} | {backend} | {level} | " + " | ".join(cells) + f" | {library} | {number(worst)} |")
    own = {row["problem"]: row["seconds"] for row in others if row["backend"] == compiled.NAME}
    beside = [_beside(name, seconds, [r for r in rows if r["problem"] == name]) for name, seconds in own.items()]
    beside = [words for words in beside if words]
    if not beside:
        return [*lines, ""]
    words = (
        "The machine code of gauss; in brackets how many times as fast as the fastest call, and as the library's own time"
    )
    return [*lines, "", f"{words} of update and solve: " + ", ".join(beside) + ".", ""]


def _beside(name: str, seconds: float, rows) -> str:
    calls = [r["seconds"] for r in rows if np.isfinite(r["seconds"])]
    if not calls:
        return ""
    library = [r["update"] + r["solve"] for r in rows if r["mode"] in (reuse.KEPT_MODE, reuse.WARM)]
    least = np.nanmin([np.nan, *library]) if np.isfinite(library).any() else np.nan
    return f"{name} {in_time(seconds)} ({min(calls) / seconds:.3g}, {least / seconds:.3g})"
