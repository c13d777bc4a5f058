"""Stepper of a system with many contacts: block-sparse for bodies that move freely, by joint coordinates for mechanisms."""

from gauss.dynamics.conditions import are_free_in_contact
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.store import cached
from gauss.system import System


def contact_stepper(system: System, held: bool = False) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, made once; with inputs that are held in each step, or without."""
    return cached(system, (contact_stepper, held), lambda: new_contact_stepper(system, held))


def new_contact_stepper(system: System, held: bool = False) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, for one motion alone."""
    return MechanismStepper(system, held) if held or not are_free_in_contact(system) else FreeBodyStepper(system)
