"""Forward dynamics in joint coordinates, loops and couplings included, over numbers or symbols.

The tree answers to any force; the rows that close it, K q̈ = k, are met by multipliers of the small system K M⁻¹ Kᵀ. It is
regularised and iterated to the unregularised one (proximal, Carpentier, Budhiraja, Mansard, RSS 2021), so that redundant
consistent rows do no harm and the same operations serve every state.
"""

import numpy as np

from gauss import rotations
from gauss.assembly.articulated import Articulated, invert
from gauss.rotations import cross
from gauss.system import PlacedJoint, System

MU = 1e-8  # regularisation of rows that are measured against what they would be on free bodies
ITERATIONS = 4  # live rows, above √MU, converge by a factor of 10⁴ or more each


def forward_dynamics(system: System, q, v, effort, forces=None) -> np.ndarray:
    """Joint accelerations (n_v,) under gravity and generalised forces.

    Parameters
    ----------
    system : System
        Any system whose loops are closed by joints with a constant subspace along coordinate axes
        (see :func:`gauss.system.obstacles`).
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates that meet the constraints; floats or expressions.
    effort : ndarray, shape (n_v,)
        Generalised forces along the rates.
    forces : dict, optional
        Force [N] and moment about the centre of mass [N m] on bodies, {body: (force, moment)} in principal axes.
    """
    tree = Articulated(system, q, v)
    closings = [Closing(tree, system.joints[i], q, v) for i in system.structure.closures if i < len(system.joints)]
    pushes = {body: _to_link(tree.links[body], *push) for body, push in (forces or {}).items()}
    for closing in closings:  # drives and springs of joints that close a loop push its two bodies
        for axis, force in zip(closing.free, effort[closing.joint.v], strict=True):
            _add(pushes, closing.wrench(axis), force)
    rates, accelerations = tree.motion(effort, pushes)
    rows = [(closing, axis) for closing in closings for axis in closing.held]
    K = coupling_rows(system)
    if rows or len(K):
        none = np.zeros(system.n_v)
        responses = [tree.response(none, closing.wrench(axis)) for closing, axis in rows]
        responses += [tree.response(row, {}) for row in K]
        gap = np.concatenate([c.relative(accelerations)[c.held] for c in closings] + [K @ _vector(system, rates)])
        S = np.array([_measure(system, closings, K, response) for response in responses]).T
        scale = np.array([1.0 / np.sqrt(closing.unbound(axis)) for closing, axis in rows] + [1.0 / _size(row) for row in K])
        y = scale * _multipliers(scale[:, None] * S * scale, scale * gap)
        for multiplier, (more_rates, more) in zip(y, responses, strict=True):
            rates = {joint: rate - multiplier * more_rates[joint] for joint, rate in rates.items()}
            accelerations = {body: a - multiplier * more[body] for body, a in accelerations.items()}
    for closing in closings:
        rates[system.joints.index(closing.joint)] = closing.relative(accelerations)[closing.free]
    return _vector(system, rates)


