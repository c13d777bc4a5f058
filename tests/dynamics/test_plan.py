"""The plan by which a motion is made: which rule is taken, what is rejected and why, and that it changes no result."""

import numpy as np
import pytest

import gauss
from benchmarks import free_bodies
from gauss import Plan
from gauss.dynamics.conditions import LARGE_TREE_BODIES, WIDEST
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import ACCELERATIONS, BATCHES, DEVICE_FUNCTIONS, FUNCTIONS, MOTIONS, motion_plan
from gauss.dynamics.rules import Question
from gauss.errors import ArgumentError, SimulationError
from gauss.integrators import METHODS
from gauss.scene import Scene
from tests.support import mechanisms

SAME = 1e-9  # of motions by two plans
RUN = {"integrator": "rk4", "step": 1e-3, "progress": False}
IMPLICIT = {"integrator": "radau5", "rtol": 1e-6}
FINE = RUN | {"step": 2.5e-4}  # where a loop is cut is felt as much as the method errs: less than SAME


def _still() -> Scene:
    scene = gauss.Scene("monument")
    scene.body("stone", 2.0, (1.0, 1.0, 1.0))
    scene.fixed("foot", "ground", "stone")
    return scene


def _opaque() -> Scene:
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.1 else 2.0)
    return scene


def _opaque_friction() -> Scene:
    scene = _opaque()
    scene.joint_friction("J2", 0.1)
    return scene


def _asking() -> Scene:
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=lambda t, motion: float(motion.position("rod1")[2]))
    return scene


def _long() -> Scene:
    return gauss.load("n_pendulum", n=LARGE_TREE_BODIES + 1)


def _controlled() -> Scene:
    scene = gauss.load("friction_oscillator")
    scene.input("u", "rail", limits=(-1.0, 1.0))
    return scene


def _driven() -> Scene:
    scene = _long()
    scene.drive("J1", torque=lambda t: float(t))
    return scene


def _shafts(count: int) -> Scene:
    """Trains of five shafts geared one to the other, each driven."""
    scene = gauss.Scene("shafts")
    for k in range(count):
        scene.body(f"B{k}", 1.0, (0.1, 0.1, 0.15))
        scene.revolute(f"J{k}", "ground", f"B{k}", at=(k, 0.0, 0.0))
        if k % 5:
            scene.couple(f"C{k}", f"J{k}", f"J{k - 1}", ratio=-1.1)
        else:
            scene.drive(f"J{k}", torque=0.1 * k)
    return scene


def _mesh() -> Scene:
    return gauss.load("n_four_bar", n=50)


def _driven_mesh() -> Scene:
    scene = _mesh()
    scene.drive("A0", torque=lambda t: float(t))
    return scene


