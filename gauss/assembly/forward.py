"""Forward dynamics of one part of a system in joint coordinates, loops and couplings included, over numbers or symbols.

The tree answers to any force; the rows that close it, K q̈ = k, are met by multipliers of the small system K M⁻¹ Kᵀ. It is
regularised and iterated to the unregularised one (proximal, Carpentier, Budhiraja, Mansard, RSS 2021), so that redundant
consistent rows do no harm and the same operations serve every state.
"""

import numpy as np

from gauss.assembly.articulated import Articulated
from gauss.assembly.closing import Closing
from gauss.assembly.tree import Tree
from gauss.rotations import cross
from gauss.system import Part
from gauss.tracing import LDLT

MU = 1e-8  # regularisation of rows that are measured against what they would be on free bodies
ITERATIONS = 3  # live rows, above √MU, converge by a factor of 10⁴ or more each


class Moving:
    """A part of a system in one state, eliminated once for any number of right-hand sides.

    Parameters
    ----------
    part : Part
        Any whose loops are closed by joints with a constant subspace along coordinate axes
        (see :func:`gauss.system.obstacles`).
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates; floats or expressions.
    """

    def __init__(self, part: Part, q, v):
        self.part, self.tree = part, Tree(part, q, v)
        self.articulated = Articulated(self.tree)
        self.closings = [Closing(self.tree, index, q, v) for index in part.closing]
        self.couplings = coupling_rows(part)
        self.wrenches = [closing.wrench(axis) for closing in self.closings for axis in closing.held]
        sizes = [closing.unbound(axis) for closing in self.closings for axis in closing.held]
        self.scale = 1.0 / np.sqrt(np.array(sizes + [float(row @ row) for row in self.couplings]))
        if self.scale.size:
            none = np.zeros(part.n_v)
            self.responses = [self.articulated.response(none, wrench) for wrench in self.wrenches]
            self.responses += [self.articulated.response(row) for row in self.couplings]
            rows = np.array([self._rows(*response, still=True) for response in self.responses]).T
            self.S = self.scale[:, None] * rows * self.scale
            self.factor = LDLT(self.S + MU * np.eye(len(self.S)))

    def motion(self, effort, forces=None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers of the closing rows; forces {body: (force, moment)} of the part."""
        rates, accelerations = self.articulated.motion(effort, self.pushes(effort, forces))
        return self._closed(rates, accelerations, still=False, target=0.0)

    def residual(self, rates, multipliers, effort, forces=None) -> tuple[np.ndarray, np.ndarray]:
        """What the equations of motion (n_v,) and the closing rows lack, found by inverse dynamics."""
        pushes = self.pushes(effort, forces)
        for multiplier, wrench in zip(multipliers, self.wrenches, strict=False):
            _add(pushes, wrench, -multiplier)
        ties = multipliers[len(self.wrenches) :] @ self.couplings if len(self.couplings) else 0.0
        lacking = effort - ties - self.tree.inverse_dynamics(rates, pushes)
        for closing in self.closings:
            lacking[closing.joint.v] = 0.0  # its coordinates follow from the others
        for train in self.part.trains:
            places = [self.part.joints[joint].v.start for joint in train.joints]
            lacking[places[0]] = sum(ratio * lacking[k] for ratio, k in zip(train.ratios, places, strict=True))
            lacking[places[1:]] = 0.0
        by_joint = {edge.constraint: rates[self.part.joints[edge.constraint].v] for edge in self.tree.edges}
        return lacking, -self._rows(by_joint, self.tree.accelerations(rates), still=False)

    def correction(self, lacking, gap) -> np.ndarray:
        """Change (n_v,) of the joint accelerations that makes up for a residual."""
        return self._closed(*self.articulated.response(lacking), still=True, target=gap)[0]

    def settled_rates(self, v) -> np.ndarray:
        """Rates (n_v,) nearest to v in the mass metric that meet the closing rows."""
        by_joint = {edge.constraint: v[self.part.joints[edge.constraint].v] for edge in self.tree.edges}
        return self._closed(by_joint, self.tree.carried(v), still=True, target=0.0)[0]

    def approach(self, gap, slack) -> np.ndarray:
        """Displacement (n_v,), the least in the mass metric, that undoes a gap of the closing rows.

        Parameters
        ----------
        gap, slack : ndarray, list of ndarray
            Residual of the closing rows, and what each closing joint is off along its free axes; see :func:`closure`.
        """
        at_rest = self.tree.carried(np.zeros(self.part.n_v))
        still = {edge.constraint: np.zeros(self.part.joints[edge.constraint].pair.n_v) for edge in self.tree.edges}
        displacement = self._closed(still, at_rest, still=True, target=-gap)[0]
        for closing, off in zip(self.closings, slack, strict=True):
            displacement[closing.joint.v] = displacement[closing.joint.v] + off
        return displacement

    def pushes(self, effort, forces=None) -> dict[int, np.ndarray]:
        """Force vectors on links: forces on bodies, and drives and springs of joints that close a loop."""
        pushes = {body: _to_link(self.tree.links[body], *push) for body, push in (forces or {}).items()}
        for closing in self.closings:
            for axis, force in zip(closing.free, effort[closing.joint.v], strict=True):
                _add(pushes, closing.wrench(axis), force)
        return pushes

    def _closed(self, rates, accelerations, still: bool, target):
        """Meet the closing rows by multipliers; all joint accelerations (n_v,), and the multipliers."""
        multipliers = np.zeros(0)
        if self.scale.size:
            gap = self._rows(rates, accelerations, still) - target
            multipliers = self.scale * self._multipliers(self.scale * gap)
            for multiplier, (more_rates, more) in zip(multipliers, self.responses, strict=True):
                for total, change in ((rates, more_rates), (accelerations, more)):
                    for key, part in change.items():
                        total[key] = total.get(key, 0.0) - multiplier * part
        for closing in self.closings:
            rates[closing.index] = closing.relative(accelerations, still)[closing.free]
        return self._vector(rates), multipliers

    def _multipliers(self, gap):
        """Proximal iterations for S y = gap."""
        y = self.factor.solve(gap)
        for _ in range(ITERATIONS - 1):
            y = y + self.factor.solve(gap - self.S @ y)  # on the residual of S itself: rounding in the factor does not stay
        return y

    def _rows(self, rates, accelerations, still: bool) -> np.ndarray:
        """Left side of the closing rows; zero when they are met."""
        parts = [closing.relative(accelerations, still)[closing.held] for closing in self.closings]
        return np.concatenate([*parts, self.couplings @ self._vector(rates)])

    def _vector(self, rates) -> np.ndarray:
        """All joint accelerations; zero for a joint whose acceleration is not known yet."""
        joints = self.part.joints
        return np.concatenate([rates.get(i, np.zeros(joint.pair.n_v)) for i, joint in enumerate(joints)])


def closure(part: Part, q) -> tuple[np.ndarray, list[np.ndarray]]:
    """Residual of the closing rows in position [rad, m], and what each closing joint is off along its free axes."""
    still = np.zeros(part.n_v)
    tree = Tree(part, q, still)
    gaps = [(closing, closing.gap()) for closing in (Closing(tree, index, q, still) for index in part.closing)]
    of = lambda name: q[part.joint(name).q]  # noqa: E731
    ties = [of(tie.driven) - tie.ratio * of(tie.driver) - tie.offset for tie in part.couplings]
    held = np.concatenate([np.zeros(0), *(gap[closing.held] for closing, gap in gaps), *ties])
    return held, [gap[closing.free] for closing, gap in gaps]


def coupling_rows(part: Part) -> np.ndarray:
    """Rows K (m, n_v) of K q̇ = 0: q̇_driven − ratio · q̇_driver."""
    rows = np.zeros((len(part.couplings), part.n_v))
    for row, coupling in zip(rows, part.couplings, strict=True):
        row[part.joint(coupling.driven).v] = 1.0
        row[part.joint(coupling.driver).v] = -coupling.ratio
    return rows


def _to_link(link, force, moment) -> np.ndarray:
    """Force vector in the link frame of a force through the centre of mass and a moment, in principal axes."""
    R, p = link.R_central, link.p_central
    return np.concatenate([R.T @ (moment - cross(p, force)), R.T @ force])


def _add(pushes: dict, more: dict, factor):
    for body, push in more.items():
        pushes[body] = pushes.get(body, np.zeros(6)) + factor * push
