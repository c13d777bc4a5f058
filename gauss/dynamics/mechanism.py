"""Dynamics of a system in joint coordinates: the equations of its subsystems, each by itself, over numbers or symbols."""

from collections.abc import Iterator
from copy import copy

import numpy as np

from gauss.codegen import Scalar
from gauss.dynamics import constrained_aba
from gauss.dynamics.constrained_aba import BaumgarteFeedback, ConstrainedArticulatedBody
from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.refined_dynamics import RefinedAccelerations, RefinedForwardDynamics
from gauss.dynamics.rnea import KinematicTree
from gauss.rotations import cross
from gauss.system import State, Subsystem, System, retract, whole

COORDINATE_STEPS = 3  # corrections of dependent coordinates: an angle δ is off by δ³/6 after one


def forward_dynamics(system: System, q, v, tau, forces=None, t: Scalar = 0.0) -> np.ndarray:
    """Joint accelerations (n_v,) under gravity and generalised forces.

    ``system``: any without obstacles (see :func:`gauss.dynamics.conditions.obstacles`). ``q``, ``v`` (n_q,), (n_v,):
    coordinates and rates that meet the constraints; floats or expressions. ``tau`` (n_v,): generalised forces along the
    rates [N m, N]. ``forces``: force [N] and moment about the centre of mass [N m] on bodies, {body: (force, moment)} in
    principal axes. ``t``: time [s], for rheonomic constraints.
    """
    return Mechanism(system, q, v, t).motion(tau, forces)[0]


