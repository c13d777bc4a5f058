"""Laws of time that jump, or act for a short while, in motions of fixed steps that are differentiated, fitted or optimised.

Each answer is that of the closed form, or of :func:`gauss.simulate`, or is refused or warned of.
"""

import math

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import SimulationError, SwitchingWarning
from tests.support.switching import ROOT_PI, bell, slider, verdict

STEP = 0.01
WIDTH = 1e-4  # s, of pulses: a hundredth of a step
NARROW = 1e4  # N: unit impulses
LAWS = {
    "pulse": (lambda t: gm.where(t > 0.5031, gm.where(t < 0.5031 + WIDTH, NARROW, 0.0), 0.0), 1.0, 1 - 0.5031 - WIDTH / 2),
    "pulse at an end": (lambda t: NARROW if 0.5 <= t < 0.5 + WIDTH else 0.0, 1.0, 0.5 - WIDTH / 2),
    "two pulses": (lambda t: sum(NARROW if s <= t < s + WIDTH else 0.0 for s in (0.2031, 0.2035)), 2.0, 2 * 0.79665),
    "jump": (lambda t: gm.where(t > 0.5031, 1.0, 0.0), 1 - 0.5031, (1 - 0.5031) ** 2 / 2),
    "jump at an end": (lambda t: 1.0 if t >= 0.5 else 0.0, 0.5, 0.125),
    "peak": (lambda t: NARROW * bell(WIDTH, 0.5037)(t), ROOT_PI, ROOT_PI * (1 - 0.5037)),
}  # fmt: skip
EXACT = {name for name in LAWS if name != "peak"}  # steps end at switching times, and not within smooth peaks


def moved(scene) -> tuple[float, float]:
    found = gauss.sensitivities(scene, 1.0, step=STEP)
    return found.v[-1, 0], found.q[-1, 0]


def by_gradient(scene) -> tuple[float, float]:
    return tuple(gauss.motion_gradient(scene, 1.0, loss, step=STEP).value for loss in (lambda q, v: v[0], lambda q, v: q[0]))


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("motion", [moved, by_gradient])
def test_motions_with_derivatives(law, motion):
    force, rate, place = LAWS[law]
    allowed = ("right",) if law in EXACT else ("right", "warned")
    assert verdict(lambda: motion(slider(force)), [rate, place]) in allowed


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_feedback_motions(law):
    force, rate, place = LAWS[law]
    scene = slider(force)
    scene.input("push", "x", limits=5.0)

    def motion():
        found = gauss.ilqr(scene, 1.0, step=STEP, cost=lambda t, q, v, u: u[0] ** 2)
        return found.v[-1, 0], found.q[-1, 0]

    assert verdict(motion, [rate, place]) in ("right", "warned")


@pytest.mark.slow
@pytest.mark.parametrize("phases", [1, 2])
@pytest.mark.parametrize("law", LAWS)
def test_optimal_motions_of_a_given_duration(law, phases):
    pytest.importorskip("casadi")
    force, rate, place = LAWS[law]
    scene = slider(force)
    scene.input("push", "x", limits=5.0)

    def motion():
        rest = {"x": 0.0, "x rate": 0.0}
        if phases == 1:
            found = gauss.optimal_motion(scene, 1.0, start=rest)
        else:
            found = gauss.optimal_hybrid_motion(scene, [gauss.MotionPhase(0.15), gauss.MotionPhase(0.85)], start=rest)
        return found.v[-1, 0], found.q[-1, 0]

    assert verdict(motion, [rate, place], relative=1e-6) == "right"  # the tolerance of the mesh


@pytest.mark.slow
def test_an_optimal_motion_of_free_duration_warns_of_a_narrow_peak():
    pytest.importorskip("casadi")
    scene = slider(LAWS["peak"][0])
    scene.input("push", "x", limits=1.0)
    rest = {"x": 0.0, "x rate": 0.0}
    with pytest.warns(SwitchingWarning, match="feature of a law of time"):
        gauss.optimal_motion(scene, (0.1, 10.0), start=rest, end=rest | {"x": 1.0}, cost="time")


@pytest.mark.slow
@pytest.mark.parametrize("law", sorted(EXACT))
def test_fitted_motions(law):
    scene = slider(LAWS[law][0])
    times = np.linspace(0.0, 1.0, 11)
    measured = gauss.simulate(scene, 1.0, times=times, progress=False)
    fitted = gauss.fit_motion(scene, times, {"x": measured.q[:, 0]}, {"b.mass": 1.1}, step=STEP)
    assert fitted.values["b.mass"] == pytest.approx(1.0, rel=1e-8)


def pendulum(law, stop: bool):
    scene = gauss.load("pendulum")
    scene.drive("A", torque=law, name="shock")
    if stop:
        scene.stop("A", highest=math.radians(20.0), restitution=0.5)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("stop", [False, True])
@pytest.mark.parametrize("law", ["pulse", "jump", "two pulses"])
def test_derivatives_by_the_start(law, stop):
    """Against differences of simulated motions, whose steps end where the law switches."""
    system = gauss.compile_scene(pendulum(LAWS[law][0], stop))
    start, delta = system.initial_state(), 1e-5
    found = gauss.sensitivities(system, 1.0, step=STEP, integrator="dop853").start[-1]

    def after(dq, dv):
        state = gauss.State(start.t, start.q + dq, start.v + dv)
        motion = gauss.simulate(system, 1.0, state=state, rtol=1e-13, progress=False)
        return np.concatenate([motion.q[-1], motion.v[-1]])

    changes = np.array([(after(*sign) - after(*(-sign))) / (2 * delta) for sign in delta * np.eye(2)[:, :, None]]).T
    assert found == pytest.approx(changes, rel=1e-6, abs=1e-6)  # of differences over 1e-5


@pytest.mark.parametrize("call", [gauss.sensitivities, lambda scene, *given, **more: gauss.ilqr(
    scene, *given, cost=lambda t, q, v, u: u[0] ** 2, **more)])  # fmt: skip
def test_a_jump_of_a_prescribed_speed_has_no_derivative(call):
    scene = gauss.Scene("led", gravity=(0, 0, 0))
    for name in "bc":
        scene.body(name, 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    scene.prismatic("y", "b", "c", axis=(1, 0, 0))
    scene.drive("x", speed=lambda t: gm.where(t < 0.5031, 0.5, 0.0))
    scene.input("push", "y", limits=1.0)
    with pytest.raises(SimulationError, match=r"jump at t = 0.5031 s"):
        call(scene, 1.0, step=STEP)
