"""Linear models and equilibria: against differences on the constraint manifold, closed forms, and motions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

import gauss
from gauss.dynamics.projection import project_positions, project_rates
from gauss.errors import ArgumentError, SimulationError, StateError
from gauss.system import retract
from models import families
from tests.support import mechanisms

STEP = 1e-5  # of central differences, in units of the scene
DIFFERENCES = 1e-6  # relative to the largest entry of A: truncation h² and round-off ε / h
EXACT = 1e-9  # closed forms
ENERGY_STEP, ENERGY_SLOPE = 1e-3, 1e-5  # of second differences of energies, and what they leave: h², and round-off over h²
OFF, CHANGED = 1e-8, 1e-4  # distance of a state from its constraints, and share of A that it changes: over singular values
RICCATI = 1e-8  # gains by two solvers of the Riccati equation, relative
SCENES = {
    "open": lambda: gauss.load("double_pendulum"),
    "damped": lambda: gauss.load("cart_pole"),
    "loop": lambda: gauss.load("four_bar"),
    "slider": lambda: gauss.load("slider_crank"),
    "redundant": lambda: gauss.load("bricard"),
    "coupled": lambda: gauss.load("gear_pair"),
    "springs": lambda: families.stewart_platform(),
    "governor": lambda: families.flyball_governor(),
}


def _on_manifold(system, state, N, dy, dw, places, free):
    """State with the given changes of the independent coordinates and rates."""
    q = retract(system, state.q, N @ dy)
    moved = project_positions(system, replace(state, q=q), 40, tuple(places))
    v = state.v.copy()
    v[free] += dw
    return project_rates(system, replace(moved, v=v), tuple(free))


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_matrices_are_the_slopes_of_the_motion(name):
    system = gauss.compile_scene(SCENES[name]())
    rng = np.random.default_rng(1)
    start = system.initial_state()
    state = system.initial_state(start.q, start.v + 0.3 * system.scale.rates * rng.normal(size=system.n_v))
    # rates of a ball joint are no rates of coordinates: the legs describe the platform
    legs = [f"leg{k}" for k in range(1, 7)] if name == "springs" else None
    model = gauss.linearise(system, state, independent=legs)
    k = model.displacements.shape[1]
    names = list(system.coordinates)
    places = [names.index(one) for one in model.states[:k]]
    free = [names.index(one.removesuffix(" rate")) for one in model.states[k:]]
    units = np.concatenate([system.scale.coordinates[places], system.scale.rates[free]])
    found = np.empty((k + len(free),) * 2)
    for j, unit in enumerate(units):
        change, slopes = np.zeros(len(units)), []
        for sign in (1.0, -1.0):
            change[j] = sign * STEP * unit
            there = _on_manifold(system, state, model.displacements, change[:k], change[k:], places, free)
            slopes.append(np.concatenate([there.v[places], system.accelerations(there)[free]]))
        found[:, j] = (slopes[0] - slopes[1]) / (2.0 * STEP * unit)
    assert np.abs(model.A - found).max() <= DIFFERENCES * np.abs(model.A).max()


def test_a_pendulum_has_its_frequency():
    scene = gauss.load("pendulum")
    rest = gauss.equilibrium(scene)
    modes = rest.model.modes()
    system = rest.model.system
    M = system.mass_matrix(rest.state.q)[0, 0]
    slope = system.gravity_forces(rest.state.q + 1e-6) - system.gravity_forces(rest.state.q - 1e-6)
    assert modes.frequencies == pytest.approx([np.sqrt(slope[0] / 2e-6 / M) / (2.0 * np.pi)], rel=1e-8)
    assert rest.stability == "marginal" and "A" in str(modes)


@pytest.mark.slow
@pytest.mark.parametrize("axis, is_stable", [(0, True), (1, False), (2, True)])
def test_a_free_body_turns_stably_about_its_extreme_axes(axis, is_stable):
    """λ² = ω² (I₁ − I₂)(I₃ − I₁) / (I₂ I₃) about axis 1 (Euler)."""
    inertia, speed = np.array([1.0, 2.0, 2.5]), 2.0
    scene = gauss.Scene("body", gravity=(0.0, 0.0, 0.0))
    scene.body("body", mass=1.0, inertia=tuple(inertia))
    scene.free("flight", "ground", "body")
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    v = np.zeros(6)
    v[[name in (f"flight.w{'xyz'[axis]}",) for name in system.coordinates]] = speed
    model = gauss.linearise(system, replace(start, v=v))
    one, two, three = inertia[[axis, (axis + 1) % 3, (axis + 2) % 3]]
    square = speed**2 * (one - two) * (three - one) / (two * three)
    assert np.abs(model.eigenvalues**2 - square).min() <= EXACT * abs(square)
    assert (square < 0.0) == is_stable
    assert (model.eigenvalues.real.max() > 0.1) == (not is_stable)


@pytest.mark.slow
def test_freedoms_of_a_loop_with_redundant_rows_are_counted_once():
    model = gauss.linearise(gauss.load("bricard"))
    assert model.A.shape == (2, 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bricard", "parallelogram", "four_bar", "cardan"])
def test_states_a_little_off_their_constraints_have_the_same_freedoms(name):
    """Redundant rows contradict each other there; rates are those of the coordinates, in which no other is better."""
    system, rng = gauss.compile_scene(gauss.load(name)), np.random.default_rng(2)
    moved = gauss.simulate(system, 0.3, rtol=1e-10, atol=1e-10)
    state = system.state(moved.q[-1], moved.v[-1])
    model = gauss.linearise(system, state)
    assert model.states == (model.states[0], f"{model.states[0]} rate")
    away = replace(state, q=retract(system, state.q, OFF * rng.normal(size=system.n_v)))
    A = gauss.linearise(system, away, independent=model.states[:1]).A
    assert A == pytest.approx(model.A, abs=CHANGED * np.abs(model.A).max())


@pytest.mark.parametrize("change", [lambda s: replace(s, q=s.q + 1e-3), lambda s: replace(s, v=np.eye(4)[0])])
def test_states_far_from_their_constraints_are_refused(change):
    system = gauss.compile_scene(gauss.load("four_bar"))
    with pytest.raises(StateError, match="'D'"):
        gauss.linearise(system, change(system.initial_state()))


@pytest.mark.slow
@pytest.mark.parametrize("mass", [1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13])
def test_light_rods_of_loops_are_modelled_or_refused(mass):
    """Masses that differ by many orders take digits of the multipliers; the model without the rod's mass is the limit."""

    def linkage(mass):
        scene, corner = gauss.Scene("light rod", gravity=(0.0, -9.81, 0.0)), (0.0, 0.4, 0.0)
        crank = scene.body("crank", 1.0, (0.0, 0.0, 0.02), com=(0.0, 0.2, 0.0))
        rod = scene.body("rod", mass, (0.0, 0.0, 0.1 * mass), position=corner)
        rocker = scene.body("rocker", 1.0, (0.0, 0.0, 0.02), position=(1.0, 0.0, 0.0), com=(0.0, 0.3, 0.0))
        for name, pair, at in (
            ("A", ("ground", crank), (0.0, 0.0, 0.0)), ("B", (crank, rod), corner), ("C", (rod, rocker), (1.0, 0.6, 0.0)),
            ("D", ("ground", rocker), (1.0, 0.0, 0.0)),
        ):  # fmt: skip
            scene.revolute(name, *pair, at=at)
        system = gauss.compile_scene(scene)
        state = system.initial_state([0.3, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], keep=["A"])
        return gauss.linearise(system, state, independent=["A"]).A

    limit = linkage(0.0)
    try:
        assert linkage(mass) == pytest.approx(limit, abs=(10.0 * mass + CHANGED) * np.abs(limit).max())
    except SimulationError as error:
        assert mass < 1e-6 and "too few digits" in str(error)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cardan", "turntable"])
