"""Families of scenes with the size as an argument."""

import numpy as np

import gauss
from gauss.errors import SceneError
from gauss.rotations import from_rpy

__all__ = [
    "andrews_squeezer",
    "delta_robot",
    "flyball_governor",
    "four_bar_branch",
    "hung_chain",
    "mass_ratio_chain",
    "n_four_bar",
    "n_pendulum",
    "parallel_chains",
    "random_tree",
    "rotor_branch",
    "spatial_chain",
    "spatial_double_pendulum",
    "stewart_platform",
]

KINDS = ("revolute", "prismatic", "fixed", "free", "cylindrical", "universal", "ball", "planar", "screw")


def n_pendulum(n: int = 3, mass: float = 1.0, length: float = 1.0) -> gauss.Scene:
    """Chain of n uniform rods in the x-y plane, hanging from the ground, released from the horizontal.

    ::

        ground o-----o-----o-----   →  swings down
               J1    J2    J3
    """
    _at_least_one(n)
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
    _at_least_one(n)
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


def hung_chain(n: int = 10, mass: float = 1.0, length: float = 10.0) -> gauss.Scene:
    """Chain of n equal rods hung at both ends, at rest on half a circle: one loop, however long.

    Parameters
    ----------
    n : int
        Number of rods.
    mass, length : float
        Of the whole chain [kg, m].
    """
    _at_least_one(n)
    scene = gauss.Scene(f"hung chain of {n}", gravity=(0, -9.81, 0))
    angles = np.linspace(-np.pi, 0.0, n + 1)
    points = length / n / (2.0 * np.sin(np.pi / (2 * n))) * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    own, rod, moment = mass / n, length / n, mass / n * (length / n) ** 2 / 12
    for i in range(n):
        along = points[i + 1] - points[i]
        turn = (0, 0, np.arctan2(along[1], along[0]))
        scene.body(f"link{i}", own, (0, moment, moment), com=(rod / 2, 0, 0), position=points[i], rotation=turn)
        scene.revolute(f"joint{i}", f"link{i - 1}" if i else "ground", f"link{i}", at=points[i])
    scene.revolute(f"joint{n}", f"link{n - 1}", "ground", at=points[n])
    return scene


def spatial_chain(n: int = 10, seed: int = 0) -> gauss.Scene:
    """Chain of n bodies with random inertias on hinges with random axes."""
    return _grow(f"spatial chain of {n}", n, seed, ("revolute",), lambda i, rng: i - 1)


def random_tree(n: int = 10, seed: int = 0, kinds=KINDS) -> gauss.Scene:
    """Tree of n bodies with random parents, inertias, frames and kinds of joints."""
    return _grow(f"random tree of {n}", n, seed, tuple(kinds), lambda i, rng: int(rng.integers(-1, i)))


def mass_ratio_chain(n: int = 10, ratio: float = 1e6) -> gauss.Scene:
    """Chain of n rods of 1 m, axes z, x, y in turn; masses grow geometrically from 1 kg to the given ratio."""
    _at_least_one(n)
    scene, previous = gauss.Scene(f"chain with mass ratio {ratio:g}"), "ground"
    for i in range(n):
        mass = ratio ** (i / max(n - 1, 1))
        place = {"on": previous, "position": (1.0 if i else 0.0, 0, 0)}
        scene.body(f"link{i}", mass, (0.02 * mass, mass / 12, mass / 12), com=(0.5, 0, 0), **place)
        axis = ((0, 0, 1), (1, 0, 0), (0, 1, 0))[i % 3]
        scene.revolute(f"joint{i}", previous, f"link{i}", axis=axis, frame=f"link{i}")
        previous = f"link{i}"
    return scene


