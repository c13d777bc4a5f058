"""What the user says: bodies, joints, loads and where they start; frozen and validated."""

from gauss.scene.body import Body, Frame
from gauss.scene.joint import Coupling, Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start
from gauss.scene.pairs import PAIRS, Pair
from gauss.scene.scene import GROUND, Scene

__all__ = [
    "GROUND",
    "PAIRS",
    "Body",
    "Coupling",
    "Drive",
    "Force",
    "Frame",
    "Joint",
    "JointSpring",
    "Pair",
    "Scene",
    "Spring",
    "Start",
]
