"""Sensors: what they may be asked of, and derivatives of their values in linear models against differences."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.sensor_values import measured
from gauss.errors import SceneError, SimulationError
from gauss.scene.inputs import SENSORS

CHANGE = 1e-6  # of a coordinate or rate, in central differences
DIFFERENCED = 1e-7  # relative, of these
MISTAKES = {
    "an unknown frame": (("position", "upper", (0, 0, 0), "nothing"), "no body or frame 'nothing'"),
    "an acceleration from a frame": (("acceleration", "upper", (0, 0, 0), "lower"), "is not seen from a frame"),
    "no name": (("position", "upper", (0, 0, 0), None), "relative_to"),
    "a subtree of a frame": (("center_of_mass", "tip"), "no body 'tip'"),
    "an unknown kind": (("centre_of_mass", "upper"), "Did you mean 'center_of_mass'"),
}


def _scene():
    scene = gauss.load("double_pendulum")
    scene.frame("tip", "lower", (0.1, 0.2, 0.3), (0.3, 0.2, 0.1))
    return scene


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_refused(name):
    given, words = MISTAKES[name]
    with pytest.raises(SceneError, match=f"output 'x'.*{words}"):
        _scene().output("x", *given)


def test_subtrees_without_mass_are_refused():
    scene = gauss.Scene("empty")
    scene.body("b", 1.0, (1, 1, 1))
    scene.free("F", "ground", "b")
    scene.body("m", 0.0, (0, 0, 0), on="b")
    scene.fixed("W", "b", "m")
    scene.output("x", "center_of_mass", "m")
    system = gauss.compile_scene(scene)
    with pytest.raises(SimulationError, match="output 'x': body 'm', .*no mass"):
        measured(scene.outputs["x"], kinematics(system, system.initial_state()))


@pytest.mark.slow
def test_linear_models_have_the_slopes_of_sensors():
    scene = _scene()
    for kind, (of, _) in SENSORS.items():
        if of in ("frame", "body"):
            scene.output(kind, kind, "lower" if of == "body" else "tip")
    scene.output("seen", "velocity", "upper", at=(0.1, 0.0, 0.2), relative_to="tip")
    system = gauss.compile_scene(scene)
    rng = np.random.default_rng(1)
    q, v = rng.normal(size=system.n_q), rng.normal(size=system.n_v)

    def values(x):
        at = gauss.Simulator(system, 1e-3)
        at.reset(gauss.State(0.0, x[: system.n_q], x[system.n_q :]))
        return at.output_vector()

    x = np.concatenate([q, v])
    slopes = np.transpose([(values(x + d) - values(x - d)) / (2.0 * CHANGE) for d in CHANGE * np.eye(len(x))])
    found = gauss.linearise(system, state=gauss.State(0.0, q, v)).C
    assert abs(found - slopes).max() <= DIFFERENCED * abs(slopes).max()
