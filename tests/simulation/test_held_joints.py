"""Motions of trees with many dry frictions: phases share machine code, and are those of phases that do not."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.engines import held_joints
from gauss.dynamics.engines.cut_rows import CutRowEngine
from gauss.simulation.phases.phase import Phase

SAME_PHASE = 1e-9  # relative; errors of rtol 1e-11 grow in a chain that sticks and slips
SAME_EVENT = 1e-9  # s
BALANCE = 1e-8  # of the largest energy
STOP = 0.15  # rad


def chain(links: int, stop: bool = False, seed: int = 0) -> gauss.Scene:
    """Chain of links about axes of any direction, of which each joint but the last has dry friction."""
    rng, scene = np.random.default_rng(seed), gauss.Scene(f"chain of {links}")
    before = "ground"
    for k in range(links):
        here = np.array([0.0, 0.0, -0.4 * k])
        body = scene.body(f"link {k}", 1.0 + k, (0.05, 0.06, 0.07), position=here - [0.0, 0.0, 0.2])
        axis = rng.normal(size=3)
        scene.revolute(f"J{k}", before, body, axis=axis / np.linalg.norm(axis), at=here)
        if k < links - 1:
            scene.joint_friction(f"J{k}", name=f"friction {k}", limit=1.5)
        scene.start(f"J{k}", rate=float(rng.normal()))
        before = body
    if stop:
        scene.stop("J1", highest=STOP, restitution=0.0)
    return scene


def moved(scene: gauss.Scene) -> gauss.Trajectory:
    return gauss.simulate(scene, 0.8, times=np.linspace(0.0, 0.8, 9), rtol=1e-11, atol=1e-12, progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("stop", [False, True])
def test_phases_with_shared_code_are_those_with_their_own(stop, monkeypatch):
    shared = moved(chain(4, stop))
    monkeypatch.setattr(held_joints, "LEAST_FRICTIONS", 100)
    own = moved(chain(4, stop))
    assert [(event.kind, event.gaps) for event in shared.events] == [(event.kind, event.gaps) for event in own.events]
    assert len(own.events) > 4
    times = [[event.t for event in motion.events] for motion in (shared, own)]
    np.testing.assert_allclose(*times, rtol=0, atol=SAME_EVENT)
    for found, expected in ((shared.q, own.q), (shared.v, own.v), (shared.work, own.work)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=SAME_PHASE * np.abs(expected).max())
    energy = gauss.energy(shared)
    assert np.abs(energy.balance).max() <= BALANCE * np.abs(energy.kinetic).max()


@pytest.mark.slow
def test_all_phases_share_one_system_of_machine_code(monkeypatch):
    engines = []

    def kept(self, *given):
        made(self, *given)
        engines.append(self.solvers[0])

    made = Phase.__init__
    monkeypatch.setattr(Phase, "__init__", kept)
    moved(chain(4))
    assert len(engines) > 3
    assert all(isinstance(engine, CutRowEngine) for engine in engines)
    assert len({id(engine.cut) for engine in engines}) == 1


def own_law(scene: gauss.Scene):
    for name, element in list(scene.set_valued.items()):
        scene.set_valued[name] = type(element)(name, element.joint, lambda t: 1.5 + t)


OTHERS = {
    "two frictions": lambda: chain(3),
    "limits are laws of time": lambda: chain(4),
    "a constraint": lambda: chain(4),
}
CHANGES = {
    "limits are laws of time": own_law,
    "a constraint": lambda scene: scene.linear_coupling("tie", {"J0": 1.0, "J3": 2.0}),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_other_scenes_have_code_for_each_phase(kind):
    scene = OTHERS[kind]()
    assert kind not in CHANGES or held_joints.shared_frictions(gauss.compile_scene(scene))
    CHANGES.get(kind, lambda scene: None)(scene)
    assert not held_joints.shared_frictions(gauss.compile_scene(scene))
