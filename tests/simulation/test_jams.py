"""Prescribed motions into rigid obstacles: refused with the names, by events and by time stepping."""

import pytest

import gauss
from gauss.errors import SimulationError

pytestmark = pytest.mark.slow


def _driven_arm(**elbow):
    scene = gauss.Scene("arm", gravity=(0, 0, 0))
    for name, before, place in (("upper", "ground", 0.0), ("lower", "upper", 1.0)):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.5, 0, 0), position=(place, 0, 0))
        scene.revolute(f"to {name}", before, name, at=(place, 0, 0))
    scene.drive("to upper", speed=1.0)
    if elbow:
        scene.drive("to lower", **elbow)
    return scene


JAMS = {
    "stop": lambda s: s.stop("to upper", highest=0.5, name="end"),
    "rebounding stop": lambda s: s.stop("to upper", highest=0.5, restitution=0.5, name="end"),
    "rope": lambda s: s.rope("end", "upper", "ground", (1, 0, 0), (0.5, -0.5, 0), length=1.0),
    "gap": lambda s: s.one_sided("end", lambda at: 0.5 - at.coordinate("to upper")),
}


@pytest.mark.parametrize("elbow", [{}, {"speed": 0.0}])
@pytest.mark.parametrize("jam", JAMS)
def test_a_motion_that_is_prescribed_into_what_is_solid_is_refused_by_name(jam, elbow):
    scene = _driven_arm(**elbow)
    JAMS[jam](scene)
    with pytest.raises(SimulationError, match=r"impact at t = .* jams at 'end.*', .* closing with") as refused:
        gauss.simulate(scene, 2.0, rtol=1e-8, atol=1e-8)
    assert refused.value.trajectory.t[-1] < 1.5


@pytest.mark.parametrize(("elbow", "backend"), [({}, "auto"), ({"speed": 0.0}, "auto"), ({"speed": 0.0}, "recursion")])
@pytest.mark.parametrize("jam", JAMS)
def test_time_stepping_refuses_such_a_motion_where_it_jams(jam, elbow, backend):
    scene = _driven_arm(**elbow)
    JAMS[jam](scene)
    with pytest.raises(SimulationError, match=r"^t = .* jams at 'end.*', .* closing with") as refused:
        gauss.simulate(scene, 2.0, integrator="time_stepping", step=0.01, backend=backend)
    assert 0.4 < refused.value.trajectory.t[-1] < 1.5


def test_a_prescribed_motion_goes_on_where_another_joint_gives_way():
    scene = _driven_arm()
    scene.stop("to lower", lowest=-0.2, highest=0.2)
    motion = gauss.simulate(scene, 1.0, rtol=1e-8, atol=1e-8)
    assert motion.events[0].kind == "impact" and motion.coordinate("to upper")[-1] == pytest.approx(1.0, abs=1e-7)
