"""Open chains by Pinocchio's aba, stepped by SciPy."""

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

from benchmarks.work_precision.scenes import NotBuiltError
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.system import State, System

METHODS = ("DOP853", "LSODA")
LEAST = 2.3e-14  # what SciPy takes


class PinocchioModel:
    """A system in Pinocchio.

    NotBuiltError if it has loops, or joints of more than one freedom.
    """

    def __init__(self, system: System):
        if system.has_closures or system.n_q != system.n_v:
            raise NotBuiltError("only open chains of joints of one freedom are stepped by SciPy here")
        if not all(bound.on_coordinates for bound in system.loads):
            raise NotBuiltError("forces on bodies are not given to aba here")
        self.system, self.model = system, twin(system).reduced
        self.data, start = self.model.createData(), system.initial_state()
        self.start = np.concatenate([start.q, start.v])
        self.driven = bool(system.loads)

    def centres(self, method: str, tolerance: float, duration: float) -> np.ndarray:
        """Centres of mass (n, 3) at the end."""
        n, none, model, data = self.system.n_v, np.zeros(self.system.n_v), self.model, self.data

        def slope(t, y):
            effort = Applied(kinematics(self.system, State(t, y[:n], y[n:]))).P if self.driven else none
            return np.concatenate([y[n:], pin.aba(model, data, y[:n], y[n:], effort)])

        run = {"method": method, "rtol": max(tolerance, LEAST), "atol": tolerance, "t_eval": [duration]}
        found = solve_ivp(slope, (0.0, duration), self.start, **run)
        if not found.success:
            raise ArithmeticError(found.message)
        return np.array(
            kinematics(self.system, State(duration, *np.split(found.y[:, -1], 2))).x[: self.system.structure.n_bodies]
        )
