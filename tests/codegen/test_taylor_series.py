"""Taylor coefficients in machine code against power series of 40 digits, composed in another way."""

import ctypes

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf

import gauss
from gauss.codegen import HIGHEST_ORDER, LEAD, ROW, Series, Writer, machine, without_series, write
from gauss.codegen.recurrences import OPERATIONS_PER_PIECE
from gauss.system import coordinate_rates

mpmath.mp.dps = 40
ROUNDING = 1e-12  # relative to the largest term of a coefficient: it is a sum of at most 24 products of such sums
CHAOS = 1e-9  # the same of operations one after the other that were picked at random: they may cancel


def coefficients(function, t, y, order: int) -> np.ndarray:
    """Coefficients (n, order + 1) of y' = f(t, y), by machine code."""
    series, writer = Series(function), Writer()
    writer.export(series, "go")
    code = machine.load(str(writer.module))
    inputs, found = np.array([t, *y, order], dtype=float), np.full(len(series.outputs), np.nan)
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(code.address("go"))(inputs.ctypes.data, found.ctypes.data)
    return found[: ROW * len(y)].reshape(-1, ROW)[:, LEAD : LEAD + order + 1]


class Power:
    """Truncated power series of exact numbers; functions of it by Horner's scheme in all but its first coefficient."""

    def __init__(self, c):
        self.c = list(c)

    def _lift(self, other):
        return other if isinstance(other, Power) else Power([mpf(other)] + [mpf(0)] * (len(self.c) - 1))

    def __add__(self, other):
        return Power(a + b for a, b in zip(self.c, self._lift(other).c, strict=True))

    def __neg__(self):
        return Power(-a for a in self.c)

    def __sub__(self, other):
        return self + -self._lift(other)

    def __mul__(self, other):
        b = self._lift(other).c
        return Power(sum(self.c[j] * b[k - j] for j in range(k + 1)) for k in range(len(b)))

    def __truediv__(self, other):
        return self * self._lift(other).of(lambda x: 1 / x)

    def of(self, function):
        """Series of a function of this one, from the function's own Taylor series."""
        n = len(self.c)
        outer, rest = mpmath.taylor(function, self.c[0], n - 1), Power([mpf(0), *self.c[1:]])
        total = self._lift(0)
        for a in outer[::-1]:
            total = total * rest + a
        return total


OPERATIONS = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "neg": lambda x: -x,
    "sqrt": lambda x: x.of(mpmath.sqrt),
    "sin": lambda x: x.of(mpmath.sin),
    "cos": lambda x: x.of(mpmath.cos),
    "exp": lambda x: x.of(mpmath.exp),
    "log": lambda x: x.of(mpmath.log),
}


def exact(function, t, y, order: int) -> np.ndarray:
    """The same by Picard's iteration with power series of 40 digits."""
    found = [Power([mpf(float(a))] + [mpf(0)] * order) for a in y]
    for k in range(order):
        # each turn makes one more coefficient right; those of higher order are not needed yet
        short = [Power(u.c[: k + 1]) for u in found]
        time = Power(([mpf(float(t)), mpf(1)] + [mpf(0)] * order)[: k + 1])
        values = dict(zip((x.index for x in function.inputs), [time, *short], strict=True))
        for node in function.nodes:
            if node.op == "constant":
                values[node.index] = Power([mpf(node.value)] + [mpf(0)] * k)
            elif node.op != "symbol":
                values[node.index] = OPERATIONS[node.op](*(values[x.index] for x in node.operands))
        for u, output in zip(found, function.outputs, strict=True):
            slope = values[output.index].c[k] if hasattr(output, "index") else mpf(float(output)) * (k == 0)
            u.c[k + 1] = slope / (k + 1)
    return np.array([[float(a) for a in u.c] for u in found])


def off(found, right) -> float:
    """Largest error of a coefficient, over the largest of its order among all."""
    return float((np.abs(found - right).max(axis=0) / np.maximum(np.abs(right).max(axis=0), 1e-300)).max())


