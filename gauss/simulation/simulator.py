"""Simulator: a motion that Python advances step by step, in machine code, with the inputs of its choice.

The step loops are those of :func:`gauss.simulate`: a step of this module is, bit for bit, a step of such a motion.
"""

import ctypes
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from sys import maxsize
from typing import Any, NoReturn

import numpy as np

from gauss.arguments import named_arguments, real_numbers
from gauss.codegen import one_tier
from gauss.codegen.kernels import LoopStatus
from gauss.dynamics.laws.switching import Switching
from gauss.dynamics.load_receiver import output_kernel
from gauss.dynamics.outputs import shape_of, split
from gauss.dynamics.plan import plan_of
from gauss.dynamics.projection import within_limits
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError, require
from gauss.integrators import FixedStep
from gauss.scene import Scene
from gauss.simulation.arguments import checked_problem, random_changes
from gauss.simulation.compiled_fixed_run import CompiledFixedRun
from gauss.simulation.drivers import fixed_run
from gauss.simulation.grid import StepEnds
from gauss.simulation.held_inputs import FLOAT, HeldInputs, checked_inputs
from gauss.simulation.integrators import usual_fixed_step
from gauss.simulation.moreau.compiled_run import CompiledMoreauRun
from gauss.simulation.moreau.pair_kernel_steps import PairKernelSteps
from gauss.simulation.simulator_state import SimulatorState
from gauss.simulation.step_limits import steps_per_check
from gauss.simulation.step_watch import StepWatch
from gauss.simulation.tolerances import check_tolerances, checked_count
from gauss.system import State, System, retract

FAILURES = {
    LoopStatus.UNCONFIRMED: "the check does not confirm the accelerations",
    LoopStatus.OFF_CONSTRAINTS: "the projection onto the constraints failed",
    LoopStatus.UNSOLVED: "the equations of the step were not solved",
    LoopStatus.NOT_FINITE: "the motion is not finite",
}
STEPS = {("compiled loop", code) for code in ("embedded loops", "compiled", "callbacks")}
STEPS |= {("time stepping", code) for code in ("compiled", "pair kernels", "callbacks")}


