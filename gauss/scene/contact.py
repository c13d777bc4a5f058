"""Contact of two shapes: they do not enter each other."""

from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.onesided import OneSided
from gauss.scene.touching import Touch, count, touches


@dataclass(frozen=True)
class Contact(OneSided):
    """Two shapes that may touch, without friction.

    Parameters
    ----------
    name : str
        Name of the contact.
    shape, other : str
        The two shapes.
    restitution : float
        Speed after an impact over that before it, 0 to 1.
    """

    shape: str
    other: str
    restitution: float = 0.0

    shapes: ClassVar[tuple[str, ...]] = ("shape", "other")

    def __post_init__(self):
        """Check every value."""
        values.text(self.name, "name of a contact")
        if self.shape == self.other:
            raise SceneError(f"{self.what}: a shape does not touch itself; name two.")
        self._keep_restitution()

    def sides(self, scene) -> tuple[str, ...]:
        """Names of the gaps: that of the contact, numbered from 1 if there are many places."""
        number = count(scene.shapes[self.shape], scene.shapes[self.other])
        return (self.name,) if number == 1 else tuple(f"{self.name}.{k + 1}" for k in range(number))

    def gaps(self, at) -> list:
        """Distances of the places that may touch."""
        return [touch.gap for touch in self.touches(at)]

    def touches(self, at) -> list[Touch]:
        """Places that may touch."""
        shapes = at.system.scene.shapes
        return touches(shapes[self.shape], shapes[self.other], at)
