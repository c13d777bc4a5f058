"""Meshes: the first one, whose intervals end where laws of time switch, the error of one, and finer ones.

For the error each interval is integrated again from its start by compiled steps of gauss, under the found inputs: those of
:mod:`gauss.dynamics.motion_step`, Runge–Kutta of order 4 with a projection onto the constraints, so short that their own
error is small against that of the collocation. Within an interval the collocation is right for smooth laws; a narrow one may
lie between all of its points.
"""

from functools import cached_property

import numpy as np

from gauss.analysis.optimal.equations import OptimalEquations
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.laws.switching_times import APART, distinct
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.motion_step import MotionStep
from gauss.integrators import Rates
from gauss.simulation.passed_switching import smooth_timetable, warn_of_features
from gauss.system import State, System

SUBSTEPS = 16  # of an interval: the error of order 4 is 65 000 times smaller than with one step
MOST_PARTS = 4  # of an interval, from one mesh to the next
MOST_PLACES = 20  # of an interval: more switching times and cells of a law are left to the check of the result
MESH_DISTANCE = 0.01  # of an equal interval: a mesh point nearer to a switching time gives way to it
MARGIN = 4.0 * APART  # relative to the times: no evaluation falls upon a switching time at an end of the interval


class LinearInputStep(MotionStep):
    """Step under inputs that are linear in time, u = u₀ + (t − t₀) u′; what a step takes as parameters are t₀, u₀, u′.

    Parameters
    ----------
    equations : OptimalEquations
        Equations of motion.
    """

    def __init__(self, equations: OptimalEquations):
        super().__init__(equations.system, "rk4")
        self.equations, self.inputs, self.n_p = equations, (), 1 + 2 * equations.n_u
        self.key = (LinearInputStep, self.laws.key)

    def evaluate(self, state: State, delta) -> Rates:
        """Rates of a state."""
        (begin,), value, slope = np.split(delta, [1, 1 + self.equations.n_u])
        loads = self.equations.loads(value + (state.t - begin) * slope)
        still = np.zeros(self.system.n_v)
        return Rates(LoadedMechanism(self.system, loads, state.t, state.q, state.v, still).accelerations(), np.zeros(3))

    def interval(self, t: float, h: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(q, v) at the start and after each part (SUBSTEPS + 1, n_x) of an interval, from inputs u (2, n_u) at its ends."""
        given, margin = np.concatenate([[t], u[0], (u[1] - u[0]) / h]), MARGIN * max(abs(t), abs(t + h))
        begin, step, found = t + margin, (h - 2.0 * margin) / SUBSTEPS, [x]
        for k in range(SUBSTEPS):
            found.append(self.move(np.concatenate([[begin + k * step, step], found[-1], given])))
        return np.array(found)


class MeshError:
    """Errors of found motions of one system."""

    def __init__(self, equations: OptimalEquations):
        self.equations = equations

    @cached_property
    def step(self) -> LinearInputStep:
        """Its compiled step."""
        return LinearInputStep(self.equations)

    def moved(self, t: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """States (n, SUBSTEPS + 1, n_q + n_v) along each interval from its own start.

        Parameters
        ----------
        t : ndarray, shape (n + 1,)
            Mesh points [s].
        x : ndarray, shape (n + 1, n_q + n_v)
            States there.
        u : ndarray, shape (n, 2, n_u)
            Inputs at the ends of the intervals.
        """
        return np.array([self.step.interval(t[k], t[k + 1] - t[k], x[k], u[k]) for k in range(len(u))])

    def of_intervals(self, moved: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Error (n,) of each interval whose states are moved, the largest of all coordinates and rates in their units."""
        return np.abs((moved[:, -1] - x[1:]) / self.equations.units).max(axis=1)

    def simulated(self, t: np.ndarray, start: np.ndarray, u: np.ndarray) -> np.ndarray:
        """States (n + 1, n_q + n_v) of a motion from the start under the inputs."""
        found = [start]
        for k in range(len(u)):
            found.append(self.step.interval(t[k], t[k + 1] - t[k], found[-1], u[k])[-1])
        return np.array(found)


def refined(mesh: np.ndarray, errors: np.ndarray, excess: np.ndarray, tolerance: float, order: int) -> np.ndarray:
    """Mesh with smaller errors and excesses over limits; an interval makes at most four.

    Parameters
    ----------
    mesh : ndarray, shape (n + 1,)
        Mesh from 0 to 1.
    errors, excess : ndarray, shape (n,)
        Error of each interval, ∝ h^(order + 1), and what it is beyond limits by, ∝ h²; zero where it is small enough.
    tolerance : float
        Largest error and excess.
    order : int
        Order of the collocation.
    """
    counts = np.maximum(*(_parts(*one, tolerance) for one in ((errors, order + 1), (excess, 2))))
    pieces = [np.linspace(a, b, m, endpoint=False) for a, b, m in zip(mesh[:-1], mesh[1:], counts, strict=True)]
    return np.concatenate([*pieces, mesh[-1:]])


def _parts(sizes: np.ndarray, power: int, tolerance: float) -> np.ndarray:
    """Parts of each interval, for sizes ∝ h^power."""
    counts = np.ceil((sizes / (0.5 * tolerance)) ** (1.0 / power))
    return np.where(sizes > tolerance, np.clip(counts, 2, MOST_PARTS), 1).astype(int)


def law_mesh(system: System, start: State, span: tuple[float, float], intervals: int) -> np.ndarray:
    """First mesh (n + 1,) on [0, 1]: equal intervals, divided where laws of time switch if the duration is given [s].

    SimulationError if a prescribed position or velocity jumps.
    """
    equal, (duration, longest) = np.linspace(0.0, 1.0, intervals + 1), span
    if duration != longest:
        return equal
    begin, end = start.t, start.t + duration
    times = smooth_timetable(system, Laws(system), start, end)
    places = (np.array([0.5 * (before + after) for before, after in times.stops(begin, end)[:-1]]) - begin) / duration
    if not places.size or places.size > MOST_PLACES * intervals:
        return equal
    inner = equal[1:-1]
    far = np.abs(inner[:, None] - places).min(axis=1) > MESH_DISTANCE / intervals
    return distinct(np.concatenate([equal[[0, -1]], inner[far], places]))


def warn_of_passed(system: System, start: State, t: np.ndarray):
    """Warn of features of laws of time that pass between all times at which a mesh t (n + 1,) was checked [s].

    SimulationError if a prescribed position or velocity jumps.

    Warns
    -----
    SwitchingWarning
        With the scene.
    """
    times = smooth_timetable(system, Laws(system), start, float(t[-1]))
    edges = distinct(np.clip(np.concatenate([t[[0, -1]], times.switches, times.mesh]), t[0], t[-1]))
    if edges.size < 3:
        return
    middle = 0.5 * (edges[1:] + edges[:-1])
    steps = (np.diff(t) / SUBSTEPS)[np.clip(np.searchsorted(t, middle) - 1, 0, len(t) - 2)]
    passed = np.diff(edges) < steps
    if passed.any():
        warn_of_features(system.scene.name, float(steps[passed].max()), "give more intervals=", float(middle[passed][0]))
