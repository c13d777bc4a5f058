"""Motions against closed forms and reference files; orders of convergence; what happens when a motion cannot go on."""

from types import SimpleNamespace

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError
from gauss.simulation import INTEGRATORS
from tests.support import mechanisms

ORDERS = {"rk4": 4, "semi_implicit_euler": 1}
SLOPE = 0.1  # of the measured order against theory
REFERENCE_DIGITS = 2e-11  # a tolerance of 1e-12 per step accumulates to this over a few seconds of swinging


def _run(scene, duration, **options):
    return gauss.simulate(scene, duration, rtol=1e-12, atol=1e-13, **options)


def test_double_pendulum_reference():
    data = mechanisms.reference("double-pendulum")
    scene = mechanisms.rods(2)
    for joint, angle in zip(scene.joints, mechanisms.start_angles(data["initial_conditions"]["angles"]), strict=True):
        scene.start(joint, angle)
    trajectory = _run(scene, data["duration"], times=np.array(data["table"]["t"]))
    assert np.abs(mechanisms.rod_angles(trajectory) - data["table"]["angles"]).max() <= REFERENCE_DIGITS


def test_chain_of_ten_reference():
    """The first quarter second: later every digit is lost to the whip of the last link (it takes 10 times longer)."""
    data = mechanisms.reference("chain-10")
    scene = mechanisms.rods(10)
    for joint, angle in zip(scene.joints, mechanisms.start_angles(data["initial_conditions"]["angles"]), strict=True):
        scene.start(joint, angle)
    t = np.array(data["table"]["t"])
    kept = t <= 0.25
    trajectory = _run(scene, t[kept][-1], times=t[kept])
    assert np.abs(mechanisms.rod_angles(trajectory) - np.array(data["table"]["angles"])[kept]).max() <= REFERENCE_DIGITS


def test_pendulum_by_elliptic_functions():
    data = mechanisms.reference("pendulum")
    scene = gauss.Scene("pendulum", gravity=(0, 0, -9.81))
    scene.body("bob", mass=1.0, com=(0, 0, -1.0))  # a point mass on a massless bar, hanging
    scene.revolute("A", "ground", "bob", axis=(0, 1, 0))
    key = next(k for k in data["table"] if k != "t" and np.ndim(data["table"][k]) == 1)
    t, angles = np.array(data["table"]["t"]), np.array(data["table"][key])
    scene.start("A", angles[0])
    trajectory = _run(scene, t[-1], times=t)
    assert np.abs(trajectory.coordinate("A") - angles).max() <= REFERENCE_DIGITS


def test_free_body_by_jacobi_functions():
    """Six seconds about the intermediate axis, where errors grow like exp(2.9 t): 1e-13 becomes 1e-9 and more later."""
    data = mechanisms.reference("free-rigid-body")
    scene = gauss.Scene("body", gravity=(0, 0, 0))
    scene.body("body", 1.0, data["parameters"]["J"])
    scene.free("F", "ground", "body")
    scene.start("F", rate=(0, 0, 0, *data["initial_conditions"]["omega"]))
    t = np.array(data["table"]["t"])[:25]
    trajectory = _run(scene, t[-1], times=t)
    assert np.abs(trajectory.v[:, 3:] - np.array(data["table"]["omega"])[:25]).max() <= 1e-9
    assert np.abs(np.linalg.norm(trajectory.q[:, 3:], axis=1) - 1.0).max() <= 1e-15


@pytest.mark.parametrize("which", ["slow", "fast"])
def test_steady_top_keeps_its_inclination(which):
    data = mechanisms.reference("steady-top")
    p, precession = data["parameters"], data[f"precession_{which}"]
    transverse = p["A"] - p["m"] * p["l"] ** 2
    scene = gauss.Scene("top", gravity=(0, 0, -p["g"]))
    scene.body("top", p["m"], (transverse, transverse, p["C"]), com=(0, 0, p["l"]))
    scene.ball("tip", "ground", "top")
    half, theta = p["theta"] / 2, p["theta"]
    spin = p["w3"]  # the total angular velocity about the axis; precession adds its part across it
    scene.start("tip", (np.cos(half), 0.0, np.sin(half), 0.0), (-precession * np.sin(theta), 0.0, spin))
    trajectory = _run(scene, 2.0)
    axis = trajectory.body("top").com / p["l"]
    assert np.abs(np.arccos(axis[:, 2]) - theta).max() <= 1e-10
    turned = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    assert turned[-1] == pytest.approx(precession * 2.0, abs=1e-9)


