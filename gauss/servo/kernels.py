"""Machine code of a servo: rows G and directions W of any system, responses X_W, X_G of one with traceable dynamics."""

import numpy as np

from gauss.codegen import Function, Kernel, forward, jacobian
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.traced_laws import Laws, needs_poses
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.traced_system import applied_loads
from gauss.servo.actuators import push
from gauss.servo.instant import ServoInstant
from gauss.servo.observed import MotionSymbols, body_inputs, body_symbols
from gauss.servo.relation import ScalarRelation, ServoRows, rows, scalars
from gauss.servo.servo import Servo
from gauss.system import State, System


class ShapedKernel:
    """Machine code of arrays of expressions of symbols."""

    def __init__(self, inputs, outputs):
        flat = [entry for output in outputs for entry in np.ravel(np.asarray(output, dtype=object))]
        self.kernel = Kernel(Function("servo", list(inputs), flat), batch=False)
        ends = np.cumsum([0, *(np.size(output) for output in outputs)])
        shapes = [np.shape(output) for output in outputs]
        self.parts = [(slice(*pair), shape) for *pair, shape in zip(ends[:-1], ends[1:], shapes, strict=True)]

    def __call__(self, inputs) -> list[np.ndarray]:
        """Outputs in their shapes."""
        numbers = self.kernel(inputs)
        return [numbers[place].reshape(shape) for place, shape in self.parts]


def directions(servo: Servo, symbols: MotionSymbols) -> np.ndarray:
    """Directions W (j, n_v) in tree coordinates: derivatives of the power of one unit of each effort."""
    motion, found = symbols.motion, []
    for actuator, number in servo.each_effort:
        applied = Applied(motion, ())
        push(actuator, number, motion, applied)
        bodies = range(servo.system.structure.n_bodies)
        power = sum((applied.F[i] @ motion.u[i] + applied.M[i] @ motion.W[i] for i in bodies), applied.P @ motion.state.v)
        found.append(jacobian([power], motion.state.v)[0])
    return np.array(found, dtype=object).reshape(len(found), servo.system.n_v)


def body_directions(servo: Servo, motion: Kinematics) -> np.ndarray:
    """Directions W (j, 6n + p) on the bodies, in principal axes and world axes, and on the coordinates."""
    found = []
    for actuator, number in servo.each_effort:
        applied = Applied(motion, ())
        push(actuator, number, motion, applied)
        bodies = range(servo.system.structure.n_bodies)
        on_bodies = [part for i in bodies for part in (motion.R[i].T @ applied.M[i], applied.F[i])]
        found.append(np.concatenate([*on_bodies, applied.P]))
    return np.array(found).reshape(len(found), servo.system.Phi.size + servo.system.n_v)


def untraceable(system: System) -> list[str]:
    """Reasons why the dynamics of a system cannot be traced; none if they can."""
    called = [bound for bound in Laws(system).called if not bound.on_coordinates or needs_poses(bound.load)]
    return obstacles(system) + [f"the law of {bound.load.name!r} is an opaque callback of the motion" for bound in called]


def accelerations(symbols: MotionSymbols, laws: Laws, effort) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (n_v,) in symbols under the traced loads and further generalised forces, and power (3,) of the loads."""
    system, state = symbols.motion.system, symbols.motion.state
    own, forces, power = applied_loads(system, laws.traced, state)
    return Mechanism(system, state.q, state.v).motion(own + effort, forces)[0], power


class BodyRows:
    """Rows A_s a + B_s q̈ = D_s of all relations in maximal coordinates."""

    def __init__(self, servo: Servo):
        symbols = body_symbols(servo.system)
        ordered = [*(x for x in servo.relations if x.ideal), *(x for x in servo.relations if not x.ideal)]
        self.kernel = ShapedKernel(symbols.inputs, rows(scalars(ordered, symbols), symbols))

    def __call__(self, motion: Kinematics) -> ServoRows:
        """Rows (r, 6n + p) in numbers."""
        return ServoRows(*self.kernel(body_inputs(motion)))


class TreeRows:
    """Rows G q̈ = γ of some relations in tree coordinates, and directions of the efforts."""

    def __init__(self, servo: Servo, found: list[ScalarRelation]):
        symbols = servo.symbols
        self.kernel = ShapedKernel(symbols.inputs, [*rows(found, symbols), directions(servo, symbols)])

    def __call__(self, state: State) -> tuple[ServoRows, np.ndarray]:
        """Rows and directions in numbers."""
        *parts, W = self.kernel(np.concatenate([state.q, state.v, [state.t]]))
        return ServoRows(*parts), W


class EffortResponses:
    """Instants by machine code, of systems that are not :func:`untraceable`."""

    def __init__(self, servo: Servo, found: list[ScalarRelation]):
        self.system, laws = servo.system, Laws(servo.system)
        self.called = laws.called
        symbols = servo.symbols
        effort = symbols.t.graph.symbols("P", self.system.n_v)
        free, power = accelerations(symbols, laws, effort)
        rates, W = rows(found, symbols), directions(servo, symbols)
        answers = [
            np.array([forward(free, effort, pull) for pull in pulls], dtype=object).reshape(len(pulls), self.system.n_v).T
            for pulls in (W, rates.G)
        ]
        self.kernel = ShapedKernel([*symbols.inputs, *effort], [*rates, W, free, *answers, power])

    def __call__(self, state: State) -> ServoInstant:
        """Instant in tree coordinates."""
        applied = Applied(Kinematics(self.system, state), self.called)
        inputs = np.concatenate([state.q, state.v, [state.t], applied.P])
        position, velocity, G, gamma, W, free, X_W, X_G, power = self.kernel(inputs)
        power = power + [applied.driven, applied.loaded, applied.dissipated]
        return ServoInstant(position, velocity, G, gamma, W, free, X_W, X_G, W @ state.v, power)


def body_rows(servo: Servo) -> BodyRows:
    """Rows in maximal coordinates; compiled at the first call."""
    return servo.made((BodyRows,), lambda: BodyRows(servo))


def tree_rows(servo: Servo, found: tuple[ScalarRelation, ...]) -> TreeRows:
    """Rows in tree coordinates of these relations; compiled at the first call."""
    return servo.made((TreeRows, found), lambda: TreeRows(servo, list(found)))


def responses(servo: Servo, found: tuple[ScalarRelation, ...]) -> EffortResponses:
    """Rows and responses of these relations; compiled at the first call."""
    return servo.made((EffortResponses, found), lambda: EffortResponses(servo, list(found)))


def untraced(servo: Servo) -> list[str]:
    """Reasons why the dynamics of a servo's system cannot be traced, kept."""
    return servo.made((untraceable,), lambda: untraceable(servo.system))
