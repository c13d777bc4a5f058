"""Servo-controlled scenes that several tests use, with their closed forms where there are any."""

import numpy as np

import gauss
from gauss import math
from gauss.servo import AuxiliarySupport, Cable, Motor, Servo, ServoRelation, Thruster
from tests.support.mechanisms import inertia

G = 9.81


def cart_pendulum(cart=1.0, bob=0.5, length=0.8, cart_force=0.0) -> gauss.Scene:
    """Inverted pendulum of a massless rod; ``pin`` is the angle from the upright, leaning towards +x."""
    scene = gauss.Scene("cart and pendulum", gravity=(0, -G, 0))
    scene.body("cart", cart)
    scene.body("bob", bob, com=(0, length, 0))
    scene.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
    scene.revolute("pin", "cart", "bob", axis=(0, 0, -1))
    if cart_force:
        scene.drive("rail", force=cart_force)
    return scene


def lean(profile, name="lean", **options) -> ServoRelation:
    """Relation that the inclination of the pendulum follows a function of time."""
    return ServoRelation(name, lambda t, motion: motion.coordinate("pin") - profile(t), unit="rad", **options)


def at(profile, name="place") -> ServoRelation:
    """Relation that the cart follows a function of time."""
    return ServoRelation(name, lambda t, motion: motion.coordinate("rail") - profile(t), unit="m")


def crane(trolley=10.0, load=2.0) -> gauss.Scene:
    """Overhead crane: trolley, massless rope of variable length, point load; ``swing`` is the angle of the rope."""
    scene = gauss.Scene("crane", gravity=(0, -G, 0))
    scene.body("trolley", trolley)
    scene.body("rope", 0.0)
    scene.body("load", load)
    scene.prismatic("rail", "ground", "trolley", axis=(1, 0, 0))
    scene.revolute("swing", "trolley", "rope", axis=(0, 0, 1))
    scene.prismatic("hoist", "rope", "load", axis=(0, -1, 0))
    scene.start("hoist", 3.0)
    return scene


def crane_servo(x, y, trolley=10.0, load=2.0) -> Servo:
    """Crane whose load follows (x(t), y(t)) by a force on the trolley and the tension of the rope."""
    path = ServoRelation("load", lambda t, motion: motion.position("load")[:2] - np.array([x(t), y(t)]), unit="m")
    return Servo(crane(trolley, load), [path], [Motor("trolley force", "rail"), Cable("rope", "load", "trolley")])


def two_masses(m1=1.0, m2=2.0, stiffness=50.0) -> gauss.Scene:
    """Two masses on a line, a relaxed spring of 1 m between them."""
    scene = gauss.Scene("two masses", gravity=(0, 0, 0))
    for name, mass, x in (("first", m1, 0.0), ("second", m2, 1.0)):
        scene.body(name, mass, position=(x, 0, 0))
        scene.prismatic(f"x{name}", "ground", name, at=(x, 0, 0))
    scene.spring("tether", "first", "second", stiffness=stiffness, length=1.0)
    return scene


def two_masses_servo(profile, **data) -> Servo:
    """Force on the first mass, by which the second follows a function of time."""
    follow = ServoRelation("second", lambda t, motion: motion.coordinate("xsecond") - profile(t), unit="m")
    return Servo(two_masses(**data), [follow], [Motor("force", "xfirst")])


def arm() -> gauss.Scene:
    """Planar arm of two links of 1 m and 0.8 m; the elbow is free."""
    scene = gauss.Scene("arm", gravity=(0, -G, 0))
    scene.body("upper", 2.0, (0, 0, 0.2), com=(0.5, 0, 0))
    scene.body("lower", 1.0, (0, 0, 0.06), com=(0.4, 0, 0), position=(1.0, 0, 0))
    scene.revolute("shoulder", "ground", "upper")
    scene.revolute("elbow", "upper", "lower", at=(1, 0, 0))
    scene.start("shoulder", 0.4)
    scene.start("elbow", 0.7)
    return scene


def tip_on_line(ideal=False) -> ServoRelation:
    """Tip of the arm on the line x = const through its start."""
    x = np.cos(0.4) + 0.8 * np.cos(1.1)
    return ServoRelation("tip", lambda t, motion: motion.position("lower", (0.8, 0, 0))[0] - x, ideal=ideal, unit="m")


