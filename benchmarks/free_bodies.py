"""Free bodies with contacts."""

import numpy as np

import gauss
from gauss.rotations import from_quaternion
from gauss.scene import Scene

EDGE, RADIUS = 0.2, 0.05  # of boxes and balls [m]
TILE = 0.01, 0.04, 0.1  # edges of a domino [m]
WALL = 0.17  # half width of a bin [m]


def free_body(scene: Scene, name: str, inertia: float, position, rate=None, turn=(1.0, 0.0, 0.0, 0.0)):
    """Body of 1 kg on a free joint from the ground."""
    scene.body(name, mass=1.0, inertia=(inertia,) * 3)
    scene.free(f"{name} floats", "ground", name)
    scene.start(f"{name} floats", position=(*position, *turn), **({} if rate is None else {"rate": rate}))


def floor(name: str) -> Scene:
    """Scene with a horizontal plane."""
    scene = gauss.Scene(name)
    scene.half_space("floor")
    return scene


def stack(n: int, friction: float = 0.5) -> Scene:
    """Boxes on each other, all pairs declared."""
    scene = floor("stack")
    for k in range(n):
        free_body(scene, f"box {k}", EDGE**2 / 6.0, (0.0, 0.0, EDGE * (k + 0.5)))
        scene.box(f"cube {k}", f"box {k}", (EDGE,) * 3)
    scene.contacts_all(friction=friction)
    return scene


def dominoes(n: int, push: float = 1.0) -> Scene:
    """A row of dominoes, of which the first is pushed [rad/s]: by 1 it falls back, by 3 they topple."""
    scene, (a, b, c), gap = floor("dominoes"), TILE, 0.05
    for k in range(n):
        scene.body(
            f"domino {k}", mass=0.1, inertia=tuple(0.1 / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b]))
        )
        scene.free(f"domino {k} floats", "ground", f"domino {k}")
        rate = (0.5 * c * push, 0.0, 0.0, 0.0, push, 0.0) if not k else (0.0,) * 6
        scene.start(f"domino {k} floats", position=(gap * k, 0.0, 0.5 * c, 1.0, 0.0, 0.0, 0.0), rate=rate)
        scene.box(f"tile {k}", f"domino {k}", (a, b, c))
    scene.contacts_all(friction=0.4)
    return scene


def walled_floor(name: str, wall: float) -> Scene:
    """Scene with a plane and four walls, each so far from its middle [m]."""
    scene = floor(name)
    for side, x, y in (("west", 1, 0), ("east", -1, 0), ("south", 0, 1), ("north", 0, -1)):
        scene.half_space(side, at=(-wall * x, -wall * y, 0.0), normal=(x, y, 0.0))
    return scene


def bin_of_balls(n: int, friction: float = 0.5, wall: float = WALL, seed: int = 0) -> Scene:
    """Balls in layers above each other that fall into a bin of four walls."""
    rng, scene = np.random.default_rng(seed), walled_floor("bin of balls", wall)
    row = int(2.0 * wall / (2.2 * RADIUS))
    for i in range(n):
        layer, place = divmod(i, row * row)
        east, north = ((k - 0.5 * (row - 1)) * 2.2 * RADIUS + 0.001 * rng.standard_normal() for k in divmod(place, row))
        free_body(scene, f"ball {i}", 0.4 * RADIUS**2, (east, north, 1.2 * RADIUS + 2.1 * RADIUS * layer))
        scene.sphere(f"sphere {i}", f"ball {i}", RADIUS)
    scene.contacts_all(friction=friction)
    return scene


def packed_balls(n: int, row: int, jolt: float = 0.0) -> tuple[Scene, float]:
    """Balls at rest in a bin, and the half width of the bin [m].

    Each lies in the hollow of four below, in layers of row² and (row − 1)² balls by turns, neighbours 1 % of their diameter
    apart; a jolt gives each a velocity at random [m/s].
    """
    apart, rng = 2.02 * RADIUS, np.random.default_rng(0)
    rise, wall = np.sqrt(4.0 * RADIUS**2 - 0.5 * apart**2), 0.5 * (row - 1) * apart + RADIUS
    scene = walled_floor("packed balls", wall)
    places: list[tuple[int, float, float]] = []
    while len(places) < n:
        layer = places[-1][0] + 1 if places else 0
        across = (np.arange(row - layer % 2) - 0.5 * (row - 1 - layer % 2)) * apart
        places += [(layer, east, north) for east in across for north in across]
    for i, (layer, east, north) in enumerate(places[:n]):
        rate = (*jolt * rng.standard_normal(3), 0.0, 0.0, 0.0)
        free_body(scene, f"ball {i}", 0.4 * RADIUS**2, (east, north, RADIUS + rise * layer), rate=rate)
        scene.sphere(f"sphere {i}", f"ball {i}", RADIUS)
    scene.contacts_all(friction=0.5)
    return scene, wall


def box_depth(q: np.ndarray, size) -> float:
    """Deepest corner below the floor [m] of boxes at coordinates (n, 7)."""
    half = 0.5 * np.array(size)
    return max(0.0, *(float(np.abs(from_quaternion(own[3:])[2]) @ half - own[2]) for own in q))


def ball_depth(q: np.ndarray, wall: float) -> float:
    """Deepest penetration [m] of balls at coordinates (n, 7) into each other, the floor and the walls of a bin."""
    x = q[:, :3]
    apart = np.linalg.norm(x[:, None] - x[None], axis=2) + np.diag(np.full(len(x), np.inf))
    return max(0.0, 2.0 * RADIUS - apart.min(), RADIUS - x[:, 2].min(), np.abs(x[:, :2]).max() + RADIUS - wall)
