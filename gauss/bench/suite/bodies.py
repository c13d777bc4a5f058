"""Rigid bodies that touch: stacks, walls, tables and heaps, in numbers that binary digits hold exactly.

Masses, moments of inertia and places are multiples of powers of two, so that rows that depend on each other do so
exactly, and that contact forces which are zero by symmetry are exactly zero. Velocities of a body are (ω, v) in world
axes.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

GRAVITY = 10.0  # [m/s²]; a number that binary digits hold


@dataclass(frozen=True)
class Heap:
    """Bodies and the points where they touch."""

    # mass, inertia, position (k,), (k, 3), (k, 3): masses [kg], principal moments [kg m²] about the world's axes, and
    # centres of mass [m]
    mass: np.ndarray
    inertia: np.ndarray
    position: np.ndarray
    # pairs (c, 2): bodies of each contact; −1 is the ground. The first is pushed along the normal, the second against it.
    pairs: np.ndarray
    # point, normal (c, 3): where they touch [m], and unit normals
    point: np.ndarray
    normal: np.ndarray
    # load (k, 6): moments [N m] and forces [N], gravity included
    load: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))

    @property
    def weights(self) -> np.ndarray:
        """Diagonal of the mass matrix (6k,)."""
        return np.concatenate([self.inertia, np.repeat(self.mass[:, None], 3, axis=1)], axis=1).ravel()

    @property
    def free(self) -> np.ndarray:
        """Accelerations (6k,) without contacts."""
        return self.load.ravel() / self.weights

    def rows(self, directions: np.ndarray) -> sparse.csr_array:
        """Velocity of the first body relative to the second at each contact along a direction (c, 3): rows (c, 6k)."""
        entries, columns = [], []
        for end, sign in ((0, 1.0), (1, -1.0)):
            body = self.pairs[:, end]
            arm = self.point - self.position[body]
            block = sign * np.concatenate([np.cross(arm, directions), directions], axis=1)
            entries.append(np.where(body[:, None] >= 0, block, 0.0))
            columns.append(6 * np.maximum(body, 0)[:, None] + np.arange(6))
        place = np.repeat(np.arange(len(self.pairs)), 6)
        shape = len(self.pairs), 6 * self.mass.size
        parts = (
            sparse.coo_array((e.ravel(), (place, c.ravel())), shape=shape) for e, c in zip(entries, columns, strict=True)
        )
        total = sparse.csr_array(sum(parts, sparse.coo_array(shape)))
        total.eliminate_zeros()
        return total

    def frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Two tangents (c, 3) of each contact."""
        least = np.argmin(np.abs(self.normal), axis=1)
        one = np.cross(np.eye(3)[least], self.normal)
        one = one / np.linalg.norm(one, axis=1)[:, None]
        return one, np.cross(self.normal, one)

    def all_rows(self) -> sparse.csr_array:
        """Rows (3c, 6k) of the relative velocities, normal first and two tangents after it, contact by contact."""
        parts = sparse.vstack([self.rows(direction) for direction in (self.normal, *self.frames())], format="csr")
        count = len(self.pairs)
        return sparse.csr_array(parts[np.arange(3 * count).reshape(3, count).T.ravel()])

    def names(self, units: tuple[str, str] = ("rad/s²", "m/s²")) -> dict:
        """Names of the velocities of the bodies, or of their accelerations, and units."""
        axes = ("wx", "wy", "wz", "vx", "vy", "vz")
        count = self.mass.size
        return {
            "variables": tuple(f"body{i}.{axis}" for i in range(count) for axis in axes),
            "units": tuple((units[0],) * 3 + (units[1],) * 3) * count,
        }


