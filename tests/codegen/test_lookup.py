"""Tables whose rows are data: numbers, machine code and exported code agree with scipy, and slopes are exact."""

import ctypes
import subprocess

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PPoly

from gauss import math
from gauss.analysis.export.c_code import PRELUDE, CBody
from gauss.analysis.export.casadi_function import casadi_function
from gauss.analysis.export.exported_function import ExportedFunction
from gauss.codegen import Column, Expression, Function, Graph, Kernel, content_digest, forward, numbers_of, substitute, write
from gauss.dynamics.laws.intervals import Interval, enclose

ROUNDING = 4e-15  # relative to the largest value: of a polynomial about the begin of its piece
ROWS = 200
RNG = np.random.default_rng(5)
BREAKS = {"uniform": np.linspace(-1.0, 3.0, ROWS), "uneven": np.sort(RNG.uniform(-1.0, 3.0, ROWS))}
VALUES = RNG.standard_normal(ROWS)
STEPS = RNG.standard_normal((1, ROWS - 1))


def places(breaks: np.ndarray) -> np.ndarray:
    """Random numbers, the breaks, their neighbours, and numbers beyond the table."""
    beside = np.nextafter(breaks, np.inf), np.nextafter(breaks, -np.inf)
    return np.concatenate([RNG.uniform(-2.0, 4.0, 301), breaks, *beside, [-1e300, 1e300]])


def tables(breaks: np.ndarray) -> dict:
    """Traced function, its value by another library, and the derivative of that."""
    spline = CubicSpline(breaks, np.sin(breaks))
    slopes = np.append(0.0, np.append(np.diff(VALUES) / np.diff(breaks), 0.0))
    steps = PPoly(STEPS, breaks)
    before = lambda x: STEPS[0][np.clip(np.searchsorted(breaks, x) - 1, 0, ROWS - 2)]  # noqa: E731
    return {
        "lines": (
            lambda x: math.interp(x, breaks, VALUES),
            lambda x: np.interp(x, breaks, VALUES),
            lambda x: slopes[np.searchsorted(breaks, x)],
        ),
        "spline": (lambda x: math.piecewise(spline, x), spline, spline.derivative()),
        "steps": (lambda x: math.piecewise(steps, x), before, lambda x: 0.0 * x),
    }


CASES = [(spaced, name) for spaced in BREAKS for name in ("lines", "spline", "steps")]


def case(spaced: str, name: str):
    """Traced function of one number, numbers, values and slopes there."""
    law, value, slope = tables(BREAKS[spaced])[name]
    x = places(BREAKS[spaced])
    x = x if name != "spline" else x[np.abs(x) < 10.0]
    function = write(lambda given: [law(given[0])], 1)
    slopes = Function("slope", function.inputs, list(forward(function.outputs, function.inputs, [1.0])))
    return function, slopes, x, value(x), slope(x)


