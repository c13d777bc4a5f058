"""Fit of motions with events: residuals of the event-driven motion, derivatives by its saltation matrices.

The start follows from the parameters by central differences, which cost no motion.
"""

import numpy as np

from gauss.analysis.fit_problem import FitProblem
from gauss.analysis.sensitivities import sensitivities
from gauss.analysis.sensitivity.motion import Motion
from gauss.dynamics import compile_scene
from gauss.errors import ArgumentError, GaussError, SceneError
from gauss.scene import Scene
from gauss.scene.named_numbers import is_start, parsed, scene_of
from gauss.simulation.tolerances import WHOLE
from gauss.system import System

OF_ELEMENTS = {"bodies": ("mass", "com"), "contacts": ("restitution", "lowest", "highest"), "set_valued": ("limit",)}


def derivative_of(scene: Scene, name: str) -> tuple[str, int] | None:
    """Parameter of :func:`gauss.sensitivities` for a number such as "floor.restitution", and its entry; None for the start.

    ArgumentError if there is no derivative by it through events.
    """
    if is_start(scene, name):
        return None
    path, index = parsed(name)
    owner, _, key = path.rpartition(".")
    if path == "gravity":
        return "gravity", int(index or 0)
    known = any(owner in getattr(scene, group) and key in keys for group, keys in OF_ELEMENTS.items())
    if known or (owner in scene.loads and index is None):
        return f"{key}:{owner}", int(index or 0)
    raise ArgumentError(f"fit_motion: through impacts, stops and friction there are no derivatives by {name!r}; fit others.")


class EventFitProblem(FitProblem):
    """Residuals of a fit of motions with events, and their derivatives."""

    def _prepare(self, step: float, integrator: str):
        """Steps whose ends are the samples, and the parameters by which the motion is differentiated."""
        samples = (self.t - self.t[0]) / step
        self.rows = np.round(samples).astype(int)
        if np.abs(samples - self.rows).max() > WHOLE * self.rows[-1] or not np.diff(self.rows).all():
            raise ArgumentError(
                f"fit_motion: times: with impacts, stops or friction the samples lie on whole multiples of step, {step} s."
            )
        self.h, self.integrator = step, integrator
        self.by = [derivative_of(self.scene, name) for name in self.names]
        self.held = np.repeat(self.inputs, np.diff(self.rows), axis=0)
        self._states(self.first)  # refuses scenes whose events have no derivatives

    def _states(self, p: np.ndarray) -> np.ndarray:
        """States (k, n_x) at the samples."""
        duration = self.h * self.rows[-1]
        return Motion(self._system(p), duration, self.h, None, self.held, (), self.integrator).x[self.rows]

    def _system(self, p: np.ndarray) -> System:
        """System with these parameters."""
        return compile_scene(scene_of(self.scene, dict(zip(self.names, map(float, p), strict=True))))

    def motion(self, p: np.ndarray, directions: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray | None]:
        """Fitted values (k, n), NaN where there is no motion."""
        try:
            return self._states(p)[:, self.places], None
        except GaussError:
            return np.full(self.y.shape, np.nan), None

    def slopes(self, p: np.ndarray) -> np.ndarray:
        """Derivatives (k n, p) of the fitted values."""
        asked = tuple(dict.fromkeys(one[0] for one in self.by if one is not None))
        found = sensitivities(
            self._system(p),
            self.h * self.rows[-1],
            step=self.h,
            inputs=self.held,
            parameters=asked,
            integrator=self.integrator,
        )
        centre = self._start(p)
        columns = []
        for pair, size, name, by in zip(self._beside(p), self.steps, self.names, self.by, strict=True):
            along = self._slope(centre, pair, size, name)
            moved = found.start[self.rows] @ np.linalg.lstsq(found.start[0], along, rcond=None)[0]
            if by is not None:
                moved = moved + found.parameters[by[0]][self.rows][:, :, by[1]]
            columns.append(moved[:, self.places])
        return np.array(columns).transpose(1, 2, 0).reshape(-1, p.size)

    def _start(self, p: np.ndarray) -> np.ndarray:
        """Start (n_x,)."""
        start = self._system(p).initial_state()
        return np.concatenate([start.q, start.v])

    def _if_valid(self, p: np.ndarray) -> np.ndarray | None:
        """Start; None where the scene refuses the parameters."""
        try:
            return self._start(p)
        except SceneError:
            return None
