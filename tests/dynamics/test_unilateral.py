"""Accelerations where gaps are closed: machine code against the certified quadratic programme."""

import numpy as np
import pytest

import gauss
from gauss.dynamics import conditions
from gauss.dynamics.contact import unilateral
from gauss.dynamics.contact.unilateral import ActiveSetKernel
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import ACCELERATIONS
from gauss.dynamics.rules import Question

EXACT = 1e-9  # of the largest acceleration: what quadratic programmes are certified to


def _stopped_four_bar():
    scene = gauss.load("four_bar")
    joint = next(iter(scene.joints))
    scene.stop(joint, lowest=float(gauss.compile_scene(scene).initial_state().q[0]))
    return scene


SCENES = {
    "box on 4": lambda: gauss.load("box_on_plane_4"),
    "box on 8": lambda: gauss.load("box_on_plane_8"),
    "stops": lambda: gauss.load("double_pendulum_stops"),
    "four-bar": _stopped_four_bar,
    "rope": lambda: gauss.load("slack_rope"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_machine_code_presses_as_the_quadratic_programme_does(name):
    """Under random loads gaps stay closed, or open, in every combination; a state at rest touches where its start does."""
    system, rng, opened = gauss.compile_scene(SCENES[name]()), np.random.default_rng(0), set()
    start = system.initial_state()
    state = system.state(start.q, np.zeros(system.n_v))
    for _ in range(15):
        load = rng.standard_normal(system.n_v) * 10.0
        expected = CertifiedEngine().rates(system, state, load).acceleration
        found = system.accelerations(state, load)
        assert found == pytest.approx(expected, abs=EXACT * (1.0 + np.abs(expected).max()))
        opened.add(tuple(np.sign(np.round(found, 6))))
    assert len(opened) > 1


@pytest.mark.slow
def test_a_law_that_is_called_acts_beside_closed_gaps():
    scene, calls = gauss.load("box_on_plane_4"), []
    scene.loads.clear()
    system = gauss.compile_scene(scene)
    state, load = system.initial_state(), np.zeros(system.n_v)
    load[0] = 10.0
    pulled = gauss.load("box_on_plane_4")
    pulled.loads.clear()
    pulled.force("pull", "box", force=lambda t: [calls.append(t) or 10.0, 0.0, 0.0])
    other = gauss.compile_scene(pulled)
    assert other.accelerations(other.initial_state()) == pytest.approx(system.accelerations(state, load), abs=1e-9)
    assert calls


@pytest.mark.slow
@pytest.mark.parametrize(("push", "stays"), [(0.0, 4), (100.0, 0)])
@pytest.mark.parametrize("operations", [0, None])
def test_what_stays_closed_is_known_at_once_or_once_it_was_asked_often(push, stays, operations, monkeypatch):
    """A box of 2 kg rests on its points, or is lifted off by more than its weight."""
    monkeypatch.setattr(unilateral, "CONTACT_THRESHOLD", 1)
    if operations is not None:
        monkeypatch.setattr(conditions, "MOST_CONTACT_OPERATIONS", operations)
    scene = gauss.load("box_on_plane_4")
    scene.loads.clear()
    scene.force("lift", "box", force=(0.0, 0.0, push))
    system = gauss.compile_scene(scene)
    state, staying = system.initial_state(), ActiveSetKernel(system)
    gaps = np.arange(4)
    assert operations is None or staying(state, gaps) is None
    assert len(staying(state, gaps)) == stays


@pytest.mark.slow
def test_gaps_do_not_keep_forward_dynamics_from_being_compiled():
    system = gauss.compile_scene(gauss.load("box_on_plane_4"))
    state, load = system.initial_state(), np.array([3.0, 0, 50.0, 0, 0, 0])
    found = system.forward_dynamics(state.q, state.v, load)
    assert found == pytest.approx(system.accelerations(state, load), abs=1e-12)
    with pytest.raises(gauss.errors.SimulationError, match="'C' is unilateral"):
        _ = gauss.compile_scene(gauss.load("block_on_incline")).forward_dynamics


def test_gaps_with_friction_are_left_to_what_solves_them():
    system = gauss.compile_scene(gauss.load("block_on_incline"))
    plan = ACCELERATIONS.plan(Question(system, Laws(system, trace=False)))
    assert plan.dynamics == "certified" and any("friction" in why for why in plan.rejected[0].why)
