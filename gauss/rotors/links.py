"""Links between two shafts: torque Q_em on the driven shaft, −f Q_em on the driver.

Ratio i = ω_driver/ω_driven at zero slip; i < 0 turns the shafts against each other. The torque factor f is 1/(i η) when
power flows from driver to driven, else η̄/i: the torque efficiencies η, η̄ do not contain the loss by slip
(Rotor chains, section 1).
"""

from dataclasses import dataclass
from typing import NamedTuple

from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.scene import Elastic, values
from gauss.scene.losses import checked_slip, keep_efficiencies, torque_factor


class LinkKinematics(NamedTuple):
    """Relative kinematics of the two shafts of a link."""

    t: Scalar  # time [s]
    twist: Scalar  # twist, lead: α_driver/i − α_driven, lead of the driver [rad], and its rate [rad/s]
    lead: Scalar
    v_d: Scalar  # v_d, v: speeds ω_driver and i ω_driven [rad/s]
    v: Scalar
    v_0: float  # speed below which a friction drive counts as at rest [rad/s]


@dataclass(frozen=True)
class ShaftLink:
    """Link of two shafts; a link without losses and friction unless a subclass has them.

    Parameters
    ----------
    name, driven, driver : str
        Name of the link and of its two shafts.
    ratio : float
        i = ω_driver/ω_driven at zero slip.
    """

    name: str
    driven: str
    driver: str
    ratio: float = 1.0

    kind = "link"  # in messages; not annotated: no field

    @property
    def efficiency(self) -> float:
        """Efficiency η of torque."""
        return 1.0

    @property
    def back_efficiency(self) -> float:
        """Efficiency η̄ of torque when the driven shaft drives."""
        return 1.0

    @property
    def dry(self) -> bool:
        """Whether it is set-valued: sticks at zero slip, or slips."""
        return False

    @property
    def backlash(self) -> float:
        """Backlash [rad], referred to the driven shaft."""
        return 0.0

    @property
    def corners(self) -> tuple[float, ...]:
        """Times at which its data have a corner [s]."""
        return ()

    def __post_init__(self) -> None:
        """Check every value."""
        values.keep(self, ratio=values.number(self.ratio, f"{self.what}: ratio", "1"))
        if self.ratio == 0:
            raise SceneError(f"{self.what}: ratio: expected ω_driver/ω_driven other than 0.")
        if self.driven == self.driver:
            raise SceneError(f"{self.what}: driven and driver are both {self.driven!r}; a link joins two shafts.")

    @property
    def what(self) -> str:
        """Kind and name, for messages."""
        return f"{self.kind} {values.text(self.name, 'name of a link')!r}"

    def factor(self, forward: bool) -> float:
        """Torque factor f: torque taken from the driver over torque given to the driven shaft [1]."""
        return torque_factor(self, forward)

    @property
    def lossy(self) -> bool:
        """Whether f depends on the direction of the power."""
        return self.efficiency != 1.0 or self.back_efficiency != 1.0

    def effort(self, ends: LinkKinematics, state: Scalar) -> Scalar:
        """Q_em [N m]; ``state``: sign of the slip of dry links, 0 where they stick; backlash side of springs."""
        return 0.0

    def heat(self, ends: LinkKinematics, effort: Scalar, state: Scalar) -> Scalar:
        """Power lost between the shafts by slip or damping [W]."""
        return effort * ends.lead

    def bounds(self, t: float) -> tuple[float, float]:
        """Least and largest Q_em while it sticks [N m]."""
        return 0.0, 0.0


@dataclass(frozen=True)
class GearPair(ShaftLink):
    """Gears, chain, toothed belt, belt of constant slip: the constraint i ω_driven = (1 − ε) ω_driver.

    Parameters
    ----------
    efficiency : float
        η of torque, 0 < η ≤ 1.
    back_efficiency : float, optional
        η̄ when the driven shaft drives; 0 is self-locking; max(0, 2 − 1/η) when not given, at most 1 − ε.
    slip : float
        ε, constant.

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> gear = fan.gear("gear", driven=wheel, driver=motor, ratio=2.0, efficiency=0.96)
    >>> drive = fan.torque(motor, rotors.Linear(stiffness=2.0, omega_0=150.0))
    >>> load = fan.torque(wheel, rotors.Quadratic(0.01))
    >>> gear.ratio, gear.efficiency
    (2.0, 0.96)
    >>> rotors.snapshot(fan, speeds=[10.0, 5.0]).torques.round(3)
    array([304.181])
    """

    kind = "gear"
    efficiency: float = 1.0
    back_efficiency: float = None  # type: ignore[assignment]  # a float after __post_init__
    slip: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        super().__post_init__()
        values.keep(self, slip=checked_slip(self.slip, self.what))
        keep_efficiencies(self, 1.0 - self.slip)

    @property
    def rate(self) -> float:
        """K = ω_driven/ω_driver = (1 − ε)/i."""
        return (1.0 - self.slip) / self.ratio


@dataclass(frozen=True)
class TorsionSpring(Elastic, ShaftLink):
    """Elastic shaft, belt or coupling: Q_em = k z + d ż, z the twist beyond the backlash.

    With backlash ``state`` is the backlash side in contact (−1, 1), 0 for none. Contact is unilateral: torques only press.

    Parameters
    ----------
    stiffness, damping : float
        k [N m/rad] and d [N m s/rad], referred to the driven shaft.
    backlash : float
        Backlash from side to side [rad], referred to the driven shaft.
    rest : float
        Twist α_driver/i − α_driven without torque, in the middle of the backlash [rad].

    Examples
    --------
    >>> from gauss import rotors
    >>> fan = rotors.Network("fan")
    >>> motor = fan.shaft("motor", inertia=0.1)
    >>> wheel = fan.shaft("wheel", inertia=0.5)
    >>> spring = fan.spring("coupling", wheel, motor, stiffness=200.0, damping=0.5, backlash=0.01)
    >>> spring.stiffness, spring.backlash
    (200.0, 0.01)
    """

    kind = "torsion spring"
    stiffness: float = 0.0
    damping: float = 0.0
    backlash: float = 0.0
    rest: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        super().__post_init__()
        self._keep_elastic()

    def contact_torque(self, ends: LinkKinematics, state: Scalar) -> Scalar:
        """Torque in contact [N m]."""
        return self.side_force(ends.twist, ends.lead, state)

    def effort(self, ends: LinkKinematics, state: Scalar) -> Scalar:
        """Q_em of spring and damper [N m]."""
        return self.contact_torque(ends, state) * state * state if self.backlash else self.contact_torque(ends, 0.0)

    def heat(self, ends: LinkKinematics, effort: Scalar, state: Scalar) -> Scalar:
        """Power lost in the damper [W]."""
        lost = self.damping * ends.lead * ends.lead
        return lost * state * state if self.backlash else lost

    def energy(self, twist: Scalar, state: Scalar) -> Scalar:
        """Elastic energy [J]."""
        touching = state * state if self.backlash else 1.0
        return self.stored(twist, state if self.backlash else 0.0) * touching
