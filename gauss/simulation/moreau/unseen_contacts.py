"""Steps within which no shape passes through another one unseen: gaps are looked at once a step."""

import numpy as np

from gauss.dynamics.kinematics import kinematics
from gauss.scene import Contact, HalfSpace, Scene
from gauss.scene.collision import Collider
from gauss.system import State, System

SHARE = 0.25  # of the thickness of two shapes together that they may move in a step


class StepLimit:
    """Largest steps of a system with contacts of shapes; none with half-spaces, which nothing passes through.

    Parameters
    ----------
    system : System
        The system.
    """

    def __init__(self, system: System):
        self.system, pairs = system, _pairs(system.scene)
        self.way = np.array([SHARE * (thickness(one) + thickness(other)) for one, other in pairs])
        shapes = list({shape.name: shape for pair in pairs for shape in pair}.values())
        places = {shape.name: k for k, shape in enumerate(shapes)}
        self.pairs = np.array([[places[shape.name] for shape in pair] for pair in pairs], dtype=int).reshape(-1, 2)
        frames, middles = [system.frames[shape.body] for shape in shapes], [shape.corners.mean(axis=0) for shape in shapes]
        self.bodies = np.array([frame.body for frame in frames], dtype=int)
        self.middles = [frame.p + frame.R @ middle for frame, middle in zip(frames, middles, strict=True)]
        self.reach = np.array([shape.radius + _farthest(shape.corners - shape.corners.mean(axis=0)) for shape in shapes])

    def step(self, state: State) -> float:
        """Largest step at the rates of a state [s]."""
        if not self.way.size:
            return np.inf
        motion = kinematics(self.system, state)
        x, u, W = (np.array([part[b] for b in self.bodies]) for part in (motion.x, motion.u, motion.W))
        out = np.array([motion.R[b] @ middle for b, middle in zip(self.bodies, self.middles, strict=True)])
        speed = np.linalg.norm(u + np.cross(W, out), axis=1) + np.linalg.norm(W, axis=1) * self.reach
        one, other = self.pairs.T
        apart = np.linalg.norm((x + out)[one] - (x + out)[other], axis=1) - self.reach[one] - self.reach[other]
        with np.errstate(divide="ignore"):
            return float((np.maximum(self.way, 0.5 * apart) / (speed[one] + speed[other])).min())


def _pairs(scene: Scene) -> list[tuple[Collider, Collider]]:
    """Shapes of contacts without half-spaces."""
    contacts = [contact for contact in scene.contacts.values() if isinstance(contact, Contact)]
    pairs = [(scene.shapes[contact.shape], scene.shapes[contact.other]) for contact in contacts]
    return [pair for pair in pairs if not isinstance(pair[0], HalfSpace) and not isinstance(pair[1], HalfSpace)]


def thickness(shape: Collider) -> float:
    """Least extent of a shape [m]."""
    corners = shape.corners - shape.corners.mean(axis=0)
    extents = np.ptp(corners @ np.linalg.svd(corners, full_matrices=True)[2].T, axis=0)
    return 2.0 * shape.radius + float(extents.min())


def _farthest(points: np.ndarray) -> float:
    return float(np.linalg.norm(points, axis=1).max())
