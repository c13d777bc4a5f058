"""Arguments that are no numbers, tables or names are refused by errors of gauss, whatever they are."""

import numpy as np
import pytest

import gauss
from gauss import export, rotors, servo
from gauss.errors import GaussError
from gauss.scene.actuators import pi_controller

JUNK = {
    "text": "x",
    "object": object(),
    "complex": 1j,
    "bytes": b"x",
    "ragged": [[1], [1, 2]],
    "texts": ["x"],
    "nan": [float("nan")],
    "function": lambda *given: None,
    "masked": np.ma.masked_array([1.0], mask=[True]),
    "huge integer": 10**400,
    "intervals": np.array([1], "m8[s]"),
}
PENDULUM = gauss.load("pendulum")
SYSTEM = gauss.compile_scene(PENDULUM)
TIMES = np.linspace(0.0, 0.2, 5)
ROWS = TIMES[:, None]
ANGLES = {"A": [0.0, 0.1, 0.2, 0.3, 0.4]}


def _bar():
    bar = gauss.Linkage("bar")
    for name, (x, y) in {"crank": (0.2, 0.0), "coupler": (0.5, 0.0), "rocker": (0.35, 0.0)}.items():
        bar.link(name, mass=1.0, inertia=0.1, com=(x, y))
    bar.revolute("A", "ground", "crank")
    bar.revolute("B", "crank", "coupler", at=(0.4, 0))
    bar.revolute("C", "rocker", "coupler", at=(0.7, 0), child_at=(1.0, 0))
    bar.revolute("D", "ground", "rocker", at=(1.2, 0))
    bar.drive("A", speed=10.0)
    return bar


def _network():
    network = rotors.Network("one")
    network.shaft("A", 1.0)
    return network


def _held(**options):
    lean = servo.ServoRelation("lean", lambda t, motion: motion.coordinate("pin"))
    return servo.Servo(gauss.load("cart_pole"), [lean], [servo.Motor("motor", "rail")], **options)


def _driven(law):
    scene = gauss.load("pendulum")
    scene.drive("A", torque=law)
    return scene


