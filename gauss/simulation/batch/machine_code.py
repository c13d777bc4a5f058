"""Machine code of batches of one system: fixed steps of smooth systems and of contacts."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from gauss.codegen.kernels import FixedStepBatchLoop
from gauss.dynamics.conditions import smooth_question
from gauss.dynamics.contact.moreau_step import moreau_stepper
from gauss.dynamics.laws.constraint_modes import constraint_modes, refuse_surfaces
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import BATCHES, is_time_stepping, method_key, plan_of
from gauss.dynamics.programs import program_of
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.traced_system import Program
from gauss.integrators import EXPLICIT_FIXED, FixedStep, Integrator
from gauss.simulation.compiled_steps.loop_functions import fixed_batch
from gauss.simulation.moreau.compiled_step import compiled_batch, method_state_size
from gauss.simulation.moreau.moreau_jean import NONSMOOTH
from gauss.simulation.refusals import refuse_links
from gauss.system import System

if TYPE_CHECKING:
    from gauss.codegen.gpu.batches import DeviceFixedStepLoop

T = TypeVar("T")
FIXED = {method.name: method for method in EXPLICIT_FIXED}
STEPPED = FIXED | {method.name: method for method in NONSMOOTH}


def contact_state_size(system: System) -> int:
    """Numbers of the method state of time stepping."""
    return method_state_size(moreau_stepper(system))


ONE_BY_ONE = "pair kernels", "callbacks"  # dynamics of motions that are made one after the other


def one_by_one(system: System, method: Integrator, held: bool) -> str:
    """Dynamics of motions that are made one after the other; empty where they share vector registers."""
    if constraint_modes(system) is not None:
        return "pieces between surfaces of constraints"
    laws = Laws(system)
    if not (laws.called or is_time_stepping(Question(system, laws, method=method))):
        return ""
    plan = plan_of(Question(system, laws, method=method, held=held))
    return plan.dynamics if plan.dynamics in ONE_BY_ONE else ""


def fixed_step_code(
    system: System, method: FixedStep, held: bool, device: str | None = None
) -> "FixedStepBatchLoop | DeviceFixedStepLoop":
    """Machine code of fixed steps of a batch, cached with the system; with inputs that are held in each step, or without.

    SimulationError if the system cannot be compiled, or has links that the method does not take.
    """
    if method.nonsmooth:
        refuse_links(system)
    if device is not None:
        refuse_surfaces(system, "a batch on a device")

    def make(laws: Laws) -> "FixedStepBatchLoop | DeviceFixedStepLoop":
        if not method.nonsmooth:
            return fixed_batch(batch_program(system, laws, method)(system, laws, inputs=held), method, device)
        stepper, smooth = moreau_stepper(system), smooth_question(Question(system, laws)).laws
        program = Program(stepper.smooth, smooth, memory=method_state_size(stepper), inputs=held)
        return compiled_batch(stepper, program, device)

    return machine_code(system, method, (held, device), make)


def batch_program(system: System, laws: Laws, method: Integrator) -> type[Program]:
    """Class of the functions of a system for a batch; SimulationError if the system cannot be compiled."""
    return program_of(BATCHES.plan(Question(system, laws, method=method)).dynamics)


def machine_code(system: System, method: Integrator, kind: tuple, make: Callable[[Laws], T]) -> T:
    """Machine code of the steps, cached with the system; SimulationError if the system cannot be compiled."""
    laws = Laws(system)
    batch_program(system, laws, method)
    return cached_on_disk(system, (machine_code, method_key(method), kind, laws.key), lambda: make(laws))
