"""State → Compulsion: kinematics, applied loads, constraint rows."""

from gauss.assembly.assemble import assemble, assemble_motion, checked_load, closure_gap, impressed
from gauss.assembly.assembler import Assembler
from gauss.assembly.balance import unbalanced
from gauss.assembly.gaps import Gaps, closed, gap_kernel, gaps, with_contacts, with_gaps
from gauss.assembly.kinematics import JointMotion, Motion, kinematics
from gauss.assembly.loads import Applied, stretch
from gauss.assembly.mechanism import Mechanism, closure, forward_dynamics
from gauss.assembly.sweep import forward_sweep, inverse_sweep

__all__ = [
    "Applied",
    "Assembler",
    "Gaps",
    "JointMotion",
    "Mechanism",
    "Motion",
    "assemble",
    "assemble_motion",
    "checked_load",
    "closed",
    "closure",
    "closure_gap",
    "forward_dynamics",
    "forward_sweep",
    "gap_kernel",
    "gaps",
    "impressed",
    "inverse_sweep",
    "kinematics",
    "stretch",
    "unbalanced",
    "with_contacts",
    "with_gaps",
]
