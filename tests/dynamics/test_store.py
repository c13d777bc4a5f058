"""Machine code is kept by what it computes, not by what somebody calls it; threads that ask at once get one and the same."""

import gc
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from threading import Barrier
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import gauss
from gauss.codegen import content_key, gc_pause
from gauss.codegen.kernels import Loop
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.store import Store
from gauss.integrators import METHODS

pytestmark = pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")  # long steps, so that methods differ
FIXED = ["semi_implicit_euler", "rk4", "verlet", "gauss4", "gauss6", "variational_midpoint", "energy_momentum"]
PAIRS = [("dop853", "dopri5"), ("dopri5", "dop853"), ("dop853", "radau5"), ("radau5", "dopri5")]


def _end(system, method, **options) -> np.ndarray:
    """Last coordinates and rates."""
    found = gauss.simulate(system, 0.2, integrator=method, progress=False, **options)
    return np.concatenate([found.q[-1], found.v[-1]])


def _system():
    return gauss.compile_scene(gauss.load("double_pendulum"))


@pytest.mark.slow
@pytest.mark.parametrize("name", FIXED[1:])
def test_methods_of_one_name_are_not_taken_for_each_other(name):
    system, alone = _system(), _end(_system(), METHODS[name], step=0.02)
    first = _end(system, replace(METHODS[FIXED[0]], name="mine"), step=0.02)
    np.testing.assert_array_equal(_end(system, replace(METHODS[name], name="mine"), step=0.02), alone)
    assert np.abs(first - alone).max() > 1e-6  # the methods differ, so a mix-up would be seen
    np.testing.assert_array_equal(_end(system, replace(METHODS[FIXED[0]], name="mine"), step=0.02), first)


@pytest.mark.slow
@pytest.mark.parametrize("first, second", PAIRS)
def test_pairs_of_one_name_are_not_taken_for_each_other(first, second):
    system, loose = _system(), {"rtol": 1e-3, "atol": 1e-3}
    alone = _end(_system(), METHODS[second], **loose)
    other = _end(system, replace(METHODS[first], name="mine") if first != "radau5" else METHODS[first], **loose)
    if second != "radau5":
        np.testing.assert_array_equal(_end(system, replace(METHODS[second], name="mine"), **loose), alone)
    else:
        np.testing.assert_array_equal(_end(system, METHODS[second], **loose), alone)
    assert np.abs(other - alone).max() > 1e-12


@pytest.mark.slow
def test_near_parameters_of_generalised_alpha_are_told_apart():
    near, system = (0.5, 0.5000001), _system()
    kept = [_end(system, gauss.generalised_alpha(rho), step=0.02) for rho in near]
    alone = [_end(_system(), gauss.generalised_alpha(rho), step=0.02) for rho in near]
    np.testing.assert_array_equal(kept, alone)
    assert np.abs(alone[0] - alone[1]).max() > 1e-13


@pytest.mark.slow
def test_a_method_of_ones_own_is_seen_to_change():
    """A step that closes over a number is traced anew when the number changes."""
    factor, system = [1.0], _system()

    def step(equations, point, h):
        found, cost = METHODS["rk4"].step(equations, point, h)
        return replace(found, work=factor[0] * found.work), cost

    method = replace(METHODS["rk4"], name="mine", step=step)

    def work():
        gauss.simulate(system, 0.1, integrator=method, step=0.05, progress=False)

    def made():
        return sum(1 for key in system.dynamics._made if key[0] is Loop)

    work()
    once = made()
    work()
    assert made() == once  # nothing has changed: the code is kept
    factor[0] = 2.0
    work()
    assert made() == once + 1


def _scaled(factor):
    return lambda x: factor * x


SCALE = 2.0


def _names_a_global(x):
    return SCALE * x


class PythonWrapper:
    """An object with values, and no record."""

    def __init__(self, value):
        self.value = value

    def times(self, x):
        return self.value * x


@dataclass(frozen=True)
class Record:
    name: str
    values: np.ndarray


ALIKE = [
    (lambda: 1.5),
    (lambda: np.arange(3.0)),
    (lambda: (1, "a", None, [2.0])),
    (lambda: Record("a", np.arange(2.0))),
    (lambda: _scaled(2.0)),
    (lambda: partial(_scaled, 2.0)),
    (lambda: gauss.generalised_alpha(0.3)),
    (lambda: replace(METHODS["dop853"], name="mine")),
]


@pytest.mark.parametrize("make", ALIKE)
def test_equal_things_made_twice_share_a_key(make):
    one, two = content_key(make()), content_key(make())
    assert one == two and hash(one) == hash(two)


