"""Traced functions against numpy, CasADi and 40 digits; derivatives; machine code kept on disk."""

import os
from concurrent.futures import ThreadPoolExecutor

import casadi
import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gauss import math, rotations
from gauss.codegen import (
    Expression,
    Function,
    Graph,
    Kernel,
    branches,
    count,
    forward,
    jacobian,
    numbers_of,
    object_cache,
    object_code,
    processor,
    reverse,
    substitute,
    trace,
)

ROUNDING = 1e-14  # of a dozen operations on numbers near 1
ULP = 1.0  # allowed error of sine and cosine


def everything(x):
    """Every operation, written for numbers and symbols alike."""
    a, b = x[0], x[1]
    return [
        a + b * 2.0 - 1.0,
        -a / b,
        np.sqrt(b) * np.sin(a) + np.cos(a * b),
        np.exp(a) * np.log(b),
        np.arctan2(a, b),
        a**3 - b**-2 + b**0.5,
        np.tan(a),
        abs(a),
        math.minimum(a * b, 0.3) - math.maximum(a, b),
        math.where(a < b, a * a, b),
    ]


def in_casadi():
    x = casadi.SX.sym("x", 2)
    a, b = x[0], x[1]
    outputs = casadi.vertcat(
        a + b * 2 - 1,
        -a / b,
        casadi.sqrt(b) * casadi.sin(a) + casadi.cos(a * b),
        casadi.exp(a) * casadi.log(b),
        casadi.atan2(a, b),
        a**3 - b**-2 + b**0.5,
        casadi.tan(a),
        casadi.fabs(a),
        casadi.fmin(a * b, 0.3) - casadi.fmax(a, b),
        casadi.if_else(a < b, a * a, b),
    )
    return x, outputs


@pytest.mark.parametrize("columns", [1, 2, 7, 8, 9, 33])
def test_kernels_compute_what_numpy_computes(columns):
    kernel = trace(lambda x: np.array(everything(x)), 2)
    x = np.random.default_rng(0).uniform(0.2, 1.2, (2, columns))
    expected = np.array(everything(x))
    assert np.abs(kernel(x) - expected).max() <= ROUNDING * np.abs(expected).max()
    assert np.array_equal(kernel(x[:, 0]), kernel(x[:, :1])[:, 0])


def test_the_width_of_the_batch_changes_nothing_but_rounding():
    kernel = trace(lambda x: np.array(everything(x)), 2)
    x = np.random.default_rng(1).uniform(0.2, 1.2, (2, 64))
    singly = np.array([kernel(column) for column in x.T]).T
    assert np.abs(kernel(x) - singly).max() <= ROUNDING


@pytest.mark.parametrize("width", [2, 4, 8])
def test_registers_of_any_width(width, monkeypatch):
    monkeypatch.setattr(processor, "width", lambda: width)
    x = np.random.default_rng(2).uniform(0.2, 1.2, (2, 2 * width + 1))
    expected = np.array(everything(x))
    assert np.abs(trace(lambda x: np.array(everything(x)), 2)(x) - expected).max() <= ROUNDING * np.abs(expected).max()


@pytest.mark.peer
def test_jacobian_agrees_with_casadi():
    traced = trace(lambda y: jacobian(everything(y), y).ravel(), 2)
    symbol, outputs = in_casadi()
    reference = casadi.Function("J", [symbol], [casadi.jacobian(outputs, symbol)])
    for point in np.random.default_rng(2).uniform(0.2, 1.2, (20, 2)):
        expected = np.array(reference(point))
        assert np.abs(traced(point).reshape(10, 2) - expected).max() <= 1e-13 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("which", range(10))
def test_forward_and_reverse_agree_with_casadi(which):
    point, (symbol, outputs) = np.array([0.4, 0.9]), in_casadi()
    adjoint = trace(lambda x: reverse(everything(x)[which], x), 2)(point)
    tangent = trace(lambda x: jacobian([everything(x)[which]], x)[0], 2)(point)
    gradient = casadi.Function("g", [symbol], [casadi.gradient(outputs[which], symbol)])(point)
    assert adjoint == pytest.approx(tangent, rel=1e-13)
    assert adjoint == pytest.approx(np.array(gradient).ravel(), rel=1e-13)


def test_directional_derivative():
    kernel = trace(lambda x, d: forward(np.array(everything(x)), x, d), 2, 2)
    x, d, h = np.array([0.4, 0.9]), np.array([0.3, -0.7]), 1e-6
    difference = (np.array(everything(x + h * d)) - np.array(everything(x - h * d))) / (2 * h)
    assert kernel(np.concatenate([x, d])) == pytest.approx(difference, rel=1e-8)


