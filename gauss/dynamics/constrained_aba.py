"""Forward dynamics of one part of a system in joint coordinates, with all its constraints, over numbers or symbols.

The tree answers to any force; the rows that close it, K q̈ = k, are met by multipliers of the small system K M⁻¹ Kᵀ. It is
regularised and iterated to the unregularised one (proximal, Carpentier, Budhiraja, Mansard, RSS 2021), so that redundant
consistent rows do no harm and the same operations serve every state.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.codegen import LDLT, as_number
from gauss.dynamics.aba import ArticulatedBody
from gauss.dynamics.coupling_constraints import Couplings, RelationRows
from gauss.dynamics.loop_joints import LoopJoint
from gauss.dynamics.rnea import KinematicTree
from gauss.rotations import cross
from gauss.system import Scale, Subsystem

MU = 1e-8  # regularisation of rows that are measured against what they would be on free bodies
REDUNDANT = 1e-7  # eigenvalue of S, 1 for rows that bind as on free bodies, far below which multipliers are not determined
ITERATIONS = 3  # live rows, above √MU, converge by a factor of 10⁴ or more each


class BaumgarteFeedback(NamedTuple):
    """Accelerations that draw a state back to the constraints.

    Attributes
    ----------
    rows : ndarray, shape (m,)
        What the closing rows are set to instead of zero.
    rates : ndarray, shape (n_v,)
        What is added to the accelerations of joints that close loops.
    """

    rows: np.ndarray
    rates: np.ndarray


class ConstrainedArticulatedBody:
    """A part of a system in one state, eliminated once for any number of right-hand sides.

    Parameters
    ----------
    part : Subsystem
        The part.
    q, v : ndarray, shape (n_q,), (n_v,)
        Its coordinates and rates; floats or expressions.
    relations : sequence of Rows
        Rows of the relations that bind it in this state, in the order of ``part.relations``.

    Attributes
    ----------
    groups : list
        Closing rows: joints that close loops, then couplings, then relations. Each has ``value``, the left side of its rows;
        ``actions``, force vectors and generalised forces that a unit multiplier of each row stands for; ``sizes``, what
        each row is measured against; ``moving``, the right side C of its rows of velocities.
    """

    def __init__(self, part: Subsystem, q, v, relations):
        self.part, self.tree, self.v = part, KinematicTree(part, q, v), v
        self.articulated = ArticulatedBody(self.tree)
        self.closed = [LoopJoint(self.tree, index, q, v) for index in part.closing]
        self.groups = [
            *self.closed,
            *([Couplings(part)] if part.couplings else []),
            *(RelationRows(self.tree, *found) for found in zip(part.relations, relations, strict=True)),
        ]
        self.actions = [action for group in self.groups for action in group.actions]
        sizes = [size for group in self.groups for size in group.sizes]
        self.scale = np.array([1.0 / np.sqrt(size) for size in sizes] + [None], dtype=object)[:-1]
        self.moving = np.concatenate([np.zeros(0), *(group.moving for group in self.groups)])

    @cached_property
    def responses(self) -> list:
        """Accelerations of joints and links under the action of each row."""
        return [self.articulated.response(effort, self._with_closed(pushes, effort)) for pushes, effort in self.actions]

    @cached_property
    def S(self) -> np.ndarray:
        """K M⁻¹ Kᵀ of the scaled rows."""
        rows = np.array([self._rows(*response, still=True) for response in self.responses]).T
        S = np.zeros(rows.shape, dtype=object)
        for i, row in enumerate(rows):
            others = np.flatnonzero(row != 0)  # most rows feel few of the others
            S[i, others] = self.scale[i] * row[others] * self.scale[others]
        return S

    @cached_property
    def factor(self) -> LDLT:
        """Factorisation of S, regularised."""
        return LDLT(self.S + MU * np.eye(len(self.S)))

    @property
    def pivots(self) -> list:
        """Pivots of the closing rows, 1 where a row binds as on free bodies; small near configurations where rows fade."""
        return [1.0 / inverse for inverse in self.factor.inverse_pivots.values()] if self.actions else []

    def motion(self, effort, forces=None, pull: "BaumgarteFeedback | None" = None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers of the closing rows; forces {body: (force, moment)} of the part."""
        rates, accelerations = self.articulated.motion(effort, self._pushes(effort, forces))
        found, multipliers = self._closed(rates, accelerations, still=False, target=0.0 if pull is None else pull.rows)
        return found if pull is None else found + pull.rates, multipliers

    def slip(self) -> np.ndarray:
        """By how much the rates miss the closing rows, K v − C."""
        return self._rows(self._by_joint(self.v), self.tree.carried(self.v), still=True) - self.moving

    def pull(self, gap, slack, alpha: float, beta: float) -> "BaumgarteFeedback":
        """Accelerations −2α ċ − β² c (Baumgarte 1972) that draw a state back from a gap c, see :meth:`approach`."""
        carried, slip = self.tree.carried(self.v), self.slip()
        rates = np.zeros(self.part.n_v, dtype=np.result_type(float, self.v, *slack))
        for closed, off in zip(self.closed, slack, strict=True):
            place = closed.joint.v
            rates[place] = beta**2 * off + 2.0 * alpha * (closed.rates(carried, still=True) - self.v[place])
        return BaumgarteFeedback(-2.0 * alpha * slip - beta**2 * gap, rates)

    def residual(
        self, rates, multipliers, effort, forces=None, pull: "BaumgarteFeedback | None" = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """What the equations of motion (n_v,) and the closing rows lack, found by inverse dynamics."""
        pushes = self._pushes(effort, forces)
        for multiplier, (more, along) in zip(multipliers, self.actions, strict=True):
            add_to(pushes, self._with_closed(more, along), -multiplier)
            effort = effort - multiplier * along
        lacking = condensed(self.part, effort - self.tree.inverse_dynamics(rates, pushes))
        return lacking, self.gap(rates, pull)

    def gap(self, rates, pull: "BaumgarteFeedback | None" = None) -> np.ndarray:
        """What the closing rows lack under joint accelerations (n_v,)."""
        target = 0.0 if pull is None else pull.rows
        return target - self._rows(self._by_joint(rates), self.tree.accelerations(rates), still=False)

    def correction(self, lacking, gap) -> np.ndarray:
        """Change (n_v,) of the joint accelerations that makes up for a residual.

        Rows below √MU hold so little that accelerations along them are not determined: what these lack does not count.
        """
        if self.actions:
            damped, gap = LDLT(self.S + np.sqrt(MU) * np.eye(len(self.S))), self.scale * gap
            for _ in range(2):
                gap = gap - np.sqrt(MU) * damped.solve(gap)
            gap = gap / self.scale
        return self.response(lacking, gap)[0]

    def response(self, effort, target) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n_v,) x and multipliers y with M x + Kᵀ y = effort and K x = target."""
        return self._closed(*self.articulated.response(effort, self._with_closed({}, effort)), still=True, target=target)

    def released(self, effort, multipliers) -> np.ndarray:
        """Rates (n_v,) x with M x + Kᵀ y = effort for given multipliers y."""
        return self._pulled(*self.articulated.response(effort, self._with_closed({}, effort)), multipliers, still=True)

    def determined(self, multipliers) -> np.ndarray:
        """Multipliers without their part along redundant rows, which nothing determines: S (S + ν)⁻¹ y if scaled."""
        if not self.actions:
            return multipliers
        y = multipliers / self.scale
        return self.scale * (y - REDUNDANT * LDLT(self.S + REDUNDANT * np.eye(len(self.S))).solve(y))

    def reaction(self, multipliers) -> np.ndarray:
        """Generalised forces (n_v,) of the constraints, −Kᵀ y."""
        effort, pushes = np.zeros(self.part.n_v, dtype=object), {}
        for multiplier, (more, along) in zip(multipliers, self.actions, strict=True):
            add_to(pushes, self._with_closed(more, along), -multiplier)
            effort = effort - multiplier * along
        return condensed(self.part, effort + self.tree.projected(pushes))

    def following(self, rates) -> np.ndarray:
        """Joint accelerations (n_v,): those of the tree as they are, those of closing joints as they follow from them."""
        return self._all_rates(self._by_joint(rates), self.tree.accelerations(rates), still=False)

    def carried_along(self) -> np.ndarray:
        """Rates (n_v,): those of the tree as they are, those of closing joints as they follow from them."""
        return self._all_rates(self._by_joint(self.v), self.tree.carried(self.v), still=True)

    def projected_rates(self, v) -> np.ndarray:
        """Rates (n_v,) nearest to v in the mass metric that meet the closing rows."""
        return self._closed(self._by_joint(v), self.tree.carried(v), still=True, target=self.moving)[0]

    def along(self, v) -> np.ndarray:
        """What of rates (n_v,) is along the closing rows, the rest being orthogonal to it in the mass metric."""
        return self._closed(self._by_joint(v), self.tree.carried(v), still=True, target=0.0)[0]

    def approach(self, gap, slack) -> np.ndarray:
        """Displacement (n_v,), the least in the mass metric, that undoes a gap of the closing rows.

        Parameters
        ----------
        gap, slack : ndarray, list of ndarray
            Residual of the closing rows, and what each closing joint is off along its free axes; see :func:`closure`.
        """
        multipliers = self.factor.solve(self.scale * gap) if self.actions else ()  # the steps of Newton's method iterate
        displacement = self._pulled({}, {}, self.scale * multipliers, still=True)
        displacement = displacement.astype(np.result_type(displacement, *slack))  # numbers if no row closes
        for closed, part in zip(self.closed, slack, strict=True):
            displacement[closed.joint.v] = displacement[closed.joint.v] + part
        return displacement

    def _pushes(self, effort, forces) -> dict[int, np.ndarray]:
        """Force vectors on links: forces on bodies, and generalised forces of joints that close a loop."""
        pushes = {body: _to_link(self.tree.links[body], *push) for body, push in (forces or {}).items()}
        return self._with_closed(pushes, effort)

    def _with_closed(self, pushes, effort) -> dict[int, np.ndarray]:
        """Force vectors with those that generalised forces along closing joints amount to."""
        pushes = dict(pushes)
        if effort.dtype != object and not effort.any():
            return pushes
        for closed in self.closed:
            for direction, force in zip(closed.free.T, effort[closed.joint.v], strict=True):
                if as_number(force) != 0:
                    add_to(pushes, closed.wrench(direction), force)
        return pushes

    def _closed(self, rates, accelerations, still: bool, target):
        """Meet the closing rows by multipliers; all joint accelerations (n_v,), and the multipliers."""
        multipliers = np.zeros(0)
        if self.actions:
            gap = self._rows(rates, accelerations, still) - target
            multipliers = self.scale * self._multipliers(self.scale * gap)
        return self._pulled(rates, accelerations, multipliers, still), multipliers

    def _pulled(self, rates, accelerations, multipliers, still: bool) -> np.ndarray:
        """All joint accelerations (n_v,) once multipliers act."""
        return self._all_rates(*self.moved(rates, accelerations, multipliers), still)

    def moved(self, rates, accelerations, multipliers) -> tuple[dict, dict]:
        """Accelerations of joints of the tree and of links once multipliers act."""
        rates, accelerations = dict(rates), dict(accelerations)
        for multiplier, (more_rates, more) in zip(multipliers, self.responses if self.actions else (), strict=True):
            for total, change in ((rates, more_rates), (accelerations, more)):
                for key, part in change.items():
                    total[key] = total.get(key, 0.0) - multiplier * part
        return rates, accelerations

    def _multipliers(self, gap):
        """Proximal iterations for S y = gap."""
        y, felt = self.factor.solve(gap), [np.flatnonzero(row != 0) for row in self.S]
        for _ in range(ITERATIONS - 1):
            found = np.array([row[others] @ y[others] for row, others in zip(self.S, felt, strict=True)])
            y = y + self.factor.solve(gap - found)  # on the residual of S: rounding in the factor does not stay
        return y

    def _rows(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the closing rows less the right; zero when they are met."""
        if len(self.groups) > len(self.closed):  # closing joints are told by the links alone
            rates = self._all_rates(rates, accelerations, still)
        return np.concatenate([np.zeros(0), *(group.value(rates, accelerations, still) for group in self.groups)])

    def _all_rates(self, rates, accelerations, still: bool) -> np.ndarray:
        """All joint accelerations (n_v,); those of joints that close loops follow from the links."""
        joints = self.part.joints
        parts = [rates.get(i, np.zeros(joint.pair.n_v)) for i, joint in enumerate(joints)]
        for closed in self.closed:
            parts[closed.index] = closed.rates(accelerations, still)
        return np.concatenate(parts)

    def _by_joint(self, rates) -> dict[int, np.ndarray]:
        return {edge.constraint: rates[self.part.joints[edge.constraint].v] for edge in self.tree.edges}


