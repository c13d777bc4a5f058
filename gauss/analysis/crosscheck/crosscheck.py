"""A table of differences between gauss and Pinocchio."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from gauss.dynamics import compile_scene
from gauss.errors import SimulationError, StateError, require
from gauss.scene import Scene
from gauss.system import State, System, phase_scene, random_state, retract


@dataclass(frozen=True)
class Row:
    """Comparison of one quantity in all states.

    Parameters
    ----------
    quantity : str
        Quantity, and algorithm of the peer.
    difference : float
        Largest relative difference.
    tolerance : float
        Difference taken for rounding.
    """

    quantity: str
    difference: float
    tolerance: float

    @property
    def passed(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.difference <= self.tolerance


@dataclass(frozen=True)
class CrossCheck:
    """Outcome of :func:`gauss.analysis.crosscheck`; ``print`` it.

    Parameters
    ----------
    scene : str
        Name of the scene.
    peer : str
        The other program and its version.
    where : str
        States.
    backend : str
        Backend of gauss.
    table : tuple of Row
        Differences.
    notes : tuple of str
        Notes for readers of the table.
    """

    scene: str
    peer: str
    where: str
    backend: str
    table: tuple[Row, ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all quantities agree."""
        return all(row.passed for row in self.table)

    def __str__(self):
        """Return the table as aligned text."""
        width = max(len(row.quantity) for row in self.table)
        lines = [
            f"scene {self.scene!r}, backend {self.backend!r} against {self.peer}: "
            f"{'agreement' if self.passed else 'DISAGREEMENT'} in {self.where}",
            f"  {'quantity':{width}}  {'largest relative difference':>27}  {'tolerance':>9}",
        ]
        for row in self.table:
            verdict = "ok" if row.passed else "FAILED"
            lines.append(f"  {row.quantity:{width}}  {row.difference:27.1e}  {row.tolerance:9.0e}  {verdict}")
        return "\n".join(lines + [f"  note: {note}" for note in self.notes])


def crosscheck(
    scene: Scene | System,
    states: int | Sequence[State] = 20,
    seed: int = 0,
    backend: str = "auto",
    tolerance: float = 1e-10,
) -> CrossCheck:
    """Compare a scene with the same scene in Pinocchio.

    Accelerations, reactions (of trees), energies; and within gauss the balance of power, dT/dt = power of all
    applied loads. The Pinocchio model is built from the scene, joint by joint.

    Parameters
    ----------
    scene : Scene or System
        Scene to check.
    states : int or sequence of State
        Number of random states, each under random joint forces added to those of the scene; or given states, without.
    seed : int
        Seed of the random numbers.
    backend : str
        Backend of gauss.
    tolerance : float
        Largest relative difference that passes.

    Returns
    -------
    CrossCheck
        The table; ``.passed`` when every row is within the tolerance.

    Raises
    ------
    GaussError
        If Pinocchio cannot represent the scene; the message names the joint or constraint.
    """
    require(scene, (Scene, System), "crosscheck")
    if not (states > 0 if isinstance(states, int) else len(states)):
        raise SimulationError(f"states: expected a positive number, or some states, got {states!r}.")
    if seed < 0:
        raise SimulationError(f"seed: expected a number that is not negative, got {seed!r}.")
    if not tolerance > 0:
        raise SimulationError(f"tolerance: expected a positive number, got {tolerance!r}.")
    system = scene if isinstance(scene, System) else compile_scene(scene)
    left_out = ", ".join(system.scene.contacts | system.scene.set_valued | system.scene.losses)
    notes: tuple[str, ...] = ()
    if left_out:
        system, notes = compile_scene(phase_scene(system.scene)), (f"left out, as Pinocchio has none: {left_out}",)
    # a slow import, for cross-checks only
    comparison = import_module("gauss.analysis.crosscheck.comparison").Comparison(system, backend)
    if isinstance(states, int):
        where = f"{states} random states (seed {seed})"
        loads = np.random.default_rng((seed, 1)).standard_normal((states, system.n_v))
        compared: Iterable[State] = random_states(system, states, seed)
    else:
        compared, where, loads = states, f"{len(states)} given states", np.zeros((len(states), system.n_v))
    for state, load in zip(compared, loads, strict=True):
        comparison.take(state, load)
    rows = tuple(Row(quantity, difference, tolerance) for quantity, difference in comparison.worst.items())
    return CrossCheck(system.scene.name, comparison.peer, where, str(backend), rows, notes + comparison.notes)


DISPLACEMENT = 0.1  # standard deviation of the displacement of a mechanism with loops from its start [rad, m]
TRIES = 8  # each with half the displacement of the one before: small links do not reach large displacements


def random_states(system: System, count: int, seed: int = 0) -> Iterator[State]:
    """Consistent random states.

    Of a tree anywhere: angles in ±π, displacements in ±0.5 m, any orientation. Of a system with loops around its start.

    Parameters
    ----------
    system : System
        The system.
    count : int
        Number of states.
    seed : int
        Seed of the random numbers.
    """
    rng = np.random.default_rng(seed)
    start = system.initial_state() if system.has_closures else None
    for _ in range(count):
        yield random_state(system, rng) if start is None else _assembled(system, start, rng)


def _assembled(system: System, start: State, rng: np.random.Generator) -> State:
    v = rng.standard_normal(system.n_v)
    theta = DISPLACEMENT * rng.standard_normal(system.n_v)
    for _ in range(TRIES):
        try:
            return system.initial_state(retract(system, start.q, theta), v, start.t)
        except StateError:
            theta = theta / 2
    return system.initial_state(start.q, v, start.t)
