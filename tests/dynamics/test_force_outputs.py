"""Outputs that are forces: of joints against reactions, of contacts against a weight at rest; refusals."""

import numpy as np
import pytest

import gauss
from gauss.errors import SceneError, SimulationError

pytestmark = pytest.mark.slow

STEP = 1e-3
AGREEMENT = 1e-8  # relative to the largest force, of machine code and certified solutions
AT_REST = 1e-6


MODELS = {
    "double_pendulum": lambda: gauss.load("double_pendulum"),
    "cart_pole": lambda: gauss.load("cart_pole"),
    "tree": lambda: gauss.load("random_tree", n=3, seed=2, kinds=("revolute",)),
}


@pytest.mark.parametrize("model", MODELS)
def test_forces_of_joints_are_the_reactions(model):
    scene = MODELS[model]()
    joint = list(scene.joints)[1]
    scene.output("F", "joint_force", joint)
    scene.output("M", "joint_moment", joint)
    scene.input("u", list(scene.joints)[0])
    sim = gauss.Simulator(scene, STEP)
    sim.reset(seed=1, spread=0.5)
    sim.step([0.7], n=50)
    at = sim.outputs
    control = gauss.rollout(sim.system, [sim.state.q], [sim.state.v], steps=1, step=STEP, control=[[[0.7]]])
    motion = gauss.simulate(sim.system, STEP, state=sim.state, control=lambda t, q, v: [0.7], rate=1.0, times=[0.0, STEP])
    found = gauss.reactions(motion, joint)
    size = np.abs(found.force).max()
    for name, expected in (("F", found.force), ("M", found.moment)):
        assert np.abs(at[name] - expected[0]).max() <= AGREEMENT * size
        assert np.abs(control.output(name)[0, 0] - expected[0]).max() <= AGREEMENT * size
    free = gauss.simulate(sim.system, 0.01, state=sim.state)
    assert np.abs(free.output("F") - gauss.reactions(free, joint).force).max() <= AGREEMENT * size


def test_forces_of_contacts_bear_the_weight():
    scene = gauss.load("box_on_plane_4")
    (contact,) = scene.contacts
    scene.output("N", "contact_force", contact)
    sim, many = gauss.Simulator(scene, STEP), gauss.SimulatorBatch(scene, STEP, batch=3)
    sim.step(n=400), many.step(n=400)
    weight = sum(body.mass for body in scene.bodies.values()) * np.linalg.norm(scene.gravity)
    assert sim.outputs["N"].shape == (4,)
    assert sim.outputs["N"].sum() == pytest.approx(many.outputs["N"][1].sum(), rel=AT_REST)
    assert sim.outputs["N"].min() >= 0.0 and sim.outputs["N"].sum() <= weight * (1.0 + AT_REST)


def test_unknown_forces_are_refused():
    scene = gauss.load("bricard")
    scene.output("F", "joint_force", list(scene.joints)[0])
    with pytest.raises(SimulationError, match="redundant"):
        gauss.Simulator(scene, STEP).output_vector()
    with pytest.raises(SceneError, match="no contact"):
        scene.output("N", "contact_force", "nothing")
    blocked = gauss.load("block_on_incline")
    blocked.output("F", "joint_force", list(blocked.joints)[0])
    with pytest.raises(SimulationError, match="gauss.reactions"):
        gauss.Simulator(blocked, STEP).output_vector()
