"""Sleeping of mechanisms: trees of joints at rest stand still until something acts on them, and move as without sleeping."""

import re

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import RADIUS, floor, free_body
from gauss import Plan, Sleeping
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.coordinate_groups import coordinate_groups
from gauss.errors import SimulationError
from gauss.simulation.motion_records import SleepRecord

STEP = 1e-3  # [s]
SOON = Sleeping(duration=0.05)
KERNELS = Plan("time stepping", "pair kernels")
AS_AWAKE = 1e-6  # [m], [m/s], [rad], [rad/s]: rates at rest in steps that meet the laws to 1e-10, through impacts
BALANCE = 1e-12  # [J] of 1 J, [m/s] of 1 m/s
SHUT = 1e-3  # [N m] with which a lid is held shut, of 0.2 N m by its weight
LINE = 300  # [characters]
ENDS = 0.3  # [s]: until here no impact follows on another in which a change of 1e-12 grows


def chest(scene, name: str, x: float):
    """Box with a lid on a damped hinge, which lies on a stop."""
    free_body(scene, name, 0.01, (x, 0.0, 0.1))
    scene.box(f"{name} case", name, (0.2, 0.2, 0.2))
    scene.body(f"{name} lid", mass=0.2, inertia=(1e-3,) * 3, position=(0.0, 0.0, 0.12))
    scene.revolute(f"{name} hinge", name, f"{name} lid", axis=(0, 1, 0), at=(-0.1, 0.0, 0.11))
    scene.box(f"{name} board", f"{name} lid", (0.2, 0.2, 0.02))
    scene.joint_spring(f"{name} damper", f"{name} hinge", damping=0.02)
    scene.stop(f"{name} hinge", lowest=-1.0, highest=0.0)


def chests(ball: float | None = None):
    """Two chests; a ball flies towards the first with a speed [m/s]."""
    scene = floor("chests")
    chest(scene, "a", 0.0)
    chest(scene, "b", 0.5)
    if ball is not None:
        free_body(scene, "ball", 0.4 * RADIUS**2, (-0.6, 0.02, 0.08), rate=(ball, 0.0, 0.3, 0.0, 0.0, 0.0))
        scene.sphere("shell", "ball", RADIUS)
    return scene


def numbers_in(text: str) -> set[int]:
    """Whole numbers that a report states."""
    return set(map(int, re.findall(r"\d+", text)))


def with_contacts(scene):
    """Scene whose shapes all touch with friction."""
    scene.contacts_all(friction=0.5)
    return scene


def chain():
    """Links that lie on the floor, with dry friction in a hinge, and a ball that rolls into them."""
    scene = floor("chain")
    for k in range(4):
        scene.body(f"link {k}", mass=0.1, inertia=(1e-4,) * 3, position=(0.2 * k, 0.0, 0.03))
        scene.capsule(f"rod {k}", f"link {k}", 0.03, 0.14, axis=(1, 0, 0))
        if k:
            at = (0.2 * k - 0.1, 0.0, 0.03)
            scene.revolute(f"hinge {k}", f"link {k - 1}", f"link {k}", axis=(0, 0, 1) if k % 2 else (0, 1, 0), at=at)
    scene.free("floats", "ground", "link 0", at=(0.0, 0.0, 0.03))
    scene.joint_friction("hinge 2", 0.01)
    free_body(scene, "ball", 0.4 * RADIUS**2, (0.3, -0.5, 0.06), rate=(0.0, 2.0, 0.3, 0.0, 0.0, 0.0))
    scene.sphere("shell", "ball", RADIUS)
    return with_contacts(scene)


def moved(scene, duration: float = ENDS, sleeping=SOON, **options):
    """Motion by kernels of pairs of shapes."""
    options = {"integrator": "time_stepping", "step": STEP, "progress": False, "plan": KERNELS} | options
    return gauss.simulate(scene, duration, sleeping=sleeping, **options)


def of_sleep(trajectory) -> list[tuple[str, tuple[str, ...]]]:
    """Events of sleep: kinds and bodies."""
    return [(event.kind, event.gaps) for event in trajectory.events if event.kind in ("sleeps", "wakes")]


def same(scene, duration: float = ENDS, **options):
    """Motion with sleeping; it is that without."""
    system = gauss.compile_scene(scene)
    asleep, awake = (moved(system, duration, sleeping, **options) for sleeping in (SOON, False))
    for name in ("q", "v", "work"):
        np.testing.assert_allclose(getattr(asleep, name), getattr(awake, name), atol=AS_AWAKE)
    return asleep


@pytest.mark.slow
def test_a_ball_wakes_the_tree_that_it_hits_and_all_move_as_without_sleep():
    found = same(with_contacts(chests(ball=3.0)))
    a, b = ("a", "a lid"), ("b", "b lid")
    assert of_sleep(found) == [("sleeps", (*a, *b)), ("wakes", a)]
    slept = found.t >= found.events[0].t
    (of_b,) = (joint for joint in found.system.joints if joint.name == "b floats")
    assert not found.v[slept][:, of_b.v].any()
    assert (np.diff(found.q[slept][:, of_b.q], axis=0) == 0.0).all()


