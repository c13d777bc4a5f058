"""Operations of the forward dynamics of one state with its error check: traced, whatever lanes they are computed in."""

from functools import partial

from gauss.codegen import write
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import FUNCTIONS
from gauss.dynamics.rules import Question
from gauss.dynamics.traced_refinement import embedded_once, refined_once
from gauss.dynamics.traced_system import Program
from gauss.system import System

TAKEN, GENERAL = "operations", "operations, general"
EMBEDDED = "embedded loops"


def operations(system: System) -> dict[str, int]:
    """Operations by the plan of the system, and by the general elimination where loops are eliminated where they close."""
    laws = Laws(system)
    sizes = {"q": system.n_q, "v": system.n_v, "load": system.n_v, "t": 1}

    def number(once) -> int:
        return sum(write(partial(once, Program(system, laws)), *sizes.values(), name=TAKEN).operations().values())

    if FUNCTIONS.plan(Question(system, laws)).dynamics != EMBEDDED:
        return {TAKEN: number(refined_once)}
    return {TAKEN: number(embedded_once), GENERAL: number(refined_once)}