def _skew(kind):
    scene = mechanisms.two_bodies(kind, 1)
    n = gauss.compile_scene(scene).n_v
    for k, joint in enumerate(scene.joints):
        count = scene.joints[joint].pair.n_v
        scene.start(joint, rate=tuple(0.5 + 0.1 * (k + i) for i in range(count)))
    assert n
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ORDERS)
@pytest.mark.parametrize("scene", ["revolute", "ball", "free", "loop"])
def test_order_of_fixed_steps(integrator, scene):
    """Error against a much finer reference falls with the order of the method, on the manifold and with loops, too."""
    scene = mechanisms.four_bar() if scene == "loop" else _skew(scene)
    fast = scene.name == "four-bar"  # its crank turns at 10 rad/s: only smaller steps show the order
    duration = 0.02 if fast else 0.08
    exact = _run(scene, duration)
    steps = np.array([0.01, 0.005, 0.0025] if integrator == "rk4" else [0.001, 0.0005, 0.00025]) / (8 if fast else 1)
    errors = [_distance(gauss.simulate(scene, duration, integrator=integrator, step=h), exact) for h in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(ORDERS[integrator], abs=SLOPE)


def _distance(one, two):
    return np.abs(np.concatenate([one.q[-1] - two.q[-1], one.v[-1] - two.v[-1]])).max()


@pytest.mark.slow
def test_order_of_dop853():
    """One step of length h from the same start: its local error falls like h⁹."""
    from gauss.dynamics.engines.certified import CertifiedEngine
    from gauss.integrators import METHODS, Point, Tolerance

    scene = _skew("ball")
    system = gauss.compile_scene(scene)
    start, solver = system.initial_state(), CertifiedEngine()
    equations = SimpleNamespace(system=system, evaluate=lambda state: solver.rates(system, state))
    point = Point(start, np.zeros(3), equations.evaluate(start))
    steps = np.array([0.2, 0.14, 0.1])
    errors = []
    for h in steps:
        exact = gauss.simulate(system, h, rtol=1e-13, atol=1e-15, step=h / 4)
        reached = METHODS["dop853"].attempt(equations, point, h, Tolerance(1.0, 1.0, 1.0)).point.state
        errors.append(np.abs(np.concatenate([reached.q - exact.q[-1], reached.v - exact.v[-1]])).max())
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(9, abs=0.6)


def test_dense_output_is_as_good_as_the_steps():
    scene = mechanisms.rods(2)
    scene.start("J1", 0.3)
    times = np.linspace(0, 1, 23)
    dense = _run(scene, 1.0, times=times)
    for k in (5, 11, 17):
        assert np.abs(dense.q[k] - _run(scene, times[k]).q[-1]).max() <= 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
def test_a_loop_keeps_closed_and_moves_the_same_wherever_it_is_cut(order):
    from gauss.dynamics.assemble import position_residual

    trajectory = _run(mechanisms.four_bar(order), 0.5)
    assert max(np.abs(position_residual(motion)).max() for motion in trajectory.motions) <= 1e-12
    assert np.abs(gauss.energy(trajectory).balance).max() <= 1e-10 * gauss.energy(trajectory).scale
    reference = _run(mechanisms.four_bar(), 0.5)
    for joint in "ABCD":
        assert trajectory.coordinate(joint)[-1] == pytest.approx(reference.coordinate(joint)[-1], abs=1e-10)


def test_a_start_is_kept_and_the_rest_of_the_loop_follows():
    system = gauss.compile_scene(mechanisms.four_bar())
    state = system.initial_state()
    assert state.v[0] == pytest.approx(10.0, abs=1e-12)
    assert state.q[0] == pytest.approx(0.0, abs=1e-12)


def test_a_rough_guess_is_assembled():
    from gauss.dynamics.assemble import position_residual
    from gauss.dynamics.kinematics import kinematics

    system = gauss.compile_scene(mechanisms.four_bar())
    state = system.initial_state([0.5, 0.1, -0.2, 0.1], [1.0, 0.0, 0.0, 0.0])
    assert np.abs(position_residual(kinematics(system, state))).max() <= 1e-12


@pytest.mark.slow
def test_constraints_that_cannot_be_met_are_named():
    scene = mechanisms.rods(2)
    scene.couple("half turn", "J2", "J1", ratio=1.0, offset=0.5)
    scene.couple("other", "J2", "J1", ratio=1.0, offset=0.2)
    with pytest.raises(StateError, match="'(half turn|other)' cannot be met.*off by 0.15"):
        gauss.compile_scene(scene).initial_state()


@pytest.mark.slow
def test_work_of_drives_and_dampers_closes_the_balance():
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=lambda t: 5.0 * np.sin(3 * t))
    scene.drive("J2", torque=lambda t, motion: -0.5 * motion.rate("J2"))
    scene.joint_spring("S", "J2", stiffness=3.0, damping=0.4, rest=0.2)
    scene.spring("rope", "rod2", "ground", at=(1, 0, 0), other_at=(1.0, 1.0, 0.5), stiffness=20.0, damping=0.7, length=0.4)
    scene.force("wind", "rod2", force=lambda t: (0.0, 2.0 * t, 1.0), at=(1, 0, 0))
    scene.force("torch", "rod1", moment=(0, 0, 0.3), force=(0.5, 0, 0), axes="body")
    energy = gauss.energy(_run(scene, 1.0))
    assert np.abs(energy.balance).max() <= 1e-10 * energy.scale
    for part in (energy.drives, energy.loads, energy.dissipated):
        assert np.abs(part[-1]) > 1e-2
    assert (np.diff(energy.dissipated) >= 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["recursion", "kkt", "nullspace", "daqp", "osqp"])
