"""Analysis of systems and motions: reactions, forces of constraints and drives, inverse dynamics, energy, mobility."""

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
from gauss.simulation.energy_balance import attach

__all__, __getattr__, __dir__ = attach(__name__,
    "energy",
    "friction_forces",
    "inverse_dynamics",
    "reactions",
    "set_valued_forces",
    "warn_of_balance",
    "unique_reactions",
]
