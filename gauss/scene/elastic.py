"""Springs and dampers between two joint coordinates, with or without play."""

from dataclasses import dataclass
from typing import ClassVar

from gauss import math
from gauss.errors import SceneError
from gauss.scene import values


class Elastic:
    """Law of an elastic link of two joints: Q = k z + d ż on the driven, z the twist beyond the play; flanks never pull.

    Twist and lead are q_driver/i − q_driven and its rate. A side is the flank that touches, −1 or 1; 0 without play.
    Of a class with ``stiffness``, ``damping``, ``backlash`` and ``rest``.
    """

    def strain(self, twist, side):
        """Z [rad, m] beyond the middle, or beyond the flank of a side."""
        return twist - self.rest - side * 0.5 * self.backlash

    def pressed(self, twist, lead, side):
        """Q [N m, N] if the flank of a side touches."""
        return self.stiffness * self.strain(twist, side) + self.damping * lead

    def touch(self, twist, lead, side):
        """Positive if the flank of a side touches: pressed together, and not pulling; relative to one radian of strain."""
        return math.minimum(self.strain(twist, side) * side, self.pressed(twist, lead, side) * side / self.stiffness)

    def stored(self, twist, side):
        """Elastic energy [J] if the flank of a side touches."""
        return 0.5 * self.stiffness * self.strain(twist, side) ** 2

    def _keep_elastic(self):
        for key, unit in (("stiffness", "N m/rad or N/m"), ("damping", "N m s/rad or N s/m"), ("backlash", "rad or m")):
            checked = values.number(getattr(self, key), f"{self.what}: {key}", unit, non_negative=True)
            object.__setattr__(self, key, checked)
        object.__setattr__(self, "rest", values.number(self.rest, f"{self.what}: rest", "rad or m"))
        if not self.stiffness and not self.damping:
            raise SceneError(f"{self.what}: has neither stiffness nor damping; give one, or leave it out.")
        if self.backlash and not self.stiffness:
            raise SceneError(f"{self.what}: backlash needs a stiffness [N m/rad or N/m] of the flanks.")


@dataclass(frozen=True)
class ElasticLink(Elastic):
    """Spring and damper between two joints: an elastic shaft, belt or coupling, teeth with backlash.

    Parameters
    ----------
    name : str
        Name of the link.
    driven, driver : str
        Joints of one freedom, or single rates of joints.
    ratio : float
        i, rate of the driver over that of the driven while it is not strained.
    stiffness, damping : float
        k [N m/rad, N/m] and d [N m s/rad, N s/m], referred to the driven joint.
    backlash : float
        Play from flank to flank [rad, m], referred to the driven joint.
    rest : float
        Twist without force, in the middle of the play [rad, m].
    side : int, optional
        Flank that touches (−1, 1), 0 for none; where it is not given the state tells.
    """

    name: str
    driven: str
    driver: str
    ratio: float = 1.0
    stiffness: float = 0.0
    damping: float = 0.0
    backlash: float = 0.0
    rest: float = 0.0
    side: int | None = None

    joints: ClassVar[tuple[str, ...]] = ("driven", "driver")

    def __post_init__(self):
        """Check every value."""
        values.text(self.name, "name of an elastic link")
        if self.driven == self.driver:
            raise SceneError(f"{self.what}: driven and driver are both {self.driven!r}; a link joins two joints.")
        object.__setattr__(self, "ratio", values.number(self.ratio, f"{self.what}: ratio", "1"))
        if self.ratio == 0:
            raise SceneError(f"{self.what}: ratio: expected rate of the driver over that of the driven, other than 0.")
        if self.side not in (None, -1, 0, 1):
            raise SceneError(f"{self.what}: side is the flank that touches, −1 or 1, or 0; got {self.side!r}.")
        self._keep_elastic()

    @property
    def what(self) -> str:
        """How an error message calls it."""
        return f"elastic link {self.name!r}"

    @property
    def acts_on(self) -> dict[str, float]:
        """Driven and driver, and factors of the force on them."""
        return {self.driven: 1.0, self.driver: -1.0 / self.ratio}

    def ends(self, at):
        """Twist [rad, m] and lead [rad/s, m/s] where a view shows the mechanism."""
        twist = -sum(factor * at.coordinate(joint) for joint, factor in self.acts_on.items())
        return twist, -sum(factor * at.rate(joint) for joint, factor in self.acts_on.items())

    def touching(self, twist, lead, slack: float = 0.0) -> dict:
        """Sides that may touch, and 1 for each that does, else 0."""
        if not self.backlash:
            return {0: 1.0}
        if self.side is not None:
            return {self.side: float(self.side != 0)}
        return {side: math.where(self.touch(twist, lead, side) > -slack, 1.0, 0.0) for side in (-1, 1)}
