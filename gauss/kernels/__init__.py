"""Compiled loops over flat arrays: integrators that call a scene's functions with no Python between the steps."""

from gauss.kernels.adaptive import GIVEN, Adaptive
from gauss.kernels.block_ldlt import BlockLDLT
from gauss.kernels.calls import Calls
from gauss.kernels.cells import Block, Cells, Memory, Place, Vector
from gauss.kernels.checked import Corrected, Correction
from gauss.kernels.contacts import Contacts
from gauss.kernels.control import Control, Status
from gauss.kernels.energies import ENERGIES, LOOK, opened, updated
from gauss.kernels.explicit import Interpolation, Trial, stride
from gauss.kernels.fixed import Due, Fixed
from gauss.kernels.guarded import Guarded
from gauss.kernels.loop import Loop
from gauss.kernels.many import WORST, Many, Span
from gauss.kernels.newton import Newton
from gauss.kernels.otherwise import Otherwise
from gauss.kernels.pivots import Pivots
from gauss.kernels.repeat import Repeat
from gauss.kernels.settling import Settle, Solve
from gauss.kernels.stream import RECORD, Queue, Stream
from gauss.kernels.sweep import Step, Sweep
from gauss.kernels.taylor import Expanded

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
