"""Initial value problem of a motion, with its method: the checked input of a driver."""

from typing import NamedTuple

import numpy as np

from gauss.backends import Backend
from gauss.dynamics.laws.switching import Switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rules import Question
from gauss.dynamics.stabilisation import Baumgarte, Drift
from gauss.integrators import Integrator, Tolerance
from gauss.simulation.held_inputs import HeldInputs
from gauss.simulation.moreau.sleeping import Sleeping
from gauss.system import State, System


class Problem(NamedTuple):
    """Initial value problem of a motion, with its method.

    Attributes
    ----------
    system : System
        The system.
    laws : Laws
        Its loads.
    method : Integrator
        Integrator.
    tolerance : Tolerance
        Local error of adaptive steps.
    step : float or None
        Fixed step, or the largest adaptive one [s].
    backend : str, Backend or class
        Requested backend, or "auto".
    stabilisation : str or Baumgarte
        Constraint stabilisation, as given by the user.
    drift : Drift
        The same, with its gains.
    switching : Switching
        Switching times and functions, and jumps of prescribed velocities.
    start : State
        Consistent initial state.
    end : float
        Final time [s].
    samples : ndarray or None
        Times to return [s]; every step when None.
    progress : bool
        Whether a progress bar is shown.
    held : HeldInputs, optional
        Inputs, held between samples; they are zero when not given.
    sleeping : Sleeping, optional
        When bodies at rest sleep; never when not given.
    """

    system: System
    laws: Laws
    method: Integrator
    tolerance: Tolerance
    step: float | None
    backend: str | Backend | type
    stabilisation: str | Baumgarte
    drift: Drift
    switching: Switching
    start: State
    end: float
    samples: np.ndarray | None
    progress: bool
    held: HeldInputs | None = None
    sleeping: Sleeping | None = None

    @property
    def question(self) -> Question:
        """Facts that the rules of :data:`gauss.dynamics.plan.MOTIONS` are evaluated on."""
        stabilisation = "baumgarte" if isinstance(self.stabilisation, Baumgarte) else self.stabilisation
        held = self.held is not None
        return Question(self.system, self.laws, self.backend, self.method, self.drift, stabilisation, held)
