"""State of a simulator, from which any simulator of the same scene and step continues."""

from typing import Any, NamedTuple

from gauss.simulation.moreau.unseen_contacts import FIRST


class SimulatorState(NamedTuple):
    """State of a simulator, opaque.

    Attributes
    ----------
    point, control : bytes
        Point of the motion and record of its loop.
    begun : float
        Time of the state that the motion began from [s].
    steps : int
        Steps since then.
    contacts : object
        Contacts that the next step starts from, where the point does not hold them.
    of : tuple
        Step and methods of the simulator; any where empty.
    watched : tuple
        When the next look at the shapes is due, and whether undetected switching was warned of.
    """

    point: bytes
    control: bytes
    begun: float
    steps: int
    contacts: Any = None
    of: tuple = ()
    watched: tuple = (FIRST, False)
