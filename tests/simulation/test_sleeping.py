"""Sleeping of free bodies: islands at rest stand still until they are pushed, and motions are those without sleeping."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import EDGE, RADIUS, floor, free_body
from gauss import Sleeping
from gauss.errors import SimulationError

STEP = 1e-3  # [s]
SOON = Sleeping(duration=0.05)
BALANCE = 1e-12  # [J] of 1 J, [m/s] of 1 m/s: sum of energies over many steps
FORCE = 1e-6  # [N] of 10 N: forces of steps that meet the laws to 1e-10 of a speed, over a step
AS_AWAKE = 1e-6  # [m], [m/s]: rates of bodies at rest in steps that meet the laws to 1e-10, through impacts


def pile(n: int, ball: float | None = None):
    """Boxes on each other, and one beside them; a ball flies towards the stack with a speed [m/s]."""
    scene = floor("pile")
    for k in range(n):
        free_body(scene, f"box {k}", EDGE**2 / 6.0, (0.0, 0.0, EDGE * (k + 0.5)))
        scene.box(f"cube {k}", f"box {k}", (EDGE,) * 3)
    free_body(scene, "lonely", EDGE**2 / 6.0, (0.0, 3.0 * EDGE, 0.5 * EDGE))
    scene.box("lonely cube", "lonely", (EDGE,) * 3)
    if ball is not None:
        free_body(scene, "ball", 0.4 * RADIUS**2, (-0.5, 0.0, 1.5 * EDGE), rate=(ball, 0.0, 0.5, 0.0, 0.0, 0.0))
        scene.sphere("shell", "ball", RADIUS)
    scene.contacts_all(friction=0.5)
    return scene


@pytest.fixture(scope="module")
def hit():
    """Stack of two boxes that a ball hits."""
    return gauss.compile_scene(pile(2, ball=3.0))


def moved(scene, duration: float, sleeping=SOON, **options):
    """Motion by time stepping."""
    options = {"integrator": "time_stepping", "step": STEP, "progress": False} | options
    return gauss.simulate(scene, duration, sleeping=sleeping, **options)


def of_sleep(trajectory) -> list[tuple[str, tuple[str, ...]]]:
    """Events of sleep: kinds and bodies."""
    return [(event.kind, event.gaps) for event in trajectory.events if event.kind in ("sleeps", "wakes")]


def others(trajectory) -> list[tuple]:
    """Other events, those of one step by their names."""
    return sorted((e.t, e.kind, e.gaps) for e in trajectory.events if e.kind not in ("sleeps", "wakes"))


@pytest.mark.slow
def test_a_ball_wakes_the_stack_that_it_hits_and_all_move_as_without_sleep(hit):
    asleep, awake = moved(hit, 0.4), moved(hit, 0.4, sleeping=False)
    assert of_sleep(asleep)[0] == ("sleeps", ("box 0", "box 1", "lonely"))
    assert of_sleep(asleep)[1] == ("wakes", ("box 0", "box 1"))
    np.testing.assert_allclose(asleep.q, awake.q, atol=AS_AWAKE)
    np.testing.assert_allclose(asleep.v, awake.v, atol=AS_AWAKE)
    assert others(asleep) == others(awake)
    lonely = asleep.v[asleep.t > 0.2].reshape(-1, 4, 6)[:, 2]
    assert not lonely.any()


@pytest.mark.slow
def test_forces_of_bodies_asleep_are_those_of_bodies_at_rest(hit):
    asleep, awake = (moved(hit, 0.1, sleeping=sleeping, times=[0.1]) for sleeping in (SOON, False))
    assert not asleep.v[-1].reshape(-1, 6)[:3].any()
    name = next(name for name in hit.scene.contacts if "cube 0" in name and "floor" in name)
    one, other = (gauss.contact_forces(found, name)[-1].sum() for found in (asleep, awake))
    np.testing.assert_allclose(one, 2.0 * 9.81, atol=FORCE)
    np.testing.assert_allclose(one, other, atol=FORCE)


@pytest.mark.slow
def test_the_energy_of_bodies_put_to_rest_is_dissipated():
    scene = floor("slow disc")
    free_body(scene, "box", EDGE**2 / 6.0, (0.0, 0.0, 0.5 * EDGE), rate=(1e-3, 0.0, 0.0, 0.0, 0.0, 0.0))
    scene.box("cube", "box", (EDGE,) * 3)
    scene.contacts_all()  # without friction it never stops
    found = moved(scene, 0.2, sleeping=Sleeping(speed=2e-3, duration=0.05))
    (event,) = [event for event in found.events if event.kind == "sleeps"]
    kinetic = 0.5 * 1e-6
    np.testing.assert_allclose(event.loss, kinetic, atol=BALANCE)
    np.testing.assert_allclose(found.work[-1, 2], kinetic, atol=BALANCE)
    assert not found.v[-1].any()
    faster = moved(scene, 0.2, sleeping=Sleeping(speed=0.5e-3, duration=0.05))
    assert not of_sleep(faster)
    np.testing.assert_allclose(faster.v[-1, 0], 1e-3, atol=BALANCE)


@pytest.mark.slow
def test_sleep_does_not_depend_on_the_samples(hit):
    whole = moved(hit, 0.3)
    again, sampled = moved(hit, 0.3), moved(hit, 0.3, times=np.array([0.0505, 0.1, 0.1903, 0.3]))
    np.testing.assert_array_equal(whole.q, again.q)
    np.testing.assert_array_equal(whole.q[-1], sampled.q[-1])
    assert of_sleep(whole) == of_sleep(again) == of_sleep(sampled)


@pytest.mark.slow
def test_bodies_that_all_sleep_stay_where_they_are():
    found = moved(pile(2), 0.5)
    last = found.q[found.t > 0.1]
    np.testing.assert_array_equal(last, np.broadcast_to(last[0], last.shape))
    assert found.stats.steps == 500


@pytest.mark.parametrize(
    ("name", "options"),
    [("box_on_plane_8", {"integrator": "dop853", "step": None}), ("pendulum", {}), ("box_on_plane_8", {"step": None})],
)
def test_sleep_is_refused_where_it_does_not_apply(name, options):
    options |= {"rtol": 1e-4} if "step" in options else {}
    with pytest.raises(SimulationError, match="sleeping"):
        moved(gauss.load(name), 0.1, **options)


@pytest.mark.parametrize(
    "wrong",
    [{"speed": 0.0}, {"speed": np.nan}, {"speed": [1e-3]}, {"duration": -1.0}, {"duration": np.inf}, {"duration": None}],
)
def test_sleeping_takes_positive_numbers(wrong):
    with pytest.raises(SimulationError, match=next(iter(wrong))):
        Sleeping(**wrong)
