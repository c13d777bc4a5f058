"""Machine code that is made once it pays: when evaluations by numpy have taken about as long as making it will.

So a motion takes at most twice as long as the better of both would have. What making it takes grows with the number of its
operations, which is known once the equations are written down; that costs little.
"""

from threading import Lock

from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.traced_system import Kernels, Program
from gauss.system import System

LEAST = 25  # evaluations by numpy that take as long as the machine code of next to nothing
PER_OPERATION = 0.25  # further ones for each operation of an evaluation: 0.4 ms of compiling, of 1.6 ms by numpy


class Tiered:
    """Machine code of one system, for steps that are put together by Python.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.dynamics.conditions.obstacles`).
    """

    def __init__(self, system: System):
        self.system, self.spent = system, 0
        self.programs: dict[str, Program] = {}
        self.made: dict[str, Kernels] = {}
        self._lock = Lock()

    def kernels(self, laws: Laws, spent: int) -> Kernels | None:
        """Machine code for these laws; None as long as it would not pay, or where one of them has to be called.

        Parameters
        ----------
        laws : Laws
            Loads of the system.
        spent : int
            Evaluations by numpy since this was asked last.
        """
        with self._lock:
            return self._kernels(laws, spent)

    def _kernels(self, laws: Laws, spent: int) -> Kernels | None:
        self.spent += spent
        if laws.key in self.made:
            return self.made[laws.key]
        if laws.called or self.spent < LEAST:
            return None
        program = self.programs.setdefault(laws.key, Program(self.system, laws, Drift()))
        if self.spent < LEAST + PER_OPERATION * sum(program.rates.operations().values()):
            return None
        return self.made.setdefault(laws.key, program.kernels())


def tiered(system: System) -> Tiered:
    """Machine code of a system, kept from motion to motion."""
    return system.dynamics.on_demand((Tiered,), lambda: Tiered(system))
