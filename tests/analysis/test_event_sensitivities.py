import warnings
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, SimulationError, StateError, SwitchingWarning

pytestmark = pytest.mark.slow

ACCURACY = 1e-8  # of extrapolated differences of motions of tolerance 1e-13, relative to the largest derivative
DIFFERENCE = 1e-4  # largest of the differences that are extrapolated, in the unit of what is changed
ROUND_OFF = 1e-11  # between the forward and the adjoint derivative, relative to the largest
METHOD = {"step": 0.01, "integrator": "dop853"}


def bouncing():
    """A ball that bounces twice."""
    scene = gauss.Scene("ball", gravity=(0, 0, -9.81))
    scene.prismatic("z", "ground", scene.body("ball", 1.3), axis=(0, 0, 1))
    scene.stop("z", lowest=-0.3, name="floor", restitution=0.6)
    return scene, {"z": -0.1}, 0.6


def stopped(name, joint, low=None, high=None, restitution=0.0, span=0.5, **rates):
    """A shipped scene with a stop."""
    scene = gauss.load(name)
    scene.stop(joint, lowest=low, highest=high, restitution=restitution, name="buffer")
    return scene, rates, span


def sliding():
    """A mass on a spring with Coulomb friction, which turns back, slips and comes to rest."""
    scene = gauss.Scene("slider", gravity=(0, 0, 0))
    scene.prismatic("x", "ground", scene.body("mass", 1.0))
    scene.joint_spring("spring", "x", stiffness=100.0, rest=-0.3)
    scene.joint_friction("x", 9.0)
    return scene, {"x": 0.5}, 0.8


def dragged():
    """A mass with friction that a second one drags by a spring: it sticks, then slips, while the other moves on."""
    scene = gauss.Scene("dragged", gravity=(0, 0, 0))
    first = scene.body("first", 1.0)
    scene.prismatic("x", "ground", first)
    scene.prismatic("y", "ground", scene.body("second", 3.0, position=(0.5, 0, 0)))
    scene.spring("between", "first", "second", stiffness=60.0, length=0.5)
    scene.joint_friction("x", 4.0)
    return scene, {"y": 1.0}, 0.7


def roped():
    """A ball that falls beside its anchor until its rope is taut."""
    scene = gauss.Scene("rope", gravity=(0, 0, -9.81))
    ball = scene.body("ball", 2.0)
    scene.prismatic("x", "ground", scene.body("rail", 0.5), axis=(1, 0, 0))
    scene.prismatic("z", "rail", ball, axis=(0, 0, 1))
    scene.rope("rope", "ground", "ball", length=0.4, restitution=0.3)
    return scene, {"x": 0.8, "z": 0.1}, 0.45


def bead():
    """A bead above a parabolic bowl."""
    scene = gauss.Scene("bead", gravity=(0, 0, -9.81))
    scene.prismatic("x", "ground", scene.body("rail", 0.2), axis=(1, 0, 0))
    scene.prismatic("z", "rail", scene.body("bead", 1.0), axis=(0, 0, 1))
    scene.one_sided("bowl", lambda at: at.coordinate("z") + 0.5 - 0.4 * at.coordinate("x") ** 2, restitution=0.7)
    return scene, {"x": 0.7}, 0.6


