"""Form of the object that supplies the mechanics of a system: the mechanics is in :mod:`gauss.dynamics`, above this room."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeVar, runtime_checkable

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.system.state import State
from gauss.system.subsystem import Subsystem

if TYPE_CHECKING:
    from gauss.system.system import System

T = TypeVar("T")


@runtime_checkable
class Dynamics(Protocol):
    """Supplier of the mechanics of systems, from the rooms above.

    It keeps compiled functions, one store for one system.
    """

    def anew(self) -> "Dynamics":
        """Supplier for another system, with nothing compiled yet."""

    def on_demand(self, key: tuple, make: Callable[[], T]) -> T:
        """Entry of a key in the store, made on first request."""

    def accelerations(self, system: "System", state: State, load) -> np.ndarray:
        """Accelerations (n_v,)."""

    def held(self, system: "System", state: State, load) -> Compulsion | None:
        """Compulsion in the contact mode of a state, set-valued elements as rows and loads; None where no such exists."""

    def forward_dynamics(self, system: "System") -> Callable:
        """Compiled function (q, v, load, out=None, t=0.0) → accelerations."""

    def function(self, system: "System", names, reference: str, independent, device=None) -> Callable:
        """Compiled function of a state, or of several at once, by their names."""

    def evaluate(self, system: "System", names, given: dict, t, reference: str, independent) -> dict:
        """Results of several functions of a state, by their names, for arguments by their names."""

    def operations(self, system: "System", subsystems: tuple[Subsystem, ...]) -> int | None:
        """Operations of one evaluation of the forward dynamics of subsystems; None if these are not traced."""

    def plans(self, system: "System") -> dict:
        """Plans of its motions and of single states, {what: plan}, or the error that says what they need."""

    def candidate_pairs(self, system: "System"):
        """Pairs of shapes that a step of time stepping looks at: numbers of parts and pairs, and whether by a grid."""

    def time_step(self, system: "System"):
        """Plan of time stepping, and what a step takes at the start; an error with the reason where there is none."""

    def sleepers(self, system: "System"):
        """Bodies that may sleep in time stepping, and those that never do; where none may, the error with the reason."""

    def cost(self, system: "System", plan) -> tuple[float, float]:
        """Estimated cost of an evaluation by a plan [s], and its ratio to that of the fastest route that is barred."""

    def equal_chains(self, system: "System", plan) -> list[tuple[int, int]]:
        """Numbers of equal chains that code of single states may compute together, and of their joints, for each kind."""

    def called(self, system: "System") -> dict[str, str]:
        """Loads whose laws cannot become machine code, and why."""

    def consistent(
        self, system: "System", state: State, kept=(), required=False, least_violation=False, rough=False
    ) -> State:
        """Consistent state near the given one; joints in ``kept`` keep their coordinates if possible, or must."""

    def scene_start(self, system: "System") -> State:
        """Consistent start of the scene at time 0."""

    def projected(self, system: "System", state: State) -> State:
        """State projected onto the constraints; one that meets them to round-off stays as it is."""

    def mobility(self, system: "System"):
        """Freedoms and redundant constraints at the start of the scene; its ``str`` lists them."""
