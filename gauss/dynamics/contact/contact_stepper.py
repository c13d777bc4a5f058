"""Stepper of a system with many contacts: block-sparse for bodies that move freely, by joint coordinates for mechanisms."""

from gauss.dynamics.conditions import are_free_in_contact, smooth_system
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.store import cached
from gauss.system import System


def contact_stepper(system: System, held: bool = False) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, made once for its laws as they are now; with inputs that are held in each step, or without."""
    laws = Laws(smooth_system(system))
    names = tuple(bound.load.name for bound in laws.called)
    return cached(system, (contact_stepper, held, laws.key, names), lambda: new_contact_stepper(system, held))


def new_contact_stepper(system: System, held: bool = False) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, for one motion alone."""
    return MechanismStepper(system, held) if held or not are_free_in_contact(system) else FreeBodyStepper(system)
