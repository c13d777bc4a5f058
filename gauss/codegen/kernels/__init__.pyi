from gauss.codegen.kernels.adaptive import LAST_STEP_SHARE, TRIAL_RESULTS, TRIAL_SETTINGS, Adaptive
from gauss.codegen.kernels.adaptive_batch import MOTION_RECORD, AdaptiveBatchLoop, MotionQueue
from gauss.codegen.kernels.block_contacts import BlockContactLaws, BlockContactSolver, ContactGraph
from gauss.codegen.kernels.block_ldlt import BlockLDLT
from gauss.codegen.kernels.call_recorder import CallRecorder, Operand, RecordedCalls, Slot, Vector
from gauss.codegen.kernels.call_table import CallTable
from gauss.codegen.kernels.checked_recursion import CorrectedRecursion, Correction
from gauss.codegen.kernels.checked_switch import CheckedSwitch
from gauss.codegen.kernels.compiled_loop import CallingLoop, Loop, address
from gauss.codegen.kernels.contact_solver import CompiledContactSolver, ContactSolver
from gauss.codegen.kernels.contact_step import ContactForces
from gauss.codegen.kernels.damped_compliance import DampedCompliance
from gauss.codegen.kernels.energy_record import (
    ENERGY_RECORD,
    ENERGY_SAMPLE,
    initial_energy_record,
    recorded_energies,
    updated_energy_record,
)
from gauss.codegen.kernels.explicit import ExplicitTrial, Interpolation, stride
from gauss.codegen.kernels.first_accepted import FirstAccepted
from gauss.codegen.kernels.fixed_point import FixedPoint
from gauss.codegen.kernels.fixed_step import Due, Fixed, Notes
from gauss.codegen.kernels.fixed_step_batch import WORST_RECORD, BatchSpan, FixedStepBatchLoop
from gauss.codegen.kernels.free_body_poses import FreeBodyFunctions
from gauss.codegen.kernels.free_body_step import CompiledFreeBodyStep
from gauss.codegen.kernels.free_motion import STIFF_DAMPING, implicit_inertia
from gauss.codegen.kernels.lapack import Pivots
from gauss.codegen.kernels.loop_control import Control, LoopStatus
from gauss.codegen.kernels.mechanism_loop import CallingSteps, CompiledSteps
from gauss.codegen.kernels.mechanism_step import CompiledMechanismStep, StepFunctions
from gauss.codegen.kernels.near_pairs import NearPairs
from gauss.codegen.kernels.newton import Newton
from gauss.codegen.kernels.newton_rounds import Round
from gauss.codegen.kernels.row_code import RowCode, RowFunction, SingleRowFunction
from gauss.codegen.kernels.section_code import RecordedSections, SectionCode
from gauss.codegen.kernels.step_memory import MemoryLayout
from gauss.codegen.kernels.taylor import TaylorStep
from gauss.codegen.kernels.tree_recursion import LinkStep, TreeRecursion

__all__ = [
    "TRIAL_RESULTS",
    "RowCode",
    "RowFunction",
    "TRIAL_SETTINGS",
    "Adaptive",
    "Operand",
    "BlockLDLT",
    "CallTable",
    "CallingLoop",
    "CallingSteps",
    "CallRecorder",
    "ContactForces",
    "Control",
    "CorrectedRecursion",
    "Correction",
    "DampedCompliance",
    "Due",
    "ENERGY_RECORD",
    "address",
    "TaylorStep",
    "Fixed",
    "CheckedSwitch",
    "Interpolation",
    "LAST_STEP_SHARE",
    "ENERGY_SAMPLE",
    "Loop",
    "FixedStepBatchLoop",
    "RecordedCalls",
    "RecordedSections",
    "STIFF_DAMPING",
    "SectionCode",
    "NearPairs",
    "CompiledMechanismStep",
    "CompiledFreeBodyStep",
    "CompiledSteps",
    "FreeBodyFunctions",
    "MemoryLayout",
    "StepFunctions",
    "Newton",
    "Notes",
    "FirstAccepted",
    "Pivots",
    "SingleRowFunction",
    "Slot",
    "MotionQueue",
    "MOTION_RECORD",
    "FixedPoint",
    "BlockContactLaws",
    "BlockContactSolver",
    "ContactGraph",
    "Round",
    "ContactSolver",
    "CompiledContactSolver",
    "BatchSpan",
    "LoopStatus",
    "LinkStep",
    "AdaptiveBatchLoop",
    "TreeRecursion",
    "ExplicitTrial",
    "Vector",
    "WORST_RECORD",
    "implicit_inertia",
    "initial_energy_record",
    "recorded_energies",
    "stride",
    "updated_energy_record",
]
