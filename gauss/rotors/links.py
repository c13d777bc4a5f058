"""Links between two shafts. Each says what torque it gives to the driven shaft, Q_em; the driver feels −f Q_em.

Ratio i = ω_driver/ω_driven at zero slip; i < 0 turns the shafts against each other. The torque factor f is 1/(i η) when
power flows from driver to driven, else η̄/i: the torque efficiencies η, η̄ do not contain the loss by slip
(Rotor chains, section 1).
"""

from dataclasses import dataclass
from typing import NamedTuple

from gauss.codegen import Scalar
from gauss.errors import SceneError
from gauss.rotors.interpolant import Interpolant, points
from gauss.rotors.traction import as_curve, symmetric_slip
from gauss.scene import Elastic, values
from gauss.scene.losses import checked_slip, keep_efficiencies, torque_factor


class Ends(NamedTuple):
    """Where the two shafts of a link are.

    Attributes
    ----------
    t : float
        Time [s].
    twist, lead : float
        α_driver/i − α_driven [rad], by which the driver is ahead, and its rate [rad/s].
    v_d, v : float
        Speeds ω_driver and i ω_driven [rad/s].
    v_0 : float
        Speed below which a friction drive counts as at rest [rad/s].
    """

    t: Scalar
    twist: Scalar
    lead: Scalar
    v_d: Scalar
    v: Scalar
    v_0: float