def test_neutral_rest_is_marginal(name):
    """A balanced joint stays wherever it is put: both its eigenvalues are zero."""
    assert {one.stability for one in gauss.equilibria(gauss.load(name), starts=8)} == {"marginal"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "four_bar", "bricard"])
def test_modes_are_those_of_the_state_of_rest(name):
    """ω² = V″ / M of one freedom, by energies along it."""
    scene = gauss.load(name)
    found, rest = gauss.modes(scene), gauss.equilibrium(scene)
    system, N = rest.model.system, rest.model.displacements

    def energy(share):
        q = rest.state.q + share * ENERGY_STEP * N[:, 0]
        return system.potential_energy(project_positions(system, replace(rest.state, q=q), 40, tuple(free)).q)

    free = [list(system.coordinates).index(rest.model.states[0])]
    slope = (energy(1) + energy(-1) - 2.0 * energy(0)) / ENERGY_STEP**2
    M = N[:, 0] @ system.mass_matrix(rest.state.q) @ N[:, 0]
    square = float(np.squeeze(slope)) / M
    assert found.eigenvalues**2 == pytest.approx(np.full(len(found.eigenvalues), -square), rel=ENERGY_SLOPE)
    assert gauss.modes(system, rest.state).shapes == pytest.approx(found.shapes)


