"""An optimal motion: states at the mesh points, inputs as functions of time, and its accuracy."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gauss import math
from gauss.dynamics.inputs import driven_scene
from gauss.errors import ArgumentError, did_you_mean
from gauss.simulation.simulate import simulate
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System

if TYPE_CHECKING:
    from scipy.interpolate import PPoly
else:
    PPoly = object  # scipy.interpolate is imported where a law is made


@dataclass(frozen=True)
class OptimalMotion:
    """Motion of least cost, with its inputs.

    Parameters
    ----------
    system : System
        The system.
    t : ndarray, shape (k,)
        Mesh points [s].
    q, v : ndarray, shape (k, n_q), (k, n_v)
        Coordinates and rates there.
    inputs : tuple of str
        Names of the inputs.
    law : scipy.interpolate.PPoly
        Inputs (n_u,) [N m, N] at a time [s]; they may jump at mesh points.
    cost : float
        Cost.
    kkt : float
        Largest entry of the gradient of the Lagrangian, relative to the largest multiplier or 1; in shares of the units.
    residual : float
        Largest residual of the equations of the mesh, in shares of the units.
    mesh_error : float
        Largest error of an interval against steps of gauss from its start, in shares of the units.
    simulation_error : float
        The same of the whole motion, simulated from the start with these inputs.
    limit_error : float
        Largest excess over a limit between the points of the mesh: of coordinates, rates, gaps and contact forces, in shares
        of the units.
    iterations : int
        Iterations of all meshes.
    meshes : tuple of tuple
        Intervals and mesh error of each mesh, the first one first.
    """

    system: System = field(repr=False)  # as long as a scene
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    inputs: tuple[str, ...]
    law: PPoly
    cost: float
    kkt: float
    residual: float
    mesh_error: float
    simulation_error: float
    limit_error: float
    iterations: int
    meshes: tuple[tuple[int, float], ...]

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def start(self) -> State:
        """State at the start."""
        return State(float(self.t[0]), self.q[0], self.v[0])

    @property
    def end(self) -> State:
        """State at the end."""
        return State(float(self.t[-1]), self.q[-1], self.v[-1])

    def __getitem__(self, name: str) -> PPoly:
        """Law of one input, as for ``scene.drive(joint, torque=…)``.

        Raises
        ------
        ArgumentError
            If it is none of the motion.
        """
        from scipy.interpolate import PPoly as Piecewise

        if name not in self.inputs:
            raise ArgumentError(f"no input {name!r} in this motion. {did_you_mean(str(name), self.inputs)}")
        return Piecewise(self.law.c[:, :, self.inputs.index(name)], self.law.x)

    def control(self, t: float, q=None, v=None) -> np.ndarray:
        """Inputs (n_u,) at a time [s], as ``gauss.simulate(…, control=…, rate=…)`` and simulators take them."""
        return self.law(np.clip(t, self.t[0], self.t[-1]))

    def simulate(self, **settings) -> Trajectory:
        """Motion of the scene from the start under these inputs.

        Parameters
        ----------
        **settings
            As of :func:`gauss.simulate`: ``times``, ``rtol`` and so on.

        Returns
        -------
        Trajectory
            The motion.
        """
        laws = {name: lambda t, law=self[name]: math.piecewise(law, t) for name in self.inputs}
        return simulate(driven_scene(self.system.scene, laws), self.duration, state=self.start, **settings)

    def __str__(self):
        return (
            f"{self.duration:.6g} s, cost {self.cost:.9g}, {len(self.t) - 1} intervals, {self.iterations} iterations; KKT "
            f"{self.kkt:.1e}, mesh error {self.mesh_error:.1e}, simulated with an error of {self.simulation_error:.1e}"
        )