SCENES = {
    "bouncing ball": bouncing,
    "pendulum at a stop": lambda: stopped("pendulum", "A", low=-0.8, restitution=0.5),
    "pendulum that stays at a stop": lambda: stopped("pendulum", "A", low=-0.8),
    "double pendulum that stays": lambda: stopped("double_pendulum", "A", low=-0.3, A=-1.0),
    "cart-pole that stays": lambda: stopped("cart_pole", "rail", high=0.1, rail=1.0, pin=-4.0, span=0.25),
    "four-bar that stays": lambda: stopped("four_bar", "A", low=-0.2, A=-2.0, span=0.3),
    "pendulum on a stop": lambda: stopped("pendulum", "A", low=0.0),
    "double pendulum": lambda: stopped("double_pendulum", "B", high=-0.7, restitution=0.4, B=2.0, span=0.3),
    "cart-pole": lambda: stopped("cart_pole", "rail", high=0.1, restitution=0.8, rail=1.0),
    "four-bar": lambda: stopped("four_bar", "A", high=0.1, restitution=0.6, A=2.0, span=0.4),
    "slider-crank": lambda: stopped("slider_crank", "A", high=0.05, restitution=0.5, A=2.0, span=0.4),
    "parallelogram": lambda: stopped("parallelogram", "A1", high=-0.2, restitution=0.5, A1=2.0, span=0.4),
    "friction": sliding,
    "stick and slip": dragged,
    "rope": roped,
    "bead": bead,
}


def started(scene, rates):
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    v = start.v.copy()
    for joint, rate in rates.items():
        v[system.column(joint)] = rate
    if system.has_closures:
        (first,) = rates
        v = system.null_space(start.q, independent=[first])[:, 0] * rates[first]
    return system, system.state(start.q, v)


def differentiable(name):
    scene, rates, span = SCENES[name]()
    return *started(scene, rates), span


def extrapolated(function):
    """Derivative at 0 by central differences of three sizes (Richardson): the error is O(ε⁶)."""
    slopes = [(function(e) - function(-e)) / (2.0 * e) for e in DIFFERENCE / 2.0 ** np.arange(3)]
    while len(slopes) > 1:
        order = 4.0 ** (4 - len(slopes))
        slopes = [(order * fine - rough) / (order - 1.0) for rough, fine in zip(slopes, slopes[1:], strict=False)]
    return slopes[0]


def close(found, wanted, every, accuracy=ACCURACY):
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=accuracy * max(1.0, np.abs(every).max()))


def end(system, span, state):
    """(q, v) at the end of a motion of :func:`gauss.simulate`."""
    found = gauss.simulate(system, span, state=state, rtol=1e-13, progress=False)
    return np.concatenate([found.q[-1], found.v[-1]])


@pytest.mark.parametrize("name", SCENES)
def test_transition_matrices_through_events_are_derivatives_of_motions(name):
    system, start, span = differentiable(name)
    found = gauss.sensitivities(system, span, state=start, **METHOD)
    for k in range(len(found.states)):
        along = found.start[0][:, k]

        def moved(e, along=along):
            state = replace(start, q=start.q + e * along[: system.n_q], v=start.v + e * along[system.n_q :])
            return end(system, span, system.projected(state) if system.has_closures else state)

        close(found.start[-1][:, k], extrapolated(moved), found.start)


@pytest.mark.parametrize("name", ["pendulum at a stop", "four-bar", "stick and slip"])
def test_the_adjoint_through_events_is_the_transpose(name):
    system, start, span = differentiable(name)
    parameters = [f"mass:{next(iter(system.structure.bodies))}", "gravity"]
    settings = {"state": start, "parameters": parameters} | METHOD
    forward = gauss.sensitivities(system, span, **settings)
    weights = np.random.default_rng(6).normal(size=system.n_q + system.n_v)
    loss = lambda q, v: weights[: system.n_q] @ q + weights[system.n_q :] @ v  # noqa: E731
    found = gauss.motion_gradient(system, span, loss, **settings)
    close(found.start, weights @ forward.start[-1], forward.start, ROUND_OFF)
    for parameter, slope in forward.parameters.items():
        close(found.parameters[parameter], weights @ slope[-1], slope, ROUND_OFF)