@dataclass(frozen=True)
class Link:
    """What all links share.

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

    # Answers of a link without loss and friction; kinds that differ say so.
    efficiency = 1.0
    back_efficiency = 1.0
    dry = False  # whether it can hold its shafts together, and let them slip
    backlash = 0.0
    corners = ()  # times [s] at which its data have a corner

    def __post_init__(self):
        """Check every value."""
        object.__setattr__(self, "ratio", values.number(self.ratio, f"{self.what}: ratio", "1"))
        if self.ratio == 0:
            raise SceneError(f"{self.what}: ratio: expected ω_driver/ω_driven other than 0.")
        if self.driven == self.driver:
            raise SceneError(f"{self.what}: driven and driver are both {self.driven!r}; a link joins two shafts.")

    @property
    def what(self) -> str:
        """Kind and name, for messages."""
        return f"{type(self).__name__} {values.text(self.name, 'name of a link')!r}"

    def factor(self, forward: bool) -> float:
        """f: torque taken from the driver over torque given to the driven shaft."""
        return torque_factor(self, forward)

    @property
    def lossy(self) -> bool:
        """Whether f depends on the direction of the power."""
        return self.efficiency != 1.0 or self.back_efficiency != 1.0

    def effort(self, ends: Ends, state):
        """Q_em [N m] from where the shafts are; ``state`` is the sign of ``lead`` for dry links, 0 where they hold."""
        return 0.0

    def heat(self, ends: Ends, effort, state):
        """Power lost between the shafts by slip or damping [W]."""
        return effort * ends.lead

    def bounds(self, t: float) -> tuple[float, float]:
        """Least and largest Q_em that it holds without slip [N m]."""
        return 0.0, 0.0


@dataclass(frozen=True)
class Gear(Link):
    """Gears, chain, toothed belt; a belt of constant slip: the speeds are bound, i ω_driven = (1 − ε) ω_driver.

    Parameters
    ----------
    efficiency : float
        η of torque, 0 < η ≤ 1.
    back_efficiency : float, optional
        η̄ when the driven shaft drives; 0 locks itself; max(0, 2 − 1/η) when not given, at most 1 − ε.
    slip : float
        ε, constant.
    """

    efficiency: float = 1.0
    back_efficiency: float | None = None
    slip: float = 0.0

    def __post_init__(self):
        """Check every value."""
        super().__post_init__()
        object.__setattr__(self, "slip", checked_slip(self.slip, self.what))
        keep_efficiencies(self, 1.0 - self.slip)

    @property
    def rate(self) -> float:
        """K = ω_driven/ω_driver = (1 − ε)/i."""
        return (1.0 - self.slip) / self.ratio


@dataclass(frozen=True)
class FrictionDrive(Link):
    """Friction drive that slips by its traction characteristic.

    Parameters
    ----------
    curve : Hyperbola, Measured, Characteristic, (A, B, C), dict or callable
        Torque on the driven shaft [N m] over the slip; see :mod:`gauss.rotors.traction`.
    efficiency, back_efficiency : float
        η and η̄ as of a :class:`Gear`; the loss by slip comes on top.
    largest_slip : float, optional
        End of the range that the curve was fitted in; leaving it is reported.
    """

    curve: object = None
    efficiency: float = 1.0
    back_efficiency: float | None = None
    largest_slip: float | None = None

    def __post_init__(self):
        """Check every value."""
        super().__post_init__()
        object.__setattr__(self, "curve", as_curve(self.curve, self.what))
        keep_efficiencies(self)
        if self.largest_slip is not None:
            limit = values.number(self.largest_slip, f"{self.what}: largest_slip", "1", positive=True)
            object.__setattr__(self, "largest_slip", limit)

    @property
    def dry(self) -> bool:
        """Whether it sticks at zero slip."""
        return self.curve.threshold > 0

    def effort(self, ends: Ends, state):
        """Q_em of the characteristic."""
        way = 1.0 if self.ratio > 0 else -1.0
        torque = way * self.curve(symmetric_slip(ends.v_d, ends.v, ends.v_0), way * state)
        return torque * state * state if self.dry else torque

    def bounds(self, t):
        """Hold up to the threshold."""
        return -self.curve.threshold, self.curve.threshold


@dataclass(frozen=True)
class TorsionSpring(Elastic, Link):
    """Elastic shaft, belt or coupling: Q_em = k z + d ż, z the twist beyond the play.

    With backlash ``state`` names the flank that touches (−1, 1) or is 0. Flanks never pull.

    Parameters
    ----------
    stiffness, damping : float
        k [N m/rad] and d [N m s/rad], referred to the driven shaft.
    backlash : float
        Play from flank to flank [rad], referred to the driven shaft.
    rest : float
        Twist α_driver/i − α_driven without torque, in the middle of the play [rad].
    """

    stiffness: float = 0.0
    damping: float = 0.0
    backlash: float = 0.0
    rest: float = 0.0

    def __post_init__(self):
        """Check every value."""
        super().__post_init__()
        self._keep_elastic()

    def flank(self, ends: Ends, state):
        """Torque [N m] if it touches."""
        return self.pressed(ends.twist, ends.lead, state)

    def effort(self, ends: Ends, state):
        """Q_em of spring and damper."""
        return self.flank(ends, state) * state * state if self.backlash else self.flank(ends, 0.0)

    def heat(self, ends: Ends, effort, state):
        """Power lost in the damper [W]."""
        lost = self.damping * ends.lead * ends.lead
        return lost * state * state if self.backlash else lost

    def energy(self, twist, state):
        """Elastic energy [J]."""
        touching = state * state if self.backlash else 1.0
        return self.stored(twist, state if self.backlash else 0.0) * touching


@dataclass(frozen=True)
class Clutch(Link):
    """Friction clutch: holds its shafts together up to static · torque, slips with ``torque``.

    Parameters
    ----------
    torque : float, dict or Interpolant
        Torque while it slips [N m]; a table {time [s], torque [N m]} of straight lines says how it is engaged.
    static : float
        Friction at rest over friction in slip, at least 1.
    """

    torque: object = None
    static: float = 1.0

    dry = True

    def __post_init__(self):
        """Check every value."""
        super().__post_init__()
        if isinstance(self.torque, dict):
            if set(self.torque) != {"time", "torque"}:
                raise SceneError(f"{self.what}: torque: a table has time [s] and torque [N m], got {sorted(self.torque)}.")
            time, torque = points(self.torque["time"], self.torque["torque"], self.what, "time", "s", "torque", "N m")
            if min(torque) < 0:
                raise SceneError(f"{self.what}: torque: no entry may be negative.")
            object.__setattr__(self, "torque", Interpolant(time, torque, smooth=False))
        elif not isinstance(self.torque, Interpolant):
            checked = values.number(self.torque, f"{self.what}: torque", "N m", non_negative=True)
            object.__setattr__(self, "torque", checked)
        static = values.number(self.static, f"{self.what}: static", "1", positive=True)
        if static < 1:
            raise SceneError(f"{self.what}: static: expected at least 1, got {static:g}; friction at rest is not smaller.")
        object.__setattr__(self, "static", static)

    @property
    def corners(self) -> tuple:
        """Times of the corners of its table [s]."""
        return self.torque.x if isinstance(self.torque, Interpolant) else ()

    def _slipping(self, t):
        return self.torque(t) if isinstance(self.torque, Interpolant) else self.torque

    def effort(self, ends: Ends, state):
        """Q_em while it slips."""
        return state * self._slipping(ends.t)

    def bounds(self, t):
        """Hold up to the static torque."""
        limit = self.static * float(self._slipping(t))
        return -limit, limit


@dataclass(frozen=True)
class TorqueLimiter(Clutch):
    """Slipping hub: a clutch that is always engaged.

    Parameters
    ----------
    name : str
        Name of the link.
    driven, driver : str
        Shafts.
    ratio : float
        i, speed of the driver over speed of the driven shaft.
    torque : float, dict or Interpolant
        Torque while it slips [N m].
    static : float
        Friction at rest over friction in slip, at least 1.
    """


@dataclass(frozen=True)
class OneWayClutch(Link):
    """Freewheel: the driver takes the driven shaft along and is overrun by it freely.

    Parameters
    ----------
    name : str
        Name of the link.
    driven, driver : str
        Shafts.
    ratio : float
        i, speed of the driver over speed of the driven shaft.
    """

    dry = True

    def bounds(self, t):
        """Push without limit, never pull."""
        return 0.0, float("inf")
