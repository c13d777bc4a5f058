"""A control: does this comparison judge the problems of ``benchmarks/qp`` as qpbenchmark itself does, solver by solver.

    python -m benchmarks.qpbenchmark_run [--work bench/qpbenchmark]

It runs qpbenchmark on the test set, with qpbenchmark's own settings and its residuals, and puts what it finds beside
the rows of form F2 in ``results/qp.csv``, whose problems these are. An answer counts if it is claimed within 1 s, and
primal and dual residual and duality gap are within the tolerance. The comparison sets qpbenchmark's tolerances; beyond
these it raises limits of iterations and gives CVXOPT, KVXOPT and ECOS tolerances of the gap. qpbenchmark times the first
call, in which JAX compiles qpax and jaxopt's OSQP and a busy machine loads libraries; here that is a column of its own.
The rest is the same library with the same problem, so that other verdicts differ only near the tolerance.

Writes benchmarks/results/qpbenchmark.md and .csv; what the work folder has is not measured again.
"""

import argparse
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from benchmarks.command import RESULTS
from benchmarks.maros_meszaros import SETTINGS, SolverRecord, figures, pairs, published
from gauss.bench.export import file_name
from gauss.bench.levels import LEVELS
from gauss.bench.markdown import head, table
from gauss.bench.summary import asked
from gauss.bench.table import header_of, read_table, write_table
from gauss.bench.worker import ONE_THREAD

TEST_SET = Path(__file__).parent / "qp" / "gauss_problems.py"
FORM = "F2"
TITLES = ("solver", "problems", "kept here", "kept by qpbenchmark", "same verdict", "others: residual over tolerance")
COMMAND = """import sys
from qpbenchmark.benchmark import load_test_set
from qpbenchmark.results import Results
from qpbenchmark.run import run
problems = load_test_set(sys.argv[1])
run(problems, Results(sys.argv[2], problems), only_settings=sys.argv[3])
"""


def main():
    """Run qpbenchmark, and write both side by side."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.qpbenchmark_run", description=__doc__.split("\n")[0])
    parser.add_argument("--work", type=Path, default=Path("bench/qpbenchmark"), help="folder of its measurements")
    results = parser.parse_args().work / "results.csv"
    results.parent.mkdir(parents=True, exist_ok=True)
    for setting in SETTINGS.values():
        run(results, setting)
    ours = [row for row in asked(read_table(RESULTS / "qp.csv")) if row["form"] == FORM]
    rows = pairs([row | {"problem": file_name(row["problem"])} for row in ours], published(results))
    write(rows, header_of(RESULTS / "qp.csv"))


def run(results: Path, setting: str):
    """One of qpbenchmark's settings on all problems, one thread, JAX in double precision."""
    arguments = [str(TEST_SET), str(results), setting]
    one_thread = ONE_THREAD | {"JAX_ENABLE_X64": "1"}
    subprocess.run([sys.executable, "-c", COMMAND, *arguments], check=True, env=os.environ | one_thread)


def write(rows: list[tuple[dict, dict]], conditions: list[str]):
    """Table and page."""
    conditions = [*conditions, f"beside: qpbenchmark {version('qpbenchmark')}, run on the same machine"]
    write_table(RESULTS / "qpbenchmark.csv", conditions, [figures(*row) for row in rows])
    text = [*head("The problems of mechanisms by qpbenchmark itself", conditions), __doc__.split("\n\n")[2], ""]
    for level, setting in SETTINGS.items():
        chosen = [row for row in rows if row[0]["level"] == level]
        records = [SolverRecord(name, [r for r in chosen if r[0]["backend"] == name]) for name in _solvers(chosen)]
        same = sum(record.same for record in records)
        text += [f"## {setting}: tolerance {LEVELS[level]:g}", "", f"{same} of {len(chosen)} verdicts are the same.", ""]
        text += [*table(TITLES, map(_line, records)), ""]
    (RESULTS / "qpbenchmark.md").write_text("\n".join(text), encoding="utf-8")


def _solvers(rows) -> list[str]:
    return list(dict.fromkeys(ours["backend"] for ours, _ in rows))


def _line(record: SolverRecord) -> list:
    kept = [sum(pair[side]["kept"] for pair in record.pairs) for side in (0, 1)]
    return [record.solver, len(record.pairs), *kept, record.same, record.differing]


if __name__ == "__main__":
    main()
