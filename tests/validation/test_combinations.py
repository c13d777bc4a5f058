"""Combinations of elements that each work alone: every entry point answers, and two routes agree."""

import numpy as np
import pytest

import gauss

AGREED = 1e-9  # relative: machine code against the certified solver, both good to about 1e-12
MOVED = 1e-7  # rad: two motions of 0.1 s at rtol 1e-10 by different ways to accelerations
END = (0.3, 0, 0)  # m: a point of the second arm


def arms():
    """Two arms in a vertical plane."""
    scene = gauss.Scene("arms")
    scene.body("upper", 2.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0))
    scene.revolute("shoulder", "ground", "upper", axis=(0, 1, 0))
    scene.body("lower", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0), position=(0.6, 0, 0))
    scene.revolute("elbow", "upper", "lower", axis=(0, 1, 0), at=(0.6, 0, 0))
    return scene


FORCES = {
    "spring": lambda s: s.spring("k", "upper", "ground", (0.5, 0, 0), (0, 0, 1), stiffness=50.0),
    "damper": lambda s: s.spring("k", "upper", "ground", (0.5, 0, 0), (0, 0, 1), damping=5.0),
    "spring of two bodies": lambda s: s.spring("k", "upper", "lower", (0.1, 0, 0.1), END, stiffness=50.0),
    "force": lambda s: s.force("push", "lower", lambda t, motion: -5.0 * motion.velocity("lower")),
}
TIED = {
    "speed": lambda s: s.drive("shoulder", speed=1.0),
    "angle": lambda s: s.drive("shoulder", angle=lambda t: np.sin(t)),
    "distance": lambda s: s.distance("rod", "lower", "ground", END, (0.5, 0, -1)),
    "constrain": lambda s: s.constrain("tie", lambda at: at.coordinate("shoulder") + at.coordinate("elbow")),
    "coupling": lambda s: s.couple("gear", "elbow", "shoulder", -1.0),
    "guide": lambda s: s.guide("guide", "lower", lambda t: (0.9, 0, -0.1 * t), at=END, along=((0, 0, 1),)),
    "plane": lambda s: s.on_plane("table", "lower", "ground", at=END),
    "knife edge": lambda s: s.knife_edge("blade", "lower", at=END),
}
COMING = {
    "stop": lambda s: s.stop("shoulder", highest=0.05),
    "stop that rebounds": lambda s: s.stop("elbow", highest=0.05, restitution=0.5),
    "rope": lambda s: s.rope("rope", "ground", "lower", (0, 0, 1), END),
    "joint friction": lambda s: s.joint_friction("shoulder", 3.0),
    "limited drive": lambda s: s.drive("shoulder", speed=1.0, limit=5.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("tied", TIED)
@pytest.mark.parametrize("force", FORCES)
def test_every_force_goes_with_every_relation(force, tied):
    scene = arms()
    FORCES[force](scene)
    TIED[tied](scene)
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    expected = gauss.solve(gauss.assemble(system, state)).qdd
    size = np.abs(expected).max() + 1.0
    assert np.abs(system.accelerations(state) - expected).max() <= AGREED * size
    assert np.abs(system.forward_dynamics(state.q, state.v, np.zeros(2)) - expected).max() <= AGREED * size


@pytest.mark.slow
@pytest.mark.parametrize("coming", COMING)
@pytest.mark.parametrize("force", ["spring", "damper"])
def test_springs_go_with_loops_and_friction(force, coming):
    scene = arms()
    FORCES[force](scene)
    COMING[coming](scene)
    compiled, certified = (
        gauss.simulate(scene, 0.12, rtol=1e-10, atol=1e-10, backend=backend) for backend in ("auto", "recursion")
    )
    assert np.abs(compiled.q[-1] - certified.q[-1]).max() <= MOVED


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["taylor", "radau5", "gauss4", "scipy_dop853"])
def test_springs_go_with_relations_in_every_method(integrator):
    scene = arms()
    FORCES["spring"](scene)
    TIED["distance"](scene)
    motion = gauss.simulate(scene, 0.05, integrator=integrator, step=2e-3, rtol=1e-10, atol=1e-10)
    expected = gauss.simulate(scene, 0.05, rtol=1e-10, atol=1e-10, backend="recursion")
    assert np.abs(motion.q[-1] - expected.q[-1]).max() <= MOVED


QUIET = {"one body": "pendulum", "chain": "double_pendulum", "loop": "four_bar"}


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["auto", "recursion"])
@pytest.mark.filterwarnings("ignore::gauss.errors.BalanceWarning")  # of order 1 where loops close
@pytest.mark.parametrize("name", QUIET.values(), ids=QUIET)
def test_time_stepping_of_what_touches_nothing_converges(name, backend):
    scene = gauss.load(name)
    expected = gauss.simulate(scene, 0.04).q[-1]
    errors = [
        np.abs(gauss.simulate(scene, 0.04, integrator="time_stepping", step=h, backend=backend).q[-1] - expected).max()
        for h in (2e-3, 1e-3)
    ]
    assert errors[1] <= 0.6 * errors[0] + 1e-12  # order 1 at least; the pendulum has no error but rounding


@pytest.mark.slow
def test_time_stepping_calls_a_law_where_nothing_touches():
    scene = arms()
    scene.drive("elbow", torque=lambda t, motion: -float(motion.rate("elbow")))
    motion = gauss.simulate(scene, 0.05, integrator="time_stepping", step=1e-3)
    expected = gauss.simulate(scene, 0.05, rtol=1e-8, atol=1e-8)
    assert np.abs(motion.q[-1] - expected.q[-1]).max() <= 1e-5  # order 2: h² of the accelerations


