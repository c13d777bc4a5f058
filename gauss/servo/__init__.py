"""Servo-constraints (Béghin, Appell): relations kept not by contact but by controlled forces.

A :class:`ServoRelation` is held by actuators; rows of the relations and directions of the forces are separate matrices::

    Servo(scene, relations, actuators) --realisable--> Verdict
    Servo --initial_state--> State --solve--> ServoSolution
    Servo --simulate--> Tracking --energy--> ServoEnergy

P. Appell, Traité de mécanique rationnelle, vol. II; H. Béghin, Étude théorique des compas gyrostatiques, 1922.
"""

from gauss.servo.actuators import AuxiliarySupport, Cable, Motor, Thruster
from gauss.servo.equilibrium import Equilibrium, equilibrium
from gauss.servo.explain import explain
from gauss.servo.lagrange import LagrangeSolution, lagrange, without_multipliers
from gauss.servo.observed import Observed
from gauss.servo.project import initial_state
from gauss.servo.realisable import realisable
from gauss.servo.relation import ServoRelation
from gauss.servo.saddle import ServoSolution
from gauss.servo.servo import Servo
from gauss.servo.simulate import simulate
from gauss.servo.solve import solve
from gauss.servo.tracking import ServoEnergy, Tracking, energy
from gauss.servo.verdict import UnrealisableError, Verdict
from gauss.versions import current_name

__all__ = [
    "AuxiliarySupport",
    "Cable",
    "Equilibrium",
    "LagrangeSolution",
    "Motor",
    "Observed",
    "Servo",
    "ServoEnergy",
    "ServoRelation",
    "ServoSolution",
    "Thruster",
    "Tracking",
    "UnrealisableError",
    "Verdict",
    "energy",
    "equilibrium",
    "explain",
    "initial_state",
    "lagrange",
    "realisable",
    "simulate",
    "solve",
    "without_multipliers",
]

RENAMED = {"Relation": "ServoRelation", "Support": "AuxiliarySupport"}  # former names, and those of today


def __getattr__(name: str):
    """Return what goes by another name now."""
    return globals()[current_name(__name__, RENAMED, name)]
