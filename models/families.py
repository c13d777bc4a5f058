"""Families of scenes with the size as an argument."""

import numpy as np

import gauss

__all__ = ["mass_ratio_chain", "n_four_bar", "n_pendulum", "random_tree", "spatial_chain"]

KINDS = ("revolute", "prismatic", "fixed", "free", "cylindrical", "universal", "ball", "planar", "screw")


def n_pendulum(n: int = 3, mass: float = 1.0, length: float = 1.0) -> gauss.Scene:
    """Chain of n uniform rods in the x-y plane, hanging from the ground, released from the horizontal.

    ::

        ground o-----o-----o-----   →  swings down
               J1    J2    J3
    """
    scene, previous = gauss.Scene(f"{n}-pendulum", gravity=(0, -9.81, 0)), "ground"
    moment = mass * length**2 / 12
    for i in range(1, n + 1):
        place = {"on": previous, "position": (length if i > 1 else 0.0, 0, 0)}
        scene.body(f"rod{i}", mass, (0, moment, moment), com=(length / 2, 0, 0), **place)
        scene.revolute(f"J{i}", previous, f"rod{i}", frame=f"rod{i}")
        previous = f"rod{i}"
    return scene


def n_four_bar(n: int = 1, mass: float = 1.0, length: float = 1.0) -> gauss.Scene:
    """Ladder of n square windows of uniform rods, n + 1 cranks upright on the ground: IFToMM benchmark A02.

    ::

          B0 ---- B1 ---- B2
          |       |       |
        --A0------A1------A2--   cranks start with v(B0) = 1 m/s along x
    """
    scene = gauss.Scene(f"{n}-four-bar", gravity=(0, -9.81, 0))
    moment, upright = mass * length**2 / 12, (0, 0, np.pi / 2)
    rod = {"mass": mass, "inertia": (0, moment, moment), "com": (length / 2, 0, 0)}
    for i in range(n + 1):
        scene.body(f"crank{i}", **rod, position=(i * length, 0, 0), rotation=upright)
        scene.revolute(f"A{i}", "ground", f"crank{i}", at=(i * length, 0, 0))
        if i:
            scene.body(f"coupler{i}", **rod, position=((i - 1) * length, length, 0))
            scene.revolute(f"B{i - 1}", f"crank{i - 1}", f"coupler{i}", at=((i - 1) * length, length, 0))
            scene.revolute(f"C{i}", f"coupler{i}", f"crank{i}", at=(i * length, length, 0))
    scene.start("A0", rate=-1.0 / length)
    return scene


def spatial_chain(n: int = 10, seed: int = 0) -> gauss.Scene:
    """Chain of n bodies with random inertias on hinges with random axes."""
    return _grow(f"spatial chain of {n}", n, seed, ("revolute",), lambda i, rng: i - 1)


def random_tree(n: int = 10, seed: int = 0, kinds=KINDS) -> gauss.Scene:
    """Tree of n bodies with random parents, inertias, frames and kinds of joints."""
    return _grow(f"random tree of {n}", n, seed, tuple(kinds), lambda i, rng: int(rng.integers(-1, i)))


def mass_ratio_chain(n: int = 10, ratio: float = 1e6) -> gauss.Scene:
    """Chain of n rods of 1 m, axes z, x, y in turn; masses grow geometrically from 1 kg to the given ratio."""
    scene, previous = gauss.Scene(f"chain with mass ratio {ratio:g}"), "ground"
    for i in range(n):
        mass = ratio ** (i / max(n - 1, 1))
        place = {"on": previous, "position": (1.0 if i else 0.0, 0, 0)}
        scene.body(f"link{i}", mass, (0.02 * mass, mass / 12, mass / 12), com=(0.5, 0, 0), **place)
        axis = ((0, 0, 1), (1, 0, 0), (0, 1, 0))[i % 3]
        scene.revolute(f"joint{i}", previous, f"link{i}", axis=axis, frame=f"link{i}")
        previous = f"link{i}"
    return scene


def _grow(name: str, n: int, seed: int, kinds, parent) -> gauss.Scene:
    """Tree whose body i hangs on body ``parent(i, rng)``, −1 being the ground."""
    rng, scene = np.random.default_rng(seed), gauss.Scene(name)
    for i in range(n):
        kind, on = kinds[int(rng.integers(len(kinds)))], parent(i, rng)
        x, y, z = rng.uniform(0.02, 0.2, 3)
        scene.body(
            f"body{i}",
            mass=rng.uniform(0.5, 3.0),
            inertia=(y + z, x + z, x + y),
            com=rng.uniform(-0.3, 0.3, 3),
            inertia_axes=rng.uniform(-1, 1, 3),
            on="ground" if on < 0 else f"body{on}",
            position=rng.uniform(-0.5, 0.5, 3),
            rotation=rng.uniform(-1, 1, 3),
        )
        options = {} if kind in ("ball", "free", "fixed") else {"axis": rng.standard_normal(3)}
        if kind == "screw":
            options["pitch"] = rng.uniform(0.05, 0.3)
        at = rng.uniform(-0.1, 0.1, 3)
        scene.joint(f"joint{i}", kind, "ground" if on < 0 else f"body{on}", f"body{i}", at=at, frame=f"body{i}", **options)
    return scene
