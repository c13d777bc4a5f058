"""Forward dynamics of a subsystem body by body, refined to round-off (iterative refinement, with an error bound).

The recursion in link frames loses digits where masses differ by many orders, and so does its check by inverse dynamics: the
force on a heavy body is the difference of two large ones. Here the deviation a − a_free of Gauss's principle is an unknown
of every body beside q̈: it is small where a body is heavy, and keeps all its digits. The elimination is the preconditioner;
residuals are those of the equations of bodies, joints and loop constraints,

    f = Φ (a − a_free) − forces,   Eᵀ f = P,   a_o = X a_i + E q̈ + c,   K a = k.

Loop constraints are solved through a square root of K M⁻¹ Kᵀ = WᵀW, so that near rank-deficient rows keep their digits, down
to the root of the position residual: R of a QR factorisation of W has small pivots to round-off, those of WᵀW only to its
square root (Björck, Numerical Methods for Least Squares Problems, 1996, sec. 2.4 and 6.6.5).
"""

from typing import Any, NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Scalar, as_number
from gauss.dynamics.constrained_aba import ConstrainedArticulatedBody, add_to, condensed
from gauss.dynamics.given_link_frames import ungrouped
from gauss.dynamics.rnea import square, to_outer
from gauss.rotations import cross

SMALLEST_DIVISOR = 1e-300  # of a length that is cut off: its inverse stays finite


