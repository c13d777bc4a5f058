"""Forward dynamics of one part by the compulsion itself, body by body, refined until its own rounding is all that is left.

The recursion in link frames loses digits where masses differ by many orders, and so does its check by inverse dynamics: the
force that a heavy body takes is the difference of two large ones. Here bodies keep what Gauss's principle weighs, their
deviation a − a_free from free motion, as unknowns of their own beside q̈: it is small where a body is heavy, and all its
digits count. The elimination only steers; what is wrong is found from the equations of bodies, joints and closing rows,

    f = Φ (a − a_free) − forces,   Eᵀ f = P,   a_o = X a_i + E q̈ + c,   K a = k.

Closing rows are met through half of K M⁻¹ Kᵀ, so that rows that have all but faded still count, down to the root of what
the state is off its constraints.
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Scalar, as_number
from gauss.dynamics.constrained_aba import ConstrainedArticulatedBody, add_to, condensed
from gauss.dynamics.given_link_frames import ungrouped
from gauss.dynamics.rnea import square, to_outer
from gauss.dynamics.sparse_qr import QR
from gauss.rotations import cross

DEAD = 1e-8  # √rounding, of what a row would be on free bodies: shorter ones the tree meets by itself
REFINEMENTS = 2  # the first makes up for what the elimination lost, the second shows what the first left
PROBES = 2  # random roundings that are tried
CAUTION = 4.0  # times their root mean square: what the rounding of one residual does lies below
UNIT = float(np.finfo(float).eps)


class RefinedIterate(NamedTuple):
    """Accelerations of a part, or a change of them.

    Attributes
    ----------
    rates : dict
        Accelerations of the joints of the tree.
    deviations : dict
        a − a_free (6,) of each body at its centre of mass, in the axes of its link.
    multipliers : ndarray, shape (m,)
        Multipliers of the closing rows.
    """

    rates: dict[int, np.ndarray]
    deviations: dict[int, np.ndarray]
    multipliers: np.ndarray

    def plus(self, change: "RefinedIterate") -> "RefinedIterate":
        """Both together."""
        rates = {joint: own + change.rates[joint] for joint, own in self.rates.items()}
        deviations = {body: own + change.deviations[body] for body, own in self.deviations.items()}
        return RefinedIterate(rates, deviations, self.multipliers + change.multipliers)


class IterateResidual(NamedTuple):
    """What an answer lacks.

    Attributes
    ----------
    slips : dict
        Acceleration (6,) of each link that its joint and the inner link do not account for.
    effort : ndarray, shape (n_v,)
        Generalised forces that are not balanced.
    gap : ndarray, shape (m,)
        Closing rows.
    forces : dict
        Force vectors (6,) that are not balanced but by joints.
    """

    slips: dict[int, np.ndarray]
    effort: np.ndarray
    gap: np.ndarray
    forces: dict[int, np.ndarray]


class RefinedAccelerations(NamedTuple):
    """Joint accelerations and what speaks for them.

    Attributes
    ----------
    rates : ndarray, shape (n_v,)
        Joint accelerations.
    error : ndarray, shape (n_v,)
        What they may be off: what the last refinement changed, and what rounding of its residuals may hide.
    gap : ndarray, shape (m,)
        What the closing rows lack: those that fade or contradict each other.
    power : Scalar
        Power that constraints which move bring in [W].
    """

    rates: np.ndarray
    error: np.ndarray
    gap: np.ndarray
    power: Scalar


class RefinedForwardDynamics(ConstrainedArticulatedBody):
    """A part of a system in one state.

    Parameters
    ----------
    part, q, v, relations
        As of :class:`gauss.dynamics.constrained_aba.ConstrainedArticulatedBody`.
    cut : float or Expression
        Closing rows that add less than this share of their length to the others are left out.
    """

    def __init__(self, part, q, v, relations, cut):
        super().__init__(ungrouped(part), q, v, relations)
        self.bodies = {body: _body(self.part, link, body) for body, link in self.tree.links.items() if body >= 0}
        self.free = {body: own.free_motion(self.tree.omegas[body]) for body, own in self.bodies.items()}
        halves = [
            self.articulated.half_response(effort, self._with_closed(pushes, effort)) for pushes, effort in self.actions
        ]
        self.halves = QR(np.array(halves).T * self.scale, DEAD, cut) if self.actions else None

    def found(self, effort, forces=None) -> RefinedAccelerations:
        """Joint accelerations (n_v,) under generalised forces, and forces {body: (force, moment)} on bodies."""
        pushes = self._pushes(effort, forces)
        answer = self._first(effort, pushes)
        for _ in range(REFINEMENTS):
            lacking = self._lacking(answer, effort, pushes)
            change, moved = self._change(lacking)
            answer = answer.plus(change)
        accelerations = self._accelerations(answer)
        error = np.abs(moved) + self._hidden(answer.rates, accelerations, effort, lacking.forces)
        rates, power = self._all_rates(answer.rates, accelerations, still=False), -(answer.multipliers @ self.moving)
        return RefinedAccelerations(rates, error, lacking.gap, power)

    def _first(self, effort, pushes) -> RefinedIterate:
        """Answer of the elimination as it is."""
        rates, accelerations = self.articulated.motion(effort, pushes)
        multipliers = self._meeting(self._rows(rates, accelerations, still=False))
        rates, accelerations = self.moved(rates, accelerations, multipliers)
        deviations = {body: self._at_centre(body, accelerations[body]) - free for body, free in self.free.items()}
        return RefinedIterate(rates, deviations, multipliers)

    def _lacking(self, answer: RefinedIterate, effort, pushes) -> IterateResidual:
        """What is wrong with an answer."""
        accelerations, slips = self._accelerations(answer), {}
        for edge in self.tree.edges:
            link, kin = self.tree.links[edge.outer], self.tree.joint_kinematics[edge.outer]
            carried = to_outer(link, kin, accelerations[edge.inner]) + kin.bias
            slips[edge.outer] = carried + kin.S @ answer.rates[edge.constraint] - accelerations[edge.outer]
        forces = {body: self.bodies[body].force(deviation) for body, deviation in answer.deviations.items()}
        add_to(forces, pushes, -1.0)
        for multiplier, (more, along) in zip(answer.multipliers, self.actions, strict=True):
            add_to(forces, self._with_closed(more, along), multiplier)
            effort = effort - multiplier * along
        effort = condensed(self.part, effort - self.tree.projected(forces))
        gap = -self._rows(answer.rates, accelerations, still=False)
        return IterateResidual(slips, effort, gap, self.tree.gathered(forces))

    def _change(self, lacking: IterateResidual) -> tuple[RefinedIterate, np.ndarray]:
        """Change of an answer that makes up for what it lacks, and what that is of all joint accelerations (n_v,)."""
        rates, accelerations = self.articulated.response(lacking.effort, None, lacking.slips)
        multipliers = self._meeting(self._rows(rates, accelerations, still=True) - lacking.gap)
        rates, accelerations = self.moved(rates, accelerations, multipliers)
        deviations = {body: self._at_centre(body, accelerations[body], still=True) for body in self.free}
        return RefinedIterate(rates, deviations, multipliers), self._all_rates(rates, accelerations, still=True)

    def _hidden(self, rates, accelerations, effort, forces) -> np.ndarray:
        """Joint accelerations (n_v,) that residuals do not show: what their own rounding does, each number of it."""
        rng, squares = np.random.default_rng(0), []
        rounded = lambda numbers: UNIT * rng.uniform(-1.0, 1.0, np.shape(numbers)) * np.abs(numbers)  # noqa: E731
        every = lambda parts: {key: rounded(own) for key, own in parts.items()}  # noqa: E731
        for _ in range(PROBES):
            slips = every({body: own for body, own in accelerations.items() if body >= 0})
            gap = self._rows(every(rates), every(accelerations), still=True)
            found, carried = self.articulated.response(condensed(self.part, rounded(effort)), every(forces), slips)
            multipliers = self._meeting(self._rows(found, carried, still=True) - gap)
            squares.append(self._all_rates(*self.moved(found, carried, multipliers), still=True) ** 2)
        return CAUTION * np.array([np.sqrt(total / PROBES) for total in sum(squares)])

    def _accelerations(self, answer: RefinedIterate) -> dict[int, np.ndarray]:
        """Acceleration (6,) of every link, weight included."""
        found = {-1: self.tree.ground}
        for body, deviation in answer.deviations.items():
            alpha, linear = np.split(self.free[body] + deviation, 2)
            found[body] = np.concatenate([alpha, linear - self._about_centre(body, alpha)])
        return found

    def _at_centre(self, body: int, acceleration, still: bool = False) -> np.ndarray:
        """Acceleration (6,) of the centre of a body from that of its link."""
        alpha, linear = np.split(acceleration, 2)
        return np.concatenate([alpha, linear + self._about_centre(body, alpha, still)])

    def _about_centre(self, body: int, alpha, still: bool = False) -> np.ndarray:
        """Acceleration (3,) of the centre of a body against the origin of its link."""
        c = self.bodies[body].c
        return cross(alpha, c) if still else cross(alpha, c) + square(self.tree.omegas[body]) @ c

    def _meeting(self, gap) -> np.ndarray:
        """Multipliers that close a gap of the closing rows."""
        return self.scale * self.halves.solve(self.scale * gap) if self.actions else np.zeros(0)


class BodyInertia(NamedTuple):
    """Inertia of a body in the axes of its link.

    Attributes
    ----------
    mass : Scalar
        Mass [kg].
    J, R : ndarray, shape (3,), (3, 3)
        Principal moments [kg m²], and the way from the axes of the link to the principal ones.
    c : ndarray, shape (3,)
        Centre of mass [m].
    """

    mass: Scalar
    J: np.ndarray
    R: np.ndarray
    c: np.ndarray

    def free_motion(self, omega: np.ndarray) -> np.ndarray:
        """Acceleration (6,) at the centre when nothing but weight acts, by which all is measured: Euler's equations."""
        own = self.R @ omega
        torque, alpha = cross(self.J * own, own), np.zeros(3, dtype=object)
        for k, moment in enumerate(self.J):
            if as_number(moment) != 0:
                alpha[k] = torque[k] / moment
        return np.concatenate([self.R.T @ alpha, np.zeros(3)])

    def force(self, deviation: np.ndarray) -> np.ndarray:
        """Force vector (6,) at the origin of the link that a deviation from free motion takes."""
        force = self.mass * deviation[3:]
        moment = (self.R.T @ (self.J[:, None] * self.R)) @ deviation[:3]
        return np.concatenate([moment + cross(self.c, force), force])


def _body(part, link, body: int) -> BodyInertia:
    J, mass = part.Phi[6 * body : 6 * body + 3], part.Phi[6 * body + 3]
    return BodyInertia(mass, J, link.R_central, -link.R_central.T @ link.p_central)
