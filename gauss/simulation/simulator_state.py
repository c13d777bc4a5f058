"""State of a simulator, from which any simulator of the same scene and step continues."""

from typing import Any, NamedTuple

from gauss.simulation.moreau.unseen_contacts import FIRST


class SimulatorState(NamedTuple):
    """State of a simulator, opaque."""

    point: bytes  # point, control: point of the motion and record of its loop
    control: bytes
    begun: float  # time of the state that the motion began from [s]
    steps: int  # steps since then
    contacts: Any = None  # contacts that the next step starts from, where the point does not hold them
    of: tuple = ()  # step and methods of the simulator; any where empty
    # when the next look at the shapes is due, and whether undetected switching was warned of
    watched: tuple = (FIRST, False)
