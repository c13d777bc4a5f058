"""The nonlinear programme of all phases of a motion, solved by IPOPT (Wächter and Biegler, Math. Program. 106, 2006)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gauss.analysis.optimal.problem import MotionProblem, MotionValues, Solved
from gauss.analysis.optimal.transcription import Transcription
from gauss.interruption import Interruptible

TOLERANCE = 1e-9  # of IPOPT, on its scaled problem
RESOLVED = 1e-3  # of the cost of inputs at their sizes: of this size are changes that count


class CollocationProgramme:
    """Phases of a motion on their meshes.

    Parameters
    ----------
    problems : sequence of MotionProblem
        The phases, one after the other.
    meshes : sequence of ndarray
        Their meshes from 0 to 1.
    rows : sequence of list of int
        Their independent rows of the constraints.
    relaxed : bool
        Whether conditions on the ends may be missed, which is then the cost.
    """

    def __init__(self, problems: Sequence[MotionProblem], meshes, rows, relaxed: bool = False):
        import casadi

        self.casadi, self.problems, self.parts = casadi, problems, list[Transcription]()
        for problem, mesh, own in zip(problems, meshes, rows, strict=True):
            before = self.parts[-1] if self.parts else None
            self.parts.append(Transcription(problem, mesh, own, relaxed, before))
        self.variables = casadi.vertcat(*(part.variables for part in self.parts))
        self.costs = casadi.vertcat(*(part.objective for part in self.parts))
        self.constraints = casadi.vertcat(*(part.constraints for part in self.parts))

    def solve(self, guesses: Sequence[MotionValues]) -> Solved:
        """Optimum near guesses on the same meshes."""
        casadi = self.casadi
        start = np.concatenate([part.packed(guess) for part, guess in zip(self.parts, guesses, strict=True)])
        unit = self._unit_of_cost(guesses)
        names = {"x": self.variables, "f": casadi.sum1(self.costs) / unit, "g": self.constraints}
        options = {"print_level": 0, "sb": "yes", "max_iter": self.problems[0].iterations, "tol": TOLERANCE}
        solver = casadi.nlpsol("motion", "ipopt", names, {"print_time": False, "ipopt": options})
        lowest, highest = map(np.concatenate, zip(*(part.bounds for part in self.parts), strict=True))
        low, high = map(np.concatenate, zip(*(part.row_bounds for part in self.parts), strict=True))
        with Interruptible():  # which IPOPT takes for a failure of a function
            answer = solver(x0=start, lbx=lowest, ubx=highest, lbg=low, ubg=high)
        x, stats = np.array(answer["x"]).ravel(), solver.stats()
        rows = np.array(answer["g"]).ravel()
        residual = np.maximum(np.maximum(low - rows, rows - high), 0.0).max(initial=0.0)
        ends = np.cumsum([part.variables.size1() for part in self.parts])[:-1]
        pairs = zip(self.parts, np.split(x, ends), strict=True)
        values, misses = zip(*(part.unpacked(own) for part, own in pairs), strict=True)
        costs, kkt = self._costs_at(x), self._stationarity(answer, unit)
        return Solved(
            values, tuple(costs.tolist()), stats["return_status"], stats["iter_count"], kkt, float(residual), misses
        )

    def _costs_at(self, x: np.ndarray) -> np.ndarray:
        """Cost of each phase."""
        return np.array(self.casadi.Function("costs", [self.variables], [self.costs])(x)).ravel()

    def _unit_of_cost(self, guesses: Sequence[MotionValues]) -> float:
        """Size of the cost: IPOPT takes costs for numbers near one, whatever the units of the scene.

        It is that of the guesses, with all inputs at the sizes of these: guesses may cost nothing.
        """
        busy = [replace(guess, u=np.ones_like(guess.u)) for guess in guesses]
        found = 0.0
        for values in (guesses, busy):
            x = np.concatenate([part.packed(one) for part, one in zip(self.parts, values, strict=True)])
            found = max(found, float(np.abs(self._costs_at(x)).sum()))
        return RESOLVED * found if 0.0 < found < np.inf else 1.0

    def _stationarity(self, answer, unit: float) -> float:
        """Largest entry of ∇f + ∇g λ + ν, relative to the largest multiplier, or to 1."""
        casadi, multipliers = self.casadi, self.casadi.MX.sym("lambda", self.constraints.size1())
        slope = casadi.gradient(casadi.sum1(self.costs) / unit + casadi.dot(multipliers, self.constraints), self.variables)
        found = casadi.Function("slope", [self.variables, multipliers], [slope])(answer["x"], answer["lam_g"])
        whole = np.array(found + answer["lam_x"]).ravel()
        sizes = [np.abs(np.array(answer[name])).max(initial=0.0) for name in ("lam_g", "lam_x")]
        return float(np.abs(whole).max() / max(1.0, *sizes))
