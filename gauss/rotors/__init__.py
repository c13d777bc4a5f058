"""Rotors on gears, friction drives, springs and clutches: working organs of machines as a network of shafts.

A :class:`Network` says what there is; :func:`simulate` follows its motion through all events, in the smallest number of
coordinates; the other functions look at one instant, at steady operation, at vibrations, or put it into a scene.
"""

from gauss.rotors.elements import Shaft, Torque, law_of
from gauss.rotors.events import Event
from gauss.rotors.explain import explain
from gauss.rotors.full import Snapshot, snapshot
from gauss.rotors.laws import DC, Constant, Diesel, Dry, Function, Kloss, Linear, Periodic, Quadratic, Table, Viscous
from gauss.rotors.links import Clutch, FrictionDrive, Gear, OneWayClutch, TorqueLimiter, TorsionSpring
from gauss.rotors.motion import Energy, RotorMotion
from gauss.rotors.network import Network
from gauss.rotors.report import mode_table, report, steady_table, table
from gauss.rotors.run import BeltSlipWarning
from gauss.rotors.runup import run_up_time
from gauss.rotors.scene import to_scene
from gauss.rotors.simulate import simulate
from gauss.rotors.steady import OperatingPoint, operating_points
from gauss.rotors.traction import Characteristic, Hyperbola, Measured
from gauss.rotors.vibration import Campbell, Modes, campbell, eigenmodes

__all__ = [
    "DC",
    "BeltSlipWarning",
    "Campbell",
    "Characteristic",
    "Clutch",
    "Constant",
    "Diesel",
    "Dry",
    "Energy",
    "Event",
    "FrictionDrive",
    "Function",
    "Gear",
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
    "RotorMotion",
    "Shaft",
    "Snapshot",
    "Table",
    "Torque",
    "TorqueLimiter",
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
