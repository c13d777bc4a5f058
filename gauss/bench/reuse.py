"""Gain of a kept workspace and of a warm start along a motion, step by step, beside solving from nothing."""

import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from gauss.backends.accuracy import KEPT
from gauss.backends.clarabel_ import Clarabel
from gauss.backends.compulsion import Compulsion
from gauss.backends.osqp_ import OSQP
from gauss.backends.piqp_ import PIQP
from gauss.backends.programme import FORMS
from gauss.backends.programmed import attempt, read
from gauss.bench import compiled
from gauss.bench.contest import with_time
from gauss.bench.contestants import ready
from gauss.bench.levels import settings
from gauss.bench.markdown import in_time, number, table
from gauss.bench.problems import MechanismProblem, make_problem
from gauss.bench.reference import reference
from gauss.bench.table import Measurement, ResultTable
from gauss.bench.worker import Worker
from gauss.dynamics.assemble import assemble
from gauss.simulation import simulate

REUSE = Measurement(
    "qp_reuse",
    ("problem", "backend", "level", "mode"),
    ("seconds", "setup", "update", "solve", "error", "outcome", "reason"),
    ("numpy", "scipy", "qpsolvers", "clarabel", "osqp", "piqp"),
)
PROBLEMS = ("panda", "four-bar", "ladder 10")
LEVELS = ("low", "high")
STEPS, STEP = 100, 1e-3  # of the motion [s]
MOTION_TIME = 120.0  # [s] that a motion may take by the clock
ONE_SHOT, ANEW, KEPT_MODE, WARM = "one-shot by qpsolvers", "called directly", "workspace kept", "and warm start"
MODES = {name: (ONE_SHOT, ANEW, KEPT_MODE, WARM)[: 4 if name == "osqp" else 3] for name in ("osqp", "clarabel", "piqp")}
ALL_MODES = MODES["osqp"]


def along(compulsions: list[Compulsion], accelerations: list, backend: str, level: str) -> list[dict]:
    """Median times and largest error of every mode; at each step all modes take their turn.

    All have the settings of the comparison; kept workspaces of Clarabel do not presolve, for they would take no updates.
    """
    chosen, kept_only = settings(backend, level), KEPT["clarabel"] if backend == "clarabel" else {}
    cold = {"warm_starting": False} if backend == "osqp" else {}
    method = {"osqp": OSQP, "clarabel": Clarabel, "piqp": PIQP}[backend]
    kept, modes = {KEPT_MODE: method(**chosen, **cold, **kept_only), WARM: method(**chosen)}, MODES[backend]
    programmes = [FORMS["F2s"](compulsion) for compulsion in compulsions]
    figures: dict[str, list] = {mode: [] for mode in modes}
    answers: dict[str, list] = {mode: [] for mode in modes}
    for whole in programmes:
        lean, prepared = whole.without_zeros(), ready(backend, whole, level)
        with prepared.around:
            for mode in modes:
                if mode == ONE_SHOT:
                    found, seconds = with_time(prepared.call, time.perf_counter)
                    answer, library = prepared.read(found), prepared.library(found)
                    reported = Reported(library.setup, np.nan, library.solve)
                else:
                    solver, programme = (method(**chosen), lean) if mode == ANEW else (kept[mode], whole)
                    answer, seconds = with_time(partial(attempt, solver, programme), time.perf_counter)
                    reported = _reported(solver, backend)
                answers[mode].append(answer)
                figures[mode].append((seconds, *reported))
    errors = {mode: _errors(compulsions, programmes, answers[mode], accelerations) for mode in modes}
    return [_row(mode, max(errors[mode]), figures[mode]) for mode in modes]


def _row(mode: str, error: float, figures: list[tuple[float, ...]]) -> dict:
    """Row of a mode: the largest error, and medians of the times but the first."""
    times = zip(("seconds", "setup", "update", "solve"), map(float, np.median(figures[1:], axis=0)), strict=True)
    return {"mode": mode, "error": error, "outcome": "answered"} | dict(times)


