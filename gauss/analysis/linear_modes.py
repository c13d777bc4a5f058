"""Eigenmodes of a linear model."""

from dataclasses import dataclass

import numpy as np

DAMPING_DIGITS = 12  # digits of a damping ratio after the point: what is less is round-off, and minus zero


@dataclass(frozen=True)
class LinearModes:
    """Eigenmodes of a linear model, slowest first; one of each pair of conjugate ones.

    Parameters
    ----------
    eigenvalues : ndarray of complex, shape (m,)
        Eigenvalues [1/s].
    shapes : ndarray of complex, shape (m, n_v)
        Displacements along all rates of the system, the largest in its unit being 1.
    coordinates : tuple of str
        Names of the displacements.
    """

    eigenvalues: np.ndarray
    shapes: np.ndarray
    coordinates: tuple[str, ...]

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies of the oscillations [Hz], 0 where none is."""
        return np.abs(self.eigenvalues.imag) / (2.0 * np.pi)

    @property
    def damping(self) -> np.ndarray:
        """Damping ratios ``−Re λ / |λ|``; NaN where λ = 0."""
        with np.errstate(invalid="ignore"):
            return -self.eigenvalues.real / np.abs(self.eigenvalues)

    def __str__(self):
        lines = [f"{'Hz':>12}{'damping':>12}  moves most"]
        for frequency, damping, shape in zip(self.frequencies, self.damping, self.shapes, strict=True):
            largest = [self.coordinates[k] for k in np.argsort(-np.abs(shape))[:3] if abs(shape[k]) > 0.1]
            lines.append(f"{frequency:12.6g}{round(damping, DAMPING_DIGITS) + 0.0:12.4g}  {', '.join(largest)}")
        return "\n".join(lines)