PIVOT = 0.3  # of the plate, below its surface [m]: a tilt carries the surface sideways
RADIUS = 0.1  # of the disk [m]


def tilting_plate(plate=3.0) -> gauss.Scene:
    """Plate that tilts about two axes through a pivot below it, and an upright disk whose rim touches it.

    The disk has six coordinates of its own; contact and rolling are a relation, see :func:`rolling`.
    """
    scene = gauss.Scene("plate and disk")
    scene.body("gimbal", 0.0)
    scene.body("plate", plate, (0.1 * plate, 0.12 * plate, 0.2 * plate), com=(0, 0, PIVOT))
    scene.revolute("roll", "ground", "gimbal", axis=(1, 0, 0))
    scene.revolute("pitch", "gimbal", "plate", axis=(0, 1, 0))
    J = 0.5 * 0.5 * RADIUS**2
    scene.body("disk", 0.5, (J / 2, J, J / 2))
    scene.free("disk", "ground", "disk")
    scene.start("disk", (0.05, 0.02, PIVOT + RADIUS, 1, 0, 0, 0), (0, 0, 0, 0, 2.0, 0.5))
    return scene


def rolling() -> ServoRelation:
    """Rim of the disk rolls on the plate without slip: the material points that touch have one velocity."""

    def residual(t, motion):
        normal, axis = motion.rotation("plate")[:, 2], motion.rotation("disk")[:, 1]
        down = (axis @ normal) * axis - normal
        touching = motion.position("disk") + RADIUS * down / math.sqrt(down @ down)
        speeds = [
            motion.velocity(body) + _cross(motion.angular_velocity(body), touching - motion.position(body))
            for body in ("disk", "plate")
        ]
        return speeds[0] - speeds[1]

    return ServoRelation("rolling", residual, level="velocity", ideal=True, unit="m/s")


def rolling_servo(plate=3.0) -> Servo:
    """Plate tilted so that the centre of the disk stays at rest, seen from above (example 6)."""
    centre = ServoRelation("centre", lambda t, motion: motion.position("disk")[:2] - np.array([0.05, 0.02]), unit="m")
    return Servo(tilting_plate(plate), [rolling(), centre], [AuxiliarySupport("plate", ("roll", "pitch"))])


def _cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def random_tree(rng, size: int) -> gauss.Scene:
    """Random tree of revolute, prismatic and universal joints with springs and gravity."""
    scene = gauss.Scene("random tree", gravity=rng.normal(size=3) * 5)
    for i in range(size):
        name, parent = f"body{i}", f"body{rng.integers(max(0, i - 2), i)}" if i else "ground"
        mass = rng.uniform(0.5, 2.0)
        scene.body(
            name, mass, inertia(rng), com=rng.normal(size=3), position=rng.normal(size=3), rotation=rng.normal(size=3)
        )
        kind = rng.choice(["revolute", "prismatic", "universal"]) if i else "universal"
        scene.joint(f"joint{i}", kind, parent, name, at=rng.normal(size=3), axis=rng.normal(size=3))
    scene.spring("spring", "body0", f"body{size - 1}", other_at=(0.1, 0.2, 0.3), at=(1, 0, 0), stiffness=3.0, damping=0.4)
    return scene


def random_servo(rng, size: int, count: int) -> Servo:
    """Random tree with relations of all levels, and as many efforts of all kinds."""
    scene = random_tree(rng, size)
    target, point, line = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    last = f"body{size - 1}"

    def place(t, motion):
        gap = motion.position(last, point) - target * math.sin(t)
        return line @ gap

    def speed(t, motion):
        return line @ motion.velocity(last, point) * motion.velocity("body0", target)[0] - 0.3 * math.cos(2 * t)

    def push(t, motion):
        return motion.acceleration(last, target)[1] + motion.angular_acceleration("body0")[2] - t * t

    relations = [
        ServoRelation("place", place),
        ServoRelation("speed", speed, level="velocity"),
        ServoRelation("push", push, level="acceleration"),
    ]
    system = gauss.compile_scene(scene)
    actuators = [
        Motor("motor", system.coordinates[0]),
        Thruster("jet", last, force=rng.normal(size=3), moment=rng.normal(size=3), at=rng.normal(size=3), axes="body"),
        Thruster("pull", f"body{size - 2}", force=rng.normal(size=3)),
    ]
    return Servo(system, relations[:count], actuators[:count])