class Reported(NamedTuple):
    """Times [s] that a library reports of its last call; nan where it reports none."""

    setup: float
    update: float
    solve: float


def _reported(solver, backend: str) -> Reported:
    """Times that OSQP and PIQP report of a workspace; set-up is that of its making."""
    if backend == "clarabel":
        return Reported(np.nan, np.nan, np.nan)
    info = solver._solver._solver.info if backend == "osqp" else solver._solver.result.info
    return Reported(info.setup_time, info.update_time, info.solve_time)


def _errors(compulsions, programmes, outcomes, accelerations) -> list[float]:
    answers = map(read, compulsions, programmes, outcomes)
    return [expected.error(c, answer) for c, answer, expected in zip(compulsions, answers, accelerations, strict=True)]


def compare_reuse(folder: Path, fresh: bool = False, progress: bool = True) -> ResultTable:
    """Measure the modes that are not measured yet, and return the table."""
    table = REUSE.table(folder, fresh)
    cells = [(p, b, level) for p in PROBLEMS for b in MODES for level in LEVELS]
    missing = [c for c in cells if not table.has(problem=c[0], backend=c[1], level=c[2], mode=ONE_SHOT)]
    motions: dict[str, tuple] = {}
    with Worker() as worker:
        for name, backend, level in tqdm(missing, unit="cell", disable=not progress, desc="bench qp, along motions"):
            if name not in motions:
                compulsions = along_motion(make_problem(name))
                motions[name] = compulsions, [reference(compulsion) for compulsion in compulsions]
            reply = worker.call(along, *motions[name], backend, level, timeout=MOTION_TIME)
            nothing = dict.fromkeys(("seconds", "setup", "update", "solve", "error"), np.nan) | {"outcome": reply.outcome}
            rows = reply.value or [nothing | {"mode": mode} for mode in MODES[backend]]
            for row in rows[::-1]:  # the mode that marks a finished cell comes last
                table.add({"problem": name, "backend": backend, "level": level, "reason": reply.reason} | row)
    return table


def along_motion(problem: MechanismProblem, steps: int = STEPS) -> list[Compulsion]:
    """Compulsions at equally spaced times of the motion that starts in the state of a problem."""
    assert problem.system is not None  # programmes alone do not move
    times = STEP * np.arange(steps)
    motion = simulate(problem.system, times[-1], state=problem.state, times=times, progress=False)
    return [assemble(problem.system, motion.state(i), problem.load) for i in range(len(motion))]


def reuse_lines(rows, others) -> list[str]:
    """Section of the report; ``others`` are the rows of the comparison, for the machine code of gauss beside them."""
    titles = ["problem", "backend", "level", *ALL_MODES, "set-up, update, solve by the library", "largest error"]
    lines = [
        "## Along a motion",
        "",
        f"{STEPS} instants, {1e3 * STEP:g} ms apart, F2s; all ways of calling take turns at every instant, with "
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
    once = mine[ONE_SHOT]["seconds"]
    times = {mode: f"{in_time(row['seconds'])} ({once / row['seconds']:.1f})" for mode, row in mine.items()}
    kept = mine[WARM if WARM in mine else KEPT_MODE]
    library = ", ".join(in_time(kept[name]) for name in ("setup", "update", "solve"))
    worst = max(row["error"] for row in mine.values())
    return [*key, *(times.get(mode, "") for mode in ALL_MODES), library, number(worst)]


def _beside(name: str, seconds: float, rows) -> str:
    calls = [r["seconds"] for r in rows if np.isfinite(r["seconds"])]
    if not calls:
        return ""
    library = [r["update"] + r["solve"] for r in rows if r["mode"] in (KEPT_MODE, WARM)]
    least = np.nanmin([np.nan, *library]) if np.isfinite(library).any() else np.nan
    return f"{name} {in_time(seconds)} ({min(calls) / seconds:.3g}, {least / seconds:.3g})"
