"""Contests of forward dynamics: one call from Python, one state in a compiled loop, a batch; large chains."""

import numpy as np
import pinocchio as pin

from benchmarks.speed.arms import Arm, random_states
from gauss.bench.contest import OURS, Competitor, Contest, Goal, difference
from gauss.codegen import Kernel, trace
from gauss.dynamics.conditions import is_large
from gauss.dynamics.mechanism import forward_dynamics
from gauss.dynamics.tree_recursion import forward_tree_recursion

CALLS = 512
PAD = 8  # doubles between rows: rows at multiples of 4096 bytes would share one set of the cache
TRIGONOMETRY = 42  # operations of one sine and cosine
CPP, PYTHON, DGEMM, SMALLER = "Pinocchio C++", "pin.aba from Python", "dgemm", "100 links"


def kernels(arm: Arm) -> tuple[Kernel, Kernel]:
    """Compiled forward dynamics of an arm: one state at a time, and a batch."""
    system, n = arm.system, arm.system.n_v
    if is_large(system):
        recursion = forward_tree_recursion(system)
        return Kernel(recursion, False), Kernel(recursion, True)
    dynamics = lambda q, v, f: forward_dynamics(system, q, v, f)  # noqa: E731
    sizes = system.n_q, n, n
    return trace(dynamics, *sizes, batch=False), trace(dynamics, *sizes, batch=True)


def inputs(arm: Arm, states) -> np.ndarray:
    """Inputs of a kernel, one column for each state; a tree recursion takes the acceleration of the ground, too."""
    count, rows = states[0].shape[1], [*states]
    if is_large(arm.system):
        ground = np.concatenate([np.zeros(3), -np.array(arm.system.scene.gravity)])
        rows.append(np.repeat(ground[:, None], count, axis=1))
    return padded(np.concatenate(rows))


def padded(array: np.ndarray) -> np.ndarray:
    """The same array with room between its rows."""
    room = np.zeros((array.shape[0], array.shape[1] + PAD))
    room[:, : array.shape[1]] = array
    return room[:, : array.shape[1]]


def from_python(arm: Arm, goal: float) -> Contest:
    """One call from Python as a user makes it: the result in a given array, arguments and result checked."""
    checked_dynamics = arm.system.forward_dynamics
    q, v, effort = random_states(arm, CALLS)
    parts = [tuple(np.ascontiguousarray(x[:, i]) for x in (q, v, effort)) for i in range(CALLS)]
    data, out, aba, model = arm.model.createData(), np.empty(arm.system.n_v), pin.aba, arm.model
    world = pin.Convention.WORLD

    def ours():
        for a, b, c in parts:
            checked_dynamics(a, b, c, out)

    def theirs():
        for a, b, c in parts:
            aba(model, data, a, b, c, world)

    agreement = max(difference(checked_dynamics(*given, out), aba(model, data, *given)) for given in parts)
    tasks = {OURS: Competitor(ours, CALLS), PYTHON: Competitor(theirs, CALLS)}
    remarks = "gauss checks types, sizes and finiteness of all that is given, refines its result once and checks it"
    return Contest(f"forward dynamics, one call from Python, {arm.name}", tasks, (Goal(PYTHON, goal),), agreement, remarks)


def in_loops(arm: Arm, one_goal: float, batch_goal: float, count: int = 4096) -> list[Contest]:
    """Many states in a compiled loop: one after the other, and a vector register of them at a time."""
    states = random_states(arm, count)
    given, (q, v, effort) = inputs(arm, states), (np.asfortranarray(part) for part in states)
    pool, peer, out = pin.ModelPool(arm.model, 1), np.zeros_like(effort, order="F"), padded(np.zeros(effort.shape))
    pin.abaInParallel(1, pool, q, v, effort, peer)
    contests = []
    for kernel, goal, what in zip(kernels(arm), (one_goal, batch_goal), ("one state", f"batch of {count}"), strict=True):
        tasks = {
            OURS: Competitor(lambda kernel=kernel: kernel(given, out), count),
            CPP: Competitor(lambda: pin.abaInParallel(1, pool, q, v, effort, peer), count),
        }
        work, agreement = f"forward dynamics, {what}, {arm.name}", difference(kernel(given), peer)
        contests.append(Contest(work, tasks, (Goal(CPP, goal),), agreement, operations=operations(kernel)))
    return contests


def longer_chain(small: Arm, large: Arm, at_most: float, count: int = 256) -> Contest:
    """One state of a long chain beside one of a shorter chain; it may take so many times as long."""
    tasks, agreement = {}, 0.0
    for name, arm in ((OURS, large), (SMALLER, small)):
        kernel, _ = kernels(arm)
        states = random_states(arm, count)
        given, out = inputs(arm, states), padded(np.zeros((arm.system.n_v, count)))
        tasks[name] = Competitor(lambda kernel=kernel, given=given, out=out: kernel(given, out), count)
        if name == SMALLER:
            data = arm.model.createData()
            peer = [pin.aba(arm.model, data, *(np.ascontiguousarray(part[:, i]) for part in states)) for i in range(count)]
            agreement = difference(kernel(given), np.transpose(peer))
    work = f"forward dynamics, one state, {large.name}"
    remarks = "agreement with Pinocchio at 100 links: its data of 1000 need O(n³) memory"
    return Contest(work, tasks, (Goal(SMALLER, 1 / at_most),), agreement, remarks)


def share_of_peak(contest: Contest, goal: float) -> Contest:
    """Operations per second in the batch beside a matrix product on the same core; a unit is an operation."""
    ours = contest.tasks[OURS]
    A = np.random.default_rng(0).standard_normal((512, 512))
    product = np.empty_like(A)
    tasks = {
        OURS: Competitor(ours.run, ours.units * contest.operations),
        DGEMM: Competitor(lambda: np.matmul(A, A, out=product), 2 * 512**3),
    }
    work = contest.work.replace("forward dynamics", "share of dgemm")
    return Contest(work, tasks, (Goal(DGEMM, goal),), contest.agreement, f"{contest.operations} operations")


def operations(kernel: Kernel) -> int:
    """Floating point operations of one evaluation, a sine and cosine counted as 42."""
    return sum(kernel.operations.values()) + (TRIGONOMETRY - 2) * kernel.operations.get("sin", 0)
