"""The equations of a network, written once over scalars that may be numbers or symbols, O(n) for one evaluation.

    J_j ω̇_j = Q_j + Σ_{links driving j} Q_em − Σ_{links driven by j} f Q_em        (III.75), (III.76)

with gears eliminated from the leaves: a child adds ψ κ Ĵ to the inertia of its parent and ψ Q̂ to its torque
(articulated bodies of one freedom; Featherstone, Rigid Body Dynamics Algorithms, ch. 7).
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Kernel, Scalar, trace
from gauss.dynamics.rules import Plan, Rejected
from gauss.errors import SimulationError
from gauss.rotors.laws import ROLES, TorqueFunction
from gauss.rotors.links import GearPair, LinkKinematics
from gauss.rotors.reduced import ReducedNetwork, psi
from gauss.scene.values import returned

MOST_ELEMENTS = 5000  # shafts and links: larger networks take minutes to compile


class Conditions(NamedTuple):
    """Inputs of the equations besides time, angles and speeds: the mode, and the torques of what sticks."""

    f: np.ndarray  # (n_l,): torque factor of each link
    # (n_l,): of dry links the sign of the slip, 0 where they stick; of springs the backlash side in contact
    state: np.ndarray
    held: np.ndarray  # (n_l,): torque of dry links that stick [N m]
    dry: np.ndarray  # (n_d,): sign of the speed of shafts with dry friction, 0 where their group sticks
    gate: np.ndarray  # (n_terms,): 1 for torques that act, else 0
    dry_limit: np.ndarray  # (n_d,): dry friction of shafts [N m]
    stuck: np.ndarray  # (n_g,): torque of the friction of a group at rest on its root [N m]


class NetworkInstant(NamedTuple):
    """Accelerations, torques and powers of one instant."""

    acceleration: np.ndarray  # (n_g,) of the roots [rad/s²]
    torque: np.ndarray  # (n_l,) q_em of the links [N m]
    applied: np.ndarray  # (n,) sum of torques on each shaft but those of gears [N m]
    power: np.ndarray  # (3,) of motors, loads and losses [W]
    slipped: np.ndarray  # slipped, meshed (n_l,): power lost between the shafts of each link, and by its efficiency [W]
    meshed: np.ndarray


def sizes(reduced: ReducedNetwork) -> list[int]:
    """Lengths of the arguments of :func:`evaluate`, time included."""
    n_g, n_l, n_d, n_t = reduced.n_groups, len(reduced.links), len(reduced.dry), len(reduced.terms)
    return [1, n_g, n_g, n_l, n_l, n_l, n_d, n_t, n_d, n_g]


def evaluate(reduced: ReducedNetwork, t, theta, w, conditions: Conditions) -> NetworkInstant:
    """Accelerations and torques of one instant.

    Parameters
    ----------
    t : Scalar
        Time [s].
    theta, w : array_like, shape (n_g,)
        Angles turned since the start [rad] and speeds [rad/s] of the roots.
    conditions : Conditions
        Mode and torques of what sticks.
    """
    c = conditions
    speed = [k * w[g] for k, g in zip(reduced.K.tolist(), reduced.group, strict=True)]
    angle = [a + k * theta[g] for a, k, g in zip(reduced.angle.tolist(), reduced.K.tolist(), reduced.group, strict=True)]
    Q, power = _applied(reduced, t, angle, speed, c)
    torques, slipped = _transmit(reduced, t, angle, speed, c, Q)
    acceleration = _eliminate(reduced, Q, torques, c)
    meshed: list[Scalar] = [0.0] * len(reduced.links)
    for b, link in enumerate(reduced.links):
        v_d = speed[reduced.driver[b]]
        if isinstance(link, GearPair) and link.slip:
            slipped[b] = torques[b] * (v_d / link.ratio - speed[reduced.driven[b]])
        if link.lossy:
            meshed[b] = (c.f[b] - 1.0 / link.ratio) * torques[b] * v_d
    parts = (acceleration, torques, Q, power, slipped, meshed)
    return NetworkInstant(*(np.array(part) for part in parts))


def _applied(reduced: ReducedNetwork, t, angle, speed, c: Conditions) -> tuple[list, list]:
    """Applied torques (n,) on the shafts, dry friction among them, and their powers by role."""
    Q: list[Scalar] = [0.0] * len(reduced.names)
    power: dict[str, Scalar] = dict.fromkeys(ROLES, 0.0)
    index = {name: j for j, name in enumerate(reduced.names)}
    for term, gate in zip(reduced.terms, c.gate, strict=True):
        j = index[term.shaft]
        torque = gate * _torque(term, t, angle[j], speed[j])
        Q[j] = Q[j] + torque
        power[term.role] = power[term.role] + torque * speed[j]
    for d, j in enumerate(reduced.dry):
        torque = -c.dry[d] * c.dry_limit[d]
        Q[j] = Q[j] + torque
        power["load"] = power["load"] + torque * speed[j]
    return Q, [power[role] for role in ROLES]


def _transmit(reduced: ReducedNetwork, t, angle, speed, c: Conditions, Q: list) -> tuple[list, list]:
    """Torques Q_em and slip losses of all links but gears, added to the torques Q on the shafts."""
    torques: list[Scalar] = [0.0] * len(reduced.links)
    slipped: list[Scalar] = [0.0] * len(reduced.links)
    for b, link in enumerate(reduced.links):
        if not isinstance(link, GearPair):
            ends = link_kinematics(reduced, b, t, angle, speed)
            torques[b] = link.effort(ends, c.state[b]) + (c.held[b] if link.dry else 0.0)
            slipped[b] = link.heat(ends, torques[b], c.state[b])
            p, d = reduced.driver[b], reduced.driven[b]
            Q[d] = Q[d] + torques[b]
            Q[p] = Q[p] - c.f[b] * torques[b]
    return torques, slipped


def _eliminate(reduced: ReducedNetwork, Q, torques, c: Conditions) -> list:
    """Accelerations of the roots; fills in the torques of the gears."""
    J_hat, Q_hat = reduced.inertia.tolist(), list(Q)
    for branch in reduced.inward:
        factor = psi(branch, c.f)
        J_hat[branch.parent] = J_hat[branch.parent] + factor * branch.rate * J_hat[branch.child]
        Q_hat[branch.parent] = Q_hat[branch.parent] + factor * Q_hat[branch.child]
    acceleration = [0.0] * len(Q)
    for g, root in enumerate(reduced.roots):
        acceleration[root] = (Q_hat[root] + c.stuck[g]) / J_hat[root]
    for branch in reversed(reduced.inward):
        acceleration[branch.child] = branch.rate * acceleration[branch.parent]
        needed = J_hat[branch.child] * acceleration[branch.child] - Q_hat[branch.child]
        torques[branch.link] = needed if branch.forward else -needed / c.f[branch.link]
    return [acceleration[root] for root in reduced.roots]


def link_kinematics(reduced: ReducedNetwork, b: int, t, angle, speed) -> LinkKinematics:
    """Relative kinematics of a link, from angles and speeds of all shafts."""
    i, p, d = reduced.links[b].ratio, reduced.driver[b], reduced.driven[b]
    lead = speed[p] / i - speed[d]
    return LinkKinematics(t, angle[p] / i - angle[d], lead, speed[p], i * speed[d], reduced.v_0)


def _torque(term, t, angle, speed):
    """Torque of one term [N m]; what a function of the user returns is checked."""
    if isinstance(term.law, TorqueFunction):
        return returned(term.law.function, (t, angle, speed), f"torque {term.name!r}", 1)[0]
    return term.law(t, angle, speed)


class NetworkEquations:
    """The equations of one network, compiled when all its laws can be traced.

    Attributes
    ----------
    plan : Plan
        Whether they are, and why not.
    """

    def __init__(self, reduced: ReducedNetwork, compiled: bool | None = None):
        self.reduced = reduced
        self._kernel: Kernel | None = None
        n, n_l = len(reduced.names), len(reduced.links)
        ends = np.cumsum([0, reduced.n_groups, n_l, n, len(ROLES), n_l, n_l])
        self._parts = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
        against = self._compile(compiled)
        rejected = (Rejected("events", "compiled", (against,)),) if against else ()
        self.plan = Plan("events", "numpy" if against else "compiled", "none", rejected=rejected)

    def _compile(self, compiled: bool | None) -> str:
        """Trace and compile the equations; the reason against it, empty if they are."""
        size = len(self.reduced.names) + len(self.reduced.links)
        if compiled is None and size > MOST_ELEMENTS:
            return f"it has more than {MOST_ELEMENTS} shafts and links"
        if compiled is False:
            return "compiled=False is asked for"
        try:
            self._kernel = trace(self._traced, *sizes(self.reduced), batch=False)
        except Exception as error:  # a law of the user may fail in any way on symbols: it is called then
            if compiled:
                raise SimulationError(f"compiled=True: a law cannot be traced ({error}); leave compiled out.") from error
            return f"a law cannot be traced ({type(error).__name__}: {error})"
        return ""

    def _traced(self, t, theta, w, *conditions):
        return tuple(evaluate(self.reduced, t[0], theta, w, Conditions(*conditions)))

    def __call__(self, t: float, theta, w, conditions: Conditions) -> NetworkInstant:
        """Accelerations and torques of one instant."""
        if self._kernel is None:
            return NetworkInstant(
                *(np.asarray(part, dtype=float) for part in evaluate(self.reduced, t, theta, w, conditions))
            )
        found = self._kernel(np.concatenate([[t], theta, w, *conditions]))
        return NetworkInstant(*[found[part] for part in self._parts])
