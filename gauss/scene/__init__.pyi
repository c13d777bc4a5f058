from gauss.scene import actuators, profiles
from gauss.scene.body import Body, Frame
from gauss.scene.clutches import Clutch, Freewheel, JointLink
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere
from gauss.scene.contact import Contact, Guard, Slip
from gauss.scene.contact_distances import FeaturePair
from gauss.scene.convex_mesh import ConvexMesh
from gauss.scene.curved_shapes import Cone, Cylinder, Ellipsoid
from gauss.scene.elastic import Elastic, ElasticLink
from gauss.scene.gears import Gear, Rack
from gauss.scene.geometry import Angle, Coincident, Distance, OnCurve, OnLine, OnPlane
from gauss.scene.height_field import HeightField
from gauss.scene.inputs import Input, Output
from gauss.scene.joint import Coupling, Joint
from gauss.scene.loads import Drive, Force, JointSpring, Spring, Start, StateLaw
from gauss.scene.losses import IdealCounterpart, JointAtRest, LossyGear
from gauss.scene.motions import Guided, Prescribed
from gauss.scene.names import GROUND
from gauss.scene.pairs import PAIRS, Pair
from gauss.scene.relation import Constraint, Relation
from gauss.scene.rolling import KnifeEdge, Rolling
from gauss.scene.scene import Scene
from gauss.scene.set_valued import JointDryFriction, JointFriction, LimitedDrive, SetValued, Slipping
from gauss.scene.transmissions import Cam, LinearCoupling, Transmission
from gauss.scene.unilateral import ClosedGap, OneSidedConstraint, Rope, Stop, Unilateral

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
    "Cone",
    "Constraint",
    "Contact",
    "ConvexMesh",
    "Coupling",
    "Cylinder",
    "Distance",
    "Drive",
    "Elastic",
    "ElasticLink",
    "Ellipsoid",
    "Force",
    "Frame",
    "Freewheel",
    "Gear",
    "SetValued",
    "Guard",
    "Guided",
    "HalfSpace",
    "HeightField",
    "Input",
    "Joint",
    "JointFriction",
    "JointAtRest",
    "JointDryFriction",
    "JointLink",
    "JointSpring",
    "KnifeEdge",
    "LimitedDrive",
    "LinearCoupling",
    "LossyGear",
    "OnCurve",
    "OnLine",
    "OnPlane",
    "OneSidedConstraint",
    "Output",
    "Pair",
    "FeaturePair",
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
    "StateLaw",
    "Stop",
    "Transmission",
    "Unilateral",
    "actuators",
    "profiles",
]
