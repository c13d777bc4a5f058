"""Collision shape of terrain: heights over a grid, with two triangles a cell."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.curved_shapes import BoundedCollider


@dataclass(frozen=True)
class HeightField(BoundedCollider):
    """Terrain over a grid around ``at``: the surface of two triangles a cell, and what is under it.

    The first row of heights lies at the least y, the first column at the least x, as MuJoCo's ``hfield`` has them. Each cell
    is divided from its corner of least x and y to the opposite one. Bodies touch the
    upper surface; what comes from beside or below is not stopped.

    Parameters
    ----------
    heights : array_like, shape (rows, columns)
        Heights along the third axis, from ``at`` [m]: at least two rows along y and two columns along x.
    size : array_like, shape (2,)
        Edges of the field along x and y [m].
    rotation : array_like
        Of its axes, from the frame of the body.
    depth : float
        How far the solid reaches below the lowest height [m].
    """

    heights: tuple = ()
    size: tuple = (0.0, 0.0)
    rotation: tuple = (0.0, 0.0, 0.0)
    depth: float = 1.0

    kind: ClassVar[str] = "height field"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, rotation=values.rotation(self.rotation, f"{self.what}: rotation"))
        values.keep(self, size=values.vector(self.size, f"{self.what}: size", "m", 2))
        if min(self.size) <= 0.0:
            raise SceneError(f"{self.what}: size is two edges > 0 [m], along x and y, got {self.size}.")
        self._keep_length("depth", positive=True)
        values.keep(self, heights=tuple(map(tuple, self._checked().tolist())))

    def _checked(self) -> np.ndarray:
        """Heights as given, once they are known to be a grid of finite numbers."""
        what = f"{self.what}: heights"
        try:
            given = np.asarray(self.heights)
        except ValueError:  # rows of several lengths
            given = np.empty(0, dtype=object)
        if given.ndim != 2 or given.dtype.kind not in "fiu" or min(given.shape) < 2:
            raise SceneError(
                f"{what} are a grid [m], at least two rows of two numbers each, all rows of one length, "
                f"got {_outline(self.heights)}."
            )
        wrong = np.argwhere(~np.isfinite(given))
        if len(wrong):
            row, column = wrong[0].tolist()
            raise SceneError(
                f"{what}: expected finite numbers in [m], got {given[row, column]} in row {row}, column {column}."
            )
        return given.astype(float)

    def __hash__(self) -> int:
        """Hash of what is short: fields of equal name and size are compared in full."""
        return hash((self.name, self.body, self.at, self.size, len(self.heights)))

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from its axes to the frame of the body."""
        return values.rotation_matrix(self.rotation)

    @cached_property
    def grid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places of columns along x and of rows along y, heights (rows, columns), from ``at`` [m]."""
        z = np.array(self.heights)
        x, y = (np.linspace(-0.5 * edge, 0.5 * edge, n) for edge, n in zip(self.size, z.shape[::-1], strict=True))
        return x, y, z

    @cached_property
    def _span(self) -> tuple[float, float]:
        """Lowest place of the solid and highest of its surface, from ``at`` [m]."""
        z = self.grid[2]
        return float(z.min()) - self.depth, float(z.max())

    @property
    def half_edges(self) -> np.ndarray:
        """Half edges (3,) of the box around it [m]."""
        return 0.5 * np.array([*self.size, self._span[1] - self._span[0]])

    @property
    def centre(self) -> np.ndarray:
        """Middle (3,) of that box, in the frame of the body [m]."""
        return np.array(self.at) + 0.5 * sum(self._span) * self.axes[:, 2]

    @cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (n, 3) of the surface in the frame of the body [m], and its triangles (m, 3), for pictures."""
        x, y, z = self.grid
        points = np.stack([*np.meshgrid(x, y), z], axis=-1).reshape(-1, 3)
        corner = (np.arange(len(y) - 1)[:, None] * len(x) + np.arange(len(x) - 1)).ravel()[:, None]
        below, above = corner + (0, 1, 1 + len(x)), corner + (0, 1 + len(x), len(x))
        return np.array(self.at) + points @ self.axes.T, np.concatenate([below, above])


def _outline(given) -> str:
    """What was given instead of a grid, in short."""
    try:
        array = np.asarray(given)
        return f"numbers of shape {array.shape}" if array.dtype.kind in "fiu" else f"{given!r:.60}"
    except ValueError:
        return f"rows of lengths {sorted({np.size(row) for row in given})}"
