"""What the compiled loops call: the functions of one system, written down from the same source that runs on numbers.

A point is the vector (t, q, v, work, q̈, power, memory, parameters): a state, the work done up to it, the rates there, what
the method remembers, and, for a system with parameters, what they are on this motion.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.backends.dual_certificate import LEAST_SHARE
from gauss.backends.rank import COARSEST_LOOP_RANK, LOOP_RANK
from gauss.codegen import Expression, Function, Kernel, write
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.energies import look_at_energies
from gauss.dynamics.error_scale import ROUNDING, TRUST, consistent_states, floor, spin
from gauss.dynamics.inverse_dynamics_residual import inverse_dynamics_residual
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.switching_functions import Watch
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism, careful, closure, loop_constraint_scales
from gauss.dynamics.parametrised_system import ParametrisedSystem
from gauss.dynamics.stabilisation import Drift
from gauss.integrators import Point, Rates
from gauss.system import State, System, retract

SETTLING = 2  # Newton steps in position after an integration step, on one factorisation
HUGE = 1e300
INDEPENDENT = 1e-4  # pivot of a closing row, 1 on free bodies, above which it does not depend on others


@dataclass(frozen=True)
class Layout:
    """Places of a point's parts in a vector."""

    n_q: int
    n_v: int
    memory: int = 0
    parameters: tuple[str, ...] = ()

    @property
    def row(self) -> int:
        """Numbers of (t, q, v, work)."""
        return 1 + self.n_q + self.n_v + 3

    @property
    def size(self) -> int:
        """Numbers of a point."""
        return self.row + self.n_v + 3 + self.memory + len(self.parameters)

    @property
    def n_y(self) -> int:
        """Numbers of y."""
        return 2 * self.n_v + 3

    def pack(self, point: Point) -> np.ndarray:
        """Vector of a point; its parameters are those of the graph that it is traced in."""
        state = point.state
        memory = point.rates.acceleration if point.memory is None else point.memory
        parts = [[state.t], state.q, state.v, point.work, *point.rates, memory[: self.memory]]
        if self.parameters:
            graph = next(entry.graph for part in parts for entry in part if isinstance(entry, Expression))
            parts.append([graph.parameter(name) for name in self.parameters])
        return np.concatenate(parts)

    def state(self, x: np.ndarray) -> State:
        """State in a vector; where it is traced, its parameters hold from then on."""
        if self.parameters:
            x[0].graph.bind(self.parameters, x[self.size - len(self.parameters) : self.size])
        return State(x[0], x[1 : 1 + self.n_q], x[1 + self.n_q : 1 + self.n_q + self.n_v])

    def point(self, x: np.ndarray) -> Point:
        """Point in a vector."""
        _, acceleration, power, memory, _ = np.split(x, np.cumsum([self.row, self.n_v, 3, self.memory]))
        return Point(self.state(x), x[self.row - 3 : self.row], Rates(acceleration, power), memory)


class Kernels(NamedTuple):
    """Machine code that steps are put together from.

    Attributes
    ----------
    forward : Kernel
        (t, q, v, generalised forces added) → (q̈, power of the loads).
    check : Kernel
        (point, generalised forces added) → error of its accelerations, and what closing rows lack under them.
    settle : Kernel or None
        (t, q, v) → (q and v on the constraints, …, gap that is left); None where nothing is to be done.
    """

    forward: Kernel
    check: Kernel
    settle: Kernel | None