@pytest.mark.parametrize(
    ("name", "body"),
    [("pendulum at a stop", "rod"), ("double pendulum", "lower"), ("four-bar", "coupler"), ("friction", "mass")],
)
def test_derivatives_by_masses_through_events(name, body):
    scene, rates, span = SCENES[name]()
    system, start = started(scene, rates)
    found = gauss.sensitivities(system, span, state=start, parameters=[f"mass:{body}"], **METHOD)

    def heavier(e):
        own = replace(scene.bodies[body], mass=scene.bodies[body].mass + e)
        return end(gauss.compile_scene(replace(scene, bodies=scene.bodies | {body: own})), span, start)

    close(found.parameters[f"mass:{body}"][-1][:, 0], extrapolated(heavier), found.start)


OF_EVENTS = [
    ("bouncing ball", "restitution:floor"),
    ("bouncing ball", "lowest:floor"),
    ("pendulum at a stop", "lowest:buffer"),
    ("double pendulum", "restitution:buffer"),
    ("four-bar", "restitution:buffer"),
    ("four-bar", "highest:buffer"),
    ("slider-crank", "highest:buffer"),
    ("pendulum that stays at a stop", "lowest:buffer"),
    ("double pendulum that stays", "lowest:buffer"),
    ("cart-pole that stays", "highest:buffer"),
    ("four-bar that stays", "lowest:buffer"),
    ("rope", "restitution:rope"),
    ("bead", "restitution:bowl"),
    ("friction", "limit:friction of x"),
    ("stick and slip", "limit:friction of x"),
]


@pytest.mark.parametrize(("name", "parameter"), OF_EVENTS)
def test_derivatives_by_restitution_stops_and_friction(name, parameter):
    scene, rates, span = SCENES[name]()
    system, start = started(scene, rates)
    found = gauss.sensitivities(system, span, state=start, parameters=[parameter], **METHOD)
    kind, _, element = parameter.partition(":")
    group = "set_valued" if kind == "limit" else "contacts"

    def changed(e):
        elements = getattr(scene, group)
        other = replace(elements[element], **{kind: getattr(elements[element], kind) + e})
        return end(gauss.compile_scene(replace(scene, **{group: elements | {element: other}})), span, start)

    close(found.parameters[parameter][-1][:, 0], extrapolated(changed), found.start)


def test_a_bouncing_ball_has_the_derivatives_of_its_closed_form():
    """z⁺ = h + e s τ − g τ²/2 at τ = T − T₁ after the first bounce, with s = g T₁ and T₁ = √(2 (z₀ − h) / g)."""
    scene = gauss.Scene("ball", gravity=(0, 0, -10.0))
    scene.prismatic("z", "ground", scene.body("ball", 2.0), axis=(0, 0, 1))
    scene.stop("z", lowest=-0.2, name="floor", restitution=0.5)
    names = ["restitution:floor", "lowest:floor"]
    T, first, fall = 0.3, 0.2, 2.0
    found = gauss.sensitivities(scene, T, step=0.01, integrator="dop853", parameters=names).parameters
    after = T - first
    by_first = -0.5 * fall + 0.5 * 10.0 * after + 10.0 * after  # ∂z/∂T₁
    assert found[names[0]][-1][:, 0] == pytest.approx([fall * after, fall], rel=ACCURACY)
    assert found[names[1]][-1][0, 0] == pytest.approx(1.0 - by_first / fall, rel=ACCURACY)


@pytest.mark.parametrize(
    ("name", "parameter", "error", "words"),
    [
        ("bouncing ball", "restitution:flour", StateError, "'floor'"),
        ("bouncing ball", "highest:floor", ArgumentError, "no stop with a place 'highest'"),
        ("pendulum that stays at a stop", "restitution:buffer", ArgumentError, "no derivative at 0"),
        ("pendulum on a stop", "lowest:buffer", SimulationError, "'buffer' bears from the start"),
        ("rope", "lowest:rope", ArgumentError, "'rope' is no stop"),
    ],
)
def test_parameters_of_events_without_a_derivative_are_named(name, parameter, error, words):
    scene, rates, span = SCENES[name]()
    system, start = started(scene, rates)
    with pytest.raises(error, match=words):
        gauss.sensitivities(system, span, state=start, parameters=[parameter], **METHOD)


