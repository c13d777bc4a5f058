"""Index reduction of servo-constraints: rows that determine the efforts, and all residuals that stay zero meanwhile.

Efforts enter the second derivative of most relations. Where they do not (cranes, flexible joints), some combination of the
second derivatives is free of efforts: a hidden relation of positions and rates, which is differentiated in its place, until
S has full rank. This is the structure algorithm (Singh, IEEE Trans. Autom. Control 26, 1981, 595; Hirschorn 1979)
on the traced equations of motion, which is index reduction of the servo-constrained system.
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import count, forward, substitute
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SceneError
from gauss.servo.kernels import ShapedKernel, accelerations, directions
from gauss.servo.relation import DERIVATIVES, ScalarRelation, rows
from gauss.servo.servo import Servo
from gauss.system import State, retract

TERM_ROUNDING = 1e-9  # relative to the terms of a number: below it the number is rounding
SAMPLES = 4
SPREAD = 0.05  # units of the scene, of neighbouring states: on the same side of any singularity
MOST_OPERATIONS = 2000  # of a hidden relation: its second derivative has ten to twenty times as many
NEIGHBOUR_RATES = 1.0  # units of the scene: rates of neighbouring states


class RelationPlan(NamedTuple):
    """Rows by which relations are held."""

    scalars: tuple[ScalarRelation, ...]  # relations of contacts, of servos, and hidden ones
    active: tuple[int, ...]  # those whose accelerations determine the efforts, counted after the contacts
    degree: int  # highest relative degree

    @property
    def reduced(self) -> bool:
        """Whether there are hidden relations."""
        return any(scalar.name.startswith(HIDDEN) for scalar in self.scalars)


HIDDEN = "hidden in "


class NoReductionError(SceneError):
    """Relations whose relative degree index reduction cannot lower."""


def direct(servo: Servo) -> RelationPlan:
    """Plan in which the second derivatives of the relations determine the efforts."""
    return RelationPlan(
        servo.scalars, tuple(range(len(servo.held))), max((DERIVATIVES[s.level] for s in servo.scalars), default=0)
    )


def neighbours(servo: Servo, state: State) -> list[State]:
    """States near a given one, consistent with the contacts of the scene; the same ones at every call."""
    rng = np.random.default_rng(1829)  # any seed: what holds at random states holds almost everywhere
    dynamics = servo.system.dynamics
    assert dynamics is not None  # a servo compiles its scene
    system, scale, found = servo.system, servo.system.scale, []
    for _ in range(SAMPLES):
        q = retract(system, state.q, SPREAD * scale.coordinates * rng.standard_normal(system.n_v))
        t = state.t + SPREAD * scale.time * rng.random()
        near = State(t, q, state.v + NEIGHBOUR_RATES * scale.rates * rng.standard_normal(system.n_v))
        found.append(dynamics.consistent(system, near, ()))
    return found


def reduced(servo: Servo, state: State) -> RelationPlan:
    """Plan with hidden relations, found near a state.

    NoReductionError if the equations of motion cannot be differentiated, or no effort ever acts on a relation; the message
    says why.
    """
    _check(servo)
    samples, table = neighbours(servo, state), list(servo.scalars)
    active = list(range(len(table)))
    degree = [DERIVATIVES[scalar.level] for scalar in table]
    while True:
        free_rows = _free_of_efforts(servo, [table[i] for i in active], samples)
        if not free_rows:
            return RelationPlan(tuple(table), tuple(active), max(degree))
        for row, psi, size in free_rows:
            hidden = _hidden(servo, table[active[row]].name, psi, size, samples)
            degree[row] += DERIVATIVES[hidden.level]
            if degree[row] > 2 * servo.system.n_v:
                raise NoReductionError(f"no effort acts on relation {table[row].name!r} however often it is differentiated.")
            table.append(hidden)
            active[row] = len(table) - 1


def _check(servo: Servo):
    against = obstacles(servo.system)
    against += [f"the law of {name!r} is an opaque Python callback" for name in Laws(servo.system).reasons]
    if servo.n_contacts:
        against.append("contacts keep some relations")
    if servo.system.has_closures:
        against.append("the scene has loops or couplings")
    if against:
        raise NoReductionError(f"the equations of motion cannot be differentiated further: {'; '.join(against)}.")


def _free_of_efforts(servo: Servo, found: list[ScalarRelation], samples) -> list:
    """Rows without efforts after elimination from G q̈ = γ: (row, ψ, size of its terms at the samples)."""
    system, symbols = servo.system, servo.symbols
    effort = symbols.t.graph.symbols("P", system.n_v)
    free, _ = accelerations(symbols, Laws(system), effort)
    W, written = directions(servo, symbols), rows(found, symbols)
    X = np.array([substitute(forward(free, effort, w), effort, np.zeros(system.n_v)) for w in W], dtype=object).T
    free = substitute(free, effort, np.zeros(system.n_v))
    S, b = written.G @ X, written.gamma - written.G @ free
    kernel = ShapedKernel(symbols.inputs, [written.G, written.gamma, X, free])
    numbers = [kernel(_inputs(sample)) for sample in samples]
    S_numbers = np.array([G @ X for G, _, X, _ in numbers])
    b_sizes = np.array([np.abs(G) @ np.abs(free) + np.abs(gamma) for G, gamma, _, free in numbers])
    sizes = np.array([np.abs(G) @ np.abs(X) for G, _, X, _ in numbers])
    units = system.scale.coordinates
    most = [
        np.outer(np.abs(G) @ units, np.abs(X.T / units).max(axis=1)) for G, _, X, _ in numbers
    ]  # upper bounds of the sizes
    sizes = np.maximum(sizes, np.maximum(TERM_ROUNDING * np.max(most, axis=0), np.finfo(float).tiny))
    waiting, columns = list(range(len(found))), list(range(len(servo.efforts)))
    while waiting and columns:
        share = (np.abs(S_numbers) / sizes).min(axis=0)[np.ix_(waiting, columns)]
        place, column = np.unravel_index(int(share.argmax()), share.shape)
        if share[place, column] <= TERM_ROUNDING:
            break
        i, k = waiting.pop(int(place)), columns.pop(int(column))
        for other in waiting:
            factor = S[other, k] / S[i, k]
            S[other], b[other] = S[other] - factor * S[i], b[other] - factor * b[i]
            ratio = S_numbers[:, other, k] / S_numbers[:, i, k]
            S_numbers[:, other] -= ratio[:, None] * S_numbers[:, i]
            S_numbers[:, other, k] = 0.0
            sizes[:, other] += np.abs(ratio)[:, None] * sizes[:, i]
            b_sizes[:, other] += np.abs(ratio) * b_sizes[:, i]
    return [(row, b[row], b_sizes[:, row]) for row in waiting]


def _hidden(servo: Servo, name: str, psi, size, samples) -> ScalarRelation:
    """Hidden relation ψ = 0, of positions if rates do not matter in it."""
    system, symbols = servo.system, servo.symbols
    name = f"{HIDDEN}{name.removeprefix(HIDDEN)}"
    operations = sum(count([psi]).values())
    if operations > MOST_OPERATIONS:
        raise NoReductionError(
            f"{name} takes {operations} operations, and more when it is differentiated: too many for index reduction; "
            "model the mechanism by fewer bodies."
        )
    kernel = ShapedKernel(symbols.inputs, [np.array([psi], dtype=object)])

    def change(other) -> float:
        return max(abs(float(kernel(_inputs(s))[0][0] - kernel(_inputs(other(s)))[0][0])) for s in samples) / size.max()

    if change(lambda s: State(s.t, s.q, -2.0 * s.v)) > TERM_ROUNDING:
        return ScalarRelation(name, psi, "velocity")
    psi = substitute([psi], symbols.velocities, np.zeros(system.n_v))[0]
    kernel = ShapedKernel(symbols.inputs, [np.array([psi], dtype=object)])
    others = dict(zip(map(id, samples), samples[1:] + samples[:1], strict=True))
    if change(lambda s: State(s.t, others[id(s)].q, s.v)) <= TERM_ROUNDING:
        raise NoReductionError(
            f"no effort acts on relation {name.removeprefix(HIDDEN)!r}: its acceleration is one of gravity and time alone."
        )
    return ScalarRelation(name, psi, "position")


def _inputs(state: State) -> np.ndarray:
    return np.concatenate([state.q, state.v, [state.t]])
