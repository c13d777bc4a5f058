"""A motion with held inputs as one motion from each sample of the control law to the next, by any driver."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss.codegen import Scalar
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError
from gauss.simulation.held_inputs import EQUAL_SAMPLES, HeldInputs, driven_as
from gauss.simulation.motion_records import joined_stats
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.system import State


def held_motion(problem: Problem, drive: Callable[[Problem], Trajectory]) -> Trajectory:
    """Motion whose inputs are drives of constant effort from one sample to the next; it may begin between two samples.

    ``drive``: problem without held inputs → trajectory. SimulationError if the motion cannot continue; its ``trajectory``
    holds the motion so far.
    """
    held, state = problem.held, problem.start
    pieces: list[Trajectory] = []
    assert held is not None
    now, work = np.zeros(len(held.names)), np.zeros(3)
    system = driven_as(problem.system, {name: lambda t, k=k: now[k] for k, name in enumerate(held.names)})
    alone = problem._replace(system=system, laws=Laws(system), held=None, progress=False)
    for k in range(_sample_at(held, state.t), len(held.times)):
        end = held.hold_end(k)
        samples = _samples_within(problem.samples, state.t, end, not pieces)
        try:
            now[:] = held.at(k, state.t, state.q.copy(), state.v.copy())
            piece = drive(alone._replace(start=state, end=end, samples=samples))
        except (SimulationError, KeyboardInterrupt) as error:
            reached = getattr(error, "trajectory", None)
            so_far = pieces if reached is None else [*pieces, replace(reached, work=reached.work + work)]
            error.trajectory = _joined(so_far) if so_far else None  # type: ignore[union-attr]  # documented
            raise
        state = State(end, piece.q[-1].copy(), piece.v[-1].copy())
        pieces.append(_asked(replace(piece, work=piece.work + work), problem.samples, bool(pieces)))
        work = work + piece.work[-1]
    return _joined(pieces)


def _sample_at(held: HeldInputs, t: Scalar) -> int:
    """Number of the sample that holds at a time [s]."""
    return max(0, int(np.searchsorted(held.times, t + EQUAL_SAMPLES / held.rate, side="right")) - 1)


def _samples_within(samples: np.ndarray | None, begin: Scalar, end: float, first: bool) -> np.ndarray | None:
    """Times to return between two samples of the law, and the end [s]; None for every step."""
    if samples is None:
        return None
    inside = samples[(samples > begin) & (samples < end)]
    return np.concatenate([samples[samples == begin] if first else samples[:0], inside, [end]])


def _asked(piece: Trajectory, samples: np.ndarray | None, later: bool) -> Trajectory:
    """Piece with the rows that were asked for; a later one begins with the last row of that before."""
    rows = np.ones(len(piece), dtype=bool)
    if samples is None:
        rows[0] = not later
    else:
        rows[-1] = bool((samples == piece.t[-1]).any())
    return replace(piece, t=piece.t[rows], q=piece.q[rows], v=piece.v[rows], work=piece.work[rows])


def _joined(pieces: list[Trajectory]) -> Trajectory:
    """Concatenation of pieces."""
    whole = joined_stats([piece.stats for piece in pieces])
    t, q, v, work = (np.concatenate([getattr(piece, name) for piece in pieces]) for name in ("t", "q", "v", "work"))
    events = tuple(event for piece in pieces for event in piece.events)
    return replace(pieces[-1], stats=whole, events=events, energies=None, t=t, q=q, v=v, work=work)