def near(expected: np.ndarray):
    """Comparison to rounding."""
    return pytest.approx(expected, rel=ROUNDING, abs=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize(("spaced", "name"), CASES)
def test_machine_code_has_the_values_and_the_slopes_of_the_table(spaced, name):
    """On single states and in vectors of states, bit for bit the same."""
    function, slope, x, expected, expected_slope = case(spaced, name)
    code = Kernel(function)
    found = code(x[None])[0]
    assert found == near(expected)
    assert [code(np.array([one]))[0] for one in x[::9]] == list(found[::9])
    inner = ~np.isin(x, BREAKS[spaced])  # at a break both slopes are right
    assert Kernel(slope)(x[None])[0][inner] == near(expected_slope[inner])


@pytest.mark.parametrize(("spaced", "name"), CASES)
def test_numbers_and_intervals_agree_with_machine_code(spaced, name):
    """Evaluated, substituted and enclosed; each interval holds the values of its numbers."""
    function, _, x, expected, _ = case(spaced, name)
    (symbol,), (output,) = function.inputs, function.outputs
    value = numbers_of([output], [symbol])
    assert [value([one])[0] for one in x[::17]] == near(expected[::17])
    assert [float(substitute([output], [symbol], [one])[0].value) for one in x[::17]] == near(expected[::17])
    assert enclose([output], {symbol.index: Interval.point(x)})[0].low == near(expected)
    ends = np.sort(RNG.uniform(-2.0, 4.0, (2, 60)), axis=0)
    inside = ends[0] + np.linspace(0.0, 1.0, 21)[:, None] * (ends[1] - ends[0])
    low, high = enclose([output], {symbol.index: Interval(*ends)})[0]
    values, margin = Kernel(function)(inside.reshape(1, -1))[0].reshape(inside.shape), ROUNDING * np.abs(expected).max()
    assert ((values >= low - margin) & (values <= high + margin)).all()


@pytest.mark.parametrize(("spaced", "name"), CASES)
def test_code_that_encloses_holds_the_values(spaced, name):
    """Enclosures over expressions, as machine code of the checks of steps has them."""
    law = tables(BREAKS[spaced])[name][0]
    graph = Graph()
    symbol = graph.symbol("x")
    output = law(symbol)

    def enclosed(ends):
        low, high = enclose([output], {symbol.index: Interval(*ends)})[0]
        return [low, high]

    ends = np.sort(RNG.uniform(-1.5, 3.5, (2, 40)), axis=0)
    ends[1, ::2] = ends[0, ::2] + 0.3 * (BREAKS["uniform"][1] - BREAKS["uniform"][0])
    found = Kernel(write(enclosed, 2))(ends)
    inside = ends[0] + np.linspace(0.0, 1.0, 21)[:, None] * (ends[1] - ends[0])
    values = tables(BREAKS[spaced])[name][1](inside)
    margin = ROUNDING * np.abs(values).max()
    assert ((values >= found[0] - margin) & (values <= found[1] + margin)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("spaced", "name"), CASES)
def test_exported_functions_agree(spaced, name, tmp_path):
    """In C and in CasADi."""
    function, _, x, expected, _ = case(spaced, name)
    exported = ExportedFunction("law", function, {"x": (1,)}, {"y": (1,)})
    x, expected = x[::7], expected[::7]
    found = casadi_function(exported)
    assert [float(found(one)) for one in x] == near(expected)
    body = "\n".join(CBody(exported).statements())
    source, library = tmp_path / "law.c", tmp_path / "law.so"
    source.write_text(f"#include <math.h>\n{PRELUDE}\nvoid law(const double *x, double *y)\n{{\n{body}\n}}\n")
    subprocess.run(["cc", "-std=c99", "-O1", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    law, y = ctypes.CDLL(str(library)).law, np.zeros(1)
    pointer = lambda a: a.ctypes.data_as(ctypes.c_void_p)  # noqa: E731
    values = []
    for one in x:
        law(pointer(np.array([one])), pointer(y))
        values.append(y[0])
    assert values == near(expected)


def test_code_does_not_grow_with_rows():
    """The number of operations of a table is that of a hundred rows."""
    sizes = [len(write(lambda x, n=n: [math.interp(x[0], np.arange(n), np.ones(n) * n)], 1).nodes) for n in (100, 10_000)]
    assert sizes[0] == sizes[1]


def test_tables_are_told_apart_by_content():
    """Equal rows are one table, in a graph and in the keys of code; one other number is another."""
    rows = np.arange(ROWS, dtype=float)
    changed = rows.copy()
    changed[ROWS // 2] += 1e-12

    def law(values):
        return write(lambda x: [math.interp(x[0], rows, values)], 1)

    keys = [content_digest(law(values)) for values in (rows, rows.copy(), changed)]
    assert keys[0] == keys[1] != keys[2]
    assert law(rows).text() == law(rows.copy()).text() != law(changed).text()
    graph = Graph()
    x = graph.symbol("x")
    assert math.interp(x, rows, rows) is math.interp(x, rows, rows.copy())
    assert math.interp(x, rows, rows) is not math.interp(x, rows, changed)


@pytest.mark.parametrize("continuous", [True, False])
def test_only_tables_that_jump_are_said_to(continuous):
    """A spline has bends at most; a table of steps jumps."""
    polynomial = CubicSpline(BREAKS["uniform"], VALUES) if continuous else PPoly(STEPS, BREAKS["uniform"])
    output = math.piecewise(polynomial, Graph().symbol("x"))
    columns = [node.value for node in output.graph.nodes if isinstance(node, Expression) and node.op == "row"]
    assert [isinstance(column, Column) and column.jumps for column in columns] == [not continuous]
