"""Motions known in closed form, each as a scene: a pendulum, a free body, a four-bar."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ellipj, ellipk

import gauss


@dataclass(frozen=True)
class ClosedForm:
    """A scene, what is seen of its motion (k, m), and what that is at a time (m,)."""

    scene: gauss.Scene
    duration: float
    observe: Callable
    exact: Callable


def pendulum(start: float = 2.0) -> ClosedForm:
    """Point mass on a massless bar of 1 m, let go at an angle [rad] (Whittaker, Analytical Dynamics, §44)."""
    scene = gauss.Scene("pendulum", gravity=(0, 0, -9.81))
    scene.body("bob", mass=1.0, com=(0, 0, -1.0))
    scene.revolute("A", "ground", "bob", axis=(0, 1, 0))
    scene.start("A", start)
    k, omega = np.sin(start / 2), np.sqrt(9.81)

    def exact(t):
        sn, cn, dn, _ = ellipj(ellipk(k**2) - omega * t, k**2)
        return np.array([2.0 * np.arcsin(k * sn), -2.0 * k * omega * cn])

    return ClosedForm(scene, 1.0, lambda motion: np.concatenate([motion.q, motion.v], axis=1), exact)


def symmetric_body() -> ClosedForm:
    """Free symmetric body, spinning: it precesses steadily about its angular momentum (Landau, Lifshitz, Mechanics, §33)."""
    J, J3, spin, across, speed = 2.0, 1.0, 3.0, 1.0, np.array([0.1, -0.2, 0.3])
    scene = gauss.Scene("body", gravity=(0, 0, 0))
    scene.body("body", 1.0, (J, J, J3))
    scene.free("F", "ground", "body")
    scene.start("F", rate=(*speed, across, 0.0, spin))
    momentum = np.array([J * across, 0.0, J3 * spin])
    rate = np.linalg.norm(momentum) / J
    axis, own = momentum / np.linalg.norm(momentum), (J - J3) / J * spin

    def quaternion(vector):
        half = np.linalg.norm(vector) / 2
        return np.array([np.cos(half), *(vector * np.sinc(half / np.pi) / 2)])

    def exact(t):
        from gauss.rotations import multiply

        turned = multiply(quaternion(rate * t * axis), quaternion(np.array([0.0, 0.0, own * t])))
        omega = np.array([across * np.cos(own * t), -across * np.sin(own * t), spin])
        return np.concatenate([speed * t, turned, speed, omega])

    def observe(motion):
        sign = np.where(motion.q @ np.append(np.zeros(3), exact(motion.t[-1])[3:7]) < 0, -1.0, 1.0)
        q = motion.q.copy()
        q[:, 3:] *= sign[:, None]
        return np.concatenate([q, motion.v[:, :3], motion.v[:, 3:]], axis=1)

    return ClosedForm(scene, 1.0, observe, exact)


def parallelogram(start: float = 0.8) -> ClosedForm:
    """Parallelogram of uniform rods, hanging from two cranks of 1 m and a coupler of 2 m: a pendulum of one freedom."""
    g = 9.81
    scene = gauss.Scene("parallelogram", gravity=(0, 0, -g))
    for name, x in (("left", 0.0), ("right", 2.0)):
        scene.body(name, 1.0, (1 / 12, 1 / 12, 0.001), com=(0, 0, -0.5), position=(x, 0, 0))
        scene.revolute(f"{name} pivot", "ground", name, at=(x, 0, 0), axis=(0, 1, 0))
    scene.body("coupler", 1.0, (0.001, 1 / 3, 1 / 3), com=(1.0, 0, 0), position=(0, 0, -1))
    scene.revolute("B", "left", "coupler", at=(0, 0, -1), axis=(0, 1, 0))
    scene.revolute("C", "coupler", "right", at=(2, 0, -1), axis=(0, 1, 0))
    scene.start("left pivot", start)
    scene.start("right pivot", start)
    scene.start("B", -start)
    k, omega = np.sin(start / 2), np.sqrt(g * (2 * 0.5 + 1.0) / (2 / 3 + 1.0))

    def exact(t):
        sn, cn, dn, _ = ellipj(ellipk(k**2) - omega * t, k**2)
        angle, rate = 2.0 * np.arcsin(k * sn), -2.0 * k * omega * cn
        return np.array([angle, angle, rate, rate])

    def observe(motion):
        both = [motion.coordinate("left pivot"), motion.coordinate("right pivot")]
        return np.stack([*both, motion.rate("left pivot"), motion.rate("right pivot")], axis=1)

    return ClosedForm(scene, 1.0, observe, exact)


SCENES = {"pendulum": pendulum, "free body": symmetric_body, "loop": parallelogram}
