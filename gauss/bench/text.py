"""Numbers of the comparison in words."""

import numpy as np


def in_time(seconds: float) -> str:
    """Time in the unit that fits."""
    if not np.isfinite(seconds):
        return "–"
    return f"{1e6 * seconds:.3g} µs" if seconds < 1e-3 else f"{1e3 * seconds:.3g} ms"


def number(value: float) -> str:
    """Error by its decade."""
    if value == 0.0:
        return "0"
    return f"{value:.0e}" if np.isfinite(value) else "–"


def share(value: float) -> str:
    """Share in percent."""
    return f"{value:.0%}" if np.isfinite(value) else ""
