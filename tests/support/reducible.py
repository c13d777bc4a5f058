"""Scenes that passes reduce: planes, spherical linkages, welded links, gear trains, trusses and islands."""

import numpy as np

import gauss
from gauss.io.catalog import shipped
from tests.support import mechanisms


def tilted(scene: gauss.Scene) -> gauss.Scene:
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
    return tilted(scene)


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
    scene = tilted(scene)
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
    "tilted slider-crank": lambda: tilted(gauss.load("slider_crank")),
    "random tree": lambda: gauss.load("random_tree", n=12, seed=1),
}
# one-sided constraints and set-valued elements are stepped phase by phase
SHIPPED = [name for name in shipped() if not (gauss.load(name).contacts or gauss.load(name).set_valued)]
SCENES = {name: lambda name=name: gauss.load(name) for name in SHIPPED} | BUILT
