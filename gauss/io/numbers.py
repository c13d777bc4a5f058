"""Decimal numbers in text, read alike in every format and locale, and limits that mean that there is none."""

import re

import numpy as np

from gauss.errors import FileError, did_you_mean

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
LIMITS = ("start", "stops")  # how limits of joints are read: for the search of the initial state, or as stops, too
UNIT_VECTORS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}  # by the names that formats use
UNLIMITED = 1e16  # rad or m: formats write this, the largest double or infinity where there is no limit


def number(token: str) -> float | None:
    """Number that a token is; None if it is anything else, such as ``1kg``, ``0x10``, ``1,5``, ``nan`` or ``inf``."""
    return float(token) if NUMBER.fullmatch(token) else None


def numbers(text: str | None, count: int) -> tuple[float, ...] | None:
    """So many finite numbers with white space between and around them; None if the text is anything else."""
    found = [value for token in (text or "").split() if (value := number(token)) is not None]
    if len(found) != count or len((text or "").split()) != count or not np.isfinite(found).all():
        return None
    return tuple(found)


def check_option(path, name: str, given: str, options: tuple[str, ...]):
    """Refuse an option of a reader that is none.

    FileError with the file, the name of the option, its values, and the one that may have been meant.
    """
    if given not in options:
        raise FileError(f"{path}: {name}: expected {' or '.join(map(repr, options))}. {did_you_mean(str(given), options)}")


def bounds(lowest: float, highest: float) -> tuple[float, float] | None:
    """Limits of a coordinate [rad, m]; None where there is one on neither side.

    A side without limit is at ±:data:`UNLIMITED`, beyond which no joint gets.
    """
    lowest, highest = max(lowest, -UNLIMITED), min(highest, UNLIMITED)
    return None if lowest == -UNLIMITED and highest == UNLIMITED else (lowest, highest)


def add_stop(scene, joint: str):
    """Stops at the limits of a joint, on the sides that have one."""
    limits = scene.joints[joint].limits
    if limits is not None:
        scene.stop(joint, *(None if abs(end) >= UNLIMITED else end for end in limits))
