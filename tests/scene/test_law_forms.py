"""Laws in every form that Python has for a function: one motion, however the function is written."""

import functools
import math as plain
import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import SwitchingWarning
from gauss.scene.values import arguments

SAME = 1e-8  # rad: a traced law against the same law called, at rtol 1e-9


def arm(**drive):
    scene = gauss.Scene("arm")
    scene.body("arm", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0))
    scene.revolute("hinge", "ground", "arm", axis=(0, 1, 0))
    scene.drive("hinge", **drive)
    return scene


class Damper:
    """A law that is an object."""

    def __init__(self, k):
        self.k = k

    def __call__(self, t, motion):
        return -self.k * motion.rate("hinge")

    def bound(self, t, motion):
        return -self.k * motion.rate("hinge")


def damper(k, t, motion):
    return -k * motion.rate("hinge")


def raising(t, motion):
    if not isinstance(motion.rate("hinge"), float):
        raise gauss.errors.StateError("only numbers")
    return -2.0 * motion.rate("hinge")


DAMPERS = {
    "default": lambda t, motion, k=2.0: -k * motion.rate("hinge"),
    "keyword": lambda t, motion, *, k=2.0: -k * motion.rate("hinge"),
    "partial": functools.partial(damper, 2.0),
    "object": Damper(2.0),
    "method": Damper(2.0).bound,
    "called": lambda t, motion: -2.0 * float(motion.rate("hinge")),
    "called, for it raises an error of gauss": raising,
    "called, for it asks the system": lambda t, motion: -2.0 * motion.system.state(motion.state.q, motion.state.v).v[0],
}
SINES = {
    "ufunc": np.sin,
    "default": lambda t, k=1.0: np.sin(k * t),
    "all defaults": lambda t=0.0: np.sin(t),
    "any number": lambda *given: np.sin(given[0]),
    "partial": functools.partial(lambda t, k: np.sin(k * t), k=1.0),
}


def end(scene):
    return gauss.simulate(scene, 0.2, rtol=1e-9, atol=1e-9).q[-1]


@pytest.mark.slow
@pytest.mark.parametrize("form", DAMPERS)
def test_one_law_of_the_motion_in_many_forms(form):
    expected = end(arm(torque=lambda t, motion: -2.0 * motion.rate("hinge")))
    assert np.abs(end(arm(torque=DAMPERS[form])) - expected).max() <= SAME


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["torque", "angle", "speed"])
@pytest.mark.parametrize("form", SINES)
def test_one_law_of_time_in_many_forms(form, kind):
    expected = end(arm(**{kind: lambda t: np.sin(t)}))
    assert np.abs(end(arm(**{kind: SINES[form]})) - expected).max() <= SAME


def test_laws_of_a_loop_keep_their_own_default():
    """The idiom for one law of many joints: a default argument is no place for the motion."""
    for i in (1.0, 3.0):
        expected = end(arm(torque=lambda t, i=i: i * t))
        assert np.abs(end(arm(torque=functools.partial(lambda i, t: i * t, i))) - expected).max() <= SAME


@pytest.mark.parametrize(
    ("law", "count"),
    [
        (lambda: 0, 0),
        (lambda t: 0, 1),
        (lambda t=0: 0, 1),
        (lambda t, m: 0, 2),
        (lambda t, m, i=1: 0, 2),
        (lambda t, i=1: 0, 1),
        (lambda *given: 0, 1),
        (lambda **given: 0, 0),
        (np.sin, 1),
        (np.arctan2, 2),
        (max, 1),
    ],
)
def test_arguments_that_are_required_count(law, count):
    assert arguments(law) == count


CONDITIONS = {  # 3 N m from 0.05 to 0.12 s
    "and": lambda t: gauss.math.where((t > 0.05) & (t < 0.12), 3.0, 0.0),
    "or": lambda t: gauss.math.where((t <= 0.05) | (t >= 0.12), 0.0, 3.0),
    "times": lambda t: 3.0 * ((t > 0.05) & (t < 0.12)),
    "of numpy's truth": lambda t: gauss.math.where(np.bool_(True) & (t > 0.05) & (t < 0.12), 3.0, 0.0),
}


