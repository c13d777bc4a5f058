"""What a kept workspace and a warm start are worth along a motion, step by step, beside solving from nothing."""

import time
from pathlib import Path
from statistics import median

import numpy as np
from tqdm import tqdm

from gauss.assembly import assemble
from gauss.backends import make
from gauss.backends.programme import FORMS, attempt, read
from gauss.bench.levels import settings
from gauss.bench.machine import header
from gauss.bench.problems import Problem, make_problem
from gauss.bench.reference import reference
from gauss.bench.table import Table
from gauss.bench.worker import Worker
from gauss.compulsion import Compulsion
from gauss.simulation import simulate

FILE = "qp_reuse.csv"
KEYS = ("problem", "backend", "level", "mode")
VALUES = ("seconds", "error", "outcome", "reason")
PROBLEMS = ("panda", "four-bar", "ladder 10")
LEVELS = ("low", "high")
STEPS, STEP = 100, 1e-3  # of the motion [s]
TIMEOUT = 120.0
PACKAGES = ("numpy", "scipy", "qpsolvers", "clarabel", "osqp", "piqp")
ONE_SHOT, ANEW, KEPT, WARM = "one-shot by qpsolvers", "called directly", "workspace kept", "and warm start"
MODES = {"osqp": (ONE_SHOT, ANEW, KEPT, WARM), "clarabel": (ONE_SHOT, ANEW, KEPT), "piqp": (ONE_SHOT, ANEW, KEPT)}


def along(compulsions: list[Compulsion], accelerations: list, backend: str, level: str) -> list[dict]:
    """Median time and largest error of every mode; at each step all modes take their turn."""
    chosen = settings(backend, level)
    cold = {"warm_starting": False} if backend == "osqp" else {}
    kept = {KEPT: make(backend, **chosen, **cold).solver, WARM: make(backend, **chosen).solver if cold else None}
    modes = MODES[backend]
    programmes = [FORMS["F2s"](compulsion) for compulsion in compulsions]
    lean = [programme.without_zeros() for programme in programmes]
    solvers = {ONE_SHOT: lambda: make(f"qpsolvers:{backend}", **chosen).solver, ANEW: lambda: make(backend, **chosen).solver}
    seconds, answers = {mode: [] for mode in modes}, {mode: [] for mode in modes}
    for whole, given in zip(programmes, lean, strict=True):
        for mode in modes:
            begin = time.perf_counter()
            outcome = attempt(kept[mode], whole) if mode in kept else attempt(solvers[mode](), given)
            seconds[mode].append(time.perf_counter() - begin)
            answers[mode].append(outcome)
    errors = {mode: _errors(compulsions, programmes, answers[mode], accelerations) for mode in modes}
    return [
        {"mode": mode, "seconds": median(seconds[mode]), "error": max(errors[mode]), "outcome": "answered"} for mode in modes
    ]


def _errors(compulsions, programmes, outcomes, accelerations) -> list[float]:
    answers = map(read, compulsions, programmes, outcomes)
    return [expected.error(c, answer) for c, answer, expected in zip(compulsions, answers, accelerations, strict=True)]


def compare_reuse(folder: Path, fresh: bool = False, progress: bool = True) -> Table:
    """Measure the modes that are not measured yet, and return the table."""
    table = Table(Path(folder) / FILE, header(*PACKAGES), KEYS, VALUES, fresh)
    cells = [(p, b, level) for p in PROBLEMS for b in MODES for level in LEVELS]
    missing = [c for c in cells if not table.has(problem=c[0], backend=c[1], level=c[2], mode=ONE_SHOT)]
    motions: dict[str, tuple] = {}
    with Worker() as worker:
        for name, backend, level in tqdm(missing, unit="cell", disable=not progress, desc="bench qp, along motions"):
            if name not in motions:
                compulsions = along_motion(make_problem(name))
                motions[name] = compulsions, [reference(compulsion) for compulsion in compulsions]
            reply = worker.call(along, *motions[name], backend, level, timeout=TIMEOUT)
            nothing = {"seconds": np.nan, "error": np.nan, "outcome": reply.outcome}
            rows = reply.value or [nothing | {"mode": mode} for mode in MODES[backend]]
            for row in rows[::-1]:  # the mode that marks a finished cell comes last
                table.add({"problem": name, "backend": backend, "level": level, "reason": reply.reason} | row)
    return table


def along_motion(problem: Problem, steps: int = STEPS) -> list[Compulsion]:
    """Compulsions at equally spaced times of the motion that starts in the state of a problem."""
    times = STEP * np.arange(steps)
    motion = simulate(problem.system, times[-1], state=problem.state, times=times, progress=False)
    return [assemble(problem.system, motion.state(i), problem.load) for i in range(len(motion))]
