"""Measures all problems and writes the page."""

import time
from statistics import median

import numpy as np

import benchmarks.iftomm
import gauss
from benchmarks.iftomm.problems import BenchmarkProblem
from gauss.bench.contest import Competitor, interleaved, with_time
from gauss.bench.markdown import formatted_table, head

MARGIN = 100  # how many times less than asked errors should be


def measure(all_problems: list[BenchmarkProblem], rounds: int) -> list[dict]:
    """Row of every problem."""
    runs, rows = [], []
    for problem in all_problems:
        system = gauss.compile_scene(problem.make())
        run = lambda problem=problem, system=system: gauss.simulate(  # noqa: E731
            system, problem.duration, times=problem.times, progress=False, **problem.settings
        )
        runs.append(run)
        motion, first = with_time(run, time.perf_counter)
        energy, error = float(np.abs(gauss.energy(motion).balance).max()), problem.error(motion)
        rows.append(
            {
                "problem": problem.name,
                "what": problem.what if problem.energy is None else "energy",
                "steps": problem.steps,
                "asked": problem.asked,
                "unit": "" if problem.energy is None else " J",
                "asked_by": problem.by,
                "method": problem.settings.get("integrator", "dop853"),
                "tolerance": problem.settings.get("rtol", 1e-12),
                "error": error,
                "energy": energy,
                "times_less": problem.asked / (error if problem.energy is None else energy),
                "reference": problem.against,
                "first_s": first,
                "submitted": problem.submitted,
            }
        )
    walls = interleaved({k: Competitor(run) for k, run in enumerate(runs)}, rounds, time.perf_counter)
    for k, row in enumerate(rows):
        row["wall_ms"] = 1e3 * median(walls[k])
        row["first_s"] -= median(walls[k])
    return rows


COLUMNS = {
    "problem": "{problem}",
    "seen": "{what}",
    "samples": "{steps:.0f}",
    "asked": "{asked:.0e}{unit} {asked_by}",
    "method": "{method}, {tolerance:.0e}",
    "error": "{error:.1e}",
    "energy": "{energy:.1e} J",
    "times less": "{times_less:.1e}",
    "against": "{reference}",
    "wall": "{wall_ms:.2f} ms",
    "first": "{first_s:.2f} s",
    "submitted": "{submitted}",
}


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    missed = [row["problem"] for row in rows if not row["times_less"] >= MARGIN]
    verdict = f"Errors at least {MARGIN} times less than asked: {'missed by ' + ', '.join(missed) if missed else 'all'}."
    about = benchmarks.iftomm.__doc__.split("\n\n", 3)[3].strip()
    lines = [*head("The IFToMM benchmark problems", conditions), *formatted_table(COLUMNS, rows)]
    return [*lines, "", verdict, "", about, ""]
