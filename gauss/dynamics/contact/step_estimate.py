"""What a step of time stepping takes at the start of a scene: route, near contacts, islands, and its measured cost."""

from time import thread_time
from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.contact_stepper import Stepper, lent_stepper
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.shape_table import KINDS
from gauss.dynamics.rules import Plan
from gauss.linked_groups import linked_groups
from gauss.system import State, System

STEP = 2e-3  # of the time of the scene: steps that resolve its motion
TIMED = 20  # steps by machine code that are timed, after as many that are not


class StepEstimate(NamedTuple):
    """A step of time stepping at the start of a scene."""

    free: bool  # whether it is the step of free bodies, whose matrix is block-sparse; otherwise that of mechanisms, dense
    points: int  # points, pairs: near contact points, near pairs of convex parts
    pairs: int
    kinds: tuple[str, ...]  # of these pairs
    islands: tuple[int, ...]  # numbers of bodies in groups of free bodies that near contacts connect; empty of mechanisms
    step: float  # its length [s]
    cost: float  # CPU time that it takes [s], measured


def estimated_step(system: System, plan: Plan) -> StepEstimate | None:
    """Step at the start of a scene by a plan of time stepping; None of a plan that is not by kernels of pairs of shapes.

    GaussError if the scene has no start, shapes overlap there, or steps from there fail.
    """
    if plan.dynamics != "pair kernels":
        return None
    state, h = system.initial_state(), STEP * system.scale.time
    with lent_stepper(system) as stepper:
        stepper.forget()
        stepper.refuse_penetration(state)
        near = stepper.python_step(state, h).contacts
        assert near is not None  # a step by Python
        table = stepper.table
        first, second = table.pair(near.key)
        pairs = np.unique(np.column_stack([first, second]), axis=0)
        kinds = dict.fromkeys((KINDS[table.kind[i]].__name__, KINDS[table.kind[j]].__name__) for i, j in pairs)
        free = isinstance(stepper, FreeBodyStepper)
        return StepEstimate(
            free,
            near.key.size,
            len(pairs),
            tuple("–".join(pair) for pair in kinds),
            _islands(stepper.n, near.bodies) if free else (),
            h,
            _cost(stepper, state, h),
        )


def _islands(count: int, pairs: np.ndarray) -> tuple[int, ...]:
    """Numbers of bodies in groups that contacts between pairs of bodies (m, 2) connect; of moving ones, the first."""
    root = linked_groups(count, pairs[(pairs < count).all(axis=1)].tolist())
    return tuple(np.unique(root[np.unique(pairs[pairs < count])], return_counts=True)[1].tolist())


def _cost(stepper: Stepper, state: State, h: float) -> float:
    """CPU time of a step [s]: the mean of some by machine code after others; of one in Python where it finishes none."""
    begin = np.concatenate([[state.t], state.q, state.v, np.zeros(3)])
    rows = np.empty((TIMED, begin.size))
    for _ in range(2):  # the first steps make what all share, and find forces without a guess
        began = thread_time()
        steps = stepper.steps_from(begin, begin[0] + h * np.arange(1, TIMED + 1), rows).steps
        taken = thread_time() - began
        if not steps:
            began = thread_time()
            t, q, v = np.split(begin[:-3], [1, 1 + state.q.size])
            stepper.python_step(State(float(t[0]), q, v), h)
            return thread_time() - began
        begin = rows[steps - 1].copy()
    return taken / steps