class Mechanism:
    """A system in one state, eliminated once for any number of right-hand sides; vectors are those of the system.

    ``q``, ``v`` (n_q,), (n_v,): coordinates and rates; floats or expressions. ``subsystems``: subsystems of another stage of
    the reduction; those of the system when not given.
    """

    of_subsystem: type[ConstrainedArticulatedBody] = ConstrainedArticulatedBody  # dynamics of each subsystem

    def __init__(self, system: System, q, v, t: Scalar = 0.0, subsystems=None):
        relations = _relations(system, State(t, q, v))
        self.system, self.q, self.t = system, q, t
        self.bodies = [
            self._body(index, one, q[one.q], v[one.v], [relations[r.index] for r in one.relations])
            for index, one in enumerate(system.subsystems if subsystems is None else subsystems)
        ]

    def _body(self, index: int, one: Subsystem, q, v, relations) -> ConstrainedArticulatedBody:
        """Dynamics of a subsystem."""
        return self.of_subsystem(one, q, v, relations)

    def moving(self, v) -> "Mechanism":
        """The same system in the same position at other rates; what depends on the position alone is not made again."""
        relations, found = _relations(self.system, State(self.t, self.q, v)), copy(self)
        found.bodies = [
            body.moving(v[body.subsystem.v], [relations[r.index] for r in body.subsystem.relations]) for body in self.bodies
        ]
        return found

    def eliminated(self) -> "Mechanism":
        """The same, with K M⁻¹ Kᵀ factored."""
        for body in self.bodies:
            body.eliminated()
        return self

    def motion(self, tau, forces=None, feedback: list[BaumgarteFeedback] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers of the loop constraints.

        ``tau``, ``forces``: as of :func:`forward_dynamics`. ``feedback``: stabilisation of each subsystem.
        """
        found = [
            body.motion(tau[body.subsystem.v], _carried(body.subsystem, forces), own)
            for body, own in zip(self.bodies, self._each(feedback), strict=True)
        ]
        return self._whole([rates for rates, _ in found]), _joined([multipliers for _, multipliers in found])

    def baumgarte_feedback(self, phi, slack, alpha: float, beta: float) -> list[BaumgarteFeedback]:
        """Accelerations −2α φ̇ − β² φ of each subsystem for a position residual, see :func:`loop_residual`."""
        triples = zip(self.bodies, self._rows_of(phi), slack, strict=True)
        return [body.baumgarte_feedback(own, off, alpha, beta) for body, own, off in triples]

    def residual(self, rates, multipliers, tau, forces=None, feedback=None) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the equations of motion (n_v,), by inverse dynamics, and of the loop constraints (m,)."""
        triples = zip(self.bodies, self._rows_of(multipliers), self._each(feedback), strict=True)
        found = [
            body.residual(rates[body.subsystem.v], y, tau[body.subsystem.v], _carried(body.subsystem, forces), own)
            for body, y, own in triples
        ]
        return self._whole([left for left, _ in found]), _joined([rows for _, rows in found])

    def acceleration_residual(self, rates, feedback=None) -> np.ndarray:
        """Residual k − K q̈ of the loop constraints under joint accelerations (n_v,)."""
        pairs = zip(self.bodies, self._each(feedback), strict=True)
        return _joined([body.acceleration_residual(rates[body.subsystem.v], own) for body, own in pairs])

    def correction(self, residual, rows) -> np.ndarray:
        """Change (n_v,) of the joint accelerations that removes the residuals of :meth:`residual`."""
        return self._whole([body.correction(residual[body.subsystem.v], own) for body, own in self._with(rows)])

    def damped(self, rows) -> np.ndarray:
        """Residual (m,) of the loop constraints without its part along nearly dependent rows."""
        return _joined([body.damped(own) for body, own in self._with(rows)])

    def dependent_accelerations(self, rates) -> np.ndarray:
        """Joint accelerations (n_v,), with those of loop joints replaced by those that follow from the trees."""
        return self._whole([body.dependent_accelerations(rates[body.subsystem.v]) for body in self.bodies])

    def response(self, tau, target) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n_v,) x and multipliers y with M x + Kᵀ y = tau and K x = target, or C of the velocity rows if None."""
        found = [
            body.response(tau[body.subsystem.v], body.velocity_rhs if target is None else own)
            for body, own in self._with(self.velocity_rhs if target is None else target)
        ]
        return self._whole([rates for rates, _ in found]), _joined([multipliers for _, multipliers in found])

    def released(self, tau, multipliers) -> np.ndarray:
        """Rates (n_v,) x with M x + Kᵀ y = tau for given multipliers y."""
        return self._whole([body.released(tau[body.subsystem.v], own) for body, own in self._with(multipliers)])

    def unprojected(self, residual, rows) -> np.ndarray:
        """Rates (n_v,) to which those that meet K x = rows and are :meth:`nearest` are the correction of residuals."""
        return self._whole([body.unprojected(residual[body.subsystem.v], own) for body, own in self._with(rows)])

    def determined(self, multipliers) -> np.ndarray:
        """Multipliers without their part along redundant rows, which is undetermined."""
        return _joined([body.determined(own) for body, own in self._with(multipliers)])

    def reaction(self, multipliers) -> np.ndarray:
        """Generalised forces (n_v,) of the constraints, −Kᵀ y, along the independent coordinates."""
        return self._whole([body.reaction(own) for body, own in self._with(multipliers)])

    def along_tree(self, tau) -> np.ndarray:
        """Generalised forces (n_v,) along the independent coordinates, with those of loop joints carried inward."""
        return self._whole([body.along_tree(tau[body.subsystem.v]) for body in self.bodies])

    def dependent_rates(self) -> np.ndarray:
        """Rates (n_v,), with those of loop joints replaced by those that follow from the trees."""
        return self._whole([body.dependent_rates() for body in self.bodies])

    def velocity_residual(self) -> np.ndarray:
        """K v − C of the loop constraints."""
        return _joined([body.velocity_residual() for body in self.bodies])

    def velocity(self) -> np.ndarray:
        """Left side K v of the loop constraints."""
        return self.velocity_residual() + self.velocity_rhs

    def along_rows(self, rates) -> np.ndarray:
        """K x (m,) of rates x (n_v,)."""
        return _joined([body.along_rows(rates[body.subsystem.v]) for body in self.bodies])

    @property
    def scale(self) -> np.ndarray:
        """Factor of each row of K that makes K M⁻¹ Kᵀ of free bodies 1."""
        return _joined([body.scale for body in self.bodies])

    @property
    def velocity_rhs(self) -> np.ndarray:
        """Right side C of the velocity rows."""
        return _joined([body.velocity_rhs for body in self.bodies])

    def nearest(self, v, target) -> np.ndarray:
        """Rates x (n_v,) nearest to v in the mass metric with K x = target (m,).

        With a target of zeros, v − x is orthogonal to the null space of K in the mass metric.
        """
        return self._whole([body.nearest(v[body.subsystem.v], own) for body, own in self._with(target)])

    def power(self, multipliers) -> Scalar:
        """Power of rheonomic constraints [W]: −λᵀ C."""
        return -sum((multiplier * c for multiplier, c in zip(multipliers, self.velocity_rhs, strict=True)), 0.0)

    def position_correction(self, phi, slack) -> np.ndarray:
        """Newton step (n_v,), the least in the mass metric, on the position residual of :func:`loop_residual`."""
        triples = zip(self.bodies, self._rows_of(phi), slack, strict=True)
        return self._whole([body.position_correction(own, off) for body, own, off in triples])

    @property
    def pivots(self) -> list:
        """Pivots of K M⁻¹ Kᵀ; see :attr:`gauss.dynamics.constrained_aba.ConstrainedArticulatedBody.pivots`."""
        return [pivot for body in self.bodies for pivot in body.pivots]

    @property
    def relation_rows(self) -> dict[str, slice]:
        """Rows of the multipliers that belong to each relation, by its name; they are the last ones of its subsystem."""
        placed, found, end = self.system.relations.placed, dict[str, slice](), 0
        for body in self.bodies:
            end += body.scale.size
            place = end - sum(one.size for one in body.subsystem.relations)
            for one in body.subsystem.relations:
                found[placed[one.index].name] = slice(place, place + one.size)
                place += one.size
        return found

    def _each(self, feedback):
        return [None] * len(self.bodies) if feedback is None else feedback

    def _rows_of(self, rows) -> list[np.ndarray]:
        """Entries of each subsystem in a vector (m,) of the loop constraints."""
        ends = np.cumsum([body.scale.size for body in self.bodies], dtype=int)
        return [rows[end - body.scale.size : end] for body, end in zip(self.bodies, ends, strict=True)]

    def _with(self, rows) -> Iterator[tuple[ConstrainedArticulatedBody, np.ndarray]]:
        """Each subsystem with its entries in a vector (m,) of the loop constraints."""
        return zip(self.bodies, self._rows_of(rows), strict=True)

    def _whole(self, vectors) -> np.ndarray:
        """Vector (n_v,) of the system from those of its subsystems; zero for what belongs to none."""
        return _placed(self.system, [body.subsystem.v for body in self.bodies], vectors)


def refined_forward_dynamics(system: System, state: State, tau, forces=None, cut: Scalar = 0.0) -> RefinedAccelerations:
    """Joint accelerations of a system, refined to round-off, with an error bound; see :class:`RefinedForwardDynamics`.

    ``system``, ``state``, ``tau``, ``forces``: as of :func:`forward_dynamics`. ``cut``: rank tolerance: loop constraints
    with less than this share of their length outside the span of the others are left out.
    """
    relations, found, places = _relations(system, state), [], [one.v for one in system.subsystems]
    for one in system.subsystems:
        rows = [relations[r.index] for r in one.relations]
        body = RefinedForwardDynamics(one, state.q[one.q], state.v[one.v], rows, cut)
        found.append(body.found(tau[one.v], _carried(one, forces)))
    rates, error = (_placed(system, places, [getattr(own, name) for own in found]) for name in ("rates", "error"))
    return RefinedAccelerations(
        rates, error, _joined([own.residual for own in found]), sum((own.power for own in found), 0.0)
    )


def loop_residual(system: System, q, t: Scalar = 0.0, subsystems=None) -> tuple[np.ndarray, list[list[np.ndarray]]]:
    """Position residual φ of all loop constraints [rad, m], and errors of the coordinates of loop joints by subsystem."""
    relations = _relations(system, State(t, q, np.zeros(system.n_v)))
    found = [
        constrained_aba.loop_residual(one, q[one.q], [relations[r.index] for r in one.relations])
        for one in (system.subsystems if subsystems is None else subsystems)
    ]
    return _joined([held for held, _ in found]), [slack for _, slack in found]


def loop_constraint_scales(system: System) -> np.ndarray:
    """Sizes of the rows of :func:`loop_residual`, see :mod:`gauss.dynamics.constraint_scales`."""
    n, sizes, q = len(system.relations.placed), constraint_scales(system), system.reference.q
    own = [sizes[constraint.rows] for constraint in system.structure.constraints[len(system.structure.constraints) - n :]]
    pairs = [(one, [own[relation.index] for relation in one.relations]) for one in system.subsystems]
    found = [constrained_aba.loop_constraint_scales(one, q[one.q], system.scale, rows) for one, rows in pairs]
    return _joined(found).astype(float)


def loop_constraints(system: System, q, v, t: Scalar = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual c (r,) [rad, m], Jacobian J (r, n_v) and bias γ (r,) of all rows outside the tree: J q̈ = γ.

    Rows are those of joints outside the tree, then couplings, then further constraints, as the scene has them, redundant
    ones too. Columns of joints outside the tree are zero: their coordinates are dependent.
    """
    subsystems = (whole(system),)
    mechanism = Mechanism(system, q, v, t, subsystems)
    rows = [-mechanism.reaction(unit) for unit in np.eye(mechanism.scale.size)]
    J = np.array(rows, dtype=object).reshape(len(rows), system.n_v)
    return loop_residual(system, q, t, subsystems)[0], J, mechanism.acceleration_residual(np.zeros(system.n_v))


