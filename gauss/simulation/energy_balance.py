"""Energy-balance check of every motion: T + V − work + dissipated = const, within a thousandth of the largest energy.

Compiled loops record the energies along the motion (:mod:`gauss.codegen.kernels.energy_record`); of other motions the start
and a few samples are evaluated. Rounding is allowed for.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.codegen import trace
from gauss.codegen.kernels import recorded_energies
from gauss.dynamics.energies import look_at_energies
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.store import cached_on_disk
from gauss.errors import BalanceWarning, require, user_level
from gauss.simulation.advice import advice
from gauss.simulation.motion_records import EnergyRecord
from gauss.simulation.trajectory import LEAST_COMPILED_SAMPLES, Trajectory
from gauss.system import State, System, coordinate_units, rate_units

WRONG = 1e-3  # residual relative to the largest energy above which a motion is taken to be wrong
FIRST_ORDER = 0.05  # the same of time stepping, whose error is proportional to the step at impacts
RESTING = 1e-12  # of the energy scale of the scene: less counts as rest
ROUNDING_SHARE = 1e-9  # rounding, relative to the magnitude of the potential energy, to the work, and to positions
FEW_SAMPLES, MORE_SAMPLES = 5, 60  # evaluated at first, and where these fail: few may miss the largest energy
TIME_STEPPING = "time_stepping"  # name of the integrator of order 1
SHOWN = 8  # failing motions of a batch that a warning names


class Imbalance(NamedTuple):
    """Residual of the energy balance of a motion."""

    off: float  # off, scale: largest residual, and the energy that it is compared with [J]
    scale: float
    when: float  # end of the interval of its largest change [s]
    allowed: float = WRONG  # tolerance, relative to the scale

    @property
    def is_wrong(self) -> bool:
        """Whether it exceeds the tolerance, or is NaN."""
        return not self.off <= self.allowed * self.scale

    @property
    def share(self) -> float:
        """Residual relative to the scale."""
        return self.off / self.scale if self.off else 0.0

    def __str__(self):
        of = f", {100.0 * self.share:.3g} % of the largest energy {self.scale:.3g} J" if self.scale else ""
        return f"the energy balance is off by {self.off:.3g} J{of}, and changed most before t = {self.when:.6g} s"


_COLLECTED: ContextVar[list | None] = ContextVar("collected", default=None)


@contextmanager
def imbalances() -> Iterator[list[Imbalance]]:
    """Collect the imbalances of all motions within a ``with`` statement; the caller does the warning."""
    found: list[Imbalance] = []
    token = _COLLECTED.set(found)
    try:
        yield found
    finally:
        _COLLECTED.reset(token)


def watch_balance(trajectory: Trajectory, start: State):
    """Check the energy balance of a simulated motion from its initial state, whether or not among the samples.

    BalanceWarning with the residual, its time, and advice.
    """
    record, collected = trajectory.energies or energy_record(_some(trajectory, start, FEW_SAMPLES)), _COLLECTED.get()
    if collected is None and record.off <= WRONG * record.kinetic:  # the usual case, quickly
        return
    found = _imbalance(record, WRONG if trajectory.step is None else FIRST_ORDER)
    if found.is_wrong:
        found = _imbalance_by_samples(trajectory, start, record)
    if collected is not None:
        collected.append(found)
    elif found.is_wrong:
        _warn(trajectory, found)


def warn_of_balance(trajectory: Trajectory):
    """Check the energy balance of a motion at all of its samples.

    Parameters
    ----------
    trajectory : Trajectory
        Motion.

    Warns
    -----
    BalanceWarning
        With the residual, its time, and advice.

    Raises
    ------
    ArgumentError
        If it is no trajectory.
    """
    require(trajectory, (Trajectory,), "warn_of_balance")
    if not len(trajectory):
        return
    start = trajectory.state(0)
    found = _imbalance_by_samples(trajectory, start, energy_record(trajectory))
    if found.is_wrong:
        _warn(trajectory, found)


def balance_in_words(trajectory: Trajectory) -> str:
    """Residual of the energy balance of a motion, as its loop recorded it or by a few samples, in one line."""
    if not len(trajectory):
        return "energy balance: no samples"
    record = trajectory.energies or energy_record(_some(trajectory, trajectory.state(0), FEW_SAMPLES))
    if np.isnan(record.off):
        return "energy balance: unknown"
    return f"energy balance: off by {record.off:.3g} J, largest energy {record.scale:.3g} J"


def shares(system: System, energies: EnergyRecord, starts: np.ndarray, samples: np.ndarray, duration: float) -> np.ndarray:
    """Imbalance (batch,) of a batch of motions relative to their largest energies; zero at rest.

    Initial states are (n_q + n_v, batch), samples (batch, k, n_q + n_v); the system may be the first of several that differ
    in numbers only.
    """
    scale = np.maximum(
        energies.scale, (ROUNDING_SHARE / WRONG) * np.maximum(energies.magnitude, RESTING * system.scale.energy)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(energies.off == 0.0, 0.0, energies.off / scale)
    wrong = np.flatnonzero(~(share <= WRONG))
    rests = _rests(system, starts.T[wrong, None], samples[wrong], duration) if wrong.size else wrong
    share[wrong] = np.where(rests, 0.0, share[wrong])
    return share


def warn_of_many(system: System, share: np.ndarray, name: Callable[[int], str], settings: dict):
    """Warn of the motions of a batch whose imbalances (batch,) by :func:`shares` exceed the tolerance; the worst are named.

    BalanceWarning with their names by their indices, their imbalance, and advice by the settings.
    """
    stepped = settings["integrator"] == TIME_STEPPING
    wrong = np.flatnonzero(share > (FIRST_ORDER if stepped else WRONG))  # NaN: it failed
    if not wrong.size:
        return
    worst = wrong[np.argsort(-share[wrong], kind="stable")][:SHOWN]
    words = ", ".join(f"{name(int(k))} by {100.0 * share[k]:.3g} %" for k in worst)
    more = f" and {wrong.size - worst.size} others" if wrong.size > worst.size else ""
    warnings.warn(
        f"scene {system.scene.name!r}, integrator {settings['integrator']!r}: the energy balance of {wrong.size} of "
        f"{share.size} motions is off: {words}{more}, of their largest energy; {advice(system, settings, stepped=stepped)}.",
        BalanceWarning,
        stacklevel=user_level(),
    )


def _warn(trajectory: Trajectory, found: Imbalance):
    system, settings = trajectory.system, trajectory.settings
    by = f", integrator {settings['integrator']!r}" if "integrator" in settings else ""
    what = advice(system, settings, trajectory.events, trajectory.step is not None)
    warnings.warn(f"scene {system.scene.name!r}{by}: {found}; {what}.", BalanceWarning, stacklevel=user_level())


def _imbalance(record: EnergyRecord, allowed: float, magnitude: float = 0.0) -> Imbalance:
    """Imbalance of a record; the scale allows for rounding."""
    floor = (ROUNDING_SHARE / allowed) * max(record.magnitude, magnitude)
    return Imbalance(record.off, max(record.kinetic, record.highest - record.lowest, floor), record.when, allowed)


def _imbalance_by_samples(trajectory: Trajectory, start: State, record: EnergyRecord) -> Imbalance:
    """Imbalance by more samples; zero for a system at rest."""
    some = _some(trajectory, start, MORE_SAMPLES)
    again = energy_record(some)
    clear = again if record.off < again.off else record  # NaN stays
    whole = clear._replace(
        kinetic=max(record.kinetic, again.kinetic),
        lowest=min(record.lowest, again.lowest),
        highest=max(record.highest, again.highest),
        magnitude=max(record.magnitude, again.magnitude),
    )
    allowed = WRONG if trajectory.step is None else FIRST_ORDER
    least = RESTING * trajectory.system.scale.energy
    found = _imbalance(whole, allowed, np.abs(trajectory.work).max(initial=least))
    if found.is_wrong:
        begin, states = np.concatenate([start.q, start.v]), np.concatenate([some.q, some.v], axis=1)
        if _rests(trajectory.system, begin, states, some.t[-1] - start.t):
            return found._replace(off=0.0)
    return found


def _some(trajectory: Trajectory, start: State, count: int) -> Trajectory:
    """Start, and ``count`` samples spread over the motion."""
    places = np.linspace(0, max(len(trajectory) - 1, 0), count).round().astype(int)
    rows = sorted(set(places.tolist()))[: len(trajectory)]
    columns = {name: getattr(trajectory, name)[rows] for name in ("t", "q", "v", "work")}
    if not len(rows) or columns["t"][0] != start.t:
        first = {"t": start.t, "q": start.q, "v": start.v, "work": np.zeros(trajectory.work.shape[1])}
        columns = {name: np.concatenate([[first[name]], column]) for name, column in columns.items()}
    return replace(trajectory, **columns, energies=None)


def energy_record(trajectory: Trajectory) -> EnergyRecord:
    """Energies of all samples."""
    energies = _energies(trajectory)
    return EnergyRecord(*map(float, recorded_energies(trajectory.t, energies)))


def _energies(trajectory: Trajectory) -> np.ndarray:
    """Energies (k, 4) at all samples; compiled above the threshold of evaluations."""
    system, work = trajectory.system, trajectory.work[:, :3]
    if system.dynamics is not None:
        seen = system.dynamics.on_demand((_energies,), lambda: [0])
        seen[0] += len(trajectory)
        if seen[0] >= LEAST_COMPILED_SAMPLES:
            kernel = cached_on_disk(system, (_kernel,), lambda: _kernel(system))
            return kernel(np.concatenate([trajectory.t[None], trajectory.q.T, trajectory.v.T, work.T])).T
    states = (trajectory.state(k) for k in range(len(trajectory)))
    return np.array([look_at_energies(kinematics(system, s), own) for s, own in zip(states, work, strict=True)])


def _kernel(system: System):
    def energies(t, q, v, work):
        return look_at_energies(kinematics(system, State(t[0], q, v)), work)

    return trace(energies, 1, system.n_q, system.n_v, 3, batch=False)


def _rests(system: System, begin: np.ndarray, states: np.ndarray, duration: float):
    """Whether samples (…, k, n_q + n_v) of motions equal their initial states (…, n_q + n_v) to rounding."""
    motion = kinematics(system, State(0.0, *np.split(np.ravel(begin)[: system.n_q + system.n_v], [system.n_q])))
    places, Phi = np.reshape(motion.x[: system.structure.n_bodies], (-1, 3)), np.reshape(system.Phi, (-1, 6))
    heavy = Phi[Phi[:, 3] > 0.0]  # a body without mass has no radius of gyration
    size = max(np.ptp(places, axis=0).max(), np.sqrt(heavy[:, :3].sum(axis=1) / heavy[:, 3]).max(initial=0.0))  # [m]
    units = np.array([size if unit == "m" else 1.0 for unit in coordinate_units(system).values()])
    rates = np.array([size if unit == "m/s" else 1.0 for unit in rate_units(system).values()])
    q, v = np.split(states, [system.n_q], axis=-1)
    near = (np.abs(q - begin[..., : system.n_q]) <= ROUNDING_SHARE * units).all(axis=(-1, -2))
    return near & (np.abs(v) * duration <= ROUNDING_SHARE * rates).all(axis=(-1, -2))
