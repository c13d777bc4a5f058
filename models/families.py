"""Families of scenes with the size as an argument."""

import numpy as np

import gauss

__all__ = [
    "delta_robot",
    "mass_ratio_chain",
    "n_four_bar",
    "n_pendulum",
    "random_tree",
    "spatial_chain",
    "stewart_platform",
]

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


def stewart_platform(base: float = 1.0, top: float = 0.6, height: float = 1.0, stiffness: float = 4000.0) -> gauss.Scene:
    """Platform on six legs with springs, each a Cardan joint at the base, a slider, and a ball joint at the platform.

    The legs lead in turn to the three corners of the platform; "leg1" … "leg6" are the sliders.
    """
    scene = gauss.Scene("Stewart platform")
    foot_angles = np.deg2rad([-10, 10, 110, 130, 230, 250])
    head_angles = np.deg2rad([-50, 50, 70, 170, 190, 290])
    for k, (foot_angle, head_angle) in enumerate(zip(foot_angles, head_angles, strict=True), start=1):
        foot = base * np.array([np.cos(foot_angle), np.sin(foot_angle), 0.0])
        head = np.array([top * np.cos(head_angle), top * np.sin(head_angle), height])
        leg = (head - foot) / np.linalg.norm(head - foot)
        R = _frame(leg, np.cross([0.0, 0.0, 1.0], leg))
        turned = {"position": foot, "rotation": R}
        scene.body(f"cylinder{k}", 2.0, (0.03, 0.03, 0.002), com=(0, 0, 0.25), **turned)
        scene.body(f"rod{k}", 1.0, (0.015, 0.015, 0.0005), com=(0, 0, np.linalg.norm(head - foot) - 0.25), **turned)
        if k == 1:
            scene.body("platform", 20.0, (0.8, 0.8, 1.5), position=(0, 0, height))
        scene.universal(f"foot{k}", "ground", f"cylinder{k}", at=foot, axis=R[:, 0], second_axis=R[:, 1])
        scene.prismatic(f"leg{k}", f"cylinder{k}", f"rod{k}", at=foot, axis=leg)
        scene.ball(f"head{k}", f"rod{k}", "platform", at=head)
        scene.joint_spring(f"spring{k}", f"leg{k}", stiffness=stiffness)
    return scene


def delta_robot(
    base: float = 0.2, arm: float = 0.25, forearm: float = 0.5, platform: float = 0.05, width: float = 0.1
) -> gauss.Scene:
    """Delta robot: three arms on hinges "hip1" … "hip3", each with a parallelogram of two rods to the platform.

    Rods have a Cardan joint at the arm and a ball joint at the platform, which therefore does not turn. The arms are
    horizontal at the reference configuration, where the platform is at depth √(forearm² − (base + arm − platform)²).
    """
    scene = gauss.Scene("delta robot")
    depth = np.sqrt(forearm**2 - (base + arm - platform) ** 2)
    rod_moment = 0.1 * forearm**2 / 12
    for i in (1, 2, 3):
        angle = 2 * np.pi * (i - 1) / 3
        out, across = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
        scene.body(f"arm{i}", 0.4, (2e-4, 2e-3, 2e-3), com=(arm / 2, 0, 0), position=base * out, rotation=(0, 0, angle))
        if i == 1:
            scene.body("platform", 0.5, (5e-4, 5e-4, 1e-3), position=(0, 0, -depth))
        scene.revolute(f"hip{i}", "ground", f"arm{i}", at=base * out, axis=across)
        for side, offset in (("a", -width / 2), ("b", width / 2)):
            elbow, wrist = (base + arm) * out + offset * across, platform * out + offset * across - depth * np.eye(3)[2]
            R = _frame((wrist - elbow) / forearm, across)
            scene.body(
                f"rod{i}{side}", 0.1, (rod_moment, rod_moment, 1e-5), com=(0, 0, forearm / 2), position=elbow, rotation=R
            )
            scene.universal(f"elbow{i}{side}", f"arm{i}", f"rod{i}{side}", at=elbow, axis=across, second_axis=R[:, 1])
            scene.ball(f"wrist{i}{side}", f"rod{i}{side}", "platform", at=wrist)
    return scene


def _frame(z, x) -> np.ndarray:
    """Rotation whose third column is z, its first along x, made perpendicular to z."""
    x = x - z * (z @ x)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


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
