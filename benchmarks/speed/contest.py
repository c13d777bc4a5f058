"""A contest: the same work done by several, in interleaved rounds."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import median

import numpy as np

OURS = "gauss"
WARM = 0.02  # s after which caches have settled: before, a run is slower the shorter it is


@dataclass(frozen=True)
class Task:
    """What one competitor does.

    Parameters
    ----------
    run : callable
        Does it once.
    units : int
        How many units of the work that is.
    is_short : bool
        Whether what it finds in the caches counts; it is then run for :data:`WARM` before the run that is timed.
    """

    run: Callable
    units: int = 1
    is_short: bool = True


@dataclass(frozen=True)
class Goal:
    """What a row of the table asks for: to be so many times as fast as a peer."""

    peer: str
    ratio: float


@dataclass(frozen=True)
class Contest:
    """One row of the table.

    Parameters
    ----------
    work : str
        What is done.
    tasks : dict
        Competitors by name; the first is gauss.
    goals : tuple of Goal
        What is asked for.
    agreement : float
        Largest relative difference of the results to Pinocchio's.
    remarks : str
        Settings of this row.
    operations : int
        Operations of one unit in the code of gauss, if they are counted.
    """

    work: str
    tasks: dict[str, Task]
    goals: tuple[Goal, ...]
    agreement: float
    remarks: str = ""
    operations: int = 0


@dataclass(frozen=True)
class Measured:
    """A contest with the seconds per unit of every round, by competitor."""

    contest: Contest
    seconds: dict[str, list[float]] = field(default_factory=dict)

    def median(self, name: str) -> float:
        """Median seconds per unit."""
        return median(self.seconds[name])

    def ratio(self, peer: str) -> tuple[float, float, float]:
        """Median and quartiles of how many times as long a peer took, round by round."""
        ratios = [p / t for p, t in zip(self.seconds[peer], self.seconds[OURS], strict=True)]
        low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
        return float(middle), float(low), float(high)


def measure(contest: Contest, rounds: int) -> Measured:
    """Run all competitors in turn, so many times; each finds its data in the caches, where its runs before left them."""
    seconds = {name: [] for name in contest.tasks}
    for _ in range(rounds):
        for name, task in contest.tasks.items():
            spent = 0.0 if task.is_short else WARM
            while spent < WARM:
                spent += cpu_time(task.run)
            seconds[name].append(cpu_time(task.run) / task.units)
    return Measured(contest, seconds)


def cpu_time(run: Callable) -> float:
    """CPU seconds of one call, all threads of the process together."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def difference(ours, reference) -> float:
    """Largest difference relative to the largest number."""
    return float(np.abs(np.asarray(ours) - reference).max() / np.abs(reference).max())
