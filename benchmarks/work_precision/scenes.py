"""The scenes, how long they move, and where their references come from."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import gauss
from benchmarks.speed.arms import FINGERS
from gauss import math
from gauss.system import random_state


class NotBuiltError(Exception):
    """A scene has something that is not built in another engine here."""


@dataclass(frozen=True)
class TimedScene:
    """A scene to be moved."""

    name: str  # what it is called
    make: Callable  # () → Scene
    duration: float  # how long [s]
    windows: int = 0  # windows of a ladder, 0 for other scenes


def _panda() -> gauss.Scene:
    """Panda, let go in a random posture."""
    free = gauss.load("robot:panda", mimic=False)
    scene = gauss.Scene("Panda", free.gravity)
    for body in free.bodies.values():
        scene.add(body)
    for joint in free.joints.values():
        scene.add(replace(joint, kind="fixed", axis=(0.0, 0.0, 1.0)) if joint.name in FINGERS else joint)
    system = gauss.compile_scene(scene)
    start = random_state(system, np.random.default_rng(0)).q
    for joint in system.joints:
        if joint.pair.n_v:
            scene.start(joint.name, start[joint.q][0])
    return scene


def driven_ur5(stiffness: float = 100.0, damping: float = 4.0) -> gauss.Scene:
    """UR5 whose drives follow sines of 0.5 Hz by feedback of position and rate."""
    scene = gauss.load("robot:ur5")
    for k, joint in enumerate(scene.joints.values()):
        if joint.pair.n_v == 1:
            scene.drive(joint.name, torque=_following(joint.name, 0.4 * (-1) ** k, stiffness, damping))
            scene.start(joint.name, position=-0.3 if "shoulder_lift" in joint.name else 0.1)
    return scene


def _following(joint: str, amplitude: float, stiffness: float, damping: float):
    def torque(t, motion):
        return stiffness * (amplitude * math.sin(np.pi * t) - motion.coordinate(joint)) - damping * motion.rate(joint)

    return torque


CASES = (
    TimedScene("Panda, free swing", _panda, 1.0),
    TimedScene("UR5 with PD drives", driven_ur5, 2.0),
    TimedScene("double pendulum", lambda: gauss.load("double_pendulum"), 3.0),
    TimedScene("spatial double pendulum", lambda: gauss.load("spatial_double_pendulum"), 2.0),
    TimedScene("chain of 10 links", lambda: gauss.load("n_pendulum", n=10), 1.0),
    TimedScene("heavy top", lambda: gauss.load("heavy_top"), 2.0),
    TimedScene("rolling disk", lambda: gauss.load("rolling_disk"), 2.0),
    TimedScene("four-bar", lambda: gauss.load("four_bar"), 1.0),
    TimedScene("slider-crank", lambda: gauss.load("slider_crank"), 1.0),
    TimedScene("four-bar ladder, N = 1 (A02)", lambda: gauss.load("n_four_bar", n=1), 10.0, 1),
    TimedScene("four-bar ladder, N = 10 (A02)", lambda: gauss.load("n_four_bar", n=10), 10.0, 10),
    TimedScene("Andrews' squeezer (A03)", lambda: gauss.load("andrews_squeezer"), 0.03),
    TimedScene("Bricard (A04)", lambda: gauss.load("bricard"), 2.0),
    TimedScene("flyball governor (A05)", lambda: gauss.load("flyball_governor"), 1.0),
)
