"""State of a system: time, joint coordinates and rates."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from gauss.codegen import Scalar
from gauss.shapes import Shaped

if TYPE_CHECKING:
    Time = Any  # a number, or an Expression in traced functions: which of them is as open as the elements of q and v are
else:
    Time = Scalar


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

    t: Time
    q: Shaped[np.ndarray, " nq"]
    v: Shaped[np.ndarray, " nv"]
