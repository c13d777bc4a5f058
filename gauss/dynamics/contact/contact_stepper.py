"""Stepper of a system with many contacts: block-sparse for bodies that move freely, by joint coordinates for mechanisms."""

from gauss.dynamics.conditions import are_free_in_contact
from gauss.dynamics.contact.free_body_step import FreeBodyStepper, free_body_stepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper, mechanism_stepper
from gauss.system import System


def contact_stepper(system: System) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, made once."""
    return free_body_stepper(system) if are_free_in_contact(system) else mechanism_stepper(system)