@pytest.mark.slow
def test_what_sticks_binds_rates():
    """A double pendulum whose upper joint sticks: the lower one swings as a pendulum about it."""
    scene = gauss.load("double_pendulum")
    scene.starts.clear()
    stuck = replace(scene, set_valued=dict(scene.set_valued))
    stuck.joint_friction("A", 1e3)
    start = gauss.compile_scene(scene).state([-0.4, 0.4 - np.pi / 2.0], np.zeros(2))
    model = gauss.linearise(stuck, start)
    assert model.states == ("A", "B", "B rate") and model.is_equilibrium
    assert gauss.linearise(stuck, start, independent=["B", "A"]).states == ("B", "A", "B rate")
    body = scene.bodies["lower"]
    arm, inertia = np.linalg.norm(body.com), body.inertia[2] + body.mass * np.linalg.norm(body.com) ** 2
    weight = body.mass * abs(scene.gravity[1]) * arm / inertia
    assert np.sort(np.abs(model.eigenvalues)) == pytest.approx([0.0, np.sqrt(weight), np.sqrt(weight)], rel=EXACT)
    assert model.A[2] == pytest.approx([-weight, -weight, 0.0])


@pytest.mark.slow
def test_rolling_binds_rates_alone():
    model = gauss.linearise(gauss.load("rolling_disk"))
    assert len([one for one in model.states if one.endswith(" rate")]) == 3 and len(model.states) == 8
    given = gauss.linearise(gauss.load("rolling_disk"), independent=model.states[:5])
    assert given.states[:5] == model.states[:5] and len(given.states) == 8
    assert np.sort_complex(given.eigenvalues) == pytest.approx(np.sort_complex(model.eigenvalues), abs=1e-6)


@pytest.mark.slow
def test_a_pole_is_balanced_by_the_regulator_of_its_linear_model():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail")
    scene.output("lean", "coordinate", "pin")
    upright = max(gauss.equilibria(scene), key=lambda one: one.energy)
    assert upright.stability == "unstable"
    model = gauss.linearise(scene, upright.state)
    assert model.inputs == ("push",) and model.outputs == ("lean",) and model.D == pytest.approx(0.0)
    gains = model.B.T @ solve_continuous_are(model.A, model.B, np.eye(4), np.eye(1))
    order = [list(model.system.coordinates).index(name.removesuffix(" rate")) for name in model.states]
    k = len(order) // 2
    at = upright.state.q[order[:k]]
    law = lambda t, q, v: -gains[0] @ np.concatenate([q[order[:k]] - at, v[order[k:]]])  # noqa: E731
    q = upright.state.q + [0.0, 0.2]
    motion = gauss.simulate(scene, 12.0, state=model.system.initial_state(q, np.zeros(2)), control=law, rate=200, rtol=1e-8)
    assert np.abs(motion.q[-1] - upright.state.q).max() <= 1e-2


