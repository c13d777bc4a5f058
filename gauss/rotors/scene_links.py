"""Links of rotors as elements of a scene between two joint coordinates, by their own laws."""

from collections.abc import Callable
from dataclasses import dataclass

from gauss.rotors.friction_links import OneWayClutch
from gauss.rotors.links import GearPair, ShaftLink, TorsionSpring
from gauss.rotors.mechanics import link_kinematics
from gauss.rotors.reduced import ReducedNetwork
from gauss.scene import Coupling, Drive, ElasticLink, Freewheel, JointLink, LossyGear


@dataclass(frozen=True)
class SlippingLink(JointLink):
    """Clutch or friction drive between two joints."""

    ratio: float
    link: ShaftLink  # link that determines its torques
    ends: Callable  # (t, motion) → :class:`LinkKinematics`

    @property
    def what(self) -> str:
        """Kind and name, for messages."""
        return self.link.what

    @property
    def sticks(self) -> bool:  # type: ignore[override]  # constant in other kinds
        """Whether it can stick."""
        return self.link.dry

    @property
    def loses(self) -> bool:
        """Whether it has an efficiency."""
        return self.link.lossy

    @property
    def efficiency(self) -> float:
        """Efficiency η of the link."""
        return self.link.efficiency

    @property
    def back_efficiency(self) -> float:
        """Back efficiency of the link."""
        return self.link.back_efficiency

    def bounds(self, t: float) -> tuple[float, float]:
        """Least and largest torque while it sticks [N m]."""
        return self.link.bounds(t)

    def effort(self, sign):
        """Q_em of the link; where it can stick the driver leads by the sign of the torque."""
        return lambda t, motion: self.link.effort(self.ends(t, motion), sign)


def elements_of(reduced: ReducedNetwork, b: int, joints: dict[str, str]) -> list:
    """Elements of a scene that are equivalent to a link, for given joints of the shafts."""
    link = reduced.links[b]
    ends = link.name, joints[link.driven], joints[link.driver]
    if isinstance(link, GearPair):
        if link.lossy or link.slip:
            return [LossyGear(*ends, link.ratio, link.efficiency, link.back_efficiency, link.slip)]
        return [Coupling(*ends, link.rate)]
    if isinstance(link, OneWayClutch):
        return [Freewheel(*ends, link.ratio)]
    if isinstance(link, TorsionSpring):
        p, d = reduced.driver[b], reduced.driven[b]
        turned = reduced.angle[p] / link.ratio - reduced.angle[d]  # joints count from the angles at the start
        return [ElasticLink(*ends, link.ratio, link.stiffness, link.damping, link.backlash, float(link.rest - turned))]
    slipping = SlippingLink(*ends, link.ratio, link, _ends_of(reduced, b, joints))
    return [slipping] if link.dry or link.lossy else _torques(slipping)


def _torques(slipping: SlippingLink) -> list[Drive]:
    """Torques of a link that never sticks and loses power by slip only: functions of the state."""
    law, shafts = slipping.effort(1), {slipping.driven: slipping.link.driven, slipping.driver: slipping.link.driver}

    def shared(factor: float) -> Callable:
        return lambda t, motion: factor * law(t, motion)

    return [
        Drive(f"{slipping.name} on {shafts[joint]}", joint, shared(factor)) for joint, factor in slipping.acts_on.items()
    ]


def _ends_of(reduced: ReducedNetwork, b: int, joints: dict[str, str]) -> Callable:
    """Function (t, motion) → relative kinematics of a link, for given joints of the shafts."""
    link, p, d = reduced.links[b], int(reduced.driver[b]), int(reduced.driven[b])
    names = {p: joints[link.driver], d: joints[link.driven]}

    def ends(t, motion):
        angle = {j: reduced.angle[j] + motion.coordinate(name) for j, name in names.items()}
        speed = {j: motion.rate(name) for j, name in names.items()}
        return link_kinematics(reduced, b, t, angle, speed)

    return ends
