"""What is not a number stays so in tables and in the smaller and the larger of two numbers, however they are evaluated."""

import ctypes
import subprocess

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from gauss import math
from gauss.analysis.export.c_code import PRELUDE, CBody
from gauss.analysis.export.casadi_function import casadi_function
from gauss.analysis.export.exported_function import ExportedFunction
from gauss.codegen import Function, Graph, Kernel, forward, numbers_of, substitute, write

NAN, EVEN = np.nan, np.linspace(-1.0, 3.0, 100)
UNEVEN = np.sort(np.append(np.random.default_rng(3).uniform(-1.0, 3.0, 98), [-1.0, 3.0]))
LAWS = {
    "minimum": lambda x, y: math.minimum(x, y),
    "maximum": lambda x, y: math.maximum(x, y),
    "below": lambda x, y: math.minimum(x, 1.0) + 0.0 * y,
    "above": lambda x, y: math.maximum(0.0, x),
    "clip": lambda x, y: math.clip(x, -1.0, 1.0),
    "clip between": lambda x, y: math.clip(x, y, 2.0),
    "few rows": lambda x, y: math.interp(x, [0.0, 1.0, 2.0], [3.0, 4.0, 6.0]),
    "even rows": lambda x, y: math.interp(x, EVEN, np.cos(EVEN)),
    "uneven rows": lambda x, y: math.interp(x, UNEVEN, np.cos(UNEVEN)),
    "spline": lambda x, y: math.piecewise(CubicSpline(EVEN, np.cos(EVEN)), x),
}
OF_TWO = ("minimum", "maximum", "clip between")
GIVEN = np.array([(x, y) for x in (-0.0, 0.0, 0.5, -3.0, 7.0, NAN) for y in (0.0, -0.0, 0.25, -4.0, NAN)])
ROUNDING = 1e-14  # of a table, relative to 1


def traced(name: str) -> tuple[Function, np.ndarray]:
    """A law, and where it is not a number."""
    missing = np.isnan(GIVEN[:, 0]) | (np.isnan(GIVEN[:, 1]) & (name in OF_TWO))
    return write(lambda x: [LAWS[name](x[0], x[1])], 2, name="law"), missing


def plain(name: str) -> np.ndarray:
    return np.array([float(LAWS[name](np.float64(x), np.float64(y))) for x, y in np.where(np.isnan(GIVEN), 0.1, GIVEN)])


@pytest.mark.parametrize("name", LAWS)
def test_machine_code_keeps_it(name):
    """On single states and in vectors, where all other results are bit for bit the same."""
    function, missing = traced(name)
    code = Kernel(function)
    found = code(GIVEN.T)[0]
    assert (np.isnan(found) == missing).all()
    singles = np.array([code(one)[0] for one in GIVEN])
    assert singles[~missing].tobytes() == found[~missing].tobytes() and np.isnan(singles[missing]).all()
    assert found[~missing] == pytest.approx(plain(name)[~missing], rel=ROUNDING, abs=ROUNDING)


@pytest.mark.parametrize("name", LAWS)
def test_numbers_keep_it(name):
    """Evaluated without machine code, and folded."""
    function, missing = traced(name)
    value = numbers_of(function.outputs, function.inputs)
    assert (np.isnan([value(list(one))[0] for one in GIVEN]) == missing).all()
    folded = [substitute(function.outputs, function.inputs, list(one))[0] for one in GIVEN]
    assert (np.isnan([float(one.value) for one in folded]) == missing).all()


@pytest.mark.parametrize("name", ["even rows", "uneven rows", "spline"])
def test_slopes_of_tables_keep_it(name):
    function, _ = traced(name)
    slope = Kernel(Function("slope", function.inputs, list(forward(function.outputs, function.inputs, [1.0, 0.0]))))
    found = slope(GIVEN.T)[0]
    assert (np.isnan(found) == np.isnan(GIVEN[:, 0])).all()


@pytest.mark.parametrize("function", [math.minimum, math.maximum])
def test_a_constant_that_is_none_makes_the_result_none(function):
    x = Graph().symbol("x")
    with np.errstate(invalid="ignore"):
        assert all(np.isnan(function(*pair).value) for pair in ((x, NAN), (NAN, x)))


@pytest.mark.parametrize("zero, other", [(0.0, -0.0), (-0.0, 0.0)])
def test_of_two_zeros_it_is_the_constant_else_the_first(zero, other):
    """As before minima and maxima kept what is not a number: no sign of a result changes."""
    for function in (math.minimum, math.maximum):
        pair = Kernel(write(lambda x, function=function: [function(x[0], x[1])], 2))([zero, other])[0]
        one = Kernel(write(lambda x, function=function: [function(x[0], 0.0), function(0.0, x[0])], 1))([other])
        assert np.signbit(pair) == np.signbit(zero) and not np.signbit(one).any()


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_exported_functions_keep_it(name, tmp_path):
    """In C and in CasADi."""
    function, missing = traced(name)
    exported = ExportedFunction("law", function, {"x": (2,)}, {"y": (1,)})
    found = casadi_function(exported)
    assert (np.isnan([float(found(one)) for one in GIVEN]) == missing).all()
    body = "\n".join(CBody(exported).statements())
    source, library = tmp_path / "law.c", tmp_path / "law.so"
    source.write_text(f"#include <math.h>\n{PRELUDE}\nvoid law(const double *x, double *y)\n{{\n{body}\n}}\n")
    subprocess.run(["cc", "-std=c99", "-O1", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    law, y, values = ctypes.CDLL(str(library)).law, np.zeros(1), []
    for one in GIVEN:
        law(one.copy().ctypes.data_as(ctypes.c_void_p), y.ctypes.data_as(ctypes.c_void_p))
        values.append(y[0])
    assert (np.isnan(values) == missing).all()
    assert np.array(values)[~missing] == pytest.approx(plain(name)[~missing], rel=ROUNDING, abs=ROUNDING)
