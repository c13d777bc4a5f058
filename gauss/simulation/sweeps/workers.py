"""Workers of a sweep: this process, processes of this machine, or a cluster; pieces of dead workers are repeated."""

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, as_completed
from importlib import import_module
from typing import Any

from gauss.errors import GaussError, SimulationError, extra

RESTARTS = 3  # of dead workers; after more of them the work itself is taken to be the cause


def results_of(work: Callable, pieces: list[tuple], workers) -> Iterator[tuple[tuple, Any]]:
    """Pieces with the results of ``work(*piece)``, in the order of completion; the work is pickled for the workers.

    ``workers``: None for this process, a number for so many processes of this machine, or an object with ``submit`` as those
    of :mod:`concurrent.futures`, or a client of Dask. SimulationError if they die repeatedly.
    """
    if workers is None:
        for piece in pieces:
            yield piece, work(*piece)
        return
    left, died = list(pieces), 0
    while left:
        try:
            yield from _submitted(work, left, workers)
        except GaussError:
            raise
        except Exception as error:
            died += 1
            if died > RESTARTS or not (isinstance(error, BrokenExecutor) and isinstance(workers, int)):
                raise _failed(error, len(pieces) - len(left), len(pieces)) from error


def _submitted(work: Callable, left: list[tuple], workers) -> Iterator[tuple[tuple, Any]]:
    """Results of the pieces that are left, by an executor; finished pieces are removed from the list."""
    executor = _executor(workers)
    futures = {executor.submit(work, *piece): piece for piece in left}
    try:
        for future in as_completed(futures):
            found = future.result()
            left.remove(futures[future])
            yield futures[future], found
    except KeyboardInterrupt:
        if isinstance(workers, int):  # own processes, which ignore Ctrl-C
            executor.shutdown(wait=False, kill_workers=True)
        raise
    finally:
        for future in futures:
            future.cancel()


def _failed(error: Exception, done: int, count: int) -> SimulationError:
    """Error of workers that die repeatedly."""
    return SimulationError(
        f"workers failed ({type(error).__name__}: {error}); {done} of {count} pieces are done. Is there enough memory? "
        "A sweep with path= goes on from its folder when it is called again."
    )


def _executor(workers):
    """Executor: an object with ``submit``."""
    if isinstance(workers, int):
        with extra("sweep"):
            loky = import_module("loky")
        return loky.get_reusable_executor(
            max_workers=workers, reuse="auto", kill_workers=False, initializer=_ignore_interrupts
        )
    return workers.get_executor() if hasattr(workers, "get_executor") else workers


def _ignore_interrupts():
    """Leave Ctrl-C, which a terminal sends to all processes, to the parent process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
