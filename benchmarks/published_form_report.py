"""Maros and Mészáros's problems in the published form: verdicts of today's versions, of those then, and the published ones.

Verdicts are those of ``benchmarks/published_form.py``. With the versions of solvers with which the published table was
measured, nothing else differs but the machine and limits of iterations: settings are qpbenchmark's own.
"""

from collections.abc import Iterable
from pathlib import Path

from benchmarks.agreement import agreement
from gauss.bench.markdown import share, table
from gauss.bench.table import read_table

SIDES = {"now": "today's versions", "then": "published versions", "published": "published"}
TITLES = ("solver", "problems", *(f"solved, {words}" for words in SIDES.values()), "same verdict today", "same verdict then")


def rows(now: Iterable[dict], then: Iterable[dict], published: dict) -> list[dict]:
    """Verdicts by solver, level and problem, of problems and solvers that all three tables have; whether kept."""
    ours = [{_key(row): row["kept"] for row in one} for one in (now, then)]
    common = [key for key in ours[0] if key in ours[1] and key in published]
    return [
        dict(zip(("solver", "level", "problem"), key, strict=True))
        | {"now": ours[0][key], "then": ours[1][key], "published": published[key]["kept"]}
        for key in common
    ]


def _key(row: dict) -> tuple[str, str, str]:
    return row["backend"], row["level"], row["problem"]


def lines(path: Path, settings: dict[str, str]) -> list[str]:
    """Sections of the page, one a level."""
    found = read_table(path)
    text = [__doc__.split("\n\n")[1].replace("\n", " "), ""]
    for level, setting in settings.items():
        chosen = [row for row in found if row["level"] == level]
        text += _section(f"## {setting}, in the published form", chosen) if chosen else []
    return text


def _section(title: str, chosen: list[dict]) -> list[str]:
    by_solver = {
        name: [row for row in chosen if row["solver"] == name] for name in sorted({row["solver"] for row in chosen})
    }
    found = {side: agreement((row["solver"], row[side], row["published"]) for row in chosen) for side in ("now", "then")}
    words = (f"with {SIDES[side]} {one.same} of {one.count} verdicts, τ = {one.tau:.2f}" for side, one in found.items())
    body = []
    for name, mine in by_solver.items():
        shares = [one.shares[name][0] for one in found.values()] + [found["now"].shares[name][1]]
        body.append([name, len(mine), *map(share, shares), *(_same(mine, side) for side in found)])
    problems = len({row["problem"] for row in chosen})
    intro = f"{problems} problems, those that all three were asked. Verdicts as published, and Kendall's τ of the rankings "
    intro += f"by share of problems solved: {'; '.join(words)}."
    return [title, "", intro, "", *table(TITLES, body), ""]


def _same(mine: list[dict], side: str) -> int:
    return sum(row[side] == row["published"] for row in mine)
