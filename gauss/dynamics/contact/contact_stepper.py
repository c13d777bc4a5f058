"""Stepper of a system with many contacts: block-sparse for bodies that move freely, by joint coordinates for mechanisms."""

from gauss.dynamics.conditions import are_free_in_contact, smooth_system
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.store import cached
from gauss.system import System


def contact_stepper(system: System, held: bool = False, removal: float = 0.0) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, made once for its laws as they are now; with inputs that are held in each step, or without.

    Parameters
    ----------
    held : bool
        Whether the inputs of the scene are held in each step.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.
    """
    laws = Laws(smooth_system(system))
    names = tuple(bound.load.name for bound in laws.called)
    return cached(
        system, (contact_stepper, held, removal, laws.key, names), lambda: new_contact_stepper(system, held, removal)
    )


def new_contact_stepper(system: System, held: bool = False, removal: float = 0.0) -> FreeBodyStepper | MechanismStepper:
    """Stepper of a system, for one motion alone; as of :func:`contact_stepper`."""
    if held or not are_free_in_contact(system):
        return MechanismStepper(system, held, removal)
    return FreeBodyStepper(system, removal)
