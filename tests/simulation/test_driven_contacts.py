"""Time stepping of contacts beside prescribed motions: the work of their forces, and friction of prescribed joints."""

import numpy as np
import pytest

import gauss
from gauss import Plan, math

pytestmark = pytest.mark.slow

STEP, END = 1e-3, 0.5  # [s]
BALANCE = 2e-3  # of the work: time stepping is of order 1 at impacts
SAME_MOTION = 1e-4  # rad, m: of two routes that round the moment of an impact differently
ROUNDING = 1e-10  # relative
ROUTES = ("compiled", "pair kernels", "certified")
MOTIONS = {
    "constant speed": {"speed": 0.3},
    "speed": {"speed": lambda t: 0.3 * math.sin(3.0 * t)},
    "displacement": {"displacement": lambda t: 0.1 * math.sin(3.0 * t)},
    "jump": {"speed": lambda t: math.where(t < 0.1, 0.0, 0.4)},
}


def pushed(drive: dict, boxes: bool = False) -> gauss.Scene:
    """A sphere on a rail pushes a ball along a floor, or boxes; the rail has dry friction."""
    scene = gauss.Scene("pusher")
    scene.half_space("floor")
    scene.body("plate", mass=2.0, inertia=(0.02,) * 3, position=(-0.4, 0.0, 0.15))
    scene.prismatic("rail", "ground", "plate", axis=(1, 0, 0))
    scene.sphere("face", "plate", 0.1)
    scene.drive("rail", **drive)
    scene.joint_friction("rail", 0.5)
    for k in range(3 if boxes else 1):
        scene.body(f"body {k}", mass=1.0, inertia=(0.004,) * 3, position=(-0.19 + 0.25 * k, 0.0, 0.1))
        scene.joint(f"free {k}", "free", "ground", f"body {k}")
        scene.box(f"shape {k}", f"body {k}", (0.2, 0.2, 0.2)) if boxes else scene.sphere(f"shape {k}", f"body {k}", 0.1)
        scene.contact(f"on floor {k}", f"shape {k}", "floor", friction=0.3)
        scene.contact(f"push {k}", "face", f"shape {k}", friction=0.2)
    return scene


def moved(system: gauss.System, route: str | None = None) -> gauss.Trajectory:
    plan = None if route is None else Plan("time stepping", route)
    return gauss.simulate(system, END, integrator="time_stepping", step=STEP, progress=False, plan=plan)


def energy(motion: gauss.Trajectory, k: int) -> float:
    system = motion.system
    return float(system.kinetic_energy(motion.q[k], motion.v[k]) + system.potential_energy(motion.q[k]))


@pytest.mark.parametrize("drive", MOTIONS)
def test_prescribed_motions_do_the_work_of_contacts_and_friction(drive):
    system = gauss.compile_scene(pushed(MOTIONS[drive]))
    motions = [moved(system, route) for route in ROUTES]
    for motion in motions:
        driven, loaded, lost = motion.work[-1]
        assert energy(motion, -1) - energy(motion, 0) == pytest.approx(driven + loaded - lost, abs=BALANCE * driven)
        np.testing.assert_allclose(motion.q[-1], motions[0].q[-1], atol=SAME_MOTION)
        np.testing.assert_allclose(motion.work[-1], motions[0].work[-1], rtol=10 * BALANCE, atol=BALANCE * driven)


@pytest.mark.parametrize("route", ["compiled", "certified"])
def test_dry_friction_of_a_prescribed_joint_takes_its_force_times_the_way(route):
    scene = gauss.Scene("rail", gravity=(0.0, 0.0, 0.0))
    for k, name in enumerate(("held", "loose")):
        scene.body(name, mass=1.0, inertia=(0.02,) * 3, position=(float(k), 0.0, 0.0))
        scene.prismatic(f"{name} rail", "ground", name, axis=(1, 0, 0))
    scene.drive("held rail", speed=0.3)
    scene.joint_friction("held rail", 0.5)
    scene.joint_friction("loose rail", 0.2)
    scene.start("loose rail", rate=1.0)
    motion = moved(gauss.compile_scene(scene), route)
    driven, _, lost = motion.work[-1]
    assert driven == pytest.approx(0.5 * 0.3 * END, rel=ROUNDING)
    assert motion.v[-1, 1] == pytest.approx(1.0 - 0.2 * END, rel=ROUNDING)
    assert lost == pytest.approx(driven + 0.5 * (1.0 - motion.v[-1, 1] ** 2), rel=ROUNDING)


def test_boxes_beside_a_prescribed_motion_are_moved_by_kernels_of_pairs():
    motion = moved(gauss.compile_scene(pushed(MOTIONS["speed"], boxes=True)))
    driven, loaded, lost = motion.work[-1]
    assert motion.stats.plan.dynamics == "pair kernels"
    assert energy(motion, -1) - energy(motion, 0) == pytest.approx(driven + loaded - lost, abs=BALANCE * driven)
