"""Traced functions of one system, over numbers or symbols: forward dynamics, projection, error check.

Integrator loops and engines are compiled from them. Points are vectors (:class:`gauss.dynamics.point_layout.PointLayout`).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Function, Kernel, write
from gauss.dynamics.assemble import state_residual
from gauss.dynamics.energies import look_at_energies
from gauss.dynamics.error_scale import (
    ACCELERATION_TOLERANCE,
    NEAR_SINGULAR_ROUNDOFF,
    acceleration_scale,
    centrifugal_scale,
)
from gauss.dynamics.gear_trains import on_trains
from gauss.dynamics.generic_rank import has_full_generic_rank
from gauss.dynamics.inputs import input_loads
from gauss.dynamics.inverse_dynamics_residual import inverse_dynamics_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.constraint_functions import watched_functions
from gauss.dynamics.laws.switching_functions import SwitchingFunctions
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism, loop_constraint_scales, loop_residual
from gauss.dynamics.parameters import ParametrisedSystem
from gauss.dynamics.point_layout import PointLayout
from gauss.dynamics.rigid_loops import is_in_other_pose
from gauss.dynamics.shared_elimination import SharedElimination
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.store import cached_on_disk
from gauss.integrators import Point, Rates
from gauss.system import State, System, retract

if TYPE_CHECKING:
    from gauss.codegen.kernels import RowFunction

POSITION_STEPS = 2  # Newton steps in position after an integration step, on one factorisation
FINITE_SUM = 1e300  # largest sum that counts as finite
FINITE = float(np.finfo(float).max)  # limit of a sum of absolute values that no NaN and no infinity meets


class Kernels(NamedTuple):
    """Machine code of the functions that Python forms steps from."""

    forward: Kernel  # (t, q, v, generalised forces added) → (q̈, power of the loads)
    # (point, generalised forces added) → error of its accelerations, and residual of the loop constraints under them
    check: Kernel
    project: Kernel | None  # (t, q, v) → (q and v on the constraints, …, position residual); None where nothing is projected


class Program:
    """Functions of one system.

    ``system``: one without obstacles (see :func:`gauss.dynamics.conditions.obstacles`). ``memory``: numbers of the state of
    the method. ``family``: the parametrised system, if some numbers of the system are parameters. ``inputs``: whether the
    inputs of the scene are parameters, held in each step; otherwise they are zero.

    Attributes: ``checks_bodies``: whether accelerations of a tree are checked by inverse dynamics of all bodies, independent
    of link frames.
    """

    checks_bodies = True

    def __init__(
        self,
        system: System,
        laws: Laws,
        drift: Drift = Drift(),  # noqa: B008 (frozen)
        memory: int = 0,
        family: ParametrisedSystem | None = None,
        inputs: bool = False,
    ):
        self.system, self.drift, self.laws = system, drift, laws
        self.loads = laws.traced if family is None else family.system.loads
        self.inputs = tuple(system.scene.inputs) if inputs else ()
        self.loads = [*self.loads, *input_loads(system)] if inputs else self.loads
        self.pattern = system if family is None else family.pattern  # a system of numbers alone
        self.layout = PointLayout(system.n_q, system.n_v, memory, self.inputs if family is None else family.parameters)

    @property
    def elimination(self) -> Callable[..., Mechanism]:
        """Elimination of the trees and loop constraints in one state."""
        return Mechanism

    @cached_property
    def watch(self) -> SwitchingFunctions:
        """Switching functions of its laws and constraints."""
        return SwitchingFunctions(self.system, watched_functions(self.pattern, self.laws))

    @property
    def projects(self) -> bool:
        """Whether states are projected onto the constraints after a step."""
        return self.drift.projects and self.system.closes

    @cached_property
    def rates(self) -> "Function | RowFunction":
        """Function (t, q, v) → (q̈, power of the loads, …); that of :attr:`monitored_rates` where these are needed, too."""
        monitored = self.may_lose_rank
        return self.monitored_rates if monitored else write(self._rates, 1, self.system.n_q, self.system.n_v, name="rates")

    @cached_property
    def has_full_rank(self) -> bool:
        """Whether the loop constraints have full rank at generic configurations: then small pivots mean a singular one."""
        return self.system.closes and has_full_generic_rank(self.pattern)

    @cached_property
    def has_redundant_rows(self) -> bool:
        """Whether the loop constraints of what is projected are redundant at every configuration."""
        return self.projects and not self.has_full_rank

    @property
    def may_lose_rank(self) -> bool:
        """Whether the loop constraints of what is projected lose rank at singular configurations only."""
        return self.projects and self.has_full_rank

    @cached_property
    def monitored_rates(self) -> Function:
        """Function (t, q, v) → (q̈, power of the loads, least pivot of S, and its singularity if that is monitored)."""
        return write(self._monitored_rates, 1, self.system.n_q, self.system.n_v, name="rates")

    @cached_property
    def projected_rates(self) -> "Function | RowFunction":
        """Function (t, q, v) → (q, v) on the constraints, q̈ and power there, singularity of S, position residual.

        The singularity is 1 plus the sum of the inverse pivots of S, a bound of its least eigenvalue: where all rows of a
        long ladder become singular together, that is much less than a pivot.
        """
        return write(self._projected_rates, 1, self.system.n_q, self.system.n_v, name="closed")

    @cached_property
    def own(self) -> np.ndarray:
        """Inverse units of coordinates (n_v,) and rates."""
        return 1.0 / self.pattern.scale.coordinates

    @cached_property
    def shares(self) -> np.ndarray:
        """Inverse scales (m,) of the residuals of the loop constraints."""
        return 1.0 / loop_constraint_scales(self.pattern)

    @cached_property
    def along(self) -> Function:
        """Function (t, q, displacement or rates) → its component in the null space of K, in the mass metric."""

        def along(t, q, change):
            return self.shared.nearest(self.shared.place(t, q), change, np.zeros(self.shares.size), 0.0)

        return write(along, 1, self.system.n_q, self.system.n_v, name="along")

    def forward(self) -> Kernel:
        """Machine code of (t, q, v, generalised forces added) → (q̈, power of the loads)."""
        n_q, n_v = self.system.n_q, self.system.n_v
        return Kernel(write(self._rates, 1, n_q, n_v, n_v, name="forward"), batch=False)

    def kernels(self) -> Kernels:
        """Machine code of the functions that Python forms steps from."""
        check = write(self.check, self.layout.size, self.system.n_v, name="check")
        project = Kernel(self.projected_rates, batch=False) if self.projects else None
        return Kernels(self.forward(), Kernel(check, batch=False), project)

    @property
    def cached_kernels(self) -> Kernels:
        """The same, cached with the system, and by their content on disk."""
        return cached_on_disk(self.system, (Program.kernels, self.drift, self.laws.key), self.kernels)

    def residual(self, state: State):
        """Constraint residual of a state, in position and velocity, relative; of all constraints of the system.

        Infinite where a loop that cannot move has another pose than the rigid body to which it is reduced.
        """
        return constraint_residual(self.system, state)

    def evaluate(self, state: State) -> Rates:
        """Rates of a traced state, by a call."""
        return self.split_rates(self.rates([state.t], state.q, state.v))[0]

    def split_rates(self, found) -> tuple[Rates, np.ndarray]:
        """Rates of a state, and what :attr:`monitored_rates` adds to them, from the outputs of these functions."""
        acceleration, power, monitored = np.split(found, [self.system.n_v, self.system.n_v + 3])
        return Rates(acceleration, power), monitored

    def check(self, x, tau=None) -> np.ndarray:
        """Error of the accelerations of a point, and residual of the loop constraints, relative to the largest of them.

        The error is the residual of inverse dynamics as a change of accelerations. For a tree, inverse dynamics are those of
        the bodies as the scene has them, independent of reductions and link frames; the forces of couplings and relations
        are then part of the residual, but change no allowed acceleration. Near-singular or inconsistent redundant
        constraints may keep a residual that no q̈ removes. Near a singularity the round-off contribution is not counted as
        error.
        """
        point = self.layout.point(x)
        state, found = point.state, point.rates.acceleration
        change, rows, singularity = (self._tree_error if self.system.is_tree else self._loop_error)(state, found, tau)
        change = np.abs(change) * self.own
        noise = NEAR_SINGULAR_ROUNDOFF * largest(state.v * self.own) ** 2 * singularity * np.sqrt(singularity)
        size = math.maximum(largest(found * self.own), self.error_scale(state.v)) + noise / ACCELERATION_TOLERANCE
        rows = np.abs(rows) * self.shares
        error = math.where(change.sum() <= FINITE_SUM, largest(change), np.inf)  # a maximum ignores NaN
        return np.array([error / size, rows.sum() / size], dtype=object)

    def _tree_error(self, state: State, acceleration, tau):
        """Error of the accelerations of a tree, residual of the constraints, singularity; by inverse dynamics of bodies."""
        mechanism = Mechanism(self.system, state.q, state.v, state.t)
        motion, rows = (
            kinematics(self.system, state),
            mechanism.acceleration_residual(acceleration, self.feedback(mechanism)),
        )
        residual = inverse_dynamics_residual(motion, Applied(motion, self.loads), acceleration)
        residual = residual if tau is None else residual + tau
        return mechanism.correction(residual, rows), rows, self.monitored(mechanism)[1]

    def _loop_error(self, state: State, acceleration, tau):
        """Error of the accelerations, residual of the constraints, singularity; by inverse dynamics in joint coordinates."""
        shared, tau = (self.shared, ()) if tau is None else (self.shared_with_forces, tau)
        place = shared.place([state.t], state.q)
        *_, multipliers, (_, singularity) = shared.motion(place, state.v, tau)
        change, rows, damped = shared.defect(place, state.v, tau, acceleration, multipliers)
        return shared.nearest(place, change, damped, 0.0), rows, singularity

    def error_scale(self, v):
        """Size of accelerations below which errors are no longer relative to them, for rates v (n_v,)."""
        return acceleration_scale(self.pattern) + centrifugal_scale(self.pattern, v)

    def energies(self, x) -> np.ndarray:
        """Energies of a point, see :func:`gauss.dynamics.energies.look_at_energies`."""
        point = self.layout.point(x)
        return look_at_energies(kinematics(self.system, point.state), point.work)

    def watched_point(self, x):
        """Check of a point, and its energies: what loops evaluate at intervals."""
        return self.check(x), self.energies(x)

    @cached_property
    def point_check(self) -> "Function | RowFunction":
        """Function of a point → its check, and its energies."""
        return write(self.held_point if self.inputs else self.watched_point, self.layout.size, name="check")

    def held_point(self, x):
        """Check of a point, and its energies, with the rates under its inputs instead of those that it holds."""
        point = self.layout.point(x)
        return self.watched_point(self.layout.pack(replace(point, rates=self.evaluate(point.state))))

    def instant(self, state: State, tau=None) -> tuple[Mechanism, Rates]:
        """Eliminated traced state, and its rates, inlined; generalised forces may be added."""
        mechanism, *rates = self._evaluated([state.t], state.q, state.v, tau)
        return mechanism, Rates(*rates)

    def _rates(self, t, q, v, tau=None):
        return self._evaluated(t, q, v, tau)[1:]

    def _monitored_rates(self, t, q, v):
        self.order_inputs(t)
        acceleration, power, _, monitored = self.shared.motion(self.shared.place(t, q, often=True), v, often=True)
        return acceleration, power, monitored

    def order_inputs(self, t):
        """Let the inputs of the scene be the last ones of a function that is traced, in the order of the scene."""
        for name in self.inputs:
            t[0].graph.parameter(name)

    def _evaluated(self, t, q, v, tau=None):
        self.order_inputs(t)
        state = State(t[0], q, v)
        own, forces, power = self.applied(state)
        mechanism = self.elimination(self.system, q, v, state.t)
        tau = own if tau is None else own + tau
        acceleration, multipliers = mechanism.motion(tau, forces, self.feedback(mechanism))
        return mechanism, acceleration, power + np.array([mechanism.power(multipliers), 0.0, 0.0])

    def _projected_rates(self, t, q, v):
        shared, m = self.shared, self.shares.size
        place = shared.place(t, q, often=True)
        for _ in range(POSITION_STEPS):
            q = retract(self.system, q, shared.newton_step(place, shared.loop_residual(t, q)))
        place = shared.place(t, q, often=True)
        v = shared.nearest(place, v, np.zeros(m), 1.0, often=True)
        residual = reduce(math.maximum, [0.0, *np.abs(shared.loop_residual(t, q)[:m] * self.shares)])
        acceleration, power, _, monitored = shared.motion(place, v, often=True)
        return q, v, acceleration, power, monitored[1:], [residual]

    @cached_property
    def shared(self) -> SharedElimination:
        """Functions of its states that share one elimination."""
        return SharedElimination(self)

    @cached_property
    def shared_with_forces(self) -> SharedElimination:
        """The same where generalised forces are added to the loads."""
        return SharedElimination(self, self.system.n_v)

    def monitored(self, mechanism: Mechanism) -> list:
        """Least pivot of S, and its singularity, 1 plus the sum of the inverse pivots; 1 if these are not monitored."""
        pivots = mechanism.pivots if self.has_full_rank else ()
        return [reduce(math.minimum, [1.0, *pivots]), 1.0 + sum(1.0 / pivot for pivot in pivots)]

    def applied(self, state: State):
        """Generalised forces, forces on bodies and power of its loads, see :func:`applied_loads`."""
        return applied_loads(self.system, self.loads, state)

    def feedback(self, mechanism: Mechanism):
        """Baumgarte feedback; None for other stabilisations."""
        if self.drift.gains is None:
            return None
        return mechanism.baumgarte_feedback(*loop_residual(self.system, mechanism.q, mechanism.t), *self.drift.gains)

    def projected(self, x):
        """Projected point with its rates, and the position residual."""
        point = self.layout.point(x)
        state, rates, (_, residual) = self.on_constraints(point.state)
        return self.layout.pack(Point(state, point.work, rates, point.method_state)), [residual]

    def on_trains(self, state: State) -> State:
        """State after a step whose gear trains follow their first joints, where states are projected."""
        return on_trains(self.system, state) if self.drift.projects else state

    def projection(self) -> Function | None:
        """Function of a point → (projected point, position residual); None where nothing is projected."""
        return write(self.projected, self.layout.size, name="project") if self.projects else None

    def on_constraints(self, state: State):
        """Projected state, its rates, and (singularity of S, position residual), by a call."""
        (n_q, n_v), found = (self.system.n_q, self.system.n_v), self.projected_rates([state.t], state.q, state.v)
        q, v, acceleration, power, rest = np.split(found, np.cumsum([n_q, n_v, n_v, 3]))
        return State(state.t, q, v), Rates(acceleration, power), rest


def constraint_residual(system: System, state: State):
    """Constraint residual of a state, in position and velocity, relative; see :meth:`Program.residual`."""
    residual = off_unit(system, state.q)
    if system.rigid_joints:
        residual = residual + math.where(is_in_other_pose(system, state.q), np.inf, 0.0)
    if system.has_closures:
        residual = residual + state_residual(kinematics(system, state))
    return residual


def off_unit(system: System, q):
    """Sum of |qᵀ q − 1| of all quaternions."""
    squares = [q[place] @ q[place] for place in system.quaternions.values()]
    return sum((np.abs(square - 1.0) for square in squares), 0.0)


def applied_loads(system: System, loads, state: State):
    """Generalised forces (n_v,), forces on bodies in principal axes, and power (3,) of loads; numbers or expressions."""
    if not loads:
        return np.zeros(system.n_v), {}, np.zeros(3)
    motion = kinematics(system, state)
    applied = Applied(motion, loads)
    return applied.P, applied.on_bodies(motion), applied.power


def largest(values):
    """Largest absolute value."""
    return reduce(math.maximum, np.abs(values))


def absolute_sum(*vectors):
    """Sum of absolute values, halves to halves: as a chain it would take longer than many a function that it guards."""
    values = np.abs(np.concatenate(vectors))
    while len(values) > 1:
        half = len(values) // 2
        values = np.concatenate([values[:half] + values[half : 2 * half], values[2 * half :]])
    return values.sum()