# scene, arguments → driver, dynamics, what was rejected
CASES = {
    "nothing moves": (_still, {}, ("constant", "none"), []),
    "smooth": (lambda: mechanisms.rods(2), {}, ("compiled loop", "compiled"), []),
    "loops": (mechanisms.four_bar, {}, ("compiled loop", "embedded loops"), []),
    "a fixed step": (lambda: mechanisms.rods(2), RUN, ("compiled loop", "compiled"), []),
    "a backend": (
        lambda: mechanisms.rods(2),
        {"backend": "kkt"},
        ("Python loop", "certified"),
        ["compiled loop", "Python loop"],
    ),
    "an opaque law": (_opaque, {}, ("compiled loop", "callbacks"), ["compiled loop"]),
    "a law that asks": (_asking, {}, ("compiled loop", "callbacks"), ["compiled loop"]),
    "an opaque law, an implicit method": (_opaque, IMPLICIT, ("Python loop", "compiled"), ["compiled loop"] * 2),
    "a large tree": (_long, {}, ("compiled loop", "tree recursion"), ["compiled loop"]),
    "a large tree, an opaque law": (_driven, {}, ("compiled loop", "tree recursion"), ["compiled loop"]),
    "a large tree, an implicit method": (_driven, IMPLICIT, ("Python loop", "tree recursion"), ["compiled loop"] * 3),
    "held inputs, friction": (
        _controlled,
        {"control": lambda t, q, v: 0.5, "rate": 1000.0},
        ("samples", "compiled"),
        ["events", "events"],
    ),
    "many loops": (_mesh, {}, ("compiled loop", "call graph"), ["compiled loop"]),
    "many loops, an opaque law": (_driven_mesh, {}, ("compiled loop", "call graph"), ["compiled loop"]),
    "many loops, an implicit method": (_driven_mesh, IMPLICIT, ("Python loop", "call graph"), ["compiled loop"] * 3),
    "a library": (lambda: mechanisms.rods(2), {"integrator": "scipy_dop853"}, ("library", "compiled"), []),
    "a library, a law": (_opaque, {"integrator": "scipy_dop853"}, ("library", "certified"), ["library"]),
    "contacts": (lambda: gauss.load("newtons_cradle"), {}, ("events", "compiled"), []),
    "contacts, a backend": (
        lambda: gauss.load("newtons_cradle"),
        {"backend": "kkt"},
        ("events", "certified"),
        ["events"],
    ),
    "steps over contacts": (
        lambda: gauss.load("box_on_plane_4"),
        {"integrator": "time_stepping", "step": 1e-3},
        ("time stepping", "compiled"),
        [],
    ),
    "steps, a backend": (
        lambda: gauss.load("box_on_plane_4"),
        {"integrator": "time_stepping", "step": 1e-3, "backend": "kkt"},
        ("time stepping", "certified"),
        ["time stepping", "time stepping"],
    ),
    "steps, an opaque law": (
        _opaque_friction,
        {"integrator": "time_stepping", "step": 1e-3},
        ("time stepping", "callbacks"),
        ["time stepping"],
    ),
    "steps of many contacts": (
        lambda: free_bodies.stack(2),
        {"integrator": "time_stepping", "step": 1e-3},
        ("time stepping", "pair kernels"),
        ["time stepping"],
    ),
    "Baumgarte": (mechanisms.four_bar, {"stabilisation": "baumgarte"}, ("compiled loop", "embedded loops"), []),
    "Baumgarte, an implicit method": (
        mechanisms.four_bar,
        {"stabilisation": "baumgarte", **IMPLICIT},
        ("compiled loop", "compiled"),
        ["compiled loop"],
    ),
}


