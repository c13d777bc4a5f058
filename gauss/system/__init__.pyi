from gauss.system.build import build
from gauss.system.contact_mode import FREE, ContactMode, guards, phase_scene, sides
from gauss.system.coordinate_names import coordinate_units, rate_units
from gauss.system.frozen_functions import refuse_changed
from gauss.system.manifold import (
    along_rates,
    chart_lead,
    chart_rate,
    chart_velocity,
    coordinate_rates,
    displacement,
    in_own_axes,
    in_parent_axes,
    random_state,
    retract,
    rounded,
    sizes,
    turned,
    velocity_lead,
)
from gauss.system.passes import Stage
from gauss.system.placed_elements import BoundLoad, PlacedFrame, PlacedJoint
from gauss.system.relations import Relations
from gauss.system.scale import Scale
from gauss.system.state import State, View
from gauss.system.subsystem import Subsystem, whole
from gauss.system.system import UNIT_QUATERNION, Dynamics, System

__all__ = [
    "FREE",
    "UNIT_QUATERNION",
    "BoundLoad",
    "Dynamics",
    "Subsystem",
    "PlacedFrame",
    "PlacedJoint",
    "Relations",
    "Scale",
    "Stage",
    "State",
    "System",
    "ContactMode",
    "View",
    "along_rates",
    "build",
    "chart_lead",
    "chart_rate",
    "chart_velocity",
    "coordinate_units",
    "coordinate_rates",
    "displacement",
    "guards",
    "in_own_axes",
    "in_parent_axes",
    "phase_scene",
    "random_state",
    "rate_units",
    "refuse_changed",
    "retract",
    "rounded",
    "sides",
    "sizes",
    "velocity_lead",
    "turned",
    "whole",
]
