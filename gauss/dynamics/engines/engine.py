"""Engine: rates(state), projection and check of one motion, whatever the source of the accelerations."""

from abc import ABC, abstractmethod

from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, System


class DistrustError(SimulationError):
    """Accelerations of a step failed the check by an independent computation; the step is to be repeated."""


class Engine(ABC):
    """Source of accelerations along one motion.

    Attributes: ``handed_over``: time from which the certified engine is in use [s]; None while this one is.
    """

    handed_over: float | None = None

    @property
    @abstractmethod
    def evaluations(self) -> int:
        """Number of accelerations computed."""

    @property
    @abstractmethod
    def rescued(self) -> int:
        """Solutions that another backend found."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Method, in words."""

    @property
    @abstractmethod
    def error(self) -> float:
        """Largest relative error of accelerations found by a check."""

    @abstractmethod
    def rates(self, system: System, state: State, load=None) -> Rates:
        """Accelerations (n_v,), and the power of all loads; ``load`` (n_v,) are further generalised forces."""

    @abstractmethod
    def project(self, system: System, state: State) -> State:
        """State after a step, projected onto the constraints of position and velocity."""

    @abstractmethod
    def check(self, point: Point, last: bool = False):
        """Check the accelerations of a point by an independent computation; ``last`` marks the end of the motion.

        DistrustError if they differ; from then on the engine uses the independent computation.
        """

    def hand_over(self, t: float) -> bool:
        """Switch to the certified engine from time t [s]; False if there is none, or it is in use already."""
        return False
