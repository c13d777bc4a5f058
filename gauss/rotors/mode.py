"""What holds between two events: directions of power, what sticks, what touches, which way things turn."""

from dataclasses import dataclass

import numpy as np

from gauss.rotors.reduced import Reduced, friction_drives


@dataclass(frozen=True)
class Mode:
    """Discrete state of a network.

    Parameters
    ----------
    forward : ndarray of bool, shape (n_l,)
        Whether power flows from driver to driven.
    state : ndarray, shape (n_l,)
        Sign of the slip of dry links, 0 where they hold; flank of springs with backlash.
    direction : ndarray, shape (n_g,)
        Way that each group turns or sets out to turn, 0 if friction holds it.
    gate : ndarray, shape (n_terms,)
        1 for torques that act.
    dry_limit : ndarray, shape (n_d,)
        Dry friction of shafts [N m].
    signs : ndarray, shape (n_i,)
        Sign of each indicator, 0 if it started at zero.
    """

    forward: np.ndarray
    state: np.ndarray
    direction: np.ndarray
    gate: np.ndarray
    dry_limit: np.ndarray
    signs: np.ndarray

    def same(self, other: "Mode") -> bool:
        """Whether nothing that the equations depend on differs."""
        keys = ("forward", "state", "direction", "gate", "dry_limit")
        return all(np.array_equal(getattr(self, key), getattr(other, key)) for key in keys)


@dataclass(frozen=True)
class Indicator:
    """Quantity whose change of sign is an event, though it changes no equation.

    Parameters
    ----------
    element : str
        What it is about.
    falling, rising : str
        Kind of event when it becomes negative or positive.
    """

    element: str
    falling: str
    rising: str


def indicators(reduced: Reduced) -> list[Indicator]:
    """Indicators in the order of :func:`indicate`, the speeds of the groups first."""
    found = [Indicator(reduced.names[root], "reversal", "reversal") for root in reduced.roots]
    for _, link in friction_drives(reduced):
        found += [Indicator(link.name, "slip reversal", "slip reversal"), Indicator(link.name, "rest", "start")]
        if link.largest_slip is not None:
            found.append(Indicator(link.name, "beyond the range of the curve", "in the range of the curve"))
        if link.curve.peak is not None:
            found.append(Indicator(link.name, "past the peak", "before the peak"))
    found += [Indicator(term.name, "corner", "corner") for term in reduced.terms for _ in term.law.kinks]
    return found


def indicate(reduced: Reduced, speed: np.ndarray) -> np.ndarray:
    """Indicators (n_i,) at given speeds (n,) of the shafts, each over its own scale."""
    scale = reduced.v_0
    found = [speed[root] / scale for root in reduced.roots]
    for b, link in friction_drives(reduced):
        v_d, v = speed[reduced.driver[b]], link.ratio * speed[reduced.driven[b]]
        faster = max(abs(v_d), abs(v))
        slip = abs(v_d - v) / max(faster, scale)
        found += [(abs(v_d) - abs(v)) / scale, faster / scale - 1.0]
        if link.largest_slip is not None:
            found.append(link.largest_slip - slip)
        if link.curve.peak is not None:
            found.append(link.curve.peak - slip)
    for term in reduced.terms:
        found += [(speed[reduced.names.index(term.shaft)] - kink) / scale for kink in term.law.kinks]
    return np.array(found)
