"""What is stepped moves like what was written: every pass, by itself and all together, on every shipped scene and more."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import forward_dynamics
from gauss.dynamics.traced_system import Program
from gauss.io.catalog import shipped
from gauss.system import random_state
from tests import mechanisms

ALIKE = 1e-11  # of accelerations, relative to the largest, and of coordinates after a motion [rad, m]


def _tilted(scene: gauss.Scene) -> gauss.Scene:
    """The same mechanism with a skew plane, hung on the ground through a skew base."""
    turned = gauss.Scene(f"tilted {scene.name}", gravity=scene.gravity)
    turned.body("base", 1.0, (0.1, 0.1, 0.1), rotation=(0.3, -0.7, 1.1), position=(0.1, 0.2, 0.3))
    turned.fixed("foot", "ground", "base")
    for body in scene.bodies.values():
        on = "base" if body.on == "ground" else body.on
        turned.add(gauss.Body(**(vars(body) | {"on": on})))
    for joint in scene.joints.values():
        ends = {key: "base" if getattr(joint, key) == "ground" else getattr(joint, key) for key in ("parent", "child")}
        frame = "base" if joint.frame == "world" else joint.frame
        turned.add(gauss.Joint(**(vars(joint) | ends | {"frame": frame})))
    for start in scene.starts.values():
        turned.add(start)
    return turned


def layered() -> gauss.Scene:
    """Four-bar with links in layers above each other, skew inertias, a slider on the rocker, forces out of the plane."""
    scene = mechanisms.four_bar("CDAB")
    scene.body(
        "weight", 0.4, (0.01, 0.02, 0.02, 0.003, 0.001, 0.002), com=(0.1, 0.05, 0.3), on="rocker", position=(0.3, 0, 0.2)
    )
    scene.prismatic("rail", "rocker", "weight", at=(0.3, 0, 0.2), axis=(1, 0.4, 0), frame="rocker")
    scene.joint_spring("buffer", "rail", stiffness=50.0, damping=0.1)
    scene.spring("rope", "weight", "ground", at=(0, 0, 0.5), other_at=(1, 1, 2), stiffness=20.0, length=0.3)
    scene.force("push", "coupler", force=(1, 2, 3), moment=(0.3, 0.2, 0.1), at=(0.2, 0.1, 0.4), axes="body")
    return _tilted(scene)


def welded() -> gauss.Scene:
    """Arm whose links are made of several bodies, one of them closing a loop of welds, with loads on all."""
    scene = gauss.load("spatial_tree")
    rng = np.random.default_rng(3)
    for i, on in enumerate(("b1", "tool0", "b3", "b4", "ground")):
        place = {"com": rng.normal(size=3), "position": rng.normal(size=3), "rotation": rng.normal(size=3)}
        scene.body(f"tool{i}", 0.3 + i, mechanisms.inertia(rng), on=on, **place)
        scene.fixed(f"weld{i}", on, f"tool{i}", at=rng.normal(size=3))
        scene.force(f"push{i}", f"tool{i}", force=rng.normal(size=3), moment=rng.normal(size=3), axes="body")
    scene.fixed("again", "tool1", "b1")
    scene.spring("rope", "tool1", "tool3", stiffness=10.0, damping=1.0, length=0.5)
    return scene


def wrist() -> gauss.Scene:
    """Spherical five-bar: hinges whose axes meet in a point, though their joint points lie elsewhere; and a top on it."""
    rng, scene, centre = np.random.default_rng(5), gauss.Scene("wrist"), np.array([0.3, -0.2, 0.5])
    axes = [rng.normal(size=3) for _ in range(5)]
    names = ["ground", "a", "b", "c", "d", "ground"]
    for name in names[1:5]:
        scene.body(name, 1.0, mechanisms.inertia(rng), com=rng.normal(size=3), position=rng.normal(size=3))
    for i, axis in enumerate(axes):
        at = centre + 0.3 * (i + 1) * axis
        scene.revolute(f"J{i}", names[i], names[i + 1], at=at, axis=axis)
    scene.body("top", 0.5, mechanisms.inertia(rng), com=(0.1, 0.2, 0.3))
    scene.ball("tip", "b", "top", at=centre)
    scene.start("J0", rate=0.5)
    return scene


def geared(driver_on: str) -> gauss.Scene:
    """Belt train of three wheels on a swinging arm; the last driven from within the train, or by the arm."""
    scene = gauss.Scene("belts", gravity=(0, 0, -9.81))
    scene.body("arm", 2.0, (0.2, 0.1, 0.2), com=(0.5, 0.1, 0))
    scene.revolute("swing", "ground", "arm", axis=(0, 1, 0.2))
    for i, axis in enumerate(((0, 1, 0), (1, 0, 0), (0, 0.6, 0.8))):
        place = {"com": (0.02 * i, 0.01, 0), "on": "arm", "position": (0.3 * i, 0, 0)}
        scene.body(f"wheel{i}", 0.5 + i, (0.01, 0.02, 0.01), **place)
        scene.revolute(f"shaft{i}", "arm", f"wheel{i}", axis=axis, frame=f"wheel{i}")
    scene.body("rider", 0.3, (0.01, 0.01, 0.01), on="wheel2", position=(0.1, 0.2, 0.1))
    scene.revolute("perch", "wheel2", "rider", axis=(1, 1, 0), frame="rider")
    scene.couple("first belt", "shaft1", "shaft0", 2.0, 0.3)
    scene.couple("second belt", "shaft2", driver_on, -1.5)
    scene.drive("shaft1", torque=0.7)
    return scene


def truss() -> gauss.Scene:
    """Double pendulum whose upper link is a triangle of three rods."""
    scene = mechanisms.rods(1)
    scene.body("strut", 0.5, mechanisms.SLENDER, com=(0.5, 0, 0), on="rod1", rotation=(0, 0, np.pi / 3))
    scene.body(
        "tie", 0.5, mechanisms.SLENDER, com=(0.5, 0, 0), on="rod1", position=(1, 0, 0), rotation=(0, 0, 2 * np.pi / 3)
    )
    scene.revolute("P", "rod1", "strut", frame="rod1")
    scene.revolute("Q", "rod1", "tie", at=(1, 0, 0), frame="rod1")
    scene.revolute("R", "strut", "tie", at=(1, 0, 0), frame="strut")
    scene.body("lower", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0), on="tie", position=(1, 0, 0))
    scene.revolute("knee", "tie", "lower", frame="lower")
    return scene


def locked() -> gauss.Scene:
    """Chain in which a coupling of ratio 0 holds one joint at an angle, and another coupling holds a second."""
    scene = mechanisms.chain([1.0, 2.0, 0.5, 0.7])
    scene.couple("brake", "joint1", "joint0", 0.0, 0.4)
    scene.couple("second brake", "joint3", "joint1", -2.0, 0.1)
    return scene


def islands() -> gauss.Scene:
    """Three four-bars and a pendulum on one ground, two of them joined by a spring."""
    scene = gauss.Scene("islands", gravity=(0, -9.8, 0))
    for i in range(3):
        bar = mechanisms.four_bar()
        for body in bar.bodies.values():
            scene.add(gauss.Body(**(vars(body) | {"name": f"{body.name}{i}"})))
        for joint in bar.joints.values():
            ends = {key: f"{name}{i}" if (name := getattr(joint, key)) != "ground" else name for key in ("parent", "child")}
            scene.add(gauss.Joint(**(vars(joint) | ends | {"name": f"{joint.name}{i}"})))
        scene.start(f"A{i}", rate=1.0 + i)
    scene.body("rod", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0))
    scene.revolute("P", "ground", "rod")
    scene.spring("rope", "rocker0", "rod", stiffness=30.0, length=0.2)
    return scene


def strutted() -> gauss.Scene:
    """Skew plane of two pendulums and a four-bar in layers, two of them tied by a rod, the third driven."""
    scene = mechanisms.four_bar("CDAB")
    scene.body("flag", 0.7, (0.02, 0.03, 0.04), com=(0.3, 0.1, 0.2), position=(2.0, 0, 0.4))
    scene.revolute("mast", "ground", "flag", at=(2.0, 0, 0.4))
    scene.body("patch", 0.1, (0.01, 0.01, 0.01), on="flag", position=(0.2, 0.3, 0.1))
    scene.fixed("seam", "flag", "patch", frame="patch")
    scene.body("rod", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0), position=(-1, 0, 0))
    scene.revolute("P", "ground", "rod", frame="rod")
    scene = _tilted(scene)
    scene.distance("tie", "patch", "rocker", at=(0.1, 0.2, 0.3), other_at=(0.5, 0.1, -0.2))
    scene.drive("P", angle=lambda t: 0.3 * np.sin(2 * t))
    return scene


def tied_islands() -> gauss.Scene:
    """Islands of which two roll on each other; one has a tool on a table that slides only along its edge."""
    scene = islands()
    for name, place in (("drum", (5.0, 0, 0)), ("roller", (5.0, 1.5, 0))):
        scene.body(name, 1.0, (0.2, 0.2, 0.3), com=(0.1, 0.05, 0), position=place)
        scene.revolute(f"axle of {name}", "ground", name, frame=name)
    scene.gear("mesh", "drum", "roller", (20, 10))
    scene.body("cart", 2.0, (0.1, 0.1, 0.1), position=(0, 0, 4))
    scene.prismatic("rail", "ground", "cart", frame="cart")
    scene.body("arm", 1.0, (0.1, 0.2, 0.3), com=(0.2, 0.1, 0.3), position=(0, 0, 4))
    scene.ball("shoulder", "cart", "arm", frame="arm")
    pose = {"on": "arm", "position": (0.5, 0.1, 0.2), "rotation": (0.3, 0.2, 0.1)}
    scene.body("tool", 0.5, (0.02, 0.03, 0.04), com=(0.1, 0, 0), **pose)
    scene.fixed("flange", "arm", "tool", frame="tool")
    scene.on_plane("table", "tool", "ground", at=(0.2, 0.1, 0.3), normal=(0.2, 0.1, 1.0), other_at=(0.7, 0.2, 4.5))
    scene.constrain("blade", velocity=lambda at: at.rotation("tool")[:, 1] @ at.velocity("tool", (0.1, 0, 0)))
    return scene


BUILT = {
    "strutted": strutted,
    "tied islands": tied_islands,
    "layered": layered,
    "welded": welded,
    "wrist": wrist,
    "belts": lambda: geared("shaft1"),
    "belts across": lambda: geared("swing"),
    "truss": truss,
    "locked": locked,
    "islands": islands,
    "door on two hinges": lambda: mechanisms.four_bar(twice=True),
    "ladder": lambda: gauss.load("n_four_bar", n=4),
    "panda": lambda: gauss.load("robot:panda"),
    "tilted slider-crank": lambda: _tilted(gauss.load("slider_crank")),
    "random tree": lambda: gauss.load("random_tree", n=12, seed=1),
}
# one-sided constraints and grips are stepped phase by phase
SHIPPED = [name for name in shipped() if not (gauss.load(name).contacts or gauss.load(name).grips)]
SCENES = {name: lambda name=name: gauss.load(name) for name in SHIPPED} | BUILT


def _states(system, count: int, seed: int):
    """Consistent random states near the start."""
    rng, start = np.random.default_rng(seed), system.initial_state()
    for _ in range(count):
        guess = random_state(system, rng, spread=0.2, slide=0.05)
        near = system.state(start.q + (guess.q - system.reference.q) if system.is_flat else guess.q, start.v + guess.v)
        yield system.initial_state(near.q, near.v), rng


@pytest.mark.parametrize("name", SCENES)
def test_reduced_and_full_accelerations_are_alike(name):
    """Against the certified recursion in maximal coordinates, and against the same recursion on the unreduced system."""
    system = gauss.compile_scene(SCENES[name]())
    assert not obstacles(system)
    kernel = Program(system, Laws(system)).forward()
    for state, rng in _states(system, 3, 1):
        load = rng.standard_normal(system.n_v)
        expected = gauss.solve(gauss.assemble(system, state, load), "recursion").qdd
        found = kernel(np.concatenate([[0.0], state.q, state.v, load]))[: system.n_v]
        assert np.abs(found - expected).max() <= ALIKE * np.abs(expected).max()


@pytest.mark.parametrize("name", [*SHIPPED, "welded", "truss"])
def test_reduced_and_full_motions_are_alike(name):
    """Where a loop is cut is felt as much as the method errs: the step is short enough for that to be rounding."""
    scene = SCENES[name]()
    options = {"integrator": "rk4", "step": 2.5e-4, "times": [0.005, 0.01]}
    fast, slow = (gauss.simulate(scene, 0.01, backend=backend, **options) for backend in ("auto", "recursion"))
    assert fast.stats.plan.dynamics == "compiled" and fast.stats.handed_over is None
    assert np.abs(fast.q - slow.q).max() <= ALIKE
    assert np.abs(fast.v - slow.v).max() <= ALIKE * max(1.0, np.abs(slow.v).max())
    assert np.abs(fast.work - slow.work).max() <= ALIKE * max(1.0, np.abs(slow.work).max())


# bodies, coordinates, rows of all parts together, and how many rows close loops
SIZES = {
    "four_bar": (3, 4, 12, 2),
    "slider_crank": (3, 4, 12, 2),
    "cardan": (2, 5, 18, 4),
    "gear_pair": (2, 1, 6, 0),
    "heavy_top": (1, 3, 3, 0),
    "layered": (4, 5, 15, 2),
    "welded": (4, 4, 24, 0),
    "wrist": (5, 8, 18, 2),
    "belts": (5, 3, 30, 0),
    "belts across": (5, 4, 31, 1),
    "truss": (2, 2, 6, 0),
    "locked": (2, 2, 12, 0),
    "islands": (10, 13, 39, 6),
    "strutted": (5, 6, 20, 4),
    "tied islands": (14, 19, 60, 9),
    "door on two hinges": (3, 5, 13, 2),
    "ladder": (9, 13, 39, 8),
    "panda": (9, 8, 54, 0),
    "tilted slider-crank": (3, 4, 12, 2),
}


@pytest.mark.parametrize("name", SIZES)
def test_no_more_is_modelled_than_a_scene_needs(name):
    parts = gauss.compile_scene(SCENES[name]()).parts
    found = [(part.n_bodies, part.n_coordinates, part.n_rows, part.n_loop_constraints) for part in parts]
    assert tuple(map(sum, zip(*found, strict=True))) == SIZES[name]


def test_a_plane_costs_the_same_however_it_lies():
    """The normal of the plane need not be an axis, inertias not be principal, links not lie in one layer."""
    counts = []
    for scene in (mechanisms.four_bar(), _tilted(mechanisms.four_bar())):
        system = gauss.compile_scene(scene)
        counts.append(system.dynamics.operations(system, system.parts))
    assert counts[1] <= counts[0] + 20  # gravity has more components than one there


@pytest.mark.parametrize(
    "build, what",
    [
        (lambda: _bent_four_bar(1e-7), "mechanisms in a plane"),
        (lambda: _bent_wrist(1e-7), "spherical mechanisms"),
        (lambda: gauss.load("four_bar"), "loops that cannot move"),
        (lambda: gauss.load("n_four_bar", n=1), "loops that cannot move"),
        (lambda: gauss.load("slider_crank"), "joints that repeat others"),
        (lambda: gauss.load("cardan"), "spherical mechanisms"),
    ],
)
def test_what_only_looks_like_it_is_left_alone(build, what):
    stages = gauss.compile_scene(build()).reduction
    assert not next(stage for stage in stages if stage.what.startswith(what)).why


def _bent_four_bar(angle: float) -> gauss.Scene:
    scene = mechanisms.four_bar("ABC")
    scene.revolute("D", "ground", "rocker", at=(1.2, 0, 0), axis=(0, np.sin(angle), np.cos(angle)))
    return scene


def _bent_wrist(offset: float) -> gauss.Scene:
    scene = gauss.Scene("two hinges that miss each other")
    for name in ("a", "b"):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.1, 0, 0))
    scene.revolute("A", "ground", "a")
    scene.revolute("B", "a", "b", at=(0, offset, 0.3), axis=(1, 0, 0))
    return scene


def test_a_flat_triangle_may_move_at_first_order_and_is_not_called_rigid():
    """Its rods lie on one line: a loop that is locked, yet not by its velocities."""
    scene = gauss.Scene("flat")
    for name, place in (("one", 0.0), ("two", 1.0)):
        scene.body(name, 1.0, mechanisms.SLENDER, com=(0.5, 0, 0), position=(place, 0, 0))
    scene.revolute("A", "ground", "one")
    scene.revolute("B", "one", "two", at=(1, 0, 0))
    scene.revolute("C", "ground", "two", at=(2, 0, 0))
    assert len(gauss.compile_scene(scene).parts[0].joints) == 3


def test_what_was_reduced_away_is_still_told():
    """Poses, reactions and energies are those of the scene as it was written."""
    scene = welded()
    options = {"rtol": 1e-11, "atol": 1e-13, "times": [0.05]}
    fast, slow = (gauss.simulate(scene, 0.05, backend=backend, **options) for backend in ("auto", "recursion"))
    for name in ("tool1", "tool3", "tool4"):
        assert np.abs(fast.body(name).position - slow.body(name).position).max() <= 1e-9
    for found, expected in zip(gauss.reactions(fast, "weld2"), gauss.reactions(slow, "weld2"), strict=True):
        assert np.abs(found - expected).max() <= 1e-7 * np.abs(expected).max()
    assert gauss.energy(fast).kinetic == pytest.approx(gauss.energy(slow).kinetic, rel=1e-9)
    assert fast.system.coordinates == ("b1", "b2", "b3", "b4")


def test_a_gear_has_the_reduced_inertia_of_the_book():
    """J1 + r² J2, driven by M1 + r M2."""
    system = gauss.compile_scene(gauss.load("gear_pair"))
    ratio, pinion, wheel = -1 / 3, 0.001, 0.04
    expected = (1.0 + ratio * 2.0) / (pinion + ratio**2 * wheel)
    found = forward_dynamics(system, np.zeros(2), np.zeros(2), np.array([1.0, 2.0]))
    assert found == pytest.approx([expected, ratio * expected], rel=1e-14)


def test_what_is_locked_does_not_move():
    system = gauss.compile_scene(locked())
    found = forward_dynamics(system, *(np.full(4, 0.1),) * 2, np.ones(4))
    assert found[1] == found[3] == 0.0 and np.abs(found[[0, 2]]).min() > 0.0


def test_a_relation_with_nothing_that_moves_is_still_looked_at():
    """A hinge that a second brake holds is driven: what cannot be met is refused, whichever island it is left to."""
    scene = islands()
    scene.body("door", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0))
    scene.revolute("hinge", "ground", "door")
    scene.couple("brake", "hinge", "P", 0.0, 0.2)
    scene.drive("hinge", angle=lambda t: 0.2 + 0.5 * t)
    with pytest.raises(gauss.GaussError):
        gauss.simulate(scene, 0.1)


def test_a_scene_that_cannot_move_at_all_has_no_parts():
    """It is solved as it is written, for its reactions."""
    scene = gauss.Scene("monument")
    scene.body("stone", 2.0, (1, 1, 1))
    scene.fixed("foot", "ground", "stone")
    scene.revolute("bolt", "ground", "stone")
    system = gauss.compile_scene(scene)
    assert system.parts == ()
    assert gauss.simulate(system, 0.1).q[-1] == pytest.approx([0.0], abs=1e-12)


def test_explain_tells_what_was_saved_and_why():
    told = gauss.compile_scene(mechanisms.four_bar(twice=True)).explain()
    for line in (
        "subsystems in joint coordinates: 30 rows, 5 coordinates,",
        "mechanisms in a plane are laid into it: all hinges have the direction (0 0 1)",
        "saves 15 rows, 0 coordinates,",
        "joint 'again' repeats 'D'",
        "saves 2 rows, 0 coordinates,",
        "gear and belt trains are one reduced inertia: none here",
        "reduced: 13 rows, 5 coordinates,",
    ):
        assert line in told
    assert "loops are closed by 'C', 'again' instead of 'D', 'again'" in told