class QR:
    """Triangular factor of a matrix (n, m) of numbers or expressions, for solving WᵀW y = b, by modified Gram–Schmidt.

    Columns are sparse, and scaled to unit length; linearly dependent ones are left out.

    ``least_length``: columns below this length are left out. ``cut``: rank tolerance: columns with less than this share of
    their length outside the span of the earlier ones are left out.
    """

    def __init__(self, W: np.ndarray, least_length: float, cut):
        m = W.shape[1]
        self.scale, self.inverse_pivots = [], []
        self.above: list[dict[int, Any]] = [{} for _ in range(m)]  # of each column, entries of R above its pivot
        directions: list[dict[int, Any]] = []
        for j in range(m):
            column = {i: entry for i, entry in enumerate(W[:, j]) if as_number(entry) != 0}
            length = _length(column)
            self.scale.append(math.where(length > least_length, 1.0 / math.maximum(length, SMALLEST_DIVISOR), 0.0))
            column = {i: entry * self.scale[j] for i, entry in column.items()}
            self._orthogonalise(j, column, directions)
            pivot = _length(column)
            self.inverse_pivots.append(math.where(pivot > cut, 1.0 / math.maximum(pivot, SMALLEST_DIVISOR), 0.0))
            directions.append({i: entry * self.inverse_pivots[j] for i, entry in column.items()})

    def _orthogonalise(self, j: int, column: dict[int, Any], directions: list[dict[int, Any]]):
        """Subtract the components along earlier directions from column j, in place."""
        for k, direction in enumerate(directions):
            shared = [i for i in direction if i in column]
            if not shared:
                continue
            self.above[j][k] = sum(direction[i] * column[i] for i in shared)
            for i, entry in direction.items():
                column[i] = column.get(i, 0.0) - self.above[j][k] * entry

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution y (m,) of WᵀW y = b; 0 for columns that are left out."""
        m = len(self.above)
        y = [b[j] * self.scale[j] for j in range(m)]
        for j in range(m):
            y[j] = (y[j] - sum(entry * y[k] for k, entry in self.above[j].items())) * self.inverse_pivots[j]
        for j in reversed(range(m)):
            y[j] = y[j] * self.inverse_pivots[j]
            for k, entry in self.above[j].items():
                y[k] = y[k] - entry * y[j]
        return np.array([*(y[j] * self.scale[j] for j in range(m)), None], dtype=object)[:-1]


def _length(column: dict):
    return np.sqrt(sum(entry * entry for entry in column.values())) if column else 0.0


LEAST_ROW_LENGTH = 1e-8  # √round-off, relative to the row on free bodies: shorter rows the tree meets by itself
REFINEMENTS = 2  # the first removes the errors of the elimination, the second measures those of the first
PROBES = 2  # random round-off errors of the residuals
ROUNDOFF_MARGIN = 4.0  # times their root mean square: bound of the round-off of one residual
UNIT_ROUNDOFF = float(np.finfo(float).eps)


class RefinedIterate(NamedTuple):
    """Accelerations of a subsystem, or a change of them."""

    rates: dict[int, np.ndarray]  # accelerations of the tree joints
    deviations: dict[int, np.ndarray]  # a − a_free (6,) of each body at its centre of mass, in the axes of its link
    multipliers: np.ndarray  # (m,) multipliers of the loop constraints

    def plus(self, change: "RefinedIterate") -> "RefinedIterate":
        """Sum of an iterate and its change."""
        rates = {joint: own + change.rates[joint] for joint, own in self.rates.items()}
        deviations = {body: own + change.deviations[body] for body, own in self.deviations.items()}
        return RefinedIterate(rates, deviations, self.multipliers + change.multipliers)


class IterateResidual(NamedTuple):
    """Residuals of an iterate."""

    accelerations: dict[int, np.ndarray]  # residual (6,) of the acceleration equation of each link, a_i + S q̈ + c − a
    tau: np.ndarray  # (n_v,) residual generalised forces
    rows: np.ndarray  # (m,) residual of the loop constraints
    forces: dict[int, np.ndarray]  # wrenches (6,) on bodies and what they carry, to be balanced by joints


class RefinedAccelerations(NamedTuple):
    """Joint accelerations with an error bound."""

    rates: np.ndarray  # (n_v,) joint accelerations
    error: np.ndarray  # (n_v,) bound of their error: the last refinement, and the round-off of its residuals
    # (m,) residual of the loop constraints, not zero near singular configurations and for inconsistent redundant rows
    residual: np.ndarray
    power: Scalar  # power of rheonomic constraints [W]


class RefinedForwardDynamics(ConstrainedArticulatedBody):
    """Forward dynamics of a subsystem in one state with iterative refinement.

    ``subsystem``, ``q``, ``v``, ``relations``: as of :class:`gauss.dynamics.constrained_aba.ConstrainedArticulatedBody`.
    ``cut``: rank tolerance: loop constraints with less than this share of their length outside the span of the others are
    left out.
    """

    def __init__(self, subsystem, q, v, relations, cut):
        super().__init__(ungrouped(subsystem), q, v, relations)
        self.bodies = {body: _body(self.subsystem, link, body) for body, link in self.tree.links.items() if body >= 0}
        self.free = {body: own.free_motion(self.tree.omegas[body]) for body, own in self.bodies.items()}
        halves = [
            self.articulated.half_response(tau, self._with_loop_forces(wrenches, tau)) for wrenches, tau in self.unit_forces
        ]
        self.halves = QR(np.array(halves).T * self.scale, LEAST_ROW_LENGTH, cut) if self.unit_forces else None

    def found(self, tau, forces=None) -> RefinedAccelerations:
        """Joint accelerations (n_v,) under generalised forces, and forces {body: (force, moment)} on bodies."""
        wrenches = self._external_wrenches(tau, forces)
        iterate = self._first(tau, wrenches)
        for _ in range(REFINEMENTS):
            residual = self._residual_of(iterate, tau, wrenches)
            change, moved = self._change(residual)
            iterate = iterate.plus(change)
        accelerations = self._accelerations(iterate)
        error = np.abs(moved) + self._roundoff(iterate.rates, accelerations, tau, residual.forces)
        rates = self._all_rates(iterate.rates, accelerations, still=False)
        return RefinedAccelerations(rates, error, residual.rows, -(iterate.multipliers @ self.velocity_rhs))

    def _first(self, tau, wrenches) -> RefinedIterate:
        """Solution by the elimination alone."""
        rates, accelerations = self.articulated.motion(tau, wrenches)
        multipliers = self._solved_multipliers(self._rows(rates, accelerations, still=False))
        rates, accelerations = self.under_multipliers(rates, accelerations, multipliers)
        deviations = {body: self._at_centre(body, accelerations[body]) - free for body, free in self.free.items()}
        return RefinedIterate(rates, deviations, multipliers)

    def _residual_of(self, iterate: RefinedIterate, tau, wrenches) -> IterateResidual:
        accelerations, off = self._accelerations(iterate), {}
        for edge in self.tree.edges:
            link, kin = self.tree.links[edge.outer], self.tree.joint_kinematics[edge.outer]
            carried = to_outer(link, kin, accelerations[edge.inner]) + kin.bias
            off[edge.outer] = carried + kin.S @ iterate.rates[edge.constraint] - accelerations[edge.outer]
        forces = {body: self.bodies[body].force(deviation) for body, deviation in iterate.deviations.items()}
        add_to(forces, wrenches, -1.0)
        for multiplier, (more, along) in zip(iterate.multipliers, self.unit_forces, strict=True):
            add_to(forces, self._with_loop_forces(more, along), multiplier)
            tau = tau - multiplier * along
        tau = condensed(self.subsystem, tau - self.tree.projected(forces))
        rows = -self._rows(iterate.rates, accelerations, still=False)
        return IterateResidual(off, tau, rows, self.tree.gathered(forces))

    def _change(self, residual: IterateResidual) -> tuple[RefinedIterate, np.ndarray]:
        """Change of an iterate that removes its residuals, and the same of all joint accelerations (n_v,)."""
        rates, accelerations = self.articulated.response(residual.tau, None, residual.accelerations)
        multipliers = self._solved_multipliers(self._rows(rates, accelerations, still=True) - residual.rows)
        rates, accelerations = self.under_multipliers(rates, accelerations, multipliers)
        deviations = {body: self._at_centre(body, accelerations[body], still=True) for body in self.free}
        return RefinedIterate(rates, deviations, multipliers), self._all_rates(rates, accelerations, still=True)

    def _roundoff(self, rates, accelerations, tau, forces) -> np.ndarray:
        """Bound (n_v,) of the error by round-off of the residuals, from random errors of their terms."""
        rng = np.random.default_rng(0)
        squares: list[np.ndarray] = []
        rounded = lambda numbers: UNIT_ROUNDOFF * rng.uniform(-1.0, 1.0, np.shape(numbers)) * np.abs(numbers)  # noqa: E731
        every = lambda parts: {key: rounded(own) for key, own in parts.items()}  # noqa: E731
        for _ in range(PROBES):
            off = every({body: own for body, own in accelerations.items() if body >= 0})
            rows = self._rows(every(rates), every(accelerations), still=True)
            found, carried = self.articulated.response(condensed(self.subsystem, rounded(tau)), every(forces), off)
            multipliers = self._solved_multipliers(self._rows(found, carried, still=True) - rows)
            squares.append(self._all_rates(*self.under_multipliers(found, carried, multipliers), still=True) ** 2)
        return ROUNDOFF_MARGIN * np.array([np.sqrt(total / PROBES) for total in np.asarray(sum(squares))])

    def _accelerations(self, iterate: RefinedIterate) -> dict[int, np.ndarray]:
        """Acceleration (6,) of every link, less gravity."""
        found = {-1: self.tree.ground}
        for body, deviation in iterate.deviations.items():
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

    def _solved_multipliers(self, residual) -> np.ndarray:
        """Solution y of K M⁻¹ Kᵀ y = residual."""
        return self.scale * self.halves.solve(self.scale * residual) if self.halves is not None else np.zeros(0)


class BodyInertia(NamedTuple):
    """Inertia of a body in the axes of its link."""

    mass: Scalar  # mass [kg]
    J: np.ndarray  # J (3,), R (3, 3): principal moments [kg m²], and the rotation from link axes to principal axes
    R: np.ndarray
    c: np.ndarray  # (3,) centre of mass [m]

    def free_motion(self, omega: np.ndarray) -> np.ndarray:
        """a_free (6,) at the centre, less gravity: Euler's equations."""
        own = self.R @ omega
        torque, alpha = cross(self.J * own, own), np.zeros(3, dtype=object)
        for k, moment in enumerate(self.J):
            if as_number(moment) != 0:
                alpha[k] = torque[k] / moment
        return np.concatenate([self.R.T @ alpha, np.zeros(3)])

    def force(self, deviation: np.ndarray) -> np.ndarray:
        """Wrench (6,) Φ (a − a_free) at the origin of the link."""
        force = self.mass * deviation[3:]
        moment = (self.R.T @ (self.J[:, None] * self.R)) @ deviation[:3]
        return np.concatenate([moment + cross(self.c, force), force])


def _body(subsystem, link, body: int) -> BodyInertia:
    J, mass = subsystem.Phi[6 * body : 6 * body + 3], subsystem.Phi[6 * body + 3]
    return BodyInertia(mass, J, link.R_central, -link.R_central.T @ link.p_central)
