"""Constrained forward dynamics of a subsystem: M q̈ + h + Kᵀ y = τ with K q̈ = k, over numbers or symbols.

The articulated-body algorithm solves with M; the multipliers solve S y = K M⁻¹ (τ − h) − k with S = K M⁻¹ Kᵀ, by iterations
of (S + μ) Δy = residual that converge to the unregularised solution (proximal method: Carpentier, Budhiraja, Mansard, RSS
2021). So redundant consistent constraints do no harm, and the same operations serve every state.
"""

from copy import copy
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.codegen import LDLT, as_number, entered
from gauss.dynamics.aba import ArticulatedBody
from gauss.dynamics.coupling_constraints import Couplings, RelationRows
from gauss.dynamics.loop_joints import LoopJoint
from gauss.dynamics.rnea import KinematicTree
from gauss.rotations import cross
from gauss.system import Scale, Subsystem

MU = 1e-8  # regularisation of S, whose rows are scaled to 1 on free bodies
REDUNDANT = 1e-7  # eigenvalue of the scaled S far below which multipliers are undetermined
ITERATIONS = 3  # rows with pivots above √MU converge by a factor of 10⁴ or more each


class BaumgarteFeedback(NamedTuple):
    """Accelerations −2α φ̇ − β² φ (Baumgarte 1972)."""

    rows: np.ndarray  # (m,) target of the loop constraints instead of zero
    rates: np.ndarray  # (n_v,) accelerations added to those of loop joints