UNLIKE = [
    (0.0, -0.0),
    (1, 1.0),
    (1, True),
    (0.5, np.nextafter(0.5, 1.0)),
    (np.arange(4.0), np.arange(4.0).reshape(2, 2)),
    (np.arange(4.0), np.arange(4)),
    (Record("a", np.array([0.0, 1.0])), Record("a", np.array([0.0, np.nextafter(1.0, 2.0)]))),
    (Record("a", np.zeros(1)), Record("b", np.zeros(1))),
    (_scaled(2.0), _scaled(3.0)),
    (partial(_scaled, 2.0), partial(_scaled, 3.0)),
    (PythonWrapper(1.0).times, PythonWrapper(2.0).times),
    (gauss.generalised_alpha(0.3), gauss.generalised_alpha(0.3000001)),
    (lambda x, k=1.0: k * x, lambda x, k=2.0: k * x),
]


@pytest.mark.parametrize("one, two", UNLIKE, ids=range(len(UNLIKE)))
def test_unlike_things_have_unlike_keys(one, two):
    assert content_key(one) != content_key(two)
    assert content_key(one) == content_key(one)


def test_values_that_change_in_place_change_the_key(monkeypatch):
    array, plain = np.zeros(2), PythonWrapper(1.0)
    before = content_key(array), content_key(plain), content_key(_names_a_global)
    array[0], plain.value = 1.0, 2.0
    monkeypatch.setitem(globals(), "SCALE", 3.0)
    for old, new in zip(before, (content_key(array), content_key(plain), content_key(_names_a_global)), strict=True):
        assert old != new


class Slots:
    """An object without a dictionary."""

    __slots__ = ("value",)


class Class:
    """A class as a place of settings."""


class MoreThanFields(Record):
    """A record with an attribute that is no field of it."""


def _places():
    """Things and where a number of theirs is, by name."""
    module, slots, queue, more = ModuleType("settings"), Slots(), deque([0.0]), MoreThanFields("a", np.zeros(1))

    def own(x):
        return own.value * x

    return {
        "attribute of a function": (own, own),
        "attribute of a class": (lambda x: Class.value * x, Class),
        "attribute of a module": (lambda x: module.value * x, module),
        "slot": (lambda x: slots.value * x, slots),
        "queue": (lambda x: queue[0] * x, queue),
        "attribute of a record": (lambda x: more.value * x, more),
        "attribute of a class in a module": (lambda x: module.settings.value * x, SimpleNamespace(module=module)),
    }


@pytest.mark.parametrize("place", _places())
def test_what_a_function_looks_up_elsewhere_is_in_its_key(place):
    function, owner = _places()[place]
    keys = []
    for value in (1.0, 2.0, 1.0):
        if isinstance(owner, deque):
            owner[0] = value
        elif isinstance(owner, SimpleNamespace):
            owner.module.settings = Class
            Class.value = value
        else:
            object.__setattr__(owner, "value", value) if isinstance(owner, Record) else setattr(owner, "value", value)
        keys.append(content_key(function))
    assert keys[0] != keys[1] and keys[0] == keys[2]


def test_what_refers_to_itself_has_a_key():
    def step(x):
        return step(x - 1) if x else 0

    ring = [1.0]
    ring.append(ring)
    assert content_key(step) == content_key(step) and content_key(ring) == content_key(ring)


def test_laws_are_told_apart_by_the_load_they_belong_to():
    """Of two equal laws one may be traced, then the other."""
    scene, opaque = gauss.load("double_pendulum"), [True, False]

    def law(number):
        return lambda t: float(t) if opaque[number] else 2.0 * t

    for number, joint in enumerate(list(scene.joints)[:2]):
        scene.drive(joint, torque=law(number))
    system = gauss.compile_scene(scene)
    one = Laws(system).key
    opaque.reverse()
    assert Laws(system).key != one


def test_one_thread_makes_and_the_others_wait():
    kept, made, gate = Store(), [], Barrier(4)

    def make():
        made.append(1)
        time.sleep(0.05)
        return object()

    def ask(_):
        gate.wait()
        return kept.on_demand((dict,), make)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(ask, range(4)))
    assert len(made) == 1 and all(one is found[0] for one in found)


def test_making_may_ask_for_other_things():
    kept = Store()
    assert kept.on_demand((dict,), lambda: kept.on_demand((list,), lambda: 1) + 1) == 2


def test_what_failed_to_be_made_can_be_asked_for_again():
    kept = Store()
    with pytest.raises(ZeroDivisionError):
        kept.on_demand("thing", lambda: 1 / 0)
    assert kept.on_demand("thing", lambda: 3) == 3


def test_threads_that_write_down_at_once_leave_the_collector_as_it_was():
    before, gate = gc.get_threshold(), Barrier(3)

    def work(pause):
        gate.wait()
        with gc_pause():
            time.sleep(pause)

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(work, (0.01, 0.03, 0.05)))
    assert gc.get_threshold() == before


def test_threads_that_simulate_a_new_system_at_once_agree():
    system, expected = _system(), _end(_system(), "dop853")
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(lambda _: _end(system, "dop853"), range(4)):
            np.testing.assert_array_equal(found, expected)
