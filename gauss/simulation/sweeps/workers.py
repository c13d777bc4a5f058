"""Who does the work: this process, processes of this machine, or a cluster. A worker that dies costs only its time."""

import signal
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, as_completed
from importlib import import_module

from gauss.errors import GaussError, SimulationError, extra

RESTARTS = 3  # times that dead workers are replaced before it is put down to the work itself


def outcomes(work: Callable, pieces: list[tuple], workers) -> Iterator[tuple[tuple, object]]:
    """Pieces with what ``work(*piece)`` returns, in the order in which they are done.

    Parameters
    ----------
    work : callable
        What is done; it travels to the workers together with all that it holds.
    pieces : list of tuple
        Arguments.
    workers : None, int, executor or client
        None: this process. A number: so many processes of this machine. An object with ``submit`` as those of
        :mod:`concurrent.futures`, or a client of Dask: its workers.

    Raises
    ------
    SimulationError
        If workers die again and again.
    """
    if workers is None:
        for piece in pieces:
            yield piece, work(*piece)
        return
    left, died = list(pieces), 0
    while left:
        executor = _executor(workers)
        futures = {executor.submit(work, *piece): piece for piece in left}
        try:
            for future in as_completed(futures):
                found = future.result()
                left.remove(futures[future])
                yield futures[future], found
        except GaussError:
            raise
        except KeyboardInterrupt:
            if isinstance(workers, int):  # ours, and they do not hear Ctrl-C
                executor.shutdown(wait=False, kill_workers=True)
            raise
        except Exception as error:
            died += 1
            if died > RESTARTS or not (isinstance(error, BrokenExecutor) and isinstance(workers, int)):
                done = f"{len(pieces) - len(left)} of {len(pieces)} pieces are done"
                raise SimulationError(
                    f"workers failed ({type(error).__name__}: {error}); {done}. Is there enough memory? "
                    "A sweep with path= goes on from its folder when it is called again."
                ) from error
        finally:
            for future in futures:
                future.cancel()


def _executor(workers):
    """Something with ``submit``."""
    if isinstance(workers, int):
        with extra("sweep"):
            loky = import_module("loky")
        return loky.get_reusable_executor(max_workers=workers, reuse="auto", kill_workers=False, initializer=_deaf)
    return workers.get_executor() if hasattr(workers, "get_executor") else workers


def _deaf():
    """Leave Ctrl-C, which a terminal sends to all processes, to the one that gave the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
