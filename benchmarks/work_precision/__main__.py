"""Measure what is not measured yet, and write the table, the report, the charts and a section of the README."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse  # noqa: E402
import time  # noqa: E402

import benchmarks.work_precision as work_precision  # noqa: E402
import gauss  # noqa: E402
from benchmarks.command import RESULTS, about  # noqa: E402
from benchmarks.work_precision import peers, prepared, report  # noqa: E402
from benchmarks.work_precision.reference import find  # noqa: E402
from benchmarks.work_precision.scenes import CASES, TimedScene  # noqa: E402
from gauss.bench.precision import attempts  # noqa: E402
from gauss.integrators import METHODS  # noqa: E402

EXPLICIT, SUNDIALS = ("dop853", "dopri5", "rk4"), ("cvode_adams", "ida")
WIDE = 16  # rates of a system beyond which implicit steps take long to compile


def main():
    """Measure and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.work_precision", description=about(work_precision.__doc__))
    parser.add_argument("--patience", type=float, default=0.3, help="longest run of one setting [s]")
    parser.add_argument("--scene", action="append", help="only scenes whose name has this in it; may be repeated")
    extent = parser.add_mutually_exclusive_group()
    extent.add_argument("--fresh", action="store_true", help="measure everything again")
    extent.add_argument("--report", action="store_true", help="measure nothing; write what the table gives")
    given = parser.parse_args()
    table = report.AttemptTable(RESULTS / "work_precision.csv", given.fresh)
    for case in () if given.report else CASES:
        if given.scene is None or any(part in case.name for part in given.scene):
            began = time.process_time()
            _measure(case, table, given.patience)
            table.add_time(time.process_time() - began)
    report.write(table, RESULTS, RESULTS.parent / "README.md", work_precision.__doc__.split("\n\n", 2)[2].strip())


def _measure(case: TimedScene, table: "report.AttemptTable", patience: float):
    """All attempts of a case that are missing in the table."""
    system = gauss.compile_scene(case.make())
    methods = [*METHODS, *SUNDIALS] if system.n_v <= WIDE else EXPLICIT
    wanted = [method for method in methods if not table.has_method(case.name, "gauss", method)]
    missing = [engine for engine, (_, _, own) in peers.ENGINES.items() if not table.has_method(case.name, engine, own[-1])]
    ready = [one for one in prepared.METHODS if not table.has_method(case.name, "gauss", prepared.name_of(one))]
    if not (wanted or missing or ready):
        return
    against = find(case, system)
    for method in wanted:
        table.add(case.name, list(attempts(system, case.duration, against, [method], patience)), against.source)
    for one in prepared.attempts(case, system, against, patience, ready):
        table.add(case.name, [one], against.source)
    known = lambda engine, method, setting: table.has_method(case.name, engine, method)  # noqa: E731
    for one in peers.attempts(case, system, against, patience, known):
        table.add(case.name, [one], against.source)


if __name__ == "__main__":
    main()
