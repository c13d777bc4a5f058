"""Gear trains: all joints of a train keep to its first joint at every step, by every integrator that projects."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.gear_trains import followers, on_trains

ROUNDOFF = 8 * np.finfo(float).eps  # residual of a coupling relative to its terms: round-off of one state, none of a sum
STEPS, STEP = 5_000, 1e-3  # after which coordinates that are summed by themselves are some 1e-14 apart
PROJECTED = "rk4", "semi_implicit_euler", "verlet", "gauss4", "energy_momentum", "radau5", "generalised_alpha"
ADAPTIVE = "dop853", "dopri5", "taylor", "scipy_dop853"


def wheels(order=(0, 1, 2)) -> gauss.Scene:
    """Four eccentric wheels on one carrier, geared with offsets; couplings are stated in different orders."""
    scene = gauss.Scene("wheels")
    scene.body("arm", 1.0, (0.1, 0.2, 0.2), com=(0.2, 0, 0))
    scene.revolute("shoulder", "ground", "arm", axis=(0, 1, 0))
    for k, mass in enumerate((0.2, 0.5, 0.1, 0.3)):
        scene.body(f"wheel{k}", mass, (0.01, 0.01, 0.02), com=(0.02 * k, 0.01, 0))
        scene.revolute(f"axle{k}", "arm", f"wheel{k}", at=(0.1 * k, 0, 0))
    couplings = ("axle0", "axle1", -1 / 3, 0.1), ("axle2", "axle3", 2.7, -0.3), ("axle3", "axle1", 0.9, 0.7)
    for k in order:
        driven, driver, ratio, offset = couplings[k]
        scene.couple(f"mesh{k}", driven, driver, ratio, offset)
    scene.start("axle1", 0.4, 3.0)
    return scene


def residual(system, q, v) -> float:
    """Largest residual of the couplings in coordinates (k, n_q) and rates (k, n_v), relative to their terms."""
    found = [0.0]
    for c in system.scene.couplings.values():
        for values, part, offset in ((q, "q", c.offset), (v, "v", 0.0)):
            driven, driver = (values[:, getattr(system.joint(name), part).start] for name in (c.driven, c.driver))
            terms = np.abs(driven) + np.abs(c.ratio * driver) + abs(offset)
            found.append((np.abs(driven - c.ratio * driver - offset) / np.maximum(terms, 1.0)).max())
    return max(found)


SCENES = {
    "wheels": wheels,
    "wheels in reverse": lambda: wheels((2, 1, 0)),
    "rotors": lambda: gauss.load("rotor_branch", n=2),
}


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0), (0, 2, 1)])
def test_couplings_with_offsets_become_one_train(order):
    system = gauss.compile_scene(wheels(order))
    rng = np.random.default_rng(0)
    state = on_trains(system, system.state(rng.standard_normal(system.n_q), rng.standard_normal(system.n_v)))
    assert len(followers(system)) == 3
    assert residual(system, state.q[None], state.v[None]) <= ROUNDOFF


CASES = [("wheels", method) for method in (*PROJECTED, *ADAPTIVE)]
CASES += [(scene, method) for scene in ("wheels in reverse", "rotors") for method in ("dop853", "rk4", "verlet")]


@pytest.mark.slow
@pytest.mark.parametrize("scene, integrator", CASES)
def test_trains_do_not_drift(scene, integrator):
    system, end = gauss.compile_scene(SCENES[scene]()), STEPS * STEP
    options = {"step": STEP} if integrator in PROJECTED else {"rtol": 1e-10}
    motion = gauss.simulate(system, end, integrator=integrator, times=np.linspace(0.1, end, 8), **options)
    assert residual(system, motion.q, motion.v) <= ROUNDOFF


@pytest.mark.slow
def test_trains_do_not_drift_in_time_stepping_and_in_batches():
    system, end = gauss.compile_scene(wheels()), STEPS * STEP
    motion = gauss.simulate(system, end, integrator="time_stepping", step=STEP)
    assert residual(system, motion.q, motion.v) <= ROUNDOFF
    start = system.initial_state()
    fixed, adaptive = {"step": STEP, "steps": STEPS, "every": STEPS}, {"times": [end], "rtol": 1e-10}
    for integrator, options in (("rk4", fixed), ("dop853", adaptive)):
        batch = gauss.rollout(system, [start.q] * 3, [start.v] * 3, integrator=integrator, **options)
        assert residual(system, batch.q[:, -1], batch.v[:, -1]) <= ROUNDOFF


def test_without_projection_trains_are_left_alone():
    """What a user turns off stays off."""
    system = gauss.compile_scene(wheels())
    motion = gauss.simulate(system, 10 * STEPS * STEP, integrator="rk4", step=STEP, stabilisation="none")
    assert ROUNDOFF < residual(system, motion.q, motion.v) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "gauss4"])
def test_energy_does_not_suffer(integrator):
    """Projected and left alone, the energy error is the same: that of the method, or round-off."""
    system, end, errors = gauss.compile_scene(wheels()), STEPS * STEP, []
    options = {"step": STEP} if integrator in PROJECTED else {"rtol": 1e-12}
    for stabilisation in ("projection", "none"):
        motion = gauss.simulate(system, end, integrator=integrator, stabilisation=stabilisation, **options)
        energy = np.array(
            [system.kinetic_energy(q, v) + system.potential_energy(q) for q, v in zip(motion.q, motion.v, strict=True)]
        )
        errors.append(np.abs(energy - energy[0]).max() / np.abs(energy).max())
    assert errors[0] <= 1.5 * errors[1] + 10 * ROUNDOFF