def four_bar_branch(n: int = 3, root: str = "free") -> gauss.Scene:
    """Base with a branch of n four-bars, each on the rocker of the one before, its plane turned by a right angle.

    The base floats, or stands with ``root="fixed"``. Loops in planes of their own: two rows each, three are redundant.
    """
    _at_least_one(n)
    scene, carrier = gauss.Scene(f"branch of {n} four-bars"), "base"
    scene.body("base", 5.0, (0.1, 0.1, 0.1))
    scene.joint("base joint", "free" if root == "free" else "fixed", "ground", "base")
    coupler = np.hypot(0.4, 0.1)
    for i in range(1, n + 1):
        turn, foot = (np.pi / 2, 0.0, 0.0), np.array([0.3 if i > 1 else 0.0, 0.0, 0.0])
        R = from_rpy(*turn)
        upright = R @ from_rpy(0, 0, np.pi / 2)
        scene.body(f"crank{i}", **_rod(0.2), on=carrier, position=foot, rotation=upright)
        scene.revolute(f"A{i}", carrier, f"crank{i}", frame=f"crank{i}")
        scene.body(f"rocker{i}", **_rod(0.3), on=carrier, position=foot + R @ [0.4, 0.0, 0.0], rotation=upright)
        scene.revolute(f"D{i}", carrier, f"rocker{i}", frame=f"rocker{i}")
        lean = (0, 0, np.arctan2(0.1, 0.4) - np.pi / 2)
        scene.body(f"coupler{i}", **_rod(coupler), on=f"crank{i}", position=(0.2, 0, 0), rotation=lean)
        scene.revolute(f"B{i}", f"crank{i}", f"coupler{i}", frame=f"coupler{i}")
        scene.revolute(f"C{i}", f"coupler{i}", f"rocker{i}", at=(0.3, 0, 0), frame=f"rocker{i}")
        carrier = f"rocker{i}"
    return scene


def rotor_branch(n: int = 3, ratio: float = 6.0, root: str = "free") -> gauss.Scene:
    """Base with a branch of n links, each with a geared rotor on the link before, axes x and y in turn.

    The base floats, or stands with ``root="fixed"``; a rotor turns ``ratio`` times as fast as its link.
    """
    _at_least_one(n)
    scene, carrier = gauss.Scene(f"branch of {n} links with rotors"), "base"
    scene.body("base", 5.0, (0.1, 0.1, 0.1))
    scene.joint("base joint", "free" if root == "free" else "fixed", "ground", "base")
    for i in range(1, n + 1):
        axis, foot = (1, 0, 0) if i % 2 else (0, 1, 0), (0, 0, -0.3 if i > 1 else 0.0)
        scene.body(f"link{i}", 0.8, (0.006, 0.006, 0.0005), com=(0, 0, -0.15), on=carrier, position=foot)
        scene.body(f"rotor{i}", 0.2, (1e-4, 1e-4, 1e-4), on=carrier, position=foot)
        for name in (f"link{i}", f"rotor{i}"):
            scene.revolute(f"{name} joint", carrier, name, frame=name, axis=axis)
        scene.couple(f"gear{i}", f"rotor{i} joint", f"link{i} joint", ratio)
        carrier = f"link{i}"
    return scene


def parallel_chains(depth: int = 5, rung: int = 2, belt: bool = False) -> gauss.Scene:
    """Two chains of ``depth`` links side by side, tied at one height: by a rod, or by a belt.

    Parameters
    ----------
    depth : int
        Links of each chain, 5 to 40 and more.
    rung : int
        Links below the tie, of each chain.
    belt : bool
        Whether a belt keeps these links of both chains at one direction (a sum of coordinates), instead of a rod between
        them (a loop).
    """
    _at_least_one(rung)
    if rung > depth:
        raise SceneError(f"rung: expected 1 to {depth}, the depth, got {rung}.")
    scene = gauss.Scene(f"parallel chains of {depth}", gravity=(0, -9.81, 0))
    for chain, side in ((1, 0.0), (2, 1.3)):
        previous = "ground"
        for i in range(1, depth + 1):
            name, place = f"link {chain}.{i}", (side if i == 1 else 1.0, 0, 0)
            scene.body(name, **_rod(1.0), on=previous, position=place, rotation=(0, 0, -1.2 if i == 1 else 0.1))
            scene.revolute(f"joint {chain}.{i}", previous, name, frame=name)
            previous = name
    if belt:
        terms = {f"joint {chain}.{i}": 1.0 if chain == 1 else -1.0 for chain in (1, 2) for i in range(1, rung + 1)}
        scene.linear_coupling("belt", terms)
        return scene
    turned = 1.2 - 0.1 * (rung - 1)
    scene.body("rod", **_rod(1.3), on=f"link 1.{rung}", position=(1.0, 0, 0), rotation=(0, 0, turned))
    scene.revolute("rod joint", f"link 1.{rung}", "rod", frame="rod")
    scene.revolute("tie", "rod", f"link 2.{rung}", frame="rod", at=(1.3, 0, 0))
    return scene


def _rod(length: float) -> dict:
    """Uniform rod along x, of 1 kg/m."""
    moment = length**3 / 12
    return {"mass": length, "inertia": (1e-3 * length, moment, moment), "com": (length / 2, 0, 0)}