EQUALITIES = {  # t beside 3 N m from 0.05 to 0.1 s; what is equal is traced where the rest of the law is
    "equal": lambda t: t + (3.0 if t // 0.05 == 1 else 0.0),
    "unequal": lambda t: t + (0.0 if t // 0.05 != 1 else 3.0),
    "member": lambda t: t + (3.0 if t // 0.05 in (1, 9) else 0.0),
    "of numpy": lambda t: t + 3.0 * np.equal(np.floor(t / 0.05), 1.0),
    "of a truth": lambda t: t + (3.0 if (t >= 0.05) == (t < 0.1) else 0.0),
    "key": lambda t: t + {1.0: 3.0}.get(t // 0.05, 0.0),
    "sign": lambda t: t + 1.5 * (np.sign(t - 0.05) - np.sign(t - 0.1)),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", EQUALITIES)
def test_equality_is_of_values_while_a_law_is_traced(form):
    expected = end(arm(torque=lambda t: t + gauss.math.where((t >= 0.05) & (t < 0.1), 3.0, 0.0)))
    assert np.abs(end(arm(torque=EQUALITIES[form])) - expected).max() <= SAME


class Counter:
    """A law whose object counts its calls, and holds what it was given last."""

    def __init__(self):
        self.calls, self.last = 0, None

    def __call__(self, t):
        self.calls, before = self.calls + 1, self.last
        self.last = t
        return 2.0 * t if before is None else t + t


class Integral:
    """A controller with a state of its own."""

    def __init__(self):
        self.total, self.last = 0.0, 0.0

    def __call__(self, t, motion):
        self.total, self.last = self.total + (0.3 - motion.coordinate("hinge")) * (t - self.last), t
        return 5.0 * self.total + t


def test_a_law_that_keeps_what_it_was_given_is_called():
    """Its last argument is no symbol once it was traced, and a value that does not depend on it deserves no warning."""
    law = Counter()
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "(?s).*same time.*")
        found = end(arm(torque=law))
    assert np.abs(found - end(arm(torque=lambda t: 2.0 * t))).max() <= SAME
    assert isinstance(law.last, float)


@pytest.mark.slow
def test_a_law_with_a_state_is_warned_of_by_name_in_every_call():
    system = gauss.compile_scene(arm(torque=Integral()))
    for _ in range(2):
        with pytest.warns(SwitchingWarning, match=r"drive of hinge.*same time"):
            gauss.simulate(system, 0.02, integrator="rk4", step=0.005)


TYPED = {  # laws that ask for the type of their argument: what is traced is not what they give for numbers
    "isinstance": lambda t: 0.1 * t + (10.0 if isinstance(t, float) else 0.0),
    "a try": lambda t: _whole(t) + 0.1 * t,
}


def _whole(t):
    try:
        return float(int(t))
    except TypeError:
        return 0.0


@pytest.mark.slow
@pytest.mark.parametrize("form", TYPED)
def test_a_law_that_gives_other_numbers_than_were_traced_is_called(form):
    system, law = gauss.compile_scene(arm(torque=TYPED[form])), TYPED[form]
    found = gauss.simulate(system, 1.5, integrator="rk4", step=0.01)
    assert found.stats.plan.dynamics == "callbacks"
    expected = gauss.simulate(arm(torque=lambda t: law(float(t))), 1.5, integrator="rk4", step=0.01)
    assert found.v[-1] == pytest.approx(expected.v[-1], rel=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("form", CONDITIONS)
def test_conditions_are_joined_as_truths_of_python_are(form):
    system = gauss.compile_scene(arm(torque=CONDITIONS[form]))
    found = gauss.simulate(system, 0.2, rtol=1e-9, atol=1e-9)
    assert found.q[-1] == pytest.approx(end(arm(torque=lambda t: 3.0 if 0.05 < t < 0.12 else 0.0)), abs=SAME)
    assert found.stats.plan.driver == "compiled loop" and not found.stats.opaque


FAILING = {
    "no such operation": (lambda t: gauss.math.where(t & (t < 1.0), 1.0, 0.0), "TypeError"),
    "out of its range": (lambda t: [1.0, 2.0][int(float(t) * 20)], "IndexError"),
    "domain": (lambda t: float(t) if t < 0.1 else plain.sqrt(-1.0), "ValueError"),
    "no number": (lambda t: None if float(t) > 0.1 else 1.0, "None"),
    "more numbers": (lambda t: [1.0] * (1 + int(float(t) > 0.1)), r"\[1.0, 1.0\]"),
}


@pytest.mark.slow
@pytest.mark.parametrize("form", FAILING)
def test_a_law_that_fails_on_the_way_is_named(form):
    law, why = FAILING[form]
    with pytest.raises(gauss.GaussError, match=f"drive of hinge.*{why}"):
        end(arm(torque=law))


@pytest.mark.slow
def test_a_law_need_not_take_the_start_at_other_times():
    scene = arm(torque=lambda t, motion: -plain.sqrt(float(motion.coordinate("hinge")) + 0.5 - float(t)))
    scene.start("hinge", 0.0, 5.0)
    assert end(scene) > 0.2 - 0.5
