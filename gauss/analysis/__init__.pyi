from gauss.analysis.contact_forces import contact_forces, friction_forces
from gauss.analysis.contact_points import ContactPoints, contact_points
from gauss.analysis.inverse_dynamics import InverseDynamics, inverse_dynamics
from gauss.analysis.inverse_kinematics import InverseKinematics, differential_inverse_kinematics, inverse_kinematics
from gauss.analysis.planned_motion import PlannedMotion, plan_motion
from gauss.analysis.planned_path import plan_path
from gauss.analysis.reactions import (
    Reaction,
    constraint_forces,
    drive_forces,
    reactions,
    set_valued_forces,
    unique_reactions,
)
from gauss.analysis.target import Target
from gauss.analysis.targets import CenterOfMassTarget, DistanceTarget, PointTarget, PoseTarget, PostureTarget
from gauss.simulation.energy import Energy, energy
from gauss.simulation.energy_balance import warn_of_balance

__all__ = [
    "CenterOfMassTarget",
    "ContactPoints",
    "DistanceTarget",
    "Energy",
    "InverseDynamics",
    "InverseKinematics",
    "PlannedMotion",
    "PointTarget",
    "PoseTarget",
    "PostureTarget",
    "Reaction",
    "Target",
    "constraint_forces",
    "contact_forces",
    "contact_points",
    "differential_inverse_kinematics",
    "drive_forces",
    "energy",
    "friction_forces",
    "inverse_dynamics",
    "inverse_kinematics",
    "plan_motion",
    "plan_path",
    "reactions",
    "set_valued_forces",
    "unique_reactions",
    "warn_of_balance",
]
