"""Result of a simulation: times, coordinates q, rates v, work, poses of the bodies, statistics, events."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from importlib import import_module
from pathlib import Path

import numpy as np

from gauss import rotations
from gauss.arguments import real_numbers
from gauss.codegen import content_key, trace
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.outputs import FORCES, OF_JOINTS, joint_forces, shape_of
from gauss.dynamics.rules import Plan
from gauss.dynamics.sensor_values import INERTIAL, measured
from gauss.dynamics.state_functions import distance_of_loops
from gauss.errors import RecordedMotionWarning, StateError, did_you_mean, require
from gauss.shapes import Shaped
from gauss.simulation.held_inputs import numbers_in_words
from gauss.simulation.motion_records import EnergyRecord, Event, Stats
from gauss.system import State, System

LOOKED_AT = 20  # samples of a recorded motion whose loops are looked at: noise is in all of them
RECORDED_RESIDUAL = 1e-6  # of loop constraints, relative to their scales: above that of any integrator
LEAST_COMPILED_SAMPLES = 300  # samples above which machine code is compiled: numpy takes about as long for so many


@dataclass(frozen=True)
class BodyMotion:
    """Motion of a body or named frame, in world axes.

    Parameters
    ----------
    position : ndarray, shape (k, 3)
        Origin of the frame [m].
    rotation : ndarray, shape (k, 3, 3)
        Rotation from the frame to world.
    com : ndarray, shape (k, 3)
        Centre of mass of the body [m].
    velocity : ndarray, shape (k, 3)
        Velocity of the origin of the frame [m/s].
    angular_velocity : ndarray, shape (k, 3)
        Angular velocity [rad/s].
    """

    position: np.ndarray
    rotation: np.ndarray
    com: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


@dataclass(frozen=True)
class Trajectory:
    """Motion of a system.

    Parameters
    ----------
    system : System
        The system.
    t : ndarray, shape (k,)
        Times [s].
    q : ndarray, shape (k, n_q)
        Coordinates.
    v : ndarray, shape (k, n_v)
        Rates, in the order of ``system.coordinates`` [rad/s, m/s]; ω of a ball or free joint is in the axes of the joint
        frame on the child, not of the body's own frame, see :meth:`gauss.Scene.ball`.
    work : ndarray, shape (k, 3)
        Work of drives and of forces on bodies, energy lost in dampers, since the start [J]. Once poses or forces of the
        motion were asked for, these arrays are read-only.
    stats : Stats
        Statistics.
    events : tuple of Event
        Impacts and changes of the contact mode, by time stepping at the ends of its steps. Where every step is returned, an
        impact that is located has two samples of one time, before and after it; a jump of a prescribed velocity has samples
        a few units in the last place before and after it.
    step : float, optional
        Step of time stepping [s].
    settings : dict
        Arguments of the simulation by name.
    energies : EnergyRecord, optional
        Energies recorded by the compiled loop, of motions that it computed from start to end.
    removal : float
        Time in which steps chosen by error control remove penetration [s]; zero: within a step.
    """

    system: System
    t: Shaped[np.ndarray, " k"]
    q: Shaped[np.ndarray, "k nq"]
    v: Shaped[np.ndarray, "k nv"]
    work: Shaped[np.ndarray, "k 3"]
    stats: Stats
    events: tuple[Event, ...] = ()
    step: float | None = None
    settings: dict = field(default_factory=dict, repr=False)
    energies: EnergyRecord | None = field(default=None, repr=False, compare=False)
    removal: float = field(default=0.0, repr=False)

    @classmethod
    def from_coordinates(cls, system: System, t, q, v=None) -> "Trajectory":
        """Recorded motion: of coordinates at given times, for reactions, drive forces, poses and films.

        Parameters
        ----------
        system : System
            The system.
        t : array_like, shape (k,)
            Times, increasing [s].
        q : array_like, shape (k, n_q)
            Coordinates; a quaternion may change its sign from sample to sample.
        v : array_like, shape (k, n_v), optional
            Rates; those of a cubic spline through the coordinates when not given.

        Returns
        -------
        Trajectory
            Its work is unknown (NaN), its method is "recorded".

        Raises
        ------
        StateError
            If sizes do not fit, numbers are not finite, times do not increase, or a quaternion is not unit.

        Warns
        -----
        RecordedMotionWarning
            If coordinates do not meet the loop constraints at one of some samples.
        """
        require(system, (System,), "from_coordinates")
        times, samples = _recorded_samples(system, t, q)
        states = [system.state(here) for here in samples]
        samples = np.array([state.q for state in states])
        rates = spline_rates(system, times, samples) if v is None else real_numbers(v)
        if rates is None or rates.shape != (len(times), system.n_v) or not np.isfinite(rates).all():
            raise StateError(
                f"from_coordinates: expected finite rates v ({len(times)}, {system.n_v}), got {numbers_in_words(rates)}."
            )
        _warn_of_loops(system, times, samples)
        work = np.full((len(times), 3), np.nan)
        return cls(system, times, samples, rates, work, Stats(0, 0, 0, 0, 0.0, np.nan, "recorded"))

    def __len__(self):
        return len(self.t)

    def __repr__(self):
        span = f"{self.t[0]:.6g} … {self.t[-1]:.6g} s" if len(self) else "empty"
        return f"Trajectory({self.system.scene.name!r}, {len(self)} samples, {span})"

    def __str__(self):
        from gauss.simulation.energy_balance import balance_in_words  # which is about trajectories

        return f"{self!r}\n{self.stats!r}\n{balance_in_words(self)}"

    def _repr_html_(self) -> str:
        from gauss.simulation.notebook import html_table  # notebooks alone need it

        return html_table(self.system, self.t, self.q, repr(self))

    def plot(self, *others: "Trajectory", path=None):
        """Figure of this motion alone, or compared with others.

        See :func:`gauss.view.plot_motion` and :func:`gauss.view.plot_comparison`.

        Parameters
        ----------
        *others : Trajectory
            Motions that it is compared with: coordinates, and their differences from this motion.
        path : str or Path, optional
            Where to save it: .png, .svg or .pdf.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        MissingPackageError
            If matplotlib is not installed.
        """
        view = import_module("gauss.view")
        if others and isinstance(others[0], str | Path):  # motion.plot("figure.png"), as before
            others, path = others[1:], others[0]
        return view.plot_comparison([self, *others], path=path) if others else view.plot_motion(self, path)

    def recorded(self, system: System, settings: dict, plan: Plan) -> "Trajectory":
        """Trajectory with the arguments of the simulation and its plan, of a system."""
        made = object.__new__(Trajectory)  # a fifth of the time of dataclasses.replace
        fields = {name: value for name, value in vars(self).items() if name in Trajectory.__dataclass_fields__}
        made.__dict__.update(fields, system=system, settings=settings, stats=self.stats._replace(plan=plan))
        return made

    def state(self, index: int) -> State:
        """State of one sample; the last one is -1.

        Raises
        ------
        StateError
            If there is no such sample.
        """
        if not is_index(index, len(self)):
            raise StateError(f"state: expected the index of a sample, from {-len(self)} to {len(self) - 1}, got {index!r}.")
        return State(float(self.t[index]), self.q[index], self.v[index])

    @cached_property
    def motions(self) -> list[Kinematics]:
        """Poses and velocities at every sample; from then on the samples are read-only."""
        self.hold_samples()
        return [kinematics(self.system, self.state(i)) for i in range(len(self))]

    def hold_samples(self):
        """Make the samples read-only: an answer about them is kept, which a change in place would make another motion's."""
        for samples in (self.t, self.q, self.v, self.work):
            samples.flags.writeable = False

    def body(self, name: str) -> BodyMotion:
        """Motion of a body, or of a named frame on a body.

        Raises
        ------
        StateError
            If there is no such body or frame.
        """
        index = self.system.frame(name).body
        if index < 0:
            raise StateError(f"{name!r} is fixed to the ground; only bodies and frames on them move.")

        def frame(motion: Kinematics):
            parts = motion.position(name), motion.rotation(name), motion.x[index], motion.velocity(name), motion.W[index]
            return np.concatenate([np.ravel(part) for part in parts])

        found = self.sampled(f"frame {name}", frame)
        position, rotation, com, velocity, angular_velocity = np.split(found, [3, 12, 15, 18], axis=1)
        return BodyMotion(position, rotation.reshape(-1, 3, 3), com, velocity, angular_velocity)

    def poses(self) -> tuple[Shaped[np.ndarray, "k n 3"], Shaped[np.ndarray, "k n 3 3"]]:
        """Positions [m] of the frames of all bodies, and rotations from them to world, at every sample."""
        bodies = self.system.structure.bodies

        def frames(motion: Kinematics):
            return np.concatenate([np.ravel(part(name)) for name in bodies for part in (motion.position, motion.rotation)])

        found = self.sampled("poses", frames).reshape(len(self), len(bodies), 12)
        return found[:, :, :3], found[:, :, 3:].reshape(len(self), len(bodies), 3, 3)

    def sampled(self, name: str, function: Callable[[Kinematics], np.ndarray]) -> np.ndarray:
        """Values (k, m) of a function of the motion at every sample; of many samples, by machine code.

        Parameters
        ----------
        name : str
            Name of the function, for its machine code.
        function : callable
            Takes a :class:`Kinematics`, returns a vector of numbers, or of expressions if it is traced.
        """
        if len(self) < LEAST_COMPILED_SAMPLES:
            return np.array([function(motion) for motion in self.motions], dtype=float)
        system = self.system

        def traced(t, q, v):
            return function(kinematics(system, State(t[0], q, v)))

        kernel = system.mechanics.on_demand(
            (trace, name, content_key(function)), lambda: trace(traced, 1, system.n_q, system.n_v)
        )
        return kernel(np.concatenate([self.t[None], self.q.T, self.v.T])).T

    def __getstate__(self) -> dict:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # without cached poses

    def output(self, name: str) -> np.ndarray:
        """Values of an output of the scene at every sample, (k,), (k, n), or (k, 3, 3) of a rotation.

        Raises
        ------
        StateError
            If the scene has no such output.
        """
        outputs = self.system.scene.outputs
        if not isinstance(name, str) or name not in outputs:
            raise StateError(f"no output {name!r}. {did_you_mean(name, outputs)}")
        output = outputs[name]
        if output.kind in FORCES:
            if output.kind not in OF_JOINTS:
                raise StateError(f"output {name!r}: forces along a motion come from gauss.contact_forces.")
            found = joint_forces(output, self.system, self.t, self.q, self.v)
        elif output.kind in INERTIAL:
            rates = [self.system.accelerations(self.state(k)) for k in range(len(self))]
            found = np.array([measured(output, *pair) for pair in zip(self.motions, rates, strict=True)])
        else:
            found = self.sampled(f"output {name}", lambda motion: measured(output, motion))
        return found.reshape(len(self), *shape_of(output, self.system))

    def coordinate(self, joint: str) -> np.ndarray:
        """Coordinates (k,) or (k, n) of a joint [rad, m]."""
        return self._of(self.q[:, self.system.joint(joint).q])

    def rate(self, joint: str) -> np.ndarray:
        """Rates (k,) or (k, n) of a joint [rad/s, m/s]."""
        return self._of(self.v[:, self.system.joint(joint).v])

    @staticmethod
    def _of(columns: np.ndarray) -> np.ndarray:
        return columns[:, 0] if columns.shape[1] == 1 else columns


