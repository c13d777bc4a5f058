"""What a motion says when asked: reactions, energy."""

from gauss.audit.energy import Energy, energy, kinetic_energy, potential_energy
from gauss.audit.reactions import Reaction, reactions

__all__ = ["Energy", "Reaction", "energy", "kinetic_energy", "potential_energy", "reactions"]
