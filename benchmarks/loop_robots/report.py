"""The page of the table of robots with loops."""

from collections.abc import Sequence

import numpy as np

from benchmarks.loop_robots.operations import GENERAL, TAKEN
from gauss.bench.contest import OURS
from gauss.bench.markdown import formatted_table, head, in_time, number

BATCHED = "batch"
SOFT = "mj_forward"  # its constraints are springs
WANTED = 1e-10  # error that is asked for
BETTER, BETTER_IN_BATCH = 5.0, 15.0  # times the fastest peer


def page(text: str, names: Sequence[str], lines: list[dict], conditions: list[str]) -> list[str]:
    """Page of the results.

    Parameters
    ----------
    text : str
        Docstring of the benchmark.
    names : sequence of str
        Peers.
    lines, conditions : list
        Of the table.
    """
    about = text.split("\n\n", 3)[3].rsplit("\n\n", 1)[0]
    made = [_made(names, line) for line in lines]
    return [
        *head("Robots with loops and geared rotors", conditions),
        *_summary(made),
        "",
        *formatted_table(
            {
                "robot": "{robot}",
                "loops, couplings": "{loops}, {couplings}",
                "rates": "{nv}",
                "freedoms": "{dof}",
                "redundant rows": "{redundant}",
                "operations": "{operations}",
                "moved in assembly": "{moved:.2g}",
                "error": "{error}",
                "one state": "{ours}",
                "in a batch": "{batch}",
                "peers (error)": "{peers}",
                "fastest / ours": "{ratio:.1f}",
                "/ batch": "{batch_ratio:.0f}",
                "first answer, cold": "{cold}",
                "warm": "{warm}",
            },
            made,
        ),
        "",
        *_motions(lines),
        about,
        "",
    ]


def _made(names: Sequence[str], line: dict) -> dict:
    """Cells of a line."""
    times = {name: _value(line, name) for name in (*names, OURS, BATCHED)}
    known = [name for name in names if np.isfinite(times[name])]
    best = min((times[name] for name in known), default=np.nan)
    return {
        "robot": line["robot"],
        **{key: f"{_value(line, key):.0f}" for key in ("loops", "couplings", "nv", "dof", "redundant")},
        "operations": _operations(_value(line, TAKEN), _value(line, GENERAL)),
        "moved": _value(line, "moved"),
        "accuracy": _value(line, "error"),
        "error": number(_value(line, "error")),
        "ours": in_time(times[OURS]),
        "batch": in_time(times[BATCHED]),
        "peers": ", ".join(f"{name} {in_time(times[name])} ({number(_value(line, f'{name} error'))})" for name in known),
        "ratio": best / times[OURS],
        "batch_ratio": best / times[BATCHED],
        "cold": in_time(_value(line, "cold")),
        "warm": in_time(_value(line, "warm")),
    }


def _operations(taken: float, general: float) -> str:
    """Numbers of operations; that of the general elimination in brackets."""
    return f"{taken:.0f}" if np.isnan(general) else f"{taken:.0f} ({general:.0f})"


def _summary(made: list[dict]) -> list[str]:
    """Counts of what is asked for."""
    n = len(made)
    exact = sum(one["accuracy"] <= WANTED for one in made)
    once, many = (
        sum(one["ratio"] >= BETTER for one in made),
        sum(one["batch_ratio"] >= BETTER_IN_BATCH for one in made),
    )
    return [
        f"{n} robots: all open and are assembled; {exact} agree with the references to {WANTED:g}. One state is at least "
        f"{BETTER:g} times as fast as the fastest peer on {once}, a batch {BETTER_IN_BATCH:g} times on {many}. The "
        f"constraints of {SOFT} are soft: it answers another question, to the error that is stated."
    ]


def _motions(lines: list[dict]) -> list[str]:
    moved = [line for line in lines if np.isfinite(_value(line, "drift"))]
    if not moved:
        return []
    cells = [
        {
            "robot": line["robot"],
            "until": f"{_value(line, 'moved_until'):.0f} s",
            "drift": number(_value(line, "drift")),
            "time": in_time(_value(line, "motion")),
        }
        for line in moved
    ]
    return [
        *formatted_table({"motion of": "{robot}", "until": "{until}", "drift": "{drift}", "CPU time": "{time}"}, cells),
        "",
    ]


def _value(line: dict, key: str) -> float:
    given = line.get(key, "")
    return float(given) if given not in ("", None) else np.nan