CALLS = {
    "fit_motion: times": lambda junk: gauss.fit_motion(PENDULUM, junk, ANGLES, {"gravity.y": -9.0}, step=0.05),
    "fit_motion: measured": lambda junk: gauss.fit_motion(PENDULUM, TIMES, {"A": junk}, {"gravity.y": -9.0}, step=0.05),
    "fit_motion: parameters": lambda junk: gauss.fit_motion(PENDULUM, TIMES, ANGLES, {"gravity.y": junk}, step=0.05),
    "fit_motion: bounds": lambda junk: gauss.fit_motion(
        PENDULUM, TIMES, ANGLES, {"gravity.y": -9.0}, step=0.05, bounds={"gravity.y": junk}
    ),
    "fit_motion: noise": lambda junk: gauss.fit_motion(PENDULUM, TIMES, ANGLES, {"gravity.y": -9.0}, step=0.05, noise=junk),
    "regressor: q": lambda junk: gauss.regressor(SYSTEM, junk, [0.0], [0.0]),
    "regressor: independent": lambda junk: gauss.regressor(SYSTEM, [0.0], [0.0], [0.0], independent=junk),
    "regressor: friction": lambda junk: gauss.regressor(SYSTEM, [0.0], [0.0], [0.0], friction=junk),
    "excitation: limits": lambda junk: gauss.excitation(SYSTEM, 1.0, harmonics=1, trials=1, limits=junk),
    "excitation: seed": lambda junk: gauss.excitation(SYSTEM, 1.0, harmonics=1, trials=1, seed=junk),
    "root_locus: parameter": lambda junk: gauss.root_locus(PENDULUM, junk, [-9.0]),
    "root_locus: values": lambda junk: gauss.root_locus(PENDULUM, "gravity.y", junk),
    "sensitivities: duration": lambda junk: gauss.sensitivities(SYSTEM, junk, step=0.01),
    "sensitivities: integrator": lambda junk: gauss.sensitivities(SYSTEM, 0.1, step=0.01, integrator=junk),
    "sensitivities: parameters": lambda junk: gauss.sensitivities(SYSTEM, 0.1, step=0.01, parameters=junk),
    "plan_motion: begin": lambda junk: gauss.plan_motion(
        SYSTEM, [{"A": 0.0}, {"A": 1.0}], speeds=1.0, accelerations=1.0, begin=junk
    ),
    "to_c: system": lambda junk: export.to_c(junk),
    "to_c: names": lambda junk: export.to_c(SYSTEM, junk),
    "save_as: language": lambda junk: export.save_as(SYSTEM, junk),
    "cycle": lambda junk: _bar().cycle(junk),
    "reduced_inertia": lambda junk: _bar().reduced_inertia(junk),
    "flywheel": lambda junk: _bar().flywheel(junk),
    "load": lambda junk: _bar().load(junk),
    "rotors: duration": lambda junk: rotors.simulate(_network(), junk),
    "servo: system": lambda junk: servo.Servo(junk, (), ()),
    "from_coordinates: system": lambda junk: gauss.Trajectory.from_coordinates(junk, TIMES, ROWS),
    "from_coordinates: t": lambda junk: gauss.Trajectory.from_coordinates(SYSTEM, junk, ROWS),
    "from_coordinates: q": lambda junk: gauss.Trajectory.from_coordinates(SYSTEM, TIMES, junk),
    "from_coordinates: v": lambda junk: gauss.Trajectory.from_coordinates(SYSTEM, TIMES, ROWS, junk),
    "simulate: duration": lambda junk: gauss.simulate(SYSTEM, junk),
    "simulate: times": lambda junk: gauss.simulate(SYSTEM, 1.0, times=junk),
    "simulate: breaks": lambda junk: gauss.simulate(SYSTEM, 1.0, breaks=junk),
    "simulate: rtol": lambda junk: gauss.simulate(SYSTEM, 1.0, rtol=junk),
    "simulate: atol": lambda junk: gauss.simulate(SYSTEM, 1.0, atol=junk),
    "simulate: step": lambda junk: gauss.simulate(SYSTEM, 1.0, step=junk),
    "rollout: q0": lambda junk: gauss.rollout(SYSTEM, junk, [[0.0]], steps=2, step=0.1),
    "rollout: steps": lambda junk: gauss.rollout(SYSTEM, [[0.0]], [[0.0]], steps=junk, step=0.1),
    "rollout: times": lambda junk: gauss.rollout(SYSTEM, [[0.0]], [[0.0]], integrator="dop853", times=junk),
    "Simulator: step": lambda junk: gauss.Simulator(SYSTEM, junk),
    "state: q": lambda junk: SYSTEM.state(junk),
    "accelerations: load": lambda junk: SYSTEM.accelerations(SYSTEM.initial_state(), junk),
    "derivatives: load": lambda junk: gauss.derivatives(SYSTEM, SYSTEM.initial_state(), junk),
    "evaluate: names": lambda junk: SYSTEM.evaluate(junk, [0.0]),
    "body: mass": lambda junk: gauss.Scene("s").body("b", junk),
    "body: com": lambda junk: gauss.Scene("s").body("b", 1.0, com=junk),
    "drive: law": lambda junk: gauss.simulate(_driven(lambda t: junk), 0.1),
    "servo.simulate": lambda junk: servo.simulate(junk, 0.1),
    "servo.solve": lambda junk: servo.solve(junk, SYSTEM.initial_state()),
    "servo.realisable": lambda junk: servo.realisable(junk),
    "servo.equilibrium": lambda junk: servo.equilibrium(junk),
    "servo.explain": lambda junk: servo.explain(junk),
    "servo.initial_state": lambda junk: servo.initial_state(junk),
    "servo.lagrange": lambda junk: servo.lagrange(junk, SYSTEM.initial_state()),
    "servo.energy": lambda junk: servo.energy(junk),
    "servo: weights": lambda junk: _held(weights=junk),
    "crossings: trajectory": lambda junk: gauss.crossings(junk, lambda at: 1.0),
    "friction_problem: step": lambda junk: gauss.friction_problem(SYSTEM, step=junk),
    "rollout: integrator": lambda junk: gauss.rollout(SYSTEM, [[0.0]], [[0.0]], steps=2, step=0.1, integrator=junk),
    "SimulatorBatch: integrator": lambda junk: gauss.SimulatorBatch(SYSTEM, 0.1, 2, junk),
    "sweep: measure": lambda junk: gauss.sweep(PENDULUM, {"gravity.y": [-9.0]}, 0.1, measure=junk),
    "output": lambda junk: gauss.Trajectory.from_coordinates(SYSTEM, TIMES, ROWS).output(junk),
    "start: position": lambda junk: gauss.load("pendulum").start("A", junk),
    "drive: joint": lambda junk: gauss.load("pendulum").drive(junk, torque=1.0),
    "drive: breaks": lambda junk: gauss.load("pendulum").drive("A", torque=lambda t: 0.0, breaks=junk),
    "guide: along": lambda junk: gauss.load("pendulum").guide("g", "rod", (0.0, 0.0, 0.0), along=junk),
    "linear_coupling": lambda junk: gauss.load("pendulum").linear_coupling("c", junk),
    "contacts_all: exclude": lambda junk: gauss.load("pendulum").contacts_all(exclude=junk),
    "mesh: faces": lambda junk: gauss.Scene("s").mesh("m", "ground", np.eye(4, 3), faces=junk),
    "pi_controller": lambda junk: pi_controller(gauss.load("pendulum"), "c", "A", 0.5, proportional=junk, integral=1.0),
}


@pytest.mark.parametrize("kind", JUNK)
@pytest.mark.parametrize("name", CALLS)
def test_junk_is_refused(name, kind):
    """No TypeError of what is called within, and no answer."""
    if name in ("cycle", "reduced_inertia") and kind == "nan":
        pytest.skip("no angle: no pose there closes, and says so")
    if name == "excitation: seed" and kind == "huge integer":
        pytest.skip("a seed may have any size")
    with pytest.raises(GaussError):
        CALLS[name](JUNK[kind])


def test_a_mechanism_in_a_plane_is_what_the_table_says():
    """The base of the table is sound: without junk nothing is refused."""
    assert np.isfinite(_bar().cycle([0.0, 1.0]).torque).all()
