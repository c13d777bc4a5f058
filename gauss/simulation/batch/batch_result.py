"""Result of a batch of motions: samples of all, single ones as trajectories, outputs of the scene."""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gauss.dynamics.conditions import smooth_system
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.load_receiver import output_kernel
from gauss.dynamics.outputs import FORCES, shape_of, split
from gauss.dynamics.programs import CalledProgram
from gauss.dynamics.sensor_values import INERTIAL
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError, StateError, did_you_mean
from gauss.integrators import FixedStep
from gauss.shapes import Shaped
from gauss.simulation.batch.fixed_step_batch import FixedStepBatch
from gauss.simulation.batch.machine_code import fixed_step_code
from gauss.simulation.held_inputs import RecordedInput, driven_as
from gauss.simulation.integrators import INTEGRATORS
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING
from gauss.simulation.motion_records import Stats
from gauss.simulation.trajectory import Trajectory, is_index
from gauss.system import System

METHOD = "compiled batch, checked by inverse dynamics"


@dataclass(frozen=True)
class Rollout:
    """Motions of a batch.

    Parameters
    ----------
    system : System
        The system.
    t : ndarray, shape (k,)
        Times [s].
    q : ndarray, shape (batch, k, n_q)
        Coordinates.
    v : ndarray, shape (batch, k, n_v)
        Rates.
    repeated : tuple of int
        Motions repeated by :func:`gauss.simulate`, because a check of the compiled steps failed, or prescribed velocities
        jump.
    steps, rejected : ndarray, shape (batch,)
        Accepted and rejected steps of each motion.
    diverged : tuple of int
        Motions that diverged or cannot continue: some of their samples are not finite.
    control : ndarray, shape (batch, rows, n_u), optional
        Inputs of each motion, each row held for an equal share of the steps.
    work : ndarray, shape (batch, k, 3), optional
        Work of drives and of forces on bodies, energy lost in dampers, since the start [J]; of adaptive methods.
    errors : ndarray, shape (batch,), optional
        Largest relative error of the accelerations of each motion.
    settings : dict
        Arguments of the simulation by name.
    reasons : dict of int to str
        Why motions of ``diverged`` cannot continue.
    again : dict of int to Trajectory
        The repeated motions, those of ``diverged`` up to where they cannot continue.
    """

    system: System = field(repr=False)  # as long as a scene
    t: Shaped[np.ndarray, " k"]
    q: Shaped[np.ndarray, "batch k nq"]
    v: Shaped[np.ndarray, "batch k nv"]
    repeated: tuple[int, ...]
    steps: Shaped[np.ndarray, " batch"]
    rejected: Shaped[np.ndarray, " batch"]
    diverged: tuple[int, ...] = ()
    control: Shaped[np.ndarray, "batch rows nu"] | None = None
    work: Shaped[np.ndarray, "batch k 3"] | None = field(default=None, repr=False)
    errors: np.ndarray | None = field(default=None, repr=False, compare=False)
    settings: dict = field(default_factory=dict, repr=False)
    reasons: dict[int, str] = field(default_factory=dict, repr=False, compare=False)
    again: dict[int, Trajectory] = field(default_factory=dict, repr=False, compare=False)

    def __len__(self):
        return len(self.q)

    def trajectory(self, index: int) -> Trajectory:
        """Motion of one start, for reactions, films and files; one that diverged ends at its last finite sample.

        Parameters
        ----------
        index : int
            Number of the motion; the last one is -1.

        Raises
        ------
        StateError
            If there is no such motion.
        """
        if not is_index(index, len(self)):
            raise StateError(f"trajectory: expected the number of a motion, below {len(self)}, got {index!r}.")
        k = int(index) % len(self)
        if k in self.again:
            return self.again[k]
        finite = np.isfinite(self.q[k]).all(axis=1) & np.isfinite(self.v[k]).all(axis=1)
        rows = len(self.t) if finite.all() else int(np.argmin(finite))
        steps, rejected = int(self.steps[k]), int(self.rejected[k])
        error = np.nan if self.errors is None else float(self.errors[k])
        stats = Stats(self.settings.get("evaluations", 1) * (steps + rejected), steps, rejected, 0, 0.0, error, METHOD)
        step = self.settings["step"] if self.settings.get("integrator") == TIME_STEPPING.name else None
        t, q, v, work = (part[:rows].copy() for part in (self.t, self.q[k], self.v[k], self._work_of(k)))
        return Trajectory(self._driven(k), t, q, v, work, stats, step=step, settings=dict(self.settings))

    def _work_of(self, k: int) -> np.ndarray:
        """Work (k, 3) of one motion; that of fixed steps by the same steps again."""
        if self.work is not None:
            return self.work[k]
        method = INTEGRATORS[self.settings["integrator"]]
        assert isinstance(method, FixedStep)
        control = None if self.control is None else self.control[k : k + 1]
        start = np.concatenate([self.q[k, 0], self.v[k, 0]])[:, None]
        batch = FixedStepBatch(fixed_step_code(self.system, method, control is not None), start)
        steps, h, keep = (self.settings[name] for name in ("steps", "step", "every"))
        return batch.run(steps, h, keep, 1, control, with_work=True)[0, :, -3:]

    def _driven(self, k: int) -> System:
        """System with drives by the inputs of one motion."""
        if self.control is None:
            return self.system
        times = np.linspace(self.t[0], self.settings["duration"], self.control.shape[1], endpoint=False)
        laws: dict[str, Callable] = {
            name: RecordedInput(times, self.control[k, :, i]) for i, name in enumerate(self.system.scene.inputs)
        }
        return driven_as(self.system, laws)

    def output(self, name: str) -> np.ndarray:
        """Values of an output of the scene at every sample of all motions, (batch, k, …).

        Accelerations are those under the inputs of the step that ends at the sample; of the first sample, of the first one.

        Raises
        ------
        StateError
            If the scene has no such output.
        SimulationError
            If it depends on the accelerations of a motion with contacts or friction, which are means over steps.
        """
        outputs = self.system.scene.outputs
        if not isinstance(name, str) or name not in outputs:
            raise StateError(f"no output {name!r}. {did_you_mean(name, outputs)}")
        output = outputs[name]
        if output.kind in (*INERTIAL, *FORCES) and self.system.nonsmooth:
            raise SimulationError(f"output {name!r}: with contacts, means over steps; use gauss.SimulatorBatch.")
        return split(self._measured, self.system.scene)[name].reshape(*self.q.shape[:2], *shape_of(output, self.system))

    @cached_property
    def _measured(self) -> np.ndarray:
        """Values (batch, k, m) of all outputs, in SIMD code."""
        held, system = self.control is not None, smooth_system(self.system) if self.system.nonsmooth else self.system
        laws = Laws(system)
        program = (CalledProgram if laws.called else Program)(system, laws, inputs=held)
        measure = output_kernel(program, self.system, bool(self.system.nonsmooth), batch=True)
        (batch, samples, _), layout = self.q.shape, program.layout
        points = np.zeros((layout.size, batch, samples))
        points[0] = self.t
        points[1 : layout.row - 3] = np.moveaxis(np.concatenate([self.q, self.v], axis=2), 2, 0)
        if self.control is not None:
            hold, every = self.settings["steps"] // self.control.shape[1], self.settings["every"]
            rows = np.maximum(every * np.arange(samples) - 1, 0) // hold
            points[layout.size - len(program.inputs) :] = np.moveaxis(self.control[:, rows], 2, 0)
        return measure(points.reshape(layout.size, -1)).T.reshape(batch, samples, -1)

    def __getstate__(self) -> dict:
        return {name: value for name, value in vars(self).items() if name != "_measured"}


@contextmanager
def kept_on_interruption(make: Callable[..., Rollout]):
    """Attach a rollout to a KeyboardInterrupt, for a ``with`` statement: of its ``samples`` (batch, k, n_q + n_v …), if any.

    ``make``: (samples, fields) → rollout.
    """
    try:
        yield
    except KeyboardInterrupt as error:  # stays a KeyboardInterrupt: no handler of errors may swallow it
        samples, again = vars(error).pop("samples", None), vars(error).pop("again", {})
        vars(error).pop("trajectory", None)  # of one motion
        error.rollout = None if samples is None else _interrupted(make, samples, again)  # type: ignore[attr-defined]
        raise


def _interrupted(make: Callable[..., Rollout], samples: np.ndarray, again: dict[int, Trajectory]) -> Rollout:
    """Rollout up to an interruption."""
    missing = tuple(map(int, np.flatnonzero(~np.isfinite(samples).all(axis=(1, 2)))))
    counts = np.zeros((2, len(samples)), dtype=int)
    marks = {"repeated": (), "diverged": missing, "reasons": dict.fromkeys(missing, "interrupted"), "again": again}
    return make(samples, steps=counts[0], rejected=counts[1], **marks)
