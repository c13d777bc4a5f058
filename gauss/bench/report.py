"""The comparison as Markdown."""

from collections.abc import Iterator

import numpy as np

from gauss.bench import compiled
from gauss.bench.clocks import TIMED_AROUND
from gauss.bench.instances import FILE, MAIN_FORM
from gauss.bench.levels import LEVELS, LIMIT, MAIN_LEVEL, OURS, OWN
from gauss.bench.markdown import head, in_time, number, share, table
from gauss.bench.measure import WRONG
from gauss.bench.problems import INCONSISTENT, SELECTION
from gauss.bench.reuse import reuse_lines
from gauss.bench.settings_report import settings_lines
from gauss.bench.summary import (
    PENALTIES,
    RIGHT,
    SHIFT,
    SHIFTS,
    against_compiled,
    asked,
    backends,
    checksum,
    clocks,
    groups,
    is_broken,
    is_kept,
    is_lost,
    is_right,
    is_wrong,
    not_asked,
    sensitivity,
    totals,
    verdict,
)
from gauss.dynamics.engines.tiering import COMPILE_THRESHOLD

HOW = f"""Every backend gets the same quadratic programmes of mechanisms, in a process of its own with one thread. The
error of an answer is the largest relative error of a body's or joint's acceleration against a reference with residuals of
50 digits. F2: accelerations of the bodies, in their units; F2s: scaled by Φ^½, rows of unit length. Levels are absolute
tolerances of residuals and duality gap: low 1e-3, mid 1e-6, high 1e-9, tightest 1e-12 (HiGHS 1e-10). An answer after
{LIMIT:g} s is none.

Two rules, the same for all. **Right**: the error is at most {RIGHT:g}, that of multipliers at most {WRONG:g}, whoever
answered and whatever a certificate says. **Kept**: primal and dual residual and gap are within the tolerance that was
asked for, as qpbenchmark judges, whatever the solver looks at. **Claimed, beyond**: success was claimed, and a residual
that the solver promises (see its settings) is above its tolerance and above ten times the rounding of its own terms, where
forces of 1e9 leave no other choice; the error is another column. Of a file without a solution or a proof the verdict is
unknown: it is judged by its residuals alone.

Times are medians of calls from Python, set-up included, on a problem in the form that the solver takes; making that form
is not timed. They are wall times, or CPU times of the process where these are less, so that a busy machine adds nothing,
and a tenth of the wall times at least, so that waiting is not free.
The time of the library is what it reports of itself. Those of gauss's own methods include making their matrices in
Python. Means are shifted geometric means over all problems of a class (shift {1e3 * SHIFT:g} ms), a problem
that is not solved right counting as {LIMIT:g} s. The machine may be shared: times side by side compare, single ones are
no records. Errors of multipliers are those of the solver's own, constraint by constraint, without what redundant rows leave
open; a solver that gives none is off by 1."""


def markdown(rows, reused, header) -> str:
    """The whole report."""
    problems, left, rows = _problems(rows), not_asked(rows), asked(rows)
    lines = head("QP backends on mechanism problems", [*header, "all packages: [qp.lock](qp.lock)", checksum(rows)])
    lines += [HOW, "", *left, *(["![Errors of the backends](qp_errors.png)"] if cells_shown(rows) else [])]
    lines += ["![Time against error](qp_time_error.png)", "", "![Performance profiles](qp_profile.png)", ""]
    lines += problems + settings_lines([n for n in backends(rows) if n not in (*OURS, compiled.NAME)], MAIN_LEVEL)
    lines += _errors(rows) + _totals(rows) + _verdicts(rows) + _times(rows) + _means(rows) + _against(rows) + _honesty(rows)
    return "\n".join(lines + (reuse_lines(reused, rows) if reused else [])) + "\n"


def _problems(rows) -> list[str]:
    lines = ["## Problems", ""]
    for group, names in groups(rows).items():
        lines += [f"Class {group}, {len(names)}:", ""]
        lines += [f"* **{name}**{': ' + SELECTION[name].note if name in SELECTION else ''}." for name in names]
        lines.append("")
    return lines


def _errors(rows) -> list[str]:
    problems = [name for group, names in groups(rows).items() if group != INCONSISTENT for name in names]
    cells = cells_shown(rows)
    forms = sorted({row["form"] for row in cells.values()} - {OWN}) or [MAIN_FORM]
    lines = [
        f"## Errors, {', '.join(forms)}, level {MAIN_LEVEL}",
        "",
        "In brackets: not certified. Bold: claimed, beyond. –: refused, or no finite "
        f"answer; {compiled.NAME}, which has no certificate: errors of joints alone. Kept: residuals are within the "
        "tolerance, of a problem without a reference.",
        "",
        *table(
            ["backend", *problems], ([name, *(_cell(cells.get((name, p))) for p in problems)] for name in backends(rows))
        ),
        "",
    ]
    return lines


