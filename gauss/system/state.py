"""State of a system, and a view of it: positions and velocities by name, of numbers, or of symbols that are traced."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from gauss.codegen import Entry
from gauss.rotations import cross
from gauss.scene import GROUND
from gauss.shapes import Shaped
from gauss.system import frames

if TYPE_CHECKING:
    from gauss.system.system import System


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


ORIGIN = (0.0, 0.0, 0.0)  # of a frame


class ByBody(Protocol):
    """An array of each body, by its index."""

    def __getitem__(self, body: int, /) -> np.ndarray:
        """Array of a body."""


class View:
    """View of the mechanism, the argument of laws and constraints: R, x, W, u of the bodies, and a state.

    Attributes
    ----------
    system : System
        The mechanism.
    state : State
        Time, coordinates, rates.
    R, x : sequence of ndarray
        Rotation (3, 3) from principal axes to world, and centre of mass (3,) [m], of each body; −1 is the ground.
    W, u : sequence of ndarray
        Angular velocity (3,) [rad/s] and velocity of the centre of mass (3,) [m/s] in world axes.
    """

    system: "System"
    state: State
    R: ByBody
    x: ByBody
    W: ByBody
    u: ByBody

    @property
    def t(self):
        """Time [s]."""
        return self.state.t

    def coordinate(self, joint: str):
        """Coordinate of a joint [rad, m]: a number for one freedom or one coordinate of many ("U.angle1"), else an array."""
        placed, k = self.system.coordinate(joint)
        q = self.coordinates_of(placed)
        return one(q) if k is None else q[placed.plain(k)]

    def rate(self, joint: str):
        """Rate of a joint [rad/s, m/s]: a number for one freedom or one rate of many ("U.angle1"), else an array."""
        placed, k = self.system.coordinate(joint)
        v = self.rates_of(placed)
        return one(v) if k is None else v[k]

    def coordinates_of(self, joint) -> np.ndarray:
        """All coordinates of a placed joint."""
        return self.state.q[joint.q]

    def rates_of(self, joint) -> np.ndarray:
        """All rates of a placed joint."""
        return self.state.v[joint.v]

    def position(self, frame: str, point=ORIGIN) -> np.ndarray:
        """Position (3,) in world [m] of a point given in the frame of a body, or of a named frame."""
        placed = self.system.frame(frame)
        own = placed.p if point is ORIGIN else placed.p + placed.R @ np.asarray(point)  # the usual case, quickly
        return self.x[placed.body] + self.R[placed.body] @ own

    def rotation(self, frame: str) -> np.ndarray:
        """Rotation (3, 3) from the frame of a body, or a named frame, to world."""
        placed = self.system.frame(frame)
        return self.R[placed.body] @ placed.R

    def reference(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and origin (3,) of a frame in world at the reference configuration: constants."""
        placed, scene = self.system.frame(frame), self.system.scene
        if placed.body < 0:
            return placed.R, placed.p
        body = self.system.structure.bodies[placed.body]
        central = frames.compose(frames.relative(scene, GROUND, body), frames.central(scene, body))
        return frames.compose(central, (placed.R, placed.p))

    def velocity(self, frame: str, point=ORIGIN) -> np.ndarray:
        """Velocity (3,) in world [m/s] of a point fixed in a body."""
        return self.velocity_at(frame, self.position(frame, point))

    def velocity_at(self, frame: str, place) -> np.ndarray:
        """Velocity (3,) in world [m/s] of the material point of a body at a place in the world."""
        body = self.system.frame(frame).body
        return self.u[body] + cross(self.W[body], np.asarray(place) - self.x[body])

    def angular_velocity(self, frame: str) -> np.ndarray:
        """Angular velocity (3,) in world axes [rad/s]."""
        return self.W[self.system.frame(frame).body]


def one(values):
    """Return the only entry of an array of one, else the array."""
    return values[0] if len(values) == 1 else values
