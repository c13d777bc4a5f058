"""Prepared motions: everything of a motion but its initial state is decided, so that a call costs a few microseconds.

The step loop is that of :func:`gauss.simulate`: from a consistent state, its results are the same bit for bit.
"""

import ctypes
from typing import Any

import numpy as np

from gauss.arguments import named_arguments, real_numbers
from gauss.codegen import one_tier
from gauss.codegen.kernels import Control, LoopStatus, address
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.plan import plan_of
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.dynamics.rules import Plan
from gauss.errors import SimulationError, StateError
from gauss.integrators import FixedStep
from gauss.scene import Scene
from gauss.simulation.arguments import checked_problem
from gauss.simulation.drivers import DRIVERS, adaptive_run
from gauss.simulation.problem import Problem
from gauss.simulation.simulate import simulate
from gauss.simulation.step_limits import BUDGET, lasting
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


class PreparedMotion:
    """Function (q, v) → samples of the motion from there; made by :func:`prepare`.

    Attributes
    ----------
    system : System
        The system.
    times : ndarray, shape (k,)
        Samples [s], counted from the start.
    """

    def __init__(self, scene: Scene | System, duration: float, times, options: dict):
        self.options, end = options, [duration] if times is None else times
        given = {"integrator": "dop853", "step": None, "rtol": 1e-12, "atol": None, "stabilisation": "projection"} | options
        integrator, step, rtol, atol, stabilisation = given.values()
        with one_tier():
            problem = checked_problem(
                scene, duration, integrator, step, rtol, atol, "auto", stabilisation, None, end, (), False
            )
            self.system, self.duration, plan = problem.system, float(duration), plan_of(problem.question)
            self._rigid = self.system.rigid_joints
            name = self.system.scene.name
            if plan.driver != "compiled loop" or isinstance(problem.method, FixedStep):
                fixed = "the integrator has fixed steps, which gauss.Simulator makes"
                why = fixed if isinstance(problem.method, FixedStep) else f"its driver is {plan.driver!r}"
                why = "; ".join(map(str, plan.rejected)) or why
                raise SimulationError(f"a motion of {name!r} cannot be prepared: {why}.")
            samples = np.asarray(problem.samples, dtype=float)
            self._origin, self.times = problem.start, samples - problem.start.t
            self._calling = (problem._replace(progress=False), plan) if problem.laws.called else None
            if self._calling is not None:
                self._given = np.empty(1 + self.system.n_q + self.system.n_v)
                self._keep_places()
                return
            if problem.switching.times or problem.switching.conditional:
                raise SimulationError(f"a motion of {name!r} cannot be prepared: laws switch; use gauss.simulate.")
            run = adaptive_run(problem, plan.dynamics)
            loop = run.prepared()
            simulate(self.system, duration, times=end, progress=False, **options)  # confirms the accelerations of the loop
        self._first, self._begins = loop.function("start"), bool(samples[0] == problem.start.t)
        self._later = np.ascontiguousarray(samples[int(self._begins) :])
        self._rows = np.empty((samples.size, run.layout.row))
        run.control.samples, self._control = float(self._later.size), Control()
        self._template = bytes(run.control)
        self._numbers: Any = np.frombuffer(self._control).data  # type: ignore[call-overload]  # a record of ctypes
        self._settings = np.frombuffer(self._template).data
        tolerance, n, size = problem.tolerance, self.system.n_q + self.system.n_v, run.layout.size
        self._given = np.concatenate(
            [[problem.start.t], np.zeros(n), [tolerance.rtol, tolerance.atol, tolerance.atol_rates]]
        )
        self._keep_places()
        self._begun, self._confirmed = np.empty(size + 7), np.empty(size)
        self._point, self._first_check = np.split(self._begun, [size])
        self._confirmed_room: Any = self._confirmed.data
        self._point_room = self._point.data
        self._start_arguments = ctypes.c_void_p(address(self._given)), ctypes.c_void_p(address(self._begun))
        out = self._rows[int(self._begins) :]
        arrays = self._point, self._confirmed, self._later, out
        self._arguments = ctypes.byref(self._control), *(ctypes.c_void_p(address(array)) for array in arrays)
        self._loop = loop.entry
        ends = np.cumsum([1, self.system.n_q, self.system.n_v])
        _, q, v, _ = np.split(self._rows, ends, axis=1)
        self._found = q, v
        self._row, self._first_row = self._point[: run.layout.row], self._rows[:1]

    def _keep_places(self):
        """Keep the places of an initial state, also as memory, which is written to in half the time of arrays."""
        n_q, n_v = self.system.n_q, self.system.n_v
        self._q, self._v = np.split(self._given[1 : 1 + n_q + n_v], [n_q])
        self._q_room: Any = self._q.data
        self._v_room: Any = self._v.data

    def __reduce__(self):
        return PreparedMotion, (self.system, self.duration, self.times, self.options)

    def __call__(self, q=None, v=None) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (k, n_q) and rates (k, n_v) at the samples.

        Parameters
        ----------
        q, v : array_like, shape (n_q,), (n_v,), optional
            Consistent initial state; that of the scene when not given.

        Returns
        -------
        tuple of ndarray
            Views of one array, which the next call overwrites.

        Raises
        ------
        StateError
            If the state does not fit.
        SimulationError
            If the motion cannot continue.
        """
        try:
            _put(self._q_room, self._origin.q if q is None else q)
            _put(self._v_room, self._origin.v if v is None else v)
        except ValueError:
            raise StateError(f"expected {self._q.size} coordinates and {self._v.size} rates, got {q!r} and {v!r}.") from None
        if self._rigid:
            refuse_other_pose(self.system, self._q)
        if self._calling is not None:
            found = self._called(*self._calling)
            return found.q, found.v
        if not self._is_done():
            found = self.trajectory(self._q.copy(), self._v.copy())
            return found.q, found.v
        return self._found

    def _called(self, problem: Problem, plan: Plan) -> Trajectory:
        """Motion whose machine code calls opaque laws, which may switch: its steps are tried one by one."""
        if not np.isfinite(self._given[1:]).all():
            return self.trajectory(self._q.copy(), self._v.copy())  # refuses it
        start = State(self._origin.t, self._q.copy(), self._v.copy())
        with one_tier():
            return DRIVERS[plan.driver](problem._replace(start=start), plan)

    def _is_done(self) -> bool:
        """Make the motion; whether it is confirmed to its end."""
        control, checked = self._control, self._first_check
        self._first.call(*self._start_arguments)
        self._confirmed_room[:], self._numbers[:] = self._point_room, self._settings
        error, _, control.kinetic, potential, control.initial, control.magnitude, control.h = checked.tolist()
        control.lowest, control.h = potential, lasting(control.h, control.smallest)
        control.highest = potential
        if not error <= ACCELERATION_TOLERANCE:
            return False
        if self._begins:
            self._first_row[:] = self._row
        self._loop.call(*self._arguments, BUDGET)
        while control.status == LoopStatus.PAUSED:
            self._loop.call(*self._arguments, BUDGET)
        return control.status == LoopStatus.DONE and control.constraint_residual <= ACCELERATION_TOLERANCE

    def trajectory(self, q=None, v=None) -> Trajectory:
        """Motion as :func:`gauss.simulate` returns it, with work, statistics and energy balance."""
        start = State(self._origin.t, self._origin.q if q is None else q, self._origin.v if v is None else v)
        return simulate(self.system, self.duration, state=start, times=self.times, progress=False, **self.options)


def _put(room: Any, given):
    """Write numbers to memory; ValueError if they are none, or of another shape."""
    try:
        room[:] = given if type(given) is np.ndarray else real_numbers(given)
    except (TypeError, ValueError):  # of another type, or where doubles do not begin
        numbers = real_numbers(given)
        if numbers is None:
            raise ValueError("expected numbers.") from None
        room[:] = numbers


@named_arguments
def prepare(
    scene: Scene | System,
    duration: float,
    *,
    times=None,
    integrator: str = "dop853",
    step: float | None = None,
    rtol: float = 1e-12,
    atol: float | tuple[float, float] | dict | None = None,
    stabilisation: str = "projection",
) -> PreparedMotion:
    """Prepare motions that differ in their initial states only: a call costs a few microseconds besides its steps.

    Parameters
    ----------
    scene : Scene or System
        Smooth scene, or a compiled one, whose traced loads do not switch. Opaque laws are called by the machine code; these
        motions take some hundred microseconds besides, and may switch.
    duration : float
        Simulated time [s].
    times : array_like, optional
        Samples [s], counted from the start; the end when not given.
    integrator, step, rtol, atol, stabilisation
        As of :func:`gauss.simulate`, for methods that choose their steps.

    Returns
    -------
    PreparedMotion
        Function (q, v) → coordinates (k, n_q) and rates (k, n_v); its ``trajectory(q, v)`` is a
        :class:`gauss.Trajectory`.

    Raises
    ------
    SimulationError
        If the steps are not compiled, with the reasons, or a law switches.

    Examples
    --------
    >>> import gauss
    >>> swing = gauss.prepare(gauss.load("pendulum"), 0.5)
    >>> q, v = swing([0.1], [0.0])
    >>> q.shape
    (1, 1)
    """
    options = {"integrator": integrator, "step": step, "rtol": rtol, "atol": atol, "stabilisation": stabilisation}
    return PreparedMotion(scene, duration, times, options)
