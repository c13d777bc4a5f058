"""The comparison as Markdown."""

import numpy as np
import qpsolvers

from gauss.backends.qpsolvers_ import ALWAYS
from gauss.bench import compiled, reuse
from gauss.bench.levels import OWN, settings
from gauss.bench.measure import OURS, WRONG
from gauss.bench.problems import SELECTION
from gauss.bench.summary import LIMIT, SHIFT, against_compiled, backends, totals
from gauss.dynamics.engines.certified import PATIENCE

FORM, LEVEL = "F2s", "high"  # of the table of errors

HOW = f"""Every backend gets the same quadratic programmes of mechanisms, in a process of its own. The error of an answer
is the largest relative error of a body's or joint's acceleration against a reference with residuals of 50
digits. F2: accelerations of the bodies, in their units; F2s: scaled by Φ^½, rows of unit length. Levels are
absolute tolerances: low 1e-3, mid 1e-6, high 1e-9, tightest 1e-12 (HiGHS 1e-10; polishing for OSQP). Times are
medians of solves from nothing through qpsolvers, matrices given, in which no zeros are stored; those of gauss's
own methods include making their matrices in Python. Mean times are shifted geometric means (shift
{1e3 * SHIFT:g} ms), a problem that is not solved right counting as {LIMIT:g} s."""


def markdown(rows, reused, header) -> str:
    """The whole report."""
    lines = ["# QP backends on mechanism problems", "", *(f"- {line}" for line in header), "", HOW, ""]
    lines += ["![Errors of the backends](qp_errors.png)", "![Time against error](qp_time_error.png)", ""]
    lines += ["![Performance profiles](qp_profile.png)", ""]
    lines += _problems(rows) + _settings(rows) + _errors(rows) + _totals(rows) + _against(rows) + _honesty(rows)
    return "\n".join(lines + (_reuse(reused, rows) if reused else [])) + "\n"


def _problems(rows) -> list[str]:
    names = list(dict.fromkeys(row["problem"] for row in rows))
    notes = {name: SELECTION[name].note for name in names if name in SELECTION}
    return ["## Problems", "", *(f"* **{name}**: {note}." for name, note in notes.items()), ""]


def _settings(rows) -> list[str]:
    """What each QP solver is told at one level; at the others the tolerances differ."""
    told = [name for name in backends(rows) if name not in (*OURS, compiled.NAME)]
    given = {name: ALWAYS.get(name, {}) | settings(name, LEVEL) for name in told}
    words = {name: ", ".join(f"{key} {value}" for key, value in found.items()) for name, found in given.items()}
    matrices = {name: "sparse" if name in qpsolvers.sparse_solvers else "dense" for name in told}
    return [
        f"## Settings, level {LEVEL}",
        "",
        "All others are the defaults of the solver; each is asked for by the name that the solver gives it.",
        "",
        "| backend | matrices | settings |",
        "|---|---|---|",
        *(f"| {name} | {matrices[name]} | {words[name] or '–'} |" for name in told),
        "",
    ]


def _errors(rows) -> list[str]:
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    cells = {(r["backend"], r["problem"]): r for r in rows if (r["form"], r["level"]) in ((FORM, LEVEL), (OWN, OWN))}
    lines = [
        f"## Errors, {FORM}, level {LEVEL}",
        "",
        f"In brackets: not certified. Bold: claimed success with an error above {WRONG:g}. –: refused, or no finite answer.",
        "",
        "| backend | " + " | ".join(problems) + " |",
        "|---" * (len(problems) + 1) + "|",
    ]
    for backend in backends(rows):
        texts = [_cell(cells.get((backend, problem))) for problem in problems]
        lines.append(f"| {backend} | " + " | ".join(texts) + " |")
    return [*lines, ""]


def _cell(row) -> str:
    if row is None:
        return ""
    if row["outcome"] in ("crashed", "timed out"):
        return row["outcome"]
    if not np.isfinite(row["error"]):
        return "**not finite**" if row["claimed"] else "–"
    text = f"{row['error']:.0e}"
    if row["claimed"] and not row["error"] <= WRONG:
        return f"**{text}**"
    return text if row["certified"] or row["backend"] == compiled.NAME else f"({text})"


