import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.linalg import expm

import gauss
from gauss import export
from gauss.codegen import Kernel
from gauss.errors import FileError, SceneError
from gauss.scene import actuators

TIGHT = {"rtol": 1e-11, "atol": 1e-12}
ACCURACY = 1e-8  # of motions at these tolerances, and of fixed steps of high order
COARSE = 1e-5  # of fixed steps of low order
SPAN = 0.3  # s
VOLTAGE, RESISTANCE, INDUCTANCE, CONSTANT, INERTIA = 12.0, 1.5, 0.01, 0.1, 0.02
MOTOR = np.array([[0.0, CONSTANT / INERTIA], [-CONSTANT / INDUCTANCE, -RESISTANCE / INDUCTANCE]])  # of (rate, current)


def rotor(mass=1.0, gravity=(0, 0, 0)):
    scene = gauss.Scene("rotor", gravity=gravity)
    scene.revolute("A", "ground", scene.body("disk", mass, (INERTIA,) * 3))
    return scene


def motor(voltage=VOLTAGE):
    scene = rotor()
    actuators.dc_motor(scene, "m", "A", voltage, resistance=RESISTANCE, inductance=INDUCTANCE, constant=CONSTANT)
    return scene


def motor_at(t):
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[1, 2] = MOTOR, VOLTAGE / INDUCTANCE
    return expm(whole * t)[:2, 2]


def ends(trajectory):
    return np.array([trajectory.rate("A")[-1], trajectory.rate("m current")[-1]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "step", "tolerance"),
    [
        ("dop853", None, ACCURACY),
        ("radau5", None, ACCURACY),
        ("cvode_bdf", None, 1e-5),
        ("taylor", None, ACCURACY),
        ("rk4", 1e-3, 1e-4),
        ("gauss4", 1e-3, 1e-4),
        ("energy_momentum", 2e-4, 1e-3),
        ("time_stepping", 2e-4, 1e-3),
    ],
)
def test_a_motor_with_inductance_has_its_closed_form(integrator, step, tolerance):
    settings = TIGHT if step is None else {"step": step}
    trajectory = gauss.simulate(motor(), SPAN, integrator=integrator, **settings)
    np.testing.assert_allclose(ends(trajectory), motor_at(trajectory.t[-1]), rtol=tolerance)


@pytest.mark.slow
def test_an_opaque_law_and_a_traced_one_move_alike():
    opaque = motor(lambda t: VOLTAGE * float(np.format_float_positional(t) != ""))
    np.testing.assert_allclose(ends(gauss.simulate(opaque, SPAN, **TIGHT)), motor_at(SPAN), rtol=ACCURACY)


def test_batches_and_simulators_have_the_states():
    scene = gauss.compile_scene(motor())
    steps, step = 300, 1e-3
    many = gauss.rollout(scene, np.zeros((3, 2)), np.zeros((3, 2)), integrator="rk4", step=step, steps=steps)
    simulator = gauss.Simulator(scene.scene, step=step, integrator="rk4")
    for _ in range(steps):
        simulator.step()
    np.testing.assert_allclose(many.v[:, -1], [motor_at(steps * step)] * 3, rtol=1e-4)
    np.testing.assert_allclose(simulator.state.v, many.v[0, -1], rtol=1e-12)


