"""Mechanisms that several tests use, built in code."""

import json
from pathlib import Path

import numpy as np

import gauss
from gauss import rotations
from gauss.dynamics.assemble import position_residual
from gauss.system import random_state

REFERENCE = Path(__file__).parents[1] / "reference"

SLENDER = (0.0, 1.0 / 12.0, 1.0 / 12.0)  # inertia of a uniform rod of 1 kg and 1 m along x


def reference(name: str) -> dict:
    """Reference solution by name; its source is named inside."""
    return json.loads((REFERENCE / f"{name}.json").read_text())


def two_bodies(kind: str, seed: int = 0) -> gauss.Scene:
    """Two bodies in skew positions on two joints of one kind."""
    rng = np.random.default_rng(seed)
    scene = gauss.Scene(f"two {kind}")
    for name in ("a", "b"):
        scene.body(
            name,
            mass=rng.uniform(0.5, 2.0),
            inertia=inertia(rng),
            com=rng.normal(size=3),
            inertia_axes=rng.normal(size=3),
            position=rng.normal(size=3),
            rotation=rng.normal(size=3),
        )
    for name, parent, child in (("A", "ground", "a"), ("B", "a", "b")):
        axis = {} if kind in ("ball", "free", "fixed") else {"axis": rng.normal(size=3)}
        pitch = {"pitch": 0.3} if kind == "screw" else {}
        scene.joint(name, kind, parent, child, at=rng.normal(size=3), **axis, **pitch)
    return scene


def inertia(rng) -> tuple[float, float, float]:
    """Random principal moments that satisfy the triangle inequality [kg m²]."""
    x, y, z = rng.uniform(0.05, 0.5, 3)
    return y + z, x + z, x + y


def four_bar(order: str = "ABCD", twice: bool = False) -> gauss.Scene:
    """Crank-rocker of spatial revolute joints named in a given order; the last of them is cut, ``twice`` doubles it."""
    x = (0.8**2 + 1.0 - 0.49) / (2 * 0.8)  # coupler 1 m from B (0.4, 0), rocker 0.7 m from D (1.2, 0)
    C = np.array([0.4 + x, np.sqrt(1.0 - x * x), 0.0])
    scene = gauss.Scene("four-bar", gravity=(0, -9.8, 0))
    scene.body("crank", 1.2, (0.001, 0.016, 0.016), com=(0.2, 0, 0))
    turned = (0, 0, np.arctan2(C[1], x))
    scene.body("coupler", 3.0, (0.002, 0.25, 0.25), com=(0.5, 0, 0), position=(0.4, 0, 0), rotation=turned)
    turned = (0, 0, np.arctan2(C[1], C[0] - 1.2))
    scene.body("rocker", 2.2, (0.001, 0.09, 0.09), com=(0.35, 0, 0), position=(1.2, 0, 0), rotation=turned)
    joints = {
        "A": ("ground", "crank", (0, 0, 0)),
        "B": ("crank", "coupler", (0.4, 0, 0)),
        "C": ("coupler", "rocker", C),
        "D": ("ground", "rocker", (1.2, 0, 0)),
    }
    for name in order:
        parent, child, at = joints[name]
        scene.revolute(name, parent, child, at=at)
    if twice:
        parent, child, at = joints[order[-1]]
        scene.revolute("again", parent, child, at=at)
    scene.start("A", rate=10.0)
    return scene


def chain(masses) -> gauss.Scene:
    """Spatial chain of rods of 1 m with given masses, axes z, x, y in turn; all constant frames are exact."""
    scene = gauss.Scene("chain")
    previous = "ground"
    for i, mass in enumerate(masses):
        name = f"link{i}"
        moments = tuple(mass * np.array([0.02, 1 / 12, 1 / 12]))
        scene.body(name, mass, moments, com=(0.5, 0, 0), on=previous, position=(1.0 if i else 0.0, 0, 0))
        axis = ((0, 0, 1), (1, 0, 0), (0, 1, 0))[i % 3]
        scene.revolute(f"joint{i}", previous, name, axis=axis, frame=name)
        previous = name
    return scene


def rods(count: int) -> gauss.Scene:
    """Pendulum of uniform rods in the plane, as in the reference files; joint 1 from the x-axis."""
    scene = gauss.Scene("rods", gravity=(0, -9.81, 0))
    previous = "ground"
    for i in range(count):
        name = f"rod{i + 1}"
        scene.body(name, 1.0, SLENDER, com=(0.5, 0, 0), on=previous, position=(1.0 if i else 0.0, 0, 0))
        scene.revolute(f"J{i + 1}", previous, name, frame=name)
        previous = name
    return scene


