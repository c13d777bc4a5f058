"""Rotor network: shafts, links and torques, added by builder methods and checked at once."""

from dataclasses import dataclass, field

from gauss.errors import SceneError, did_you_mean
from gauss.rotors.elements import Shaft, Torque
from gauss.rotors.friction_links import FrictionClutch, FrictionDrive, OneWayClutch, TorqueLimiter
from gauss.rotors.links import GearPair, ShaftLink, TorsionSpring
from gauss.scene import values
from gauss.scene.builder import name_of


@dataclass(frozen=True)
class Network:
    """Shafts, links between them and torques on them.

    Parameters
    ----------
    name : str
        Name of the network.

    Attributes
    ----------
    shafts, links, torques : dict
        Elements by name; the methods fill them.

    Examples
    --------
    >>> from gauss.rotors import Linear, Network
    >>> network = Network("fan")
    >>> motor, fan = network.shaft("motor", 0.1), network.shaft("fan", 0.8)
    >>> network.gear("belt", driven=fan, driver=motor, ratio=2.0, efficiency=0.97).rate
    0.5
    >>> network.torque(motor, Linear(stiffness=0.5, omega_0=150.0)).name
    'torque on motor'
    """

    name: str = "network"
    shafts: dict[str, Shaft] = field(default_factory=dict)
    links: dict[str, ShaftLink] = field(default_factory=dict)
    torques: dict[str, Torque] = field(default_factory=dict)

    def __post_init__(self):
        """Check the name."""
        values.text(self.name, "name of the network")

    def add(self, element):
        """Add a Shaft, a link or a Torque and return it.

        Raises
        ------
        SceneError
            If its name is taken, or a shaft that it refers to does not exist.
        """
        place: dict
        shafts: tuple[str, ...] = ()
        if isinstance(element, Shaft):
            place, kind = self.shafts, "shaft"
        elif isinstance(element, ShaftLink):
            place, kind, shafts = self.links, "link", (element.driven, element.driver)
        elif isinstance(element, Torque):
            place, kind, shafts = self.torques, "torque", (element.shaft,)
        else:
            raise SceneError(f"expected a Shaft, a link or a Torque, got {element!r}.")
        if element.name in place:
            raise SceneError(f"{kind} {element.name!r}: the name is taken; choose another.")
        for shaft in shafts:
            if shaft not in self.shafts:
                raise SceneError(f"{kind} {element.name!r}: no shaft {shaft!r}. {did_you_mean(shaft, self.shafts)}")
        place[element.name] = element
        return element

    def shaft(self, name: str, inertia: float, speed: float | None = None, angle: float = 0.0) -> Shaft:
        """Add a rotor; see :class:`Shaft`."""
        return self.add(Shaft(name, inertia, speed, angle))

    def torque(self, shaft, law, *, name: str | None = None, begin=None, until=None, role=None, breaks=()) -> Torque:
        """Load or drive a shaft; see :class:`Torque`."""
        shaft = name_of(shaft)
        return self.add(Torque(name or self.fresh(f"torque on {shaft}"), shaft, law, begin, until, role, breaks))

    def gear(self, name: str, driven, driver, ratio: float, **options) -> GearPair:
        """Bind the speeds of two shafts; see :class:`GearPair`."""
        return self.add(GearPair(name, name_of(driven), name_of(driver), ratio, **options))

    def friction_drive(self, name: str, driven, driver, ratio: float, curve, **options) -> FrictionDrive:
        """Drive a shaft by traction; see :class:`FrictionDrive`."""
        return self.add(FrictionDrive(name, name_of(driven), name_of(driver), ratio, curve, **options))

    def spring(self, name: str, driven, driver, ratio: float = 1.0, **options) -> TorsionSpring:
        """Join two shafts by a torsion spring and damper, with or without backlash; see :class:`TorsionSpring`."""
        return self.add(TorsionSpring(name, name_of(driven), name_of(driver), ratio, **options))

    def clutch(self, name: str, driven, driver, torque, **options) -> FrictionClutch:
        """Join two shafts by a friction clutch; see :class:`FrictionClutch`."""
        return self.add(FrictionClutch(name, name_of(driven), name_of(driver), torque=torque, **options))

    def torque_limiter(self, name: str, driven, driver, torque: float, **options) -> TorqueLimiter:
        """Join two shafts by a slipping hub; see :class:`TorqueLimiter`."""
        return self.add(TorqueLimiter(name, name_of(driven), name_of(driver), torque=torque, **options))

    def one_way(self, name: str, driven, driver, **options) -> OneWayClutch:
        """Join two shafts by a freewheel; see :class:`OneWayClutch`."""
        return self.add(OneWayClutch(name, name_of(driven), name_of(driver), **options))

    def fresh(self, name: str) -> str:
        """Name of a torque that is not taken."""
        count, candidate = 1, name
        while candidate in self.torques:
            count += 1
            candidate = f"{name} {count}"
        return candidate

    def require_shaft(self, name) -> str:
        """Return the name of a shaft that exists, or raise a SceneError that names the shafts."""
        name = name_of(name)
        if name not in self.shafts:
            raise SceneError(f"no shaft {name!r} in {self.name!r}. {did_you_mean(str(name), self.shafts)}")
        return name