class ConstrainedArticulatedBody:
    """A subsystem in one state, eliminated once for any number of right-hand sides.

    ``q``, ``v`` (n_q,), (n_v,): its coordinates and rates; floats or expressions. ``relations``: rows of its relations in
    this state, in the order of ``subsystem.relations``.

    Attributes: ``constraints``: loop constraints: loop joints, then couplings, then relations. Each has ``value``, the left
    side of its rows; ``unit_forces``, wrenches and generalised forces of a unit multiplier of each row; ``sizes``, K M⁻¹ Kᵀ
    of each row on free bodies; ``velocity_rhs``, the right side C of its velocity rows.
    """

    def __init__(self, subsystem: Subsystem, q, v, relations):
        self.subsystem, self.q = subsystem, q
        self._begin(v, relations)
        self.articulated = ArticulatedBody(self.tree)
        self.unit_forces = [force for constraint in self.constraints for force in constraint.unit_forces]
        sizes = [size for constraint in self.constraints for size in constraint.sizes]
        self.scale = np.array([1.0 / np.sqrt(size) for size in sizes] + [None], dtype=object)[:-1]
        self.velocity_rhs = np.concatenate([np.zeros(0), *(constraint.velocity_rhs for constraint in self.constraints)])

    def _begin(self, v, relations):
        """Set the rates, and what depends on them."""
        subsystem = self.subsystem
        self.tree, self.v = KinematicTree(subsystem, self.q, v), v
        self.loop_joints = [LoopJoint(self.tree, index, self.q, v) for index in subsystem.loop_joints]
        self.constraints: list[LoopJoint | Couplings | RelationRows] = [
            *self.loop_joints,
            *([Couplings(subsystem)] if subsystem.couplings else []),
            *(RelationRows(self.tree, *found) for found in zip(subsystem.relations, relations, strict=True)),
        ]

    def moving(self, v, relations) -> "ConstrainedArticulatedBody":
        """The same subsystem in the same position at other rates; what depends on the position alone is not made again."""
        found = copy(self)
        found._begin(v, relations)
        found.articulated = self.articulated.moving(found.tree)
        return found

    def eliminated(self) -> "ConstrainedArticulatedBody":
        """The same, with S factored."""
        _ = self.unit_forces and self.factor
        return self

    @cached_property
    def responses(self) -> list:
        """Accelerations M⁻¹ Kᵀ of joints and links under a unit multiplier of each row."""
        return [self.articulated.response(tau, self._with_loop_forces(wrenches, tau)) for wrenches, tau in self.unit_forces]

    @cached_property
    def S(self) -> np.ndarray:
        """K M⁻¹ Kᵀ of the scaled rows."""
        rows = np.array([self._rows(rates, links, still=True) for rates, links in self.responses]).T
        S = np.zeros(rows.shape, dtype=object)
        for i, row in enumerate(rows):
            others = np.flatnonzero(row != 0)  # sparse: most loops share no branch
            S[i, others] = self.scale[i] * row[others] * self.scale[others]
        return S

    @cached_property
    def factor(self) -> LDLT:
        """Factorisation of S + μ."""
        return LDLT(self.S + MU * np.eye(len(self.S)))

    @property
    def pivots(self) -> list:
        """Pivots of the scaled S, 1 for a row as on free bodies; small where K is near rank-deficient."""
        return [1.0 / inverse for inverse in self.factor.inverse_pivots.values()] if self.unit_forces else []

    def motion(self, tau, forces=None, feedback: BaumgarteFeedback | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers of the loop constraints.

        ``tau`` (n_v,): generalised forces. ``forces``: external forces and moments on bodies, {body: (force, moment)}.
        ``feedback``: stabilisation.
        """
        rates, accelerations = self.articulated.motion(tau, self._external_wrenches(tau, forces))
        target = 0.0 if feedback is None else feedback.rows
        found, multipliers = self._constrained(rates, accelerations, still=False, target=target)
        return found if feedback is None else found + feedback.rates, multipliers

    def velocity_residual(self) -> np.ndarray:
        """K v − C."""
        return self.along_rows(self.v) - self.velocity_rhs

    def along_rows(self, rates) -> np.ndarray:
        """K x (m,) of rates x (n_v,)."""
        return self._rows(self._by_joint(rates), self.tree.carried(rates), still=True)

    def baumgarte_feedback(self, phi, slack, alpha: float, beta: float) -> BaumgarteFeedback:
        """Accelerations −2α φ̇ − β² φ (Baumgarte 1972) for a position residual, see :meth:`position_correction`."""
        carried, residual = self.tree.carried(self.v), self.velocity_residual()
        rates = np.zeros(self.subsystem.n_v, dtype=np.result_type(float, self.v, *slack))
        for loop_joint, off in zip(self.loop_joints, slack, strict=True):
            place = loop_joint.joint.v
            rates[place] = beta**2 * off + 2.0 * alpha * (loop_joint.rates(carried, still=True) - self.v[place])
        return BaumgarteFeedback(-2.0 * alpha * residual - beta**2 * phi, rates)

    def residual(
        self, rates, multipliers, tau, forces=None, feedback: BaumgarteFeedback | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the equations of motion (n_v,), by inverse dynamics, and of the loop constraints (m,)."""
        wrenches = self._external_wrenches(tau, forces)
        tau = self._less_constraint_forces(tau, wrenches, multipliers)
        left = condensed(self.subsystem, tau - self.tree.inverse_dynamics(rates, wrenches))
        return left, self.acceleration_residual(rates, feedback)

    def acceleration_residual(self, rates, feedback: BaumgarteFeedback | None = None) -> np.ndarray:
        """Residual k − K q̈ under joint accelerations (n_v,)."""
        target = 0.0 if feedback is None else feedback.rows
        return target - self._rows(self._by_joint(rates), self.tree.accelerations(rates), still=False)

    def correction(self, residual, rows) -> np.ndarray:
        """Change (n_v,) of the joint accelerations that removes the residuals of :meth:`residual`, see :meth:`damped`."""
        return self.response(residual, self.damped(rows))[0]

    def damped(self, rows) -> np.ndarray:
        """Residual (m,) of the loop constraints without its part along rows with pivots below √MU.

        Accelerations along these are undetermined.
        """
        if not self.unit_forces:
            return rows
        S, scale = entered(self.S, rows), entered(self.scale, rows)
        factor, rows = LDLT(S + np.sqrt(MU) * np.eye(len(S))), scale * rows
        for _ in range(2):
            rows = rows - np.sqrt(MU) * factor.solve(rows)
        return rows / scale

    def response(self, tau, target) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n_v,) x and multipliers y with M x + Kᵀ y = tau and K x = target."""
        rates, accelerations = self.articulated.response(tau, self._with_loop_forces({}, tau))
        return self._constrained(rates, accelerations, still=True, target=target)

    def released(self, tau, multipliers) -> np.ndarray:
        """Rates (n_v,) x with M x + Kᵀ y = tau for given multipliers y."""
        rates, accelerations = self.articulated.response(tau, self._with_loop_forces({}, tau))
        return self._all_rates(*self.under_multipliers(rates, accelerations, multipliers), still=True)

    def unprojected(self, residual, rows) -> np.ndarray:
        """Rates (n_v,) to which those that meet K x = rows and are :meth:`nearest` are the correction of residuals."""
        return self.released(residual, np.zeros(len(rows)))

    def determined(self, multipliers) -> np.ndarray:
        """Multipliers without their part along redundant rows, which is undetermined: S (S + ν)⁻¹ y if scaled."""
        if not self.unit_forces:
            return multipliers
        y = multipliers / self.scale
        return self.scale * (y - REDUNDANT * LDLT(self.S + REDUNDANT * np.eye(len(self.S))).solve(y))

    def reaction(self, multipliers) -> np.ndarray:
        """Generalised forces (n_v,) of the constraints, −Kᵀ y."""
        wrenches: dict[int, np.ndarray] = {}
        tau = self._less_constraint_forces(np.zeros(self.subsystem.n_v, dtype=object), wrenches, multipliers)
        return condensed(self.subsystem, tau + self.tree.projected(wrenches))

    def along_tree(self, tau) -> np.ndarray:
        """Generalised forces (n_v,) along the independent coordinates, with those of loop joints carried inward."""
        return condensed(self.subsystem, tau + self.tree.projected(self._with_loop_forces({}, tau)))

    def dependent_accelerations(self, rates) -> np.ndarray:
        """Joint accelerations (n_v,), with those of loop joints replaced by those that follow from the tree."""
        return self._all_rates(self._by_joint(rates), self.tree.accelerations(rates), still=False)

    def dependent_rates(self) -> np.ndarray:
        """Rates (n_v,), with those of loop joints replaced by those that follow from the tree."""
        return self._all_rates(self._by_joint(self.v), self.tree.carried(self.v), still=True)

    def nearest(self, v, target) -> np.ndarray:
        """Rates x (n_v,) nearest to v in the mass metric with K x = target."""
        return self._constrained(self._by_joint(v), self.tree.carried(v), still=True, target=target)[0]

    def position_correction(self, phi, slack) -> np.ndarray:
        """Newton step (n_v,), the least in the mass metric, on the position residual.

        ``phi``, ``slack``: residual of the rows, and coordinate errors of each loop joint; see :func:`loop_residual`.
        """
        multipliers = self.factor.solve(self.scale * phi) if self.unit_forces else ()  # Newton's steps refine, too
        return self._with_slack(
            self._all_rates(*self.under_multipliers({}, {}, self.scale * multipliers), still=True), slack
        )

    def _with_slack(self, step, slack) -> np.ndarray:
        """Displacement (n_v,) with the errors of the coordinates of loop joints added."""
        step = step.astype(np.result_type(step, *slack))  # numbers where no loop is closed
        for loop_joint, off in zip(self.loop_joints, slack, strict=True):
            step[loop_joint.joint.v] = step[loop_joint.joint.v] + off
        return step

    def under_multipliers(self, rates, accelerations, multipliers) -> tuple[dict, dict]:
        """Accelerations of tree joints and of links with the constraint forces −Kᵀ y added."""
        rates, accelerations = dict(rates), dict(accelerations)
        for multiplier, (more_rates, more) in zip(multipliers, self.responses if self.unit_forces else (), strict=True):
            for total, change in ((rates, more_rates), (accelerations, more)):
                for key, own in change.items():
                    total[key] = total.get(key, 0.0) - multiplier * own
        return rates, accelerations

    def _less_constraint_forces(self, tau, wrenches: dict, multipliers) -> np.ndarray:
        """Generalised forces less the constraint forces Kᵀ y; their wrenches on links are subtracted in place."""
        for multiplier, (more, along) in zip(multipliers, self.unit_forces, strict=True):
            add_to(wrenches, self._with_loop_forces(more, along), -multiplier)
            tau = tau - multiplier * along
        return tau

    def _external_wrenches(self, tau, forces) -> dict[int, np.ndarray]:
        """Wrenches on links: of forces on bodies, and of generalised forces of loop joints."""
        wrenches = {body: _to_link(self.tree.links[body], *force) for body, force in (forces or {}).items()}
        return self._with_loop_forces(wrenches, tau)

    def _with_loop_forces(self, wrenches, tau) -> dict[int, np.ndarray]:
        """Wrenches, with those of generalised forces along loop joints added."""
        wrenches = dict(wrenches)
        if tau.dtype != object and not tau.any():
            return wrenches
        for loop_joint in self.loop_joints:
            for direction, force in zip(loop_joint.free.T, tau[loop_joint.joint.v], strict=True):
                if as_number(force) != 0:
                    add_to(wrenches, loop_joint.wrench(direction), force)
        return wrenches

    def _constrained(self, rates, accelerations, still: bool, target):
        """Joint accelerations (n_v,) that meet the loop constraints, and the multipliers."""
        multipliers = np.zeros(0)
        if self.unit_forces:
            residual = self._rows(rates, accelerations, still) - target
            multipliers = self.scale * self._multipliers(self.scale * residual)
        return self._all_rates(*self.under_multipliers(rates, accelerations, multipliers), still), multipliers

    def _multipliers(self, residual):
        """Proximal iterations for S y = residual."""
        y, columns = self.factor.solve(residual), [np.flatnonzero(row != 0) for row in self.S]
        for _ in range(ITERATIONS - 1):
            found = np.array([row[others] @ y[others] for row, others in zip(self.S, columns, strict=True)])
            y = y + self.factor.solve(residual - found)  # on the residual of S: round-off of the factor does not stay
        return y

    def _rows(self, rates, accelerations, still: bool) -> np.ndarray:
        """K q̈ − k, or K v if ``still``."""
        if len(self.constraints) > len(self.loop_joints):  # rows of loop joints depend on links alone
            rates = self._all_rates(rates, accelerations, still)
        return np.concatenate([np.zeros(0), *(group.value(rates, accelerations, still) for group in self.constraints)])

    def _all_rates(self, rates, accelerations, still: bool) -> np.ndarray:
        """All joint accelerations (n_v,); those of loop joints follow from the links."""
        joints = self.subsystem.joints
        parts = [rates.get(i, np.zeros(joint.pair.n_v)) for i, joint in enumerate(joints)]
        for loop_joint in self.loop_joints:
            parts[loop_joint.index] = loop_joint.rates(accelerations, still)
        return np.concatenate(parts)

    def _by_joint(self, rates) -> dict[int, np.ndarray]:
        return {edge.constraint: rates[self.subsystem.joints[edge.constraint].v] for edge in self.tree.edges}


def loop_residual(subsystem: Subsystem, q, relations) -> tuple[np.ndarray, list[np.ndarray]]:
    """Position residual φ of the loop constraints [rad, m], and errors of the coordinates of each loop joint.

    Relations are given by their rows in this position, in the order of ``subsystem.relations``.
    """
    still = np.zeros(subsystem.n_v)
    tree = KinematicTree(subsystem, q, still)
    errors = [(joint, joint.position_error()) for joint in _loop_joints(tree, q, still)]
    of = lambda name: q[subsystem.joint(name).q]  # noqa: E731
    couplings = [of(c.driven) - c.ratio * of(c.driver) - c.offset for c in subsystem.couplings]
    held = [*(joint.held.T @ error for joint, error in errors), *couplings, *(rows.gap for rows in relations)]
    return np.concatenate([np.zeros(0), *held]), [joint.free.T @ error for joint, error in errors]


def _loop_joints(tree: KinematicTree, q, v) -> list[LoopJoint]:
    return [LoopJoint(tree, index, q, v) for index in tree.subsystem.loop_joints]


def loop_constraint_scales(subsystem: Subsystem, q, scale: Scale, relations) -> np.ndarray:
    """Sizes of the rows of :func:`loop_residual`: the length of the scene for distances, 1 for angles.

    Those of relations are given, in the order of ``subsystem.relations``.
    """
    still = np.zeros(subsystem.n_v)
    tree = KinematicTree(subsystem, q, still)
    held = [direction for joint in _loop_joints(tree, q, still) for direction in joint.held.T]
    joints = [scale.length if direction[3:].any() else 1.0 for direction in held]
    couplings = [scale.coordinates[subsystem.v][subsystem.joint(c.driven).v] for c in subsystem.couplings]
    return np.concatenate([joints, *couplings, *relations])


def condensed(subsystem: Subsystem, tau) -> np.ndarray:
    """Generalised forces (n_v,) along the independent coordinates: those of a gear train along its first joint."""
    tau = tau.copy()
    for index in subsystem.loop_joints:
        tau[subsystem.joints[index].v] = 0.0  # dependent coordinates
    for train in subsystem.trains:
        places = [subsystem.joints[joint].v.start for joint in train.joints]
        tau[places[0]] = sum(ratio * tau[k] for ratio, k in zip(train.ratios, places, strict=True))
        tau[places[1:]] = 0.0
    return tau


def _to_link(link, force, moment) -> np.ndarray:
    """Wrench in the link frame of a force through the centre of mass and a moment, in principal axes."""
    R, p = link.R_central, link.p_central
    return np.concatenate([R.T @ (moment - cross(p, force)), R.T @ force])


def add_to(wrenches: dict, more: dict, factor):
    """Add wrenches on links, times a factor."""
    for body, wrench in more.items():
        wrenches[body] = wrenches.get(body, np.zeros(6)) + factor * wrench
