"""A motion that is asked for: everything that its driver needs to know, checked."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.drift import Baumgarte, Drift
from gauss.dynamics.laws import Laws
from gauss.dynamics.rules import Question
from gauss.dynamics.switching import Switching
from gauss.integrators import Integrator, Tolerance
from gauss.system import State, System


class Problem(NamedTuple):
    """A motion that is asked for.

    Attributes
    ----------
    system : System
        What moves.
    laws : Laws
        Its loads.
    method : Integrator
        How it is stepped.
    tolerance : Tolerance
        Local error of steps that are chosen.
    step : float or None
        Fixed step, or the largest one [s].
    backend : str or object
        How accelerations are solved.
    stabilisation : str or Baumgarte
        How drift off the constraints is undone, as it was asked for.
    drift : Drift
        The same, with its gains.
    switching : Switching
        When laws switch, and prescribed speeds jump.
    start : State
        Consistent start.
    end : float
        When to stop [s].
    samples : ndarray or None
        Times to return [s]; every step when None.
    progress : bool
        Whether a bar is shown.
    """

    system: System
    laws: Laws
    method: Integrator
    tolerance: Tolerance
    step: float | None
    backend: object
    stabilisation: str | Baumgarte
    drift: Drift
    switching: Switching
    start: State
    end: float
    samples: np.ndarray | None
    progress: bool

    @property
    def question(self) -> Question:
        """What the rules of :data:`gauss.dynamics.plan.MOTIONS` look at."""
        stabilisation = "baumgarte" if isinstance(self.stabilisation, Baumgarte) else self.stabilisation
        return Question(self.system, self.laws, self.backend, self.method, self.drift, stabilisation)
