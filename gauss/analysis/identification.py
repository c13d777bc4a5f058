"""Identification of inertial parameters and friction: weighted least squares of measured forces, W π_b = τ.

Rows of one coordinate share the noise that the residual of a first fit shows; the covariance of the base parameters is
(Wᵀ Σ⁻¹ W)⁻¹ (Gautier, Dynamic identification of robots with power model, ICRA 1997; Swevers et al., Optimal robot excitation
and identification, IEEE Trans. Robotics and Automation 13(5), 1997). QR of the rows of each coordinate keeps all that the
fit needs in a triangle. Standard parameters are those nearest to the scene that some bodies can have.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.linalg import qr, solve_triangular

from gauss.analysis.base_parameters import BaseParameters, base_of, random_matrix
from gauss.analysis.consistent_inertias import is_consistent, nearest_consistent
from gauss.analysis.identified_scene import identified_scene
from gauss.analysis.measured_motion import MeasuredMotion, measured_motion
from gauss.analysis.regressor import RegressorModel
from gauss.analysis.report import widths_figure, write_report
from gauss.arguments import generator, named_arguments, real_array
from gauss.errors import ArgumentError, StateError
from gauss.scene import Scene
from gauss.system import System
from gauss.system.coordinate_names import force_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXCITATION_TOLERANCE = 1e-10  # share of the largest pivot of the measured rows below which a parameter is not excited
LEAST_NOISE = 1e-12  # of forces, relative to their largest: exact data have no noise to weight by


@dataclass(frozen=True)
class Identification:
    """Identified parameters of a system.

    Parameters
    ----------
    base : BaseParameters
        Combinations that forces determine.
    base_values : ndarray, shape (r,)
        Their values.
    covariance : ndarray, shape (r, r)
        Covariance of the base values.
    half_widths : ndarray, shape (r,)
        Half widths of the confidence intervals of the base values.
    confidence : float
        Probability of these intervals, under Gaussian noise.
    values : ndarray, shape (p,)
        Standard parameters that meet the base values, nearest to those of the scene; only those of ``base.identifiable``
        are measured by themselves.
    noise : ndarray, shape (k,)
        Standard deviation of the forces along each row [N m, N], by which rows are weighted.
    condition : float
        Condition number of the weighted rows with columns of unit length.
    rows : tuple of str
        Coordinates of the forces.
    measured, predicted : ndarray, shape (n, k)
        Generalised forces of the samples less known loads, and those of ``values`` [N m, N].
    model : RegressorModel
        Model of the regressor.
    """

    base: BaseParameters
    base_values: np.ndarray
    covariance: np.ndarray
    half_widths: np.ndarray
    confidence: float
    values: np.ndarray
    noise: np.ndarray
    condition: float
    rows: tuple[str, ...]
    measured: np.ndarray
    predicted: np.ndarray
    model: RegressorModel

    @property
    def parameters(self) -> dict[str, float]:
        """Standard parameters by name."""
        return dict(zip(self.base.names, self.values.tolist(), strict=True))

    @cached_property
    def scene(self) -> Scene:
        """Scene with the found masses, centres of mass, inertias and friction.

        Raises
        ------
        SceneError
            If a body has a negative mass or moment: values that need not be consistent.
        """
        return identified_scene(self.model, self.values)

    @property
    def residual(self) -> np.ndarray:
        """Root mean squares (k,) of measured less predicted forces [N m, N]."""
        return np.sqrt(((self.measured - self.predicted) ** 2).mean(axis=0))

    def __str__(self) -> str:
        lines = [
            f"{len(self.base)} base parameters from {len(self.measured)} samples, condition number {self.condition:.3g}",
            f"{'value':>12} {f'± ({self.confidence:.0%})':>12}  combination",
        ]
        found = zip(self.base_values, self.half_widths, self.base.shown, strict=True)
        lines += [f"{value:12.5g} {half:12.2g}  {label}" for value, half, label in found]
        lines.append(f"{'residual':>12} {'of':>12}  coordinate")
        largest = np.sqrt((self.measured**2).mean(axis=0))
        lines += [f"{one:12.3g} {of:12.3g}  {row}" for one, of, row in zip(self.residual, largest, self.rows, strict=True)]
        return "\n".join([*lines, f"without effect: {', '.join(self.base.unidentifiable) or 'none'}"])

    def plot(self, path=None) -> "Figure":
        """Figure of measured forces and those of the identified parameters, by coordinate.

        Parameters
        ----------
        path : str or Path, optional
            Where to save it: .png, .svg or .pdf.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        MissingPackageError
            If matplotlib is not installed.
        FileError
            If the format is none of these, or the file cannot be written.
        """
        style = import_module("gauss.view.style")  # needs matplotlib
        style.check_format(path)
        figure = style.Figure(figsize=(7.0, 0.9 + 2.1 * len(self.rows)), layout="constrained")
        units = force_units(self.model.system)
        for axes, row, one, other in zip(
            figure.subplots(len(self.rows), squeeze=False)[:, 0], self.rows, self.measured.T, self.predicted.T, strict=True
        ):
            (points,) = axes.plot(one, ".", markersize=3, zorder=3, label="measured")
            (line,) = axes.plot(other, linewidth=0.8, label="identified")
            axes.set(ylabel=f"{row} [{units[row]}]")
            axes.margins(x=0.01)
        axes.set(xlabel="sample")
        figure.legend(handles=[points, line], loc="outside upper right", ncols=2)
        return style.saved(figure, path)

    def report(self, path) -> Path:
        """Write a report as one HTML file: the table, forces, and the widths of the confidence intervals.

        Parameters
        ----------
        path : str or Path
            Where to: .html.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        ArgumentError
            If the path does not end with .html, or its folder does not exist.
        MissingPackageError
            If matplotlib is not installed.
        """
        widths = widths_figure(self.base.shown, self.base_values, self.half_widths)
        figures = [("Measured and identified forces", self.plot()), ("Confidence intervals", widths)]
        return write_report(path, f"Identification of {self.model.system.scene.name}", str(self), figures)


@named_arguments
def identify(
    system: System | Scene,
    q,
    v,
    acceleration,
    forces,
    *,
    independent: Sequence[str] | None = None,
    friction: Sequence[str] = (),
    noise=None,
    confidence: float = 0.95,
    consistent: bool = True,
    seed: int = 0,
) -> Identification:
    """Masses, centres of mass, inertias and friction from measured motions and forces.

    Parameters
    ----------
    system : System or Scene
        The system, with or without loops. Its loads and the dry friction of other joints are known; its inertias are a
        guess for what forces do not determine.
    q, v, acceleration : array_like, shape (n, n_q), (n, n_v), (n, n_v)
        Measured samples without contacts. With loops, samples are projected onto the constraints, and rates and
        accelerations of dependent joints are those of the constraints.
    forces : array_like, shape (n, n_v), or dict of str to array_like, shape (n,)
        Measured efforts of all joints, or of those that are driven, by coordinate [N m, N].
    independent : sequence of str, optional
        Independent coordinates of a system with loops; see :func:`gauss.regressor`.
    friction : sequence of str
        Joints, or single rates, whose viscous and Coulomb friction are to be found; Coulomb friction in place of that of the
        scene.
    noise : array_like, shape (k,), optional
        Standard deviation of the forces along the independent coordinates, or all [N m, N]; from the residual when not
        given.
    confidence : float
        Probability of the confidence intervals.
    consistent : bool
        Whether inertias must be those of some bodies, and friction not negative.
    seed : int
        Seed of the random states that show the base parameters.

    Returns
    -------
    Identification
        Values, confidence intervals, residuals; ``print`` shows a table, ``scene`` the scene with the found values.

    Raises
    ------
    ArgumentError
        If an argument is of a wrong type.
    StateError
        If an argument does not fit or is not finite, there are too few samples, or the motion does not excite some base
        parameters, by their names.
    SimulationError
        If a load cannot be compiled, or no consistent inertias are found.

    Examples
    --------
    >>> import gauss, numpy as np
    >>> q = np.linspace(0.0, 3.0, 50)[:, None]
    >>> torque = 9.81 * np.cos(q) + 0.01 * np.sin(5 * q)
    >>> found = gauss.identify(gauss.load("pendulum"), q, 0 * q, np.sin(5 * q), torque)
    >>> len(found.base), found.values.shape
    (3, (10,))
    """
    if not isinstance(confidence, float) or not 0.0 < confidence < 1.0:
        raise ArgumentError(f"identify: confidence: expected a number between 0 and 1, got {confidence!r}.")
    model = RegressorModel(system, independent, friction)
    samples = measured_motion(model, q, v, acceleration, forces)
    base = base_of(model, random_matrix(model, generator(seed, "identify")))
    fit = _fitted(model, base, samples, noise)
    prior = model.parameters
    values = _standard(model, base, fit, prior, consistent)
    predicted = samples.matrix @ values
    half = stats.t.ppf((1.0 + confidence) / 2.0, max(samples.forces.size - len(base), 1)) * np.sqrt(np.diag(fit.covariance))
    return Identification(
        base,
        fit.values,
        fit.covariance,
        half,
        confidence,
        values,
        fit.noise,
        fit.condition,
        model.rows,
        samples.forces,
        predicted,
        model,
    )


@dataclass(frozen=True)
class _Fit:
    """Base values of least squares: ‖triangle x − right‖² for values x in units of the scene."""

    values: np.ndarray
    covariance: np.ndarray
    noise: np.ndarray
    condition: float
    triangle: np.ndarray
    right: np.ndarray


def _fitted(model: RegressorModel, base: BaseParameters, samples: MeasuredMotion, noise) -> _Fit:
    """Weighted least squares of the base parameters."""
    (n, k), r = samples.forces.shape, len(base)
    if n * k < r:
        raise StateError(f"identify: {n} samples of {k} forces are too few for {r} base parameters.")
    units = model.units[list(base.base)]
    joined = np.concatenate([samples.matrix[:, :, list(base.base)] * units, samples.forces[:, :, None]], axis=2)
    triangles = [np.asarray(np.linalg.qr(joined[:, row], mode="r")) for row in range(k)]
    given = None if noise is None else _noise(noise, k)
    sigma = model.row_units if given is None else given
    found = _solved(base, triangles, sigma)
    if given is None:
        least = LEAST_NOISE * np.maximum(np.abs(samples.forces).max(axis=0), np.finfo(float).tiny)
        degrees = max(1.0 - r / (n * k), 1.0 / (n * k))
        step = np.append(found[0], -1.0)
        sigma = np.array([np.linalg.norm(triangle @ step) / np.sqrt(n * degrees) for triangle in triangles])
        sigma = np.maximum(sigma, least)
        found = _solved(base, triangles, sigma)
    x, covariance, condition, R, right = found
    return _Fit(units * x, units[:, None] * covariance * units, sigma, condition, R, right)


def _solved(base: BaseParameters, triangles: list[np.ndarray], sigma: np.ndarray):
    """Values, covariance, condition number, triangle and right side of rows weighted by the noise of each coordinate."""
    joined = np.concatenate([one / s for one, s in zip(triangles, sigma, strict=True)])
    triangle, r = np.asarray(np.linalg.qr(joined, mode="r")), len(base)
    R, right = triangle[:r, :r], triangle[:r, r]
    lengths = np.linalg.norm(R, axis=0)
    scaled = R / np.where(lengths > 0.0, lengths, 1.0)
    _, pivoted, order = qr(scaled, pivoting=True)
    pivots = np.abs(np.diag(pivoted))
    hidden = order[pivots <= EXCITATION_TOLERANCE * pivots[0]]
    if hidden.size:
        names = "; ".join(base.shown[k] for k in np.sort(hidden))
        raise StateError(f"identify: the motion does not excite {hidden.size} of {r} base parameters: {names}.")
    inverse = solve_triangular(R, np.eye(r))
    return inverse @ right, inverse @ inverse.T, float(np.linalg.cond(scaled)), R, right


def _noise(noise, count: int) -> np.ndarray:
    given = real_array(noise, "identify: noise", f"{count} numbers > 0")
    if given.shape not in ((), (count,)) or not np.isfinite(given).all() or (given <= 0.0).any():
        raise StateError(f"identify: noise: expected {count} numbers > 0, one for each row, got {noise!r}.")
    return np.broadcast_to(given, (count,))


def _standard(model: RegressorModel, base: BaseParameters, fit: _Fit, prior: np.ndarray, consistent: bool) -> np.ndarray:
    """Standard parameters (p,) of the base values, nearest to a guess in the units of the scene."""
    units, n_bodies = model.units, model.system.structure.n_bodies
    K = base.combinations * units / units[list(base.base), None]
    wanted, guess = fit.values / units[list(base.base)], prior / units
    found = guess + np.linalg.lstsq(K, wanted - K @ guess, rcond=None)[0]
    if consistent and not is_consistent(found, n_bodies):
        found = nearest_consistent(fit.triangle @ K, fit.right, guess, n_bodies)
    return units * found
