"""Result of a fit of a whole motion: values with confidence intervals, residuals, a table and a figure."""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gauss.analysis.report import widths_figure, write_report
from gauss.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class MotionFit:
    """Parameters of a fitted motion.

    Parameters
    ----------
    values, half_widths : dict of str to float
        Parameters, and half widths of their confidence intervals.
    covariance : ndarray, shape (p, p)
        Covariance of the parameters.
    confidence : float
        Probability of the intervals, under Gaussian noise and a linear model about the found parameters.
    noise : ndarray, shape (n,)
        Standard deviation of each measured column.
    condition : float
        Condition number of the weighted derivatives with columns of unit length.
    t : ndarray, shape (k,)
        Times [s].
    columns : tuple of str
        Names of the measured coordinates and rates.
    measured, fitted : ndarray, shape (k, n)
        Measured values, and those of the fitted motion.
    scene : Scene
        Scene with the found parameters.
    """

    values: dict[str, float]
    half_widths: dict[str, float]
    covariance: np.ndarray
    confidence: float
    noise: np.ndarray
    condition: float
    t: np.ndarray
    columns: tuple[str, ...]
    measured: np.ndarray
    fitted: np.ndarray
    scene: Scene

    @property
    def residual(self) -> np.ndarray:
        """Root mean squares (n,) of measured less fitted values."""
        return np.sqrt(((self.measured - self.fitted) ** 2).mean(axis=0))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation (p, p) of the parameters."""
        sizes = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(sizes, sizes)

    def __str__(self) -> str:
        lines = [f"{len(self.values)} parameters from {self.t.size} samples, condition number {self.condition:.3g}"]
        lines.append(f"{'value':>14} {f'± ({self.confidence:.0%})':>12}  parameter")
        lines += [f"{value:14.7g} {self.half_widths[name]:12.2g}  {name}" for name, value in self.values.items()]
        lines.append(f"{'residual':>14} {'':>12}  column")
        lines += [f"{one:14.3g} {'':>12}  {name}" for one, name in zip(self.residual, self.columns, strict=True)]
        return "\n".join(lines)

    def plot(self, path=None) -> "Figure":
        """Figure of the measured and the fitted motion, and of their differences.

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
        figure = style.Figure(figsize=(9.0, 0.8 + 1.8 * len(self.columns)), layout="constrained")
        rows = figure.subplots(len(self.columns), 2, squeeze=False, sharex=True)
        for (left, right), name, one, other in zip(rows, self.columns, self.measured.T, self.fitted.T, strict=True):
            left.plot(self.t, one, ".", markersize=2, label="measured")
            left.plot(self.t, other, linewidth=1.0, label="fitted")
            right.plot(self.t, one - other, ".", markersize=2)
            left.set(ylabel=name)
            right.set(ylabel="difference")
        rows[0, 0].legend()
        for axes in rows[-1]:
            axes.set(xlabel="t [s]")
        return style.saved(figure, path)

    def report(self, path) -> Path:
        """Write a report as one HTML file: the table, motions, and the widths of the confidence intervals.

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
        names = list(self.values)
        widths = widths_figure(names, [self.values[name] for name in names], [self.half_widths[name] for name in names])
        figures = [("Measured and fitted motion", self.plot()), ("Confidence intervals", widths)]
        return write_report(path, f"Fit of {self.scene.name}", str(self), figures)
