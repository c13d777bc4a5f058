"""The accelerations that gauss traces, as expressions of heyoka: its Taylor method, in double and in extended precision."""

import heyoka as hy
import numpy as np

from gauss.codegen import write
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.traced_system import Program
from gauss.system import State, System, coordinate_rates

OPERATIONS = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "neg": lambda x: -x,
    "sqrt": hy.sqrt,
    "sin": hy.sin,
    "cos": hy.cos,
    "exp": hy.exp,
    "log": hy.log,
}


STRAIGHT = 400  # operations up to which straight-line code is made, in two seconds for the finest tolerance


class HeyokaTaylor:
    """Taylor integrator of a system.

    Parameters
    ----------
    system : System
        What moves; everything in it is traced.
    tolerance : float
        Of a step.
    kind : type
        Numbers: float, or numpy's longdouble.

    Of few operations heyoka writes straight-line code, as is its default: twice as fast as its compact
    code, but compiled in a time that grows with their number and the square of the order.
    """

    def __init__(self, system: System, tolerance: float, kind=float):
        self.system, self.kind, program = system, kind, Program(system, Laws(system))
        n_q, n_v = system.n_q, system.n_v

        def slope(t, q, v):
            return coordinate_rates(system, q, v), program._rates(t, q, v)[0]

        function = write(slope, 1, n_q, n_v)
        q, v = hy.make_vars(*[f"q{k}" for k in range(n_q)]), hy.make_vars(*[f"v{k}" for k in range(n_v)])
        states = [*np.atleast_1d(q), *np.atleast_1d(v)]
        values = dict(zip((x.index for x in function.inputs), [hy.time, *states], strict=True))
        for node in function.nodes:
            if node.op == "constant":
                values[node.index] = hy.expression(kind(node.value))
            elif node.op != "symbol":
                values[node.index] = OPERATIONS[node.op](*(values[x.index] for x in node.operands))
        rates = [values[x.index] if hasattr(x, "index") else hy.expression(kind(x)) for x in function.outputs]
        start = system.initial_state()
        self.start = np.concatenate([start.q, start.v]).astype(kind)
        self.integrator = hy.taylor_adaptive(
            list(zip(states, rates, strict=True)),
            self.start.copy(),
            tol=kind(tolerance),
            fp_type=kind,
            compact_mode=len(function.nodes) > STRAIGHT,
        )

    def begun(self) -> hy.taylor_adaptive:
        """Integrator at the start."""
        self.integrator.time = self.kind(0)
        self.integrator.state[:] = self.start
        return self.integrator

    def states(self, times: np.ndarray) -> np.ndarray:
        """States (k, n_q + n_v) at rising times, of which the first is the start."""
        outcome, *_, states = self.begun().propagate_grid(times)
        _check(outcome)
        return np.array(states, dtype=float)

    def move(self, duration: float):
        """Move from the start to the end."""
        _check(self.begun().propagate_until(self.kind(duration))[0])

    def centres(self) -> np.ndarray:
        """Centres of mass (n, 3) where it is."""
        q, v = np.split(np.array(self.integrator.state, dtype=float), [self.system.n_q])
        return np.array(
            kinematics(self.system, State(float(self.integrator.time), q, v)).x[: self.system.structure.n_bodies]
        )


def _check(outcome: hy.taylor_outcome):
    if outcome != hy.taylor_outcome.time_limit:
        raise ArithmeticError(f"Taylor's method stopped: {outcome}")
