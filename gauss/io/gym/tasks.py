"""Tasks that are ready: cart-pole swing-up, acrobot, four-bar press; their functions have names, so that they pickle."""

from functools import partial

import numpy as np

from gauss.io import load
from gauss.io.gym.task import Task
from gauss.scene import Scene


def cart_pole_swing_up(force: float = 20.0, track: float = 3.0) -> Task:
    """Swing up a pole that hangs on a cart, and balance it.

    Parameters
    ----------
    force : float
        Largest force on the cart [N].
    track : float
        Distance from the middle of the rail at which an episode ends [m].
    """
    scene = load("cart_pole")
    scene.start("pin", np.pi)
    scene.input("push", "rail", limits=force)
    scene.output("cart", "coordinate", "rail")
    scene.output("tip", "position", "pole", at=(0.0, 0.0, 0.6))
    scene.output("speed", "rate", "rail")
    scene.output("turn", "rate", "pin")

    return Task(scene, partial(_balanced, force), partial(_beyond, track))


def _balanced(force: float, q, v, u, y):
    return np.cos(q[..., 1]) - 0.05 * q[..., 0] ** 2 - 1e-3 * (u[..., 0] / force) ** 2


def _beyond(track: float, q, v, u, y):
    return np.abs(q[..., 0]) > track


def acrobot(torque: float = 10.0) -> Task:
    """Swing a double pendulum up by a torque at its elbow.

    Parameters
    ----------
    torque : float
        Largest torque [N m].

    Examples
    --------
    >>> from gauss.gym import acrobot
    >>> task = acrobot(torque=10.0)
    >>> task.action_space
    Box(-10.0, 10.0, (1,), float64)
    """
    scene = load("double_pendulum")
    for joint in ("A", "B"):
        scene.start(joint, -0.5 * np.pi if joint == "A" else 0.0)
    scene.input("elbow", "B", limits=torque)
    scene.output("elbow", "position", "lower")
    scene.output("tip", "position", "lower", at=(1.0, 0.0, 0.0))
    for joint in ("A", "B"):
        scene.output(f"rate of {joint}", "rate", joint)

    return Task(scene, partial(_height, torque))


def _height(torque: float, q, v, u, y):
    return 0.5 * y["tip"][..., 1] - 1e-3 * (u[..., 0] / torque) ** 2


def four_bar_press(torque: float = 200.0, speed: float = 10.0, stiffness: float = 50.0) -> Task:
    """Keep the crank of a four-bar linkage at a speed while its rocker presses a spring.

    Parameters
    ----------
    torque : float
        Largest torque at the crank [N m].
    speed : float
        Speed of the crank [rad/s].
    stiffness : float
        Stiffness of the workpiece, at the bearing of the rocker [N m/rad].

    Examples
    --------
    >>> from gauss.gym import four_bar_press
    >>> list(four_bar_press().scene.inputs)
    ['motor']
    """
    scene: Scene = load("four_bar")
    scene.joint_spring("workpiece", "D", stiffness=stiffness, damping=0.02 * stiffness)
    scene.input("motor", "A", limits=torque)
    for kind in ("coordinate", "rate"):
        for joint in ("A", "D"):
            scene.output(f"{kind} of {joint}", kind, joint)

    return Task(scene, partial(_regularity, torque, speed), duration=4.0)


def _regularity(torque: float, speed: float, q, v, u, y):
    return -(((v[..., 0] - speed) / speed) ** 2) - 1e-2 * (u[..., 0] / torque) ** 2
