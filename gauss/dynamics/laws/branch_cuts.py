"""Branch cuts of atan2 in constraints of the user: the same residuals with conditions, where a motion may meet a cut.

atan2(y, x) jumps by 2π across y = 0, x < 0. In the half plane x < 0 it is atan2(−y, −x) ± π, smooth on either side; so
written, its cut is a surface between two modes (:mod:`gauss.dynamics.laws.constraint_modes`). Most residuals with atan2 wrap
an angle whose cut is away from all states that meet the constraint: only cuts that such states meet count.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from gauss.codegen import Expression, Function, Graph, reachable, substitute
from gauss.dynamics.store import cached
from gauss.dynamics.system_dynamics import SystemDynamics
from gauss.math import atan2, where
from gauss.scene.relation import Relation
from gauss.system import State, System, build, retract
from gauss.system.symbolic_mechanism import Symbols, symbols_of

ITERATIONS, SMALL_STEP = 40, 1e-6  # of Newton's method, and of its differences, in units of the coordinates
ON_CUT = 1e-8  # residual beside its terms, at a state of the size of the scene, of a cut that is met
TRIED = 6  # states from which Newton's method starts


@dataclass(frozen=True)
class Unfolded(Relation):
    """Relation whose branch cuts are conditions."""

    whole: Relation

    def positions(self, at) -> list:
        """Residuals of positions."""
        return inlined(self.whole, at, lambda traced, view: _unfolded(traced[0]))

    def velocities(self, at) -> list:
        """Residuals of velocities."""
        return inlined(self.whole, at, lambda traced, view: _unfolded(traced[1]))


def inlined(relation: Relation, at, change) -> list:
    """Residuals of a relation, changed as they are traced: a function of both parts and the symbols."""
    view = Symbols(at.system, Graph())  # of its own: the order of the conditions depends on nothing else
    changed = list(change(view.residuals(relation), view))
    bodies = [entry for b in view.bodies for entry in (*np.ravel(at.R[b]), *at.x[b], *at.W[b], *at.u[b])]
    placed = [at.system.joints[j] for j in view.joints]
    joints = [entry for joint in placed for entry in (*at.coordinates_of(joint), *at.rates_of(joint))]
    given = np.array([*bodies, *joints, at.t], dtype=object)
    return list(Function("residual", symbols_of(view.bodies, view.joints, view.t), changed).inlined(given))


def _cuts(outputs) -> list[Expression]:
    return [node for node in reachable([x for x in outputs if isinstance(x, Expression)]) if node.op == "atan2"]


def _unfolded(outputs) -> list:
    """The same results with atan2 by half planes."""
    nodes, values = _cuts(outputs), list[Expression]()
    for k, node in enumerate(nodes):
        y, x = substitute(list(node.operands), nodes[:k], values)
        left = atan2(-y, -x) + where(y < 0.0, -math.pi, math.pi)
        values.append(where(x < 0.0, left, atan2(y, x)))
    return list(substitute(list(outputs), nodes, values))


def unfolded_system(system: System) -> System | None:
    """The system with the branch cuts of its constraints as conditions; None where there are none."""

    def make() -> tuple[System | None]:
        found = {}
        for name, relation in system.scene.relations.items():
            traced = Symbols(system, Graph()).residuals(relation)
            if not relation.loses and _cuts([*traced[0], *traced[1]]):
                found[name] = Unfolded(name, relation)
        if not found:
            return (None,)
        scene = system.scene
        return (build(replace(scene, relations=scene.relations | found), SystemDynamics()),)

    return cached(system, (unfolded_system,), make)[0]


def met_from(system: System, state: State, residual) -> State | None:
    """State at which residuals of a state, beside their terms, vanish, by Newton's method from one, or None."""
    units = system.scale.coordinates
    moves = SMALL_STEP * np.diag(units * np.ones(system.n_v))

    def at(state: State, move: np.ndarray) -> State:
        return replace(state, q=retract(system, state.q, move))

    for _ in range(ITERATIONS):
        r = residual(state)
        if not np.isfinite(r).all():
            return None
        if np.abs(r).max() <= ON_CUT:
            return state
        J = np.array([residual(at(state, d)) - residual(at(state, -d)) for d in moves]).T / (2.0 * SMALL_STEP)
        state = at(state, np.clip(-np.linalg.lstsq(J, r, rcond=1e-10)[0], -1.0, 1.0) * units)
    return None