def closure(part: Subsystem, q, relations) -> tuple[np.ndarray, list[np.ndarray]]:
    """Residual of the closing rows in position [rad, m], and what each closing joint is off along its free axes.

    Relations are given by their rows in this position, in the order of ``part.relations``.
    """
    still = np.zeros(part.n_v)
    tree = KinematicTree(part, q, still)
    gaps = [(closed, closed.gap()) for closed in (LoopJoint(tree, index, q, still) for index in part.closing)]
    of = lambda name: q[part.joint(name).q]  # noqa: E731
    ties = [of(tie.driven) - tie.ratio * of(tie.driver) - tie.offset for tie in part.couplings]
    held = [*(closed.held.T @ gap for closed, gap in gaps), *ties, *(rows.gap for rows in relations)]
    return np.concatenate([np.zeros(0), *held]), [closed.free.T @ gap for closed, gap in gaps]


def loop_constraint_scales(part: Subsystem, q, scale: Scale, relations) -> np.ndarray:
    """Sizes of the rows of :func:`closure`: the length of the scene of those that are distances, one of angles.

    Those of the rows of relations are given, in the order of ``part.relations``.
    """
    still = np.zeros(part.n_v)
    tree = KinematicTree(part, q, still)
    held = [direction for index in part.closing for direction in LoopJoint(tree, index, q, still).held.T]
    joints = [scale.length if direction[3:].any() else 1.0 for direction in held]
    ties = [scale.coordinates[part.v][part.joint(tie.driven).v] for tie in part.couplings]
    return np.concatenate([joints, *ties, *relations])


def condensed(part: Subsystem, effort) -> np.ndarray:
    """Generalised forces (n_v,) along the coordinates that are free: of a train all act along its first joint's."""
    effort = effort.copy()
    for index in part.closing:
        effort[part.joints[index].v] = 0.0  # its coordinates follow from the others
    for train in part.trains:
        places = [part.joints[joint].v.start for joint in train.joints]
        effort[places[0]] = sum(ratio * effort[k] for ratio, k in zip(train.ratios, places, strict=True))
        effort[places[1:]] = 0.0
    return effort


def _to_link(link, force, moment) -> np.ndarray:
    """Force vector in the link frame of a force through the centre of mass and a moment, in principal axes."""
    R, p = link.R_central, link.p_central
    return np.concatenate([R.T @ (moment - cross(p, force)), R.T @ force])


def add_to(pushes: dict, more: dict, factor):
    """Add force vectors on links, times a factor."""
    for body, push in more.items():
        pushes[body] = pushes.get(body, np.zeros(6)) + factor * push
