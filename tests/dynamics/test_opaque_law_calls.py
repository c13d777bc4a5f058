"""Calls of opaque laws by machine code: values and refusals are those of the checks, whatever a law returns or calls."""

import inspect
import math
from fractions import Fraction
from functools import partial, wraps

import numpy as np
import pytest

import gauss
from gauss.dynamics.call_cost import call_costs
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.load_forces import LoadForces
from gauss.errors import SceneError
from gauss.scene.values import arguments, as_function, evaluated, law_of_time_alone, put
from gauss.system import State
from tests.support import mechanisms

NUMBERS = [
    1.5,
    -0.0,
    np.float64(2.0),
    3,
    True,
    Fraction(1, 3),
    np.float32(0.5),
    np.array(2.0),
    np.array([2.0]),
    [4.0],
    (4.0,),
]
VECTORS = [(1.0, 2.0, 3.0), [1, 2.0, 3], np.arange(3.0), (1, 2, 3), (np.float64(1.0), 0.0, -2.0), (True, 0.5, 1)]
REFUSED = [None, "1", math.nan, math.inf, (1.0, 2.0), (1.0, math.nan, 0.0), (math.inf, 0.0, 0.0), (1.0, None, 2.0), 10**400]


@pytest.mark.parametrize("value", [*NUMBERS, *VECTORS, *REFUSED], ids=repr)
@pytest.mark.parametrize("size", [1, 3])
def test_a_value_is_written_as_it_is_checked(value, size):
    """The quick way for the usual values, and the refusals with their words, are those of the check of any value."""
    law, numbers = (lambda t, motion: value), np.full(size + 2, 7.0)
    given = 0.25, None
    try:
        expected = evaluated(law, given, "the law", size)
    except SceneError as error:
        with pytest.raises(SceneError) as found:
            put(law, given, "the law", size, numbers, 1)
        assert str(found.value) == str(error)
        return
    put(law, given, "the law", size, numbers, 1)
    assert numbers.tolist() == [7.0, *expected.tolist(), 7.0]


def _two(t, motion):
    return t


@wraps(_two)
def _wrapped(*every):
    return _two(*every)


CALLED = [
    lambda: 0.0,
    lambda t: t,
    lambda t, scale=2.0: t * scale,
    lambda t, motion: t,
    lambda t=1.0, k=2.0: t,
    lambda *every: every,
    lambda t, *every: every,
    lambda t, /, motion, *, key=1: t,
    lambda *, key=1: key,
    _wrapped,
]


@pytest.mark.parametrize("function", CALLED)
def test_arguments_are_those_of_the_signature(function):
    """Counted from the code of plain functions, else from the signature."""
    parameters = inspect.signature(function).parameters.values()
    places = [p for p in parameters if p.kind not in (p.KEYWORD_ONLY, p.VAR_KEYWORD)]
    required = sum(p.default is p.empty and p.kind is not p.VAR_POSITIONAL for p in places)
    assert arguments(function) == (max(required, 1) if places else 0) == arguments(partial(function))


def test_only_laws_of_time_are_asked_without_the_motion():
    """Functions of the package, of both kinds, are distinguished from those of users."""
    law = lambda t: t  # noqa: E731
    assert law_of_time_alone(as_function(law)) is law
    assert law_of_time_alone(_two) is None
    assert law_of_time_alone(as_function(1.0)) is None
    assert law_of_time_alone(lambda t, motion: law(t)) is None


def _pushed(law) -> gauss.System:
    scene = mechanisms.rods(3)
    scene.drive("J2", torque=law)
    return gauss.compile_scene(scene)


def _forces(system: gauss.System) -> LoadForces:
    return LoadForces(system, Laws(system).called)


def test_a_law_may_ask_for_the_forces_that_it_is_part_of():
    """A call within a call has numbers of its own."""
    within: list[np.ndarray] = []

    def law(t):
        if t > 0.5 and not within:
            within.append(np.zeros(0))
            within[0] = forces(State(0.25, start.q, start.v))[0].copy()
        return float(t)

    system = _pushed(law)
    forces, start = _forces(system), system.initial_state()
    found = forces(State(0.75, start.q, start.v))[0]
    joint = system.joint("J2").v
    assert (found[joint], within[0][joint]) == (0.75, 0.25)


def test_poses_that_a_law_keeps_stay_those_of_their_state():
    """Arrays of one evaluation are not those of the next."""
    kept = []

    def law(t, at):
        kept.append((at, at.position("rod3").copy(), at.R[-1].copy()))
        return float(at.coordinate("J2"))

    system = _pushed(law)
    forces, start = _forces(system), system.initial_state()
    for angle in (0.1, 0.2, 0.3):
        forces(State(angle, start.q + angle, start.v))
    for at, position, ground in kept:
        assert np.array_equal(at.position("rod3"), position)
        assert np.array_equal(ground, np.eye(3))
    assert len({position.tobytes() for _, position, _ in kept[-3:]}) == 3


def test_poses_that_a_law_asks_for_later_are_those_of_its_state():
    """Numbers of a state are kept as long as its poses may be asked for."""
    kept = []

    def law(t, at):
        kept.append(at)
        return float(at.coordinate("J2"))

    system = _pushed(law)
    forces, start = _forces(system), system.initial_state()
    kept.clear()
    states = [State(angle, start.q + angle, start.v) for angle in np.linspace(0.0, 1.0, 20)]
    for state in states:
        forces(state)
    for at, state in zip(kept, states, strict=True):
        assert np.array(at.x) == pytest.approx(np.array(gauss.Kinematics(system, state).x), abs=1e-14)


@pytest.mark.parametrize("law", [lambda t: float(t), lambda t, at: float(at.rate("J2"))])
def test_the_cost_of_a_law_is_stated_with_its_own_part(law):
    """The whole is no less than the part of the user, and is found without an opaque law that has a value there."""
    system = _pushed(law)
    (cost,) = call_costs(system, Laws(system)).values()
    assert 0.0 < cost.own <= cost.whole


def test_a_law_without_a_value_at_the_start_has_an_estimated_cost():
    """A failure is no error of the report."""
    system = _pushed(lambda t: math.sqrt(float(t) - 1.0))
    (cost,) = call_costs(system, Laws(system)).values()
    assert cost.whole > 0.0
    assert math.isnan(cost.own)