def rod_angles(trajectory) -> np.ndarray:
    """Absolute angles of the rods from the downward vertical (k, n)."""
    return np.cumsum(trajectory.q, axis=1) + np.pi / 2


def start_angles(angles) -> np.ndarray:
    """Joint coordinates of rods with given absolute angles from the downward vertical."""
    return np.diff(np.array(angles), prepend=np.pi / 2)


def three_bodies(seed=0):
    """Three bodies in skew positions: two free, the third on a slider and a universal joint."""
    rng, scene = np.random.default_rng(seed), gauss.Scene("three", gravity=(0.3, -0.2, -9.81))
    for name in ("a", "b", "c"):
        pose = {"position": rng.normal(size=3), "rotation": rng.normal(size=3)}
        scene.body(name, rng.uniform(0.5, 2), inertia(rng), rng.normal(size=3), inertia_axes=rng.normal(size=3), **pose)
    scene.free("A", "ground", "a", at=rng.normal(size=3))
    scene.free("B", "ground", "b", at=rng.normal(size=3))
    scene.universal("C", "b", "c", at=rng.normal(size=3), axis=rng.normal(size=3))
    scene.frame("tip", "c", position=rng.normal(size=3), rotation=rng.normal(size=3))
    scene.body("slider", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("S", "a", "slider", axis=rng.normal(size=3))
    return scene


def largest_gap(motion) -> float:
    """By how much the samples of a motion are off the constraints."""
    return max(np.abs(position_residual(here)).max() for here in motion.motions)


def bennett(rate: float = 1.0):
    """Bennett's linkage: four hinges, links with a / sin α = b / sin β; mobile, three of six conditions being redundant.

    Returns
    -------
    scene : gauss.Scene
        It starts with all coordinates zero.
    relation : callable
        Trajectory → by how much angles miss tan(θ₁/2) tan(θ₂/2) = sin((α+β)/2) / sin((β−α)/2), θ₃ = −θ₁, θ₄ = −θ₂ [rad].
    """
    a, b, alpha, first = 1.0, 0.8, 0.9, 1.0
    beta = np.arcsin(b * np.sin(alpha) / a)
    ratio = np.sin((alpha + beta) / 2) / np.sin((beta - alpha) / 2)
    second = 2.0 * np.arctan(ratio / np.tan(first / 2))
    points, axes, R, p = [], [], np.eye(3), np.zeros(3)
    for theta, length, twist in zip((first, second, -first, -second), (a, b, a, b), (alpha, beta, alpha, beta), strict=True):
        points.append(p)
        axes.append(R[:, 2])
        R = R @ rotations.about_z(theta)
        p, R = p + length * R[:, 0], R @ rotations.about_x(twist)
    scene = gauss.Scene("Bennett", gravity=(0.3, -2.0, -9.81))
    links = ("one", "two", "three")
    for k, name in enumerate(links):
        half = (points[k + 1] - points[k]) / 2
        scene.body(name, mass=1.0 + 0.2 * k, inertia=(0.05 + 0.01 * k, 0.06, 0.07), com=half, position=points[k])
    for k, (parent, child) in enumerate((("ground", "one"), ("one", "two"), ("two", "three"), ("ground", "three"))):
        scene.revolute(f"J{k + 1}", parent, child, at=points[k], axis=axes[k])
    scene.start("J1", rate=rate)

    def relation(motion):
        one, two, three = (motion.coordinate(f"J{k}") for k in (1, 2, 3))
        missed = 2.0 * np.arctan(ratio / np.tan((first + one) / 2)) - second - two
        return np.concatenate([missed, one + three])

    return scene, relation


def ladder(n: int = 50):
    """System of n four-bars in a row."""
    return gauss.compile_scene(gauss.load("n_four_bar", n=n))


def platforms(count: int) -> gauss.Scene:
    """Stack of platforms, each on six legs with springs that stand on the one below."""
    return gauss.load("stewart_platform", n=count, stiffness=4e4)


def mass_matrix(system, q) -> np.ndarray:
    """Mass matrix of joint coordinates, column by column of the inverse dynamics."""
    still = np.zeros(system.n_v)
    bias = system.inverse_dynamics(q, still, still)
    return np.array([system.inverse_dynamics(q, still, unit) - bias for unit in np.eye(system.n_v)])


def consistent_states(system, count: int = 3):
    """States on the constraints near the reference, and random loads."""
    rng = np.random.default_rng(1)
    found = [random_state(system, rng, spread=0.2, slide=0.02) for _ in range(count)]
    return [system.initial_state(s.q, s.v, t=0.3) for s in found], rng.standard_normal((count, system.n_v))
