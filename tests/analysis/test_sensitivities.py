from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.dynamics.motion_step import TABLEAUS
from gauss.errors import ArgumentError, SimulationError, StateError
from tests.dynamics.test_parameter_terms import with_moved_joint

ACCURACY = 1e-8  # of extrapolated differences, relative to the largest derivative of the motion
DIFFERENCE = 2e-3  # largest of the differences that are extrapolated, in the unit of what is changed
STEP, SPAN = 0.01, 0.25
FINE, LOOP_ACCURACY = 0.0025, 1e-6  # with loops, derivatives by parameters have an error of the order of the method, h⁴
SMOOTH = [
    "pendulum",
    "double_pendulum",
    "cart_pole",
    "spatial_tree",
    "heavy_top",
    "four_bar",
    "slider_crank",
    "parallelogram",
]


def derivative(function):
    """Derivative at 0 by central differences of three sizes, extrapolated (Richardson): the error is O(ε⁶)."""
    slopes = [(function(e) - function(-e)) / (2.0 * e) for e in DIFFERENCE / 2.0 ** np.arange(3)]
    while len(slopes) > 1:
        order = 4.0 ** (4 - len(slopes))
        slopes = [(order * fine - rough) / (order - 1.0) for rough, fine in zip(slopes, slopes[1:], strict=False)]
    return slopes[0]


def end(system, state=None, step=STEP):
    """(q, v) at the end of a motion of the same steps, by another route."""
    found = gauss.simulate(system, SPAN, state=state, integrator="rk4", step=step)
    return np.concatenate([found.q[-1], found.v[-1]])


def close(found, wanted, size=1.0, accuracy=ACCURACY):
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=accuracy * max(size, np.abs(wanted).max(initial=0.0)))


def started(system):
    """A consistent start that moves."""
    start = system.initial_state()
    v = start.v + 0.3 * np.cos(np.arange(system.n_v))
    return system.projected(system.state(start.q, v)) if system.closes else system.state(start.q, v)


@pytest.mark.slow
@pytest.mark.parametrize("name", SMOOTH)
def test_the_transition_matrix_is_the_derivative_by_the_start(name):
    system = gauss.compile_scene(gauss.load(name))
    start = started(system)
    found = gauss.sensitivities(system, SPAN, step=STEP, state=start)
    close(np.concatenate([found.q[-1], found.v[-1]]), end(system, start))
    for k in range(len(found.states)):
        along = found.start[0][:, k]

        def moved(e, along=along):
            q, v = start.q + e * along[: system.n_q], start.v + e * along[system.n_q :]
            for place in system.quaternions.values():
                q[place] /= np.linalg.norm(q[place])
            state = replace(start, q=q, v=v)
            return end(system, system.projected(state) if system.closes else state)

        close(found.start[-1][:, k], derivative(moved), np.abs(found.start[-1]).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", SMOOTH)
def test_the_adjoint_is_the_transpose_of_the_forward_derivative(name):
    system = gauss.compile_scene(gauss.load(name))
    start, body = started(system), next(iter(system.structure.bodies))
    settings = {"step": STEP, "state": start, "parameters": [f"mass:{body}", "gravity"]}
    forward = gauss.sensitivities(system, SPAN, **settings)
    weights = np.random.default_rng(6).normal(size=system.n_q + system.n_v)
    loss = lambda q, v: weights[: system.n_q] @ q + weights[system.n_q :] @ v  # noqa: E731
    found = gauss.motion_gradient(system, SPAN, loss, **settings)
    np.testing.assert_allclose(found.value, weights @ np.concatenate([forward.q[-1], forward.v[-1]]), rtol=1e-12)
    for one, other in [
        (found.start, forward.start),
        *((found.parameters[p], forward.parameters[p]) for p in found.parameters),
    ]:
        np.testing.assert_allclose(one, weights @ other[-1], atol=1e-11 * np.abs(other[-1]).max(initial=1.0), rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "body"), [("double_pendulum", "upper"), ("cart_pole", "pole"), ("four_bar", "coupler")])
def test_derivatives_by_parameters_are_those_of_other_scenes(name, body):
    scene = gauss.load(name)
    step, accuracy = (FINE, LOOP_ACCURACY) if name == "four_bar" else (STEP, ACCURACY)
    found = gauss.sensitivities(scene, SPAN, step=step, parameters=[f"mass:{body}", "gravity"])
    down = int(np.argmax(np.abs(scene.gravity)))

    def heavier(e):
        own = replace(scene.bodies[body], mass=scene.bodies[body].mass + e)
        return end(gauss.compile_scene(replace(scene, bodies=scene.bodies | {body: own})), step=step)

    def pulled(e):
        return end(
            gauss.compile_scene(replace(scene, gravity=tuple(np.array(scene.gravity) + e * np.eye(3)[down]))), step=step
        )

    by_mass, by_gravity = found.parameters[f"mass:{body}"], found.parameters["gravity"]
    close(by_mass[-1][:, 0], derivative(heavier), accuracy=accuracy)
    close(by_gravity[-1][:, down], derivative(pulled), accuracy=accuracy)


