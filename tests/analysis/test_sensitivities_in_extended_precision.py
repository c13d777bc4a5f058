"""State-transition matrices against central differences of motions in extended precision, with loops and impacts.

The forward dynamics are evaluated as an operation graph in numbers of 64 bits of mantissa; steps, location of impacts and
their law are written here: DOP853, Newton's method on the length of a step, Gauss's principle for velocities by the response
to a unit force.
"""

import numpy as np
import pytest
from scipy.integrate import DOP853

import gauss
from gauss.analysis.export.exported_function import exported_functions
from gauss.codegen import Expression
from tests.analysis.test_event_sensitivities import bouncing, started, stopped

Extended = np.longdouble
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(np.finfo(Extended).eps > 1e-18, reason="long double has no extended precision here"),
]
ACCURACY = 1e-9  # relative to the largest derivative; at most 4.5e-11 is seen
STEP = 0.01  # s
DIFFERENCE = Extended(1e-8)  # truncation 1e-16, rounding 1e-19 over it, times the growth of the motion
NEWTON = 8  # steps of the location of an impact
OPERATIONS = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "less": lambda x, y: np.less(x, y).astype(Extended),
    "less_equal": lambda x, y: np.less_equal(x, y).astype(Extended),
    "select": lambda condition, x, y: np.where(condition != 0, x, y),
    "min": np.minimum,
    "max": np.maximum,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
}


class ExtendedMotion:
    """Motions of a system in extended precision, a column each."""

    def __init__(self, system: gauss.System):
        (self.exported,) = exported_functions(system, "forward_dynamics")
        self.n = system.n_v

    def accelerations(self, x, load=None):
        """Accelerations (n, c) of states (2 n, c)."""
        count = x.shape[1]
        given = {"q": x[: self.n], "v": x[self.n :], "load": np.zeros((self.n, count), Extended) if load is None else load}
        rows = [row for name in self.exported.inputs for row in given.get(name, np.zeros((1, count), Extended))]
        function = self.exported.function
        values = {symbol.index: row for symbol, row in zip(function.inputs, rows, strict=True)}
        for node in function.nodes:
            if node.is_constant:
                values[node.index] = Extended(node.value)
            elif node.op != "symbol":
                values[node.index] = OPERATIONS[node.op](*(values[one.index] for one in node.operands))
        found = [values[one.index] if isinstance(one, Expression) else Extended(one) for one in function.outputs]
        return np.array([np.broadcast_to(one, count) for one in found])

    def step(self, x, h):
        """States after a step of DOP853 of length h (c,)."""
        stages = []
        for row in DOP853.A[:12]:
            at = x + h * sum((Extended(a) * k for a, k in zip(row, stages, strict=False) if a), start=np.zeros_like(x))
            stages.append(np.concatenate([at[self.n :], self.accelerations(at)]))
        return x + h * sum(Extended(b) * k for b, k in zip(DOP853.B, stages, strict=True))

    def moved(self, x, span, stop=None):
        """States after a span; ``stop`` is (place, bound, sign of the free side, restitution), or None. Counts impacts."""
        impacts = 0
        for _ in range(round(span / STEP)):
            left = np.full(x.shape[1], Extended(STEP))
            after = self.step(x, left)
            if stop is not None and (self.gap(after, stop) < 0).any():
                x, left = self.struck(x, left, stop)
                after, impacts = self.step(x, left), impacts + 1
            x = after
        return x, impacts

    def gap(self, x, stop):
        place, bound, side, _ = stop
        return side * (x[place] - Extended(bound))

    def struck(self, x, left, stop):
        """States after the impact in a step, and what is left of the step."""
        place, _, side, restitution = stop
        h = left / 2
        for _ in range(NEWTON):
            at = self.step(x, h)
            h = h - self.gap(at, stop) / (side * at[self.n + place])
        at, unit = self.step(x, h), np.zeros((self.n, x.shape[1]), Extended)
        unit[place] = 1
        response = self.accelerations(at, unit) - self.accelerations(at)
        impulse = (1 + Extended(restitution)) * at[self.n + place] / response[place]
        at[self.n :] = at[self.n :] - impulse * response
        return at, left - h


def plain(name, span=0.3, **rates):
    return lambda: (gauss.load(name), rates, span), None


SCENES = {  # scene, rates at the start and span; joint, bound, side, restitution of its stop
    "double pendulum": plain("double_pendulum", A=1.0),
    "cart-pole": plain("cart_pole", rail=0.5),
    "four-bar": plain("four_bar", A=2.0),
    "slider-crank": plain("slider_crank", A=2.0),
    "redundant loop": plain("parallelogram", A1=2.0),
    "bouncing ball": (bouncing, ("z", -0.3, 1, 0.6)),
    "pendulum at a stop": (lambda: stopped("pendulum", "A", low=-0.8, restitution=0.5), ("A", -0.8, 1, 0.5)),
    "double pendulum at a stop": (
        lambda: stopped("double_pendulum", "B", high=-0.7, restitution=0.4, B=2.0, span=0.3),
        ("B", -0.7, -1, 0.4),
    ),
    "four-bar at a stop": (
        lambda: stopped("four_bar", "A", high=0.1, restitution=0.6, A=2.0, span=0.4),
        ("A", 0.1, -1, 0.6),
    ),
    "slider-crank at a stop": (
        lambda: stopped("slider_crank", "A", high=0.05, restitution=0.5, A=2.0, span=0.4),
        ("A", 0.05, -1, 0.5),
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_transition_matrices_are_differences_in_extended_precision(name):
    make, stop = SCENES[name]
    scene, rates, span = make()
    system, start = started(scene, rates)
    found = gauss.sensitivities(system, span, state=start, step=STEP, integrator="dop853")
    scene.contacts.clear()
    motion = ExtendedMotion(gauss.compile_scene(scene))
    along = found.start[0]
    x = np.concatenate([start.q, start.v]).astype(Extended)[:, None]
    columns = np.concatenate([x + DIFFERENCE * along, x - DIFFERENCE * along], axis=1)
    ends, impacts = motion.moved(columns, span, stop and (system.column(stop[0]), *stop[1:]))
    k = along.shape[1]
    expected = ((ends[:, :k] - ends[:, k:]) / (2 * DIFFERENCE)).astype(float)
    assert (impacts > 0) == (stop is not None)
    assert np.abs(found.start[-1] - expected).max() <= ACCURACY * np.abs(expected).max()
