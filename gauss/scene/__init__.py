"""The mechanism as the user describes it: bodies, joints, constraints, contacts, loads, starts; frozen and validated.

* :class:`Scene` collects the elements; its builder methods are in ``scene``, ``builder`` and ``contact_builder``;
* bilateral constraints are a :class:`Relation` (``relation``, ``geometry``, ``gears``, ``rolling``, ``motions``, …);
* unilateral constraints are a gap function g_N ≥ 0 (``unilateral``, ``contact``, ``rope``);
* set-valued elements are a :class:`SetValued` force law: Coulomb friction, limited drives (``set_valued``, ``clutches``);
* loads are known forces (``loads``, ``elastic``); kinematic pairs are in ``pairs``.
"""

from gauss.errors import named_arguments, named_methods
from gauss.scene import profiles
from gauss.scene.body import Body, Frame
from gauss.scene.builder import ConstraintBuilder
from gauss.scene.clutches import Clutch, Freewheel, JointLink
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere
from gauss.scene.contact import Contact, Guard, Slip
from gauss.scene.contact_builder import ContactBuilder
from gauss.scene.contact_distances import Place
from gauss.scene.elastic import Elastic, ElasticLink
from gauss.scene.gears import Gear, Rack
from gauss.scene.geometry import Angle, Coincident, Distance, OnCurve, OnLine, OnPlane
from gauss.scene.joint import Coupling, Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start
from gauss.scene.losses import IdealCounterpart, JointAtRest, LossyGear
from gauss.scene.motions import Guided, Prescribed
from gauss.scene.pairs import PAIRS, Pair
from gauss.scene.relation import Constraint, Relation
from gauss.scene.rolling import KnifeEdge, Rolling
from gauss.scene.rope import Rope
from gauss.scene.scene import GROUND, Scene
from gauss.scene.set_valued import JointDryFriction, JointFriction, LimitedDrive, SetValued, Slipping
from gauss.scene.transmissions import Cam, Transmission
from gauss.scene.unilateral import ClosedGap, OneSidedConstraint, Stop, Unilateral

__all__ = [
    "GROUND",
    "PAIRS",
    "Angle",
    "IdealCounterpart",
    "Body",
    "Box",
    "Cam",
    "ClosedGap",
    "Clutch",
    "Capsule",
    "Coincident",
    "Collider",
    "Constraint",
    "Contact",
    "Coupling",
    "Distance",
    "Drive",
    "Elastic",
    "ElasticLink",
    "Force",
    "Frame",
    "Freewheel",
    "Gear",
    "SetValued",
    "Guard",
    "Guided",
    "HalfSpace",
    "Joint",
    "JointFriction",
    "JointAtRest",
    "JointDryFriction",
    "JointLink",
    "JointSpring",
    "KnifeEdge",
    "LimitedDrive",
    "LossyGear",
    "OnCurve",
    "OnLine",
    "OnPlane",
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
    "Slip",
    "Slipping",
    "Sphere",
    "Spring",
    "Start",
    "Stop",
    "Transmission",
    "Unilateral",
    "profiles",
]

for _builder in (Scene, ConstraintBuilder, ContactBuilder):
    named_methods(_builder)
for _name in __all__:
    if isinstance(globals()[_name], type):
        named_arguments(globals()[_name])