@pytest.mark.slow
@pytest.mark.parametrize("where", ["parent_at", "child_at"])
def test_derivatives_by_lengths_of_a_tree(where):
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    start, parameter = system.initial_state(), f"{where}:B"
    found = gauss.sensitivities(system, SPAN, step=STEP, parameters=[parameter]).parameters[parameter][-1]
    wanted = [
        derivative(lambda e, axis=axis: end(with_moved_joint(system, where, "B", e * axis), start)) for axis in np.eye(3)
    ]
    close(found, np.array(wanted).T)


@pytest.mark.parametrize("parameter", ["child_at:D", "parent_at:B"])
@pytest.mark.parametrize("call", ["sensitivities", "motion_gradient"])
def test_lengths_of_loops_are_refused(parameter, call):
    """A start that closes the loops closes them for no other length."""
    loss = [] if call == "sensitivities" else [lambda q, v: q[0]]
    with pytest.raises(ArgumentError, match=parameter):
        getattr(gauss, call)(gauss.load("four_bar"), SPAN, *loss, step=STEP, parameters=[parameter])


def test_gradients_by_inputs_are_those_of_held_tables():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=(-50.0, 50.0))
    system, steps = gauss.compile_scene(scene), round(SPAN / STEP)
    table = np.sin(np.arange(steps))[:, None]
    loss = lambda q, v: q[1] ** 2 + v[0] * v[1]  # noqa: E731
    found = gauss.motion_gradient(system, SPAN, loss, step=STEP, inputs=table)
    for k in (0, steps // 2, steps - 1):
        given = lambda e, k=k: table + e * np.eye(steps)[:, [k]]  # noqa: E731
        changed = lambda e, given=given: gauss.motion_gradient(system, SPAN, loss, step=STEP, inputs=given(e)).value  # noqa: E731
        close(found.inputs[k, 0], derivative(changed), np.abs(found.inputs).max())


@pytest.mark.slow
def test_gradients_at_a_limit_of_an_input_are_one_sided():
    """Those of a scene without limits up to the limit itself, and zero beyond."""
    found = {}
    for limits in ((-50.0, 3.0), (3.0, 50.0), None, (-50.0, 2.0)):
        scene = gauss.load("cart_pole")
        scene.input("push", "rail", limits=limits)
        table = np.full((round(SPAN / STEP), 1), 3.0)
        loss = lambda q, v: q[1] ** 2 + v[0] * v[1]  # noqa: E731
        found[limits] = gauss.motion_gradient(scene, SPAN, loss, step=STEP, inputs=table).inputs
    for limits in ((-50.0, 3.0), (3.0, 50.0)):
        np.testing.assert_allclose(found[limits], found[None], rtol=1e-12)
    assert found[None].all() and not found[-50.0, 2.0].any()


@pytest.mark.slow
@pytest.mark.parametrize("integrator", TABLEAUS)
def test_methods_converge_to_the_exact_transition_matrix(integrator):
    scene = gauss.Scene("oscillator", gravity=(0, 0, 0))
    scene.prismatic("x", "ground", scene.body("cart", 2.0))
    scene.joint_spring("k", "x", stiffness=8.0)
    found = gauss.sensitivities(scene, 1.0, step=STEP, integrator=integrator, parameters="stiffness:k")
    wanted = [[np.cos(2.0), np.sin(2.0) / 2.0], [-2.0 * np.sin(2.0), np.cos(2.0)]]
    np.testing.assert_allclose(found.start[-1], wanted, atol=1e-7)


def test_what_has_no_derivatives_is_refused_by_name():
    rough = gauss.load("block_on_incline")
    with pytest.raises(SimulationError, match="friction of contacts"):
        gauss.sensitivities(rough, 0.1, step=0.01)
    scene = gauss.load("pendulum")
    with pytest.raises(ArgumentError, match="whole number"):
        gauss.sensitivities(scene, 0.105, step=0.01)
    for duration, step in ((np.nan, 0.01), (np.inf, 0.01), ("1 s", 0.01), (0.1, -0.01), (0.1, np.nan)):
        with pytest.raises(SimulationError, match="positive"):
            gauss.sensitivities(scene, duration, step=step)
    with pytest.raises(ArgumentError, match="parameter"):
        gauss.sensitivities(scene, 0.1, step=0.01, parameters=[3])
    with pytest.raises(ArgumentError, match="no value"):
        gauss.motion_gradient(scene, 0.1, lambda q, v: gauss.math.sqrt(-1.0 - q[0] ** 2), step=0.01)
    with pytest.raises(ArgumentError, match="rk4"):
        gauss.sensitivities(scene, 0.1, step=0.01, integrator="rk5")
    with pytest.raises(StateError, match="rod"):
        gauss.sensitivities(scene, 0.1, step=0.01, parameters=["mass:rodd"])
    with pytest.raises(ArgumentError, match="shape"):
        gauss.sensitivities(scene, 0.1, step=0.01, inputs=np.zeros((3, 1)))
    with pytest.raises(ArgumentError, match="traced"):
        gauss.motion_gradient(scene, 0.1, lambda q, v: float(q[0]), step=0.01)
