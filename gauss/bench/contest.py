"""A contest: the same work by several competitors, in interleaved rounds, so that a busy machine is busy for all of them."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import TypeVar

import numpy as np

OURS = "gauss"
WARM_UP = 0.02  # s until caches are filled: before, a run is slower the shorter it is
Name = TypeVar("Name")
Result = TypeVar("Result")
Clock = Callable[[], float]  # s: time.process_time or time.perf_counter


@dataclass(frozen=True)
class Competitor:
    """Work that is timed."""

    run: Callable  # does the work once
    units: int = 1  # units of the work in one run
    # false to run it for :data:`WARM_UP` before each timed run, so that the state of the caches does not count
    is_short: bool = True
    every: int = 1  # it is run in every so many-th round


@dataclass(frozen=True)
class Goal:
    """Ratio of the time of a peer to that of gauss that a row of the table asks for."""

    peer: str
    ratio: float


@dataclass(frozen=True)
class Contest:
    """One row of the table."""

    work: str  # what is done
    tasks: dict[str, Competitor]  # competitors by name; the first is gauss
    goals: tuple[Goal, ...]  # what is asked for
    agreement: float  # largest relative difference of the results to Pinocchio's
    remarks: str = ""  # settings of this row
    operations: int = 0  # operations of one unit in the code of gauss, if they are counted


@dataclass(frozen=True)
class Timings:
    """A contest with the seconds per unit of every round, by competitor."""

    contest: Contest
    seconds: dict[str, list[float]] = field(default_factory=dict)

    def median(self, name: str) -> float:
        """Median seconds per unit."""
        return median(self.seconds[name])

    def ratio(self, peer: str) -> tuple[float, float, float]:
        """Median and quartiles of the time of a peer over that of gauss, round by round."""
        ratios = [p / t for p, t in zip(self.seconds[peer], self.seconds[OURS], strict=True)]
        low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
        return float(middle), float(low), float(high)


def measure(contest: Contest, rounds: int) -> Timings:
    """Time all competitors of a contest."""
    return Timings(contest, interleaved(contest.tasks, rounds))


def interleaved(
    competitors: Mapping[Name, Competitor], rounds: int, clock: Clock = time.process_time
) -> dict[Name, list[float]]:
    """Seconds per unit of each competitor and round; all take their turn in each round."""
    seconds: dict[Name, list[float]] = {name: [] for name in competitors}
    for number in range(rounds):
        for name, one in competitors.items():
            if number % one.every:
                continue
            spent = 0.0 if one.is_short else WARM_UP
            while spent < WARM_UP:
                spent += duration(one.run, clock)
            seconds[name].append(duration(one.run, clock) / one.units)
    return seconds


def duration(run: Callable, clock: Clock = time.process_time) -> float:
    """Seconds of one call; by the default clock CPU seconds of all threads of the process together."""
    return with_time(run, clock)[1]


def with_time(run: Callable[[], Result], clock: Clock = time.process_time) -> tuple[Result, float]:
    """Result of one call, and its seconds as of :func:`duration`."""
    begin = clock()
    result = run()
    return result, clock() - begin


def repeated(call: Callable, count: int) -> Callable[[], list]:
    """So many calls in one; their results."""
    return lambda: [call() for _ in range(count)]


def difference(ours, reference) -> float:
    """Largest difference relative to the largest number."""
    return float(np.abs(np.asarray(ours) - reference).max() / np.abs(reference).max())
