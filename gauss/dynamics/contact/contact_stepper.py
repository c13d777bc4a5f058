"""Stepper of a system with many contacts: block-sparse for bodies that move freely, by joint coordinates for mechanisms."""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from gauss.dynamics.conditions import are_free_in_contact, smooth_system
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.store import cached
from gauss.system import System

Stepper = FreeBodyStepper | MechanismStepper


class StepperPool:
    """Steppers of one system that no motion is using: a motion takes one, for itself alone, and gives it back at its end.

    So motions of one system may run in several threads, and one within a law of another one.

    Parameters
    ----------
    make : callable
        () → a new stepper.
    """

    def __init__(self, make: Callable[[], Stepper]):
        self.make, self.free = make, deque[Stepper]()

    def take(self) -> Stepper:
        """Return a stepper that is not in use."""
        try:
            return self.free.pop()
        except IndexError:
            return self.make()

    def give(self, stepper: Stepper):
        """Take a stepper back."""
        self.free.append(stepper)


def stepper_pool(system: System, held: bool = False, removal: float = 0.0) -> StepperPool:
    """Steppers of a system, made for its laws as they are now; with inputs that are held in each step, or without.

    Parameters
    ----------
    held : bool
        Whether the inputs of the scene are held in each step.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.
    """
    laws = Laws(smooth_system(system))
    names = tuple(bound.load.name for bound in laws.called)
    make = lambda: StepperPool(lambda: new_contact_stepper(system, held, removal))  # noqa: E731
    return cached(system, (stepper_pool, held, removal, laws.key, names), make)


@contextmanager
def lent_stepper(system: System, held: bool = False, removal: float = 0.0) -> Iterator[Stepper]:
    """Stepper of a system for the time of a block; parameters as of :func:`stepper_pool`."""
    pool = stepper_pool(system, held, removal)
    stepper = pool.take()
    try:
        yield stepper
    finally:
        pool.give(stepper)


def new_contact_stepper(system: System, held: bool = False, removal: float = 0.0) -> Stepper:
    """Stepper of a system, for one motion alone; as of :func:`stepper_pool`."""
    if held or not are_free_in_contact(system):
        return MechanismStepper(system, held, removal)
    return FreeBodyStepper(system, removal)
