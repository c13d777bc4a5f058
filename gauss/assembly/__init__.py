"""State → Compulsion: kinematics, applied loads, constraint rows."""

from gauss.assembly.assemble import assemble, assemble_motion, checked_load, closure_gap, impressed
from gauss.assembly.assembler import Assembler
from gauss.assembly.balance import unbalanced
from gauss.assembly.energies import kinetic_energy_of_bodies, look_at_energies, potential_energy
from gauss.assembly.forward import MU
from gauss.assembly.gaps import (
    Gaps,
    Slips,
    closed,
    gap_kernel,
    gaps,
    grip_rows,
    margin_kernel,
    slips,
    stacked_rows,
    with_contacts,
    with_gaps,
)
from gauss.assembly.inputs import numbers, with_numbers
from gauss.assembly.kinematics import JointMotion, Kinematics, Motion, kinematics
from gauss.assembly.loads import Applied, stretch
from gauss.assembly.looped import DAMPED, Looped
from gauss.assembly.mechanism import (
    Mechanism,
    careful,
    closing_rows,
    closing_sizes,
    closure,
    condensed,
    forward_dynamics,
    inverse_dynamics,
    kinetic_energy,
    tracked,
)
from gauss.assembly.sizes import gap_sizes, grip_sizes, kept_sizes, sliding_sizes
from gauss.assembly.steps import Touching, TouchingKernel
from gauss.assembly.sweep import forward_sweep, inverse_sweep

__all__ = [
    "Applied",
    "DAMPED",
    "Assembler",
    "Gaps",
    "JointMotion",
    "Kinematics",
    "Looped",
    "MU",
    "Mechanism",
    "Motion",
    "Slips",
    "Touching",
    "TouchingKernel",
    "assemble",
    "assemble_motion",
    "careful",
    "checked_load",
    "closed",
    "closing_rows",
    "closing_sizes",
    "closure",
    "closure_gap",
    "condensed",
    "forward_dynamics",
    "forward_sweep",
    "gap_kernel",
    "gap_sizes",
    "gaps",
    "grip_rows",
    "grip_sizes",
    "impressed",
    "inverse_dynamics",
    "inverse_sweep",
    "kept_sizes",
    "kinematics",
    "kinetic_energy",
    "kinetic_energy_of_bodies",
    "look_at_energies",
    "margin_kernel",
    "numbers",
    "potential_energy",
    "sliding_sizes",
    "slips",
    "stacked_rows",
    "stretch",
    "tracked",
    "unbalanced",
    "with_contacts",
    "with_gaps",
    "with_numbers",
]
