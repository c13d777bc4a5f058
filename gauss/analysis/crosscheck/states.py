"""Random states to compare in."""

from collections.abc import Iterator

import numpy as np

from gauss.errors import StateError
from gauss.system import State, System, random_state, retract

SPREAD = 0.1  # standard deviation of the first try at leaving the start of a mechanism with loops [rad, m]
TRIES = 8  # each half as wide as the one before: links of millimetres do not follow displacements of metres


def random_states(system: System, count: int, seed: int = 0) -> Iterator[State]:
    """Consistent random states.

    Anywhere for a tree: angles in ±π, displacements in ±0.5 m, any orientation. Around its start for a system with
    closures, which has to be assembled.

    Parameters
    ----------
    system : System
        The system.
    count : int
        How many.
    seed : int
        Of the random numbers.
    """
    rng = np.random.default_rng(seed)
    start = system.initial_state() if system.has_closures else None
    for _ in range(count):
        yield random_state(system, rng) if start is None else _assembled(system, start, rng)


def _assembled(system: System, start: State, rng: np.random.Generator) -> State:
    v = rng.standard_normal(system.n_v)
    theta = SPREAD * rng.standard_normal(system.n_v)
    for _ in range(TRIES):
        try:
            return system.initial_state(retract(system, start.q, theta), v, start.t)
        except StateError:
            theta = theta / 2
    return system.initial_state(start.q, v, start.t)
