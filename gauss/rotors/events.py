"""Events of a run: what changed between two phases."""

from dataclasses import dataclass

import numpy as np

from gauss.rotors.links import Gear, OneWayClutch
from gauss.rotors.mode import indicators
from gauss.rotors.phase import Phase

TURNED = 0.5  # a slip beyond this at a change of its sign: the wheels turn against each other, and nothing is reversed


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Parameters
    ----------
    time : float
        When [s].
    kind : str
        What: "power reversal", "slip reversal", "stall", "start", "lock", "slip", "engage", "release", "contact",
        "separate", "stuck", "reversal", "rest", "switch", "corner", …
    element : str
        Shaft, link or torque.
    """

    time: float
    kind: str
    element: str

    def __str__(self):
        return f"{self.time:12.6f} s  {self.kind:28} {self.element}"


def changes(before: Phase, after: Phase, t: float, speed: np.ndarray) -> list[Event]:
    """Events that lie between two phases; speed (n,) of the shafts there."""
    reduced, old, new = before.reduced, before.mode, after.mode
    found = []
    for b, link in enumerate(reduced.links):
        if link.dry and old.state[b] != new.state[b]:
            held, free = ("engage", "release") if isinstance(link, OneWayClutch) else ("lock", "slip")
            found.append((held if new.state[b] == 0 else free if old.state[b] == 0 else "slip reversal", link.name))
        if link.backlash and old.state[b] != new.state[b]:
            found.append(("contact" if new.state[b] else "separate", link.name))
        if link.lossy and old.forward[b] != new.forward[b]:
            found.append(("power reversal", link.name))
    for g, root in enumerate(reduced.roots):
        if (old.direction[g] == 0) != (new.direction[g] == 0):
            loaded = [
                j for d, j in enumerate(reduced.dry) if reduced.group[j] == g and (old.dry_limit + new.dry_limit)[d] > 0
            ]
            kind = "start" if new.direction[g] else "stall" if loaded else "stuck"
            found.append((kind, reduced.names[loaded[0] if loaded else root]))
    for term, was, now in zip(reduced.terms, old.gate, new.gate, strict=True):
        if was != now:
            found.append(("switch", term.name))
    for j, (was, now) in zip(reduced.dry, zip(old.dry_limit, new.dry_limit, strict=True), strict=True):
        if was != now:
            found.append(("switch", f"dry friction of {reduced.names[j]}"))
    for i, indicator in enumerate(indicators(reduced)):
        if old.signs[i] * new.signs[i] < 0:
            kind = indicator.rising if new.signs[i] > 0 else indicator.falling
            if kind != "slip reversal" or _alike(reduced, indicator.element, speed):
                found.append((kind, indicator.element))
    return [Event(t, kind, element) for kind, element in dict.fromkeys(found)]


def _alike(reduced, name: str, speed) -> bool:
    """Whether the wheels of a friction drive turn alike."""
    b = next(b for b, link in enumerate(reduced.links) if link.name == name)
    v_d, v = speed[reduced.driver[b]], reduced.links[b].ratio * speed[reduced.driven[b]]
    return abs(v_d - v) <= TURNED * max(abs(v_d), abs(v), reduced.v_0)


def backward_with_slip(before: Phase, after: Phase) -> list[str]:
    """Gears of constant slip through which the power now flows back, where a constant slip describes nothing real."""
    links, was, now = after.reduced.links, before.mode.forward, after.mode.forward
    return [link.name for b, link in enumerate(links) if isinstance(link, Gear) and link.slip and was[b] and not now[b]]