@pytest.mark.slow
def test_a_chain_with_dry_friction_sleeps_as_one():
    found, links = same(chain()), tuple(f"link {k}" for k in range(4))
    assert of_sleep(found) == [("sleeps", links), ("wakes", links)]


def _driven_by_law(scene):
    scene.drive("a hinge", torque=lambda t: SHUT * (2.0 + gauss.math.sin(t)))


def _prescribed(scene):
    scene.drive("a hinge", angle=lambda t: -0.1 * gauss.math.sin(t))


def _speed_by_law(scene):
    scene.drive("a hinge", speed=lambda t: 0.1 * gauss.math.sin(t), limit=0.5)


def _constant_torque(scene):
    scene.drive("a hinge", torque=SHUT)


def _spring(scene):
    scene.spring("line", "a", "b", stiffness=20.0, length=0.5)


def _brake(scene):
    scene.drive("a hinge", speed=0.0, limit=0.5)


def _wheel(scene):
    scene.body("wheel", mass=0.2, inertia=(0.001,) * 3)
    scene.revolute("shaft", "a", "wheel", axis=(0, 1, 0))
    scene.couple("belt", "shaft", "a hinge", 2.0)


def _parallelogram(scene):
    scene.body("strut", mass=0.1, inertia=(1e-4,) * 3, position=(0.17, 0.0, 0.15))
    scene.body("coupler", mass=0.1, inertia=(1e-4,) * 3, position=(0.07, 0.0, 0.2))
    scene.revolute("foot", "a", "strut", axis=(0, 1, 0), at=(0.15, 0.0, 0.11))
    scene.revolute("knee", "a lid", "coupler", axis=(0, 1, 0), at=(-0.05, 0.0, 0.2))
    scene.revolute("end", "strut", "coupler", axis=(0, 1, 0), at=(0.2, 0.0, 0.2))


@pytest.mark.slow
@pytest.mark.parametrize("act", [_driven_by_law, _prescribed, _speed_by_law])
def test_what_a_law_of_time_or_a_prescribed_motion_acts_on_never_sleeps(act):
    scene = chests()
    act(scene)
    assert of_sleep(same(with_contacts(scene))) == [("sleeps", ("b", "b lid"))]


@pytest.mark.slow
@pytest.mark.parametrize("act", [_constant_torque, _spring, _brake, _wheel, _parallelogram])
def test_loads_without_time_couplings_and_loops_sleep(act):
    scene = chests()
    act(scene)
    ((kind, bodies),) = of_sleep(same(with_contacts(scene)))
    assert kind == "sleeps" and set(bodies) == set(scene.bodies)


@pytest.mark.slow
def test_a_changed_input_wakes_what_it_acts_on():
    scene, change = chests(), 0.15
    for name in "ab":
        scene.input(f"motor {name}", f"{name} hinge")
    with_contacts(scene)
    law = lambda t, q, v: np.array([-SHUT if t < change - 0.5 * STEP else -0.3, 0.0])  # noqa: E731
    found = same(scene, control=law, rate=100.0)
    slept, woken = of_sleep(found)
    assert slept == ("sleeps", tuple(scene.bodies)) and woken == ("wakes", ("a", "a lid"))
    (event,) = [event for event in found.events if event.kind == "wakes"]
    np.testing.assert_allclose(event.t, change, atol=STEP)


@pytest.mark.slow
def test_the_energy_of_trees_put_to_rest_is_dissipated():
    scene, rate = floor("sledge"), 1e-3
    chest(scene, "a", 0.0)
    scene.start("a floats", position=(0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0), rate=(rate, 0.0, 0.0, 0.0, 0.0, 0.0))
    scene.contacts_all()  # without friction it never stops
    found = moved(scene, 0.2, sleeping=Sleeping(speed=2.0 * rate, duration=0.05))
    (event,) = [event for event in found.events if event.kind == "sleeps"]
    np.testing.assert_allclose(event.loss, 0.5 * 1.2 * rate**2, atol=BALANCE)
    np.testing.assert_allclose(found.work[-1, 2], event.loss, atol=BALANCE)
    assert not found.v[-1].any()


@pytest.mark.slow
def test_a_chest_does_not_sleep_while_a_pendulum_without_shapes_swings_in_it():
    scene = chests()
    scene.body("bob", mass=1e-3, inertia=(1e-8,) * 3, position=(0.0, 0.0, -0.05))
    scene.revolute("pivot", "a", "bob", axis=(0, 1, 0))
    scene.start("pivot", rate=5.0)
    assert of_sleep(moved(with_contacts(scene))) == [("sleeps", ("b", "b lid"))]


@pytest.mark.slow
def test_sleep_of_trees_does_not_depend_on_the_samples():
    system = gauss.compile_scene(with_contacts(chests(ball=3.0)))
    whole, sampled = moved(system), moved(system, times=np.array([0.0505, 0.1, 0.1903, ENDS]))
    np.testing.assert_array_equal(whole.q[-1], sampled.q[-1])
    assert of_sleep(whole) == of_sleep(sampled)