class Closing:
    """A joint that closes a loop, seen from the axes of its frame on the parent.

    Parameters
    ----------
    tree : Articulated
        The open tree in its state.
    joint : PlacedJoint
        The joint.
    q, v : ndarray
        All coordinates and rates.
    """

    def __init__(self, tree: Articulated, joint: PlacedJoint, q, v):
        self.tree, self.joint = tree, joint
        self.R, self.p = joint.pair.pose(q[joint.q])
        E_omega, E_v = joint.pair.subspace(q[joint.q])
        self.free = [int(np.argmax(column)) for column in np.concatenate([E_omega, E_v]).T]
        self.held = [axis for axis in range(6) if axis not in self.free]
        self.turning, self.sliding = E_omega @ v[joint.v], E_v @ v[joint.v]
        self.sides = {
            body: _side(tree, body, R, p)
            for body, R, p in ((joint.parent, joint.R_parent, joint.p_parent), (joint.child, joint.R_child, joint.p_child))
        }

    def relative(self, accelerations, still: bool = False) -> np.ndarray:
        """Acceleration (6,) of the child against the parent at the joint point: E q̈ when the loop is closed."""
        parent, child = self.joint.parent, self.joint.child
        alpha_c, a_c, _ = self._at_joint(child, accelerations[child], np.zeros(3), still)
        alpha_p, a_p, omega_p = self._at_joint(parent, accelerations[parent], self.p, still)
        angular, linear = self.R @ alpha_c - alpha_p, self.R @ a_c - a_p
        if still:
            return np.concatenate([angular, linear])
        return np.concatenate([angular - cross(omega_p, self.turning), linear - 2.0 * cross(omega_p, self.sliding)])

    def _at_joint(self, body: int, acceleration, point, still: bool):
        """Angular acceleration, acceleration of a point of the joint frame, angular velocity, in the joint axes."""
        R, p = self.sides[body]
        omega, linear = np.split(np.zeros(6) if still else self.tree.velocities[body], 2)
        lever = p + R @ point
        true = acceleration[3:] + cross(omega, linear) + cross(acceleration[:3], lever) + cross(omega, cross(omega, lever))
        return R.T @ acceleration[:3], R.T @ true, R.T @ omega

    def wrench(self, axis: int) -> dict[int, np.ndarray]:
        """Unit force or moment along a joint axis on the child at the joint point, its opposite on the parent."""
        unit = np.eye(6)[axis]
        pushes = {}
        for body, turn, point, sign in (
            (self.joint.child, self.R.T, np.zeros(3), 1.0),
            (self.joint.parent, np.eye(3), self.p, -1.0),
        ):
            if body >= 0:
                R, p = self.sides[body]
                force = sign * (R @ (turn @ unit[3:]))
                moment = sign * (R @ (turn @ unit[:3])) + cross(p + R @ point, force)
                pushes[body] = np.concatenate([moment, force])
        return pushes

    def unbound(self, axis: int) -> float:
        """Row of this axis if no joint bound its bodies: what its rounding is measured against."""
        links = [self.tree.links[body] for body in (self.joint.parent, self.joint.child) if body >= 0]
        if axis >= 3:
            return sum(1.0 / link.mass for link in links if link.mass) or 1.0
        moments = [float(np.trace(link.inertia[0])) for link in links]
        return sum(1.0 / moment for moment in moments if moment) or 1.0


def _to_link(link, force, moment) -> np.ndarray:
    """Force vector in the link frame of a force through the centre of mass and a moment, in principal axes."""
    R, p = link.R_central, link.p_central
    return np.concatenate([R.T @ (moment - cross(p, force)), R.T @ force])


def _side(tree: Articulated, body: int, R, p):
    link = tree.links[body]
    return rotations.clean(link.R_central.T @ R), link.R_central.T @ (p - link.p_central)


def _measure(system: System, closings, K, response) -> np.ndarray:
    rates, accelerations = response
    parts = [closing.relative(accelerations, still=True)[closing.held] for closing in closings]
    return np.concatenate([*parts, K @ _vector(system, rates)])


def _multipliers(S, gap):
    """Proximal iterations for S y = gap."""
    inverse = invert(S + MU * np.eye(len(gap)))
    y = inverse @ gap
    for _ in range(ITERATIONS - 1):
        y = y + inverse @ (gap - S @ y)  # on the residual of S itself: rounding in the inverse does not stay
    return y


def coupling_rows(system: System) -> np.ndarray:
    """Rows K (m, n_v) of K q̇ = 0: q̇_driven − ratio · q̇_driver."""
    rows = np.zeros((len(system.scene.couplings), system.n_v))
    for row, coupling in zip(rows, system.scene.couplings.values(), strict=True):
        row[system.joint(coupling.driven).v] = 1.0
        row[system.joint(coupling.driver).v] = -coupling.ratio
    return rows


def _size(row: np.ndarray) -> float:
    return float(np.linalg.norm(row))


def _vector(system: System, rates) -> np.ndarray:
    """All joint accelerations; zero for a joint whose acceleration is not known yet."""
    zero = [np.zeros(joint.pair.n_v) for joint in system.joints]
    return np.concatenate([rates.get(i, zero[i]) for i in range(len(system.joints))])


def _add(pushes: dict, more: dict, factor):
    for body, push in more.items():
        pushes[body] = pushes.get(body, np.zeros(6)) + factor * push
