"""Mode of a network between two events: directions of power flow, sticking or slipping, backlash sides, rotation."""

from dataclasses import dataclass

import numpy as np

from gauss.rotors.reduced import ReducedNetwork


@dataclass(frozen=True)
class Mode:
    """Discrete state of a network.

    Parameters
    ----------
    forward : ndarray of bool, shape (n_l,)
        Whether power flows from driver to driven.
    state : ndarray, shape (n_l,)
        Sign of the slip of dry links, 0 where they stick; backlash side of springs, 0 for none.
    direction : ndarray, shape (n_g,)
        Sense in which each group turns or breaks away, 0 if it sticks at rest.
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
        """Whether the equations of both modes are equal."""
        keys = ("forward", "state", "direction", "gate", "dry_limit")
        return all(np.array_equal(getattr(self, key), getattr(other, key)) for key in keys)


@dataclass(frozen=True)
class Indicator:
    """Quantity whose change of sign is an event that changes no equation."""

    element: str  # shaft, link or torque
    falling: str  # falling, rising: kind of event when it becomes negative or positive
    rising: str


def indicators(reduced: ReducedNetwork) -> list[Indicator]:
    """Indicators in the order of :func:`indicate`, the speeds of the groups first."""
    found = [Indicator(reduced.names[root], "reversal", "reversal") for root in reduced.roots]
    drives = [reduced.links[b] for b in reduced.friction_drives]
    found += [Indicator(link.name, "slip reversal", "slip reversal") for link in drives]
    found += [Indicator(link.name, "rest", "start") for link in drives]
    found += [Indicator(reduced.links[b].name, *kinds) for b, _, *kinds in _slip_limits(reduced)]
    found += [Indicator(term.name, "corner", "corner") for term in reduced.terms for _ in term.law.kinks]
    return found


def _slip_limits(reduced: ReducedNetwork):
    """Slips that are reported: (friction drive, slip, kinds of event beyond and within)."""
    for b in reduced.friction_drives:
        link = reduced.links[b]
        if link.largest_slip is not None:
            yield b, link.largest_slip, "beyond the range of the curve", "in the range of the curve"
        if link.curve.peak is not None:
            yield b, link.curve.peak, "past the peak", "before the peak"


def indicate(reduced: ReducedNetwork, speed: np.ndarray) -> np.ndarray:
    """Indicators (n_i,) at given speeds (n,) of the shafts, each over its own scale."""
    scale, drives = reduced.v_0, reduced.friction_drives
    v_d, v = speed[reduced.driver[drives]], reduced.ratio[drives] * speed[reduced.driven[drives]]
    faster = np.maximum(np.abs(v_d), np.abs(v))
    slip = dict(zip(drives, np.abs(v_d - v) / np.maximum(faster, scale), strict=True))
    found = [*speed[list(reduced.roots)] / scale, *(np.abs(v_d) - np.abs(v)) / scale, *faster / scale - 1.0]
    found += [limit - slip[b] for b, limit, *_ in _slip_limits(reduced)]
    for term in reduced.terms:
        found += [(speed[reduced.names.index(term.shaft)] - kink) / scale for kink in term.law.kinks]
    return np.array(found)
