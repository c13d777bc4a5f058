"""Events of a run: differences between the modes of two phases."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gauss.rotors.friction_links import OneWayClutch
from gauss.rotors.links import GearPair
from gauss.rotors.mode import Mode, indicators
from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import ReducedNetwork

OPPOSED_SLIP = 0.5  # beyond this slip wheels turn against each other, and a change of sign is no reversal


@dataclass(frozen=True)
class RotorEvent:
    """Change of the mode of a network, or of the sign of an indicator.

    Parameters
    ----------
    time : float
        Time [s].
    kind : str
        "power reversal", "slip reversal", "stall", "start", "lock", "slip", "engage", "release", "contact",
        "separate", "stuck", "reversal", "rest", "switch", "corner", …
    element : str
        Shaft, link or torque.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> brake = fan.torque(wheel, rotors.Dry(10.0))
    >>> clutch = fan.clutch("clutch", wheel, motor, torque=30.0)
    >>> push = fan.torque(motor, rotors.Constant(25.0), until=0.1)
    >>> run = rotors.simulate(fan, 0.3)
    >>> run.events[0].kind, round(run.events[0].time, 6), run.events[0].element
    ('switch', 0.1, 'torque on motor')
    """

    time: float
    kind: str
    element: str

    def __str__(self):
        return f"{self.time:12.6f} s  {self.kind:28} {self.element}"


def changes(before: NetworkPhase, after: NetworkPhase, t: float, speed: np.ndarray) -> list[RotorEvent]:
    """Events that lie between two phases.

    Parameters
    ----------
    before, after : NetworkPhase
        The phases.
    t : float
        Time [s].
    speed : ndarray, shape (n,)
        Speeds of the shafts then [rad/s].
    """
    reduced, old, new = before.reduced, before.mode, after.mode
    kinds = [_of_links(reduced, old, new), _of_groups(reduced, old, new), _of_torques(reduced, old, new)]
    found = [event for events in kinds for event in events] + list(_of_indicators(reduced, old, new, speed))
    return [RotorEvent(t, kind, element) for kind, element in dict.fromkeys(found)]


Kinds = Iterator[tuple[str, str]]  # kind and element of events


def _of_links(reduced: ReducedNetwork, old: Mode, new: Mode) -> Kinds:
    """Sticking and slipping, contact and separation, reversal of power."""
    for b, link in enumerate(reduced.links):
        was, now = old.state[b], new.state[b]
        if link.dry and was != now:
            sticks, slips = ("engage", "release") if isinstance(link, OneWayClutch) else ("lock", "slip")
            yield sticks if now == 0 else slips if was == 0 else "slip reversal", link.name
        if link.backlash and was != now:
            yield "contact" if now else "separate", link.name
        if link.lossy and old.forward[b] != new.forward[b]:
            yield "power reversal", link.name


def _of_groups(reduced: ReducedNetwork, old: Mode, new: Mode) -> Kinds:
    """Breakaway and sticking of groups."""
    limit = old.dry_limit + new.dry_limit
    for g, root in enumerate(reduced.roots):
        if (old.direction[g] == 0) != (new.direction[g] == 0):
            loaded = [j for d, j in enumerate(reduced.dry) if reduced.group[j] == g and limit[d] > 0]
            kind = "start" if new.direction[g] else "stall" if loaded else "stuck"
            yield kind, reduced.names[loaded[0] if loaded else root]


def _of_torques(reduced: ReducedNetwork, old: Mode, new: Mode) -> Kinds:
    """Start and end of torques."""
    for term, was, now in zip(reduced.terms, old.gate, new.gate, strict=True):
        if was != now:
            yield "switch", term.name
    for j, was, now in zip(reduced.dry, old.dry_limit, new.dry_limit, strict=True):
        if was != now:
            yield "switch", f"dry friction of {reduced.names[j]}"


def _of_indicators(reduced: ReducedNetwork, old: Mode, new: Mode, speed: np.ndarray) -> Kinds:
    """Changes of sign of indicators."""
    for i, indicator in enumerate(indicators(reduced)):
        if old.signs[i] * new.signs[i] < 0:
            kind = indicator.rising if new.signs[i] > 0 else indicator.falling
            if kind != "slip reversal" or _same_sense(reduced, indicator.element, speed):
                yield kind, indicator.element


def _same_sense(reduced: ReducedNetwork, name: str, speed: np.ndarray) -> bool:
    """Whether the wheels of a friction drive roll in the same sense."""
    b = next(b for b, link in enumerate(reduced.links) if link.name == name)
    v_d, v = speed[reduced.driver[b]], reduced.links[b].ratio * speed[reduced.driven[b]]
    return abs(v_d - v) <= OPPOSED_SLIP * max(abs(v_d), abs(v), reduced.v_0)


def backward_with_slip(before: NetworkPhase, after: NetworkPhase) -> list[str]:
    """Gears of constant slip whose power flow turns backward, for which a constant slip is no model."""
    links, was, now = after.reduced.links, before.mode.forward, after.mode.forward
    return [link.name for b, link in enumerate(links) if isinstance(link, GearPair) and link.slip and was[b] and not now[b]]
