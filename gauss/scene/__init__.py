"""What the user says: bodies, joints, loads and where they start; frozen and validated."""

from gauss.scene import profiles
from gauss.scene.body import Body, Frame
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere
from gauss.scene.contact import Contact, Guard, Slip
from gauss.scene.gears import Gear, Rack
from gauss.scene.geometry import Angle, Coincident, Distance, OnCurve, OnLine, OnPlane
from gauss.scene.grips import Grip, JointFriction, LimitedDrive, Slipping
from gauss.scene.joint import Coupling, Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start
from gauss.scene.motions import Guided, Prescribed
from gauss.scene.onesided import OneSided, OneSidedConstraint, Side, Stop
from gauss.scene.pairs import PAIRS, Pair
from gauss.scene.places import Place
from gauss.scene.relation import Constraint, Relation
from gauss.scene.rolling import KnifeEdge, Rolling
from gauss.scene.rope import Rope
from gauss.scene.scene import GROUND, Scene
from gauss.scene.transmissions import Cam, Transmission

__all__ = [
    "GROUND",
    "PAIRS",
    "Angle",
    "Body",
    "Box",
    "Cam",
    "Capsule",
    "Coincident",
    "Collider",
    "Constraint",
    "Contact",
    "Coupling",
    "Distance",
    "Drive",
    "Force",
    "Frame",
    "Gear",
    "Grip",
    "Guard",
    "Guided",
    "HalfSpace",
    "Joint",
    "JointFriction",
    "JointSpring",
    "KnifeEdge",
    "LimitedDrive",
    "OnCurve",
    "OnLine",
    "OnPlane",
    "OneSided",
    "OneSidedConstraint",
    "Pair",
    "Place",
    "Points",
    "Prescribed",
    "Rack",
    "Relation",
    "Rolling",
    "Rope",
    "Scene",
    "Side",
    "Slip",
    "Slipping",
    "Sphere",
    "Spring",
    "Start",
    "Stop",
    "Transmission",
    "profiles",
]
