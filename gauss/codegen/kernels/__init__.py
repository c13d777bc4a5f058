"""Compiled loops over flat arrays: integrators that call a scene's functions with no Python between the steps."""

from gauss.codegen.kernels.adaptive import GIVEN, Adaptive
from gauss.codegen.kernels.adaptive_batch import RECORD, Queue, Stream
from gauss.codegen.kernels.block_ldlt import BlockLDLT
from gauss.codegen.kernels.call_recorder import Block, Cells, Memory, Place, Vector
from gauss.codegen.kernels.call_table import Calls
from gauss.codegen.kernels.checked_recursion import Corrected, Correction
from gauss.codegen.kernels.checked_switch import Guarded
from gauss.codegen.kernels.column_pivoting import Pivots
from gauss.codegen.kernels.compiled_loop import Loop
from gauss.codegen.kernels.contact_solver import Settle, Solve
from gauss.codegen.kernels.contact_step import Contacts
from gauss.codegen.kernels.energy_record import ENERGIES, LOOK, opened, updated
from gauss.codegen.kernels.explicit import Interpolation, Trial, stride
from gauss.codegen.kernels.first_accepted import Otherwise
from gauss.codegen.kernels.fixed_point import Repeat
from gauss.codegen.kernels.fixed_step import Due, Fixed
from gauss.codegen.kernels.fixed_step_batch import WORST, Many, Span
from gauss.codegen.kernels.loop_control import Control, Status
from gauss.codegen.kernels.newton import Newton
from gauss.codegen.kernels.taylor import Expanded
from gauss.codegen.kernels.tree_recursion import Step, Sweep

__all__ = [
    "GIVEN",
    "Adaptive",
    "Block",
    "BlockLDLT",
    "Calls",
    "Cells",
    "Contacts",
    "Control",
    "Corrected",
    "Correction",
    "Due",
    "ENERGIES",
    "Expanded",
    "Fixed",
    "Guarded",
    "Interpolation",
    "LOOK",
    "Loop",
    "Many",
    "Memory",
    "Newton",
    "Otherwise",
    "Pivots",
    "Place",
    "Queue",
    "RECORD",
    "Repeat",
    "Settle",
    "Solve",
    "Span",
    "Status",
    "Step",
    "Stream",
    "Sweep",
    "Trial",
    "Vector",
    "WORST",
    "opened",
    "stride",
    "updated",
]
