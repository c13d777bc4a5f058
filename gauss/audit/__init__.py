"""What a motion says when asked: reactions, forces of constraints and drives, energy."""

from gauss.audit.energy import Energy, energy, kinetic_energy, potential_energy
from gauss.audit.reactions import Reaction, constraint_forces, drive_forces, reactions

__all__ = [
    "Energy",
    "Reaction",
    "constraint_forces",
    "drive_forces",
    "energy",
    "kinetic_energy",
    "potential_energy",
    "reactions",
]