def inverse_dynamics(system: System, q, v, rates, tau, forces=None, t: Scalar = 0.0) -> np.ndarray:
    """Generalised forces (n_v,) that accelerations take besides those given, with loops cut: M q̈ + h − τ."""
    mechanism = Mechanism(system, q, v, t, (whole(system),))
    return -mechanism.residual(rates, np.zeros(mechanism.scale.size), tau, forces)[0]


def dependent_coordinates(system: System, q, t: Scalar = 0.0) -> np.ndarray:
    """Coordinates, with those of loop joints replaced by those that follow from the trees; others meet the constraints."""
    for _ in range(COORDINATE_STEPS):
        step = np.zeros(system.n_v, dtype=object)
        for one, slack in zip(system.subsystems, loop_residual(system, q, t)[1], strict=True):
            for index, off in zip(one.loop_joints, slack, strict=True):
                step[one.v[one.joints[index].v]] = off
        q = retract(system, q, step)
    return q


def kinetic_energy(system: System, q, v) -> Scalar:
    """Kinetic energy [J] from the rates of the tree alone."""
    trees = [(one, KinematicTree(one, q[one.q], v[one.v])) for one in system.subsystems]
    return sum((tree.kinetic_energy(v[one.v]) for one, tree in trees), 0.0)


def condensed(system: System, tau) -> np.ndarray:
    """Generalised forces (n_v,) along the independent coordinates."""
    found = np.zeros(system.n_v, dtype=object)
    for one in system.subsystems:
        found[one.v] = constrained_aba.condensed(one, tau[one.v])
    return found


def _relations(system: System, state: State) -> list:
    """Rows of all relations in a state."""
    return list(system.relations.rows(kinematics(system, state))) if system.relations.placed else []


def _carried(subsystem: Subsystem, forces) -> dict:
    """Forces on the bodies of a system as forces on the bodies of a subsystem that carry them."""
    found: dict[int, tuple] = {}
    for body, (force, moment) in (forces or {}).items():
        frame = subsystem.carried.get(body)
        if frame is not None and frame.body >= 0:
            force = frame.R @ force
            moment = frame.R @ moment + cross(frame.p, force)
            others = found.get(frame.body, (np.zeros(3), np.zeros(3)))
            found[frame.body] = others[0] + force, others[1] + moment
    return found


def _placed(system: System, places, vectors) -> np.ndarray:
    """Vector (n_v,) of a system from vectors of its subsystems."""
    found = np.zeros(system.n_v, dtype=np.result_type(float, *vectors))
    for place, vector in zip(places, vectors, strict=True):
        found[place] = vector
    return found


def _joined(vectors) -> np.ndarray:
    return np.concatenate([np.zeros(0), *vectors])
