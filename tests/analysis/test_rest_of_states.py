"""Equilibria, linear models and derivatives of motions of scenes with states of one's own, against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

import gauss
from gauss.errors import SimulationError
from gauss.scene import actuators

REST = 1e-7  # of coordinates and states at rest, relative: accelerations vanish to 1e-9
FITTED = 1e-6  # of parameters found from exact samples of fixed steps, relative
G, LENGTH = 9.81, 0.5  # of the pendulum of 1 kg to its centre of mass
OIL = {"area": 1e-3, "rod_area": 5e-4, "volume": 5e-4, "bulk_modulus": 1.4e9, "supply": 2e7, "flow": 1e-7, "leakage": 1e-12}


def pendulum():
    scene = gauss.load("pendulum")
    scene.starts.clear()
    return scene


def motor(scene, voltage=3.0):
    actuators.dc_motor(scene, "motor", "A", voltage, resistance=0.5, inductance=5e-3, constant=0.4, ratio=2.0)
    return scene


def motor_pendulum():
    return motor(pendulum()), {"A": -np.arccos(0.8 * 6.0 / (G * LENGTH)), "motor current": 6.0}


def controlled():
    scene = pendulum()
    actuators.pi_controller(scene, "hold", "A", 0.5, proportional=80.0, integral=40.0, derivative=8.0)
    return scene, {"A": 0.5, "hold integral": G * LENGTH * np.cos(0.5) / 40.0}


def muscled():
    scene = pendulum()
    actuators.muscle(scene, "flexor", "A", 0.5, force=300.0, arm=0.03, optimal_length=0.1)
    effort = lambda q: 4.5 * np.exp(-((0.3 * q / actuators.WIDTH) ** 2)) - G * LENGTH * np.cos(q)  # noqa: E731
    return scene, {"A": brentq(effort, -1.5, 0.0), "flexor activation": 0.5}


def cylinder(valve=0.3):
    """A ram on a spring; the flow through the valve is what leaks past the piston."""
    scene = gauss.Scene("press", gravity=(0.0, 0.0, 0.0))
    scene.prismatic("slide", "ground", scene.body("ram", 50.0, (1.0, 1.0, 1.0)), axis=(1.0, 0.0, 0.0))
    scene.joint_spring("spring", "slide", stiffness=1e5)
    actuators.hydraulic_cylinder(scene, "lift", "slide", valve, **OIL)
    return scene


def pressed():
    through = lambda drop: OIL["flow"] * 0.3 * np.sqrt(drop)  # noqa: E731
    # the same flow enters and leaves: both drops of pressure are p
    drop = brentq(lambda p: through(p) - OIL["leakage"] * (2e7 - 2.0 * p), 1.0, 1e7)
    force = OIL["area"] * (2e7 - drop) - OIL["rod_area"] * drop
    return cylinder(), {"slide": force / 1e5, "lift pressure": 2e7 - drop, "lift rod pressure": drop}


RESTS = {"motor": motor_pendulum, "controller": controlled, "muscle": muscled, "cylinder": pressed}


@pytest.mark.slow
@pytest.mark.parametrize("name", RESTS)
def test_states_rest_at_their_closed_form(name):
    scene, wanted = RESTS[name]()
    system = gauss.compile_scene(scene)
    rests = gauss.equilibria(system, starts=6)
    near = [one for one in rests if one.stability == "stable"]
    assert len(near) == 1 and all(one.model.is_equilibrium for one in rests)
    found = {one: near[0].state.v[system.column(one)] for one in scene.states}
    found |= {one: near[0].state.q[system.column(one)] for one in wanted if one not in found}
    assert found == pytest.approx(wanted, rel=REST)


@pytest.mark.slow
def test_a_linkage_rests_where_the_motor_holds_it():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    rests = gauss.equilibria(motor(scene, 2.0), starts=8)
    assert {one.stability for one in rests} == {"stable", "unstable"}
    for one in rests:
        assert one.state.v == pytest.approx([0.0] * 4 + [4.0], abs=REST)
        alone = gauss.compile_scene(gauss.load("four_bar"))
        held = gauss.equilibrium(alone, alone.state(one.state.q[:4], np.zeros(4)), keep=["A"])
        assert held.forces["A"] == pytest.approx(0.8 * 4.0, rel=REST)


@pytest.mark.slow
def test_models_at_rest_keep_the_start_of_states():
    """About the pressures of the start, not about none, at which an open valve has another slope."""
    model = gauss.linearise(cylinder())
    pressure = np.array(
        [model.state.v[k] for k, one in enumerate(model.system.coordinates) if one in model.system.scene.states]
    )
    assert (pressure == 1e7).all()
    into = -0.5 * OIL["flow"] * 0.3 / np.sqrt(1e7) - OIL["leakage"]
    assert model.A[2, 2] == pytest.approx(OIL["bulk_modulus"] * into / OIL["volume"], rel=REST)


def test_what_does_not_rest_is_named():
    scene = gauss.load("pendulum")
    scene.state("growing", rate=lambda t, at: 1.0 + at.rate("growing") ** 2)
    with pytest.raises(SimulationError, match="'growing' still changes"):
        gauss.equilibrium(scene)


@pytest.mark.slow
def test_derivatives_and_fits_name_states_as_linear_models_do():
    scene, t = motor(pendulum()), np.linspace(0.0, 0.5, 26)
    assert gauss.sensitivities(scene, 0.1, step=0.01).states == ("A", "integral of motor current", "A rate", "motor current")
    motion = gauss.simulate(scene, 0.5, times=t, rtol=1e-10, atol=1e-10)
    measured = {"A": motion.coordinate("A"), "motor current": motion.rate("motor current")}
    found = gauss.fit_motion(scene, t, measured, {"rod.mass": 0.8}, step=2e-3)
    assert found.values["rod.mass"] == pytest.approx(1.0, rel=FITTED)
