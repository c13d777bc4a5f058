"""Least squares of a fit of motions: residuals of the computed motion and their derivatives by the parameters.

How numbers of the compiled system and its consistent start follow from the parameters is differentiated by central
differences: that is smooth, and costs no motion.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from gauss.analysis.fitted_motion import MotionFit
from gauss.analysis.sensitivity.parametrised_step import ParametrisedStep
from gauss.analysis.sensitivity.timed_steps import timed_steps
from gauss.arguments import name_list, real_array, table
from gauss.dynamics import compile_scene
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import numbers, parametrised
from gauss.errors import ArgumentError, GaussError, SceneError, StateError, did_you_mean
from gauss.scene import Scene
from gauss.scene.named_numbers import POSITIVE, scene_of, value_of
from gauss.system.coordinate_names import state_names

DIFFERENCE = 1e-5  # of parameters in their units: errors of central differences are 1e-10 of them
UNIDENTIFIABLE = 1e-8  # singular values below this share of the largest: round-off of the derivatives
NAMED = 0.1  # share of a parameter in a direction without effect from which it is named
MOST_EVALUATIONS = 100  # motions of one fit; few of them converge in more than ten
CONVERGED = 1e-12  # relative change of the sum of squares, of the parameters, and of the gradient


class FitProblem:
    """Residuals of a fit and their derivatives."""

    def __init__(self, scene: Scene, times, measured, parameters, step: float, inputs, integrator: str):
        self.scene, self.t = scene, _times(times, step)
        self.names = name_list(parameters, "fit_motion: parameters")
        if not self.names or isinstance(parameters, str):
            raise ArgumentError(f"fit_motion: parameters: expected names, got {parameters!r}.")
        known = parameters if isinstance(parameters, Mapping) else {name: value_of(scene, name) for name in self.names}
        self.first = real_array([known[name] for name in self.names], "fit_motion: parameters", "a number for each")
        if self.first.shape != (len(self.names),) or not np.isfinite(self.first).all():
            raise ArgumentError(f"fit_motion: parameters: expected a finite number for each, got {parameters!r:.80}.")
        self.units = np.where(self.first == 0.0, 1.0, np.abs(self.first))
        self.system = compile_scene(scene_of(scene, dict(zip(self.names, self.first, strict=True))))
        self.columns, self.y = tuple(measured), self._measured(measured)
        self.places, self.inputs = self._places(), self._inputs(inputs)
        self._prepare(step, integrator)

    def _prepare(self, step: float, integrator: str):
        """Compile the steps of the motion, for all values of the parameters."""
        self.kind = numbers(self.system)[1]
        self.step = ParametrisedStep(parametrised(self.system, self._around()), integrator)
        self.groups = self._groups(np.maximum(1, np.ceil(np.diff(self.t) / step - 1e-9)).astype(int))

    def _groups(self, counts: np.ndarray) -> list[list[tuple[float, float]]]:
        """Begin and length of the steps between samples, of which there are so many but for switching times [s]."""
        lengths = np.diff(self.t) / counts
        nodes = [t + h * np.arange(m) for t, h, m in zip(self.t[:-1], lengths, counts, strict=True)]
        start, every = replace(self.system.initial_state(), t=float(self.t[0])), np.append(np.concatenate(nodes), self.t[-1])
        found = timed_steps(self.system, Laws(self.system), start, every, np.repeat(lengths, counts))
        return [list(chain(*found[end - m : end])) for end, m in zip(np.cumsum(counts), counts, strict=True)]

    def _measured(self, measured) -> np.ndarray:
        """Columns (k, n) of numbers."""
        if not isinstance(measured, Mapping) or not measured:
            raise ArgumentError("fit_motion: measured: expected names with values, as {'A': angles}.")
        for name, column in measured.items():
            values = real_array(column, f"fit_motion: measured {name!r}", f"{self.t.size} finite numbers")
            if values.shape != self.t.shape or not np.isfinite(values).all():
                raise ArgumentError(f"fit_motion: measured {name!r}: expected {self.t.size} finite numbers.")
        return np.array([np.asarray(column, dtype=float) for column in measured.values()]).T

    def _places(self) -> list[int]:
        """Places of the measured columns in a state."""
        known = list(state_names(self.system))
        for name in self.columns:
            if name not in known:
                raise ArgumentError(f"fit_motion: nothing measured is called {name!r}. {did_you_mean(name, known)}")
        return [known.index(name) for name in self.columns]

    def _inputs(self, inputs) -> np.ndarray:
        """Inputs (k − 1, n_u)."""
        shape = self.t.size - 1, len(self.system.scene.inputs)
        found = np.zeros(shape) if inputs is None else real_array(inputs, "fit_motion: inputs").copy()
        if found.shape != shape:
            raise ArgumentError(f"fit_motion: inputs: expected shape {shape}, got {found.shape}.")
        return found

    def limits(self, bounds) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest parameters."""
        given = table(bounds, "fit_motion: bounds", "a least and a larger value by name")
        for name in given:
            if name not in self.names:
                raise ArgumentError(f"fit_motion: bounds of {name!r}, which is not fitted. {did_you_mean(name, self.names)}")
        least = np.where(
            [name.rpartition(".")[2] in POSITIVE for name in self.names], 2.0 * DIFFERENCE * self.units, -np.inf
        )
        pairs = [given.get(name, (low, np.inf)) for name, low in zip(self.names, least, strict=True)]
        found = real_array(pairs, "fit_motion: bounds", "a least and a larger value by name")
        if found.shape != (len(pairs), 2):
            raise ArgumentError(f"fit_motion: bounds: expected a least and a larger value by name, got {bounds!r:.80}.")
        low, high = found.T
        if not ((low < high) & (low <= self.first) & (self.first <= high)).all():
            raise ArgumentError("fit_motion: bounds: expected a least and a larger value, with the first value between.")
        return low, high

    def noise(self, noise) -> np.ndarray | None:
        """Given standard deviations (n,)."""
        if noise is None:
            return None
        found = real_array(noise, "fit_motion: noise", f"{len(self.columns)} numbers > 0")
        if found.shape not in ((), (len(self.columns),)) or not (found > 0.0).all():
            raise ArgumentError(f"fit_motion: noise: expected {len(self.columns)} numbers > 0, got {noise!r}.")
        return np.broadcast_to(found, (len(self.columns),)).copy()

    def solve(self, start: np.ndarray, sigma: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Parameters of the least sum of squares."""
        weights = np.tile(1.0 / sigma, self.t.size)
        first = self.motion(start)[0]
        if not np.isfinite(first).all():
            raise StateError("fit_motion: the motion is not finite at the first values; choose others, or a shorter step.")
        self._refuse_unidentifiable(self.slopes(start) * weights[:, None])
        found = least_squares(
            lambda x: (self.motion(x * self.units)[0] - self.y).ravel() * weights,
            start / self.units,
            lambda x: self.slopes(x * self.units) * weights[:, None] * self.units,
            bounds=(low / self.units, high / self.units),
            ftol=CONVERGED,
            xtol=CONVERGED,
            gtol=CONVERGED,
            max_nfev=MOST_EVALUATIONS,
        )
        if not found.status:
            raise StateError(
                f"fit_motion: {', '.join(self.names)} do not converge in {MOST_EVALUATIONS} motions: the motion hardly "
                "identifies them together, or the first values are far off."
            )
        return found.x * self.units

    def spread(self, p: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Standard deviation (n,) of the columns about the motion, by the degrees of freedom that are left."""
        left = self.motion(p)[0] - self.y
        degrees = max(left.size - p.size, 1) / left.shape[1]
        return np.maximum(np.sqrt((left**2).sum(axis=0) / degrees), 1e-12 * sizes)

    def report(self, p: np.ndarray, sigma: np.ndarray, confidence: float) -> MotionFit:
        """The fit with its confidence intervals."""
        J = self.slopes(p) / np.tile(sigma, self.t.size)[:, None]
        self._refuse_unidentifiable(J)
        lengths = np.linalg.norm(J, axis=0)
        _, R = np.linalg.qr(J / lengths)
        inverse = np.linalg.inv(R) / lengths[:, None]
        covariance = inverse @ inverse.T
        half = stats.t.ppf(0.5 + 0.5 * confidence, max(self.y.size - p.size, 1)) * np.sqrt(np.diag(covariance))
        values, widths = (dict(zip(self.names, row.tolist(), strict=True)) for row in (p, half))
        fitted, scene = self.motion(p)[0], scene_of(self.scene, values)
        return MotionFit(
            values,
            widths,
            covariance,
            confidence,
            sigma,
            float(np.linalg.cond(R)),
            self.t,
            self.columns,
            self.y,
            fitted,
            scene,
        )

    def motion(self, p: np.ndarray, directions: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray | None]:
        """Fitted values (k, n) and, along changes of (start, numbers), their changes (k, n, p)."""
        try:
            given, x = self._of(p)
        except GaussError:
            return np.full(self.y.shape, np.nan), None
        step, varied = self.step, given[self.step.family.varied]
        n_x, n_u = step.n_x, len(step.inputs)
        found, changes = [x[self.places]], []
        if directions is not None:
            held = np.concatenate([np.zeros((n_u, p.size)), directions[n_x:]])
            X = directions[:n_x]
            changes.append(X[self.places])
        for group, u in zip(self.groups, self.inputs, strict=True):
            for t, h in group:
                if directions is not None:
                    X = step.changes(t, h, x, u, varied, np.concatenate([X, held]))
                x = step.moved_to(t, h, x, u, varied)
            found.append(x[self.places])
            if directions is not None:
                changes.append(X[self.places])
        return np.array(found), np.array(changes) if directions is not None else None

    def slopes(self, p: np.ndarray) -> np.ndarray:
        """Derivatives (k n, p) of the fitted values."""
        centre = np.concatenate(self._moved(p))
        beside = zip(self._beside(p), self.steps, self.names, strict=True)
        directions = np.array([self._slope(centre, pair, h, name) for pair, h, name in beside]).T
        _, changes = self.motion(p, directions)
        assert changes is not None
        return changes.reshape(-1, p.size)

    @property
    def steps(self) -> np.ndarray:
        """Differences (p,) of the parameters."""
        return DIFFERENCE * self.units

    def _slope(self, centre: np.ndarray, pair: np.ndarray, h: float, name: str) -> np.ndarray:
        """Derivative of the start and the numbers by a parameter; one-sided beside values that no scene has."""
        less, more = (self._if_valid(p) for p in pair)
        if less is None and more is None:
            raise StateError(
                f"fit_motion: {name!r} cannot change alone, as one moment of inertia of a thin rod: leave it out."
            )
        width = h * ((less is not None) + (more is not None))
        return ((centre if more is None else more) - (centre if less is None else less)) / width

    def _if_valid(self, p: np.ndarray) -> np.ndarray | None:
        """Start and varied numbers; None where the scene refuses them."""
        try:
            return np.concatenate(self._moved(p))
        except SceneError:
            return None

    def _beside(self, p: np.ndarray) -> np.ndarray:
        """Parameters (p, 2, p) beside others, on both sides along each."""
        steps = np.diag(self.steps)
        return np.stack([p - steps, p + steps], axis=1)

    def _around(self) -> np.ndarray:
        """Numbers (m, n) of systems beside the first one: those that differ are varied."""
        found = [self._of(self.first)[0]]
        for p in self._beside(self.first).reshape(-1, self.first.size):
            try:
                found.append(self._of(p)[0])
            except SceneError:
                continue  # the other side shows what varies
        return np.array(found)

    def _moved(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Start, and varied numbers."""
        given, x = self._of(p)
        return x, given[self.step.family.varied]

    def _of(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the system, and its start (n_x,)."""
        system = compile_scene(scene_of(self.scene, dict(zip(self.names, map(float, p), strict=True))))
        found, kind = numbers(system)
        if kind != self.kind:
            raise ArgumentError(
                f"fit_motion: the kind of mechanism changes with {', '.join(self.names)}; fit fewer of them."
            )
        start = system.initial_state()
        return found, np.concatenate([start.q, start.v])

    def _refuse_unidentifiable(self, J: np.ndarray):
        """Raise a StateError for parameters that the motion does not identify, alone or together."""
        scaled = J * self.units
        _, sizes, Vt = np.linalg.svd(scaled / max(np.abs(scaled).max(), np.finfo(float).tiny), full_matrices=True)
        sizes = np.append(sizes, np.zeros(len(Vt) - len(sizes)))
        hidden = Vt[sizes <= UNIDENTIFIABLE * sizes.max()]
        if len(hidden):
            part = np.abs(hidden).max(axis=0) > NAMED
            names = ", ".join(name for name, takes in zip(self.names, part, strict=True) if takes)
            raise StateError(
                f"fit_motion: the motion does not identify {len(hidden)} combination(s) of {names}; fit fewer of them, or "
                "measure more."
            )


def _times(times, step) -> np.ndarray:
    """Times of the samples."""
    found = real_array(times, "fit_motion: times", "increasing numbers")
    if found.ndim != 1 or found.size < 2 or not (np.diff(found) > 0.0).all():
        raise ArgumentError(f"fit_motion: times: expected increasing numbers, got {times!r:.80}.")
    if isinstance(step, bool) or not isinstance(step, float | int) or not 0.0 < step < np.inf:
        raise ArgumentError(f"fit_motion: step: expected a time > 0 [s], got {step!r}.")
    return found
