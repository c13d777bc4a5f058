"""Forward dynamics in joint coordinates, loops and couplings included, over numbers or symbols.

The tree answers to any force; the rows that close it, K q̈ = k, are met by multipliers of the small system K M⁻¹ Kᵀ. It is
regularised and iterated to the unregularised one (proximal, Carpentier, Budhiraja, Mansard, RSS 2021), so that redundant
consistent rows do no harm and the same operations serve every state.
"""

import numpy as np

from gauss.assembly.articulated import Articulated
from gauss.assembly.closing import Closing
from gauss.assembly.tree import Tree
from gauss.rotations import cross
from gauss.system import System
from gauss.tracing import LDLT

MU = 1e-8  # regularisation of rows that are measured against what they would be on free bodies
ITERATIONS = 3  # live rows, above √MU, converge by a factor of 10⁴ or more each


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
    return Mechanism(system, q, v).motion(effort, forces)[0]


class Mechanism:
    """A system in one state, eliminated once for any number of right-hand sides.

    Parameters
    ----------
    system : System
        The system.
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates; floats or expressions.
    """

    def __init__(self, system: System, q, v):
        self.system, self.tree = system, Tree(system, q, v)
        self.articulated = Articulated(self.tree)
        joints = [system.joints[i] for i in system.structure.closures if i < len(system.joints)]
        self.closings = [Closing(self.tree, joint, q, v) for joint in joints]
        self.couplings = coupling_rows(system)
        self.wrenches = [closing.wrench(axis) for closing in self.closings for axis in closing.held]
        sizes = [closing.unbound(axis) for closing in self.closings for axis in closing.held]
        self.scale = 1.0 / np.sqrt(np.array(sizes + [float(row @ row) for row in self.couplings]))
        if self.scale.size:
            none = np.zeros(system.n_v)
            self.responses = [self.articulated.response(none, wrench) for wrench in self.wrenches]
            self.responses += [self.articulated.response(row) for row in self.couplings]
            rows = np.array([self._rows(*response, still=True) for response in self.responses]).T
            self.S = self.scale[:, None] * rows * self.scale
            self.factor = LDLT(self.S + MU * np.eye(len(self.S)))

    def motion(self, effort, forces=None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers of the closing rows; forces as in :func:`forward_dynamics`."""
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
        by_joint = {edge.constraint: rates[self.system.joints[edge.constraint].v] for edge in self.tree.edges}
        return lacking, -self._rows(by_joint, self.tree.accelerations(rates), still=False)

    def correction(self, lacking, gap) -> np.ndarray:
        """Change (n_v,) of the joint accelerations that makes up for a residual."""
        return self._closed(*self.articulated.response(lacking), still=True, target=gap)[0]

    def settled_rates(self, v) -> np.ndarray:
        """Rates (n_v,) nearest to v in the mass metric that meet the closing rows."""
        by_joint = {edge.constraint: v[self.system.joints[edge.constraint].v] for edge in self.tree.edges}
        return self._closed(by_joint, self.tree.carried(v), still=True, target=0.0)[0]

    def approach(self, gap, slack) -> np.ndarray:
        """Displacement (n_v,), the least in the mass metric, that undoes a gap of the closing rows.

        Parameters
        ----------
        gap, slack : ndarray, list of ndarray
            Residual of the closing rows, and what each closing joint is off along its free axes; see :func:`closure`.
        """
        at_rest = self.tree.carried(np.zeros(self.system.n_v))
        still = {edge.constraint: np.zeros(self.system.joints[edge.constraint].pair.n_v) for edge in self.tree.edges}
        displacement = self._closed(still, at_rest, still=True, target=-gap)[0]
        for closing, part in zip(self.closings, slack, strict=True):
            displacement[closing.joint.v] = displacement[closing.joint.v] + part
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
            index = self.system.joints.index(closing.joint)
            rates[index] = closing.relative(accelerations, still)[closing.free]
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
        joints = self.system.joints
        return np.concatenate([rates.get(i, np.zeros(joint.pair.n_v)) for i, joint in enumerate(joints)])


def closure(system: System, q) -> tuple[np.ndarray, list[np.ndarray]]:
    """Residual of the closing rows in position [rad, m], and what each closing joint is off along its free axes."""
    still = np.zeros(system.n_v)
    tree = Tree(system, q, still)
    joints = [system.joints[i] for i in system.structure.closures if i < len(system.joints)]
    closings = [Closing(tree, joint, q, still) for joint in joints]
    parts = [(closing, closing.gap()) for closing in closings]
    of = lambda name: q[system.joint(name).q]  # noqa: E731
    ties = [of(tie.driven) - tie.ratio * of(tie.driver) - tie.offset for tie in system.scene.couplings.values()]
    held = np.concatenate([*(gap[closing.held] for closing, gap in parts), *ties])
    return held, [gap[closing.free] for closing, gap in parts]


def coupling_rows(system: System) -> np.ndarray:
    """Rows K (m, n_v) of K q̇ = 0: q̇_driven − ratio · q̇_driver."""
    rows = np.zeros((len(system.scene.couplings), system.n_v))
    for row, coupling in zip(rows, system.scene.couplings.values(), strict=True):
        row[system.joint(coupling.driven).v] = 1.0
        row[system.joint(coupling.driver).v] = -coupling.ratio
    return rows


def _to_link(link, force, moment) -> np.ndarray:
    """Force vector in the link frame of a force through the centre of mass and a moment, in principal axes."""
    R, p = link.R_central, link.p_central
    return np.concatenate([R.T @ (moment - cross(p, force)), R.T @ force])


def _add(pushes: dict, more: dict, factor):
    for body, push in more.items():
        pushes[body] = pushes.get(body, np.zeros(6)) + factor * push