@pytest.mark.slow
def test_a_linear_model_has_the_states_by_name():
    scene = motor(0.0)
    scene.input("u", {"m current": 1.0 / INDUCTANCE})
    model = gauss.linearise(scene, outputs=["m current", "A"])
    assert model.states == ("A", "A rate", "m current") and model.is_equilibrium
    np.testing.assert_allclose(model.A[1:, 1:], MOTOR, atol=1e-12)
    np.testing.assert_allclose(model.B[:, 0], [0.0, 0.0, 1.0 / INDUCTANCE])
    np.testing.assert_allclose(model.C, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def test_energies_leave_states_out():
    trajectory = gauss.simulate(motor(), SPAN, **TIGHT)
    energy = gauss.energy(trajectory)
    np.testing.assert_allclose(energy.kinetic, 0.5 * INERTIA * trajectory.rate("A") ** 2, atol=1e-12)
    np.testing.assert_allclose(energy.drives, energy.kinetic, atol=1e-8)


def test_a_controller_of_the_integral_leaves_no_error():
    scene = rotor(gravity=(0, 0, -9.81))
    scene.drive("A", torque=-0.3, name="weight")
    actuators.pi_controller(scene, "c", "A", 1.0, proportional=2.0, integral=4.0, derivative=0.4)
    trajectory = gauss.simulate(scene, 30.0, rtol=1e-9, atol=1e-9)
    assert abs(trajectory.coordinate("A")[-1] - 1.0) < 1e-6
    assert abs(trajectory.rate("c integral")[-1] - 0.3 / 4.0) < 1e-6


def lugre(scene):
    given = {"coulomb": 0.2, "static": 0.3, "stribeck": 0.05, "stiffness": 80.0, "damping": 0.5, "viscous": 0.01}
    actuators.lugre_friction(scene, "f", "A", **given)
    scene.drive("A", torque=lambda t: 0.5 * np.sin(3.0 * t), name="shaker")

    def rates(t, x):
        _, v, z = x
        g = 0.2 + 0.1 * np.exp(-((v / 0.05) ** 2))
        dz = v - 80.0 * abs(v) * z / g
        return [v, (0.5 * np.sin(3.0 * t) - 80.0 * z - 0.5 * dz - 0.01 * v) / INERTIA, dz]

    return rates


def muscle(scene):
    actuators.muscle(scene, "f", "A", lambda t: 0.5 + 0.5 * np.sin(4.0 * t), force=40.0, arm=0.03, optimal_length=0.1)
    scene.joint_spring("tendon", "A", stiffness=1.5, damping=0.1)

    def rates(t, x):
        q, v, a = x
        shortening = 0.03 * v / (0.1 * 10.0)
        slow, fast = np.clip([shortening, -shortening], 0.0, 1.0)
        velocity = (1 - slow) / (1 + 4 * slow) if shortening > 0 else 1.4 - 0.4 / (1 + 12.5 * fast)
        torque = 0.03 * 40.0 * a * np.exp(-((0.03 * q / 0.1 / 0.45) ** 2)) * velocity
        return [v, (torque - 1.5 * q - 0.1 * v) / INERTIA, (0.5 + 0.5 * np.sin(4.0 * t) - a) / 0.015]

    return rates


@pytest.mark.slow
@pytest.mark.parametrize("make", [lugre, muscle])
def test_actuators_move_as_their_equations(make):
    scene = rotor()
    rates = make(scene)
    (state,) = scene.states
    trajectory = gauss.simulate(scene, SPAN, rtol=1e-10, atol=1e-11)
    exact = solve_ivp(rates, (0.0, SPAN), [0.0, 0.0, 0.0], rtol=1e-11, atol=1e-12, method="DOP853").y[:, -1]
    found = [trajectory.coordinate("A")[-1], trajectory.rate("A")[-1], trajectory.rate(state)[-1]]
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-8)


@pytest.mark.slow
def test_states_go_with_loops_and_contacts():
    scene = gauss.load("four_bar")
    actuators.low_pass(scene, "slow", lambda t, at: at.rate("A"), 0.1, start=0.5)
    fine = np.linspace(0.0, SPAN, 2001)
    trajectory = gauss.simulate(scene, SPAN, times=fine, **TIGHT)
    rate, slow = trajectory.rate("A"), trajectory.rate("slow")
    exact = 0.5 * np.exp(-SPAN / 0.1) + simpson(rate * np.exp((fine - SPAN) / 0.1) / 0.1, x=fine)
    assert abs(slow[-1] - exact) <= ACCURACY * np.abs(rate).max()
    stopped = gauss.load("double_pendulum_stops")
    actuators.low_pass(stopped, "slow", lambda t, at: at.rate("A"), 0.1)
    assert np.isfinite(gauss.simulate(stopped, SPAN).rate("slow")[-1])


@pytest.mark.slow
def test_a_motor_turns_a_linkage_with_the_power_that_it_takes():
    """∫ (u − R i) i dt is the energy of the winding and of the four-bar: k i q̇ leaves the one and enters the other."""
    scene, fine = gauss.load("four_bar"), np.linspace(0.0, SPAN, 2001)
    actuators.dc_motor(scene, "m", "A", VOLTAGE, resistance=RESISTANCE, inductance=INDUCTANCE, constant=CONSTANT, ratio=20.0)
    found = gauss.simulate(scene, SPAN, times=fine, **TIGHT)
    i, energy = found.rate("m current"), gauss.energy(found)
    stored = 0.5 * INDUCTANCE * i[-1] ** 2 + (energy.kinetic + energy.potential)[-1] - (energy.kinetic + energy.potential)[0]
    taken = simpson((VOLTAGE - RESISTANCE * i) * i, x=fine)
    assert abs(taken - stored) <= ACCURACY * max(np.abs(energy.kinetic).max(), abs(taken))


