"""The command of a benchmark: measure, write the table, write the page that the table gives."""

import argparse
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from gauss.bench.table import header_of, read_table, write_table
from gauss.errors import did_you_mean

RESULTS = Path(__file__).parent / "results"
Options = Mapping[str, tuple[object, str]]  # name: default, help
ROUNDS: Options = {"rounds": (15, "interleaved repetitions")}


def about(text: str) -> str:
    """First line of the description of a benchmark, for its help."""
    return text.split("\n")[0]


def command(
    name: str, text: str, measure: Callable[..., tuple[list[dict], list[str]]], page: Callable, options: Options = ROUNDS
) -> dict:
    """Measure unless ``--report`` is given, write ``results/NAME.csv``, and from it ``results/NAME.md``.

    Parameters
    ----------
    name, text : str
        Of the benchmark; the text is the docstring of its module.
    measure : callable
        Takes the options, returns rows and conditions (when, where, with which versions).
    page : callable
        ``page(rows, conditions)`` is the page, of rows and conditions as the table holds them.
    options : dict
        Defaults and help of the options.

    Returns
    -------
    dict
        Options, "report" among them.
    """
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=about(text))
    for option, (default, purpose) in options.items():
        parser.add_argument(f"--{option}", type=type(default), default=default, help=purpose)
    parser.add_argument("--report", action="store_true", help="measure nothing; write what the table gives")
    given = vars(parser.parse_args())
    table = RESULTS / f"{name}.csv"
    if not given["report"]:
        rows, conditions = measure(**{option: given[option] for option in options})
        columns = dict.fromkeys(key for row in rows for key in row)
        write_table(table, conditions, rows, columns)
    written = "\n".join(page(read_table(table), header_of(table)))
    (RESULTS / f"{name}.md").write_text(written, encoding="utf-8")
    print(written)
    return given


def chosen(only: str, names: Iterable[str]) -> list[str]:
    """Names that hold a part in upper or lower case; all of them if it is empty.

    SystemExit if there are none: the message lists the names.
    """
    names = list(names)
    found = [name for name in names if only.lower() in name.lower()]
    if not found:
        raise SystemExit(f"--only: nothing is called {only!r}. {did_you_mean(only, names)}")
    return found


def agreeing(difference: float, at_most: float, what: str) -> float:
    """A relative difference of two computations of one quantity, if tolerances or round-off explain it.

    Raises
    ------
    AssertionError
        If it is larger, or NaN: the times of a table are worth nothing beside results that are wrong.
    """
    assert difference <= at_most, f"{what}: the results differ by {difference:.1e}; at most {at_most:g} is explained"
    return difference


def load_at_the_end() -> str:
    """Condition of a measurement that has just ended."""
    return f"load average when it ended: {', '.join(f'{load:.1f}' for load in os.getloadavg())}"
