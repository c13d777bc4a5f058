"""Rotors on gears, friction drives, springs and clutches: drive trains of machines as a network of shafts.

A :class:`Network` holds shafts, links and torques; :func:`simulate` integrates its motion through all events, in minimal
coordinates; other functions give one instant, steady operation, vibrations, or the network as part of a scene.
"""

from gauss.arguments import named_arguments, named_methods
from gauss.rotors.elements import Shaft, Torque, law_of
from gauss.rotors.events import RotorEvent
from gauss.rotors.explain import explain
from gauss.rotors.friction_links import FrictionClutch, FrictionDrive, OneWayClutch, TorqueLimiter
from gauss.rotors.full import Snapshot, snapshot
from gauss.rotors.laws import (
    DC,
    Constant,
    Diesel,
    Dry,
    Kloss,
    Linear,
    Periodic,
    Quadratic,
    TorqueFunction,
    TorqueTable,
    Viscous,
)
from gauss.rotors.links import GearPair, TorsionSpring
from gauss.rotors.motion import RotorEnergy, RotorMotion, run_up_time
from gauss.rotors.network import Network
from gauss.rotors.operating_point import OperatingPoint
from gauss.rotors.report import mode_table, report, steady_table, table
from gauss.rotors.run import BeltSlipWarning
from gauss.rotors.scene import to_scene
from gauss.rotors.simulate import simulate
from gauss.rotors.steady import operating_points
from gauss.rotors.traction import Characteristic, Hyperbola, Measured
from gauss.rotors.vibration import Campbell, Modes, campbell, eigenmodes
from gauss.versions import current_name

__all__ = [
    "BeltSlipWarning",
    "Campbell",
    "Characteristic",
    "Constant",
    "DC",
    "Diesel",
    "Dry",
    "FrictionClutch",
    "FrictionDrive",
    "GearPair",
    "Hyperbola",
    "Kloss",
    "Linear",
    "Measured",
    "Modes",
    "Network",
    "OneWayClutch",
    "OperatingPoint",
    "Periodic",
    "Quadratic",
    "RotorEnergy",
    "RotorEvent",
    "RotorMotion",
    "Shaft",
    "Snapshot",
    "Torque",
    "TorqueFunction",
    "TorqueLimiter",
    "TorqueTable",
    "TorsionSpring",
    "Viscous",
    "campbell",
    "eigenmodes",
    "explain",
    "law_of",
    "mode_table",
    "operating_points",
    "report",
    "run_up_time",
    "simulate",
    "snapshot",
    "steady_table",
    "table",
    "to_scene",
]

RENAMED = {  # former names, and those of today
    "Clutch": "FrictionClutch",
    "Energy": "RotorEnergy",
    "Event": "RotorEvent",
    "Function": "TorqueFunction",
    "Gear": "GearPair",
    "Table": "TorqueTable",
}


named_methods(named_arguments(Network))


def __getattr__(name: str):
    """Return what goes by another name now."""
    return globals()[current_name(__name__, RENAMED, name)]
