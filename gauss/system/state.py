"""State of a system: time, joint coordinates and rates."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Entry
from gauss.shapes import Shaped


@dataclass(frozen=True)
class State:
    """Configuration and rates at one instant.

    Parameters
    ----------
    t : float
        Time [s].
    q : ndarray, shape (n_q,)
        Joint coordinates [rad, m]; quaternions are unit, (w, x, y, z).
    v : ndarray, shape (n_v,)
        Joint rates [rad/s, m/s], in the order of ``System.coordinates``.
    """

    t: Entry
    q: Shaped[np.ndarray, " nq"]
    v: Shaped[np.ndarray, " nv"]