def is_index(value, count: int) -> bool:
    """Whether a value is the index of one of several things, from the last one where it is negative; no truth value is."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(-count <= value < count)


def spline_rates(system: System, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rates (k, n_v) of a cubic spline through coordinates (k, n_q); of a quaternion ω = 2 Q̄ ∘ Q̇, of either sign."""
    from scipy.interpolate import make_interp_spline  # a slow import

    smooth = q.copy()
    for place in system.quaternions.values():
        turns = np.sign(np.einsum("ki,ki->k", smooth[1:, place], smooth[:-1, place]))
        smooth[1:, place] *= np.cumprod(turns)[:, None]
    slopes = make_interp_spline(t, smooth, k=min(3, len(t) - 1))(t, nu=1)
    rates = np.zeros((len(t), system.n_v))
    for joint in system.joints:
        plain = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
        rates[:, joint.v.start : joint.v.start + plain] = slopes[:, joint.q.start : joint.q.start + plain]
        if joint.pair.quaternion is not None:
            place = slice(joint.q.start + plain, joint.q.stop)
            pairs = zip(smooth[:, place], slopes[:, place], strict=True)
            turning = [2.0 * rotations.multiply(rotations.conjugate(Q), rate)[1:] for Q, rate in pairs]
            rates[:, joint.v.start + plain : joint.v.stop] = turning
    return rates


