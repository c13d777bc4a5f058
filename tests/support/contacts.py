"""Two bodies that may touch, by shapes of every kind."""

import numpy as np

import gauss
from tests.support import mechanisms


def two_loose_bodies(seed=0):
    """Two free bodies in skew positions, one of which carries a slider."""
    rng, scene = np.random.default_rng(seed), gauss.Scene("two", gravity=(0.3, -0.2, -9.81))
    for name in ("a", "b"):
        pose = {"position": rng.normal(size=3), "rotation": rng.normal(size=3)}
        scene.body(name, 1.0, mechanisms.inertia(rng), rng.normal(size=3), **pose)
        scene.free(name.upper(), "ground", name, at=rng.normal(size=3))
    scene.body("slider", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("S", "a", "slider", axis=rng.normal(size=3))
    return scene


POINTS = {"at": (0.3, -0.2, 0.5), "other_at": (-0.4, 0.1, 0.2)}


def touching(first, second):
    """Builder of a contact between a shape of each of the two bodies."""

    def build(scene):
        SHAPES[first](scene, "one", "a", (0.3, -0.2, 0.5))
        SHAPES[second](scene, "two", "b", (-0.4, 0.1, 0.2))
        scene.contact("r", "one", "two")

    return build


SHAPES = {
    "sphere": lambda s, name, body, at: s.sphere(name, body, 0.3, at),
    "capsule": lambda s, name, body, at: s.capsule(name, body, 0.2, 1.0, at, (1, 2, -1)),
    "box": lambda s, name, body, at: s.box(name, body, (1, 2, 3), at, (0.1, 0.2, 0.3)),
    "points": lambda s, name, body, at: s.points(name, body, [(0, 0, 1), (0, 1, -1)], 0.1, at),
    "half-space": lambda s, name, body, at: s.half_space(name, body, at, (1, 2, -1)),
}
