"""Forward dynamics of a system in its joint coordinates: its parts, each by itself, over numbers or symbols."""

import numpy as np

from gauss.codegen import Scalar
from gauss.dynamics import constrained_aba as forward
from gauss.dynamics.constrained_aba import BaumgarteFeedback, Moving
from gauss.dynamics.constraint_scales import kept_sizes
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.refined_dynamics import Found, RefinedForwardDynamics
from gauss.dynamics.rnea import Tree
from gauss.rotations import cross
from gauss.system import State, Subsystem, System, retract, whole

TRACKING = 3  # corrections of coordinates that follow: an angle δ is off by δ³/6 after one


def forward_dynamics(system: System, q, v, effort, forces=None, t: Scalar = 0.0) -> np.ndarray:
    """Joint accelerations (n_v,) under gravity and generalised forces.

    Parameters
    ----------
    system : System
        Any without obstacles (see :func:`gauss.dynamics.conditions.obstacles`).
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates that meet the constraints; floats or expressions.
    effort : ndarray, shape (n_v,)
        Generalised forces along the rates.
    forces : dict, optional
        Force [N] and moment about the centre of mass [N m] on bodies, {body: (force, moment)} in principal axes.
    t : float
        Time [s], for constraints that move.
    """
    return Mechanism(system, q, v, t).motion(effort, forces)[0]