def cells_shown(rows) -> dict[tuple[str, str], dict]:
    """Cells of the table and of the chart of errors, by backend and problem."""
    shown = (row for row in rows if row["group"] != INCONSISTENT and (_shown(row) or row["form"] == OWN))
    return {(row["backend"], row["problem"]): row for row in shown}


def _shown(row) -> bool:
    """Whether a cell is one of a QP solver that tables problem by problem show."""
    return row["form"] in (MAIN_FORM, FILE) and row["level"] == MAIN_LEVEL


def _cell(row) -> str:
    if row is None:
        return ""
    if is_lost(row):
        return row["outcome"]
    if row["outcome"] == "answered" and np.isnan(row["error"]):  # nothing is known of it but its residuals
        return "kept" if is_kept(row) else "**claimed**" if is_broken(row) else "not kept"
    if not np.isfinite(row["error"]):
        return "**not finite**" if row["claimed"] else "–"
    text = number(row["error"])
    text = text if row["certified"] or row["backend"] == compiled.NAME else f"({text})"
    return f"**{text}**" if is_broken(row) else text


def _totals(rows) -> list[str]:
    lines = []
    for group, problems in groups(rows).items():
        if group == INCONSISTENT:
            continue
        for form in [f for f in dict.fromkeys(r["form"] for r in rows if r["group"] == group) if f != OWN]:
            lines += [
                f"## Class {group}, {form}: {len(problems)} problems",
                "",
                *table(TOTALS, map(_total, totals(rows, problems, form))),
                "",
            ]
    return lines


TOTALS: tuple[str, ...] = ("backend", "level", "kept", "claimed, beyond", "right", "median error")
TOTALS += ("median error of multipliers", f"claimed, error above {WRONG:g}", "no answer", "crashed, timed out", "mean time")


def _total(line: dict) -> list:
    cells = [line["backend"], line["level"], share(line["kept"]), _count(line["broken"]), share(line["right"])]
    cells += [number(line["error"]), number(line["dual_error"]), line["wrong"], line["refused"], line["lost"]]
    return [*cells, in_time(line["mean"])]


VERDICTS = {
    "said": "inconsistent",
    "no answer": "no answer",
    "within": "solved",
    "broken": "**claimed**",
    "claimed": "solved",
}


def _verdicts(rows) -> list[str]:
    """Verdicts of solvers on problems without a solution."""
    problems = groups(rows).get(INCONSISTENT, [])
    lines = []
    for problem in problems:
        lines += [
            f"## Inconsistent: {problem}",
            "",
            "inconsistent: said so; no answer: gave up or refused; solved: claimed, with residuals within the tolerance "
            "asked for, which is right where that is larger than the contradiction; bold: claimed, beyond. Methods of "
            "gauss, which have no tolerance, give least squares, and the certificate the contradiction.",
            "",
            *table(["backend", "form", *LEVELS], _stated({_key(r): r for r in rows if r["problem"] == problem})),
            "",
        ]
    return lines


def _key(row) -> tuple[str, str, str]:
    return row["backend"], row["form"], row["level"]


def _stated(mine: dict[tuple[str, str, str], dict]) -> Iterator[list[str]]:
    """Verdicts of each backend and form by level."""
    for backend, form in dict.fromkeys((b, f) for b, f, _ in mine):
        found = [mine.get((backend, form, level)) for level in (LEVELS if form != OWN else (OWN,))]
        words = [VERDICTS[verdict(row)] if row else "" for row in found]
        yield [backend, form, *words, *[""] * (len(LEVELS) - len(words))]


def _times(rows) -> list[str]:
    lines = []
    for group, problems in groups(rows).items():
        cells = {(r["backend"], r["problem"]): r for r in rows if _shown(r)}
        names = [name for name in backends(rows) if any(b == name for b, _ in cells)]
        if group == INCONSISTENT or not names:
            continue
        lines += [
            f"## Times, class {group}, {_form_of(rows, group)}, level {MAIN_LEVEL}",
            "",
            "Microseconds of right answers: call from Python / reported by the library, – where it reports none (of "
            f"{', '.join(TIMED_AROUND)}: around the call of the library).",
            "",
            *table(["problem", *names], ([p, *(_both(cells.get((name, p))) for name in names)] for p in problems)),
            "",
            "Medians over right answers: first call over later ones, quartiles apart over the median, library over "
            "call, set-up over library.",
            "",
            *table(CLOCKS, map(_clock, clocks(rows, problems, MAIN_FORM, MAIN_LEVEL))),
            "",
        ]
    return lines


def _form_of(rows, group: str) -> str:
    """Form of a class in tables that show one: of programmes of files their own."""
    forms = {row["form"] for row in rows if row["group"] == group}
    return FILE if FILE in forms else MAIN_FORM


