"""Compiled loops over flat arrays: integrators that call a scene's functions with no Python between the steps."""

from gauss.codegen.kernels.adaptive import GIVEN, Adaptive
from gauss.codegen.kernels.adaptive_batch import RECORD, AdaptiveBatchLoop, Queue
from gauss.codegen.kernels.block_ldlt import BlockLDLT
from gauss.codegen.kernels.call_recorder import CallRecorder, Memory, Operand, Slot, Vector
from gauss.codegen.kernels.call_table import Calls
from gauss.codegen.kernels.checked_recursion import CorrectedRecursion, Correction
from gauss.codegen.kernels.checked_switch import CheckedSwitch
from gauss.codegen.kernels.column_pivoting import Pivots
from gauss.codegen.kernels.compiled_loop import Loop
from gauss.codegen.kernels.contact_solver import ContactSolver, Solve
from gauss.codegen.kernels.contact_step import Contacts
from gauss.codegen.kernels.energy_record import ENERGIES, LOOK, opened, updated
from gauss.codegen.kernels.explicit import Interpolation, Trial, stride
from gauss.codegen.kernels.first_accepted import FirstAccepted
from gauss.codegen.kernels.fixed_point import FixedPoint
from gauss.codegen.kernels.fixed_step import Due, Fixed
from gauss.codegen.kernels.fixed_step_batch import WORST, FixedStepBatchLoop, Span
from gauss.codegen.kernels.loop_control import Control, Status
from gauss.codegen.kernels.newton import Newton
from gauss.codegen.kernels.taylor import TaylorStep
from gauss.codegen.kernels.tree_recursion import Step, TreeRecursion

__all__ = [
    "GIVEN",
    "Adaptive",
    "Operand",
    "BlockLDLT",
    "Calls",
    "CallRecorder",
    "Contacts",
    "Control",
    "CorrectedRecursion",
    "Correction",
    "Due",
    "ENERGIES",
    "TaylorStep",
    "Fixed",
    "CheckedSwitch",
    "Interpolation",
    "LOOK",
    "Loop",
    "FixedStepBatchLoop",
    "Memory",
    "Newton",
    "FirstAccepted",
    "Pivots",
    "Slot",
    "Queue",
    "RECORD",
    "FixedPoint",
    "ContactSolver",
    "Solve",
    "Span",
    "Status",
    "Step",
    "AdaptiveBatchLoop",
    "TreeRecursion",
    "Trial",
    "Vector",
    "WORST",
    "opened",
    "stride",
    "updated",
]
