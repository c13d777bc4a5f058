"""Sweeps: many four-bars by one call, beside single calls of simulate.

Run it with:

    python -m benchmarks.sweeps [--side 100] [--singles 60]

side² four-bars differ in the mass of the crank and in its speed at the start; each moves for a second with DOP853 at a
tolerance of 1e-9. The sweep is made by two processes, which includes starting them, building and assembling every member,
and compiling. Single calls are of members at random, half of them before the sweep, half after: ``simulate(scene)`` of a
scene that has not been seen before, whose equations are traced and compiled; and, where only starts differ,
``simulate(system, state=…)`` of one system that is compiled already, its start assembled. Their median times the number of
members is what all would take one after the other. Machine code is kept in a folder that is empty at the beginning. Motions
made both ways are compared. Writes benchmarks/results/sweeps.csv and .md.
"""

import os
import tempfile
import time
from functools import partial
from statistics import median
from typing import Any

import numpy as np

from benchmarks.command import command, load_at_the_end
from gauss.bench.contest import with_time
from gauss.bench.machine import header
from gauss.bench.markdown import head, table

RUN: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-9}
DURATION, SAMPLES, WORKERS = 1.0, 11, 2
TITLES = (
    "what differs",
    "members",
    "sweep, two processes",
    "one single call",
    "all single calls",
    "ratio",
    "difference [rad]",
)
DIFFERENT = 1e-6  # difference that tolerances of 1e-9 do not explain [rad]
ASKED = 20.0  # times as fast as single calls


def measure(side: int, singles: int) -> list[dict]:
    """Rows of all measurements."""
    import gauss
    from gauss.scene.named_numbers import changed

    scene, times, rng = gauss.load("four_bar"), np.linspace(0.0, DURATION, SAMPLES), np.random.default_rng(0)
    vary = {
        "masses and speeds": {"crank.mass": np.linspace(0.5, 2.0, side), "A.rate": np.linspace(6.0, 15.0, side)},
        "speeds alone": {"A.rate": np.linspace(6.0, 15.0, side * side)},
    }
    system = gauss.compile_scene(scene)

    def alone(values):
        one = scene
        for name, value in values.items():
            one = changed(one, name, value)
        begin, state = time.perf_counter(), None
        if "crank.mass" not in values:
            guess = system.start()
            state = system.initial_state(guess.q, [values["A.rate"], *guess.v[1:]], keep=["A"])
        motion = gauss.simulate(one if state is None else system, DURATION, state=state, times=times, **RUN)
        return time.perf_counter() - begin, motion

    rows = []
    for what, values in vary.items():
        chosen = [{name: float(rng.choice(some)) for name, some in values.items()} for _ in range(singles)]
        motions: list[tuple[dict, Any]] = []

        def batch(some, what=what, motions=motions):
            for member in some:
                wall, motion = alone(member)
                motions.append((member, motion))
                rows.append({"what": what, "way": "single", "members": 1, "wall_s": wall})

        batch(chosen[: singles // 2])
        sweep = partial(gauss.sweep, scene, values, DURATION, samples=SAMPLES, workers=WORKERS, progress=False, **RUN)
        swept, wall = with_time(sweep, time.perf_counter)
        rows.append({"what": what, "way": "sweep", "members": side * side, "wall_s": wall})
        batch(chosen[singles // 2 :])
        assert (swept.status == 1).all()
        worst = max(np.abs(swept.q.sel(member).values - motion.q).max() for member, motion in motions)
        assert worst < DIFFERENT, f"members of the sweep of {what} differ by {worst:.1e} rad from single calls"
        rows[-1]["largest_difference_rad"] = worst
    return rows


def page(rows: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results."""
    asked = f"Asked for where everything differs: {ASKED:.0f} times as fast."
    compared = [
        _compared(what, [row for row in rows if row["what"] == what]) for what in dict.fromkeys(row["what"] for row in rows)
    ]
    return [*head("Many four-bars by one call", conditions), *table(TITLES, compared), "", asked, ""]


def _compared(what: str, mine: list[dict]) -> list[str]:
    """Line of the comparison of one kind of sweep."""
    sweep = next(row for row in mine if row["way"] == "sweep")
    single = median(row["wall_s"] for row in mine if row["way"] == "single")
    whole = single * sweep["members"]
    worst = next(row["largest_difference_rad"] for row in mine if row["largest_difference_rad"] != "")
    times = [f"{sweep['wall_s']:.1f} s", f"{1e3 * single:.1f} ms", f"{whole:.0f} s (estimated)"]
    return [what, f"{sweep['members']:.0f}", *times, f"{whole / sweep['wall_s']:.0f}", f"{worst:.1e}"]


def measured(side: int, singles: int) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["GAUSS_CACHE"] = folder
        rows = measure(side, singles)
    return rows, [*header("numpy", "llvmlite", "xarray", "loky"), load_at_the_end()]


if __name__ == "__main__":
    options = {"side": (100, "values of each of two numbers"), "singles": (60, "single calls of each kind")}
    command("sweeps", __doc__, measured, page, options)