@pytest.mark.slow
def test_groups_of_coordinates_are_those_that_loads_and_joints_connect():
    for act, count in ((None, 2), (_spring, 1), (_wheel, 2), (_driven_by_law, 2)):
        scene = chests()
        if act is not None:
            act(scene)
        system = gauss.compile_scene(with_contacts(scene))
        stepper = new_contact_stepper(system)
        groups = coordinate_groups(system, stepper.smooth, stepper.carriers, False)
        assert groups.timed.size == count == len(set(groups.of_rate.tolist()))
        assert groups.timed.sum() == (act is _driven_by_law)


def test_trees_under_opaque_laws_are_refused():
    scene = chests()
    scene.drive("a hinge", torque=lambda t: float(t))
    with pytest.raises(SimulationError, match="drive of a hinge"):
        moved(with_contacts(scene), 0.01, plan=None)


@pytest.mark.slow
@pytest.mark.parametrize("times", [None, [ENDS]])
def test_the_record_of_a_motion_says_which_bodies_may_sleep_and_slept_and_when(times):
    scene = chests(ball=3.0)
    _driven_by_law(scene)
    found = moved(with_contacts(scene), times=times)
    record, a, b = found.stats.sleep, ("a", "a lid"), ("b", "b lid")
    assert record.never == a and record.able == (*b, "ball")
    assert set(record.steps) == set(b) == set(record.asleep) and record.woken == 0
    (event,) = [event for event in found.events if event.kind == "sleeps"]
    np.testing.assert_allclose(np.multiply([*record.steps.values()], STEP), event.t, rtol=BALANCE)
    assert found.stats.plan.sleepers == 3 and Plan.from_json(found.stats.plan.to_json()).sleepers == 3
    awake = moved(scene, 2 * STEP, sleeping=False).stats
    assert awake.sleep is None and awake.plan.sleepers is None


def test_a_record_of_many_bodies_is_shown_in_one_line_with_their_number():
    names = tuple(f"ball {k}" for k in range(1000))
    record = SleepRecord(names[:900], names[900:], dict.fromkeys(names[:800], 100), names[:700], 3)
    stats = gauss.simulate(gauss.load("double_pendulum"), 0.01).stats._replace(sleep=record)
    for shown in (str(record), repr(record), str(stats)):
        assert len(shown) < LINE and "\n" not in shown and {"900", "800", "700"} <= set(re.findall(r"\d+", shown))


MJCF_ARM = """<mujoco><worldbody><geom type="plane" size="5 5 1"/><body name="base" pos="0 0 0.1"><freejoint/>
<geom type="sphere" size="0.1" mass="1"/><body name="arm" pos="0.3 0 -0.05"><joint axis="0 1 0" damping="5"/>
<joint axis="1 0 0" damping="5"/><geom type="sphere" size="0.05" mass="0.3"/></body></body></worldbody></mujoco>"""


def test_bodies_without_inertia_between_joints_are_not_counted(tmp_path):
    (tmp_path / "arm.xml").write_text(MJCF_ARM)
    system = gauss.compile_scene(gauss.load(tmp_path / "arm.xml", contacts=True))
    assert system.structure.n_bodies == 3  # one of them between the two hinges
    assert system.dynamics.sleepers(system) == (("base", "arm"), ())


@pytest.mark.slow
def test_files_of_results_hold_the_record(tmp_path):
    pytest.importorskip("xarray")
    found = moved(with_contacts(chests()), 0.1)
    gauss.save(found, tmp_path / "slept.nc")
    again = gauss.load_motion(tmp_path / "slept.nc").stats
    assert again.sleep == found.stats.sleep and again.plan.sleepers == 4


def test_the_report_of_a_system_counts_the_bodies_that_may_sleep():
    scene = chests()
    _driven_by_law(scene)
    system = gauss.compile_scene(with_contacts(scene))
    able, never = system.dynamics.sleepers(system)
    assert (able, never) == (("b", "b lid"), ("a", "a lid"))
    assert numbers_in(system.explain()) >= {2, 4}


@pytest.mark.slow
@pytest.mark.parametrize(("balls", "by_grid"), [(5, False), (100, True)])
def test_the_report_of_a_system_counts_the_pairs_of_shapes_of_a_step(balls, by_grid):
    scene = floor("balls")
    for k in range(balls):
        free_body(scene, f"ball {k}", 0.4 * RADIUS**2, (0.0, 0.0, 3.0 * RADIUS * (k + 1)))
        scene.sphere(f"shell {k}", f"ball {k}", RADIUS)
    system = gauss.compile_scene(with_contacts(scene))
    found = system.dynamics.candidate_pairs(system)
    assert found == (balls + 1, balls * (balls + 1) // 2, by_grid)
    listed = len(new_contact_stepper(system).detection.pair)
    assert listed == (0 if by_grid else found.pairs)
    assert found.pairs in numbers_in(system.explain())
