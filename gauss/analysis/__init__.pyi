from gauss.analysis.contact_forces import contact_forces, friction_forces
from gauss.analysis.inverse_dynamics import InverseDynamics, inverse_dynamics
from gauss.analysis.reactions import (
    Reaction,
    constraint_forces,
    drive_forces,
    reactions,
    set_valued_forces,
    unique_reactions,
)
from gauss.simulation.energy import Energy, energy
from gauss.simulation.energy_balance import warn_of_balance

__all__ = [
    "Energy",
    "InverseDynamics",
    "Reaction",
    "constraint_forces",
    "contact_forces",
    "drive_forces",
    "energy",
    "friction_forces",
    "set_valued_forces",
    "inverse_dynamics",
    "reactions",
    "warn_of_balance",
    "unique_reactions",
]