def test_a_regulated_arm_has_the_forces_that_hold_it():
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    kept = gauss.equilibrium(system, keep=["A"])
    load = np.array([kept.forces["A"], 0.0])
    assert np.abs(system.inverse_dynamics(kept.state.q, np.zeros(2), np.zeros(2)) - load).max() <= 1e-9
    assert kept.state.q[0] == system.initial_state().q[0]


@pytest.mark.slow
def test_equilibria_of_a_linkage_are_the_extremes_of_its_energy():
    found = gauss.equilibria(gauss.load("four_bar"), starts=16)
    assert len(found) == 4 and found[0].stability == "marginal" and found[-1].stability == "unstable"
    assert sorted(one.energy for one in found) == [one.energy for one in found]
    assert [one.energy for one in found] == pytest.approx([-25.42069, -0.40837, 0.40837, 25.42069], abs=1e-5)


def test_outputs_are_slopes_of_what_is_measured():
    scene = gauss.load("cart_pole")
    scene.output("felt", "accelerometer", "pole", at=(0.0, 0.0, 0.6))
    system = gauss.compile_scene(scene)
    model = gauss.linearise(system, inputs=["rail"], outputs=["felt", "rail", "pin rate"], independent=["rail", "pin"])
    assert model.outputs == ("felt[0]", "felt[1]", "felt[2]", "rail", "pin rate")
    assert model.C[3:] == pytest.approx(np.eye(4)[[0, 3]]) and np.abs(model.D[:3]).max() > 0.0
    response = gauss.linearise(system, inputs=["rail"], outputs=["rail"], independent=["rail", "pin"]).B[2:]
    assert model.B[2:] == pytest.approx(response)


@pytest.mark.slow
@pytest.mark.parametrize(
    "call, error, words",
    [
        (lambda s: gauss.linearise(s, inputs=["rial"]), StateError, "rail"),
        (lambda s: gauss.linearise(s, outputs=["pin rates"]), StateError, "pin rate"),
        (lambda s: gauss.linearise(s, independent=["rail"]), StateError, "2 coordinates"),
        (lambda s: gauss.linearise(s, independent=3), ArgumentError, "independent: expected names"),
        (lambda s: gauss.modes("cart_pole"), ArgumentError, "modes: expected a System or Scene"),
        (lambda s: gauss.modes(s, s.initial_state(), t=1.0), ArgumentError, "time of its own"),
        (lambda s: gauss.equilibrium(s, keep=["nothing"]), StateError, "nothing"),
        (lambda s: gauss.equilibrium(s, loads={"rial": 1.0}), StateError, "rail"),
        (lambda s: gauss.equilibrium(s, loads={"rail": 1.0}), SimulationError, "'rail' still accelerates"),
        (lambda s: gauss.equilibrium(s, loads={"rail": "1 N"}), StateError, "rail"),
        (lambda s: gauss.equilibria(s, starts=-1), ArgumentError, "starts"),
        (lambda s: gauss.linearise(s, inputs=2), ArgumentError, "inputs"),
        (lambda s: gauss.linearise(s, outputs=["pin", 2]), ArgumentError, "outputs"),
        (lambda s: gauss.linearise("cart_pole"), gauss.GaussError, "Scene"),
    ],
)
def test_what_cannot_be_linearised_is_named(call, error, words):
    with pytest.raises(error, match=words):
        call(gauss.compile_scene(gauss.load("cart_pole")))


def test_a_state_space_of_python_control_has_the_names():
    control = pytest.importorskip("control")
    system = gauss.compile_scene(mechanisms.rods(1))
    model = gauss.linearise(system, inputs=system.coordinates)
    assert isinstance(model.state_space(), control.StateSpace)
    assert model.state_space().state_labels == list(model.states)
    with pytest.raises(SimulationError, match="inputs"):
        gauss.linearise(system).state_space()