@pytest.fixture(scope="module")
def plans() -> dict[str, Plan]:
    """Plan of every case, by a motion of no length to speak of."""
    return {
        name: gauss.simulate(make(), 2e-3, **{"progress": False, **options}).stats.plan
        for name, (make, options, *_) in CASES.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_motion_tells_its_plan(name, plans):
    _, _, (driver, dynamics), rejected = CASES[name]
    plan = plans[name]
    assert (plan.driver, plan.dynamics) == (driver, dynamics)
    assert [found.driver for found in plan.rejected] == rejected and all(found.why for found in plan.rejected)
    assert bool(plan.fallback) == (dynamics not in ("none", "certified", "pair kernels") and driver != "library")


@pytest.mark.slow
def test_every_rule_of_the_table_is_taken_by_some_case(plans):
    taken = {(plan.driver, plan.dynamics, plan.fallback) for plan in plans.values()}
    assert taken == {(rule.driver, rule.dynamics, rule.fallback) for rule in MOTIONS.rules}


@pytest.mark.slow
def test_what_was_rejected_names_what_speaks_against_it(plans):
    mode = {
        "an opaque law": "drive of J1",
        "a law that asks": "drive of J1",
        "a backend": "kkt",
        "a large tree": str(LARGE_TREE_BODIES),
    }
    for name, word in mode.items():
        assert all(any(word in why for why in found.why) for found in plans[name].rejected), name


OTHERS = [
    (lambda: mechanisms.rods(2), Plan("Python loop", "compiled")),
    (lambda: mechanisms.rods(2), Plan("Python loop", "certified")),
    (mechanisms.four_bar, Plan("Python loop", "compiled")),
    (mechanisms.four_bar, Plan("Python loop", "certified")),
]


@pytest.mark.slow
@pytest.mark.parametrize("make, wanted", OTHERS)
def test_another_plan_makes_the_same_motion(make, wanted):
    system = gauss.compile_scene(make())
    found, expected = (gauss.simulate(system, 0.01, plan=plan, **FINE) for plan in (wanted, None))
    assert (found.stats.plan.driver, found.stats.plan.dynamics) == (wanted.driver, wanted.dynamics)
    assert expected.stats.plan != found.stats.plan
    assert np.abs(found.q - expected.q).max() <= SAME and np.abs(found.v - expected.v).max() <= SAME


@pytest.mark.parametrize(
    "make, wanted, words",
    [
        (lambda: mechanisms.rods(1), Plan("events", "compiled"), ("events", "compiled loop")),
        (_opaque, Plan("compiled loop", "compiled"), ("compiled loop", "drive of J1")),
        (lambda: mechanisms.rods(1), Plan("tape", "compiled"), ("tape", "Python loop")),
    ],
)
def test_a_plan_that_cannot_be_is_refused_with_reasons(make, wanted, words):
    with pytest.raises(SimulationError) as caught:
        gauss.simulate(make(), 0.1, progress=False, plan=wanted)
    assert all(word in str(caught.value) for word in words)


def test_something_else_than_a_plan_is_refused():
    with pytest.raises(ArgumentError, match="plan"):
        gauss.simulate(mechanisms.rods(1), 0.1, progress=False, plan="compiled loop")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, (_, options, *_) in CASES.items() if not options])
def test_explain_prints_the_plan_of_a_motion(name, plans):
    system = gauss.compile_scene(CASES[name][0]())
    assert motion_plan(system) == plans[name] and str(plans[name]).splitlines()[0] in system.explain()


@pytest.mark.slow
def test_explicit_steps_of_many_rates_are_compiled_and_implicit_ones_are_not():
    system = gauss.compile_scene(_shafts(WIDEST + 2))
    compiled, stepped = (gauss.simulate(system, 5e-3, plan=plan, **RUN) for plan in (None, Plan("Python loop", "compiled")))
    assert compiled.stats.plan.driver == "compiled loop"
    assert np.abs(compiled.q[-1] - stepped.q[-1]).max() <= SAME * np.abs(stepped.q[-1]).max()
    assert np.abs(compiled.v[-1] - stepped.v[-1]).max() <= SAME * np.abs(stepped.v[-1]).max()
    ask = Question(system, Laws(system), method=METHODS["radau5"])
    assert MOTIONS.plan(ask).driver == "Python loop"
    with pytest.raises(SimulationError, match=f"{WIDEST + 2} rates are more than {WIDEST}"):
        MOTIONS.plan(ask, Plan("compiled loop", "compiled"))


def test_states_and_batches_ask_the_same_rules():
    systems = {
        name: gauss.compile_scene(CASES[name][0]()) for name in ("smooth", "an opaque law", "contacts", "a large tree")
    }
    ask = {name: Question(system, Laws(system)) for name, system in systems.items()}
    called = {name: Question(system, Laws(system, trace=False)) for name, system in systems.items()}
    found = {name: ACCELERATIONS.plan(question).dynamics for name, question in called.items()}
    assert found == {
        "smooth": "compiled",
        "an opaque law": "compiled",
        "contacts": "unilateral",
        "a large tree": "tree recursion",
    }
    assert FUNCTIONS.plan(ask["smooth"]).dynamics == BATCHES.plan(ask["smooth"]).dynamics == "compiled"
    refused = [(table, name) for table in (BATCHES, DEVICE_FUNCTIONS) for name in ("an opaque law", "a large tree")]
    for table, name in ((FUNCTIONS, "an opaque law"), (DEVICE_FUNCTIONS, "contacts"), *refused):
        with pytest.raises(SimulationError, match="cannot be compiled"):
            table.plan(ask[name])
