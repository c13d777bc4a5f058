"""What the user says: bodies, joints, loads and where they start; frozen and validated."""

from gauss.scene.body import Body, Frame
from gauss.scene.joint import Coupling, Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start
from gauss.scene.motions import Guided, Prescribed
from gauss.scene.pairs import PAIRS, Pair
from gauss.scene.relation import Constraint, Relation
from gauss.scene.scene import GROUND, Scene

__all__ = [
    "GROUND",
    "PAIRS",
    "Body",
    "Constraint",
    "Coupling",
    "Drive",
    "Force",
    "Frame",
    "Guided",
    "Joint",
    "JointSpring",
    "Pair",
    "Prescribed",
    "Relation",
    "Scene",
    "Spring",
    "Start",
]
