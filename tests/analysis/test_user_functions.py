"""Functions of the user that raise, or give no numbers, and scenes without motion: each entry point says what is wrong."""

import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, GaussError, SimulationError
from tests.support.switching import slider


def pushed() -> gauss.Scene:
    scene = slider(lambda t: 1.0 + 0.0 * t)
    scene.input("push", "x", limits=1.0)
    return scene


def optimal(**options):
    pytest.importorskip("casadi")
    rest = {"x": 0.0, "x rate": 0.0}
    return gauss.optimal_motion(pushed(), 1.0, start=rest, end=rest, **options)


ENTRIES = {
    "loss": lambda law: gauss.motion_gradient(pushed(), 1.0, law, step=0.1),
    "cost": lambda law: gauss.ilqr(pushed(), 1.0, step=0.1, cost=law),
    "final": lambda law: gauss.ilqr(pushed(), 1.0, step=0.1, cost=lambda t, q, v, u: u @ u, final=law),
    "running cost": lambda law: optimal(cost=law),
    "meets": lambda law: optimal(meets=law),
    "crossings": lambda law: gauss.crossings(gauss.simulate(pushed(), 1.0, progress=False), law),
}
WRONG = {
    "raises": lambda *given: {}["boom"],
    "fails": lambda *given: given[0][99],
    "None": lambda *given: None,
    "text": lambda *given: "x",
    "complex": lambda *given: 1j,
    "not finite": lambda *given: np.nan,
    "ends": lambda *given: next(iter(())),
}


@pytest.mark.slow
@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("entry", ENTRIES)
def test_what_a_function_does_wrong_is_said(entry, wrong):
    with pytest.raises((ArgumentError, SimulationError)) as caught:
        ENTRIES[entry](WRONG[wrong])
    assert entry.split()[-1] in str(caught.value)


def test_a_cost_of_several_numbers_is_refused():
    with pytest.raises(ArgumentError, match="expected a number"):
        gauss.ilqr(pushed(), 1.0, step=0.1, cost=lambda t, q, v, u: np.array([u[0], u[0]]))


def welded() -> gauss.System:
    scene = gauss.Scene("rigid")
    scene.body("block", 1.0)
    scene.fixed("glue", "ground", "block")
    return gauss.compile_scene(scene)


MOTIONLESS = (
    gauss.linearise,
    gauss.modes,
    gauss.equilibrium,
    gauss.equilibria,
    gauss.advise,
    gauss.prepare_linear_model,
    gauss.base_parameters,
    gauss.resolve_overlaps,
    lambda system: gauss.Simulator(system, 0.1),
    lambda system: gauss.SimulatorBatch(system, 0.1, 2),
    lambda system: gauss.sensitivities(system, 1.0, step=0.1),
    lambda system: gauss.regressor(system, np.zeros((1, 0)), np.zeros((1, 0)), np.zeros((1, 0))),
)


@pytest.mark.slow
@pytest.mark.parametrize("analysis", MOTIONLESS)
def test_a_scene_in_which_nothing_moves_is_named(analysis):
    with pytest.raises(GaussError, match="rigid"):
        analysis(welded())
