"""Events of time stepping: changes of the contact mode, each at the end of its step."""

from collections.abc import Iterable

import numpy as np

from gauss.dynamics.contact.contact_changes import ModeChange
from gauss.dynamics.contact.step_modes import UNKNOWN, StepModes, changes_of
from gauss.simulation.motion_records import Event

CHANGES = {(0, 1): "closes", (0, 2): "closes", (1, 2): "slips", (2, 1): "holds"}  # kinds of events by the modes


def event_of(change: ModeChange, element: str, t: float, begins: bool) -> Event | None:
    """Event of a change of an element in a step that ends at t [s]; None where the element begins with this mode."""
    hits = change.hit and change.before <= 0
    if begins and not hits:
        return None
    kind = "impact" if hits else CHANGES.get((change.before, change.after), "opens")
    return Event(t, kind, (element,), change.lost if hits else 0.0)


class ContactEvents:
    """Events by the modes after the steps of one motion.

    Parameters
    ----------
    modes : StepModes
        Modes of the scene.
    """

    def __init__(self, modes: StepModes):
        self.elements, self.modes = modes.elements, np.full(len(modes.elements), UNKNOWN)

    def of(self, times: Iterable[float], rows: np.ndarray) -> list[Event]:
        """Events of the next steps, from their ends (k,) [s] and :meth:`StepModes.after` (k, c + n)."""
        ends = list(times)
        found = (
            event_of(change, self.elements[change.element], float(ends[change.step]), change.before == UNKNOWN)
            for change in changes_of(rows, self.modes)
        )
        return [event for event in found if event is not None]
