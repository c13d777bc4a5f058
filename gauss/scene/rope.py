"""Ropes: a unilateral constraint on the distance of two points, g_N = (l² − d²)/(2 l) ≥ 0."""

from dataclasses import dataclass
from typing import ClassVar

from gauss.scene import values
from gauss.scene.geometry import Between
from gauss.scene.unilateral import Unilateral


@dataclass(frozen=True)
class Rope(Between, Unilateral):
    """Two points no farther apart than the length of a rope, which pulls when it is taut and has no mass.

    Parameters
    ----------
    length : float, optional
        Length [m]; the distance of the points at the reference configuration when not given.
    restitution : float
        Speed after it jerks taut over that before it, 0 to 1.
    """

    length: float | None = None
    restitution: float = 0.0

    kind: ClassVar[str] = "rope"

    def __post_init__(self):
        """Check every value."""
        super().__post_init__()
        if self.length is not None:
            values.keep(self, length=values.number(self.length, f"{self.what}: length", "m", positive=True))
        self._keep_restitution()

    def gaps(self, at) -> list:
        """(l² − d²)/(2 l): the slack, to first order, without a root."""
        gap, length = self.gap(at), self.length
        if length is None:
            length = self._reference_length(at)
        return [(length * length - gap @ gap) / (2.0 * length)]
