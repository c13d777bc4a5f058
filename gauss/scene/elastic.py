"""Springs and dampers between two joint coordinates, with or without backlash: Q = k z + d ż."""

from dataclasses import dataclass
from typing import ClassVar

from gauss import math
from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.scene import values


class Elastic:
    """Law of an elastic link of two joints: Q = k z + d ż on the driven joint, z the twist beyond the backlash, Q s ≥ 0.

    Twist and lead are q_driver/i − q_driven and its rate. s is the backlash side that is in contact, −1 or 1; 0 without
    backlash. The kinds have the fields.
    """

    stiffness: float
    damping: float
    backlash: float
    rest: float
    what: str  # name in messages

    def strain(self, twist, side):
        """Strain z [rad, m] from the middle, or from the contact of a side."""
        return twist - self.rest - side * 0.5 * self.backlash

    def side_force(self, twist, lead, side):
        """Force Q [N m, N] if a side is in contact."""
        return self.stiffness * self.strain(twist, side) + self.damping * lead

    def touch(self, twist, lead, side):
        """Positive if a side is in contact, strained and under pressure; relative to one radian of strain."""
        return math.minimum(self.strain(twist, side) * side, self.side_force(twist, lead, side) * side / self.stiffness)

    def stored(self, twist, side):
        """Elastic energy [J] if a side is in contact."""
        return 0.5 * self.stiffness * self.strain(twist, side) ** 2

    def _keep_elastic(self):
        for key, unit in (("stiffness", "N m/rad or N/m"), ("damping", "N m s/rad or N s/m"), ("backlash", "rad or m")):
            checked = values.number(getattr(self, key), f"{self.what}: {key}", unit, non_negative=True)
            values.keep(self, **{key: checked})
        values.keep(self, rest=values.number(self.rest, f"{self.what}: rest", "rad or m"))
        if not self.stiffness and not self.damping:
            raise SceneError(f"{self.what}: has neither stiffness nor damping; give one, or leave it out.")
        if self.backlash and not self.stiffness:
            raise SceneError(f"{self.what}: backlash needs a stiffness [N m/rad or N/m] of its sides.")


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
        Backlash from side to side [rad, m], referred to the driven joint.
    rest : float
        Twist without force, in the middle of the backlash [rad, m].
    side : int, optional
        Backlash side in contact, −1 or 1, 0 for none; decided by the state when not given.
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
        values.text(self.name, "name of an elastic link")
        if self.driven == self.driver:
            raise SceneError(f"{self.what}: driven and driver are both {self.driven!r}; a link joins two joints.")
        values.keep(self, ratio=values.number(self.ratio, f"{self.what}: ratio", "1"))
        if self.ratio == 0:
            raise SceneError(f"{self.what}: ratio: expected rate of the driver over that of the driven, other than 0.")
        if self.side not in (None, -1, 0, 1):
            raise SceneError(f"{self.what}: side is the backlash side in contact, −1, 1, or 0; got {self.side!r}.")
        self._keep_elastic()

    @property
    def what(self) -> str:  # type: ignore[override]  # a name in messages, never assigned
        """Its name in messages."""
        return f"elastic link {self.name!r}"

    @property
    def acts_on(self) -> dict[str, float]:
        """Driven and driver joint, with the factors of the force on them."""
        return {self.driven: 1.0, self.driver: -1.0 / self.ratio}

    def ends(self, at) -> tuple[Scalar, Scalar]:
        """Twist [rad, m] and lead [rad/s, m/s], by a view of the mechanism."""
        twist = -sum(factor * at.coordinate(joint) for joint, factor in self.acts_on.items())
        return twist, -sum(factor * at.rate(joint) for joint, factor in self.acts_on.items())

    def touching(self, twist, lead, slack: float = 0.0) -> dict:
        """Sides that may be in contact, with 1 for each that is, else 0."""
        if not self.backlash:
            return {0: 1.0}
        if self.side is not None:
            return {self.side: float(self.side != 0)}
        return {side: math.where(self.touch(twist, lead, side) > -slack, 1.0, 0.0) for side in (-1, 1)}