def stewart_platform(
    base: float = 1.0, top: float = 0.6, height: float = 1.0, stiffness: float = 4000.0, n: int = 1
) -> gauss.Scene:
    """Platform on six legs with springs, each a Cardan joint at the base, a slider, and a ball joint at the platform.

    The legs lead in turn to the three corners of the platform; "leg1" … "leg6" are the sliders. Of ``n`` platforms each
    stands on the one below; those of the second are "leg2.1" … "leg2.6".
    """
    scene, below = gauss.Scene("Stewart platform" if n == 1 else f"{n} Stewart platforms"), "ground"
    foot_angles = np.deg2rad([-10, 10, 110, 130, 230, 250])
    head_angles = np.deg2rad([-50, 50, 70, 170, 190, 290])
    for stage in range(n):
        prefix, floor = (f"{stage + 1}." if stage else ""), np.array([0.0, 0.0, stage * height])
        platform = f"platform{prefix[:-1]}"
        for k, (foot_angle, head_angle) in enumerate(zip(foot_angles, head_angles, strict=True), start=1):
            foot = floor + base * np.array([np.cos(foot_angle), np.sin(foot_angle), 0.0])
            head = floor + np.array([top * np.cos(head_angle), top * np.sin(head_angle), height])
            leg = (head - foot) / np.linalg.norm(head - foot)
            R = _frame(leg, np.cross([0.0, 0.0, 1.0], leg))
            leg_names = (f"{part}{prefix}{k}" for part in ("cylinder", "rod", "foot", "leg", "head", "spring"))
            cylinder, rod, foot_joint, slider, head_joint, spring = leg_names
            turned = {"position": foot, "rotation": R}
            scene.body(cylinder, 2.0, (0.03, 0.03, 0.002), com=(0, 0, 0.25), **turned)
            scene.body(rod, 1.0, (0.015, 0.015, 0.0005), com=(0, 0, np.linalg.norm(head - foot) - 0.25), **turned)
            if k == 1:
                scene.body(platform, 20.0, (0.8, 0.8, 1.5), position=floor + (0, 0, height))
            scene.universal(foot_joint, below, cylinder, at=foot, axis=R[:, 0], second_axis=R[:, 1])
            scene.prismatic(slider, cylinder, rod, at=foot, axis=leg)
            scene.ball(head_joint, rod, platform, at=head)
            scene.joint_spring(spring, slider, stiffness=stiffness)
        below = platform
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


def andrews_squeezer() -> gauss.Scene:
    """Andrews' squeezing mechanism: seven bodies, three loops that meet in E, a constant torque on K1; IFToMM benchmark A03.

    Data and angles β, Θ, γ, Φ, δ, Ω, ε of Hairer and Wanner, Solving ODEs II, VII.7. Joint coordinates count from the start:
    "O" from β, "P" from Θ, "B" from γ, "G" from Φ, "A5" from δ, "H" from Ω, "A7" from ε. ::

        O --K1-- P --K2-- E --K3-- B ~~spring~~ C
                          E --K4-- G --K5-- A
                          E --K6-- H --K7-- A
    """
    beta, theta, gamma, phi, delta, omega, epsilon = (
        -0.06171389001427645,
        0.0,
        0.45527981916307037,
        0.22266839016588588,
        0.48736497954384256,
        -0.22266839016588588,
        1.2305474445498212,
    )
    scene = gauss.Scene("Andrews' squeezer", gravity=(0, 0, 0))
    points = {"O": np.zeros(3), "A": np.array([-0.06934, -0.00227, 0]), "B": np.array([-0.03635, 0.03273, 0])}
    bodies = {  # name: (where its frame is, angle, mass, moment of inertia, centre of mass, further points)
        "K1": ("O", beta, 0.04325, 2.194e-6, (0.00092, 0), {"P": (0.007, 0)}),
        "K2": ("P", beta + theta, 0.00365, 4.410e-7, (-0.0115, 0), {"E": (-0.028, 0)}),
        "K3": ("B", gamma, 0.02373, 5.255e-6, (0.01043, -0.01874), {}),
        "K5": ("A", delta, 0.07050, 1.169e-5, (0.02308, 0.00916), {"G": (0.04, 0)}),
        "K4": ("G", phi + delta, 0.00706, 5.667e-7, (0, 0.01421 - 0.02), {}),
        "K7": ("A", epsilon, 0.05498, 1.912e-5, (-0.00449, -0.01228), {"H": (0, -0.04)}),
        "K6": ("H", omega + epsilon, 0.00706, 5.667e-7, (0.02 - 0.01421, 0), {}),
    }
    for name, (point, angle, mass, inertia, com, further) in bodies.items():
        scene.body(name, mass, (0, 0, inertia), com=(*com, 0), position=points[point], rotation=(0, 0, angle))
        c, s = np.cos(angle), np.sin(angle)
        points |= {key: points[point] + (c * x - s * y, s * x + c * y, 0) for key, (x, y) in further.items()}
    pins = {
        "O": "ground K1",
        "P": "K1 K2",
        "B": "ground K3",
        "A5": "ground K5",
        "G": "K5 K4",
        "A7": "ground K7",
        "H": "K7 K6",
    }
    for name, pair in (pins | {"E3": "K2 K3", "E4": "K2 K4", "E6": "K2 K6"}).items():
        scene.revolute(name, *pair.split(), at=points[name if name in points else name[0]])
    scene.spring("spring", "K3", "ground", (0.02, -0.018, 0), (0.014, 0.072, 0), stiffness=4530.0, length=0.07785)
    scene.drive("O", torque=0.033)
    return scene


