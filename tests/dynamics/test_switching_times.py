"""Switching times of traced laws: intervals enclose, switches are found, smooth laws need no mesh."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gauss
from gauss import math as gm
from gauss.codegen import Graph, branches
from gauss.dynamics.laws import switching_times
from gauss.dynamics.laws.affine_conditions import affine_changes
from gauss.dynamics.laws.intervals import Interval, enclose
from gauss.dynamics.laws.sampled_laws import sampled_times
from gauss.dynamics.laws.switching import switching
from gauss.dynamics.laws.switching_times import CONDITIONS, timetable
from gauss.dynamics.laws.traced_laws import Laws
from tests.support.switching import bell, slider

# False alarms: what is smooth throughout is not warned of, and makes the steps that it made.


@pytest.mark.slow
@pytest.mark.parametrize("law", [lambda t: gm.sin(3.0 * t), lambda t: gm.sin(300.0 * t) * gm.cos(t), lambda t: 1.0 + t**3])
def test_laws_that_move_throughout_need_no_mesh(law):
    system = gauss.compile_scene(slider(law))
    found = switching(system, Laws(system), system.initial_state(), 300.0).times
    assert not found
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gauss.simulate(system, 1.0, progress=False)


# Primitives.

UNARY = {
    "neg": lambda x: -x,
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "sqrt": lambda x: np.sqrt(gm.maximum(x, 0.0)),
    "abs": gm.abs,
    "floor": lambda x: x // 1,
    "square": lambda x: x * x,
    "sign": gm.sign,
}
BINARY = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / (1.0 + y * y),
    "min": gm.minimum,
    "max": gm.maximum,
    "less": lambda x, y: gm.where(x < y, x, 2.0 * y),
    "less_equal": lambda x, y: gm.where(x <= y, 1.0, y),
    "atan2": gm.atan2,
}
STEPS_OF_A_GRAPH = st.lists(st.tuples(st.sampled_from([*UNARY, *BINARY]), st.integers(0, 7), st.integers(0, 7)), max_size=7)
ENDS = st.tuples(st.floats(-3, 3), st.floats(0, 2))


def grown(x, y, steps):
    """Value of a random expression of two variables."""
    known = [x, y]
    for name, i, j in steps:
        one, two = known[i % len(known)], known[j % len(known)]
        value = UNARY[name](one) if name in UNARY else BINARY[name](one, two)
        known.append(gm.clip(value, -50.0, 50.0))
    return known[-1]


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(STEPS_OF_A_GRAPH, ENDS, ENDS, st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=5))
def test_intervals_enclose(steps, first, second, shares):
    graph = Graph()
    symbols = [graph.symbol("x"), graph.symbol("y")]
    boxes = [Interval(low, low + width) for low, width in (first, second)]
    (found,) = enclose([grown(*symbols, steps)], {s.index: box for s, box in zip(symbols, boxes, strict=True)})
    for share in shares:
        x, y = (box.low + s * (box.high - box.low) for box, s in zip(boxes, share, strict=True))
        value = grown(min(x, boxes[0].high), min(y, boxes[1].high), steps)
        slack = 1e-9 * (1.0 + abs(value))  # ends are not rounded outwards
        assert found.low - slack <= value <= found.high + slack


def decided(t, answers):
    """A value found by nested decisions."""
    total = 0.0
    for place, factor in answers:
        if t > place:
            total = total + factor * t
        elif total < place:
            total = total - factor
        else:
            return total
    return total


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-2, 2), st.integers(-3, 3)), min_size=1, max_size=4), st.lists(st.floats(-3, 3), max_size=8)
)
def test_branches_are_the_function_that_was_traced(answers, points):
    graph = Graph()
    t = graph.symbol("t")
    traced = branches(lambda: decided(t, answers))
    for point in points:
        (found,) = enclose([traced], {t.index: Interval.point(point)})
        assert found.low == found.high == pytest.approx(decided(point, answers), abs=1e-14)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.01, 9.99), min_size=1, max_size=12, unique=True), st.booleans())
def test_all_switching_times_are_found(places, waves):
    places = sorted(places)
    graph = Graph()
    t = graph.symbol("t")
    law = sum((k + 1.0) * (t > place) for k, place in enumerate(places))
    law = law + gm.where(gm.sin(7.0 * t) > 0.3, 1.0, 0.0) if waves else law
    found = timetable([law], t, 0.0, 10.0).switches
    crests = (
        [(a + 2 * math.pi * k) / 7 for k in range(12) for a in (math.asin(0.3), math.pi - math.asin(0.3))] if waves else []
    )
    expected = np.array(sorted([*places, *(c for c in crests if 0 < c < 10)]))
    close = 1e-13  # of ten seconds: times nearer than that are one
    assert all(np.abs(found - place).min() < close for place in expected)
    assert all(np.abs(expected - place).min() < close for place in found)


AFFINE = {
    "ramp": lambda x, y: 2.0 * x - 3.0,
    "sum": lambda x, y: x + y,
    "difference": lambda x, y: x / 3.0 - y,
    "negative": lambda x, y: -x,
    "clipped": lambda x, y: gm.clip(x, -1.0, 1.0),
    "larger": gm.maximum,
    "gate": lambda x, y: gm.where(x < y, x, 1.0 - y),
    "absolute": lambda x, y: gm.abs(x - 4.0),
    "product": lambda x, y: x * y,  # affine where one is constant
    "quotient": lambda x, y: x / (gm.abs(y) + 1.0),
}


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([*AFFINE]), st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=6))
def test_roots_of_piecewise_affine_conditions_are_those_that_bisection_finds(steps):
    graph = Graph()
    t = graph.symbol("t")
    made = [t, 5.0 - t, t * 0.5]
    for name, first, second in steps:
        made.append(AFFINE[name](made[first % len(made)], made[second % len(made)]))
    conditions = [switching_times._condition(node) for node in switching_times.of_time(made, t) if node.op in CONDITIONS]
    apart = 1e-13  # of ten seconds, as above
    known, others = affine_changes(conditions, t, 0.0, 10.0, apart)
    found = np.append(known, switching_times._searched(others, t, 0.0, 10.0, []))

    def changes(place: float) -> bool:
        time = {t.index: Interval.point(np.array([place - apart, place + apart]))}
        return any(np.ptp(np.broadcast_to(value.low, 2)) > 0 for value in enclose(conditions, time))

    for place in switching_times._searched(conditions, t, 0.0, 10.0, []):  # lines that only touch change nothing
        assert np.abs(found - place).min(initial=np.inf) < apart or not changes(place)
    assert all(changes(place) for place in known)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(st.floats(-5, -0.5), st.floats(0.0, 10.0))
def test_the_mesh_shows_a_bell_wherever_it_is(exponent, place):
    """Half of the bell is no less than an eighth of the cell in which it stands."""
    width = 10.0**exponent
    graph = Graph()
    t = graph.symbol("t")
    mesh = timetable([bell(width, place)(t)], t, 0.0, 10.0).mesh
    ends = np.unique([0.0, *mesh, 10.0])
    k = min(max(np.searchsorted(ends, place) - 1, 0), len(ends) - 2)
    assert ends[k + 1] - ends[k] <= 13.0 * width


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(0.1, 9.9), min_size=1, max_size=6, unique=True))
def test_jumps_of_opaque_laws_are_located(places):
    places = sorted(places)
    apart = [a for a, b in zip(places, [*places[1:], 11.0], strict=True) if b - a > 1e-2]
    law = lambda t, motion: sum(1.0 for place in apart if t > place)  # noqa: E731
    found = sampled_times(law, None, 0.0, 10.0).switches
    assert found == pytest.approx(apart, abs=1e-13)


# Laws of states that are zero but for rounding.


def swing(law):
    """A body drawn far from the origin and turned, whose position and rates cancel at rest."""
    scene = gauss.Scene("swing", gravity=(0, 0, 0))
    scene.body("a", 1.0, (0.1, 0.2, 0.3), position=(0.1, 1.7, 0.3), rotation=(0.3, -1.1, 2.0))
    scene.body("b", 1.0, (0.1, 0.2, 0.3), position=(1.3, 0.7, -0.9), rotation=(1.3, 0.1, 0.7))
    scene.revolute("A", "ground", "a", at=(0.3, 0.1, 0.2), axis=(1, 2, 3))
    scene.revolute("B", "a", "b", at=(0.7, 1.1, -0.2), axis=(3, -2, 1))
    scene.force("push", "b", law)
    return gauss.compile_scene(scene)


def test_a_law_whose_terms_cancel_is_traced():
    begin = swing(lambda t: (0.0, 0.0, 0.0)).scene.bodies["b"].position
    system = swing(lambda t, motion: motion.position("b") - np.array(begin))
    assert not Laws(system).called


def test_a_law_that_depends_on_the_type_of_its_argument_is_called():
    system = swing(lambda t, motion: (1.0 if isinstance(t, float) else t, 0.0, 0.0))
    assert Laws(system).called


def _share(system, q, v):
    """Share of a step of a millisecond between two states at rest but for small coordinates and rates, and its crossings."""
    watch = switching(system, Laws(system), system.initial_state(), 1.0).watch
    begin, end = ([*q[k], *v[k], 0.0, 0.0] for k in (0, 1))
    return watch(np.array([0.0, *begin, 1e-3, *end]))


def test_rates_of_rounding_switch_nothing():
    system = swing(lambda t, motion: (gm.maximum(motion.rate("A"), 0.0), gm.maximum(motion.rate("B"), 0.0), 0.0))
    noise = np.array([[1e-19, -1e-19], [-1e-19, 1e-19]])
    assert _share(system, np.zeros((2, 2)), noise)[0] == 1.0
    assert _share(system, np.zeros((2, 2)), 1e10 * noise)[0] < 1.0  # both laws switch: that is looked at