SLOPES = {  # y' of y = (a, b), with what each recurrence does
    "sum": lambda t, a, b: (a + b + 1.5, 2.0 - a),
    "difference": lambda t, a, b: (a - b - 0.5, 0.25 - b),
    "negative": lambda t, a, b: (-b, a),
    "product": lambda t, a, b: (a * b, 1.0 - a * a),
    "product with a number": lambda t, a, b: (3.0 * b, a * -0.5),
    "quotient": lambda t, a, b: (b / a, a / (1.0 + b * b)),
    "quotient of numbers": lambda t, a, b: (1.0 / a, b / 3.0),
    "root": lambda t, a, b: (np.sqrt(a), np.sqrt(1.0 + a * b)),
    "sine": lambda t, a, b: (b, -np.sin(a)),
    "cosine": lambda t, a, b: (np.cos(a * b), np.cos(b)),
    "sine and cosine": lambda t, a, b: (np.sin(a) * np.cos(a), np.cos(a) - np.sin(b)),
    "exponential": lambda t, a, b: (np.exp(-a), np.exp(a * b)),
    "logarithm": lambda t, a, b: (np.log(a), np.log(1.0 + b * b)),
    "power": lambda t, a, b: (a**1.7, a**-2),
    "time": lambda t, a, b: (t, np.sin(2.0 * t) * a + t * b),
    "number": lambda t, a, b: (2.5, 0.0),
    "itself": lambda t, a, b: (a, a),
}


ORDERS = [*((name, 9) for name in SLOPES), ("product", 1), ("time", 2), ("quotient", HIGHEST_ORDER)]


@pytest.mark.slow
@pytest.mark.parametrize("name, order", ORDERS)
def test_recurrences(name, order):
    function = write(lambda t, y: np.array(SLOPES[name](t[0], *y), dtype=object), 1, 2)
    start = (0.4, (0.8, 0.3))
    assert off(coefficients(function, *start, order), exact(function, *start, order)) <= ROUNDING


@st.composite
def graphs(draw):
    """Right-hand sides of three numbers in which everything is made of what was there, away from poles."""
    makers = {
        "add": lambda x, y: x + y,
        "mul": lambda x, y: x * y,
        "sub": lambda x, y: x - y,
        "div": lambda x, y: x / (1.5 + y * y),
        "sin": lambda x, y: np.sin(x + y),
        "cos": lambda x, y: np.cos(x),
        "sqrt": lambda x, y: np.sqrt(1.0 + x * x),
        "exp": lambda x, y: np.exp(np.sin(x)),
        "log": lambda x, y: np.log(2.0 + np.cos(y)),
        "scale": lambda x, y: 0.7 * x - 1.0,
    }
    places = st.integers(0, 30)
    made = draw(st.lists(st.tuples(st.sampled_from(sorted(makers)), places, places), min_size=1, max_size=12))
    ends = draw(st.tuples(places, places, places))

    def slope(t, y):
        values = [*y, t[0]]
        for name, i, j in made:
            values.append(makers[name](values[-1 - i % len(values)], values[-1 - j % len(values)]))
        return np.array([values[-1 - i % len(values)] for i in ends], dtype=object)

    return write(slope, 1, 3)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(graphs(), st.lists(st.floats(-1.0, 1.0).map(lambda x: round(x, 6)), min_size=3, max_size=3))
def test_random_graphs(function, y):
    order = 8
    right = exact(function, 0.25, y, order)
    scale = np.maximum(np.abs(right).max(axis=0), 1.0)
    assert (np.abs(coefficients(function, 0.25, y, order) - right) / scale).max() <= CHAOS


@pytest.mark.slow
@pytest.mark.parametrize("piece", [OPERATIONS_PER_PIECE, 7])
@pytest.mark.parametrize("name", ["double_pendulum", "slider_crank"])
def test_mechanisms(name, piece, monkeypatch):
    """Equations of motion as they are traced: the series of q and v are those of their solution, in however many pieces."""
    from gauss.dynamics.laws.traced_laws import Laws
    from gauss.dynamics.traced_system import Program

    monkeypatch.setattr("gauss.codegen.recurrences.OPERATIONS_PER_PIECE", piece)
    system = gauss.compile_scene(gauss.load(name))
    program, n = Program(system, Laws(system)), system.n_v
    rates = lambda t, q, v: (coordinate_rates(system, q, v), program.rates.inlined(t, q, v)[:n])  # noqa: E731
    function, state = write(rates, 1, system.n_q, n), system.initial_state()
    y = np.concatenate([state.q, state.v])
    assert off(coefficients(function, 0.0, y, 12), exact(function, 0.0, y, 12)) <= CHAOS


def test_what_has_no_series_is_named():
    from gauss import math

    function = write(lambda x: math.maximum(x[0], 0.0) + math.where(x[0] < 1.0, x[0], 2.0), 1)
    assert without_series(function) == ["less", "max", "select"]
