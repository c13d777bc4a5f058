"""Measure all contests and write the results."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("OPENBLAS_CORETYPE", None)  # the dgemm that the batch kernel is compared with gets its best
if os.environ.get("GAUSS_VECTORS") == "4":  # the best of registers of that length
    os.environ["OPENBLAS_CORETYPE"] = "Haswell"

import argparse  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from typing import NamedTuple  # noqa: E402

import benchmarks.speed as speed  # noqa: E402
import gauss  # noqa: E402
from benchmarks.command import RESULTS, about, load_at_the_end  # noqa: E402
from benchmarks.speed import report  # noqa: E402
from benchmarks.speed.arms import chain, panda, talos  # noqa: E402
from benchmarks.speed.dynamics import from_python, in_loops, longer_chain, share_of_peak  # noqa: E402
from benchmarks.speed.large_loops import first_accelerations, longer_loops  # noqa: E402
from benchmarks.speed.loops import loops  # noqa: E402
from benchmarks.speed.steps import batch, single  # noqa: E402
from benchmarks.speed.streams import own_steps  # noqa: E402
from benchmarks.speed.swing import free_swing  # noqa: E402
from gauss.bench.contest import Contest, Timings, measure  # noqa: E402
from gauss.bench.machine import header  # noqa: E402
from gauss.bench.markdown import head  # noqa: E402
from gauss.codegen.processor import width  # noqa: E402


class BatchGoals(NamedTuple):
    """Least ratios of rows whose code fills vector registers."""

    panda: float
    steps: float
    talos: float
    chain: float
    dgemm: float


GOALS = {8: BatchGoals(40.0, 35.0, 30.0, 12.0, 0.6), 4: BatchGoals(35.0, 30.0, 25.0, 12.0, 0.62)}  # by doubles in a register
NAMES = {8: "speed", 4: "speed_avx2"}  # of the files


def contests() -> Iterator[Contest]:
    """All rows of the table with their goals; made one by one, each is measured before the next is made."""
    arm, at_least = panda(), GOALS[width()]
    yield from_python(arm, goal=4.0)
    one, many = in_loops(arm, one_goal=7.0, batch_goal=at_least.panda)
    yield from (one, many)
    yield single(arm, goal=6.0)
    yield batch(arm, goal=at_least.steps)
    yield own_steps(arm, alone_goal=4.0, scipy_goal=100.0)
    yield free_swing(arm, scipy_goal=20.0, mujoco_goal=200.0)
    yield from in_loops(talos(), one_goal=6.0, batch_goal=at_least.talos)
    small = chain(100)
    yield from in_loops(small, one_goal=2.5, batch_goal=at_least.chain, count=512)
    yield longer_chain(small, chain(1000), at_most=11.0)
    yield share_of_peak(many, at_least.dgemm)
    yield loops("four-bar", gauss.load("n_four_bar", n=1), goal=12.0)
    yield loops("Stewart platform", gauss.load("stewart_platform"), goal=1.0)
    yield loops("ladder of 10 four-bars", gauss.load("n_four_bar", n=10), goal=6.0)
    yield loops("ladder of 40 four-bars", gauss.load("n_four_bar", n=40), goal=6.0)
    for name, family, n in (("ladder of 500 four-bars", "n_four_bar", 500), ("chain of 1000, hung", "hung_chain", 1000)):
        small, large = gauss.load(family, n=n // 10), gauss.load(family, n=n)
        yield longer_loops(name, small, large, at_most=11.0)
        yield first_accelerations(name, small, large, at_most=11.0)


def main():
    """Measure and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description=about(speed.__doc__))
    parser.add_argument("--rounds", type=int, default=15, help="interleaved repetitions")
    rounds = parser.parse_args().rounds
    measured: list[Timings] = []
    for contest in contests():
        measured.append(measure(contest, rounds))
        print(*report.table(report.lines(measured[-1:]))[2:], sep="\n", flush=True)
    lines = [*header("numpy", "scipy", "pin", "mujoco", "llvmlite"), load_at_the_end()]
    rows, name = report.lines(measured), NAMES[width()]
    report.write_rounds(measured, lines, RESULTS / f"{name}.csv")
    report.chart(rows, lines, RESULTS / name)
    how = speed.__doc__.split("\n\n", 3)[3].strip()
    text = [
        *head("Speed", lines),
        "CPU times of one core, medians of interleaved rounds; ratios are medians of the ratios of single rounds.",
        f"Agreement is the largest relative difference to Pinocchio; no goal is met with more than {report.AGREEMENT:g}.",
        "",
        *report.table(rows),
        "",
        f"![times as fast as the peers]({name}.svg)",
        "",
        how,
        "",
        "Settings of single rows:",
        "",
        report.remarks(measured),
        "",
    ]
    (RESULTS / f"{name}.md").write_text("\n".join(text))


if __name__ == "__main__":
    main()