@pytest.mark.slow
def test_a_linear_model_of_a_linkage_with_a_motor():
    """The rates of the crank and of the current at a rest of both, by differences along the loop."""
    scene = gauss.load("four_bar")
    scene.starts.clear()
    actuators.dc_motor(scene, "m", "A", 0.0, resistance=RESISTANCE, inductance=INDUCTANCE, constant=CONSTANT)
    bare = gauss.load("four_bar")
    bare.starts.clear()
    rest = gauss.equilibria(bare)[0]
    system = gauss.compile_scene(scene)
    q = np.zeros(system.n_q)
    q[[system.column(name) for name in rest.model.system.coordinates]] = rest.state.q
    model = gauss.linearise(system, system.state(q, np.zeros(system.n_v)), independent=["A", "m current"])
    alone = gauss.linearise(bare, rest.state, inputs=["A"], independent=["A"])
    assert model.states == ("A", "A rate", "m current") and model.is_equilibrium
    wanted = np.zeros((3, 3))
    wanted[:2, :2], wanted[1, 2] = alone.A, CONSTANT * alone.B[1, 0]
    wanted[2, 1:] = -CONSTANT / INDUCTANCE, -RESISTANCE / INDUCTANCE
    np.testing.assert_allclose(model.A, wanted, atol=1e-9 * np.abs(wanted).max())


def test_what_is_refused():
    scene = motor()
    with pytest.raises(SceneError, match="m current"):
        scene.state("m current", 1.0)
    with pytest.raises(SceneError, match="nowhere"):
        actuators.dc_motor(scene, "n", "nowhere", resistance=1.0, inductance=1.0, constant=1.0)
    with pytest.raises(SceneError, match="inductance"):
        actuators.dc_motor(scene, "n", "A", resistance=1.0, inductance=0.0, constant=1.0)


@pytest.mark.parametrize("name", ["scene.toml", "scene.xml", "scene.urdf"])
def test_files_refuse_states_by_name(name, tmp_path):
    with pytest.raises(FileError, match="m current"):
        gauss.save(motor(), tmp_path / name)


def test_exported_functions_have_the_states():
    scene = motor()
    (exported,) = export.exported_functions(scene, "forward_dynamics")
    function = Kernel(exported.function, batch=False)
    np.testing.assert_allclose(
        function([0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0])[:2], MOTOR @ [1.0, 2.0] + [0.0, VOLTAGE / INDUCTANCE]
    )


AREA, VOLUME, MODULUS, SUPPLY, FLOW, RAM = 2e-3, 1e-3, 1.4e9, 2e7, 1e-7, 50.0


def press(opening, **others):
    scene = gauss.Scene("press", gravity=(0, 0, 0))
    scene.prismatic("x", "ground", scene.body("ram", RAM))
    oil = {"area": AREA, "rod_area": AREA, "volume": VOLUME, "bulk_modulus": MODULUS, "supply": SUPPLY, "flow": FLOW}
    actuators.hydraulic_cylinder(scene, "jack", "x", opening, **oil | others)
    return scene


def test_oil_between_closed_valves_is_a_spring():
    """ω² = 2 β A² / (V m) of a ram between two columns of oil (Merritt 1967, eq. 6-35)."""
    found = np.abs(gauss.linearise(press(0.0)).eigenvalues.imag).max()
    assert found == pytest.approx(np.sqrt(2.0 * MODULUS * AREA**2 / (VOLUME * RAM)), rel=1e-10)


@pytest.mark.slow
def test_an_unloaded_cylinder_moves_as_the_flow_fills_it():
    """K u √(p / 2) = A v: each edge of the valve takes half of the supply pressure; a little of the oscillation is left."""
    found = gauss.simulate(press(0.5, leakage=2e-12), 1.0, rtol=1e-8, progress=False)
    assert found.rate("x")[-1] == pytest.approx(FLOW * 0.5 * np.sqrt(SUPPLY / 2.0) / AREA, rel=1e-3)
