"""Optimal-control problem of a phase, values of a motion on a mesh, and the solution of the nonlinear programme."""

from dataclasses import dataclass, replace

import numpy as np

from gauss.analysis.optimal.conditions import EndCondition
from gauss.analysis.optimal.equations import Casadi, OptimalEquations
from gauss.integrators.collocation import gauss_legendre
from gauss.system import System

SUCCEEDED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


@dataclass(frozen=True)
class MotionProblem:
    """What is to be optimal.

    Parameters
    ----------
    system : System
        The system, whose inputs have limits.
    cost : casadi.Function or None
        (t, x, u) → cost per time; None: the duration is the cost.
    start_time : float
        When the motion begins [s].
    duration : tuple of float
        Least and largest duration [s].
    start, end, increments : tuple of EndCondition
        Conditions on the start, on the end, and on what the end is more than the start.
    bounds : tuple of ndarray
        Least and largest (q, v), least and largest inputs.
    stages : int
        Collocation points s of an interval.
    iterations : int
        Most iterations.
    reset : casadi.Function or None
        (t, x, u) → state after an impact at the end, with which the next phase starts, or to which the increments refer;
        None: there is none.
    meets : casadi.Function or None
        (t, x, u) → what is zero at the end, one number for each condition of ``meeting``.
    meeting : tuple of EndCondition
        Their names.
    gaps, forces : casadi.Function or None
        (t, x, u) → open gaps, and forces of the closed ones, which are not negative.
    gap_labels, force_labels : tuple of (str, float)
        What their values are in messages, and units of them.
    opens : casadi.Function or None
        (t, x, u) → what is not negative at the start: less the forces that gaps which open there would have if closed.
    bears : casadi.Function or None
        (t, x, u) → what is not negative at the end: impulses of gaps that close.
    """

    system: System
    equations: OptimalEquations
    cost: Casadi
    start_time: float
    duration: tuple[float, float]
    start: tuple[EndCondition, ...]
    end: tuple[EndCondition, ...]
    increments: tuple[EndCondition, ...]
    bounds: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    stages: int
    iterations: int
    reset: Casadi = None
    meets: Casadi = None
    meeting: tuple[EndCondition, ...] = ()
    gaps: Casadi = None
    forces: Casadi = None
    opens: Casadi = None
    bears: Casadi = None
    gap_labels: tuple[tuple[str, float], ...] = ()
    force_labels: tuple[tuple[str, float], ...] = ()

    @property
    def units(self) -> np.ndarray:
        """Units of the places of all conditions: those of (q, v), and 1 for what is met at the end."""
        return np.concatenate([self.equations.units, np.ones(len(self.meeting))])

    @property
    def conditions(self) -> list[tuple[str, EndCondition]]:
        """All conditions on the ends, in the order of their rows."""
        kinds = {
            "start": self.start,
            "end": self.end,
            "increase over the period": self.increments,
            "at the end": self.meeting,
        }
        return [(kind, one) for kind, given in kinds.items() for one in given]


@dataclass(frozen=True)
class MotionValues:
    """Values of a motion on a mesh, in shares of the units."""

    mesh: np.ndarray  # (n + 1,) mesh from 0 to 1
    x: np.ndarray  # (n_x, n + 1) states at the mesh points
    z: np.ndarray  # (s, n_x, n) states at the collocation points
    u: np.ndarray  # (2, n_u, n) inputs at begin and end of the intervals
    duration: float  # [s]

    def on(self, mesh: np.ndarray, stages: int) -> "MotionValues":
        """The same motion on another mesh, interpolated."""
        c = gauss_legendre(stages).c
        own = gauss_legendre(len(self.z)).c
        inner = self.mesh[:-1] + np.diff(self.mesh) * own[:, None]
        places, order = np.unique(np.concatenate([self.mesh, inner.ravel()]), return_index=True)
        samples = np.concatenate([self.x, np.moveaxis(self.z, 0, 1).reshape(len(self.x), -1)], axis=1)[:, order]
        at = lambda points: np.array([np.interp(points, places, row) for row in samples])  # noqa: E731
        begins, ends = mesh[:-1], mesh[1:]
        middle = np.clip(np.searchsorted(self.mesh, (begins + ends) / 2.0) - 1, 0, len(self.mesh) - 2)
        low, width = self.mesh[middle], np.diff(self.mesh)[middle]
        share = np.clip([(begins - low) / width, (ends - low) / width], 0.0, 1.0)[:, None]
        u = (1.0 - share) * self.u[0][:, middle] + share * self.u[1][:, middle]
        z = np.array([at(begins + (ends - begins) * node) for node in c])
        return replace(self, mesh=mesh, x=at(mesh), z=z, u=u)


@dataclass(frozen=True)
class Solved:
    """Answer of IPOPT.

    Parameters
    ----------
    values : tuple of MotionValues
        The motion of each phase.
    status : str
        Status in the words of IPOPT.
    kkt, residual : float
        Largest entry of the gradient of the Lagrangian, relative to the largest multiplier or 1, and largest residual of a
        constraint, both in shares of the units.
    misses : tuple of ndarray
        What the conditions on the ends of each phase are missed by, in shares of the units; zero unless they were relaxed.
    """

    values: tuple[MotionValues, ...]
    costs: tuple[float, ...]
    status: str
    iterations: int
    kkt: float
    residual: float
    misses: tuple[np.ndarray, ...]

    @property
    def is_optimal(self) -> bool:
        """Whether IPOPT converged."""
        return self.status in SUCCEEDED