class Mechanism:
    """A system in one state, eliminated once for any number of right-hand sides; vectors are those of the system.

    Parameters
    ----------
    system : System
        The system.
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates; floats or expressions.
    t : float
        Time [s].
    parts : sequence of Subsystem, optional
        What is stepped; the parts of the system unless a stage of its reduction is asked for.
    """

    def __init__(self, system: System, q, v, t: Scalar = 0.0, parts=None):
        relations = _relations(system, State(t, q, v))
        self.system = system
        self.parts = [
            Moving(part, q[part.q], v[part.v], [relations[r.index] for r in part.relations])
            for part in (system.parts if parts is None else parts)
        ]

    def motion(self, effort, forces=None, pulls: list[BaumgarteFeedback] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers of the closing rows.

        Parameters
        ----------
        effort, forces
            As in :func:`forward_dynamics`.
        pulls : list of BaumgarteFeedback, optional
            What draws each part back to its constraints.
        """
        found = [
            moving.motion(effort[moving.part.v], _carried(moving.part, forces), pull)
            for moving, pull in zip(self.parts, self._each(pulls), strict=True)
        ]
        return self._whole([rates for rates, _ in found]), _joined([multipliers for _, multipliers in found])

    def pulls(self, gap, slack, alpha: float, beta: float) -> list[BaumgarteFeedback]:
        """Accelerations −2α ċ − β² c that draw each part back from a gap c, see :func:`closure`."""
        triples = zip(self.parts, self._rows_of(gap), slack, strict=True)
        return [moving.pull(own, off, alpha, beta) for moving, own, off in triples]

    def residual(self, rates, multipliers, effort, forces=None, pulls=None) -> tuple[np.ndarray, np.ndarray]:
        """What the equations of motion (n_v,) and the closing rows lack, found by inverse dynamics."""
        found = [
            moving.residual(rates[moving.part.v], own, effort[moving.part.v], _carried(moving.part, forces), pull)
            for moving, own, pull in zip(self.parts, self._rows_of(multipliers), self._each(pulls), strict=True)
        ]
        return self._whole([lacking for lacking, _ in found]), _joined([gap for _, gap in found])

    def gap(self, rates, pulls=None) -> np.ndarray:
        """What the closing rows lack under joint accelerations (n_v,)."""
        pairs = zip(self.parts, self._each(pulls), strict=True)
        return _joined([moving.gap(rates[moving.part.v], pull) for moving, pull in pairs])

    def correction(self, lacking, gap) -> np.ndarray:
        """Change (n_v,) of the joint accelerations that makes up for a residual."""
        pairs = zip(self.parts, self._rows_of(gap), strict=True)
        return self._whole([moving.correction(lacking[moving.part.v], own) for moving, own in pairs])

    def following(self, rates) -> np.ndarray:
        """Joint accelerations (n_v,): those of the trees as they are, those of closing joints as they follow from them."""
        return self._whole([moving.following(rates[moving.part.v]) for moving in self.parts])

    def response(self, effort, target) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n_v,) x and multipliers y with M x + Kᵀ y = effort and K x = target; the moving right side C if None."""
        found = [
            moving.response(effort[moving.part.v], moving.moving if target is None else own)
            for moving, own in zip(self.parts, self._rows_of(self.moving if target is None else target), strict=True)
        ]
        return self._whole([rates for rates, _ in found]), _joined([multipliers for _, multipliers in found])

    def released(self, effort, multipliers) -> np.ndarray:
        """Rates (n_v,) x with M x + Kᵀ y = effort for given multipliers y."""
        pairs = zip(self.parts, self._rows_of(multipliers), strict=True)
        return self._whole([moving.released(effort[moving.part.v], own) for moving, own in pairs])

    def determined(self, multipliers) -> np.ndarray:
        """Multipliers without their part along redundant rows, which no motion determines."""
        pairs = zip(self.parts, self._rows_of(multipliers), strict=True)
        return _joined([moving.determined(own) for moving, own in pairs])

    def reaction(self, multipliers) -> np.ndarray:
        """Generalised forces (n_v,) of the constraints, −Kᵀ y, along the free coordinates."""
        pairs = zip(self.parts, self._rows_of(multipliers), strict=True)
        return self._whole([moving.reaction(own) for moving, own in pairs])

    def carried_along(self) -> np.ndarray:
        """Rates (n_v,) of which those of joints that close loops follow from the others."""
        return self._whole([moving.carried_along() for moving in self.parts])

    def slip(self) -> np.ndarray:
        """By how much the rates miss the closing rows, K v − C."""
        return _joined([moving.slip() for moving in self.parts])

    def velocity(self) -> np.ndarray:
        """Left side K v of the loop constraints."""
        return self.slip() + self.moving

    @property
    def scale(self) -> np.ndarray:
        """What each closing row is multiplied with to be of the size of one."""
        return _joined([moving.scale for moving in self.parts])

    @property
    def moving(self) -> np.ndarray:
        """Right side C of the closing rows of velocities."""
        return _joined([moving.moving for moving in self.parts])

    def projected_rates(self, v) -> np.ndarray:
        """Rates (n_v,) nearest to v in the mass metric that meet the closing rows."""
        return self._whole([moving.projected_rates(v[moving.part.v]) for moving in self.parts])

    def along(self, v) -> np.ndarray:
        """What of rates (n_v,) is along the closing rows, the rest being orthogonal to it in the mass metric."""
        return self._whole([moving.along(v[moving.part.v]) for moving in self.parts])

    def power(self, multipliers) -> Scalar:
        """Power that constraints which move bring in [W]: −λᵀ C."""
        return -sum((multiplier * c for multiplier, c in zip(multipliers, self.moving, strict=True)), 0.0)

    def approach(self, gap, slack) -> np.ndarray:
        """Displacement (n_v,), the least in the mass metric, that undoes a gap of the closing rows, see :func:`closure`."""
        triples = zip(self.parts, self._rows_of(gap), slack, strict=True)
        return self._whole([moving.approach(own, off) for moving, own, off in triples])

    def _each(self, pulls):
        return [None] * len(self.parts) if pulls is None else pulls

    @property
    def pivots(self) -> list:
        """Pivots of the closing rows of all parts, see :attr:`gauss.dynamics.constrained_aba.Moving.pivots`."""
        return [pivot for moving in self.parts for pivot in moving.pivots]

    def _rows_of(self, rows) -> list[np.ndarray]:
        """Numbers that belong to the closing rows of each part."""
        ends = np.cumsum([moving.scale.size for moving in self.parts], dtype=int)
        return [rows[end - moving.scale.size : end] for moving, end in zip(self.parts, ends, strict=True)]

    def _whole(self, vectors) -> np.ndarray:
        """Vector (n_v,) of the system from those of its parts; what belongs to no part does not move."""
        return _placed(self.system, [moving.part.v for moving in self.parts], vectors)


def careful(system: System, state: State, effort, forces=None, cut: Scalar = 0.0) -> Found:
    """Joint accelerations of a system, refined to rounding, and what speaks for them; see :class:`RefinedForwardDynamics`.

    Parameters
    ----------
    system, state, effort, forces
        As of :func:`forward_dynamics`.
    cut : float or Expression
        Closing rows that add less than this share of their length to the others are left out.
    """
    relations, found, places = _relations(system, state), [], [part.v for part in system.parts]
    for part in system.parts:
        rows = [relations[r.index] for r in part.relations]
        moving = RefinedForwardDynamics(part, state.q[part.q], state.v[part.v], rows, cut)
        found.append(moving.found(effort[part.v], _carried(part, forces)))
    rates, error = (_placed(system, places, [getattr(one, name) for one in found]) for name in ("rates", "error"))
    return Found(rates, error, _joined([one.gap for one in found]), sum((one.power for one in found), 0.0))


def closure(system: System, q, t: Scalar = 0.0, parts=None) -> tuple[np.ndarray, list[list[np.ndarray]]]:
    """Residual of all closing rows in position [rad, m], and what closing joints are off along free axes, part by part."""
    relations, parts = _relations(system, State(t, q, np.zeros(system.n_v))), system.parts if parts is None else parts
    found = [forward.closure(part, q[part.q], [relations[r.index] for r in part.relations]) for part in parts]
    return _joined([held for held, _ in found]), [slack for _, slack in found]


def loop_constraint_scales(system: System) -> np.ndarray:
    """Sizes of the rows of :func:`closure`, see :mod:`gauss.dynamics.constraint_scales`."""
    n, sizes, q = len(system.relations.placed), kept_sizes(system), system.reference.q
    own = [sizes[constraint.rows] for constraint in system.structure.constraints[len(system.structure.constraints) - n :]]
    parts = [(part, [own[relation.index] for relation in part.relations]) for part in system.parts]
    return _joined([forward.loop_constraint_scales(part, q[part.q], system.scale, rows) for part, rows in parts]).astype(
        float
    )


def loop_constraints(system: System, q, v, t: Scalar = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual c (r,) [rad, m], Jacobian J (r, n_v) and bias γ (r,) of all rows outside the tree: J q̈ = γ.

    Rows are those of joints outside the tree, then couplings, then further constraints, as the scene has them, redundant
    ones too. Columns of joints outside the tree are zero: their coordinates follow from the others.
    """
    parts = (whole(system),)
    mechanism = Mechanism(system, q, v, t, parts)
    rows = [-mechanism.reaction(unit) for unit in np.eye(mechanism.scale.size)]
    J = np.array(rows, dtype=object).reshape(len(rows), system.n_v)
    return closure(system, q, t, parts)[0], J, mechanism.gap(np.zeros(system.n_v))


def inverse_dynamics(system: System, q, v, rates, effort, forces=None, t: Scalar = 0.0) -> np.ndarray:
    """Generalised forces (n_v,) that accelerations take besides those given, with loops cut: M q̈ + h − effort."""
    mechanism = Mechanism(system, q, v, t, (whole(system),))
    return -mechanism.residual(rates, np.zeros(mechanism.scale.size), effort, forces)[0]


def tracked(system: System, q, t: Scalar = 0.0) -> np.ndarray:
    """Coordinates of which those of joints that close loops follow from the others, which meet the closing rows."""
    for _ in range(TRACKING):
        moved = np.zeros(system.n_v, dtype=object)
        for part, slack in zip(system.parts, closure(system, q, t)[1], strict=True):
            for index, off in zip(part.closing, slack, strict=True):
                moved[part.v[part.joints[index].v]] = off
        q = retract(system, q, moved)
    return q


def kinetic_energy(system: System, q, v) -> Scalar:
    """Kinetic energy [J] from the rates of the tree alone."""
    trees = [(part, Tree(part, q[part.q], v[part.v])) for part in system.parts]
    return sum((tree.kinetic_energy(v[part.v]) for part, tree in trees), 0.0)


def condensed(system: System, effort) -> np.ndarray:
    """Generalised forces (n_v,) along the coordinates that are free."""
    whole = np.zeros(system.n_v, dtype=object)
    for part in system.parts:
        whole[part.v] = forward.condensed(part, effort[part.v])
    return whole


def _relations(system: System, state: State) -> list:
    """Rows of all relations in a state."""
    return list(system.relations.rows(kinematics(system, state))) if system.relations.placed else []


def _carried(part: Subsystem, forces) -> dict:
    """Forces on the bodies of a system as forces on the bodies of a part that carry them."""
    found: dict[int, tuple] = {}
    for body, (force, moment) in (forces or {}).items():
        frame = part.carried.get(body)
        if frame is not None and frame.body >= 0:
            force = frame.R @ force
            moment = frame.R @ moment + cross(frame.p, force)
            others = found.get(frame.body, (np.zeros(3), np.zeros(3)))
            found[frame.body] = others[0] + force, others[1] + moment
    return found


def _placed(system: System, places, vectors) -> np.ndarray:
    """Vector (n_v,) of a system from vectors of its parts."""
    whole = np.zeros(system.n_v, dtype=np.result_type(float, *vectors))
    for place, vector in zip(places, vectors, strict=True):
        whole[place] = vector
    return whole


def _joined(vectors) -> np.ndarray:
    return np.concatenate([np.zeros(0), *vectors])