def hanging(mass):
    """A bob that slides along a link, whose mass may be zero."""
    scene = gauss.Scene("hanging")
    scene.body("link", mass, (1e-3 * mass,) * 3)
    scene.revolute("hinge", "ground", "link", axis=(0, 1, 0))
    scene.body("bob", 1.0, (0.01, 0.01, 0.01), position=(0.5, 0, 0))
    scene.prismatic("slide", "link", "bob", axis=(1, 0, 0))
    return scene


def slider_crank(mass):
    """A slider-crank whose rod may have no mass: machine code of its tree divides by zero."""
    scene = gauss.Scene("slider-crank")
    scene.body("crank", 1.0, (0.01, 0.01, 0.01), com=(0.1, 0, 0))
    scene.body("rod", mass, (1e-3 * mass,) * 3, com=(0.3, 0, 0), position=(0.2, 0, 0))
    scene.body("slider", 1.0, (0.01, 0.01, 0.01), position=(0.8, 0, 0))
    scene.revolute("hinge", "ground", "crank", axis=(0, 1, 0))
    scene.revolute("knee", "crank", "rod", axis=(0, 1, 0), at=(0.2, 0, 0))
    scene.revolute("pin", "slider", "rod", axis=(0, 1, 0), at=(0.8, 0, 0))
    scene.prismatic("guide", "ground", "slider", axis=(1, 0, 0))
    scene.start("hinge", 0.6, rate=3.0)
    return scene


STOPPED = {
    "stop": (hanging, lambda s: s.stop("slide", lowest=-0.1, highest=0.1)),
    "stop that rebounds": (hanging, lambda s: s.stop("slide", lowest=-0.1, highest=0.1, restitution=0.3)),
    "stop of the massless body": (hanging, lambda s: s.stop("hinge", highest=0.4)),
    "rope": (hanging, lambda s: s.rope("rope", "ground", "bob", length=0.6)),
    "wall": (hanging, lambda s: s.one_sided("wall", lambda at: at.position("bob")[2] + 0.3)),
    "loop": (slider_crank, lambda s: s.stop("guide", lowest=-0.2, restitution=0.3)),
}
LIGHT = 1e-7  # kg: as good as no mass, to its share of the others


@pytest.mark.slow
@pytest.mark.parametrize("case", STOPPED)
def test_stops_close_where_a_body_has_no_mass(case):
    make, close = STOPPED[case]
    ends, kinds = [], []
    for mass in (0.0, LIGHT):
        scene = make(mass)
        close(scene)
        motion = gauss.simulate(scene, 0.3, rtol=1e-9, atol=1e-9)
        ends.append(motion.q[-1])
        kinds.append([event.kind for event in motion.events])
    assert kinds[0] == kinds[1] and "impact" in kinds[0]
    assert np.abs(ends[0] - ends[1]).max() <= 10 * LIGHT


def welded():
    """Two bodies that are part of the ground, and a load on one of them."""
    scene = gauss.Scene("welded")
    for name, parent in (("a", "ground"), ("b", "a")):
        scene.body(name, 1.0, (0.1, 0.1, 0.1))
        scene.fixed(f"weld of {name}", parent, name)
    scene.force("push", "b", (0, 0, 5.0))
    return scene


EVERY = ["dop853", "dopri5", "taylor", "radau5", "rk4", "verlet", "gauss4", "generalised_alpha", "variational_midpoint"]
EVERY += ["energy_momentum", "time_stepping", "scipy_dop853", "scipy_radau", "scipy_lsoda"]


@pytest.mark.slow
@pytest.mark.parametrize("integrator", EVERY)
def test_what_cannot_move_stays_in_every_method(integrator):
    motion = gauss.simulate(welded(), 0.1, integrator=integrator, step=0.05)
    assert motion.q.shape == motion.v.shape == (len(motion.t), 0)
    assert motion.t[0] == 0.0 and motion.t[-1] == 0.1
    assert gauss.simulate(welded(), 0.1, integrator=integrator, step=0.05, times=[0.02, 0.1]).t.tolist() == [0.02, 0.1]


@pytest.mark.slow
def test_what_cannot_move_answers_everywhere():
    system = gauss.compile_scene(welded())
    state, none = system.initial_state(), np.zeros(0)
    for found in (system.accelerations(state), system.forward_dynamics(none, none, none)):
        assert found.shape == (0,)
    assert system.inverse_dynamics(none, none, none).shape == (0,)
    assert gauss.derivatives(system, state).q.shape == (0, 0)
    starts = np.zeros((3, 0))
    assert gauss.rollout(system, starts, starts, steps=4, step=0.1, every=2).q.shape == (3, 3, 0)
    assert gauss.rollout(system, starts, starts, integrator="dop853", times=[0.0, 0.1]).q.shape == (3, 2, 0)
    motion = gauss.simulate(system, 0.1, verify=True)
    assert motion.stats.global_error == (0.0, 0.0)
    assert np.abs(gauss.energy(motion).balance).max() == 0.0
    weights = np.array([2 * 9.81, 9.81]) - 5.0  # carried by the ground, and by the other body
    for name, weight in zip(("weld of a", "weld of b"), weights, strict=True):
        assert np.allclose(np.abs(gauss.reactions(motion, name).force[-1]), [0, 0, weight], atol=1e-9)
    swept = gauss.sweep(welded(), {"a.mass": [1.0, 2.0]}, 0.1, progress=False)
    assert (swept.status.values == 1).all()


@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_wall_that_runs_into_what_cannot_move_is_refused(speed):
    scene = welded()
    scene.one_sided("wall", lambda at: 0.05 + at.position("a")[0] - speed * at.t)
    if speed:
        with pytest.raises(gauss.errors.SimulationError, match="inside of 'wall'"):
            gauss.simulate(scene, 0.1)
    else:
        assert len(gauss.simulate(scene, 0.1)) == 2
