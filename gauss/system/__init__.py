"""A scene turned once into what is stepped: spanning tree, constant frames, layout of the vectors."""

from gauss.system.build import build, guards, sides
from gauss.system.frozen import refuse_changed
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
    velocity_lead,
)
from gauss.system.naming import coordinate_units, rate_units
from gauss.system.part import Part, whole
from gauss.system.phases import FREE, Told, phase_scene
from gauss.system.placed import BoundLoad, PlacedFrame, PlacedJoint
from gauss.system.reduction import Stage
from gauss.system.relations import Relations
from gauss.system.scale import Scale
from gauss.system.state import State
from gauss.system.system import UNIT_QUATERNION, Dynamics, System
from gauss.system.view import View

__all__ = [
    "FREE",
    "UNIT_QUATERNION",
    "BoundLoad",
    "Dynamics",
    "Part",
    "PlacedFrame",
    "PlacedJoint",
    "Relations",
    "Scale",
    "Stage",
    "State",
    "System",
    "Told",
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
    "whole",
]
