"""Spring between a point of a body and the pointer: F = k (goal − x) − c ẋ, with k = m ω², c = 2 ζ m ω.

m is the mass of the mechanism, but at most a multiple of the mass that it shows to a force at the point, which one step with
and without a force of 1 N gives: F is held over short spans, and a lighter point would bounce under it.
"""

import copy

import numpy as np

from gauss.dynamics.kinematics import kinematics
from gauss.rotations import AXIS_NAMES
from gauss.scene import Force, Input, Scene
from gauss.simulation import Simulator
from gauss.system import State

FREQUENCY = 12.0  # ω of the point on its spring [rad/s]
DAMPING = 0.7  # ζ
HEAVIEST = 20.0  # mass of the spring over that of the point: 2 ζ ω · 20 · 2 ms stays below 1
LEAST_ANSWER = 1e-9  # m/s in a step of 1 ms: a point that answers less does not move
WRENCH = 6  # inputs of a pull: force and moment


class BodyPull:
    """Pull at a point of a body.

    Parameters
    ----------
    simulator : Simulator
        Its inputs are a force at the centre of mass and a moment on the body, see :func:`pull_simulator`.
    point : ndarray, shape (3,)
        Where it is held, in the world [m].

    Attributes
    ----------
    goal : ndarray, shape (3,)
        Where the point is pulled to [m].
    """

    def __init__(self, simulator: Simulator, body: str, point: np.ndarray):
        self.system, self.body, self.goal = simulator.system, body, point
        at = kinematics(self.system, simulator.state)
        self.local = at.rotation(body).T @ (point - at.position(body))
        self.com = np.array(self.system.scene.bodies[body].com)
        self.mass = self._mass(simulator)

    def effort(self, state: State) -> np.ndarray:
        """Force [N] and moment about the centre of mass [N m], shape (6,), world axes."""
        at = kinematics(self.system, state)
        place = at.position(self.body, self.local)
        speed = at.velocity(self.body, self.local)
        force = self.mass * FREQUENCY * (FREQUENCY * (self.goal - place) - 2 * DAMPING * speed)
        return self._at_com(at, force)

    def _at_com(self, at, force: np.ndarray) -> np.ndarray:
        arm = at.rotation(self.body) @ (self.local - self.com)
        return np.concatenate([force, np.cross(arm, force)])

    def _mass(self, simulator: Simulator) -> float:
        """Mass that the spring is made for [kg]."""
        kept = simulator.snapshot()
        at = kinematics(self.system, simulator.state)
        speeds = []
        inputs = np.zeros(len(simulator.inputs))
        for force in np.vstack([np.zeros(3), np.eye(3)]):
            inputs[-WRENCH:] = self._at_com(at, force)
            simulator.step(inputs)
            speeds.append(kinematics(self.system, simulator.state).velocity(self.body, self.local))
            simulator.restore(kept)
        answer = np.abs(np.array(speeds[1:]) - speeds[0]).max()
        shown = simulator.step_size / max(float(answer), LEAST_ANSWER)
        return min(HEAVIEST * shown, sum(body.mass for body in self.system.scene.bodies.values()))


def pull_simulator(scene: Scene, body: str, step: float) -> Simulator:
    """Simulator of a scene with a force at the centre of mass of a body and a moment on it as its last six inputs."""
    pulled = copy.deepcopy(scene)
    units = [(axis, tuple(unit)) for axis, unit in zip(AXIS_NAMES, np.eye(3), strict=True)]
    loads = [Force(f"pull {axis}", body, force=unit) for axis, unit in units]
    loads += [Force(f"turn {axis}", body, moment=unit) for axis, unit in units]
    for load in loads:
        pulled.add(Input(load.name, (), forces=(load,)))
    return Simulator(pulled, step)
