"""Engines: where accelerations of single states come from, with what is known of their error."""

from abc import ABC, abstractmethod

from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, System


class DistrustError(SimulationError):
    """A step was made with accelerations that another way to compute them does not confirm; make it again."""


class Engine(ABC):
    """Accelerations along one motion.

    Attributes
    ----------
    evaluations : int
        How often accelerations were asked for.
    rescued : int
        Solutions for which another method stepped in.
    handed_over : float or None
        Time from which the certified engine answers [s]; None as long as this one does.
    """

    evaluations: int = 0
    rescued: int = 0
    handed_over: float | None = None

    @property
    @abstractmethod
    def name(self) -> str:
        """What was used, in words."""

    @property
    @abstractmethod
    def error(self) -> float:
        """Largest relative error of accelerations that was found."""

    @abstractmethod
    def rates(self, system: System, state: State, load=None) -> Rates:
        """Accelerations, and the power of all loads; ``load`` (n_v,) is added to them."""

    @abstractmethod
    def project(self, system: System, state: State) -> State:
        """State after a step, projected onto the constraints of position and rates."""

    @abstractmethod
    def check(self, point: Point, last: bool = False):
        """Compare the accelerations of a point, above all of the last one, with those of another way to compute them.

        Raises
        ------
        DistrustError
            If they differ; from then on the other way is used.
        """

    def hand_over(self, t: float) -> bool:
        """Let the certified engine go on from here; False where none can, or it does already."""
        return False