def make_heap(mass, inertia, position, contacts, gravity=(0.0, 0.0, -GRAVITY), push=None) -> Heap:
    """Heap of contacts (first, second, point, normal) under gravity, and further loads (k, 6) if given."""
    mass, position = np.asarray(mass, dtype=float), np.asarray(position, dtype=float).reshape(-1, 3)
    inertia = np.broadcast_to(np.asarray(inertia, dtype=float), (mass.size, 3))
    load = np.zeros((mass.size, 6)) if push is None else np.array(push, dtype=float)
    load[:, 3:] += mass[:, None] * np.asarray(gravity)
    pairs = np.array([contact[:2] for contact in contacts], dtype=int).reshape(-1, 2)
    point, normal = (np.array([c[k] for c in contacts], dtype=float).reshape(-1, 3) for k in (2, 3))
    return Heap(mass, inertia, position, pairs, point, normal, load)


def table(legs: int, height: float = 1.0, **options) -> Heap:
    """A top of 4 kg on legs along the rim of a square of 2 m."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)]
    quarters = [(x / 2, y) for x in (-1, 1) for y in (-1, 1)] + [(x, y / 2) for x in (-1, 1) for y in (-1, 1)]
    feet = (corners + quarters)[:legs]
    contacts = [(0, -1, (x, y, -height), (0, 0, 1)) for x, y in feet]
    return make_heap([4.0], [2.0, 2.0, 4.0], [(0, 0, 0)], contacts, **options)


def stack(count: int, ratio: float = 1.0, **options) -> Heap:
    """Cubes of 1 m on each other, each ``ratio`` times as heavy as the one below, four points in each face."""
    mass = 2.0 * ratio ** np.arange(count)
    corners = [(x / 2, y / 2) for x in (-1, 1) for y in (-1, 1)]
    contacts = [(k, k - 1, (x, y, k), (0, 0, 1)) for k in range(count) for x, y in corners]
    return make_heap(mass, mass[:, None] / 4, [(0, 0, k + 0.5) for k in range(count)], contacts, **options)


def wall(columns: int, rows: int, **options) -> Heap:
    """Bricks of 2 m × 1 m × 1 m in running bond, four points where one lies on another."""
    place, contacts = {}, []
    for j in range(rows):
        for i in range(columns):
            place[i, j] = (2 * i + (j % 2), 0.0, j + 0.5)
    number = {key: k for k, key in enumerate(place)}
    for (i, j), (x, _, z) in place.items():
        below = [(number[k, j - 1], place[k, j - 1][0]) for k in range(columns) if j and abs(place[k, j - 1][0] - x) < 2]
        for other, middle in below or [(-1, x)]:
            low, high = max(x, middle) - 1, min(x, middle) + 1
            contacts += [(number[i, j], other, (u, y, z - 0.5), (0, 0, 1)) for u in (low, high) for y in (-0.5, 0.5)]
    count = len(place)
    return make_heap(np.full(count, 2.0), [0.5, 1.0, 1.0], list(place.values()), contacts, **options)


def balls(count: int, seed: int, spread: float = 0.0, gaps: bool = False) -> Heap:
    """Balls of 1 m in a box: close ones touch each other, low ones the floor and outer ones the walls."""
    rng, side = np.random.default_rng(seed), int(np.ceil(count ** (1 / 3)))
    grid = np.array([(x, y, z) for z in range(side) for y in range(side) for x in range(side)][:count], dtype=float)
    position = np.round((grid + 0.5 + 0.03 * rng.standard_normal(grid.shape)) * 2**20) / 2**20
    mass = 2.0 ** np.round(spread * rng.uniform(-1, 1, count))
    contacts = []
    near: list[list[int]] = [[] for _ in range(count)]
    for i, j in sorted(cKDTree(position).query_pairs(1.2)):
        near[j].append(i)
    for i in range(count):
        for axis in range(3):
            if grid[i, axis] == 0:
                contacts.append((i, -1, position[i] - 0.5 * np.eye(3)[axis], np.eye(3)[axis]))
        for j in near[i]:
            away = position[i] - position[j]
            contacts.append((i, j, (position[i] + position[j]) / 2, away / np.linalg.norm(away)))
    push = np.round(rng.standard_normal((count, 6)) * 2**8) / 2**8 * mass[:, None]
    push[:, :3] *= 0.1
    return make_heap(mass, mass[:, None] / 8, position, contacts, push=push * (4.0 if gaps else 1.0))
