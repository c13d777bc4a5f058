"""Methods of the atlas: a formulation, a solver, an integrator, and a stabilisation."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from gauss.analysis import warn_of_balance
from gauss.backends import BACKENDS, Backend, make, solve
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Answer
from gauss.bench.levels import AUTO, OURS
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.laws.switching import switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import drift
from gauss.errors import BackendError, BalanceWarning, SimulationError
from gauss.integrators import METHODS as INTEGRATORS
from gauss.integrators import FixedStep, Rates, Tolerance
from gauss.simulation import Trajectory, simulate
from gauss.simulation.python_run import PythonRun
from gauss.simulation.undetected_switching import warn_of_switching
from gauss.system import State, System

RTOL, ATOL = 1e-10, 1e-12  # of adaptive integrators


@dataclass(frozen=True)
class Method:
    """One way to compute a motion."""

    backend: str = AUTO  # what solves for accelerations
    form: str = "F2s"  # form of the compulsion that a QP solver gets
    integrator: str = "rk4"  # integrator, stabilisation: as in :func:`gauss.simulate`
    stabilisation: str = "projection"
    certified: bool = True  # whether every evaluation is certified, as users get it, or believed as the backend claims

    @property
    def name(self) -> str:
        """Name in the atlas."""
        form = "" if self.ours else f" {self.form}"
        believed = "" if self.certified else ", believed"
        return f"{self.backend}{form}, {self.integrator}, {self.stabilisation}{believed}"

    @property
    def ours(self) -> bool:
        """Whether it is a method of gauss."""
        return self.backend in OURS

    @property
    def _options(self) -> dict[str, Any]:
        """Settings of a foreign solver."""
        return {} if self.ours else {"form": self.form}

    def instant(self, compulsion: Compulsion) -> Answer:
        """Accelerations of one instant; BackendError if the method says that it has none."""
        if self.certified:
            solution = solve(compulsion, self.backend, **self._options)
            if not solution.status.certified:
                raise BackendError(str(solution.status))
            return solution.answer
        answer = _asked(make(self.backend, self.form), compulsion)
        if not answer.found:
            raise BackendError(answer.message)
        return answer

    def motion(self, system: System, duration: float, step: float, state: State | None = None, times=None) -> Trajectory:
        """Motion; ``step`` is for integrators of fixed step.

        GaussError if the method says that it cannot go on.
        """
        fixed = isinstance(INTEGRATORS[self.integrator], FixedStep)
        settings: dict[str, Any] = {"step": step} if fixed else {"rtol": RTOL, "atol": ATOL}
        if self.certified:
            chosen: dict[str, Any] = {
                "integrator": self.integrator,
                "backend": self.backend,
                "stabilisation": self.stabilisation,
            }
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", BalanceWarning)  # warned of below
                trajectory = simulate(system, duration, **chosen, **settings, state=state, times=times, progress=False)
            warn_of_balance(trajectory)
            return trajectory
        start = system.initial_state() if state is None else system.initial_state(state.q, state.v, state.t)
        against = drift(system, self.stabilisation, start)
        solver = Believing(make(self.backend, self.form), against.gains)
        integrator, tolerance = INTEGRATORS[self.integrator], Tolerance(RTOL, ATOL, ATOL)
        end = start.t + duration
        heeded = switching(system, Laws(system), start, end)
        run = PythonRun(system, integrator, solver, tolerance, settings.get("step"), end, against.projects, heeded)
        samples = None if times is None else start.t + np.asarray(times, dtype=float)
        trajectory = run.collect(start, samples, False)
        warn_of_switching(trajectory, integrator)
        return trajectory


class Believing(CertifiedEngine):
    """Accelerations as a backend claims them, without a certificate.

    Parameters
    ----------
    backend : Backend
        Made by :func:`gauss.backends.make`.
    gains : tuple of float or None
        As of :class:`CertifiedEngine`.
    """

    def __init__(self, backend: Backend, gains=None):
        super().__init__(gains=gains)
        self.believed = self.backend = backend

    def rates(self, system: System, state: State, load=None, loads=None) -> Rates:
        """Accelerations and the power of the loads; a SimulationError where the backend claims no success."""
        compulsion, (driven, loaded, dissipated) = self.assembled(system, state, load, loads)
        answer = _asked(self.believed, compulsion)
        self.evaluations += 1
        if not answer.found:
            raise SimulationError(f"t = {state.t:.6g} s, backend {self.believed.name!r}: {answer.message}.")
        driven = driven - answer.multipliers @ compulsion.C
        return Rates(answer.qdd, np.array([driven, loaded, dissipated]))


def _asked(backend: Backend, compulsion: Compulsion) -> Answer:
    """Answer of a backend; methods for equality rows refuse others."""
    if compulsion.h.size and backend.name in BACKENDS:
        raise BackendError(f"backend {backend.name!r} takes no inequality rows.")
    return backend(compulsion)


DEFAULT = Method(integrator="dop853")
FOREIGN = ("daqp", "quadprog", "clarabel", "piqp", "proxqp", "osqp", "qpalm", "highs")
METHODS = {
    method.name: method
    for method in (
        DEFAULT,
        Method(),
        Method(integrator="semi_implicit_euler"),
        Method(integrator="radau5"),
        Method(stabilisation="baumgarte"),
        Method(stabilisation="none"),
        *(Method(backend) for backend in (*BACKENDS, *FOREIGN)),
        *(Method(backend, certified=False) for backend in (*BACKENDS, *FOREIGN)),
        Method("daqp", "F2", certified=False),
        Method("clarabel", "F3", certified=False),
        Method("osqp", stabilisation="baumgarte", certified=False),
    )
}
