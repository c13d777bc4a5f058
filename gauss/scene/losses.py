"""Non-ideal links of two joint coordinates: the torque on the driver depends on the direction of power flow.

The torque Q on the driven joint costs f Q on the driver: f = 1/(i η) while power flows from driver to driven, i the rate of
the driver over that of the driven, else f = η̄/i. η, η̄ do not contain the loss by slip (Rotor chains, section 1).
"""

from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.relation import Relation


def torque_factor(link, forward: bool) -> float:
    """f: torque taken from the driver over torque given to the driven, of a link with a ratio and efficiencies."""
    return (1.0 / link.efficiency if forward else link.back_efficiency) / link.ratio


def joint_factors(link, power_flow: int) -> dict[str, float]:
    """Joints that the force of a link acts on, with factors, by the direction of power flow: 1, −1, or 0 without losses."""
    if not power_flow:
        return link.acts_on
    return {link.driven: 1.0, link.driver: -torque_factor(link, power_flow > 0)}


def keep_efficiencies(link, largest_back: float = 1.0):
    """Check η and η̄ of a link; η̄ is by default such that friction works alike both ways."""
    eta = values.number(link.efficiency, f"{link.what}: efficiency", "1", positive=True)
    given = link.back_efficiency
    back = min(max(0.0, 2.0 - 1.0 / eta), largest_back) if given is None else given
    back = values.number(back, f"{link.what}: back_efficiency", "1", non_negative=True)
    if eta > 1 or back > 1:
        raise SceneError(f"{link.what}: efficiencies are at most 1, got {eta:g} and {back:g} (back).")
    if back > largest_back:
        raise SceneError(
            f"{link.what}: back_efficiency {back:g} with slip {1 - largest_back:g} would make energy when the power flows "
            f"back; give at most 1 − slip = {largest_back:g}."
        )
    values.keep(link, efficiency=eta)
    values.keep(link, back_efficiency=back)


def checked_slip(slip, what: str) -> float:
    """Constant slip, 0 ≤ ε < 1."""
    slip = values.number(slip, f"{what}: slip", "1", non_negative=True)
    if slip >= 1:
        raise SceneError(f"{what}: slip: expected a number below 1, got {slip:g}; at 1 nothing is driven.")
    return slip


@dataclass(frozen=True)
class LossyGear(Relation):
    """Non-ideal gear, chain or belt between two joints: q_driven = (1 − ε)/i · q_driver + offset. One row.

    At rest its losses act like Coulomb friction that grows with the load.

    Parameters
    ----------
    name : str
        Name of the gear.
    driven, driver : str
        Joints of one freedom, or single rates of joints.
    ratio : float
        i, rate of the driver over that of the driven at zero slip; negative if they turn against each other.
    efficiency : float
        η of torque, 0 < η ≤ 1.
    back_efficiency : float, optional
        η̄ when the driven drives; 0 locks itself; max(0, 2 − 1/η) when not given, at most 1 − ε.
    slip : float
        ε, constant.
    offset : float
        Coordinate of the driven when that of the driver is zero [rad or m].
    """

    driven: str
    driver: str
    ratio: float
    efficiency: float = 1.0
    back_efficiency: float | None = None
    slip: float = 0.0
    offset: float = 0.0

    joints: ClassVar[tuple[str, ...]] = ("driven", "driver")

    def __post_init__(self):
        values.text(self.name, "name of a lossy gear")
        if self.driven == self.driver:
            raise SceneError(f"{self.what}: joint {self.driven!r} cannot drive itself.")
        values.keep(self, ratio=values.number(self.ratio, f"{self.what}: ratio", "1"))
        if self.ratio == 0:
            raise SceneError(f"{self.what}: ratio: expected rate of the driver over that of the driven, other than 0.")
        values.keep(self, slip=checked_slip(self.slip, self.what))
        values.keep(self, offset=values.number(self.offset, f"{self.what}: offset", "rad or m"))
        keep_efficiencies(self, 1.0 - self.slip)

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"lossy gear {self.name!r}"

    @property
    def loses(self) -> bool:
        """Whether its reactions differ in direction from its row."""
        return bool(self.efficiency != 1.0 or self.back_efficiency != 1.0 or self.slip)

    @property
    def acts_on(self) -> dict[str, float]:
        """Driven and driver, with the factors of its row."""
        return {self.driven: 1.0, self.driver: -(1.0 - self.slip) / self.ratio}

    def positions(self, at) -> list:
        """Residual: driven coordinate less its value by the driver."""
        return [sum(factor * at.coordinate(joint) for joint, factor in self.acts_on.items()) - self.offset]


@dataclass(frozen=True)
class JointAtRest(Relation):
    """Joint at rest by the losses of its gears: q̇ = 0.

    Parameters
    ----------
    name, joint : str
        Its name and the joint.
    """

    joint: str

    joints: ClassVar[tuple[str, ...]] = ("joint",)

    def velocities(self, at) -> list:
        """Rate."""
        return [at.rate(self.joint)]


@dataclass(frozen=True)
class IdealCounterpart(Relation):
    """Ideal counterpart of a non-ideal link: its rows without its losses.

    Parameters
    ----------
    name : str
        Name of the link.
    whole : Relation
        The link.
    """

    whole: Relation

    def positions(self, at) -> list:
        """Residuals of the link."""
        return self.whole.positions(at)

    def velocities(self, at) -> list:
        """Residuals of the link."""
        return self.whole.velocities(at)