class Program:
    """Functions of one system.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.dynamics.conditions.obstacles`).
    laws : Laws
        Its loads; those that are traced are included.
    drift : Drift
        How it is kept on its constraints.
    memory : int
        Numbers that a method remembers from step to step.
    family : ParametrisedSystem, optional
        What the system stands for, if some of its numbers are parameters.
    """

    def __init__(
        self,
        system: System,
        laws: Laws,
        drift: Drift = Drift(),  # noqa: B008 (frozen)
        memory: int = 0,
        family: ParametrisedSystem | None = None,
    ):
        self.system, self.drift, self.laws = system, drift, laws
        self.loads = laws.traced if family is None else family.system.loads
        self.pattern = system if family is None else family.pattern  # a system in numbers alone
        self.layout = Layout(system.n_q, system.n_v, memory, () if family is None else family.parameters)

    @cached_property
    def watch(self) -> Watch:
        """Switching functions of its laws."""
        return Watch(self.system, self.laws)

    @property
    def settles(self) -> bool:
        """Whether what is stepped is brought back to constraints after a step."""
        return self.drift.settles and self.system.closes

    @cached_property
    def rates(self) -> Function:
        """Function (t, q, v) → (q̈, power of the loads)."""
        return write(self._rates, 1, self.system.n_q, self.system.n_v, name="rates")

    @cached_property
    def rows_are_independent(self) -> bool:
        """Whether no closing row repeats others wherever the system is: a small pivot then means that a row fades."""
        if not self.system.closes:
            return False
        mechanisms = (Mechanism(self.pattern, s.q, s.v, s.t) for s in consistent_states(self.pattern))
        return any(min(mechanism.pivots, default=0.0) > INDEPENDENT for mechanism in mechanisms)

    @cached_property
    def repeats(self) -> bool:
        """Whether loop constraints of what is projected are redundant wherever the system is."""
        return self.settles and not self.rows_are_independent

    @property
    def fades(self) -> bool:
        """Whether closing rows of what is brought back to constraints can fade."""
        return self.settles and self.rows_are_independent

    @cached_property
    def watched(self) -> Function:
        """Function (t, q, v) → (q̈, power of the loads, weakest pivot of the closing rows, if these can fade)."""
        return write(self._watched, 1, self.system.n_q, self.system.n_v, name="watched")

    @cached_property
    def closed(self) -> Function:
        """Function (t, q, v) → (q, v) on the constraints, q̈ and power there, weakness of the closing rows, gap that is left.

        The weakness is the sum of their inverse pivots, which tells of the least eigenvalue of K M⁻¹ Kᵀ: where all rows of a
        long ladder fade together, that is much less than a pivot.
        """
        return write(self._closed, 1, self.system.n_q, self.system.n_v, name="closed")

    @cached_property
    def own(self) -> np.ndarray:
        """What coordinates (n_v,) and their rates are multiplied with to be relative to the length of the scene."""
        return 1.0 / self.pattern.scale.coordinates

    @cached_property
    def shares(self) -> np.ndarray:
        """What the residuals of closing rows are multiplied with to be relative to the sizes of the rows."""
        return 1.0 / loop_constraint_scales(self.pattern)

    @cached_property
    def along(self) -> Function:
        """Function (t, q, displacement or rates) → what of them is along the constraints, in the mass metric."""

        def along(t, q, change):
            still = np.zeros(self.system.n_v)
            return Mechanism(self.system, q, still, t[0]).along(change)

        return write(along, 1, self.system.n_q, self.system.n_v, name="along")

    def forward(self) -> Kernel:
        """Machine code of (t, q, v, generalised forces added) → (q̈, power of the loads)."""
        n_q, n_v = self.system.n_q, self.system.n_v
        return Kernel(write(self._rates, 1, n_q, n_v, n_v, name="forward"), batch=False)

    def kernels(self) -> Kernels:
        """Machine code for steps that are put together by Python."""
        check = write(self.check, self.layout.size, self.system.n_v, name="check")
        return Kernels(
            self.forward(), Kernel(check, batch=False), Kernel(self.closed, batch=False) if self.settles else None
        )

    def refined(self, q, v, effort, t):
        """q̈ after one refinement, which makes up for what inverse dynamics finds lacking, and what speaks for it.

        That is the size of the refinement and of what the rows lack then, the gap of the state, and the sum of all that is
        given: a part may not depend on it, but if that is no number, nor is the result. Sums, for a maximum passes over what
        is no number.
        """
        state = State(t[0], q, v)
        own, forces, _ = applied_loads(self.system, self.loads, state)
        mechanism, effort = Mechanism(self.system, q, v, state.t), own + effort
        found, multipliers = mechanism.motion(effort, forces)
        change, _ = mechanism.response(*mechanism.residual(found, multipliers, effort, forces))
        left = mechanism.gap(found + change)  # of rows that fade or contradict each other
        lacking = np.abs(change * self.own).sum() + np.abs(left * self.shares).sum()
        error = lacking / math.maximum(largest(found * self.own), floor(self.pattern) + spin(self.pattern, v))
        return found + change, [error, self.gap(state), sum(np.abs(part).sum() for part in (q, v, effort, t))]

    def careful(self, q, v, effort, t):
        """q̈ refined to rounding, and what speaks for it: its error, judged as certificates do; else as :meth:`refined`."""
        acceleration, _, error, gap = self._carefully(State(t[0], q, v), effort)
        return acceleration, [error, gap, sum(np.abs(part).sum() for part in (q, v, effort, t))]

    def refined_rates(self, t, q, v, effort):
        """q̈ refined to rounding, power of the loads, and the error as certificates judge it."""
        acceleration, power, error, _ = self._carefully(State(t[0], q, v), effort)
        return acceleration, power, [error]

    def _carefully(self, state: State, effort):
        own, forces, power = applied_loads(self.system, self.loads, state)
        gap = self.gap(state)
        found = careful(self.system, state, own + effort, forces, math.clip(math.sqrt(gap), LOOP_RANK, COARSEST_LOOP_RANK))
        size = math.maximum(largest(found.rates * self.own), floor(self.pattern) + spin(self.pattern, state.v))
        each = zip(found.error * self.own, found.rates * self.own, strict=True)
        shares = [off / math.maximum(np.abs(rate), LEAST_SHARE * size) for off, rate in each]
        error = sum(shares) + np.abs(found.gap * self.shares).sum() / size
        return found.rates, power + np.array([found.power, 0.0, 0.0]), error, gap

    def gap(self, state: State):
        """By how much a state is off the constraints of the whole system, of which the parts know what they need."""
        gap = off_unit(self.system, state.q)
        if self.system.has_closures:
            motion = kinematics(self.system, state)
            gap = gap + assemble_motion(motion, Applied(motion, ())).constraint_residual
        return gap

    def evaluate(self, state: State) -> Rates:
        """Rates of a traced state, by a call."""
        found = self.rates([state.t], state.q, state.v)
        return Rates(found[: self.system.n_v], found[self.system.n_v :])

    def check(self, x, effort=None) -> np.ndarray:
        """Error of the accelerations of a point, and what closing rows lack under them, relative to the largest of them.

        The error is what inverse dynamics finds lacking, as a change of accelerations. A tree is asked body by body, as its
        scene is written: what is found knows nothing of reductions and link frames. Forces of couplings and relations are
        among what is found then; they change no acceleration that is allowed. Rows that fade, or contradict rows that they
        repeat, may lack what no change makes up for. Where rows fade, nor is what rounding contributes an error.
        """
        point = self.layout.point(x)
        state, found = point.state, point.rates.acceleration
        mechanism = Mechanism(self.system, state.q, state.v, state.t)
        effort, pulls = np.zeros(self.system.n_v) if effort is None else effort, self._pulls(mechanism, state)
        if self.system.is_tree:
            motion = kinematics(self.system, state)
            left = (
                inverse_dynamics_residual(motion, Applied(motion, self.loads), found) + effort,
                mechanism.gap(found, pulls),
            )
        else:
            own, forces, _ = applied_loads(self.system, self.loads, state)
            _, multipliers = mechanism.motion(own + effort, forces, pulls)
            left = mechanism.residual(found, multipliers, own + effort, forces, pulls)
        change = np.abs(mechanism.correction(*left)) * self.own
        weakness = _weakness(self._fading(mechanism))
        noise = ROUNDING * largest(state.v * self.own) ** 2 * weakness * np.sqrt(weakness)
        least = floor(self.pattern) + spin(self.pattern, state.v)
        size = math.maximum(largest(found * self.own), least) + noise / TRUST
        lacking = np.abs(left[1]) * self.shares
        error = math.where(change.sum() <= HUGE, largest(change), np.inf)  # a maximum passes over what is no number
        return np.array([error / size, lacking.sum() / size], dtype=object)

    def energies(self, x) -> np.ndarray:
        """Look at the energies of a point, see :func:`gauss.dynamics.energies.look_at_energies`."""
        point = self.layout.point(x)
        return look_at_energies(kinematics(self.system, point.state), point.work)

    def watched_point(self, x):
        """Check of a point, and a look at its energies: what loops ask for now and then."""
        return self.check(x), self.energies(x)

    def instant(self, state: State, effort=None) -> tuple[Mechanism, Rates]:
        """Traced state eliminated, and its rates, written out; generalised forces may be added."""
        mechanism, *rates = self._evaluated([state.t], state.q, state.v, effort)
        return mechanism, Rates(*rates)

    def _rates(self, t, q, v, effort=None):
        return self._evaluated(t, q, v, effort)[1:]

    def _watched(self, t, q, v):
        mechanism, acceleration, power = self._evaluated(t, q, v)
        pivots = self._fading(mechanism)
        return acceleration, power, [_fold(math.minimum, [1.0, *pivots]), _weakness(pivots)]

    def _evaluated(self, t, q, v, effort=None):
        state = State(t[0], q, v)
        own, forces, power = applied_loads(self.system, self.loads, state)
        mechanism = Mechanism(self.system, q, v, state.t)
        effort = own if effort is None else own + effort
        acceleration, multipliers = mechanism.motion(effort, forces, self._pulls(mechanism, state))
        return mechanism, acceleration, power + np.array([mechanism.power(multipliers), 0.0, 0.0])

    def _closed(self, t, q, v):
        mechanism = Mechanism(self.system, q, v, t[0])
        for _ in range(SETTLING):
            q = retract(self.system, q, mechanism.approach(*closure(self.system, q, t[0])))
        v = Mechanism(self.system, q, v, t[0]).projected_rates(v)
        gap = _fold(math.maximum, [0.0, *np.abs(closure(self.system, q, t[0])[0] * self.shares)])
        mechanism, *rates = self._evaluated(t, q, v)
        return q, v, *rates, [_weakness(self._fading(mechanism))], [gap]

    def _fading(self, mechanism: Mechanism):
        """Pivots of the closing rows, if these can fade."""
        return mechanism.pivots if self.rows_are_independent else ()

    def _pulls(self, mechanism: Mechanism, state: State):
        """What draws the state back to the constraints, by Baumgarte's method."""
        if self.drift.gains is None:
            return None
        return mechanism.pulls(*closure(self.system, state.q, state.t), *self.drift.gains)

    def settled(self, x):
        """Point moved onto the constraints, with its rates, and the gap that is left."""
        point = self.layout.point(x)
        state, rates, (_, gap) = self.on_constraints(point.state)
        return self.layout.pack(Point(state, point.work, rates, point.memory)), [gap]

    def settling(self) -> Function | None:
        """Function of a point → (point on the constraints, gap that is left), if points drift off them."""
        return write(self.settled, self.layout.size, name="settle") if self.settles else None

    def on_constraints(self, state: State):
        """State moved onto the constraints, its rates, and (weakness of the closing rows, gap that is left), by a call."""
        (n_q, n_v), found = (self.system.n_q, self.system.n_v), self.closed([state.t], state.q, state.v)
        q, v, acceleration, power, rest = np.split(found, np.cumsum([n_q, n_v, n_v, 3]))
        return State(state.t, q, v), Rates(acceleration, power), rest


def _weakness(pivots):
    """Sum of inverse pivots, and one."""
    return 1.0 + sum(1.0 / pivot for pivot in pivots)


def off_unit(system: System, q):
    """By how much quaternions are not of unit length."""
    squares = [q[place] @ q[place] for place in system.quaternions.values()]
    return sum((np.abs(square - 1.0) for square in squares), 0.0)


def applied_loads(system: System, loads, state: State):
    """Generalised forces (n_v,), forces on bodies in principal axes, and power (3,) of loads; numbers or expressions."""
    if not loads:
        return np.zeros(system.n_v), {}, np.zeros(3)
    motion = kinematics(system, state)
    applied = Applied(motion, loads)
    return applied.P, applied.on_bodies(motion), np.array([applied.driven, applied.loaded, applied.dissipated])


def largest(values):
    """Largest absolute value."""
    return _fold(math.maximum, np.abs(values))


def _fold(function, values):
    total = values[0]
    for value in values[1:]:
        total = function(total, value)
    return total