def two_pendulums(coupled):
    """Two upright pendulums, the first driven; a spring between them, or none."""
    scene = gauss.Scene("two", gravity=(0, 0, -9.81))
    for place, name in enumerate("AB"):
        rod = scene.body(f"rod {name}", 1.0, (0.1, 0.1, 0.1), com=(0, 0, 0.5), position=(0, place, 0))
        scene.revolute(name, "ground", rod, at=(0, place, 0), axis=(1, 0, 0))
    if coupled:
        scene.spring("spring", "rod A", "rod B", at=(0, 0, 0.5), other_at=(0, 0, 0.5), stiffness=3.0, length=0.5)
    scene.input("push", "A")
    return scene


def test_the_regulator_of_a_mass_is_the_closed_form():
    scene = gauss.Scene("mass", gravity=(0, 0, 0))
    scene.prismatic("x", "ground", scene.body("m", 2.0), axis=(1, 0, 0))
    scene.input("push", "x")
    model = gauss.linearise(scene)
    for a, b, r in ((1.0, 1.0, 1.0), (9.0, 0.5, 0.04)):
        stiff = np.sqrt(a / r)
        assert model.lqr([a, b], [r]) == pytest.approx(np.array([[stiff, np.sqrt(b / r + 4.0 * stiff)]]), rel=RICCATI)


@pytest.mark.slow
@pytest.mark.parametrize(
    "make", [lambda: two_pendulums(True), lambda: driven("four_bar", "A"), lambda: driven("cart_pole", "rail")]
)
def test_the_regulator_is_that_of_python_control_and_stabilises(make):
    control = pytest.importorskip("control")
    model = gauss.linearise(make())
    Q, R = np.diag(np.arange(1.0, len(model.A) + 1.0)), np.array([[0.3]])
    K = model.lqr(Q, R)
    assert K == pytest.approx(control.lqr(model.A, model.B, Q, R)[0], rel=RICCATI)
    assert np.linalg.eigvals(model.A - model.B @ K).real.max() < 0.0
    assert not len(model.uncontrollable().eigenvalues)


def driven(name, joint):
    """A shipped scene with an input."""
    scene = gauss.load(name)
    scene.input("push", joint)
    return scene


def test_modes_that_no_input_reaches_are_named():
    model = gauss.linearise(two_pendulums(False))
    left = model.uncontrollable()
    rate = np.sqrt(9.81 * 0.5 / (0.1 + 0.25))
    assert sorted(left.eigenvalues.real) == pytest.approx([-rate, rate])
    assert np.abs(left.shapes) == pytest.approx(np.tile([0.0, 1.0], (2, 1)), abs=1e-9)
    with pytest.raises(SimulationError, match="'push' do not reach .*\n.*\n.* B$"):
        model.lqr()


def test_free_masses_that_no_input_reaches_are_named():
    """All eigenvalues are zero: none of them is stable."""
    scene = gauss.Scene("masses", gravity=(0, 0, 0))
    for name in "xy":
        scene.prismatic(name, "ground", scene.body(f"mass {name}", 1.0), axis=(1, 0, 0))
    scene.input("push", "x")
    with pytest.raises(SimulationError, match="'push' do not reach (.*\n)+.* y"):
        gauss.linearise(scene).lqr()


def test_what_is_printed_of_a_model_is_short():
    assert len(repr(gauss.linearise(two_pendulums(True)))) < 1500


@pytest.mark.slow
@pytest.mark.parametrize(
    "weights", [{"Q": [1.0]}, {"Q": [1.0, -1.0, 1.0, 1.0]}, {"R": "x"}, {"R": [[np.nan]]}, {"Q": [[0, 1], [0, 0]]}]
)
def test_weights_that_do_not_fit_are_refused(weights):
    with pytest.raises(ArgumentError, match=next(iter(weights))):
        gauss.linearise(two_pendulums(True)).lqr(**weights)


def test_a_model_without_inputs_has_no_regulator():
    with pytest.raises(SimulationError, match="inputs"):
        gauss.linearise(gauss.load("pendulum")).lqr()