def test_backends_give_the_same_motion(backend):
    scene = mechanisms.rods(2)
    scene.start("J1", 0.3)
    one = gauss.simulate(scene, 0.2, integrator="rk4", step=0.01, backend=backend)
    two = gauss.simulate(scene, 0.2, integrator="rk4", step=0.01)
    assert np.abs(one.q - two.q).max() <= 1e-7


def test_samples_land_exactly():
    scene = mechanisms.rods(1)
    for integrator, options in (("dop853", {}), ("rk4", {"step": 0.03}), ("semi_implicit_euler", {"step": 0.03})):
        times = np.array([0.0, 0.1, 0.25, 0.3])
        trajectory = gauss.simulate(scene, 0.3, integrator=integrator, times=times, **options)
        assert np.array_equal(trajectory.t, times)


def test_what_there_is_survives_a_failure():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if t < 0.5 else float("nan"))
    with pytest.raises(SimulationError, match="drive of J1") as caught:
        gauss.simulate(scene, 1.0, integrator="rk4", step=0.1)
    assert len(caught.value.trajectory) == 6  # steps end where the law does
    assert caught.value.trajectory.t[-1] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"integrator": "rk5"}, "rk4"),
        ({"integrator": "rk4"}, "fixed step"),
        ({"integrator": "rk4", "step": 1e-12}, "1e.12 samples"),
        ({"duration": -1.0}, "duration"),
        ({"rtol": 0.0}, "rtol"),
        ({"times": [0.5, 0.2]}, "increasing"),
        ({"times": [0.0, 5.0]}, "increasing times between 0 and the duration"),
        ({"backend": "nothing"}, "no backend"),
    ],
)
def test_wrong_settings_are_refused(options, words):
    with pytest.raises(gauss.GaussError, match=words):
        gauss.simulate(mechanisms.rods(1), **({"duration": 1.0} | options))
    assert "dop853" in INTEGRATORS


@pytest.mark.parametrize("q, v", [([0.1], None), (["a", 1], None), ([0.1, np.nan], None), (None, [1, 2, 3])])
def test_wrong_states_are_refused(q, v):
    with pytest.raises(StateError, match="expected 2"):
        gauss.compile_scene(mechanisms.rods(2)).state(q, v)


def test_a_quaternion_must_be_unit():
    system = gauss.compile_scene(mechanisms.two_bodies("ball"))
    with pytest.raises(StateError, match="quaternion"):
        system.state([1, 1, 0, 0, 1, 0, 0, 0])


@pytest.mark.slow
def test_panda_swing_keeps_its_energy():
    """The main job: two seconds of free swing, DOP853 at 1e-10."""
    scene = gauss.load("robot:panda")
    scene.start("panda_joint2", 0.8)
    energy = gauss.energy(gauss.simulate(scene, 2.0, rtol=1e-10, atol=1e-12))
    assert np.abs(energy.balance).max() <= 1e-9 * energy.scale


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "free_body", "cart_pole"])
def test_many_samples_by_machine_code_are_the_few_by_numpy(name, monkeypatch):
    trajectory = gauss.simulate(gauss.load(name), 0.2, times=np.linspace(0, 0.2, 9))
    body = trajectory.system.structure.bodies[-1]
    few, energies = trajectory.body(body), gauss.energy(trajectory)
    monkeypatch.setattr("gauss.simulation.trajectory.LEAST_COMPILED_SAMPLES", 0)
    many, energies_many = trajectory.body(body), gauss.energy(trajectory)
    for part in ("position", "rotation", "com", "velocity", "angular_velocity"):
        assert np.abs(getattr(few, part) - getattr(many, part)).max() <= 1e-13 * (1 + np.abs(getattr(few, part)).max())
    for part in ("kinetic", "potential"):
        assert np.abs(getattr(energies, part) - getattr(energies_many, part)).max() <= 1e-13 * energies.scale