def _recorded_samples(system: System, t, q) -> tuple[np.ndarray, np.ndarray]:
    """Times (k,) and coordinates (k, n_q) of the user, checked but for their size and units.

    StateError if they are no numbers, do not fit, or times do not increase.
    """
    times, samples = real_numbers(t), real_numbers(q)
    if times is None or samples is None:
        raise StateError(f"from_coordinates: expected numbers t (k,) and q (k, {system.n_q}), got others.")
    if samples.shape != (times.size, system.n_q) or times.ndim != 1 or len(times) < 2:
        raise StateError(
            f"from_coordinates: expected at least two times t (k,) and coordinates q (k, {system.n_q}), got shapes "
            f"{times.shape} and {samples.shape}."
        )
    late = np.flatnonzero(~(np.diff(times) > 0) | ~np.isfinite(np.diff(times)))
    if late.size:
        raise StateError(
            f"from_coordinates: expected finite, increasing times, got t[{late[0]}] = {times[late[0]]}, "
            f"t[{late[0] + 1}] = {times[late[0] + 1]}."
        )
    return times, samples


def _warn_of_loops(system: System, times: np.ndarray, samples: np.ndarray):
    """Warn of the worst of some samples of a recorded motion, if it does not meet the loop constraints."""
    if not system.has_closures:
        return
    places = np.unique(np.linspace(0, len(times) - 1, LOOKED_AT).astype(int))
    off = {k: distance_of_loops(system, State(times[k], samples[k], np.zeros(system.n_v))) for k in map(int, places)}
    worst = max(off, key=lambda k: off[k])
    if not off[worst] <= RECORDED_RESIDUAL:
        words = f"recorded motion of {system.scene.name!r} does not meet its loop constraints: at t = {times[worst]:g} s "
        words += f"by {off[worst]:.2g} of their scales. Its forces are wrong; system.projected makes states that meet them."
        warnings.warn(words, RecordedMotionWarning, stacklevel=3)
