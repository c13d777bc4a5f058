"""Measure and write: python -m benchmarks.iftomm."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import benchmarks.iftomm  # noqa: E402
from benchmarks.command import command, load_at_the_end  # noqa: E402
from benchmarks.iftomm import measure, page, problems  # noqa: E402
from gauss.bench.machine import header  # noqa: E402


def measured(rounds: int) -> tuple[list[dict], list[str]]:
    """Rows and conditions of the table."""
    os.environ["GAUSS_CACHE"] = ""  # compile times are those of a first run
    rows = measure(problems(), rounds)
    return rows, [*header("numpy", "llvmlite"), load_at_the_end()]


if __name__ == "__main__":
    command("iftomm", benchmarks.iftomm.__doc__, measured, page)