class Simulator:
    """Motion of a scene in fixed steps, one call after the other.

    Steps do not end where laws switch: warnings name the first feature of a law of time that is shorter than the steps, the
    first jump, and laws of the state that may have switched undetected; prescribed velocities must not jump. A jump of a law
    makes the step around it of order 1; at the end of a step it does so with methods that evaluate the law there ("rk4",
    "verlet", "generalised_alpha"), and does no harm with others ("gauss4", "variational_midpoint", "energy_momentum").
    Values that change from step to step are best given as inputs, which are held within each step.
    Opaque laws are called by the machine code of the steps; nothing is known of them between its calls but at ``breaks``.

    Parameters
    ----------
    scene : Scene or System
        Scene, or a compiled one. Its inputs are set by :meth:`step`.
    step : float
        Step [s].
    integrator : str, optional
        Fixed-step method of :func:`gauss.simulate`; "time_stepping" for scenes with contacts, friction or limited forces,
        "rk4" for all others when not given.
    stabilisation : str
        Constraint stabilisation, see :func:`gauss.simulate`.

    Attributes
    ----------
    system : System
        The system.
    step_size : float
        Step [s].
    inputs, output_names : tuple of str
        Names of the inputs and of the outputs of the scene.

    Raises
    ------
    SimulationError
        If the method has no fixed step, if the steps are not compiled, with the reasons, or if a prescribed motion jumps;
        after ten thousand steps, the step that comes near such a jump says it.

    Examples
    --------
    >>> import gauss
    >>> scene = gauss.load("cart_pole")
    >>> scene.input("push", "rail", limits=10.0).name
    'push'
    >>> sim = gauss.Simulator(scene, step=1e-3)
    >>> sim.step([2.0], n=100)
    >>> round(sim.t, 9)
    0.1
    """

    @named_arguments
    def __init__(self, scene: Scene | System, step: float, integrator: str | None = None, stabilisation: str = "projection"):
        require(scene, (Scene, System), "Simulator")
        check_tolerances(step=step)
        whole = scene if isinstance(scene, Scene) else scene.scene
        integrator = integrator or usual_fixed_step(whole)
        with one_tier():
            problem = checked_problem(
                scene, step, integrator, step, 1e-12, None, "auto", stabilisation, None, None, (), False
            )
            self.system, self.step_size, method = problem.system, float(step), problem.method
            self.inputs, self.output_names = tuple(whole.inputs), tuple(whole.outputs)
            if not isinstance(method, FixedStep):
                raise SimulationError(f"integrator {integrator!r} chooses its steps; a Simulator has fixed ones: use 'rk4'.")
            n_u = len(self.inputs)
            if self.inputs:
                problem = problem._replace(held=HeldInputs(self.system, lambda t, q, v: np.zeros(n_u), 1.0, 0.0, 1.0))
            plan = plan_of(problem.question)
            if (plan.driver, plan.dynamics) not in STEPS:
                why = "; ".join(map(str, plan.rejected)) or "nothing in it can move"
                raise SimulationError(f"steps of {whole.name!r} are not compiled: {why}.")
            self._watch = StepWatch(self.system, problem.laws, problem.start, self.step_size, method)
            problem = problem._replace(switching=Switching())
            run: CompiledFixedRun | PairKernelSteps
            run = PairKernelSteps(problem) if plan.dynamics == "pair kernels" else fixed_run(problem, plan.dynamics)
            self._run = run
            self._loop: Any = run.prepared_steps()  # machine code, or steps that are called as it is
        self._start, self._layout = problem.start, run.layout
        self._point, self._confirmed = np.zeros(run.layout.size), np.zeros(run.layout.size)
        self._u, self._before = self._point[run.layout.size - n_u :], self._point.tobytes()
        self._values: Any = self._u.data
        self._rates = self._point[1 + run.layout.n_q :][: run.layout.n_v]
        self._out, self._ends = np.empty((0, run.layout.row)), StepEnds(self.step_size)
        run.control.every = steps_per_check(method.evaluations)
        self._begun, self._steps, self._options = 0.0, 0, (self.step_size, integrator, stabilisation)
        self._switches = bool(run.program.watch or run.program.watch.phases)
        self._measure: Callable[[np.ndarray], np.ndarray] | None = None
        self._bind()
        self.reset()

    def __reduce__(self):
        return _again, ((self.system, *self._options), self.snapshot())

    @property
    def program(self) -> Program:
        """Functions of the smooth system."""
        return self._run.program

    @property
    def warned_of(self) -> set[str]:
        """What was warned of laws of time."""
        return self._watch.warned_of

    def _bind(self):
        """Keep the addresses of the arrays of the loop."""
        self._given: tuple = self._run.arrays(self._point, self._confirmed, self._ends.grid, self._out)
        self._end: Any = self._ends.grid.data.cast("B").cast("d")  # the first number is the end of the first step

    def reset(self, state: State | None = None, *, seed: int | None = None, spread: float = 0.05) -> State:
        """Begin anew; inputs are zero until the next step.

        Parameters
        ----------
        state : State, optional
            Initial state, projected onto the constraints; that of the scene when not given.
        seed : int, optional
            Seed of a random change of that state: displacements and rates are uniform up to ``spread``.
        spread : float
            Largest random change of coordinates [rad, m] and of rates [rad/s, m/s].

        Returns
        -------
        State
            The initial state.

        Raises
        ------
        AssemblyError
            If the constraints cannot be met from there.
        StateError
            If the state does not fit the system, or a loop that cannot move has another pose than in the scene.
        """
        start, run = self._start, self._run
        if state is not None:
            require(state, (State,), "reset: state")
            start = self.system.projected(state)
        if seed is not None:
            change = random_changes(seed, spread, (2, self.system.n_v))
            start = State(start.t, retract(self.system, start.q, change[0]), start.v + change[1])
            start = run.separated(self.system.projected(within_limits(self.system, start)))
        refuse_other_pose(self.system, start.q)
        self._u[:] = 0.0
        run.inputs = self._u
        self._point[:] = run.begun(start)
        self._confirmed[:] = self._point
        self._begun, self._steps = float(self._point[0]), 0
        run.control.steps = run.control.status = run.control.unseen = 0.0
        self._watch.begin(self._begun)
        return self.state

    def step(self, u=None, n: int = 1):
        """Make steps under values of the inputs.

        Parameters
        ----------
        u : array_like, shape (n_u,), optional
            Values of the inputs [N m, N], cut off at their limits, in the order of ``inputs``; the last ones when not
            given.
        n : int
            Number of steps.

        Warns
        -----
        SwitchingWarning
            Once for each motion, if a law of the state may have switched undetected within a step; once for all motions, if
            a law of time jumps, and if it has a feature shorter than the step, in the next ten thousand steps.
        ContactLawWarning
            Once for each motion, if shapes may pass through each other unseen at the rates where a call begins or ends.

        Raises
        ------
        SimulationError
            If a value is not finite, a prescribed motion jumps, or a step fails; the message says why. After a failed step
            the state is one before it.
        """
        if type(n) is not int or not 0 < n <= maxsize:
            n = checked_count("n", n)
        if u is not None:
            self._set(u)
        self._before = self._point.tobytes()
        if n == 1:
            self._steps += 1
            self._end[0] = self._begun + self._steps * self.step_size
        else:
            self._plan_steps(n)
        try:
            if self._steps > self._watch.seen:
                if self._watch.has_pairs:
                    self._look_for_passing()
                self._watch.look_ahead(self.state, self._begun, self._steps)
            self._loop.call(*self._given, n)
        except BaseException:  # Ctrl-C, or of an opaque law
            self._steps, self._point[:] = self._steps - n, np.frombuffer(self._before)
            raise
        if self._run.control.status:
            self._recover(n)
        if self._switches and self._run.control.unseen:
            self._run.control.unseen = 0.0
            self._watch.switched(self.t)
        if self._watch.has_pairs:
            self._look_for_passing()

    def _look_for_passing(self):
        self._watch.look(self._rates, self._steps, lambda: self.state, self._run.fastest)

    def _set(self, u):
        given = u if type(u) is np.ndarray and u.dtype is FLOAT else real_numbers(u)
        if given is None or given.shape != self._u.shape or not isfinite(sum(given.tolist())):
            given = checked_inputs(u, self.inputs, self.t)
        try:
            self._values[:] = given
        except ValueError:  # where doubles do not begin
            self._u[:] = given
        if isinstance(self._run, CompiledFixedRun) and self._run.method.starts_from_accelerations:
            # its method state holds the accelerations under the inputs before
            point = self._layout.point(self._point)
            rates = self._run.evaluated(point.state)
            self._point[:] = self._layout.pack(replace(point, rates=rates, method_state=rates.acceleration), self._u.copy())

    def _plan_steps(self, n: int):
        """Write the ends of steps."""
        if n > len(self._ends.grid):
            self._ends.make_room(n)
            self._bind()
        self._ends.write(self._begun, self._steps + 1, n)
        self._steps += n

    def _recover(self, n: int):
        """Repeat steps of contacts in Python; raise a SimulationError where a step has failed."""
        control, ends, before = self._run.control, self._ends.times[:n].copy(), self._steps - n
        while control.status:
            status, control.status = LoopStatus(int(control.status)), 0.0
            reached = int(np.searchsorted(ends, self._point[0], side="right"))
            self._steps = before + reached
            if status != LoopStatus.UNSOLVED or not isinstance(self._run, CompiledMoreauRun | PairKernelSteps):
                self._refuse(before, FAILURES.get(status, status.name))
            self._point[:] = self._run.repeated(self._point, float(ends[reached]))
            if not np.isfinite(self._point[: self._layout.row]).all():
                self._refuse(before, FAILURES[LoopStatus.NOT_FINITE])
            rest = ends[reached + 1 :]
            self._steps, self._ends.times[: rest.size] = before + n, rest
            if rest.size:
                self._loop.call(*self._given, rest.size)

    def _refuse(self, steps: int, why: str) -> NoReturn:
        """Return to the state before the call, after so many steps, and raise a SimulationError."""
        t, self._point[:], self._steps = self.t, np.frombuffer(self._before), steps
        raise SimulationError(f"t = {t:.6g} s: {why}; shorten the step.")

    @property
    def t(self) -> float:
        """Time [s]."""
        return float(self._point[0])

    @property
    def coordinates(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n_q,) and rates (n_v,), copies."""
        begin, end = 1 + self._layout.n_q, 1 + self._layout.n_q + self._layout.n_v
        return self._point[1:begin].copy(), self._point[begin:end].copy()

    @property
    def state(self) -> State:
        """State, a copy."""
        return State(float(self._point[0]), *self.coordinates)

    @property
    def work(self) -> np.ndarray:
        """Work (3,) of drives and of forces on bodies, energy lost in dampers, since the start [J]."""
        return self._point[self._layout.row - 3 : self._layout.row].copy()

    @property
    def outputs(self) -> dict[str, np.ndarray]:
        """Values of the outputs of the scene; accelerations of contacts are means over the last step."""
        outputs, found = self.system.scene.outputs, split(self.output_vector(), self.system.scene)
        return {name: values.reshape(shape_of(outputs[name], self.system)) for name, values in found.items()}

    def output_vector(self) -> np.ndarray:
        """Values (m,) of all outputs in a row."""
        if self._measure is None:
            # mean accelerations over a step of contacts, those of impacts included
            self._measure = output_kernel(self._run.program, self.system, self._run.method.nonsmooth, batch=False)
        return self._measure(self._point)

    def snapshot(self) -> SimulatorState:
        """Present state of the simulator, to the last bit; of the same scene and step, any simulator can restore it."""
        point, run = self._point.tobytes(), self._run
        control, kept, watched = bytes(run.control), run.kept(), self._watch.kept()
        return SimulatorState(point, control, self._begun, self._steps, kept, self._options, watched)

    def restore(self, snapshot: SimulatorState):
        """Continue from a snapshot.

        Raises
        ------
        SimulationError
            If it is of another system, step or method.
        """
        require(snapshot, (SimulatorState,), "restore")
        point = np.frombuffer(snapshot.point)
        if point.shape != self._point.shape or snapshot.of not in ((), self._options):
            raise SimulationError("restore: the snapshot is of another system, step or method.")
        self._point[:] = point
        ctypes.memmove(ctypes.byref(self._run.control), snapshot.control, len(snapshot.control))
        self._begun, self._steps = snapshot.begun, snapshot.steps
        self._watch.go_on(self._begun, snapshot.watched)
        self._run.take(snapshot.contacts)


def _again(given: tuple, snapshot: SimulatorState) -> Simulator:
    """Simulator of the same arguments in the same state, in another process."""
    simulator = Simulator(*given)
    simulator.restore(snapshot)
    return simulator