def test_folding():
    graph = Graph()
    x, y = graph.symbols("x", 2)
    zero, one = graph.constant(0.0), graph.constant(1.0)
    assert x + 0 is x and 0 + x is x and x - 0 is x and x * 1 is x and x / 1 is x
    assert x * 0 is zero and x - x is zero and 0 / x is zero and x**0 is one
    assert x * y is y * x and x + y is y + x
    assert (-x) * (-y) is x * y and x + (-y) is x - y and -(x - y) is y - x
    opposite = -x
    assert -opposite is x
    assert (graph.constant(2.0) * 3.0 + 1.0).value == 7.0
    assert graph.constant(4.0).sqrt().value == 2.0
    assert graph.select(x < y, x, x) is x and graph.select(one, x, y) is x
    R = np.array([[np.cos(x), -np.sin(x), 0.0], [np.sin(x), np.cos(x), 0.0], [0.0, 0.0, 1.0]])
    assert count(R @ np.array([0.0, 0.0, 1.0])) == {}
    assert count(R @ np.eye(3)) == {"sin": 1, "cos": 1, "neg": 1}


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from("+-*/"), st.floats(0.5, 2.0), st.booleans()), min_size=1, max_size=30))
def test_random_formulas(steps):
    def formula(x):
        total = x[0]
        for op, number, use in steps:
            other = x[1] if use else number
            total = {"+": total + other, "-": total - other, "*": total * other, "/": total / other}[op]
        return np.array([total])

    point = np.array([1.1, 0.7])
    expected = formula(point)
    assert trace(formula, 2, batch=False)(point) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-3, 1.0, 50.0, 1e3, 1e5, 1e8, 1e300])
def test_sine_and_cosine_to_one_ulp(size, monkeypatch):
    rng = np.random.default_rng(3)
    near = np.round(rng.uniform(-size, size, 100) / (np.pi / 2)) * (np.pi / 2)  # hardest: near multiples of π/2
    x = np.concatenate([rng.uniform(-size, size, 300), near])
    with mp.workdps(50 + int(np.log10(size + 1.0))):
        exact = [[function(mp.mpf(value)) for value in x] for function in (mp.sin, mp.cos)]
    for width in (1, 2, 4, 8):
        monkeypatch.setattr(processor, "width", lambda width=width: width)
        found = trace(lambda x: np.array([np.sin(x[0]), np.cos(x[0])]), 1, batch=width > 1)(x[None])
        for numbers, expected in zip(found, exact, strict=True):
            off = [abs(mp.mpf(number) - value) for number, value in zip(numbers, expected, strict=True)]
            assert (np.array(off) <= ULP * np.spacing(np.abs(numbers))).all(), width


def test_huge_angles_and_non_numbers():
    kernel = trace(lambda x: np.array([np.sin(x[0]), np.cos(x[0])]), 1)
    x = np.array([1e5 + 1, -3e7, 1e22, 0.3, np.inf, np.nan, -0.0, 1e-310, 2.0])
    with np.errstate(invalid="ignore"):
        expected = np.array([np.sin(x), np.cos(x)])
    assert np.allclose(kernel(x[None]), expected, rtol=1e-15, atol=0, equal_nan=True)


def test_angles_side_by_side_are_those_of_single_states():
    """Vectors of three angles, of which one call takes two; some lanes are huge, or no numbers."""
    kernel = trace(lambda x: np.concatenate([np.sin(x), np.cos(x)]), 3)
    x = np.random.default_rng(5).uniform(-9.0, 9.0, (3, 24))
    x[[0, 1, 1, 2, 0], [1, 2, 9, 9, 23]] = 1e22, -3e7, np.nan, 2e5, np.inf
    assert np.array_equal(kernel(x), np.transpose([kernel(column) for column in x.T]), equal_nan=True)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("angle", [0.7, -2.5, np.pi / 2, np.pi, 0.0])
def test_a_congruence_about_a_coordinate_axis_costs_less(axis, angle):
    """The same numbers as R M Rᵀ, by fewer operations when the angle is traced."""
    about = (rotations.about_x, rotations.about_y, rotations.about_z)[axis]
    M = np.random.default_rng(axis).normal(size=(3, 3))
    R = rotations.clean(about(angle))
    assert np.abs(rotations.congruent(R, M) - R @ M @ R.T).max() <= ROUNDING
    graph = Graph()
    entries, R = graph.symbols("m", 9).reshape(3, 3), about(graph.symbol("angle"))
    made = [count(product) for product in (rotations.congruent(R, entries), R @ entries @ R.T)]
    assert made[0]["mul"] <= made[1]["mul"] / 2


def test_choices():
    kernel = trace(lambda x: np.array([x[0].graph.select(x[0] < x[1], x[0] * 2, x[1] * 3)]), 2)
    x = np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 1.0]])
    assert np.array_equal(kernel(x), [[2.0, 6.0, 3.0]])