CLOCKS = ("backend", "right", "cold / warm", "spread", "library / call", "set-up / library")


def _clock(line: dict) -> list:
    shares = [share(line[key]) for key in ("spread", "library", "setup")]
    return [line["backend"], line["right"], f"{line['cold']:.2g}", *shares]


def _both(row) -> str:
    if row is None or not is_right(row):
        return ""
    library = f"{1e6 * row['library']:.3g}" if np.isfinite(row["library"]) else "–"
    return f"{1e6 * row['seconds']:.3g} / {library}"


def _means(rows) -> list[str]:
    lines = []
    columns = [f"{1e3 * shift:g} ms, {penalty * LIMIT:g} s" for shift in SHIFTS for penalty in PENALTIES]
    for group, problems in groups(rows).items():
        found = sensitivity(rows, problems, MAIN_FORM, MAIN_LEVEL)
        if group == INCONSISTENT or not found:
            continue
        lines += [
            f"## What means hinge on, class {group}, {_form_of(rows, group)}, level {MAIN_LEVEL}",
            "",
            "Shifted geometric means by shift and by what a problem costs that is not solved right; in brackets the rank.",
            "",
            *table(["backend", *columns], map(_mean, sorted(found.items(), key=lambda item: item[1][len(PENALTIES)]))),
            "",
        ]
    return lines


def _mean(item: tuple[str, list[tuple[float, int]]]) -> list[str]:
    backend, means = item
    return [backend, *(f"{in_time(mean)} ({rank})" for mean, rank in means)]


def _against(rows) -> list[str]:
    found = against_compiled(rows)
    if not found:
        return []
    return [
        "## gauss itself on the equality-constrained problems",
        "",
        "The machine code that gauss traces for the scene, from coordinates and rates to accelerations, called from "
        "Python, beside the fastest solve of a QP backend that is as accurate (within a factor of ten, or 1e-12): by "
        "the time of its call from Python, and by what its library reports. The code is made for one scene, which may "
        "take seconds that are not counted; a QP solver takes any programme, and knows nothing but its matrices, whose "
        "making is not counted. Errors of gauss are those of joints. Where the code does not confirm its own answer, "
        f"the certified recursion answers, in milliseconds; after {COMPILE_THRESHOLD} such calls, which are "
        f"not counted, "
        "machine code with iterative refinement does.",
        "",
        *table(AGAINST, map(_beside, found)),
        "",
    ]


AGAINST: tuple[str, ...] = ("problem", "gauss", "error", "fastest call", "its time", "its error", "times as fast")
AGAINST += ("fastest library", "its time", "times as fast")


def _beside(line: dict) -> list[str]:
    cells = [line["problem"], in_time(line["seconds"]), number(line["error"])]
    for clock in ("seconds", "library"):
        peer = line[clock + " peer"]
        if peer is None:
            cells += ["–"] * (4 if clock == "seconds" else 3)
            continue
        name = f"{peer['backend']} ({peer['form']}, {peer['level']})"
        error = [number(peer["error"])] if clock == "seconds" else []
        cells += [name, in_time(peer[clock]), *error, f"{peer[clock] / line['seconds']:.3g}"]
    return cells


def _honesty(rows) -> list[str]:
    """Promises and certificates: the same questions to all solvers that answered."""
    asked = [r for r in rows if r["group"] != INCONSISTENT and r["backend"] != compiled.NAME]
    by_level = {level: [r for r in asked if r["level"] == level] for level in (*LEVELS, OWN)}
    ours = by_level.pop(OWN)
    return [
        "## Honesty",
        "",
        *(_claims(level, found) for level, found in by_level.items() if found),
        _certified("QP solvers", [r for found in by_level.values() for r in found]),
        _certified("gauss's own methods", ours),
        "",
    ]


def _claims(level: str, asked: list[dict]) -> str:
    claims = [r for r in asked if r["claimed"]]
    broken, wrong = [r for r in claims if is_broken(r)], [r for r in claims if is_wrong(r)]
    return (
        f"* Level {level}: of {len(claims)} claims of QP solvers {len(broken)} came with a residual above its "
        f"promise and rounding; {len(wrong)} with an error above {WRONG:g} or numbers that are not finite, of which "
        f"the certificate refused {sum(not r['certified'] for r in wrong)}."
    )


def _certified(name: str, asked: list[dict]) -> str:
    certified = [r for r in asked if r["certified"]]
    worse = [r for r in certified if r["error"] > 2 * r["certificate"] + 1e-14]
    return (
        f"* {len(worse)} of {len(certified)} certified answers of {name} have an error above twice what the "
        "certificate says (and above rounding)."
    )


def _count(value) -> str:
    return "" if np.isnan(value) else str(value)