def _totals(rows) -> list[str]:
    lines = []
    for form in [f for f in dict.fromkeys(r["form"] for r in rows) if f != OWN]:
        lines += [
            f"## All problems, {form}",
            "",
            "Success: residuals and gap within the tolerance, as qpbenchmark judges. Right: certified, error below 1e-6.",
            "",
            "| backend | level | success | right | median error where right | claims success, wrong | right, claims failure "
            "| refused | crashed, timed out | mean time |",
            "|---|---|---|---|---|---|---|---|---|---|",
        ]
        for line in totals(rows, form):
            success = "" if np.isnan(line["success"]) else f"{line['success']:.0%}"
            lines.append(
                f"| {line['backend']} | {line['level']} | {success} | {line['right']:.0%} | {_number(line['median_error'])} "
                f"| {line['claims_wrong']} | {line['doubts_right']} | {line['refused']} | {line['lost']} "
                f"| {_time(line['mean'])} |"
            )
        lines.append("")
    return lines


def _against(rows) -> list[str]:
    found = against_compiled(rows)
    if not found:
        return []
    lines = [
        "## gauss itself on the equality-constrained problems",
        "",
        "The machine code that gauss traces for the scene, from coordinates and rates to accelerations, called from Python,",
        "beside the fastest solve of a QP backend that is as accurate (within a factor of ten, or 1e-12). It is made for",
        "one scene, which may take seconds that are not counted; a QP solver takes any programme, and knows nothing but",
        "its matrices. Where the code does not confirm its own answer, the certified recursion answers, in milliseconds;",
        f"after {PATIENCE} such calls, which are not counted, machine code that takes more care does.",
        "",
        "| problem | gauss | error | fastest QP solver as accurate | its time | its error | times as fast |",
        "|---|---|---|---|---|---|---|",
    ]
    for line in found:
        ratio = f"{line['theirs'] / line['seconds']:.3g}" if np.isfinite(line["theirs"]) else "none is"
        lines.append(
            f"| {line['problem']} | {_time(line['seconds'])} | {_number(line['error'])} | {line['peer'] or '–'} "
            f"| {_time(line['theirs'])} | {_number(line.get('their_error', np.nan))} | {ratio} |"
        )
    return [*lines, ""]


def _honesty(rows) -> list[str]:
    own = [r for r in rows if r["backend"] in OURS]
    worse = [r for r in own if r["certified"] and r["error"] > 2 * r["certificate"] + 1e-14]
    silent = [r for r in rows if r["claimed"] and not r["error"] <= WRONG]
    caught = [r for r in silent if not r["certified"]]
    return [
        "## Honesty",
        "",
        f"* {len(silent)} of {len(rows)} answers were claimed to be right and were wrong by more than {WRONG:g} or not "
        f"finite; the certificate refused {len(caught)} of them.",
        f"* {len(worse)} of {len(own)} answers of gauss's own methods were certified with an error above twice what the "
        "certificate says (and above rounding).",
        "",
    ]


def _reuse(rows, others) -> list[str]:
    lines = [
        "## Along a motion",
        "",
        f"{reuse.STEPS} instants, {1e3 * reuse.STEP:g} ms apart, F2s; all ways of calling take turns at every instant. "
        "Median times; in brackets how many times as fast as one-shot calls through qpsolvers; largest error.",
        "",
        "| problem | backend | level | " + " | ".join(reuse.MODES["osqp"]) + " | largest error |",
        "|---" * (4 + len(reuse.MODES["osqp"])) + "|",
    ]
    for problem, backend, level in dict.fromkeys((r["problem"], r["backend"], r["level"]) for r in rows):
        mine = {r["mode"]: r for r in rows if (r["problem"], r["backend"], r["level"]) == (problem, backend, level)}
        once = mine[reuse.ONE_SHOT]["seconds"]
        cells = [
            f"{_time(mine[mode]['seconds'])} ({once / mine[mode]['seconds']:.1f})" if mode in mine else ""
            for mode in reuse.MODES["osqp"]
        ]
        worst = max(row["error"] for row in mine.values())
        lines.append(f"| {problem} | {backend} | {level} | " + " | ".join(cells) + f" | {_number(worst)} |")
    own = {row["problem"]: row["seconds"] for row in others if row["backend"] == compiled.NAME}
    best = {
        name: min(r["seconds"] for r in rows if r["problem"] == name)
        for name in own
        if any(r["problem"] == name for r in rows)
    }
    beside = [f"{name} {_time(own[name])} ({seconds / own[name]:.3g})" for name, seconds in best.items()]
    words = "The machine code of gauss, in brackets how many times as fast as the fastest of these: "
    return [*lines, "", words + ", ".join(beside) + ".", ""] if beside else [*lines, ""]


def _time(seconds: float) -> str:
    if not np.isfinite(seconds):
        return "–"
    return f"{1e6 * seconds:.3g} µs" if seconds < 1e-3 else f"{1e3 * seconds:.3g} ms"


def _number(value: float) -> str:
    return f"{value:.0e}" if np.isfinite(value) else "–"
