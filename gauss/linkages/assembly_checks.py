"""Refusal of crank angles at which a linkage cannot be assembled or is singular, warnings near singular positions."""

import warnings

import numpy as np

from gauss.errors import LinkageError, NearSingularWarning
from gauss.linkages.chain import Dyad
from gauss.linkages.crank_ranges import closing_ranges
from gauss.linkages.cycle_result import Cycle
from gauss.linkages.motion import LinkageKinematics

WARNED_CONDITION = 1e3  # condition number of a group: some 0.1° from a singular position
LARGEST_ERROR = 1e-6  # relative error above which a group counts as singular: fewer than six digits are left
SINGULAR_CONDITION = 2.0**52  # condition number of a matrix that is singular in doubles


def check_assembled(motion: LinkageKinematics) -> None:
    """Check that all groups can be assembled at all crank angles.

    LinkageError if one cannot; the message names it and the angles at which the linkage closes.
    """
    for group, slack in zip(motion.chain.groups, motion.slack, strict=True):
        for words, value in slack.items():
            bad = ~(np.broadcast_to(value, motion.crank_angle.shape) >= 0)
            if bad.any():
                raise LinkageError(_open(motion, group, words, value, bad))


def _open(motion: LinkageKinematics, group, words: str, value, bad) -> str:
    worst = np.flatnonzero(bad)[np.argmax(np.nan_to_num(-value[bad], nan=np.inf))]
    amount = "" if isinstance(value[worst], float) and np.isnan(value[worst]) else f" by {-value[worst]:.6g} m"
    amount = amount if isinstance(group, Dyad) else ""
    ranges = closing_ranges(motion.chain)
    where = " and ".join(f"from {degrees(a)} to {degrees(b)}" for a, b in ranges)
    closing = f"It closes for crank angles {where}." if ranges else "It closes at no crank angle: check the lengths."
    return (
        f"{motion.chain.name}: the {group.name} does not close at crank angle {degrees(motion.crank_angle[worst])}: "
        f"it is {words}{amount}. {closing}"
    )


def degrees(angle: float) -> str:
    """Angle in both units, for messages."""
    return f"{angle:.6g} rad ({np.degrees(angle):.4g}°)"


def check_regular(found: Cycle, kappa: np.ndarray) -> None:
    """Refuse crank angles at which too few digits are left, and warn of nearly singular ones.

    LinkageError if fewer than six digits are left.
    """
    if not kappa.size:
        return
    groups, nowhere = found.chain.groups, np.where(np.isfinite(found.error), found.error, np.inf)
    worst = int(np.argmax(nowhere))
    if not nowhere[worst] <= LARGEST_ERROR:
        where = _where(found, kappa, groups, worst, "too near a singular position")
        raise LinkageError(
            f"{where}: lengths and angles, rounded to doubles, determine {_digits(nowhere[worst])} of torque, reactions or "
            "accelerations. Leave this angle out."
        )
    highest = kappa.max(axis=0)
    if highest.max() > WARNED_CONDITION:
        worst = int(np.argmax(np.where(highest > WARNED_CONDITION, found.error, -1.0)))
        where = _where(found, kappa, groups, worst, "nearly singular")
        warnings.warn(
            f"{where}: lengths and angles, rounded to doubles, determine {_digits(found.error[worst])} of torque, "
            "reactions and accelerations there.",
            NearSingularWarning,
            stacklevel=3,
        )


def _where(found: Cycle, kappa: np.ndarray, groups, k: int, what: str) -> str:
    which = int(np.argmax(np.nan_to_num(kappa[:, k], nan=np.inf, posinf=np.inf)))
    what = what if np.isfinite(kappa[which, k]) and kappa[which, k] < SINGULAR_CONDITION else "singular"
    return (
        f"{found.chain.name}: the {groups[which].name} is {what} at crank angle {degrees(found.crank_angle[k])} "
        f"(condition number {kappa[which, k]:.1e})"
    )


def _digits(error: float) -> str:
    digits = int(-np.log10(max(error, np.finfo(float).tiny))) if error < 1.0 else 0
    return {0: "no digit", 1: "one digit"}.get(digits, f"{digits} digits")
