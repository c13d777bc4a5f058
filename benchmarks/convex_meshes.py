"""Polyhedra of random points that fall on a floor."""

import numpy as np

from benchmarks.free_bodies import floor, free_body
from gauss.rotations import from_quaternion
from gauss.scene import ConvexMesh, Scene

SIZE, POINTS = 0.05, 20  # radius of the ball on which the points lie [m], and how many


def heap(n: int, friction: float = 0.5, seed: int = 0, wall: float = 0.25) -> Scene:
    """Polyhedra in layers above each other that fall into a bin of four walls."""
    rng, scene = np.random.default_rng(seed), floor("heap of meshes")
    for name, x, y in (("west", 1, 0), ("east", -1, 0), ("south", 0, 1), ("north", 0, -1)):
        scene.half_space(name, at=(-wall * x, -wall * y, 0.0), normal=(x, y, 0.0))
    row = int(2.0 * wall / (2.2 * SIZE))
    for i in range(n):
        layer, place = divmod(i, row * row)
        east, north = ((k - 0.5 * (row - 1)) * 2.2 * SIZE for k in divmod(place, row))
        points = rng.standard_normal((POINTS, 3))
        free_body(scene, f"body {i}", 0.4 * SIZE**2, (east, north, 1.1 * SIZE + 2.2 * SIZE * layer))
        scene.mesh(f"mesh {i}", f"body {i}", SIZE * points / np.linalg.norm(points, axis=1)[:, None])
    scene.contacts_all(friction=friction)
    return scene


def mesh_depth(scene: Scene, q: np.ndarray) -> float:
    """Deepest vertex below the floor [m] of meshes at coordinates (n, 7)."""
    meshes = [shape for shape in scene.shapes.values() if isinstance(shape, ConvexMesh)]
    heights = (from_quaternion(own[3:])[2] @ mesh.corners.T + own[2] for own, mesh in zip(q, meshes, strict=True))
    return max(0.0, *(-float(height.min()) for height in heights))
