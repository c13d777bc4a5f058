"""Motion of a system in symbols, with the rules of its time derivative: arguments of relations and actuators.

Two sets of symbols serve. In tree coordinates poses follow from the coordinates, and rows come out as G q̈ = γ. In
maximal coordinates every pose and velocity is a symbol of its own, and rows come out as A_s a + B_s q̈ = D_s.
"""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Expression, Graph, forward
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.rotations import skew
from gauss.system import State, System


class Observed(Kinematics):
    """Kinematics in symbols, with accelerations.

    Parameters
    ----------
    motion : Kinematics
        Poses and velocities.
    derivative : callable
        Time derivative of expressions of it.
    accelerations : sequence of Expression
        Accelerations of the coordinates.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> cart = gauss.load("cart_pole")
    >>> law = lambda t, motion: motion.joint_acceleration("rail") - 0.5
    >>> smooth = servo.ServoRelation("smooth", law, level="acceleration")
    >>> held = servo.Servo(cart, [smooth], [servo.Motor("motor", "rail")])
    >>> float(servo.solve(held, servo.initial_state(held)).qdd[0].round(4))
    0.5
    """

    def __init__(self, motion: Kinematics, derivative, accelerations):
        self.__dict__.update(motion.__dict__)
        self._derivative, self._accelerations = derivative, accelerations

    def acceleration(self, frame: str, point=(0.0, 0.0, 0.0)) -> np.ndarray:
        """Acceleration (3,) in world [m/s²] of a point fixed in a body."""
        return self._derivative(self.velocity(frame, point))

    def angular_acceleration(self, frame: str) -> np.ndarray:
        """Angular acceleration (3,) in world axes [rad/s²]."""
        return self._derivative(self.angular_velocity(frame))

    def joint_acceleration(self, joint: str):
        """Acceleration of a joint [rad/s², m/s²]: a number for one freedom, else an array."""
        values = self._accelerations[self.system.joint(joint).v]
        return values[0] if len(values) == 1 else values


@dataclass(frozen=True)
class MotionSymbols:
    """Symbols of the motion of one system."""

    inputs: list  # positions, velocities and time
    rates: list  # time derivative of each input
    velocities: list  # those of the inputs that are velocities
    accelerations: list  # unknowns, in which the rows are linear
    t: Expression  # time
    motion: Observed  # argument of residuals and actuators

    def derivative(self, outputs) -> np.ndarray:
        """Time derivative of expressions of the inputs."""
        return forward(np.asarray(outputs, dtype=object), self.inputs, self.rates)


def tree_symbols(system: System) -> MotionSymbols:
    """Symbols of coordinates q (n_q), rates v (n_v) and time; inputs in this order."""
    graph = Graph()
    q, v, a = graph.symbols("q", system.n_q), graph.symbols("v", system.n_v), graph.symbols("a", system.n_v)
    t = graph.symbol("t")
    inputs, rates = [*q, *v, t], [*_coordinate_rates(system, q, v), *a, 1.0]
    motion = Observed(kinematics(system, State(t, q, v)), lambda outputs: forward(outputs, inputs, rates), a)
    return MotionSymbols(inputs, rates, list(v), list(a), t, motion)


def body_symbols(system: System) -> MotionSymbols:
    """Symbols of q, v, t, then R (9n), x, W, u (3n each) of the bodies; accelerations are (a, q̈)."""
    graph, n = Graph(), system.structure.n_bodies
    q, v, t = graph.symbols("q", system.n_q), graph.symbols("v", system.n_v), graph.symbol("t")
    R = graph.symbols("R", 9 * n).reshape(n, 3, 3)
    x, W, u = (graph.symbols(name, 3 * n).reshape(n, 3) for name in ("x", "W", "u"))
    a, q_accelerations = graph.symbols("a", 6 * n), graph.symbols("qdd", system.n_v)
    motion = Kinematics.of_bodies(system, State(t, q, v), R, x, W, u)
    turning = [skew(W[i]) @ R[i] for i in range(n)]
    spinning = [R[i] @ a[6 * i : 6 * i + 3] for i in range(n)]
    inputs = [*q, *v, t, *R.ravel(), *x.ravel(), *W.ravel(), *u.ravel()]
    rates = [*_coordinate_rates(system, q, v), *q_accelerations, 1.0, *np.ravel(turning), *u.ravel(), *np.ravel(spinning)]
    rates += [entry for i in range(n) for entry in a[6 * i + 3 : 6 * i + 6]]
    observed = Observed(motion, lambda outputs: forward(outputs, inputs, rates), q_accelerations)
    return MotionSymbols(inputs, rates, [*v, *W.ravel(), *u.ravel()], [*a, *q_accelerations], t, observed)


def body_inputs(motion: Kinematics) -> np.ndarray:
    """Numbers for the inputs of :func:`body_symbols`."""
    n, state = motion.system.structure.n_bodies, motion.state
    parts = [np.ravel(np.array(part[:n])) for part in (motion.R, motion.x, motion.W, motion.u)]
    return np.concatenate([state.q, state.v, [state.t], *parts])


def _coordinate_rates(system: System, q, v) -> list:
    return [rate for joint in system.joints for rate in joint.pair.coordinate_rate(q[joint.q], v[joint.v])]