def flyball_governor(stiffness: float = 8e5, damping: float = 4e4) -> gauss.Scene:
    """Watt's governor with springs and dampers for coupler rods, spinning at 2π rad/s: the stiff IFToMM benchmark A05.

    Two rods of 1 m are hinged to the top of the shaft, 0.1 m apart and 30° below the horizontal, with point masses of 5 kg
    at their ends; springs lead from their middles to the sides of the slider, a block of 0.1 m, 0.5 m below the top.
    """
    scene = gauss.Scene("flyball governor", gravity=(0, 0, -9.81))
    rod, ball, slider, side = 3000 * 1.0 * 0.01**2, 5.0, 3000 * 0.1**3, 0.05
    across, along, block = rod * (2 * 0.01**2) / 12, rod * (1.0 + 0.01**2) / 12, slider * 2 * 0.1**2 / 12
    scene.body("shaft", rod, (along, along, across), com=(0, 0, -0.5))
    scene.revolute("spin", "ground", "shaft")
    scene.body("slider", slider, (block, block, block), position=(0, 0, -0.5))
    scene.prismatic("slide", "shaft", "slider", at=(0, 0, -0.5), axis=(0, 0, 1))
    com = (rod * 0.5 + ball) / (rod + ball)
    moment = along + rod * (com - 0.5) ** 2 + ball * (1.0 - com) ** 2
    for name, sign, heading in (("left", -1, np.pi), ("right", 1, 0.0)):
        hinge, turned = (sign * side, 0, 0), (0, np.pi / 6, heading)
        scene.body(name, rod + ball, (across, moment, moment), com=(com, 0, 0), position=hinge, rotation=turned)
        scene.revolute(f"{name} hinge", "shaft", name, at=hinge, axis=(0, sign, 0))
        scene.spring(f"{name} coupler", name, "slider", (0.5, 0, 0), hinge, stiffness=stiffness, damping=damping, length=0.5)
    scene.start("spin", rate=2 * np.pi)
    return scene


def spatial_double_pendulum() -> gauss.Scene:
    """Two rods of 1 kg and 1 m on ball joints, unlike in all directions, thrown from the horizontal."""
    scene = gauss.Scene("spatial double pendulum")
    rod = {"mass": 1.0, "inertia": (0.02, 0.08, 0.09), "com": (0.5, 0, 0)}
    scene.body("upper", **rod)
    scene.body("lower", **rod, position=(1, 0, 0))
    scene.ball("A", "ground", "upper")
    scene.ball("B", "upper", "lower", at=(1, 0, 0))
    scene.start("A", rate=(0.5, 0.0, 2.0))
    scene.start("B", rate=(0.0, 1.0, -1.0))
    return scene


def _frame(z, x) -> np.ndarray:
    """Rotation whose third column is z, its first along x, made perpendicular to z."""
    x = x - z * (z @ x)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _at_least_one(n: int):
    if n < 1:
        raise SceneError(f"n = {n}, which is the number of bodies or loops, must be at least 1.")


def _grow(name: str, n: int, seed: int, kinds, parent) -> gauss.Scene:
    """Tree whose body i hangs on body ``parent(i, rng)``, −1 being the ground."""
    _at_least_one(n)
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