def test_derivatives_by_a_centre_of_mass_through_an_impact():
    scene, rates, span = SCENES["double pendulum"]()
    system, start = started(scene, rates)
    found = gauss.sensitivities(system, span, state=start, parameters=["com:lower"], **METHOD)

    def longer(e):
        body = scene.bodies["lower"]
        moved = replace(body, com=tuple(np.array(body.com) + e * np.eye(3)[0]))
        return end(gauss.compile_scene(replace(scene, bodies=scene.bodies | {"lower": moved})), span, start)

    close(found.parameters["com:lower"][-1][:, 0], extrapolated(longer), found.start)


def test_gradients_by_held_inputs_through_an_impact():
    scene, rates, _ = SCENES["cart-pole"]()
    span = 0.2
    scene.input("push", "rail", limits=(-50.0, 50.0))
    system, start = started(scene, rates)
    steps = round(span / METHOD["step"])
    table = 2.0 * np.sin(np.arange(steps))[:, None]
    loss = lambda q, v: q[1] ** 2 + v[0] * v[1]  # noqa: E731
    found = gauss.motion_gradient(system, span, loss, state=start, inputs=table, **METHOD)
    impact = 10  # the step in which it is

    def changed(e):
        given = table + e * np.eye(steps)[:, [impact]]
        moved = gauss.simulate(system, span, state=start, control=given, rate=100.0, rtol=1e-13, progress=False)
        return loss(moved.q[-1], moved.v[-1])

    close(found.inputs[impact, 0], extrapolated(changed), found.inputs)


def grazing():
    """A ball thrown up that touches the ceiling with no speed."""
    scene = gauss.Scene("grazing", gravity=(0, 0, -10.0))
    scene.prismatic("z", "ground", scene.body("ball", 1.0), axis=(0, 0, 1))
    scene.stop("z", highest=0.2 - 1e-10, name="ceiling")
    return started(scene, {"z": 2.0})


def simultaneous():
    """Two balls that fall side by side."""
    scene = gauss.Scene("pair", gravity=(0, 0, -10.0))
    for name in ("one", "two"):
        scene.prismatic(f"z of {name}", "ground", scene.body(name, 1.0), axis=(0, 0, 1))
        scene.stop(f"z of {name}", lowest=-0.2, name=f"floor of {name}")
    return started(scene, {})


@pytest.mark.parametrize(
    ("make", "words"),
    [(grazing, "'ceiling.highest' .*graz"), (simultaneous, "'floor of one.lowest' and 'floor of two.lowest'")],
)
def test_events_without_a_derivative_are_refused_by_name(make, words):
    system, start = make()
    with pytest.raises(SimulationError, match=words):
        gauss.sensitivities(system, 0.4, step=0.01, state=start)


@pytest.mark.parametrize(
    ("law", "switches"),
    [
        (lambda t, at: gauss.math.where(at.position("cart")[0] > 0.1, -5.0, 0.0), True),
        (lambda t, at: gauss.math.floor(10.0 * at.position("cart")[0]), True),
        (lambda t, at: gauss.math.where(at.position("cart")[0] > 10.0, -5.0, 0.0), False),
        (lambda t, at: gauss.math.maximum(at.position("cart")[0] - 0.1, 0.0), False),
        (lambda t: gauss.math.where(t > 0.1, -5.0, 0.0), False),
    ],
)
def test_laws_that_jump_along_a_motion_are_named(law, switches):
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.prismatic("rail", "ground", scene.body("cart", 1.0), axis=(1, 0, 0))
    scene.drive("rail", force=law, name="push")
    system, start = started(scene, {"rail": 1.0})
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        gauss.sensitivities(system, 0.3, step=0.01, state=start)
    named = [one for one in found if issubclass(one.category, SwitchingWarning)]
    assert [("push" in str(one.message), one.filename == __file__) for one in named] == [(True, True)] * switches