def test_what_cannot_be_traced_is_said():
    graph = Graph()
    x = graph.symbol("x")
    with pytest.raises(TypeError, match="where"):
        bool(x < 1.0)
    with pytest.raises(TypeError, match="two graphs"):
        x + Graph().symbol("y")
    with pytest.raises(TypeError):
        x + "1"
    with pytest.raises(TypeError, match="none of its inputs"):
        trace(lambda y: [y[0] + y[0].graph.symbol("stranger")], 1)
    with pytest.raises(ValueError, match=r"expected \(2,\)"):
        trace(lambda y: [y[0] + y[1]], 2)(np.zeros(3))


@pytest.mark.parametrize("damage", ["truncate", "flip", "foreign", "empty", "renamed", None])
def test_a_damaged_file_is_as_good_as_none(damage, tmp_path, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path))
    name, content = object_cache.key("about", "text"), b"machine code" * 100
    object_cache.write(name, content)
    path = tmp_path / name
    data = path.read_bytes()
    other = object_cache.key("something", "else")
    if damage == "renamed":
        path.rename(tmp_path / other)
        name = other
    elif damage:
        path.write_bytes({"truncate": data[:-5], "flip": data[:-1] + b"X", "foreign": b"ELF" + data, "empty": b""}[damage])
    assert object_cache.read(name) == (content if damage is None else None)


def test_kernels_survive_a_damaged_store(tmp_path, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path))
    first = trace(lambda x: [x[0] * 3.25], 1)([2.0])
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:-100])
    assert trace(lambda x: [x[0] * 3.25], 1)([2.0]) == first == 6.5


def test_what_another_user_owns_is_not_run(tmp_path, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path))
    name = object_cache.key("about", "text")
    object_cache.write(name, b"machine code")
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    assert object_cache.read(name) is None


@pytest.mark.slow
def test_code_is_kept_by_graph_processor_and_version(tmp_path, monkeypatch):
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path))

    def kept(number=2.5):
        assert trace(lambda x: [x[0] * number], 1)([2.0]) == 2.0 * number
        return len(object_cache.file_sizes())

    assert [kept(), kept(), kept(3.5)] == [1, 1, 2]
    with monkeypatch.context() as other:
        other.setattr(object_code.llvm, "get_host_cpu_name", lambda: "generic")
        assert kept() == 3
    monkeypatch.setattr(object_code.llvmlite, "__version__", "another")
    assert kept() == 4


def test_without_a_store(monkeypatch, tmp_path):
    monkeypatch.setenv("GAUSS_CACHE", "")
    assert trace(lambda x: [x[0] + 1.0], 1)([2.0]) == 3.0
    monkeypatch.setenv("GAUSS_CACHE", str(tmp_path / "file" / "below"))
    (tmp_path / "file").write_text("not a folder")
    assert trace(lambda x: [x[0] + 1.0], 1)([2.0]) == 3.0


def test_substitution_folds_what_becomes_constant():
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    outputs = [x * y + np.sin(y), graph.select(x < y, x, y) / (x + 1.0), y]
    folded = substitute(outputs, [y], [0.0])
    assert folded[0].value == 0.0 and folded[2].value == 0.0
    kernel = Kernel(Function("before", [x, y], outputs)), Kernel(Function("after", [x], list(folded)))
    assert kernel[1]([0.7]) == pytest.approx(kernel[0]([0.7, 0.0]), abs=1e-15)
    assert substitute([x * y], [x], [y])[0] is y * y


@given(st.floats(-5.0, 5.0), st.floats(0.1, 5.0))
def test_numbers_of_expressions_are_those_that_substitution_folds_to(a, b):
    graph = Graph()
    symbols = [graph.symbol("a"), graph.symbol("b")]
    outputs = [*everything(symbols), math.floor(symbols[0]), graph.constant(2.0), 3.0]
    folded = substitute(outputs, symbols, [a, b])
    known = [one.value if isinstance(one, Expression) else one for one in folded]
    np.testing.assert_array_equal(numbers_of(outputs, symbols)([a, b]), known)


def test_an_if_of_another_thread_is_not_one_of_this():
    """Scenes with laws that have an `if` may be compiled in several threads at once."""

    def decided(x, others=()):
        for other in others:
            other()
        return 1.0 if x < 0.0 else 2.0

    with ThreadPoolExecutor(1) as pool:
        beside = Graph().symbol("beside")
        own = lambda: pool.submit(branches, lambda: decided(beside)).result()  # noqa: E731
        untraced = lambda: pool.submit(bool, beside).exception()  # noqa: E731
        found = []
        x = Graph().symbol("x")
        joined = branches(lambda: decided(x, (lambda: found.append(untraced()), own)))
    assert all(isinstance(error, TypeError) for error in found) and len(found) == 2
    assert [numbers_of([joined], [x])([value])[0] for value in (-1.0, 1.0)] == [1.0, 2.0]


def test_calls_have_no_numbers():
    graph = Graph()
    x = graph.symbol("x")
    (called,) = graph.call(Function("inner", [x], [np.sin(x)]), [x])
    with pytest.raises(TypeError, match="call"):
        numbers_of([called], [x])
