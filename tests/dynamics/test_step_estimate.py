"""What a report says of steps of time stepping beforehand: contacts at the start, islands, route and cost."""

import pytest

import gauss
from benchmarks.free_bodies import EDGE, bin_of_balls, floor, free_body, stack
from gauss.errors import GaussError

PAIRS_OF_BALLS = 100 * 99 // 2 + 100 * 5


def boxes(gap: float):
    """Two stacks of two boxes, a gap [m] above each other."""
    scene = floor("boxes")
    for k in range(4):
        column, level = divmod(k, 2)
        height = EDGE * (level + 0.5) + level * gap
        free_body(scene, f"box {k}", EDGE**2 / 6.0, (3.0 * column * EDGE + 0.01 * level, 0.0, height))
        scene.box(f"cube {k}", f"box {k}", (EDGE,) * 3)
    scene.contacts_all(friction=0.5)
    return gauss.compile_scene(scene)


@pytest.mark.slow
def test_islands_and_near_pairs_at_the_start_are_counted():
    system = boxes(0.0)
    plan, step = system.dynamics.time_step(system)
    assert plan.dynamics == "pair kernels" and step.free
    assert step.islands == (2, 2) and step.pairs == 4 and set(step.kinds) == {"Box–Box", "Box–HalfSpace"}
    assert step.cost > 0.0 and step.points >= 4 * step.pairs
    assert sum("µs" in line for line in system.explain().splitlines()) == 1


@pytest.mark.slow
def test_a_start_from_which_no_step_is_made_is_reported_with_the_reason():
    system = boxes(-0.3 * EDGE)
    assert isinstance(system.dynamics.time_step(system), GaussError)
    assert "cube 1 on cube 0" in next(line for line in system.explain().splitlines() if "no step from the start" in line)


@pytest.mark.slow
def test_a_bin_of_balls_has_its_pairs_and_cost_said_beforehand():
    system = gauss.compile_scene(bin_of_balls(100))
    _, step = system.dynamics.time_step(system)
    assert step.points == 0 and step.cost > 0.0  # they fall
    assert str(PAIRS_OF_BALLS) in system.explain()


def test_contacts_in_the_code_of_the_scene_have_no_estimate():
    system = gauss.compile_scene(gauss.load("block_on_incline"))
    plan, step = system.dynamics.time_step(system)
    assert plan.driver == "time stepping" and plan.dynamics == "compiled" and step is None


@pytest.mark.slow
def test_what_follows_does_not_depend_on_the_report():
    scene = stack(2)
    told, silent = gauss.compile_scene(scene), gauss.compile_scene(scene)
    told.explain()
    one, other = (gauss.simulate(s, 0.01, integrator="time_stepping", step=1e-3) for s in (told, silent))
    assert one.q.tobytes() == other.q.tobytes()
