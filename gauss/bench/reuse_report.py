"""Markdown of what kept workspaces and warm starts are worth along a motion."""

import numpy as np

from gauss.bench import compiled, reuse
from gauss.bench.markdown import in_time, number, table

ALL_MODES = reuse.MODES["osqp"]


def reuse_lines(rows, others) -> list[str]:
    """Section of the report; ``others`` are the rows of the comparison, for the machine code of gauss beside them."""
    titles = ["problem", "backend", "level", *ALL_MODES, "set-up, update, solve by the library", "largest error"]
    lines = [
        "## Along a motion",
        "",
        f"{reuse.STEPS} instants, {1e3 * reuse.STEP:g} ms apart, F2s; all ways of calling take turns at every instant, with "
        "the settings of the comparison; kept workspaces of Clarabel do not presolve. Median times of calls from Python: "
        "one-shot calls get a problem in the form that the solver takes, the others the programme, whose conversion is "
        "included; in brackets how many times as fast as one-shot calls; largest error.",
        "",
        *table(
            titles, (_line(key, {r["mode"]: r for r in rows if _key(r) == key}) for key in dict.fromkeys(map(_key, rows)))
        ),
    ]
    own = {row["problem"]: row["seconds"] for row in others if row["backend"] == compiled.NAME}
    beside = [_beside(name, seconds, [r for r in rows if r["problem"] == name]) for name, seconds in own.items()]
    beside = [words for words in beside if words]
    if not beside:
        return [*lines, ""]
    words = (
        "The machine code of gauss; in brackets how many times as fast as the fastest call, and as the library's own time"
    )
    return [*lines, "", f"{words} of update and solve: " + ", ".join(beside) + ".", ""]


def _key(row) -> tuple[str, str, str]:
    return row["problem"], row["backend"], row["level"]


def _line(key: tuple[str, str, str], mine: dict[str, dict]) -> list[str]:
    """Line of one backend on one problem, of its rows by mode."""
    once = mine[reuse.ONE_SHOT]["seconds"]
    times = {mode: f"{in_time(row['seconds'])} ({once / row['seconds']:.1f})" for mode, row in mine.items()}
    kept = mine[reuse.WARM if reuse.WARM in mine else reuse.KEPT_MODE]
    library = ", ".join(in_time(kept[name]) for name in ("setup", "update", "solve"))
    worst = max(row["error"] for row in mine.values())
    return [*key, *(times.get(mode, "") for mode in ALL_MODES), library, number(worst)]


def _beside(name: str, seconds: float, rows) -> str:
    calls = [r["seconds"] for r in rows if np.isfinite(r["seconds"])]
    if not calls:
        return ""
    library = [r["update"] + r["solve"] for r in rows if r["mode"] in (reuse.KEPT_MODE, reuse.WARM)]
    least = np.nanmin([np.nan, *library]) if np.isfinite(library).any() else np.nan
    return f"{name} {in_time(seconds)} ({min(calls) / seconds:.3g}, {least / seconds:.3g})"
