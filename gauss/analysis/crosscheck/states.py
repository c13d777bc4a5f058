"""Random consistent states for comparisons."""

from collections.abc import Iterator

import numpy as np

from gauss.errors import StateError
from gauss.system import State, System, random_state, retract

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
